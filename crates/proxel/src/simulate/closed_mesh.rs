//! Solids bounded by closed meshes of triangles.

use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};
use proxel_model::solid::{Nearest, Solid};
use std::fmt;

type V3 = [f64; 3];

/// The inside of a closed mesh of triangles around the origin. The sign of a distance is that of the pseudonormal at the
/// nearest point (Baerentzen and Aanaes 2005).
pub(super) struct ClosedMesh {
    mesh: TriMesh, // of size 1
    size: f64,
    triangles: Vec<[V3; 3]>,
}

impl fmt::Debug for ClosedMesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ClosedMesh of {} triangles", self.triangles.len())
    }
}

/// Nearer to the surface than this part of the size, the direction to it is rounding; the face's normal is not.
const ON_SURFACE: f64 = 1e-7;

impl ClosedMesh {
    /// Of triangles over points; turned around where their normals point inward.
    ///
    /// # Errors
    /// What keeps it from having an inside: an edge without a partner, no volume.
    pub fn new(points: &[V3], triangles: &[[u32; 3]]) -> Result<Self, String> {
        if triangles.is_empty() {
            return Err("it has no faces".to_string());
        }
        closed(triangles)?;
        let size = points.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        if !(size > 0.0 && size.is_finite()) {
            return Err(format!("its size is {size}"));
        }
        let unit: Vec<V3> = points.iter().map(|p| p.map(|v| v / size)).collect();
        let corners = |t: &[u32; 3]| t.map(|v| unit[v as usize]);
        let volume: f64 = triangles.iter().map(|t| determinant(corners(t))).sum();
        if volume == 0.0 || volume.is_nan() {
            return Err("it encloses no volume".to_string());
        }
        let turned: Vec<[u32; 3]> =
            triangles.iter().map(|t| if volume < 0.0 { [t[0], t[2], t[1]] } else { *t }).collect();
        let vertices = unit.iter().map(|p| Vector::new(p[0], p[1], p[2])).collect();
        let mesh = TriMesh::with_flags(vertices, turned.clone(), TriMeshFlags::ORIENTED).map_err(|e| e.to_string())?;
        Ok(ClosedMesh { mesh, size, triangles: turned.iter().map(corners).collect() })
    }
}

impl Solid for ClosedMesh {
    fn nearest(&self, x: V3) -> Nearest {
        let p = x.map(|v| v / self.size);
        let (projected, (triangle, _)) =
            self.mesh.project_local_point_and_get_location(Vector::new(p[0], p[1], p[2]), false);
        let point = [projected.point.x, projected.point.y, projected.point.z];
        let from = [0, 1, 2].map(|d| p[d] - point[d]);
        let length = norm(from);
        let sign = if projected.is_inside { -1.0 } else { 1.0 };
        let normal = if length > ON_SURFACE {
            from.map(|v| sign * v / length)
        } else {
            self.triangles.get(triangle as usize).map_or([0.0, 1.0, 0.0], normal)
        };
        Nearest { point: point.map(|v| v * self.size), normal, distance: sign * length * self.size }
    }
}

/// Every edge has one triangle on each side.
fn closed(triangles: &[[u32; 3]]) -> Result<(), String> {
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).collect();
    edges.sort_unstable();
    if let Some(e) = edges.windows(2).find(|e| e[0] == e[1]).map(|e| e[0]) {
        return Err(format!("two of its faces run along the edge {} {} (0-based) the same way", e[0], e[1]));
    }
    match edges.iter().find(|[a, b]| edges.binary_search(&[*b, *a]).is_err()) {
        Some([a, b]) => Err(format!("it is not closed: the edge {a} {b} (0-based) has a face on one side only")),
        None => Ok(()),
    }
}

fn determinant([a, b, c]: [V3; 3]) -> f64 {
    let n = cross(b, c);
    (0..3).map(|d| a[d] * n[d]).sum()
}

fn normal([a, b, c]: &[V3; 3]) -> V3 {
    let n = cross([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
    let length = norm(n);
    if length > 0.0 { n.map(|v| v / length) } else { [0.0, 1.0, 0.0] }
}

fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: V3) -> f64 {
    a.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// The closed mesh of the ground below heights over a grid: points relative to the grid's corner at height 0.
pub(super) fn terrain(spacing: [f64; 2], heights: &[Vec<f64>], depth: f64) -> (Vec<V3>, Vec<[u32; 3]>) {
    let (rows, columns) = (heights.len(), heights.first().map_or(0, Vec::len));
    let bottom = heights.iter().flatten().fold(f64::INFINITY, |m, h| m.min(*h)) - depth;
    let top = |i: usize, j: usize| (i * columns + j) as u32;
    let low = |i: usize, j: usize| (rows * columns + i * columns + j) as u32;
    let at = |i: usize, j: usize, y: f64| [j as f64 * spacing[0], y, i as f64 * spacing[1]];
    let grid = || (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
    let mut points: Vec<V3> = grid().map(|(i, j)| at(i, j, heights[i][j])).collect();
    points.extend(grid().map(|(i, j)| at(i, j, bottom)));
    let mut triangles = Vec::new();
    for i in 0..rows.saturating_sub(1) {
        for j in 0..columns.saturating_sub(1) {
            let (a, b, c, d) = (top(i, j), top(i, j + 1), top(i + 1, j), top(i + 1, j + 1));
            triangles.extend([[a, c, b], [b, c, d]]);
            let (a, b, c, d) = (low(i, j), low(i, j + 1), low(i + 1, j), low(i + 1, j + 1));
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    let mut wall = |a: (usize, usize), b: (usize, usize)| {
        let (ta, tb, la, lb) = (top(a.0, a.1), top(b.0, b.1), low(a.0, a.1), low(b.0, b.1));
        triangles.extend([[ta, tb, lb], [ta, lb, la]]);
    };
    let (r, c) = (rows.saturating_sub(1), columns.saturating_sub(1));
    for j in 0..c {
        wall((0, j), (0, j + 1));
        wall((r, j + 1), (r, j));
    }
    for i in 0..r {
        wall((i + 1, 0), (i, 0));
        wall((i, c), (i + 1, c));
    }
    (points, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proxel_mesh::generate::ball;
    use proxel_mesh::topology::boundary_surface;
    use proxel_model::solid::Brick;

    /// A box of 12 triangles.
    fn brick(half: V3) -> (Vec<V3>, Vec<[u32; 3]>) {
        let points =
            (0..8).map(|c: usize| [0, 1, 2].map(|d| if c >> d & 1 == 1 { half[d] } else { -half[d] })).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        (points, quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect())
    }

    #[test]
    fn a_box_of_triangles_is_a_box() {
        let half = [300.0, 100.0, 50.0];
        let (points, triangles) = brick(half);
        let (mesh, exact) = (ClosedMesh::new(&points, &triangles).unwrap(), Brick { half });
        let turned: Vec<[u32; 3]> = triangles.iter().map(|t| [t[1], t[0], t[2]]).collect();
        let other = ClosedMesh::new(&points, &turned).unwrap();
        let steps = [-390.0, -220.0, -99.0, -20.0, 10.0, 77.0, 120.0, 350.0];
        for x in steps.into_iter().flat_map(|x| steps.map(|y| [x, y])).flat_map(|[x, y]| steps.map(|z| [x, y, z])) {
            let (a, b) = (mesh.nearest(x), exact.nearest(x));
            assert!((a.distance - b.distance).abs() < 1e-10, "{x:?} {a:?} {b:?}");
            assert!(norm([0, 1, 2].map(|d| a.normal[d] - b.normal[d])) < 1e-9, "{x:?} {a:?} {b:?}");
            assert_eq!(other.nearest(x).distance < 0.0, b.distance < 0.0, "orientation does not matter");
        }
        let on = mesh.nearest([10.0, 100.0, 3.0]);
        assert!(on.distance.abs() < 1e-10 && on.normal == [0.0, 1.0, 0.0], "{on:?}");
    }

    #[test]
    fn terrains_are_closed_and_solid_below() {
        let heights = vec![vec![0.0, 1.0, 0.0], vec![2.0, 0.5, 0.0], vec![0.0, 0.0, -1.0]];
        let (points, triangles) = terrain([2.0, 3.0], &heights, 4.0);
        let solid = ClosedMesh::new(&points, &triangles).unwrap();
        assert!(solid.nearest([0.0, 2.0, 0.1]).distance > 0.0 && solid.nearest([2.0, 0.3, 3.0]).distance < 0.0);
        let peak = solid.nearest([0.01, 5.0, 3.0]);
        assert!((peak.distance - 3.0).abs() < 0.1 && peak.normal[1] > 0.9, "{peak:?}");
        assert!(solid.nearest([2.0, -6.0, 3.0]).distance > 0.0, "below the bottom");
    }

    #[test]
    fn open_and_flat_ones_are_refused() {
        let (points, triangles) = brick([1.0; 3]);
        let said = |t: &[[u32; 3]]| ClosedMesh::new(&points, t).unwrap_err();
        assert!(said(&triangles[1..]).contains("not closed: the edge"));
        assert!(said(&[]).contains("no faces"));
        assert!(said(&[[0, 1, 2], [0, 2, 1]]).contains("no volume"));
        assert!(said(&[[0, 1, 2], [0, 1, 3]]).contains("the same way"));
        let body = ball(1.0, 0.25).unwrap();
        let solid = ClosedMesh::new(&body.points, &boundary_surface(&body.tets)).unwrap();
        assert!((solid.nearest([0.0, 0.0, 0.0]).distance + 1.0).abs() < 0.1);
        assert!(format!("{solid:?}").contains("triangles"));
    }
}
