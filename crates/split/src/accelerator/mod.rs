//! What extrapolates a fixed-point iteration q <- G(q).

mod anderson;
mod momentum;

pub use anderson::{Anderson, Kind};
pub use momentum::Momentum;

/// A point of the iteration and its image.
#[derive(Clone, Copy, Debug)]
pub struct Iterate<'a> {
    /// q: all that is extrapolated, in whatever coordinates.
    pub q: &'a [f64],
    /// G(q), in the same coordinates.
    pub g: &'a [f64],
    /// The part of q that defines the iteration, in coordinates whose Euclidean norm is the metric of the splitting.
    pub sensed: &'a [f64],
    /// The residual G(q) - q of that part, in the same coordinates.
    pub f: &'a [f64],
}

/// How a proposed point came about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Proposal {
    /// Differences that it is made of; 0 where it is G(q) itself.
    pub columns: usize,
    /// How many of them are independent to rounding.
    pub rank: usize,
}

/// Proposes the next point from the points so far.
///
/// A proposal is an affine combination of points and images, the same for every coordinate, so that what depends on the
/// state by an affine function may be part of q and follows exactly.
pub trait Accelerator: Send {
    /// From the current point the next one in `out`. Lengths are the same in every call.
    fn next(&mut self, at: &Iterate<'_>, out: &mut [f64]) -> Proposal;

    /// Forgets everything: the next call returns its G.
    fn reset(&mut self);

    /// The safeguard has refused the last proposal and gone on from the image before.
    fn refused(&mut self) {}

    /// A proposal is kept where its merit is below this part of the last one.
    fn required(&self) -> f64 {
        1.0
    }
}

/// Proposes nothing: the iteration as it is, under the same driver.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unaccelerated;

impl Accelerator for Unaccelerated {
    fn next(&mut self, at: &Iterate<'_>, out: &mut [f64]) -> Proposal {
        out.copy_from_slice(at.g);
        Proposal::default()
    }

    fn reset(&mut self) {}
}
