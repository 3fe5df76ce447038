//! Reference surfaces: where they are nearest.

use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::TriMesh;
use proxel_model::constraint::{Closest, V3};

/// A surface of triangles, open or closed, manifold or not: nearest points through a tree of boxes.
pub(super) struct Surface {
    mesh: TriMesh,
}

impl Surface {
    /// Of triangles over points; those without an area are left out, and counted.
    ///
    /// # Errors
    /// No triangle with an area.
    pub fn new(points: &[V3], triangles: &[[u32; 3]]) -> Result<(Self, usize), String> {
        let kept: Vec<[u32; 3]> =
            triangles.iter().filter(|t| has_area(t.map(|v| points[v as usize]))).copied().collect();
        let dropped = triangles.len() - kept.len();
        if kept.is_empty() {
            return Err("no face of it has an area".to_string());
        }
        let vertices = points.iter().map(|p| Vector::new(p[0], p[1], p[2])).collect();
        let mesh = TriMesh::new(vertices, kept).map_err(|e| e.to_string())?;
        Ok((Surface { mesh }, dropped))
    }
}

impl Closest for Surface {
    fn closest(&self, x: V3) -> V3 {
        let p = Vector::new(x[0], x[1], x[2]);
        let point = self.mesh.project_local_point_and_get_location(p, false).0.point;
        [point.x, point.y, point.z]
    }
}

/// Whether a triangle is more than a segment to rounding.
fn has_area([a, b, c]: [V3; 3]) -> bool {
    let (u, v) = ([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let squared = |v: V3| v.iter().map(|c| c * c).sum::<f64>();
    squared(n) > (16.0 * f64::EPSILON).powi(2) * squared(u) * squared(v)
}
