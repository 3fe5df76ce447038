//! Who touches whom: boundary, adjacency, edges, components. Every order is that of the file.

use crate::mesh::{Mesh, Polygons};

/// The four faces of a positively oriented tetrahedron, each outward (counter-clockwise seen from
/// outside); face k is opposite to corner k.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The six edges of a tetrahedron.
pub const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Lists of varying length, flat: row `i` is `items[offsets[i]..offsets[i + 1]]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Csr {
    /// Where each row starts, and the end.
    pub offsets: Vec<u32>,
    /// All rows one after the other.
    pub items: Vec<u32>,
}

impl Csr {
    /// Row `i`.
    pub fn row(&self, i: usize) -> &[u32] {
        &self.items[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The faces of a tetrahedral mesh by how many tetrahedra they have.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TetFaces {
    /// Faces of exactly one tetrahedron, outward, in the order of the tetrahedra.
    pub boundary: Vec<[u32; 3]>,
    /// The tetrahedron of each boundary face.
    pub boundary_tet: Vec<u32>,
    /// The number of faces between two tetrahedra.
    pub interior: usize,
    /// Faces of three or more tetrahedra: no solid has them.
    pub non_manifold: Vec<[u32; 3]>,
}

/// Sorts the faces of all tetrahedra into boundary, interior and non-manifold.
pub fn tet_faces(tets: &[[u32; 4]]) -> TetFaces {
    let mut all: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * tets.len());
    for (t, tet) in tets.iter().enumerate() {
        for (k, face) in TET_FACES.iter().enumerate() {
            let mut key = face.map(|c| tet[c]);
            key.sort_unstable();
            all.push((key, (4 * t + k) as u32));
        }
    }
    all.sort_unstable();
    let mut single = Vec::new();
    let mut out = TetFaces::default();
    for group in all.chunk_by(|a, b| a.0 == b.0) {
        match group.len() {
            1 => single.push(group[0].1),
            2 => out.interior += 1,
            _ => out.non_manifold.push(group[0].0),
        }
    }
    single.sort_unstable();
    out.boundary_tet = single.iter().map(|&s| s / 4).collect();
    out.boundary = single.iter().map(|&s| TET_FACES[s as usize % 4].map(|c| tets[s as usize / 4][c])).collect();
    out
}

/// The boundary surface of a tetrahedral mesh: outward triangles over the same vertices.
pub fn boundary_surface(tets: &[[u32; 4]]) -> Vec<[u32; 3]> {
    tet_faces(tets).boundary
}

/// The surface of any mesh: its faces, or the boundary of its tetrahedra where it has no faces.
pub fn surface(mesh: &Mesh) -> Polygons {
    if mesh.faces.is_empty() && !mesh.tets.is_empty() {
        Polygons::from(&boundary_surface(&mesh.tets)[..])
    } else {
        mesh.faces.clone()
    }
}

/// The elements at each vertex, ascending.
pub fn vertex_elements<'a>(n_verts: usize, elements: impl Iterator<Item = &'a [u32]> + Clone) -> Csr {
    let mut offsets = vec![0u32; n_verts + 1];
    for v in elements.clone().flatten() {
        offsets[*v as usize + 1] += 1;
    }
    for i in 0..n_verts {
        offsets[i + 1] += offsets[i];
    }
    let mut items = vec![0; offsets[n_verts] as usize];
    let mut next = offsets.clone();
    for (e, element) in elements.enumerate() {
        for &v in element {
            let slot = &mut next[v as usize];
            items[*slot as usize] = e as u32;
            *slot += 1;
        }
    }
    Csr { offsets, items }
}

/// The edges of all tetrahedra, each once, as (smaller, larger), in lexicographic order.
pub fn tet_edges(tets: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let all = tets.iter().flat_map(|t| TET_EDGES.map(|e| ordered(t[e[0]], t[e[1]]))).collect();
    sorted_unique(all)
}

/// The edges of all polygons, each once, as (smaller, larger), in lexicographic order.
pub fn face_edges(faces: &Polygons) -> Vec<[u32; 2]> {
    sorted_unique(faces.iter().flat_map(polygon_edges).map(|[a, b]| ordered(a, b)).collect())
}

/// The directed edges of one polygon.
pub fn polygon_edges(p: &[u32]) -> impl Iterator<Item = [u32; 2]> + '_ {
    (0..p.len()).map(|k| [p[k], p[(k + 1) % p.len()]])
}

fn ordered(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn sorted_unique(mut edges: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Connected components: elements that share a vertex are connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// The number of components.
    pub count: usize,
    /// The component of each vertex; `None` where no element uses it. Components are numbered by
    /// their smallest vertex.
    pub of_vertex: Vec<Option<u32>>,
}

impl Components {
    /// The vertices that no element uses.
    pub fn unreferenced(&self) -> impl Iterator<Item = u32> + '_ {
        self.of_vertex.iter().enumerate().filter(|(_, c)| c.is_none()).map(|(v, _)| v as u32)
    }
}

/// The connected components of elements over `n_verts` vertices.
pub fn components<'a>(n_verts: usize, elements: impl Iterator<Item = &'a [u32]>) -> Components {
    const UNUSED: u32 = u32::MAX;
    let mut parent = vec![UNUSED; n_verts];
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            let up = parent[parent[v as usize] as usize];
            parent[v as usize] = up;
            v = up;
        }
        v
    }
    for element in elements {
        let mut first = None;
        for &v in element {
            if parent[v as usize] == UNUSED {
                parent[v as usize] = v;
            }
            let r = root(&mut parent, v);
            match first {
                None => first = Some(r),
                Some(f) => {
                    // The smaller root wins, so that a component is named by its smallest vertex.
                    parent[r.max(f) as usize] = r.min(f);
                    first = Some(r.min(f));
                }
            }
        }
    }
    let mut count = 0;
    let mut of_vertex = vec![None; n_verts];
    for v in 0..n_verts as u32 {
        if parent[v as usize] == UNUSED {
            continue;
        }
        let r = root(&mut parent, v);
        if r == v {
            of_vertex[v as usize] = Some(count as u32);
            count += 1;
        } else {
            of_vertex[v as usize] = of_vertex[r as usize];
        }
    }
    Components { count, of_vertex }
}

/// The connected components of all elements of a mesh.
pub fn mesh_components(mesh: &Mesh) -> Components {
    let tets = mesh.tets.iter().map(|t| &t[..]);
    let edges = mesh.edges.iter().map(|e| &e[..]);
    components(mesh.n_verts(), tets.chain(mesh.faces.iter()).chain(edges))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: [[u32; 4]; 2] = [[0, 1, 2, 3], [1, 2, 3, 4]];

    #[test]
    fn two_tets_have_six_boundary_faces() {
        let f = tet_faces(&TWO);
        assert_eq!((f.boundary.len(), f.interior, f.non_manifold.len()), (6, 1, 0));
        assert_eq!(f.boundary_tet, [0, 0, 0, 1, 1, 1]);
        assert_eq!(tet_edges(&TWO).len(), 9);
        let three = [TWO[0], TWO[1], [1, 2, 3, 5]];
        assert_eq!(tet_faces(&three).non_manifold, [[1, 2, 3]]);
    }

    #[test]
    fn adjacency_lists_elements_in_order() {
        let csr = vertex_elements(6, TWO.iter().map(|t| &t[..]));
        assert_eq!((csr.row(0), csr.row(1), csr.row(5)), (&[0][..], &[0, 1][..], &[][..]));
    }

    #[test]
    fn components_are_numbered_by_smallest_vertex() {
        let tets = [[5, 6, 7, 8], [0, 2, 3, 4], [9, 10, 11, 8]];
        let c = components(13, tets.iter().map(|t| &t[..]));
        assert_eq!(c.count, 2);
        assert_eq!(c.of_vertex[11], Some(1));
        assert_eq!(c.of_vertex[4], Some(0));
        assert_eq!(c.unreferenced().collect::<Vec<_>>(), [1, 12]);
    }
}
