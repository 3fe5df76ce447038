//! Terms whose elements are pixels.

mod differences;
mod folded;
mod folded_stencil;
mod gradient;
mod local_cosines;
mod pairs;
mod pass;
mod pixel;
mod second_order;
mod stencil;

pub use differences::Differences;
pub use gradient::GradientTerm;
pub use local_cosines::LocalCosines;
pub use pixel::PixelTerm;
pub use second_order::{Bends, Slopes};
pub use stencil::{Stencil, StencilTerm, Visit};
