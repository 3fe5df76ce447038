//! Terms whose elements are pixels.

mod gradient;
mod pass;
mod pixel;

pub use gradient::GradientTerm;
pub use pixel::PixelTerm;
