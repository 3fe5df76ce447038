//! Data with outliers.

use super::{Observed, Pointwise};
use proxel_split::DualMap;
use std::ops::Range;

/// g(z) = sum lambda_k h(z_k - f_k), Huber's function without a factor 1/2 (Huber 1964):
///
/// ```text
/// h(r) = r^2              where |r| <= delta
///        2 delta |r| - delta^2   elsewhere
/// ```
///
/// Squares of small differences, absolute values of large ones: an outlier pulls with 2 lambda delta, however far it is off.
/// Convex, and its gradient is continuous. lambda_k as in [`super::Squares`].
#[derive(Clone, Debug)]
pub struct Huber {
    /// f
    pub observed: Observed,
    /// lambda_k
    pub lambda: Observed,
    /// Their largest.
    pub most: f64,
    /// delta > 0
    pub delta: f64,
}

impl Huber {
    /// h(r)
    fn of(&self, r: f64) -> f64 {
        let size = r.abs();
        if size <= self.delta { r * r } else { self.delta * (2.0 * size - self.delta) }
    }
}

impl Pointwise for Huber {
    /// With r = v - f: r w^2 / (w^2 + 2 lambda) where that is at most delta, else r - sign(r) 2 lambda delta / w^2.
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let mut value = 0.0;
        for ((v, f), l) in v.iter_mut().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels)) {
            let r = *v - f;
            let inner = r * weight2 / (weight2 + 2.0 * l);
            let r = if inner.abs() <= self.delta { inner } else { r - (2.0 * l * self.delta / weight2).copysign(r) };
            *v = f + r;
            value += l * self.of(r);
        }
        value
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let pairs = z.iter().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels));
        pairs.map(|((z, f), l)| l * self.of(z - f)).sum()
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        for ((z, f), l) in z.iter_mut().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels)) {
            *z = 2.0 * l * (*z - f).clamp(-self.delta, self.delta);
        }
    }

    fn dual_map(&self) -> DualMap {
        DualMap::Smooth
    }

    fn force(&self) -> f64 {
        2.0 * self.most * self.delta
    }

    /// The largest |q| over 2 lambda delta; infinite where a force acts on what was not measured.
    fn gauge(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let over = |(q, l): (&f64, &f64)| if *q == 0.0 { 0.0 } else { q.abs() / (2.0 * l * self.delta) };
        Some(q.iter().zip(self.lambda.of(&pixels)).map(over).fold(0.0, f64::max))
    }

    /// That of squares: beyond, g* is infinite.
    fn conjugate(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let numbers = q.iter().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels));
        Some(numbers.filter(|(_, l)| **l > 0.0).map(|((q, f), l)| q * f + q * q / (4.0 * l)).sum())
    }
}
