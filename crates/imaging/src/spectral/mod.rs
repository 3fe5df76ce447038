//! What a transform makes diagonal.

use crate::Grid;

mod blur;
mod cosine;
mod cosine_step;
mod fourier;
mod kernel;
mod second_order_step;
mod step;

pub use blur::{Blur, convolve};
pub(crate) use cosine::Line;
pub use cosine::{Cosine, CosineSpectra};
pub use cosine_step::CosineStep;
pub use fourier::{Column, Fourier, Layout, Spectra};
pub use kernel::{BlurredSquares, Psf};
pub use second_order_step::SecondOrderStep;
pub use step::{FourierStep, Symbol};

/// Where the rows of a channel are, in a grid that begins at a node.
fn channel(grid: Grid, first: usize, channel: usize) -> Layout {
    Layout { first: first + channel * grid.width, stride: grid.row_len() }
}
