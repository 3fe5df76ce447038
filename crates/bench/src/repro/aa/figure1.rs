//! Figure 1: a quad mesh made planar. The text does not say which of the two meshes of its data it shows; costa has quads
//! only, as the caption says.

use super::planar::compare;
use crate::BenchError;
use crate::repro::context::Context;

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    compare(context, "costa2k", "costa")
}
