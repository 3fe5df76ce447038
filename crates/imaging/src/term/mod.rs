//! Terms whose elements are pixels.

mod gradient;
mod pass;
mod pixel;
mod second_order;
mod stencil;

pub use gradient::GradientTerm;
pub use pixel::PixelTerm;
pub use second_order::{Bends, Slopes};
pub use stencil::{Stencil, StencilTerm, Visit};
