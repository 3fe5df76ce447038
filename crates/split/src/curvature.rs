//! Second derivatives of a term.

use proxel_linalg::sparse::SymPattern;

/// What stands in for the Hessian of an element: itself, made positive semidefinite, or a simpler matrix that is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// Nothing: the true Hessian.
    #[default]
    None,
    /// Negative eigenvalues become 0 (Teran et al. 2005).
    Clamp,
    /// Negative eigenvalues become positive (Chen et al. 2024).
    Absolute,
    /// The proxy of scalable locally injective mappings (Rabinovich et al. 2017), |W dF|^2 with W = U diag(w) U^T and
    /// w_i^2 = psi_i / (s_i - 1): reweighted least squares.
    Reweighted,
    /// The Killing energy |grad v + (grad v)^T|^2 of a step v on the deformed element (Claici et al. 2017), scaled such that
    /// at rest it is the Hessian of an energy without volume term.
    Killing,
}

/// The second derivatives of a [`crate::Term`]'s energy E = sum g(c(Dx)), which does not depend on the coupling.
///
/// Positions, steps and gradients are flat, `dim` numbers a node; steps, like gradients, cover the free nodes.
pub trait Curvature {
    /// Finds the places of the elements' blocks in matrices over `pattern`, which has an entry for each pair of free nodes of
    /// an element.
    fn prepare(&mut self, pattern: &SymPattern);

    /// Adds d^2 E / dx^2 to the values of a [`proxel_linalg::sparse::BlockMatrix`] over the prepared pattern, without
    /// which this does nothing.
    fn add_hessian(&mut self, x: &[f64], projection: Projection, values: &mut [f64]);

    /// Adds the gradient at x of 1/2 sum w^2 |Dx - T|^2 to `grad`, T being what F becomes under a rotation-aware reading of
    /// a step: with F = U S V^T and dF = U h V^T,
    ///
    /// ```text
    /// T = U exp(omega) (S + h - omega S) V^T,    omega_ij = (h_ij - h_ji) / (s_i + s_j)
    /// ```
    ///
    /// omega turns the element, and what is left of h, a symmetric matrix, stretches it. T = F + dF up to second order.
    fn add_warped_gradient(&mut self, x: &[f64], step: &[f64], grad: &mut [f64]);
}
