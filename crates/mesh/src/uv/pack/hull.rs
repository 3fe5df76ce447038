//! Convex hulls and the smallest upright boxes around them, by rotating calipers.

use std::cmp::Ordering;
use std::f64::consts::{FRAC_PI_2, PI};

use robust::{Coord, orient2d};

pub(super) type P2 = [f64; 2];

/// Twice the signed area of a triangle; its sign is exact.
pub(super) fn orientation(a: P2, b: P2, c: P2) -> f64 {
    let at = |p: P2| Coord { x: p[0], y: p[1] };
    orient2d(at(a), at(b), at(c))
}

/// The corners of the convex hull of finite points, counter-clockwise, none on a line between two others
/// (Andrew 1979). Points on one line give its two ends, equal points one.
pub(super) fn convex_hull(mut points: Vec<P2>) -> Vec<P2> {
    points.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull: Vec<P2> = Vec::new();
    let mut chain = |points: &mut dyn Iterator<Item = &P2>| {
        let first = hull.len();
        for &p in points {
            while hull.len() >= first + 2 && orientation(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop(); // the next chain begins with it
    };
    chain(&mut points.iter());
    chain(&mut points.iter().rev());
    hull
}

/// p turned by the angle of cosine and sine `r`.
pub(super) fn turn([c, s]: P2, p: P2) -> P2 {
    [c * p[0] - s * p[1], s * p[0] + c * p[1]]
}

fn dot(a: P2, b: P2) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn sub(a: P2, b: P2) -> P2 {
    [a[0] - b[0], a[1] - b[1]]
}

/// The corners of a hull that are farthest in direction u and in the directions 90, 180 and 270 degrees from it.
/// As u turns counter-clockwise, so do the corners: a whole turn costs as many steps as the hull has corners.
struct Calipers<'a> {
    hull: &'a [P2],
    at: [usize; 4],
}

impl<'a> Calipers<'a> {
    fn new(hull: &'a [P2], u: P2) -> Self {
        let farthest = |d: P2| {
            let best = (0..hull.len()).max_by(|&i, &j| dot(hull[i], d).total_cmp(&dot(hull[j], d)));
            best.unwrap_or(0)
        };
        Calipers { hull, at: directions(u).map(farthest) }
    }

    fn turn_to(&mut self, u: P2) {
        for (at, d) in self.at.iter_mut().zip(directions(u)) {
            for _ in 0..self.hull.len() {
                let next = (*at + 1) % self.hull.len();
                if dot(sub(self.hull[next], self.hull[*at]), d) <= 0.0 {
                    break;
                }
                *at = next;
            }
        }
    }

    /// The vectors across the hull whose parts along u and across u are its width and its height.
    fn across(&self) -> [P2; 2] {
        let [a, b, c, d] = self.at.map(|i| self.hull[i]);
        [sub(a, c), sub(b, d)]
    }

    fn size(&self, u: P2) -> [f64; 2] {
        let [a, b] = self.across();
        [dot(a, u), dot(b, [-u[1], u[0]])]
    }
}

fn directions(u: P2) -> [P2; 4] {
    [u, [-u[1], u[0]], [-u[0], -u[1]], [u[1], -u[0]]]
}

/// The directions of the edges of a hull of two corners or more.
fn edge_directions(hull: &[P2]) -> impl Iterator<Item = P2> {
    (0..hull.len()).filter_map(|i| {
        let d = sub(hull[(i + 1) % hull.len()], hull[i]);
        let length = d[0].hypot(d[1]);
        (length > 0.0).then(|| [d[0] / length, d[1] / length])
    })
}

/// The turn (cosine, sine) after which the upright box around the hull has the least area. One side of the smallest
/// rectangle lies on an edge of the hull (Freeman and Shapira 1975).
pub(super) fn smallest_rectangle(hull: &[P2]) -> P2 {
    let mut best = (f64::INFINITY, f64::INFINITY, [1.0, 0.0]);
    let mut calipers: Option<Calipers<'_>> = None;
    for u in edge_directions(hull) {
        let calipers = calipers.get_or_insert_with(|| Calipers::new(hull, u));
        calipers.turn_to(u);
        let [w, h] = calipers.size(u);
        // Of rectangles without area the shortest one.
        let this = (w * h, w + h, [u[0], -u[1]]);
        if (this.0, this.1) < (best.0, best.1) {
            best = this;
        }
    }
    best.2
}

/// The turn (cosine, sine) after which the longer side of the upright box around the hull is the shortest.
///
/// Between two directions of edges (modulo 90 degrees) the corners that the box touches stay the same, and width and
/// height are arcs of cosines around their maxima, so concave: their larger one is least at an end or where the two
/// are equal.
pub(super) fn smallest_square(hull: &[P2]) -> P2 {
    let mut angles: Vec<f64> = edge_directions(hull).map(|d| d[1].atan2(d[0]).rem_euclid(FRAC_PI_2)).collect();
    angles.sort_unstable_by(f64::total_cmp);
    angles.dedup();
    let mut best = (f64::INFINITY, 0.0);
    let unit = |t: f64| [t.cos(), t.sin()];
    let Some(&first) = angles.first() else { return [1.0, 0.0] };
    let mut calipers = Calipers::new(hull, unit(first));
    for i in 0..angles.len() {
        let (lo, hi) = (angles[i], angles.get(i + 1).copied().unwrap_or(first + FRAC_PI_2));
        calipers.turn_to(unit(0.5 * (lo + hi)));
        // a . (cos, sin) = b . (-sin, cos)
        let [a, b] = calipers.across();
        let equal = (b[1] - a[0]).atan2(a[1] + b[0]);
        let equal = lo + (equal - lo).rem_euclid(PI);
        for t in [lo, equal, hi] {
            let [w, h] = calipers.size(unit(t));
            if t <= hi && w.max(h) < best.0 {
                best = (w.max(h), t);
            }
        }
    }
    let [c, s] = unit(best.1);
    [c, -s]
}
