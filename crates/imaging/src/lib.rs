//! Images: what they are, the terms and global steps of their grids, and their formats.
//!
//! A pixel is a node with one number a channel, so that an image problem is a [`proxel_split::Problem`] of `dim` 1.

mod grid;
mod image;
pub mod io;
mod prox;
pub mod restore;
mod room;
mod spectral;
mod term;
pub mod wavefront;

pub use grid::{Boundary, Grid};
pub use image::{Image, ImageError};
pub use prox::{Huber, Interval, Norm, Observed, Pointwise, Poisson, Shrinkage, Squares, TotalVariation, Window};
pub use spectral::{
    Blur, BlurredSquares, Column, Cosine, CosineSpectra, CosineStep, Fourier, FourierStep, Layout, Psf,
    SecondOrderStep, Spectra, Symbol, convolve,
};
/// A number of a spectrum.
pub type Complex = realfft::num_complex::Complex<f64>;

pub use term::{Bends, Differences, GradientTerm, LocalCosines, PixelTerm, Slopes, Stencil, StencilTerm, Visit};
