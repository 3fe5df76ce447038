//! Slow twins for tests of Proxel: finite differences, brute-force prox, tiny meshes.
//!
//! Nothing here knows Proxel: functions are closures over slices and meshes are plain arrays, so that what they check
//! cannot have leaked into them.

pub mod differences;
pub mod meshes;
pub mod minimize;
pub mod random;

pub use differences::{Estimate, Mismatch, check_gradient, check_hessian};
pub use minimize::{Minimum, nelder_mead, prox_by_force};
pub use random::SplitMix;
