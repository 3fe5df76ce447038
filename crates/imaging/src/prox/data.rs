//! What pixels are measured against.

use super::Pointwise;
use proxel_split::DualMap;
use std::ops::Range;
use std::sync::Arc;

/// A number for each pixel and channel, in rows of `row` numbers as fields are laid out; pixels are counted over rows of `width`.
#[derive(Clone, Debug)]
pub struct Observed {
    values: Arc<Vec<f64>>,
    width: usize,
    row: usize,
}

impl Observed {
    /// Laid out as a field of the grid.
    pub fn new(grid: crate::Grid, values: Vec<f64>) -> Self {
        Observed { values: Arc::new(values), width: grid.width, row: grid.row_len() }
    }

    /// Those of a whole row of pixels.
    pub(super) fn of(&self, pixels: &Range<usize>) -> &[f64] {
        let row = pixels.start / self.width.max(1);
        &self.values[row * self.row..(row + 1) * self.row]
    }
}

/// g(z) = sum lambda_k (z_k - f_k)^2, the weight lambda_k of each number given: 0 where nothing was measured, such as beyond
/// the border of the image, in the gaps of an inpainting, or between samples.
#[derive(Clone, Debug)]
pub struct Squares {
    /// f
    pub observed: Observed,
    /// lambda_k
    pub lambda: Observed,
    /// Their largest.
    pub most: f64,
}

impl Pointwise for Squares {
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let mut value = 0.0;
        for ((v, f), l) in v.iter_mut().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels)) {
            *v = (weight2 * *v + 2.0 * l * f) / (weight2 + 2.0 * l);
            value += l * (*v - f) * (*v - f);
        }
        value
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let pairs = z.iter().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels));
        pairs.map(|((z, f), l)| l * (z - f) * (z - f)).sum()
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        for ((z, f), l) in z.iter_mut().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels)) {
            *z = 2.0 * l * (*z - f);
        }
    }

    fn dual_map(&self) -> DualMap {
        // Affine as a function of z; where lambda is 0, u is 0 and says nothing about z.
        DualMap::Smooth
    }

    fn force(&self) -> f64 {
        2.0 * self.most
    }

    /// 0, or infinite where a force acts on what was not measured.
    fn gauge(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let acts = q.iter().zip(self.lambda.of(&pixels)).any(|(q, l)| *l == 0.0 && *q != 0.0);
        Some(if acts { f64::INFINITY } else { 0.0 })
    }

    /// sum q f + q^2 / (4 lambda)
    fn conjugate(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let numbers = q.iter().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels));
        Some(numbers.filter(|(_, l)| **l > 0.0).map(|((q, f), l)| q * f + q * q / (4.0 * l)).sum())
    }
}

/// The set [low, high] of every number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

impl Pointwise for Interval {
    fn prox(&self, _: Range<usize>, v: &mut [f64], _: f64) -> f64 {
        v.iter_mut().for_each(|v| *v = v.max(self.low).min(self.high));
        0.0
    }

    fn value(&self, _: Range<usize>, _: &[f64]) -> f64 {
        0.0
    }

    fn gradient(&self, _: Range<usize>, z: &mut [f64]) {
        z.fill(0.0);
    }

    fn violation(&self, _: Range<usize>, z: &[f64]) -> f64 {
        z.iter().map(|z| (self.low - z).max(z - self.high).max(0.0)).fold(0.0, f64::max)
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn force(&self) -> f64 {
        0.0
    }
}
