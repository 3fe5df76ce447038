//! A convolution and the border that makes it diagonal.

use super::cosine::{Cosine, CosineSpectra};
use super::fourier::{Fourier, Spectra};
use super::kernel::Psf;
use crate::{Boundary, Grid, ImageError};
use realfft::num_complex::Complex;
use std::f64::consts::PI;
use std::sync::Arc;

/// Convolution with a point spread function over fields of one size.
#[derive(Clone)]
pub enum Blur {
    /// The field wraps around: any function, in Fourier space.
    Periodic {
        /// Plans of the size.
        fourier: Fourier,
        /// The spectrum, column by column.
        kernel: Arc<Vec<Complex<f64>>>,
    },
    /// Its border mirrors: functions that are symmetric in both directions, by cosines.
    Neumann {
        /// Plans of the size.
        cosine: Cosine,
        /// The eigenvalues, row by row.
        kernel: Arc<Vec<f64>>,
    },
}

impl Blur {
    /// Over fields of this size.
    ///
    /// # Errors
    /// A mirroring border and a function that is not symmetric.
    pub fn new(width: usize, height: usize, psf: &Psf, boundary: Boundary) -> Result<Self, ImageError> {
        if boundary == Boundary::Periodic {
            let fourier = Fourier::new(width, height);
            let kernel = Arc::new(psf.spectrum(&fourier));
            return Ok(Blur::Periodic { fourier, kernel });
        }
        if !psf.is_symmetric() {
            let text = "boundary neumann: the point spread function is not symmetric about its centre in both directions, so \
                that no cosine transform makes it diagonal; take --boundary unknown";
            return Err(ImageError(text.to_string()));
        }
        let cosine = Cosine::new(width, height);
        let kernel = Arc::new(cosine.gains(psf));
        Ok(Blur::Neumann { cosine, kernel })
    }

    /// What lies beyond the border.
    pub fn boundary(&self) -> Boundary {
        match self {
            Blur::Periodic { .. } => Boundary::Periodic,
            Blur::Neumann { .. } => Boundary::Neumann,
        }
    }

    /// The field e whose K^T e comes near r where the blur lets frequencies through: e = H r / (|H|^2 + floor) in frequencies.
    pub fn explain(&self, grid: Grid, r: &[f64], floor: f64) -> Vec<f64> {
        let mut e = vec![0.0; grid.len()];
        match self {
            Blur::Periodic { fourier, kernel } => {
                let of = |k: &Complex<f64>| k / (k.norm_sqr() + floor);
                let kernel: Vec<Complex<f64>> = kernel.iter().map(of).collect();
                convolve(grid, fourier, &kernel, false, r, &mut e);
            }
            Blur::Neumann { cosine, kernel } => {
                let mut work = CosineSpectra::default();
                for channel in 0..grid.channels {
                    let layout = super::channel(grid, 0, channel);
                    cosine.filter(r, &mut e, &[layout], &mut work, |i, j, [r]: [f64; 1]| {
                        let h = kernel[i * grid.width + j];
                        [r * h / (h * h + floor)]
                    });
                }
            }
        }
        e
    }

    /// The field of mean 0 whose D^T D psi is r - K^T e but for the mean, D the differences of the border.
    pub fn potential(&self, grid: Grid, r: &[f64], e: &[f64]) -> Vec<f64> {
        let n = grid.len();
        let mut from = r.to_vec();
        from.extend_from_slice(e);
        let mut to = vec![0.0; 2 * n];
        match self {
            Blur::Periodic { fourier, kernel } => {
                let (h, w, scale) = (fourier.height(), fourier.width(), 1.0 / grid.n_pixels() as f64);
                let mut work = Spectra::default();
                // 2 - 2 cos t = 4 sin^2(t/2), which does not cancel.
                let part = |k: usize, n: usize| 4.0 * (PI * k as f64 / n as f64).sin().powi(2);
                let down: Vec<f64> = (0..h).map(|i| part(i, h)).collect();
                for channel in 0..grid.channels {
                    let layouts = [super::channel(grid, 0, channel), super::channel(grid, n, channel)];
                    fourier.filter(&mut from, &mut to, &layouts, &mut work, |column| {
                        let (j, [r, e]) = (column.j, column.fields);
                        let kernel = &kernel[j * h..(j + 1) * h];
                        for (((r, e), k), s) in r.iter_mut().zip(e.iter()).zip(kernel).zip(&down) {
                            let s = s + part(j, w);
                            let factor = if s > 0.0 { scale / s } else { 0.0 };
                            *r = (*r - k.conj() * *e) * factor;
                        }
                        0.0
                    });
                }
            }
            Blur::Neumann { cosine, kernel } => {
                let mut work = CosineSpectra::default();
                for channel in 0..grid.channels {
                    let layouts = [super::channel(grid, 0, channel), super::channel(grid, n, channel)];
                    cosine.filter(&from, &mut to, &layouts, &mut work, |i, j, [r, e]: [f64; 2]| {
                        let s = cosine.laplacian(i, j);
                        let factor = if s > 0.0 { 1.0 / s } else { 0.0 };
                        [(r - kernel[i * grid.width + j] * e) * factor, 0.0]
                    });
                }
            }
        }
        to.truncate(n);
        to
    }

    /// out <- (D^T D + K^T K)^-1 r, D the differences of the border: all of them and all data, so that it comes near what is left
    /// when some do not count.
    pub fn precondition(&self, grid: Grid, r: &[f64], out: &mut [f64]) {
        match self {
            Blur::Periodic { fourier, kernel } => {
                let (h, w, scale) = (fourier.height(), fourier.width(), 1.0 / grid.n_pixels() as f64);
                let (mut from, mut work) = (r.to_vec(), Spectra::default());
                let part = |k: usize, n: usize| 4.0 * (PI * k as f64 / n as f64).sin().powi(2);
                let down: Vec<f64> = (0..h).map(|i| part(i, h)).collect();
                for channel in 0..grid.channels {
                    fourier.filter(&mut from, out, &[super::channel(grid, 0, channel)], &mut work, |column| {
                        let (along, kernel) = (part(column.j, w), &kernel[column.j * h..(column.j + 1) * h]);
                        let [field] = column.fields;
                        for ((v, k), s) in field.iter_mut().zip(kernel).zip(&down) {
                            *v *= scale / (s + along + k.norm_sqr());
                        }
                        0.0
                    });
                }
            }
            Blur::Neumann { cosine, kernel } => {
                let mut work = CosineSpectra::default();
                for channel in 0..grid.channels {
                    let of = |i: usize, j: usize, [v]: [f64; 1]| {
                        let k = kernel[i * grid.width + j];
                        [v / (cosine.laplacian(i, j) + k * k)]
                    };
                    cosine.filter(r, out, &[super::channel(grid, 0, channel)], &mut work, of);
                }
            }
        }
    }

    /// out <- K x, or K^T x, over a grid of that size.
    pub fn apply(&self, grid: Grid, adjoint: bool, x: &[f64], out: &mut [f64]) {
        match self {
            Blur::Periodic { fourier, kernel } => convolve(grid, fourier, kernel, adjoint, x, out),
            // Symmetric: its own transpose.
            Blur::Neumann { cosine, kernel } => {
                let mut work = CosineSpectra::default();
                for channel in 0..grid.channels {
                    let layout = super::channel(grid, 0, channel);
                    let of = |i: usize, j: usize, [v]: [f64; 1]| [v * kernel[i * grid.width + j]];
                    cosine.filter(x, out, &[layout], &mut work, of);
                }
            }
        }
    }
}

/// out <- K x, or K^T x, over a grid that wraps around.
pub fn convolve(grid: Grid, fourier: &Fourier, kernel: &[Complex<f64>], adjoint: bool, x: &[f64], out: &mut [f64]) {
    let (mut from, mut work) = (x.to_vec(), Spectra::default());
    let (h, scale) = (fourier.height(), 1.0 / grid.n_pixels() as f64);
    for channel in 0..grid.channels {
        let layout = super::channel(grid, 0, channel);
        fourier.filter(&mut from, out, &[layout], &mut work, |column| {
            let kernel = &kernel[column.j * h..(column.j + 1) * h];
            for (value, k) in column.fields.iter_mut().flat_map(|f| f.iter_mut()).zip(kernel) {
                *value *= if adjoint { k.conj() } else { *k } * scale;
            }
            0.0
        });
    }
}
