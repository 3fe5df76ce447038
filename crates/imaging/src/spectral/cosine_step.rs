//! The global step by cosine transforms.

use super::blur::Blur;
use super::cosine::{Cosine, CosineSpectra};
use super::kernel::BlurredSquares;
use super::step::{Symbol, of_terms, weights};
use crate::Grid;
use proxel_split::{GlobalReport, GlobalStep, NormalMatrix, Objective, Precision, Problem, Pull, SystemError};
use std::sync::Arc;

/// [`super::FourierStep`] for fields whose border mirrors: the same formula, H real,
///
/// ```text
/// X = (2 lambda H F - P - H P_y) / (2 lambda H^2 + sum w^2 symbol)
/// ```
///
/// C the cosine transform in the place of the Fourier transform. Nodes behind those of x are y = K x, where they are carried.
pub struct CosineStep {
    grid: Grid,
    cosine: Cosine,
    kernel: Arc<Vec<f64>>, // row by row; none for no blur
    carries: bool,
    lambda: f64,
    right: Vec<Vec<f64>>, // a channel: 2 lambda K^T f
    symbols: Vec<Symbol>,
    weights: Vec<f64>, // w^2 of each term
    inverse: Vec<f64>, // 1 / denominator, row by row
    work: CosineSpectra,
}

impl CosineStep {
    /// With a data term that it holds itself and the problem has as a potential; terms by their symbols. None where the data
    /// wrap around.
    pub fn with_data(data: &BlurredSquares, symbols: Vec<Symbol>) -> Option<Self> {
        let Blur::Neumann { cosine, kernel } = data.blur().clone() else { return None };
        let (grid, lambda) = (data.grid(), data.lambda());
        let mut back = vec![0.0; grid.len()];
        data.blur().apply(grid, true, data.observed(), &mut back);
        back.iter_mut().for_each(|v| *v *= 2.0 * lambda);
        let rows = |channel: usize| back.chunks(grid.width).skip(channel).step_by(grid.channels).flatten();
        let right = (0..grid.channels).map(|channel| rows(channel).copied().collect()).collect();
        Some(CosineStep { lambda, right, ..Self::new(grid, cosine, kernel, false, symbols) })
    }

    /// With the blurred field behind x.
    pub fn with_blurred(grid: Grid, cosine: Cosine, kernel: Arc<Vec<f64>>, symbols: Vec<Symbol>) -> Self {
        Self::new(grid, cosine, kernel, true, symbols)
    }

    /// Terms alone.
    pub fn of_terms(grid: Grid, cosine: Cosine, symbols: Vec<Symbol>) -> Self {
        Self::new(grid, cosine, Arc::default(), false, symbols)
    }

    fn new(grid: Grid, cosine: Cosine, kernel: Arc<Vec<f64>>, carries: bool, symbols: Vec<Symbol>) -> Self {
        CosineStep {
            grid,
            cosine,
            kernel,
            carries,
            lambda: 0.0,
            right: Vec::new(),
            weights: vec![0.0; symbols.len()],
            symbols,
            inverse: Vec::new(),
            work: CosineSpectra::default(),
        }
    }
}

impl GlobalStep for CosineStep {
    fn run(
        &mut self,
        _: &mut Objective<'_>,
        _: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        let grid = self.grid;
        let (w, inverse, kernel) = (grid.width, self.inverse.as_slice(), self.kernel.as_slice());
        for channel in 0..grid.channels {
            let layout = super::channel(grid, 0, channel);
            if let Some(right) = self.right.get(channel) {
                let rows = grad.chunks_mut(grid.width).skip(channel).step_by(grid.channels);
                for (grad, right) in rows.zip(right.chunks(grid.width)) {
                    grad.iter_mut().zip(right).for_each(|(g, r)| *g -= r);
                }
            }
            if self.carries {
                let layouts = [layout, super::channel(grid, grid.len(), channel)];
                self.cosine.filter(grad, x, &layouts, &mut self.work, |i, j, [of_x, of_y]| {
                    let gain = kernel[i * w + j];
                    let new = -(of_x + gain * of_y) * inverse[i * w + j];
                    [new, gain * new]
                });
            } else {
                let of = |i: usize, j: usize, [pull]: [f64; 1]| [-pull * inverse[i * w + j]];
                self.cosine.filter(grad, x, &[layout], &mut self.work, of);
            }
        }
        Ok(GlobalReport { inner: 1, ..GlobalReport::default() })
    }

    fn precision(&self) -> Option<Precision> {
        None
    }

    fn pull(&self) -> Pull {
        Pull::AtOrigin
    }

    fn work(&self) -> f64 {
        /// Nanoseconds a pixel for a transform there and back.
        const PIXEL: f64 = 24.0;
        let fields = if self.carries { 2.0 } else { 1.0 };
        PIXEL * fields * self.grid.len() as f64
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn reset(&mut self) {}

    fn weigh(&mut self, problem: &Problem) -> Result<(), SystemError> {
        let fields = if self.carries { 2 } else { 1 };
        self.weights = weights(problem, self.grid, fields, self.symbols.len())?;
        self.inverse.clear();
        for k in 0..self.grid.n_pixels() {
            let h2 = self.kernel.get(k).map_or(1.0, |h| h * h);
            let s = self.cosine.laplacian(k / self.grid.width, k % self.grid.width);
            let denominator = 2.0 * self.lambda * h2 + of_terms(&self.symbols, &self.weights, s, h2);
            if !(denominator > 0.0 && denominator.is_finite()) {
                return Err(SystemError::Singular { node: k });
            }
            self.inverse.push(1.0 / denominator);
        }
        Ok(())
    }
}
