//! The wavefront that a coded sensor has seen: A(32).
//!
//! Before a mask of random cells light makes speckle on a sensor; a wavefront phi moves it by grad phi. From an image without
//! and one with the wavefront, phi is found by
//!
//! ```text
//! min over phi: |G M grad phi + g_t|^2 + beta |grad phi|^2
//! ```
//!
//! g the gradient of the images, g_t what has changed, M the pixels of the image in a larger field ([`Linearised`]); from
//! coarse to fine, since that holds for small shifts only ([`coarse_to_fine`]). The splitting is that of
//! [`proxel_split::Admm`], with a prox pixel by pixel ([`Consistency`]) and cosine transforms ([`CosineLaplacian`]) as its
//! global step.

mod consistency;
mod cosine;
mod gmres;
mod map;
mod pcg;
mod plane;
mod problem;
mod pyramid;
mod simulate;
#[cfg(test)]
mod tests;
mod texture;
mod zernike;

pub use consistency::{Consistency, Smoothness};
pub use cosine::CosineLaplacian;
pub use gmres::Gmres;
pub use pcg::Pcg;
pub use plane::Plane;
pub use problem::{Linearised, Solver};
pub use pyramid::{PyramidSettings, Stage, coarse_to_fine, comparable};
pub use simulate::{SimulateSettings, SimulatedPair, simulate};
pub use texture::texture;
pub use zernike::{MOST_COEFFICIENTS, coefficients, noll, zernike};
