//! The commands that restore images.

mod args;
mod psf;
mod run;

pub use args::{DeblurArgs, DenoiseArgs, InpaintArgs};
pub use run::{deblur, denoise, inpaint};
