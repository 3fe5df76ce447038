//! Quad subdivision: every face of k corners into k quads, through the midpoints of its edges and its centre.
//!
//! The topology of Catmull and Clark 1978. Vertices keep their numbers and places; the midpoints of edges follow, sorted
//! by their edge (smaller end first), then the centres of faces.

use crate::error::{ErrorKind, Result};
use crate::mesh::{Mesh, Polygons};
use crate::topology::face_edges;

/// A surface of quads, and what it was made from.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivided {
    /// The quads, those of a face one after another, the one at corner k with the vertices (corner k, midpoint after it,
    /// centre, midpoint before it). New vertices lie in the middle of what they come from.
    pub mesh: Mesh,
    /// The number of vertices before.
    pub n_original: usize,
    /// The number of midpoints, which come next.
    pub n_edges: usize,
}

/// Subdivides a surface once.
///
/// # Errors
/// Bad indices, tetrahedra, and more vertices or corners than 32 bits count.
pub fn subdivide(mesh: &Mesh) -> Result<Subdivided> {
    mesh.check_indices()?;
    let refuse = |what: &str, remedy: &str| Err(mesh.error(ErrorKind::Unsupported, what, remedy));
    if !mesh.tets.is_empty() {
        return refuse("tetrahedra cannot be subdivided into quads", "give a surface of polygons");
    }
    let edges = face_edges(&mesh.faces);
    let n = mesh.points.len();
    let corners = mesh.faces.indices().len();
    if n + edges.len() + mesh.faces.len() >= u32::MAX as usize || 4 * corners >= u32::MAX as usize {
        let what = "the subdivided mesh has more than 4294967294 vertices or corners";
        return refuse(what, "subdivide fewer times");
    }
    let middle = |[a, b]: [u32; 2]| {
        let key = [a.min(b), a.max(b)];
        // Every edge of every face is in the list.
        (n + edges.partition_point(|e| *e < key)) as u32
    };
    let mean = |of: &[u32]| {
        // Divided first: the sum of large coordinates may overflow.
        let part = 1.0 / of.len().max(1) as f64;
        of.iter().fold([0.0; 3], |s, v| [0, 1, 2].map(|d| s[d] + part * mesh.points[*v as usize][d]))
    };
    let mut points = mesh.points.clone();
    points.extend(edges.iter().map(|e| mean(e)));
    points.extend(mesh.faces.iter().map(mean));
    let mut faces = Polygons::new();
    for (f, face) in mesh.faces.iter().enumerate() {
        let centre = (n + edges.len() + f) as u32;
        let k = face.len();
        for (i, corner) in face.iter().enumerate() {
            let (next, before) = (face[(i + 1) % k], face[(i + k - 1) % k]);
            faces.push(&[*corner, middle([*corner, next]), centre, middle([before, *corner])]);
        }
    }
    let of_children = |regions: &Vec<i32>| {
        let times = mesh.faces.iter().map(<[u32]>::len);
        regions.iter().zip(times).flat_map(|(r, k)| std::iter::repeat_n(*r, k)).collect()
    };
    let out = Mesh {
        name: mesh.name.clone(),
        points,
        faces,
        face_regions: mesh.face_regions.as_ref().map(of_children),
        index_base: mesh.index_base,
        planar: mesh.planar,
        ..Mesh::default()
    };
    Ok(Subdivided { mesh: out, n_original: n, n_edges: edges.len() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::face_edges;

    #[test]
    fn a_cube_becomes_twenty_four_quads() {
        let point = |i: u32| [0, 1, 2].map(|d| f64::from((i >> d) & 1));
        let mut faces = Polygons::new();
        for f in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            faces.push(&f);
        }
        let regions = Some((0..6).collect());
        let cube = Mesh { points: (0..8).map(point).collect(), faces, face_regions: regions, ..Mesh::default() };
        let once = subdivide(&cube).expect("a surface");
        assert_eq!((once.n_original, once.n_edges, once.mesh.n_verts(), once.mesh.faces.len()), (8, 12, 26, 24));
        assert_eq!(once.mesh.points[..8], cube.points[..]);
        assert_eq!(face_edges(&once.mesh.faces).len(), 48);
        // All quads are squares of side 1/2 around the corner that they belong to, and turn as their face does.
        for (i, quad) in once.mesh.faces.iter().enumerate() {
            let p: Vec<[f64; 3]> = quad.iter().map(|v| once.mesh.points[*v as usize]).collect();
            let side = |a: usize, b: usize| (0..3).map(|d| (p[a][d] - p[b][d]).powi(2)).sum::<f64>().sqrt();
            assert!([(0, 1), (1, 2), (2, 3), (3, 0)].iter().all(|(a, b)| (side(*a, *b) - 0.5).abs() < 1e-15));
            assert_eq!(quad[0], cube.faces.get(i / 4)[i % 4]);
            let e = |a: usize, b: usize| [0, 1, 2].map(|d| p[b][d] - p[a][d]);
            let (u, v) = (e(0, 1), e(0, 3));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let out: f64 = (0..3).map(|d| n[d] * (p[2][d] - 0.5)).sum();
            assert!(out > 0.0, "quad {i} looks inward");
        }
        assert_eq!(once.mesh.face_regions.as_ref().map(|r| r[4..9].to_vec()), Some(vec![1, 1, 1, 1, 2]));
        // A triangle becomes three quads; a mesh of tetrahedra nothing.
        let triangle = Mesh::from_triangles("t", vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
        assert_eq!(subdivide(&triangle).map(|s| (s.mesh.n_verts(), s.mesh.faces.len())), Ok((7, 3)));
        let tet = Mesh::from_tets("tet", vec![[0.0; 3]; 4], vec![[0, 1, 2, 3]]);
        assert!(subdivide(&tet).expect_err("refused").to_string().contains("give a surface"));
    }
}
