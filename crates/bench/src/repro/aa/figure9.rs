//! Figure 9: another mesh made planar, with faces of three to many corners.

use super::planar::compare;
use crate::BenchError;
use crate::repro::context::Context;

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    compare(context, "airport3k", "airport")
}
