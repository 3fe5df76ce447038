//! Rayleigh damping in proportion to stiffness.

use proxel_linalg::sparse::{BlockMatrix, SparseError, SymPattern};
use proxel_split::{Potential, Problem, Projection};
use std::fmt;
use std::sync::Arc;

/// c/2 (x - X)^T K (x - X) over the free nodes, K the elastic Hessian at the start of a step, made positive semidefinite,
/// and X what velocities are measured from: (x - X) / tau. With c = beta / tau its force is -beta K v.
#[derive(Clone)]
pub(super) struct StiffnessDamping {
    matrix: Arc<BlockMatrix>,
    pairs: Arc<Vec<(u32, u32)>>, // of each slot
    factor: f64,
    anchor: Vec<f64>, // X, free nodes
}

impl fmt::Debug for StiffnessDamping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StiffnessDamping({} blocks, factor {})", self.pairs.len(), self.factor)
    }
}

impl StiffnessDamping {
    /// That of nothing, over a pattern.
    ///
    /// # Errors
    /// A pattern that is too large for blocks.
    pub fn none(pattern: &SymPattern) -> Result<Self, SparseError> {
        let mut pairs = vec![(0, 0); pattern.nnz()];
        for j in 0..pattern.n() {
            for i in pattern.column(j) {
                if let Some(slot) = pattern.slot(*i as usize, j) {
                    pairs[slot] = (*i, j as u32);
                }
            }
        }
        let matrix = Arc::new(BlockMatrix::new(pattern, 3)?);
        Ok(StiffnessDamping { matrix, pairs: Arc::new(pairs), factor: 0.0, anchor: vec![0.0; 3 * pattern.n()] })
    }

    /// With the elastic Hessian at x of terms that have found their places in the pattern.
    ///
    /// # Errors
    /// A pattern that is too large for blocks.
    pub fn at(
        &self,
        pattern: &SymPattern,
        problem: &mut Problem,
        x: &[f64],
        factor: f64,
        anchor: Vec<f64>,
    ) -> Result<Self, SparseError> {
        let mut matrix = BlockMatrix::new(pattern, 3)?;
        for term in &mut problem.terms {
            if let Some(curvature) = term.curvature() {
                curvature.add_hessian(x, Projection::Clamp, matrix.values_mut());
            }
        }
        Ok(StiffnessDamping { matrix: Arc::new(matrix), pairs: self.pairs.clone(), factor, anchor })
    }
}

impl Potential for StiffnessDamping {
    fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64 {
        if self.factor == 0.0 {
            return 0.0;
        }
        let d: Vec<f64> = x.iter().zip(&self.anchor).map(|(x, a)| self.factor * (x - a)).collect();
        let mut force = vec![0.0; d.len()];
        // Lengths are those of the pattern, so that this cannot fail.
        if self.matrix.multiply(&d, &mut force).is_err() {
            return f64::NAN;
        }
        if let Some(grad) = grad {
            grad.iter_mut().zip(&force).for_each(|(g, f)| *g += f);
        }
        proxel_split::vector::dot(&d, &force) / (2.0 * self.factor)
    }

    fn n(&self) -> usize {
        self.anchor.len() / 3
    }

    fn has_hessian(&self) -> bool {
        true
    }

    fn is_convex(&self) -> bool {
        true
    }

    fn for_each_block(&self, _: &[f64], give: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        for ((i, j), block) in self.pairs.iter().zip(self.matrix.values().as_chunks::<9>().0) {
            let row = |r: usize| [0, 1, 2].map(|c| self.factor * block[3 * r + c]);
            give(*i as usize, *j as usize, [row(0), row(1), row(2)]);
        }
    }
}
