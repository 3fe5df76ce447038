//! Uniform refinement: every tetrahedron into 8, triangle into 4, edge into 2, at edge midpoints.
//!
//! Vertices keep their numbers; the midpoints follow, sorted by their edge (smaller end first).
//! The inner octahedron of a tetrahedron is split along its shortest diagonal at rest (Bey 1995
//! keeps one fixed diagonal, which lets shapes decay where it is a long one).

use crate::error::{ErrorKind, Item, Result};
use crate::mesh::{Mesh, Polygons};
use crate::topology::{TET_EDGES, polygon_edges};
use crate::vec3::{V3, dot, sub};

/// A refined mesh and where its new vertices come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Refined {
    /// The refined mesh. Its elements follow those that they come from: children of element i stand
    /// at 8 i (tetrahedra), 4 i (triangles), 2 i (edges).
    pub mesh: Mesh,
    /// The two ends of each new vertex; new vertex k has the number `n_original + k`.
    pub midpoint_of: Vec<[u32; 2]>,
    /// The number of vertices before.
    pub n_original: usize,
}

impl Refined {
    /// Carries a second configuration over (a start, a reference): midpoints are those of its edges.
    ///
    /// # Errors
    /// [`ErrorKind::CountMismatch`] unless there is one position for each original vertex.
    pub fn positions(&self, coarse: &[[f64; 3]]) -> Result<Vec<[f64; 3]>> {
        if coarse.len() != self.n_original {
            return Err(self.mesh.error(
                ErrorKind::CountMismatch,
                format!("{} positions for {} vertices", coarse.len(), self.n_original),
                "give one position for each vertex of the mesh before refinement",
            ));
        }
        Ok(with_midpoints(coarse, &self.midpoint_of))
    }

    /// Carries pinned vertices over: a midpoint is pinned where both ends are. The given ones come
    /// first, in their order, then the midpoints, ascending.
    ///
    /// # Errors
    /// [`ErrorKind::IndexOutOfRange`] for a pin that was no vertex.
    pub fn pins(&self, coarse: &[u32]) -> Result<Vec<u32>> {
        let mut pinned = vec![false; self.n_original];
        for &v in coarse {
            match pinned.get_mut(v as usize) {
                Some(p) => *p = true,
                None => {
                    return Err(self.mesh.error(
                        ErrorKind::IndexOutOfRange,
                        format!("pin {v} is out of range, the vertices are 0 to {}", self.n_original - 1),
                        "correct the pin",
                    ));
                }
            }
        }
        let both = |e: &[u32; 2]| pinned[e[0] as usize] && pinned[e[1] as usize];
        let new = (self.n_original as u32..).zip(&self.midpoint_of);
        Ok(coarse.iter().copied().chain(new.filter(|(_, e)| both(e)).map(|(v, _)| v)).collect())
    }
}

/// Refines every element once.
///
/// # Errors
/// Bad indices; a face of more than three corners; more vertices or corners than 32 bits count.
pub fn refine(mesh: &Mesh) -> Result<Refined> {
    mesh.check_indices()?;
    if let Some(i) = mesh.faces.iter().position(|p| p.len() != 3) {
        return Err(mesh
            .error(
                ErrorKind::Unsupported,
                format!("a face of {} vertices cannot be refined", mesh.faces.get(i).len()),
                "triangulate it first",
            )
            .at_item(Item::Face(i)));
    }
    let mut edges: Vec<[u32; 2]> = Vec::with_capacity(6 * mesh.tets.len());
    let sorted = |a: u32, b: u32| [a.min(b), a.max(b)];
    edges.extend(mesh.tets.iter().flat_map(|t| TET_EDGES.map(|e| sorted(t[e[0]], t[e[1]]))));
    edges.extend(mesh.faces.iter().flat_map(polygon_edges).map(|[a, b]| sorted(a, b)));
    edges.extend(mesh.edges.iter().map(|&[a, b]| sorted(a, b)));
    edges.sort_unstable();
    edges.dedup();

    let n = mesh.points.len();
    let most = [n + edges.len(), 8 * mesh.tets.len(), 12 * mesh.faces.len()];
    if most.iter().any(|&m| m >= u32::MAX as usize) {
        return Err(mesh.error(
            ErrorKind::Unsupported,
            "the refined mesh has more than 4294967294 vertices or elements",
            "refine fewer times",
        ));
    }
    let mut starts = vec![0u32; n + 1]; // edges from vertex v: edges[starts[v]..starts[v + 1]]
    edges.iter().for_each(|e| starts[e[0] as usize + 1] += 1);
    (0..n).for_each(|v| starts[v + 1] += starts[v]);
    let middle = |a: u32, b: u32| -> u32 {
        let (a, b) = (a.min(b), a.max(b));
        let row = &edges[starts[a as usize] as usize..starts[a as usize + 1] as usize];
        // Every edge of every element is in the list.
        (n + starts[a as usize] as usize + row.partition_point(|e| e[1] < b)) as u32
    };

    let points = with_midpoints(&mesh.points, &edges);
    let mut tets = Vec::with_capacity(8 * mesh.tets.len());
    for t in &mesh.tets {
        tets.extend(split_tet(*t, TET_EDGES.map(|e| middle(t[e[0]], t[e[1]])), &points));
    }
    let mut faces = Polygons::new();
    for p in mesh.faces.iter() {
        let [a, b, c] = [p[0], p[1], p[2]];
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        for t in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            faces.push(&t);
        }
    }
    let halves = mesh.edges.iter().flat_map(|&[a, b]| [[a, middle(a, b)], [middle(a, b), b]]);
    let refined = Mesh {
        name: mesh.name.clone(),
        points,
        tets,
        faces,
        edges: halves.collect(),
        tet_regions: repeat(&mesh.tet_regions, 8),
        face_regions: repeat(&mesh.face_regions, 4),
        edge_regions: repeat(&mesh.edge_regions, 2),
        index_base: mesh.index_base,
        planar: mesh.planar,
    };
    Ok(Refined { mesh: refined, midpoint_of: edges, n_original: n })
}

fn repeat(regions: &Option<Vec<i32>>, times: usize) -> Option<Vec<i32>> {
    let each = |r: &i32| std::iter::repeat_n(*r, times);
    regions.as_ref().map(|r| r.iter().flat_map(each).collect())
}

fn with_midpoints(points: &[V3], edges: &[[u32; 2]]) -> Vec<V3> {
    let middle = |&[a, b]: &[u32; 2]| -> V3 {
        let (a, b) = (points[a as usize], points[b as usize]);
        // Halved first: the sum of two large coordinates may overflow.
        std::array::from_fn(|c| 0.5 * a[c] + 0.5 * b[c])
    };
    points.iter().copied().chain(edges.iter().map(middle)).collect()
}

/// The eight children, all with the orientation of the parent: the four corners first. Midpoints in
/// the order of [`TET_EDGES`].
fn split_tet(v: [u32; 4], m: [u32; 6], points: &[V3]) -> [[u32; 4]; 8] {
    let [m01, m02, m03, m12, m13, m23] = m;
    // Each diagonal and the other four midpoints around it; the second and the third row follow from
    // the first by rotating the corners 1, 2, 3.
    let choices =
        [([m01, m23], [m02, m03, m13, m12]), ([m02, m13], [m03, m01, m12, m23]), ([m03, m12], [m01, m02, m23, m13])];
    let length = |[a, b]: [u32; 2]| {
        let d = sub(points[a as usize], points[b as usize]);
        dot(d, d)
    };
    let (mut best, mut shortest) = (0, length(choices[0].0));
    for k in 1..3 {
        let l = length(choices[k].0);
        if l < shortest {
            (best, shortest) = (k, l);
        }
    }
    let ([a, b], r) = choices[best];
    [
        [v[0], m01, m02, m03],
        [m01, v[1], m12, m13],
        [m02, m12, v[2], m23],
        [m03, m13, m23, v[3]],
        [a, b, r[0], r[1]],
        [a, b, r[1], r[2]],
        [a, b, r[2], r[3]],
        [a, b, r[3], r[0]],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{check_tets, volume};
    use crate::generate::{CellSplit, ball, beam, cloth};
    use crate::topology::tet_faces;

    #[test]
    fn children_fill_the_parent_along_every_diagonal() {
        // Stretched so that each of the three diagonals is the shortest once.
        for axis in 0..3 {
            let mut p = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let mut far = [0.3; 3];
            far[axis] = -2.0;
            p[1 + axis] = far;
            let mut tets = vec![[0, 1, 2, 3]];
            crate::check::fix_orientation(&p, &mut tets);
            let mesh = Mesh::from_tets("t", p, tets);
            let whole = volume(mesh.tets[0].map(|v| mesh.points[v as usize]));
            let fine = refine(&mesh).unwrap().mesh;
            for t in &fine.tets {
                let v = volume(t.map(|v| fine.points[v as usize]));
                assert!((8.0 * v / whole - 1.0).abs() < 1e-14, "{v} of {whole}");
            }
        }
    }

    #[test]
    fn bodies_keep_volume_orientation_and_boundary() {
        let mesh = ball(1.0, 0.3).unwrap();
        let before = check_tets(&mesh.points, &mesh.tets);
        let fine = refine(&mesh).unwrap();
        let after = check_tets(&fine.mesh.points, &fine.mesh.tets);
        assert_eq!(fine.mesh.tets.len(), 8 * mesh.tets.len());
        assert_eq!((after.negative.len(), after.zero.len()), (0, 0));
        assert!((after.total / before.total - 1.0).abs() < 1e-12);
        assert_eq!(fine.mesh.points[..mesh.points.len()], mesh.points[..]);
        let (f0, f1) = (tet_faces(&mesh.tets), tet_faces(&fine.mesh.tets));
        assert_eq!(f1.boundary.len(), 4 * f0.boundary.len());
        assert_eq!(f1.non_manifold.len(), 0);
    }

    #[test]
    fn starts_and_pins_follow() {
        let mesh = beam([1, 1, 1], [1.0; 3], CellSplit::Five).unwrap();
        let fine = refine(&mesh).unwrap();
        let start: Vec<_> = mesh.points.iter().map(|p| p.map(|c| 3.0 * c + 1.0)).collect();
        let carried = fine.positions(&start).unwrap();
        for (p, q) in fine.mesh.points.iter().zip(&carried) {
            assert_eq!(p.map(|c| 3.0 * c + 1.0), *q);
        }
        // The four corners of one side: its four edges and one diagonal of the tetrahedra.
        let pins = fine.pins(&[4, 5, 6, 7]).unwrap();
        assert_eq!(pins.len(), 4 + 5);
        assert!(pins.iter().all(|&v| fine.mesh.points[v as usize][2] == 0.5));
        assert!(fine.pins(&[8]).is_err() && fine.positions(&start[1..]).is_err());
    }

    #[test]
    fn triangles_edges_and_regions() {
        let mut mesh = cloth([2, 2], [1.0, 1.0]).unwrap();
        mesh.face_regions = Some((0..8).collect());
        mesh.edges = vec![[0, 1]];
        let fine = refine(&mesh).unwrap().mesh;
        assert_eq!((fine.points.len(), fine.faces.len(), fine.edges.len()), (25, 32, 2));
        assert_eq!(fine.face_regions.as_ref().unwrap()[4..8], [1; 4]);
        let c = crate::check::check_triangles(&fine.points, &fine.faces.as_triangles().unwrap(), true);
        assert!(c.negative.is_empty() && (c.total - 1.0).abs() < 1e-14);
    }
}
