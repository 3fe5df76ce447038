//! Convolution with a point spread function.

use super::blur::Blur;
use super::fourier::Fourier;
use crate::{Grid, ImageError};
use proxel_split::{Potential, vector};
use realfft::num_complex::Complex;
use std::sync::Arc;

/// A point spread function: weights around a centre, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Psf {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Weights of sum 1.
    pub weights: Vec<f64>,
    /// Row and column of the centre.
    pub center: (usize, usize),
}

impl Psf {
    /// Divided by its sum. The centre is the middle pixel, floor(n/2) in both directions, where none is given.
    ///
    /// # Errors
    /// No weights, a sum of zero or less, a number that is not finite, a centre outside.
    pub fn new(
        width: usize,
        height: usize,
        weights: Vec<f64>,
        center: Option<(usize, usize)>,
    ) -> Result<Self, ImageError> {
        let refuse = |text: String| Err(ImageError(format!("point spread function: {text}")));
        if weights.is_empty() || width.checked_mul(height) != Some(weights.len()) {
            return refuse(format!("{} numbers for {width} x {height}", weights.len()));
        }
        if let Some(k) = weights.iter().position(|v| !v.is_finite()) {
            return refuse(format!("row {}, column {}: the value is {}", k / width, k % width, weights[k]));
        }
        let sum: f64 = weights.iter().sum();
        let size: f64 = weights.iter().map(|w| w.abs()).sum();
        // A sum that is rounding of its parts says nothing about their scale.
        if sum.is_nan() || sum <= 1e-12 * size {
            return refuse(format!("its sum is {sum}; it has to be positive, since weights are divided by it"));
        }
        let center = center.unwrap_or((height / 2, width / 2));
        if center.0 >= height || center.1 >= width {
            return refuse(format!(
                "the centre ({}, {}) is outside of {height} rows, {width} columns",
                center.0, center.1
            ));
        }
        Ok(Psf { width, height, weights: weights.iter().map(|w| w / sum).collect(), center })
    }

    /// By name: `gaussian:S`, `motion:LENGTH,ANGLE` or `disk:R`; none where the text begins otherwise.
    ///
    /// # Errors
    /// Numbers that are none, or as many as the name does not have; as the function of the name.
    pub fn named(text: &str) -> Option<Result<Self, ImageError>> {
        let (name, numbers) = text.split_once(':').filter(|(n, _)| ["gaussian", "motion", "disk"].contains(n))?;
        let parsed: Option<Vec<f64>> = numbers.split(',').map(|n| n.trim().parse().ok()).collect();
        Some(match (name, parsed.as_deref()) {
            ("gaussian", Some([s])) => Psf::gaussian(*s),
            ("disk", Some([r])) => Psf::disk(*r),
            ("motion", Some([length, angle])) => Psf::motion(*length, *angle),
            _ => Err(ImageError("give gaussian:S, motion:LENGTH,ANGLE or disk:R, such as gaussian:1.6".to_string())),
        })
    }

    /// One weight: no blur.
    pub fn identity() -> Self {
        Psf { width: 1, height: 1, weights: vec![1.0], center: (0, 0) }
    }

    /// Weights of an odd square that are positive where `of` (row and column from the middle) is.
    fn sampled(radius: usize, of: impl Fn(f64, f64) -> f64) -> Result<Self, ImageError> {
        let n = 2 * radius + 1;
        let at = |k: usize| k as f64 - radius as f64;
        let weights = (0..n * n).map(|k| of(at(k / n), at(k % n))).collect();
        Psf::new(n, n, weights, None)
    }

    /// exp(-r^2/(2 S^2)), cut off at 4 S.
    ///
    /// # Errors
    /// S that is not positive, or so large that the function has over a hundred million weights.
    pub fn gaussian(s: f64) -> Result<Self, ImageError> {
        let radius = radius_of("gaussian", 4.0 * s)?;
        Self::sampled(radius, |i, j| (-(i * i + j * j) / (2.0 * s * s)).exp())
    }

    /// Out of focus: 1 within the radius R, at the border the part of the pixel that is inside, by 16 x 16 samples.
    ///
    /// # Errors
    /// As [`Psf::gaussian`].
    pub fn disk(r: f64) -> Result<Self, ImageError> {
        let radius = radius_of("disk", r)?;
        Self::sampled(radius, |i, j| coverage(i, j, |y, x| y * y + x * x <= r * r))
    }

    /// Motion along a straight line of L pixels at A degrees, counterclockwise from the row to the right: the line's density
    /// spread over the two pixels that are nearest across it.
    ///
    /// # Errors
    /// As [`Psf::gaussian`].
    pub fn motion(length: f64, degrees: f64) -> Result<Self, ImageError> {
        let radius = radius_of("motion", length / 2.0)?;
        if !degrees.is_finite() {
            return Err(ImageError(format!("motion: the angle is {degrees}")));
        }
        let (sin, cos) = degrees.to_radians().sin_cos();
        let n = 2 * radius + 1;
        let mut weights = vec![0.0; n * n];
        /// Samples a pixel of length.
        const SAMPLES: f64 = 64.0;
        let count = (length * SAMPLES).ceil().max(1.0) as usize;
        for k in 0..count {
            let t = ((k as f64 + 0.5) / count as f64 - 0.5) * length;
            let (y, x) = (radius as f64 - t * sin, radius as f64 + t * cos);
            let (i, j) = (y.floor().max(0.0), x.floor().max(0.0));
            for (di, wi) in [(0.0, 1.0 - (y - i)), (1.0, y - i)] {
                for (dj, wj) in [(0.0, 1.0 - (x - j)), (1.0, x - j)] {
                    let at = (i + di) as usize * n + (j + dj) as usize;
                    if let Some(weight) = weights.get_mut(at) {
                        *weight += wi * wj;
                    }
                }
            }
        }
        Psf::new(n, n, weights, None)
    }

    /// Whether weights are the same when rows are reversed, and when columns are, around the centre, to rounding.
    pub fn is_symmetric(&self) -> bool {
        let (h, w) = (self.height, self.width);
        if self.center != (h / 2, w / 2) || h.is_multiple_of(2) || w.is_multiple_of(2) {
            return false;
        }
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-12;
        (0..h * w).all(|k| {
            let (i, j) = (k / w, k % w);
            same(self.weights[k], self.weights[(h - 1 - i) * w + j])
                && same(self.weights[k], self.weights[i * w + w - 1 - j])
        })
    }

    /// This blur, and after it the mean over n by n pixels, of which the first in both directions is the one that is asked for.
    ///
    /// # Errors
    /// n = 0.
    pub fn averaged(&self, n: usize) -> Result<Self, ImageError> {
        let (w, h) = ((self.width + n).saturating_sub(1), (self.height + n).saturating_sub(1));
        let mut weights = vec![0.0; w * h];
        for (k, weight) in self.weights.iter().enumerate() {
            let (i, j) = (k / self.width, k % self.width);
            for row in weights.chunks_mut(w.max(1)).skip(i).take(n) {
                row[j..j + n].iter_mut().for_each(|v| *v += weight);
            }
        }
        // (K x)_i = sum k_a x_(i + center - a): a mean over i .. i + n - 1 has its centre at n - 1.
        let center = (self.center.0 + n.saturating_sub(1), self.center.1 + n.saturating_sub(1));
        Psf::new(w, h, weights, Some(center))
    }

    /// Its spectrum as a periodic convolution: the transform of the weights with the centre at pixel 0.
    pub fn spectrum(&self, fourier: &Fourier) -> Vec<Complex<f64>> {
        let (w, h) = (fourier.width(), fourier.height());
        let mut field = vec![0.0; w * h];
        for (k, weight) in self.weights.iter().enumerate() {
            let i = (k / self.width + h * self.height - self.center.0) % h;
            let j = (k % self.width + w * self.width - self.center.1) % w;
            field[i * w + j] += weight;
        }
        fourier.forward(&field)
    }
}

/// A radius in pixels, of which an image can be made.
fn radius_of(name: &str, radius: f64) -> Result<usize, ImageError> {
    /// Pixels.
    const MOST: f64 = 5000.0;
    if !(radius > 0.0 && radius <= MOST) {
        return Err(ImageError(format!("{name}: a radius of {radius} pixels; it must be positive and at most {MOST}")));
    }
    Ok(radius.ceil() as usize)
}

/// The part of a pixel's square that is inside, by samples.
fn coverage(i: f64, j: f64, inside: impl Fn(f64, f64) -> bool) -> f64 {
    const SIDE: usize = 16;
    let at = |k: usize| (k as f64 + 0.5) / SIDE as f64 - 0.5;
    let hits = (0..SIDE * SIDE).filter(|k| inside(i + at(k / SIDE), j + at(k % SIDE))).count();
    hits as f64 / (SIDE * SIDE) as f64
}

/// lambda |K x - f|^2, K a convolution: the data term of A(31), without a factor 1/2, over the nodes of a grid that begins at
/// node 0.
#[derive(Clone)]
pub struct BlurredSquares {
    grid: Grid,
    blur: Blur,
    observed: Arc<Vec<f64>>, // f
    lambda: f64,
}

impl BlurredSquares {
    /// For an observed image f laid out as the grid is.
    pub fn new(grid: Grid, blur: Blur, observed: Vec<f64>, lambda: f64) -> Self {
        BlurredSquares { grid, blur, observed: Arc::new(observed), lambda }
    }

    /// K
    pub fn blur(&self) -> &Blur {
        &self.blur
    }

    /// f
    pub fn observed(&self) -> &[f64] {
        &self.observed
    }

    /// sup over y of <q, y> - lambda |y - f|^2 = <q, f> + |q|^2 / (4 lambda).
    pub(crate) fn conjugate(&self, q: &[f64]) -> f64 {
        vector::dot(q, &self.observed) + vector::dot(q, q) / (4.0 * self.lambda)
    }

    /// lambda
    pub fn lambda(&self) -> f64 {
        self.lambda
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.grid
    }
}

impl std::fmt::Debug for BlurredSquares {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "BlurredSquares({:?}, lambda {})", self.grid, self.lambda)
    }
}

impl Potential for BlurredSquares {
    fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64 {
        let n = self.grid.len();
        let mut residual = vec![0.0; n];
        self.blur.apply(self.grid, false, &x[..n], &mut residual);
        residual.iter_mut().zip(self.observed.iter()).for_each(|(r, f)| *r -= f);
        if let Some(grad) = grad {
            let mut back = vec![0.0; n];
            self.blur.apply(self.grid, true, &residual, &mut back);
            grad.iter_mut().zip(&back).for_each(|(g, b)| *g += 2.0 * self.lambda * b);
        }
        self.lambda * vector::dot(&residual, &residual)
    }

    fn n(&self) -> usize {
        self.grid.len()
    }

    fn is_convex(&self) -> bool {
        true
    }
}
