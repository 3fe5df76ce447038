//! Solids bounded by closed meshes of triangles.

use parry3d_f64::math::Vector;
use parry3d_f64::query::{PointQuery, PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape::{TriMesh, TriMeshFlags, TrianglePointLocation};
use proxel_model::solid::{Nearest, Solid};
use std::fmt;

type V3 = [f64; 3];

/// The inside of a closed mesh of triangles around the origin. The sign of a distance is that of the pseudonormal at the
/// nearest point (Baerentzen and Aanaes 2005).
pub(super) struct ClosedMesh {
    mesh: TriMesh, // of size 1
    size: f64,
    corners: Vec<[u32; 3]>,
    normals: Vec<V3>,
    around: Around,
}

impl fmt::Debug for ClosedMesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ClosedMesh of {} triangles", self.corners.len())
    }
}

/// Nearer to the surface than this part of the size, the direction to it is rounding; the face's normal is not.
const ON_SURFACE: f64 = 1e-7;
/// Halvings of a way on the search for its entrance: to 1e-9 of its length.
const HALVINGS: usize = 30;

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
        let normals = turned.iter().map(|t| normal(&corners(t))).collect();
        Ok(ClosedMesh { mesh, size, normals, around: Around::new(points.len(), &turned), corners: turned })
    }

    /// A point in units of the size.
    fn scaled(&self, x: V3) -> Vector {
        Vector::new(x[0] / self.size, x[1] / self.size, x[2] / self.size)
    }

    fn normal(&self, triangle: u32) -> V3 {
        self.normals.get(triangle as usize).copied().unwrap_or([0.0, 1.0, 0.0])
    }

    /// How far a point is in front of the plane of a triangle, both in units of the size.
    fn in_front(&self, triangle: u32, p: Vector) -> f64 {
        let a = self.mesh.triangle(triangle).a;
        dot(self.normal(triangle), [p.x - a.x, p.y - a.y, p.z - a.z])
    }

    /// Where a way from p ends inside, at q, without an entrance that rounding shows, as where it runs along a face and
    /// enters through the foot of the next one: of the unknown triangles around the place where it comes to be inside
    /// that q is behind, the one that p is farthest in front of.
    fn behind(&self, p: Vector, q: Vector, tolerance: f64, known: &[u32]) -> Option<u32> {
        let is_deep = |x: Vector| {
            let projected = self.mesh.project_local_point(x, false);
            projected.is_inside && (projected.point - x).length() > tolerance
        };
        if !is_deep(q) {
            return None;
        }
        let (mut outside, mut inside) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = (outside + inside) / 2.0;
            if is_deep(p + (q - p) * middle) { inside = middle } else { outside = middle }
        }
        [p + (q - p) * inside, q].into_iter().find_map(|x| {
            let (_, (triangle, location)) = self.mesh.project_local_point_and_get_location(x, false);
            let fits = |t: &u32| !known.contains(t) && self.in_front(*t, q) < 0.0;
            let around = self.meeting(triangle, location).into_iter().filter(fits);
            around.max_by(|a, b| self.in_front(*a, p).total_cmp(&self.in_front(*b, p)))
        })
    }

    /// The triangles that meet where a point of the surface is.
    fn meeting(&self, triangle: u32, location: TrianglePointLocation) -> Vec<u32> {
        let Some(corners) = self.corners.get(triangle as usize) else { return Vec::new() };
        match location {
            TrianglePointLocation::OnVertex(k) => self.around.of(corners[k.min(2) as usize]).to_vec(),
            TrianglePointLocation::OnEdge(k, _) => {
                let (a, b) = match k {
                    0 => (corners[0], corners[1]),
                    1 => (corners[1], corners[2]),
                    _ => (corners[0], corners[2]),
                };
                let other = self.around.of(b);
                self.around.of(a).iter().copied().filter(|t| other.contains(t)).collect()
            }
            _ => vec![triangle],
        }
    }
}

/// The triangles around each vertex.
struct Around {
    ends: Vec<u32>, // of each vertex's part of the list
    triangles: Vec<u32>,
}

impl Around {
    fn new(n: usize, triangles: &[[u32; 3]]) -> Self {
        let mut pairs: Vec<(u32, u32)> = triangles.iter().zip(0u32..).flat_map(|(t, k)| t.map(|v| (v, k))).collect();
        pairs.sort_unstable();
        let ends = (0..n as u32).map(|v| pairs.partition_point(|p| p.0 <= v) as u32).collect();
        Around { ends, triangles: pairs.into_iter().map(|p| p.1).collect() }
    }

    fn of(&self, vertex: u32) -> &[u32] {
        let end = |v: u32| self.ends.get(v as usize).map_or(0, |e| *e as usize);
        let from = if vertex == 0 { 0 } else { end(vertex - 1) };
        self.triangles.get(from..end(vertex)).unwrap_or(&[])
    }
}

impl Solid for ClosedMesh {
    fn nearest(&self, x: V3) -> Nearest {
        let p = self.scaled(x);
        let (projected, (triangle, _)) = self.mesh.project_local_point_and_get_location(p, false);
        let point = [projected.point.x, projected.point.y, projected.point.z];
        let from = [p.x - point[0], p.y - point[1], p.z - point[2]];
        let length = norm(from);
        let sign = if projected.is_inside { -1.0 } else { 1.0 };
        let normal = if length > ON_SURFACE { from.map(|v| sign * v / length) } else { self.normal(triangle) };
        Nearest { point: point.map(|v| v * self.size), normal, distance: sign * length * self.size }
    }

    /// A triangle.
    fn patch(&self, x: V3) -> u32 {
        let p = self.scaled(x);
        let (projected, (triangle, location)) = self.mesh.project_local_point_and_get_location(p, false);
        let mut best = None;
        for t in self.meeting(triangle, location) {
            let distance = self.in_front(t, p);
            // Behind a surface that is hollow there x may be in front of one of the planes.
            let fits = !projected.is_inside || distance < 0.0;
            if fits && best.is_none_or(|(_, most)| distance > most) {
                best = Some((t, distance));
            }
        }
        best.map_or(triangle, |(t, _)| t)
    }

    fn on_patch(&self, patch: u32, x: V3) -> Nearest {
        if patch as usize >= self.corners.len() {
            return self.nearest(x);
        }
        let (normal, distance) = (self.normal(patch), self.in_front(patch, self.scaled(x)) * self.size);
        Nearest { point: [0, 1, 2].map(|d| x[d] - distance * normal[d]), normal, distance }
    }

    fn away(&self, patch: u32, x: V3) -> f64 {
        if patch as usize >= self.corners.len() {
            return f64::INFINITY;
        }
        let p = self.scaled(x);
        let (n, distance) = (self.normal(patch), self.in_front(patch, p));
        // How deep a point is behind a triangle does not make it farther from it.
        let deep = distance.min(0.0);
        let foot = p - Vector::new(n[0], n[1], n[2]) * deep;
        self.mesh.triangle(patch).distance_to_local_point(foot, true) * self.size
    }

    /// Planes of triangles are known to have no more than what is behind them; a triangle that the way ends in front of is no
    /// entrance.
    fn entered(&self, from: V3, to: V3, tolerance: f64, known: &[u32]) -> Option<(u32, V3)> {
        let (p, q, tolerance) = (self.scaled(from), self.scaled(to), tolerance / self.size);
        // From a little before: a point that lies on a face begins in front of it or behind by rounding.
        let back = 2.0 * tolerance / (q - p).length().max(tolerance);
        let ray = Ray::new(p - (q - p) * back, q - p);
        let enters = |t: u32, most: f64| {
            let inward = !known.contains(&t) && self.in_front(t, p) >= -tolerance && self.in_front(t, q) < -tolerance;
            if inward { self.mesh.triangle(t).cast_local_ray(&ray, most, false) } else { None }
        };
        let Some((triangle, time)) = self.mesh.bvh().cast_ray(&ray, 1.0 + back, enters) else {
            return self.behind(p, q, tolerance, known).map(|t| (t, to));
        };
        let at = ray.point_at(time);
        Some((triangle, [at.x, at.y, at.z].map(|v| v * self.size)))
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

fn dot(a: V3, b: V3) -> f64 {
    (0..3).map(|d| a[d] * b[d]).sum()
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
    fn triangles_are_patches() {
        let half = [300.0, 100.0, 50.0];
        let (points, triangles) = brick(half);
        let (mesh, exact) = (ClosedMesh::new(&points, &triangles).unwrap(), Brick { half });
        let steps = [-390.0, -220.0, -99.0, -20.0, 10.0, 77.0, 120.0, 350.0];
        for x in steps.into_iter().flat_map(|x| steps.map(|y| [x, y])).flat_map(|[x, y]| steps.map(|z| [x, y, z])) {
            // The face of a box that a point is farthest in front of, at its corners too.
            let (a, b) = (mesh.on_patch(mesh.patch(x), x), exact.on_patch(exact.patch(x), x));
            assert!((a.distance - b.distance).abs() < 1e-10, "{x:?} {a:?} {b:?}");
        }
        let top = mesh.patch([10.0, 120.0, 3.0]);
        assert!((mesh.away(top, [10.0, 120.0, 3.0]) - 20.0).abs() < 1e-9 && mesh.away(99, [0.0; 3]).is_infinite());
        // Of a way through the box the near side is met, unless that is known; out of it there is no entrance.
        let (from, to) = ([10.0, 500.0, 3.0], [10.0, -500.0, 3.0]);
        let (patch, at) = mesh.entered(from, to, 1e-6, &[]).unwrap();
        assert!(patch == top && (at[1] - 100.0).abs() < 1e-9, "{patch} {at:?}");
        assert!(mesh.entered(from, to, 1e-6, &[top]).is_none());
        assert!(mesh.entered([10.0, 0.0, 3.0], to, 1e-6, &[]).is_none());
        assert!(mesh.entered(from, [10.0, 100.0, 3.0], 1e-6, &[]).is_none(), "the way ends on the surface");
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
