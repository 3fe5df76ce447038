//! What a transform makes diagonal.

use crate::Grid;

mod fourier;
mod kernel;
mod step;

pub use fourier::{Column, Fourier, Layout, Spectra};
pub use kernel::{BlurredSquares, Psf, convolve};
pub use step::{FourierStep, Symbol};

/// Where the rows of a channel are, in a grid that begins at a node.
fn channel(grid: Grid, first: usize, channel: usize) -> Layout {
    Layout { first: first + channel * grid.width, stride: grid.row_len() }
}
