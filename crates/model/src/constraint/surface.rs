//! Reference surfaces: where they are nearest.

use super::boxes::{Boxes, Hint, Item};
use super::curve::Segment;
use super::{Closest, V3, add, cross, dot, sub};

/// A surface of triangles, open or closed, manifold or not, of any orientation. Nearest points come from a tree of boxes; of
/// several triangles the first one counts. Triangles without an area are segments or points.
#[derive(Clone, Debug)]
pub struct Surface {
    triangles: Boxes<Triangle>,
}

/// What a surface or a curve cannot be made of: which element, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShapeIndexError(String);

impl std::fmt::Display for ShapeIndexError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ShapeIndexError {}

impl ShapeIndexError {
    /// The corners of all elements, if they are there and finite.
    pub(super) fn corners<const N: usize>(
        what: &str,
        points: &[V3],
        elements: &[[u32; N]],
    ) -> Result<Vec<[V3; N]>, Self> {
        if elements.is_empty() || elements.len() >= u32::MAX as usize {
            return Err(ShapeIndexError(format!("{} {what}s are none, or too many to be numbered", elements.len())));
        }
        let point = |i: u32| points.get(i as usize).filter(|p| p.iter().all(|c| c.is_finite()));
        let of = |(e, nodes): (usize, &[u32; N])| match nodes.iter().find(|i| point(**i).is_none()) {
            Some(i) => {
                let text =
                    format!("{what} {e} (0-based) has corner {i}, which is not finite or does not exist; correct it");
                Err(ShapeIndexError(text))
            }
            None => Ok(nodes.map(|i| points[i as usize])),
        };
        elements.iter().enumerate().map(of).collect()
    }
}

#[derive(Clone, Copy, Debug)]
struct Triangle([V3; 3]);

impl Item for Triangle {
    fn bounds(&self) -> (V3, V3) {
        let [a, b, c] = self.0;
        ([0, 1, 2].map(|d| a[d].min(b[d]).min(c[d])), [0, 1, 2].map(|d| a[d].max(b[d]).max(c[d])))
    }

    /// Over the triangle x - n (n . (x - a)) / n^2; else the nearest of the edges that x is beyond, one of which has it.
    fn nearest(&self, x: V3) -> V3 {
        let [a, b, c] = self.0;
        let (ab, bc, ca) = (sub(b, a), sub(c, b), sub(a, c));
        let n = cross(ab, bc);
        let whole = dot(n, n);
        let (ax, bx, cx) = (sub(x, a), sub(x, b), sub(x, c));
        let inward = [dot(cross(ab, ax), n), dot(cross(bc, bx), n), dot(cross(ca, cx), n)];
        if whole > 0.0 && inward.iter().all(|i| *i >= 0.0) {
            return add(x, -dot(n, ax) / whole, n);
        }
        let mut best = (f64::INFINITY, a);
        for (side, inward) in [[a, b], [b, c], [c, a]].into_iter().zip(inward) {
            // Without an area no side is that of the inside.
            if !(inward >= 0.0) || !(whole > 0.0) {
                let point = Segment(side).nearest(x);
                let way = sub(x, point);
                let squared = dot(way, way);
                if squared < best.0 {
                    best = (squared, point);
                }
            }
        }
        best.1
    }
}

impl Surface {
    /// Of triangles over points. Coordinates between 1e-70 and 1e70, so that fourth powers are numbers.
    ///
    /// # Errors
    /// No triangle, one with a corner that does not exist or is not finite.
    pub fn new(points: &[V3], triangles: &[[u32; 3]]) -> Result<Self, ShapeIndexError> {
        let items = ShapeIndexError::corners("triangle", points, triangles)?;
        let items: Vec<Triangle> = items.into_iter().map(Triangle).collect();
        Ok(Surface { triangles: Boxes::new(&items) })
    }
}

impl Closest for Surface {
    fn closest(&self, x: V3) -> V3 {
        self.triangles.nearest(x)
    }

    fn closest_from(&self, x: V3, hint: &mut Hint) -> V3 {
        self.triangles.nearest_from(x, hint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::{norm, scale};
    use proxel_testkit::minimize::nelder_mead;
    use proxel_testkit::random::SplitMix;

    /// A bumpy grid of n x n quads, each of two triangles; corners on integers tie at many points.
    fn grid(n: u32, height: f64) -> (Vec<V3>, Vec<[u32; 3]>) {
        let at = |i: u32, j: u32| i * (n + 1) + j;
        let mut points = Vec::new();
        for i in 0..=n {
            for j in 0..=n {
                points.push([
                    f64::from(i),
                    f64::from(j),
                    height * (f64::from(i) * 0.7).sin() * (f64::from(j) * 0.4).cos(),
                ]);
            }
        }
        let quads = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let triangles = quads.flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        (points, triangles.collect())
    }

    #[test]
    fn the_nearest_point_of_a_triangle() {
        let mut random = SplitMix::new(2);
        for _ in 0..300 {
            let corners: [V3; 3] = [random.array(-1.0, 1.0), random.array(-1.0, 1.0), random.array(-1.0, 1.0)];
            let x: V3 = random.array(-2.0, 2.0);
            let [a, b, c] = corners;
            let found = norm(sub(Triangle(corners).nearest(x), x));
            // Slow twin: the least over (s, t) with s, t >= 0, s + t <= 1.
            let at = |p: &[f64]| {
                let (s, t) = (p[0], p[1]);
                if s < 0.0 || t < 0.0 || s + t > 1.0 {
                    return f64::INFINITY;
                }
                norm(sub(add(add(a, s, sub(b, a)), t, sub(c, a)), x))
            };
            let starts = [[0.3, 0.3], [0.0, 0.5], [0.5, 0.0], [0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
            let least = starts.iter().map(|s| nelder_mead(&at, s, 0.2).value).fold(f64::INFINITY, f64::min);
            assert!(found < least + 1e-9 && found > least - 1e-3, "{found} {least}");
        }
    }

    #[test]
    fn triangles_without_an_area_are_segments_and_points() {
        let p = [1.0, 2.0, 3.0];
        assert_eq!(Triangle([p; 3]).nearest([5.0, 0.0, 0.0]), p);
        let flat = Triangle([[0.0; 3], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
        assert_eq!(flat.nearest([2.0, 1.0, 0.0]), [2.0, 0.0, 0.0]);
        assert_eq!(flat.nearest([4.0, 1.0, 0.0]), [3.0, 0.0, 0.0]);
        // A needle: the way to it is exact to rounding.
        let needle = Triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1e-9, 0.0]]);
        let q = needle.nearest([0.5, 0.3, 0.4]);
        assert!((norm(sub(q, [0.5, 0.3, 0.4])) - 0.5).abs() < 1e-8, "{q:?}");
    }

    /// The tree, from any hint, gives the bits of looking at all; at points that tie too.
    #[test]
    fn the_same_bits_as_without_a_tree() {
        let mut random = SplitMix::new(9);
        for (n, height) in [(1, 0.0), (3, 0.0), (12, 1.5), (30, 0.3)] {
            let (points, triangles) = grid(n, height);
            for (size, offset) in [(1.0, 0.0), (1e-6, 0.0), (1e8, 0.0), (1.0, 1e6)] {
                let moved: Vec<V3> = points.iter().map(|p| scale(size, *p).map(|c| c + offset)).collect();
                let surface = Surface::new(&moved, &triangles).unwrap();
                let mut hint = Hint::default();
                for k in 0..150 {
                    let span = f64::from(n);
                    let mut x: V3 =
                        [random.uniform(-1.0, span + 1.0), random.uniform(-1.0, span + 1.0), random.uniform(-2.0, 2.0)];
                    if k % 3 == 0 {
                        // As far from many triangles.
                        x = [x[0].round(), x[1].round(), x[2]];
                    }
                    let x = scale(size, x).map(|c| c + offset);
                    let wanted = surface.triangles.nearest_of_all(x);
                    assert_eq!(surface.closest(x), wanted);
                    // A hint from far away, and then from next to it.
                    assert_eq!(surface.closest_from(x, &mut hint), wanted);
                    let step: V3 = random.array(-0.02 * size, 0.02 * size);
                    let y = add(x, 1.0, step);
                    assert_eq!(surface.closest_from(y, &mut hint), surface.triangles.nearest_of_all(y));
                }
            }
        }
    }

    /// Small steps in all directions, many of which need no tree; the hint of another tree does no harm.
    #[test]
    fn hints_change_no_bit() {
        let (points, triangles) = grid(20, 1.0);
        let surface = Surface::new(&points, &triangles).unwrap();
        let mut random = SplitMix::new(4);
        for _ in 0..30 {
            let mut x: V3 = [random.uniform(0.0, 20.0), random.uniform(0.0, 20.0), random.uniform(-1.0, 1.0)];
            let mut hint = Hint::default();
            let mut size = 0.3;
            for _ in 0..60 {
                assert_eq!(surface.closest_from(x, &mut hint), surface.triangles.nearest_of_all(x));
                x = add(x, size, random.array(-1.0, 1.0));
                size *= 0.85;
            }
        }
        let other = Surface::new(&grid(2, 0.5).0, &grid(2, 0.5).1).unwrap();
        let (mut hint, x) = (Hint::default(), [1.7, 1.1, 0.3]);
        surface.closest_from(x, &mut hint);
        assert_eq!(other.closest_from(x, &mut hint), other.closest(x));
    }

    #[test]
    fn surfaces_of_nothing_are_refused() {
        assert!(Surface::new(&[], &[]).is_err());
        let text = Surface::new(&[[0.0; 3]; 2], &[[0, 1, 2]]).unwrap_err().to_string();
        assert!(text.contains("triangle 0") && text.contains("corner 2"), "{text}");
        assert!(Surface::new(&[[f64::INFINITY; 3]; 3], &[[0, 1, 2]]).is_err());
    }
}
