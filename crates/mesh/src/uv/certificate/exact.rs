//! Signs by exact arithmetic (Shewchuk 1997) of what lies in the plane.

use robust::{Coord, orient2d};

use crate::vec3::{V3, cross, norm, sub};

pub(crate) type V2 = [f64; 2];

/// Points of the plane, scaled by a power of two so that the largest coordinate is near 1: no sign changes, and
/// products stay in the range of f64.
pub(crate) struct Plane {
    points: Vec<V2>,
    pub scale: f64, // scaled = scale * given, a power of two
}

impl Plane {
    pub fn new(positions: &[V2]) -> Self {
        let largest = positions.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        // Small exponents keep both the scale and its inverse in range.
        let exponent = if largest > 0.0 { largest.log2().floor().clamp(-1000.0, 1000.0) as i32 } else { 0 };
        let scale = 2f64.powi(-exponent);
        Plane { points: positions.iter().map(|p| p.map(|x| x * scale)).collect(), scale }
    }

    /// The scaled point.
    pub fn at(&self, id: u32) -> V2 {
        self.points[id as usize]
    }
}

/// det(b - a, c - a), its sign exact: positive where a, b, c run counter-clockwise.
pub(crate) fn orient(a: V2, b: V2, c: V2) -> f64 {
    let p = |v: V2| Coord { x: v[0], y: v[1] };
    orient2d(p(a), p(b), p(c))
}

/// Whether the interiors of two counter-clockwise triangles of positive area intersect: convex sets of the plane have
/// disjoint interiors exactly if the line through an edge of one of them separates them.
pub(crate) fn interiors_intersect(a: [V2; 3], b: [V2; 3]) -> bool {
    let separates = |[p, q]: [V2; 2], other: &[V2; 3]| other.iter().all(|&x| orient(p, q, x) <= 0.0);
    let edges = |t: [V2; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    !(edges(a).into_iter().any(|e| separates(e, &b)) || edges(b).into_iter().any(|e| separates(e, &a)))
}

/// How two segments meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Contact {
    /// Not at all, or at an end that they share.
    None,
    /// They have one common point, inside both.
    Cross,
    /// They have a common point that is an end of one of them, or many.
    Touch,
}

/// How two segments meet that share no end by name: ends at the same place touch.
pub(crate) fn contact([a, b]: [V2; 2], [c, d]: [V2; 2]) -> Contact {
    let (oc, od) = (orient(a, b, c), orient(a, b, d));
    let (oa, ob) = (orient(c, d, a), orient(c, d, b));
    let apart = |x: f64, y: f64| (x > 0.0 && y > 0.0) || (x < 0.0 && y < 0.0);
    if apart(oc, od) || apart(oa, ob) {
        return Contact::None;
    }
    if oc != 0.0 && od != 0.0 && oa != 0.0 && ob != 0.0 {
        return Contact::Cross;
    }
    // On the line of a segment and within its box is on the segment.
    let within =
        |o: f64, x: V2, p: V2, q: V2| o == 0.0 && (0..2).all(|k| p[k].min(q[k]) <= x[k] && x[k] <= p[k].max(q[k]));
    let touch = within(oc, c, a, b) || within(od, d, a, b) || within(oa, a, c, d) || within(ob, b, c, d);
    if touch { Contact::Touch } else { Contact::None }
}

/// Whether the segments from `p` to `a` and to `b` have more in common than `p`.
pub(crate) fn fold(p: V2, a: V2, b: V2) -> bool {
    // On one line: on the same side of p as soon as some coordinate says so.
    let side = |k: usize| (a[k] > p[k] && b[k] > p[k]) || (a[k] < p[k] && b[k] < p[k]);
    orient(p, a, b) == 0.0 && (side(0) || side(1))
}

/// Whether a triangle of the surface has area: exactly, not up to a tolerance (but so much that f64 can hold its
/// square).
pub fn has_rest_area(corners: [[f64; 3]; 3]) -> bool {
    rest_area(corners) > 0.0
}

/// The area of a triangle in space, 0 exactly where it is degenerate.
pub(crate) fn rest_area(x: [V3; 3]) -> f64 {
    let (a, b) = (sub(x[1], x[0]), sub(x[2], x[0]));
    let area = 0.5 * norm(cross(a, b));
    // Rounding is below 1e-14 of the product of the edges; where that could be all of the area, exact arithmetic
    // decides.
    if area > 1e-12 * norm(a) * norm(b) {
        return area;
    }
    let largest = x.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let s = if largest > 0.0 { 2f64.powi(-(largest.log2().floor().clamp(-1000.0, 1000.0) as i32)) } else { 1.0 };
    // The components of the normal, each without cancellation.
    let projected = |i: usize, j: usize| {
        let p = |v: V3| [v[i] * s, v[j] * s];
        orient(p(x[0]), p(x[1]), p(x[2]))
    };
    0.5 * norm([projected(0, 1), projected(1, 2), projected(2, 0)]) / s / s
}
