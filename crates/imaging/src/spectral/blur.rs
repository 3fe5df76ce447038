//! A convolution and the border that makes it diagonal.

use super::cosine::{Cosine, CosineSpectra};
use super::fourier::{Fourier, Spectra};
use super::kernel::Psf;
use crate::{Boundary, Grid, ImageError};
use realfft::num_complex::Complex;
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
