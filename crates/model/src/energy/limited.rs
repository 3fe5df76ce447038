//! Hard limits of the principal stretches: an energy inside a box, nothing outside.

use super::box_prox::{box_prox, clamp, inside};
use super::{DividedDifferences, Energy, Lame, Prox};
use proxel_linalg::simd::Real;

/// psi(s) where low <= s_i <= high for all i, +inf elsewhere: strain limiting as a set, W section 7.1 (Figure 8).
///
/// Its gradient, Hessian and divided differences are those of psi, which they are inside the box; what happens at its
/// border only the prox knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limited<E> {
    energy: E,
    low: f64,
    high: f64,
}

/// Limits between which there is no state of rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitError {
    /// The least stretch asked for.
    pub low: f64,
    /// The largest.
    pub high: f64,
}

impl std::fmt::Display for LimitError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let LimitError { low, high } = self;
        write!(f, "stretches cannot be limited to {low},{high}; give 0 < LO <= 1 <= HI with LO < HI, such as 0.95,1.05")
    }
}

impl std::error::Error for LimitError {}

impl<E> Limited<E> {
    /// `energy` with stretches limited to [low, high]; `high` may be infinite.
    ///
    /// # Errors
    /// [`LimitError`] unless 0 < low <= 1 <= high and low < high.
    pub fn new(energy: E, low: f64, high: f64) -> Result<Self, LimitError> {
        let sensible = low > 0.0 && low <= 1.0 && high >= 1.0 && low < high;
        if sensible { Ok(Limited { energy, low, high }) } else { Err(LimitError { low, high }) }
    }
}

impl<const K: usize, E: Energy<K>> Energy<K> for Limited<E> {
    const NAME: &'static str = E::NAME;
    const BARRIER: bool = E::BARRIER;
    const PROX_POSITIVE: bool = true;
    const SEPARABLE: bool = E::SEPARABLE;
    const QUADRATIC: bool = false;

    /// Without limits other than positive stretches; [`Limited::new`] sets them.
    fn from_lame(lame: &Lame) -> Self {
        Limited { energy: E::from_lame(lame), low: f64::MIN_POSITIVE, high: f64::INFINITY }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        T::select(inside(&s, self.low, self.high), self.energy.value(s), T::splat(f64::INFINITY))
    }

    #[inline(always)]
    fn smooth_value<T: Real>(&self, s: [T; K]) -> T {
        self.energy.smooth_value(s)
    }

    fn limits(&self) -> Option<(f64, f64)> {
        Some((self.low, self.high))
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; K]) -> [T; K] {
        self.energy.gradient(s)
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K] {
        self.energy.hessian(s)
    }

    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        self.energy.divided_differences(s)
    }

    /// A separable convex psi: its own prox, clamped, which is exact. Others: Newton's method within the box.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; K], k: T, warm: [T; K]) -> Prox<T, K> {
        if E::SEPARABLE {
            let free = self.energy.prox(v, k, warm);
            return Prox { s: clamp(&free.s, self.low, self.high), converged: free.converged };
        }
        box_prox(&self.energy, v, k, warm, self.low, self.high)
    }

    #[inline(always)]
    fn effective_stiffness<T: Real>(&self, s: [T; K]) -> T {
        self.energy.effective_stiffness(s)
    }

    fn rest_stiffness(&self) -> f64 {
        self.energy.rest_stiffness()
    }

    fn slope_stiffness(&self) -> f64 {
        self.energy.slope_stiffness()
    }

    fn mean_stiffness(&self) -> f64 {
        self.energy.mean_stiffness()
    }
}
