//! The global step of second-order total generalised variation.

use super::Layout;
use super::blur::Blur;
use super::fourier::{Fourier, Spectra};
use super::kernel::BlurredSquares;
use super::step::{Symbol, of_terms, weights};
use crate::Grid;
use proxel_split::{GlobalReport, GlobalStep, NormalMatrix, Objective, Precision, Problem, Pull, SystemError};
use realfft::num_complex::Complex;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The exact minimiser over a field x and its slopes w = (w_1, w_2), which wrap around: terms of grad x - w ([`crate::Slopes`]),
/// with weight rho_1, of E w ([`crate::Bends`]), with rho_2, and of x or the blurred field as in [`super::FourierStep`]. With
/// d_1 = exp(2 pi i j / width) - 1 and d_2 of rows, at every frequency the system
///
/// ```text
/// [ a             -rho_1 conj(d_1)                          -rho_1 conj(d_2)                        ]
/// [ -rho_1 d_1    rho_1 + rho_2 (|d_1|^2 + |d_2|^2 / 2)     rho_2 conj(d_1) d_2 / 2                 ]
/// [ -rho_1 d_2    rho_2 d_1 conj(d_2) / 2                   rho_1 + rho_2 (|d_2|^2 + |d_1|^2 / 2)   ]
/// ```
///
/// with a = 2 lambda |H|^2 + rho_1 (|d_1|^2 + |d_2|^2) + the other terms, is solved: the two slopes are eliminated. Nodes: x, then
/// y = K x where it is carried, then w.
pub struct SecondOrderStep {
    grid: Grid,
    fourier: Fourier,
    kernel: Arc<Vec<Complex<f64>>>,
    carries: bool,
    lambda: f64,
    right: Vec<f64>,               // 2 lambda K^T f, laid out as x
    symbols: Vec<Symbol>,          // of the terms after the first two
    weights: Vec<f64>,             // w^2 of each term
    turns: [Vec<Complex<f64>>; 2], // d_1 of columns, d_2 of rows
    work: Spectra,
}

impl SecondOrderStep {
    /// With a data term that it holds itself and the problem has as a potential. Symbols are those of the terms after the first
    /// two. None where the border of the data mirrors.
    pub fn with_data(data: &BlurredSquares, symbols: Vec<Symbol>) -> Option<Self> {
        let Blur::Periodic { fourier, kernel } = data.blur().clone() else { return None };
        let mut right = vec![0.0; data.grid().len()];
        data.blur().apply(data.grid(), true, data.observed(), &mut right);
        right.iter_mut().for_each(|v| *v *= 2.0 * data.lambda());
        Some(SecondOrderStep {
            lambda: data.lambda(),
            right,
            ..Self::new(data.grid(), fourier, kernel, false, symbols)
        })
    }

    /// With the blurred field between x and w.
    pub fn with_blurred(grid: Grid, fourier: Fourier, kernel: Arc<Vec<Complex<f64>>>, symbols: Vec<Symbol>) -> Self {
        Self::new(grid, fourier, kernel, true, symbols)
    }

    /// Terms alone.
    pub fn of_terms(grid: Grid, fourier: Fourier, symbols: Vec<Symbol>) -> Self {
        Self::new(grid, fourier, Arc::default(), false, symbols)
    }

    fn new(grid: Grid, fourier: Fourier, kernel: Arc<Vec<Complex<f64>>>, carries: bool, symbols: Vec<Symbol>) -> Self {
        let turn = |k: usize, n: usize| Complex::from_polar(1.0, TAU * k as f64 / n as f64) - 1.0;
        let columns = (0..fourier.n_columns()).map(|j| turn(j, fourier.width())).collect();
        let rows = (0..fourier.height()).map(|i| turn(i, fourier.height())).collect();
        SecondOrderStep {
            grid,
            fourier,
            kernel,
            carries,
            lambda: 0.0,
            right: Vec::new(),
            symbols,
            weights: Vec::new(),
            turns: [columns, rows],
            work: Spectra::default(),
        }
    }

    /// Fields of the size of x among the nodes.
    fn fields(&self) -> usize {
        if self.carries { 4 } else { 3 }
    }
}

/// One frequency.
struct Frequency {
    a: f64, // of x with itself
    rho: [f64; 2],
    d: [Complex<f64>; 2],
}

impl Frequency {
    /// The solution for a right-hand side (x, w_1, w_2), and what is left of a.
    fn solve(&self, [bx, b1, b2]: [Complex<f64>; 3]) -> ([Complex<f64>; 3], f64) {
        let ([r1, r2], [d1, d2]) = (self.rho, self.d);
        let (s1, s2) = (d1.norm_sqr(), d2.norm_sqr());
        let (m11, m22) = (r1 + r2 * (s1 + 0.5 * s2), r1 + r2 * (s2 + 0.5 * s1));
        let m12 = d1.conj() * d2 * (0.5 * r2);
        let det = m11 * m22 - m12.norm_sqr();
        let inverse =
            |v1: Complex<f64>, v2: Complex<f64>| ((v1 * m22 - m12 * v2) / det, (v2 * m11 - m12.conj() * v1) / det);
        // Columns of x under w: -r1 d.
        let (t1, t2) = inverse(-d1 * r1, -d2 * r1);
        let schur = self.a + r1 * (d1.conj() * t1 + d2.conj() * t2).re;
        let (u1, u2) = inverse(b1, b2);
        let x = (bx + (d1.conj() * u1 + d2.conj() * u2) * r1) / schur;
        ([x, u1 - t1 * x, u2 - t2 * x], schur)
    }
}

impl GlobalStep for SecondOrderStep {
    fn run(
        &mut self,
        _: &mut Objective<'_>,
        _: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        let (grid, h, n) = (self.grid, self.fourier.height(), self.grid.len());
        grad.iter_mut().zip(&self.right).for_each(|(g, r)| *g -= r);
        let scale = 1.0 / grid.n_pixels() as f64;
        let [columns, rows] = &self.turns;
        let (kernel, symbols, weights, lambda) = (&self.kernel, &self.symbols, &self.weights, self.lambda);
        let frequency = |i: usize, j: usize| {
            let d = [columns[j], rows[i]];
            let gain = kernel.get(j * h + i).map_or(1.0, |h| h.norm_sqr());
            let s = d[0].norm_sqr() + d[1].norm_sqr();
            let others = of_terms(symbols, &weights[2..], s, gain);
            Frequency { a: 2.0 * lambda * gain + weights[0] * s + others, rho: [weights[0], weights[1]], d }
        };
        for channel in 0..grid.channels {
            let of_x = super::channel(grid, 0, channel);
            let slopes = |k: usize| Layout {
                first: (self.fields() - 2) * n + (2 * channel + k) * grid.width,
                stride: 2 * grid.row_len(),
            };
            if self.carries {
                let layouts = [of_x, super::channel(grid, n, channel), slopes(0), slopes(1)];
                self.fourier.filter(grad, x, &layouts, &mut self.work, |column| {
                    let j = column.j;
                    let [x, y, w1, w2] = column.fields;
                    for i in 0..h {
                        let k = kernel[j * h + i];
                        let right = [-(x[i] + k.conj() * y[i]), -w1[i], -w2[i]];
                        let ([new, s1, s2], _) = frequency(i, j).solve(right);
                        (x[i], y[i], w1[i], w2[i]) = (new * scale, new * k * scale, s1 * scale, s2 * scale);
                    }
                    0.0
                });
            } else {
                self.fourier.filter(grad, x, &[of_x, slopes(0), slopes(1)], &mut self.work, |column| {
                    let j = column.j;
                    let [x, w1, w2] = column.fields;
                    for i in 0..h {
                        let ([new, s1, s2], _) = frequency(i, j).solve([-x[i], -w1[i], -w2[i]]);
                        (x[i], w1[i], w2[i]) = (new * scale, s1 * scale, s2 * scale);
                    }
                    0.0
                });
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
        const PIXEL: f64 = 16.0;
        PIXEL * (self.fields() * self.grid.len()) as f64
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn reset(&mut self) {}

    fn weigh(&mut self, problem: &Problem) -> Result<(), SystemError> {
        self.weights = weights(problem, self.grid, self.fields(), self.symbols.len() + 2)?;
        let (h, [columns, rows]) = (self.fourier.height(), &self.turns);
        for (j, d1) in columns.iter().enumerate() {
            for (i, d2) in rows.iter().enumerate() {
                let gain = self.kernel.get(j * h + i).map_or(1.0, |h| h.norm_sqr());
                let s = d1.norm_sqr() + d2.norm_sqr();
                let a = 2.0 * self.lambda * gain
                    + self.weights[0] * s
                    + of_terms(&self.symbols, &self.weights[2..], s, gain);
                let at = Frequency { a, rho: [self.weights[0], self.weights[1]], d: [*d1, *d2] };
                let (_, schur) = at.solve([Complex::default(); 3]);
                if !(schur > 0.0 && schur.is_finite()) {
                    return Err(SystemError::Singular { node: i * self.grid.width + j });
                }
            }
        }
        Ok(())
    }
}
