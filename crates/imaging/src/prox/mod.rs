//! Functions of the numbers of one pixel, by their proximal operators.

use proxel_split::DualMap;
use std::ops::Range;

mod data;
mod huber;
mod poisson;
mod shrinkage;
#[cfg(test)]
mod tests;
mod total_variation;

pub use data::{Interval, Observed, Squares};
pub use huber::Huber;
pub use poisson::Poisson;
pub use shrinkage::Shrinkage;
pub use total_variation::{Norm, TotalVariation, Window};
pub(crate) use total_variation::{minus_shrinkage, shrink_pairs};

/// g(z) = sum over pixels of a function of the pixel's numbers: a penalty, a data term, or the indicator of a set.
///
/// Every method is given a range of pixels of one row (`pixels.start` counts from 0, row by row) and their numbers plane by
/// plane: number k of pixel i is `z[k * pixels.len() + i - pixels.start]`. Inside all is static.
pub trait Pointwise: Send + Sync {
    /// v <- argmin g(z) + weight2/2 |z - v|^2; returns g there, without what is infinite outside sets.
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64;

    /// g(z), without what is infinite outside sets.
    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64;

    /// z <- grad g(z), a subgradient where there is no gradient.
    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]);

    /// How far z is outside a set, at most; 0 where there is no set.
    fn violation(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let _ = (pixels, z);
        0.0
    }

    /// Whether g is infinite outside a set.
    fn is_hard(&self) -> bool {
        false
    }

    /// What u is as a function of z, A(21): then it is [`Self::gradient`] over weight2.
    fn dual_map(&self) -> DualMap {
        DualMap::None
    }

    /// Where g is the sum of `force()` times the norms of pairs of planes (0 and 1, 2 and 3, ..): those of a row's pixels that
    /// count, from 0. Terms then take the prox in the same pass as all else.
    fn shrinks_pairs(&self, pixels: Range<usize>, planes: usize) -> Option<Range<usize>> {
        let _ = (pixels, planes);
        None
    }

    /// Where g is the sum of weight |z| over all numbers of so many planes, each by itself: those of a row's pixels that count,
    /// and the weights of planes, over and over.
    fn shrinks_numbers(&self, pixels: Range<usize>, planes: usize) -> Option<(Range<usize>, &[f64])> {
        let _ = (pixels, planes);
        None
    }

    /// A typical size of the gradient of g at a pixel.
    fn force(&self) -> f64;

    /// The least m >= 0 such that q over m lies where the conjugate g* is finite; none where that is not known.
    fn gauge(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let _ = (pixels, q);
        None
    }

    /// g*(q) = sup over z of <q, z> - g(z), for q of gauge at most 1; none where that is not known.
    fn conjugate(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let _ = (pixels, q);
        None
    }
}

impl<P: Pointwise + ?Sized> Pointwise for Box<P> {
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        (**self).prox(pixels, v, weight2)
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        (**self).value(pixels, z)
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        (**self).gradient(pixels, z);
    }

    fn violation(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        (**self).violation(pixels, z)
    }

    fn is_hard(&self) -> bool {
        (**self).is_hard()
    }

    fn dual_map(&self) -> DualMap {
        (**self).dual_map()
    }

    fn shrinks_pairs(&self, pixels: Range<usize>, planes: usize) -> Option<Range<usize>> {
        (**self).shrinks_pairs(pixels, planes)
    }

    fn shrinks_numbers(&self, pixels: Range<usize>, planes: usize) -> Option<(Range<usize>, &[f64])> {
        (**self).shrinks_numbers(pixels, planes)
    }

    fn force(&self) -> f64 {
        (**self).force()
    }

    fn gauge(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        (**self).gauge(pixels, q)
    }

    fn conjugate(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        (**self).conjugate(pixels, q)
    }
}
