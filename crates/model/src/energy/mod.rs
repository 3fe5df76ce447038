//! Energy densities over principal stretches, and their proximal operators.
//!
//! An [`Energy`] of dimension K is an isotropic density psi(s) of the K principal stretches s of a deformation gradient,
//! that is of its signed singular values: s_1 >= .. >= |s_K|, the last one carrying the sign of det F. It is symmetric
//! in its arguments, so no function here asks for that order. Units: stretches have none, psi has those of the
//! material's moduli (energy per rest volume).
//!
//! All is generic over [`Real`]: one text serves single numbers and eight lanes. One file is one energy, all of them are
//! listed in [`for_each_energy!`](crate::for_each_energy), and the tests of derivatives, of the proximal operators and of
//! the lanes run over that list.
//!
//! ```
//! use proxel_model::energy::{Energy, Lame, NeoHookean};
//!
//! let lame = Lame::from_young_poisson(1e7, 0.45)?;
//! let rubber = <NeoHookean as Energy<3>>::from_lame(&lame);
//! let k = Energy::<3>::slope_stiffness(&rubber); // w^2 / V
//! let p = rubber.prox([1.2, 1.0, -0.4], k, [1.0; 3]); // an inverted target
//! assert!(p.converged && p.s.iter().all(|s| *s > 0.0));
//! # Ok::<(), proxel_model::energy::MaterialError>(())
//! ```
//!
//! To add an energy, write its file with `impl<const K: usize> Energy<K>`, declare it below, and add its line to the list.

mod box_prox;
mod dispatch;
mod lame;
mod newton;
mod products;
mod quadratic;
mod symmetric;

mod arap;
mod corotated;
mod fixed_corotated;
mod limited;
mod mips;
mod neo_hookean;
mod relaxed_symmetric_dirichlet;
mod spring;
mod stable_neo_hookean;
mod stvk;
mod symmetric_dirichlet;
mod symmetric_gradient;

pub use arap::Arap;
pub use corotated::Corotated;
pub use dispatch::{EnergyVisitor, UnknownEnergy, names, visit_1d, visit_2d, visit_3d};
pub use fixed_corotated::FixedCorotated;
pub use lame::{Lame, MaterialError};
pub use limited::{LimitError, Limited};
pub use mips::Mips;
pub use neo_hookean::NeoHookean;
pub use newton::newton_prox;
pub use relaxed_symmetric_dirichlet::RelaxedSymmetricDirichlet;
pub use spring::Spring;
pub use stable_neo_hookean::StableNeoHookean;
pub use stvk::StVenantKirchhoff;
pub use symmetric::largest_eigenvalue;
pub use symmetric_dirichlet::SymmetricDirichlet;
pub use symmetric_gradient::SymmetricGradient;

use proxel_linalg::simd::Real;

/// The list of all energies: `for_each_energy!(m)` expands to `m! { Type [1 2 3] .. }`, each type followed by the
/// dimensions K in which it implements [`Energy<K>`]. An energy becomes known to the command line, to the element
/// batches and to the tests by its line here.
#[macro_export]
macro_rules! for_each_energy {
    ($callback:ident) => {
        $callback! {
            NeoHookean [1 2 3]
            StableNeoHookean [1 2 3]
            StVenantKirchhoff [1 2 3]
            Corotated [1 2 3]
            FixedCorotated [1 2 3]
            Arap [1 2 3]
            SymmetricDirichlet [1 2 3]
            SymmetricGradient [1 2 3]
            Mips [2]
            Spring [1]
        }
    };
}

/// What a proximal operator returns.
#[derive(Clone, Copy, Debug)]
pub struct Prox<T: Real, const K: usize> {
    /// The minimiser.
    pub s: [T; K],
    /// Whether it meets the tolerance stated at [`Energy::prox`].
    pub converged: T::Mask,
}

/// The quotients that the Hessian of psi in the entries of F needs besides the Hessian in the stretches: eigenvalues of
/// its twist and flip modes (Smith, de Goes and Kim, "Analytic eigensystems for isotropic distortion energies", 2019).
/// Both arrays are symmetric with a diagonal of 0.
#[derive(Clone, Copy, Debug)]
pub struct DividedDifferences<T, const K: usize> {
    /// `[i][j]`: (psi_i - psi_j) / (s_i - s_j), where s_i = s_j its limit psi_ii - psi_ij.
    pub minus: [[T; K]; K],
    /// `[i][j]`: (psi_i + psi_j) / (s_i + s_j), where s_i = -s_j its limit psi_ii + psi_ij if there is one, otherwise
    /// an infinity: energies of |F - R| have a kink there.
    pub plus: [[T; K]; K],
}

impl<T: Real, const K: usize> DividedDifferences<T, K> {
    /// From `f(i, j) -> (minus, plus)`, asked for i < j.
    #[inline(always)]
    pub fn from_pairs(mut f: impl FnMut(usize, usize) -> (T, T)) -> Self {
        let mut d = DividedDifferences { minus: [[T::zero(); K]; K], plus: [[T::zero(); K]; K] };
        for i in 0..K {
            for j in i + 1..K {
                let (minus, plus) = f(i, j);
                d.minus[i][j] = minus;
                d.minus[j][i] = minus;
                d.plus[i][j] = plus;
                d.plus[j][i] = plus;
            }
        }
        d
    }
}

/// A density psi over K principal stretches, K = 1, 2 or 3.
///
/// psi is twice continuously differentiable almost everywhere in its domain, bounded below, and 0 with zero gradient at
/// rest, s = (1, .., 1). Implementations mark all methods `#[inline(always)]`: they are compiled into the lanes' kernels.
pub trait Energy<const K: usize>: Clone + Send + Sync + 'static {
    /// Its name on the command line and in files.
    const NAME: &'static str;
    /// Whether psi is finite only where all stretches are positive, and grows without bound towards that border.
    const BARRIER: bool = false;
    /// Whether [`Energy::prox`] admits only s >= 0, though psi may be finite elsewhere.
    const PROX_POSITIVE: bool = Self::BARRIER;
    /// Whether psi is a sum of convex functions of one stretch each; a prox within a box is then the prox, clamped.
    const SEPARABLE: bool = false;

    /// Whether psi is k/2 sum (s_i - 1)^2 with k > 0.
    const QUADRATIC: bool = false;

    /// The energy of a material. What the moduli mean to an energy that does not stem from elasticity is told at each.
    fn from_lame(lame: &Lame) -> Self;

    /// psi(s); +inf outside the domain.
    fn value<T: Real>(&self, s: [T; K]) -> T;

    /// psi(s) without the hard limits of [`Energy::limits`]: what gradient and Hessian belong to.
    #[inline(always)]
    fn smooth_value<T: Real>(&self, s: [T; K]) -> T {
        self.value(s)
    }

    /// The interval that every stretch has to stay in, where psi is infinite outside one: see [`Limited`].
    fn limits(&self) -> Option<(f64, f64)> {
        None
    }

    /// Bounds over the deformation gradients F with psi at most `level`, or none: (h, f) such that |P - P'| <= h |F - F'| for
    /// the stresses P = d psi / dF at any two points of their convex hull, all of which is in the domain, and |P|^2 <= f psi
    /// on the set itself.
    fn level_bound(&self, level: f64) -> Option<(f64, f64)> {
        let _ = level;
        None
    }

    /// psi_i = d psi / d s_i.
    fn gradient<T: Real>(&self, s: [T; K]) -> [T; K];

    /// psi_ij = d^2 psi / d s_i d s_j.
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K];

    /// The quotients (psi_i -+ psi_j) / (s_i -+ s_j) in forms that do not cancel.
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K>;

    /// argmin over s of psi(s) + k/2 |s - v|^2, k > 0 (k = w^2 / V of the splitting), over s >= 0 where
    /// [`Energy::PROX_POSITIVE`]. `warm` is a guess of the result, such as that of the iteration before; any value will do.
    ///
    /// Where the objective is not convex, the result is a local minimum with an objective no larger than at `warm` and
    /// at `v` (if they are admissible); energies that have a better rule tell it.
    ///
    /// Converged means that the gradient of the objective (its projection, with a bound) is at most about
    /// 1e-10 k max(|v|, 1), or what rounding leaves of it where psi is much stiffer than k. A lane's result does not
    /// depend on the other lanes.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; K], k: T, warm: [T; K]) -> Prox<T, K> {
        newton_prox(self, v, k, newton::better_start(self, &v, k, &warm), T::zero().le(T::zero()))
    }

    /// The stiffness that psi shows at s: the largest eigenvalue of its Hessian there, negative ones counting as 0. W(20)
    /// Relative accuracy 1e-8.
    #[inline(always)]
    fn effective_stiffness<T: Real>(&self, s: [T; K]) -> T {
        largest_eigenvalue(&self.hessian(s)).max(T::zero())
    }

    /// The largest eigenvalue of the Hessian at rest. W(21)
    fn rest_stiffness(&self) -> f64 {
        self.effective_stiffness([1.0; K])
    }

    /// The least-squares slope of d psi / d s_1 over s_1 = .90, .91, .., 1.10, the other stretches being 1: the stiffness
    /// of Liu, Bouaziz and Kavan, "Quasi-Newton methods for real-time simulation of hyperelastic materials", 2017.
    fn slope_stiffness(&self) -> f64 {
        let (mut xy, mut xx) = (0.0, 0.0);
        for n in -10..=10 {
            let x = f64::from(n) / 100.0; // their mean is 0
            let mut s = [1.0; K];
            s[0] += x;
            xy += x * self.gradient(s)[0];
            xx += x * x;
        }
        xy / xx
    }

    /// The geometric mean of the largest and the smallest eigenvalue of the Hessian at rest: the penalty under which ADMM
    /// on a quadratic is fastest (Ghadimi, Teixeira, Shames and Johansson 2015). Near incompressibility it grows with the
    /// square root of the largest, which is that of [`Energy::rest_stiffness`].
    ///
    /// At rest all psi_ii are equal, and so are all psi_ij: the eigenvalues are psi_11 - psi_12 and psi_11 + (K - 1) psi_12.
    fn mean_stiffness(&self) -> f64 {
        let h = self.hessian([1.0; K]);
        let off = if K > 1 { h[0][K - 1] } else { 0.0 };
        ((h[0][0] - off) * ((K - 1) as f64).mul_add(off, h[0][0])).sqrt()
    }
}

#[cfg(test)]
mod tests;
