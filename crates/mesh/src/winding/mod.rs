//! The generalised winding number of a triangle soup: how often it goes around a point. Jacobson, Kavan and
//! Sorkine-Hornung 2013; fast by moments of groups of triangles, Barill, Dickson, Schmidt, Levin and Jacobson 2018.
//!
//! ```text
//! w(q) = 1/(4 pi) sum_t Omega_t(q),   Omega_t the signed solid angle of triangle t seen from q
//! ```
//!
//! It is 1 inside and 0 outside a closed surface with outward normals, counts how often where surfaces overlap, and is
//! harmonic away from the triangles. So a hole changes it smoothly, and 1/2 still tells inside from outside.

mod moments;
mod tree;

#[cfg(test)]
mod tests;

pub use tree::WindingTree;

use crate::vec3::{V3, cross, dot, norm, sub};
use std::f64::consts::PI;

/// The signed solid angle of a triangle with corners a, b, c seen from the origin, in (-2 pi, 2 pi); positive where the
/// origin is behind it (normals point away). van Oosterom and Strackee 1983:
///
/// ```text
/// tan(Omega / 2) = det(a, b, c) / (|a||b||c| + (a.b)|c| + (b.c)|a| + (c.a)|b|)
/// ```
pub(crate) fn solid_angle([a, b, c]: [V3; 3]) -> f64 {
    let (la, lb, lc) = (norm(a), norm(b), norm(c));
    let above = dot(a, cross(b, c));
    let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    // On the triangle, at its edge or corner: both vanish, or the angle jumps; half of it is what lies on either side.
    if above == 0.0 { 0.0 } else { 2.0 * above.atan2(below) }
}

/// w(q) by the sum over all triangles: what [`WindingTree`] approximates. Indices must be in range.
///
/// ```
/// use proxel_mesh::winding::winding_number;
/// let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let tet = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
/// assert!((winding_number(&points, &tet, [0.1, 0.1, 0.1]) - 1.0).abs() < 1e-14);
/// assert!(winding_number(&points, &tet, [1.0, 1.0, 1.0]).abs() < 1e-14);
/// ```
pub fn winding_number(points: &[[f64; 3]], triangles: &[[u32; 3]], q: [f64; 3]) -> f64 {
    let angle = |t: &[u32; 3]| solid_angle(t.map(|v| sub(points[v as usize], q)));
    triangles.iter().map(angle).sum::<f64>() / (4.0 * PI)
}
