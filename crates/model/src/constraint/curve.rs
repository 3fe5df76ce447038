//! Reference curves: where they are nearest.

use super::boxes::{Boxes, Hint, Item};
use super::{Closest, ShapeIndexError, V3, add, dot, sub};

/// A curve of straight segments, of one piece or several, open or closed: what vertices are to be close to, or the border of a
/// mesh is to slide along. Nearest points come from a tree of boxes; of several segments the first one counts.
#[derive(Clone, Debug)]
pub struct Curve {
    segments: Boxes<Segment>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Segment(pub [V3; 2]);

impl Item for Segment {
    fn bounds(&self) -> (V3, V3) {
        let [a, b] = self.0;
        ([0, 1, 2].map(|d| a[d].min(b[d])), [0, 1, 2].map(|d| a[d].max(b[d])))
    }

    /// a + t (b - a), t = (x - a) . (b - a) / |b - a|^2 within [0, 1].
    fn nearest(&self, x: V3) -> V3 {
        let [a, b] = self.0;
        let side = sub(b, a);
        let (along, whole) = (dot(sub(x, a), side), dot(side, side));
        // Ends as they are; a segment without a length has one.
        if !(along > 0.0) {
            a
        } else if along >= whole {
            b
        } else {
            add(a, along / whole, side)
        }
    }
}

impl Curve {
    /// From point to point, and back to the first one where it is closed. A single point is a curve too.
    ///
    /// # Errors
    /// No point, a number that is not finite.
    pub fn polyline(points: &[V3], closed: bool) -> Result<Self, ShapeIndexError> {
        let n = points.len() as u32;
        let ends = (1..n).map(|i| [i - 1, i]);
        let last = [n.saturating_sub(1), 0];
        let segments: Vec<[u32; 2]> = ends.chain((closed || n == 1).then_some(last)).collect();
        Self::of_segments(points, &segments)
    }

    /// Of segments between points, such as the border of a mesh.
    ///
    /// # Errors
    /// No segment, one with a point that does not exist or is not finite.
    pub fn of_segments(points: &[V3], segments: &[[u32; 2]]) -> Result<Self, ShapeIndexError> {
        let items = ShapeIndexError::corners("segment", points, segments)?;
        let items: Vec<Segment> = items.into_iter().map(Segment).collect();
        Ok(Curve { segments: Boxes::new(&items) })
    }
}

impl Closest for Curve {
    fn closest(&self, x: V3) -> V3 {
        self.segments.nearest(x)
    }

    fn closest_from(&self, x: V3, hint: &mut Hint) -> V3 {
        self.segments.nearest_from(x, hint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::norm;
    use proxel_testkit::random::SplitMix;

    fn spiral(n: usize) -> Vec<V3> {
        let at = |i: usize| 0.05 * i as f64;
        (0..n).map(|i| [at(i).cos() * at(i), at(i).sin() * at(i), 0.1 * at(i)]).collect()
    }

    /// Slow twin: samples of all segments.
    #[test]
    fn no_sample_is_nearer() {
        let points = spiral(200);
        let mut random = SplitMix::new(3);
        for closed in [false, true] {
            let curve = Curve::polyline(&points, closed).unwrap();
            for _ in 0..100 {
                let x: V3 = random.array(-12.0, 12.0);
                let found = norm(sub(curve.closest(x), x));
                let mut least = f64::INFINITY;
                for i in 0..points.len() - usize::from(!closed) {
                    let (a, b) = (points[i], points[(i + 1) % points.len()]);
                    for k in 0..=100 {
                        least = least.min(norm(sub(add(a, f64::from(k) / 100.0, sub(b, a)), x)));
                    }
                }
                assert!(found <= least + 1e-12 && found > least - 0.03, "{found} {least}");
            }
        }
    }

    #[test]
    fn ties_go_to_the_first_segment() {
        let points = [[-1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
        let x = [0.0, 0.2, 0.0];
        let first = Curve::of_segments(&points, &[[0, 1], [2, 3]]).unwrap();
        let other = Curve::of_segments(&points, &[[3, 2], [1, 0]]).unwrap();
        assert_eq!(first.closest(x), [-1.0, 0.2, 0.0]);
        assert_eq!(other.closest(x), [1.0, 0.2, 0.0]);
    }

    #[test]
    fn curves_of_nothing_are_refused_and_points_are_curves() {
        assert!(Curve::polyline(&[], true).is_err());
        assert!(Curve::polyline(&[[f64::NAN; 3], [0.0; 3]], false).is_err());
        assert!(Curve::of_segments(&[[0.0; 3]], &[[0, 1]]).unwrap_err().to_string().contains("segment 0"));
        let one = Curve::polyline(&[[1.0, 2.0, 3.0]], false).unwrap();
        assert_eq!(one.closest([9.0, 9.0, 9.0]), [1.0, 2.0, 3.0]);
        // Not a number in, the same out.
        assert!(one.closest([f64::NAN; 3]).iter().all(|c| c.is_nan()));
    }
}
