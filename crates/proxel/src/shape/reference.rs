//! Reference surfaces: where they are nearest.

use proxel_model::constraint::{Surface, V3};

/// The surface of triangles over points; those without an area are left out, and counted.
///
/// # Errors
/// No triangle with an area.
pub(crate) fn surface(points: &[V3], triangles: &[[u32; 3]]) -> Result<(Surface, usize), String> {
    let kept: Vec<[u32; 3]> = triangles.iter().filter(|t| has_area(t.map(|v| points[v as usize]))).copied().collect();
    let dropped = triangles.len() - kept.len();
    if kept.is_empty() {
        return Err("no face of it has an area".to_string());
    }
    Ok((Surface::new(points, &kept).map_err(|e| e.to_string())?, dropped))
}

/// Whether a triangle is more than a segment to rounding.
fn has_area([a, b, c]: [V3; 3]) -> bool {
    let (u, v) = ([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let squared = |v: V3| v.iter().map(|c| c * c).sum::<f64>();
    squared(n) > (16.0 * f64::EPSILON).powi(2) * squared(u) * squared(v)
}
