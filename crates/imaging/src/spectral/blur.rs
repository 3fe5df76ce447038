//! A convolution and the border that makes it diagonal.

use super::cosine::{Cosine, CosineSpectra};
use super::fourier::Fourier;
use super::kernel::Psf;
use crate::room::Room;
use crate::{Boundary, Grid, ImageError};
use proxel_split::vector;
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

    /// e <- the field whose K^T e comes near r where the blur lets frequencies through: H r / (|H|^2 + floor) in frequencies.
    pub(crate) fn explain(&self, grid: Grid, r: &[f64], floor: f64, e: &mut [f64], room: &mut Room) {
        match self {
            Blur::Periodic { fourier, kernel } => {
                filter(grid, fourier, kernel, |k| k / (k.norm_sqr() + floor), r, e, room);
            }
            Blur::Neumann { cosine, kernel } => {
                let mut work = CosineSpectra::default();
                for channel in 0..grid.channels {
                    let layout = super::channel(grid, 0, channel);
                    cosine.filter(r, e, &[layout], &mut work, |i, j, [r]: [f64; 1]| {
                        let h = kernel[i * grid.width + j];
                        [r * h / (h * h + floor)]
                    });
                }
            }
        }
    }

    /// psi <- the field of mean 0 whose D^T D psi is r - K^T e but for the mean, D the differences of the border.
    pub(crate) fn potential(&self, grid: Grid, r: &[f64], e: &[f64], psi: &mut [f64], room: &mut Room) {
        let n = grid.len();
        let (mut from, mut to) = (room.take(2 * n), room.take(2 * n));
        vector::copy(&mut from[..n], r);
        vector::copy(&mut from[n..], e);
        match self {
            Blur::Periodic { fourier, kernel } => {
                let (h, w, scale) = (fourier.height(), fourier.width(), 1.0 / grid.n_pixels() as f64);
                // 2 - 2 cos t = 4 sin^2(t/2), which does not cancel.
                let part = |k: usize, n: usize| 4.0 * (PI * k as f64 / n as f64).sin().powi(2);
                let down: Vec<f64> = (0..h).map(|i| part(i, h)).collect();
                for channel in 0..grid.channels {
                    let layouts = [super::channel(grid, 0, channel), super::channel(grid, n, channel)];
                    fourier.filter(&mut from, &mut to, &layouts, &mut room.spectra, |column| {
                        let (j, [r, e]) = (column.j, column.fields);
                        let (along, kernel) = (part(j, w), &kernel[j * h..(j + 1) * h]);
                        for (((r, e), k), s) in r.iter_mut().zip(e.iter()).zip(kernel).zip(&down) {
                            let s = s + along;
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
        vector::copy(psi, &to[..n]);
        room.give([from, to]);
    }

    /// out <- (D^T D + K^T K)^-1 r, D the differences of the border: all of them and all data, so that it comes near what is left
    /// when some do not count.
    pub(crate) fn precondition(&self, grid: Grid, r: &[f64], out: &mut [f64], room: &mut Room) {
        match self {
            Blur::Periodic { fourier, kernel } => {
                let (h, w, scale) = (fourier.height(), fourier.width(), 1.0 / grid.n_pixels() as f64);
                let mut from = room.take(grid.len());
                vector::copy(&mut from, r);
                let part = |k: usize, n: usize| 4.0 * (PI * k as f64 / n as f64).sin().powi(2);
                let down: Vec<f64> = (0..h).map(|i| part(i, h)).collect();
                for channel in 0..grid.channels {
                    fourier.filter(&mut from, out, &[super::channel(grid, 0, channel)], &mut room.spectra, |column| {
                        let (along, kernel) = (part(column.j, w), &kernel[column.j * h..(column.j + 1) * h]);
                        let [field] = column.fields;
                        for ((v, k), s) in field.iter_mut().zip(kernel).zip(&down) {
                            *v *= scale / (s + along + k.norm_sqr());
                        }
                        0.0
                    });
                }
                room.give([from]);
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
        self.apply_in(grid, adjoint, x, out, &mut Room::default());
    }

    /// The same, in room that there is.
    pub(crate) fn apply_in(&self, grid: Grid, adjoint: bool, x: &[f64], out: &mut [f64], room: &mut Room) {
        match self {
            Blur::Periodic { fourier, kernel } => {
                filter(grid, fourier, kernel, |k| if adjoint { k.conj() } else { *k }, x, out, room);
            }
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
    let of = |k: &Complex<f64>| if adjoint { k.conj() } else { *k };
    filter(grid, fourier, kernel, of, x, out, &mut Room::default());
}

/// out <- x with its frequencies multiplied by `of` those of a kernel.
fn filter(
    grid: Grid,
    fourier: &Fourier,
    kernel: &[Complex<f64>],
    of: impl Fn(&Complex<f64>) -> Complex<f64> + Sync,
    x: &[f64],
    out: &mut [f64],
    room: &mut Room,
) {
    let mut from = room.take(x.len());
    vector::copy(&mut from, x);
    let (h, scale) = (fourier.height(), 1.0 / grid.n_pixels() as f64);
    for channel in 0..grid.channels {
        let layout = super::channel(grid, 0, channel);
        fourier.filter(&mut from, out, &[layout], &mut room.spectra, |column| {
            let kernel = &kernel[column.j * h..(column.j + 1) * h];
            for (value, k) in column.fields.iter_mut().flat_map(|f| f.iter_mut()).zip(kernel) {
                *value *= of(k) * scale;
            }
            0.0
        });
    }
    room.give([from]);
}
