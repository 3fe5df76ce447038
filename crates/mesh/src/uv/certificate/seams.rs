//! Where a map is cut, and the border of its charts in the plane.

use crate::mesh::Polygons;
use crate::uv::layout::{Layout, is_seam};
use crate::vec3::{Sum, norm, sub};

/// The length of all seams on the surface, and the edges of the plane (UV vertices) that have exactly one face.
/// Faces marked in `copies` have no say about the border.
pub(super) fn seams(
    points: &[[f64; 3]],
    faces: &Polygons,
    layout: &Layout,
    copies: &[bool],
) -> (f64, Vec<([u32; 2], u32)>) {
    let mut length = Sum::default();
    let mut border = Vec::new();
    layout.for_each_edge(faces, |edge, uses| {
        if is_seam(uses) {
            let [a, b] = edge.map(|v| points[v as usize]);
            length.add(norm(sub(a, b)));
        }
        for same in uses.chunk_by(|a, b| a.uv == b.uv) {
            let mut originals = same.iter().filter(|s| !copies[s.face as usize]);
            if let (Some(side), None) = (originals.next(), originals.next()) {
                border.push((side.uv, side.face));
            }
        }
    });
    (length.value(), border)
}

/// The diagonal of the box around all points; 0 without points.
pub(super) fn diagonal(points: &[[f64; 3]]) -> f64 {
    let low = |d: usize| points.iter().fold(f64::INFINITY, |m, p| m.min(p[d]));
    let high = |d: usize| points.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[d]));
    if points.is_empty() { 0.0 } else { norm([0, 1, 2].map(|d| high(d) - low(d))) }
}
