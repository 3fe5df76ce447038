//! The surface of a mesh: is it closed, oriented, a manifold, and of which topology.

use std::collections::HashMap;

use crate::mesh::Polygons;
use crate::topology::{components, polygon_edges};

/// The topology of a set of polygons.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SurfaceTopology {
    /// The vertices that the polygons use.
    pub n_verts: usize,
    /// The edges, each once.
    pub n_edges: usize,
    /// The polygons.
    pub n_faces: usize,
    /// Edges of a single polygon: none where the surface is closed.
    pub boundary_edges: usize,
    /// The connected pieces of the boundary; for a manifold its loops.
    pub boundary_loops: usize,
    /// Edges of three polygons or more, as (smaller, larger), ascending.
    pub non_manifold_edges: Vec<[u32; 2]>,
    /// Edges along which two polygons run in the same direction: one of them is turned around.
    pub misoriented_edges: Vec<[u32; 2]>,
}

impl SurfaceTopology {
    /// V - E + F: 2 for a sphere, 0 for a torus, 1 for a disk; sums over components.
    pub fn euler(&self) -> i64 {
        self.n_verts as i64 - self.n_edges as i64 + self.n_faces as i64
    }

    /// Whether it bounds a body: no boundary, manifold edges, consistent orientation.
    pub fn is_closed_oriented(&self) -> bool {
        self.boundary_edges == 0 && self.non_manifold_edges.is_empty() && self.misoriented_edges.is_empty()
    }
}

/// Examines polygons over `n_verts` vertices.
pub fn surface_topology(n_verts: usize, faces: &Polygons) -> SurfaceTopology {
    let mut out = SurfaceTopology { n_faces: faces.len(), ..Default::default() };
    // For each edge: how often it is run along upwards and downwards.
    let mut uses: HashMap<[u32; 2], [u32; 2]> = HashMap::with_capacity(2 * faces.len());
    for [a, b] in faces.iter().flat_map(polygon_edges) {
        uses.entry([a.min(b), a.max(b)]).or_default()[usize::from(a > b)] += 1;
    }
    let mut boundary = Vec::new();
    for (&e, &[up, down]) in &uses {
        match (up, down) {
            (1, 0) | (0, 1) => boundary.push(e),
            (1, 1) => {}
            (2, 0) | (0, 2) => out.misoriented_edges.push(e),
            _ => out.non_manifold_edges.push(e),
        }
    }
    out.non_manifold_edges.sort_unstable();
    out.misoriented_edges.sort_unstable();
    out.n_edges = uses.len();
    out.boundary_edges = boundary.len();
    out.boundary_loops = components(n_verts, boundary.iter().map(|e| &e[..])).count;
    let mut used: Vec<u32> = faces.indices().to_vec();
    used.sort_unstable();
    used.dedup();
    out.n_verts = used.len();
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disk_sphere_and_defects() {
        let topology = |t: &[[u32; 3]]| surface_topology(6, &Polygons::from(t));
        let disk = topology(&[[0, 1, 2], [0, 2, 3]]);
        assert_eq!((disk.euler(), disk.boundary_edges, disk.boundary_loops), (1, 4, 1));
        let sphere = topology(&[[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]);
        assert!(sphere.is_closed_oriented());
        assert_eq!(sphere.euler(), 2);
        let turned = topology(&[[0, 1, 2], [0, 3, 2]]);
        assert_eq!(turned.misoriented_edges, [[0, 2]]);
        let fan = topology(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        assert_eq!(fan.non_manifold_edges, [[0, 1]]);
    }
}
