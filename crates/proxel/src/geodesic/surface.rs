//! A surface as lengths of edges: all that geodesics depend on.

use super::GeodesicError;
use proxel_mesh::Mesh;
use proxel_mesh::topology::{components, surface};

/// Triangles with lengths, in units of the diagonal of the bounding box.
#[derive(Debug)]
pub struct Surface {
    /// What the mesh is called.
    pub name: String,
    /// Vertices, used or not.
    pub n: usize,
    /// Triangles with three different vertices; polygons are fans of them.
    pub triangles: Vec<[u32; 3]>,
    /// Edges, lower vertex first, in lexicographic order.
    pub edges: Vec<[u32; 2]>,
    /// The edges of each triangle: of its corners 0 and 1, 1 and 2, 2 and 0.
    pub face_edges: Vec<[u32; 3]>,
    /// Lengths of edges.
    pub lengths: Vec<f64>,
    /// Each triangle laid into the plane, corner 0 at the origin and corner 1 on the first axis.
    pub corners: Vec<[[f64; 2]; 3]>,
    /// Areas of triangles.
    pub area: Vec<f64>,
    /// The unit of length.
    pub scale: f64,
    /// What was done to the input.
    pub repaired: Vec<String>,
}

/// In every triangle two edges are longer than the third by at least this part of the mean edge: what is flatter has
/// cotangents of no meaning (Sharp and Crane 2020, *A Laplacian for nonmanifold triangle meshes*, section 4.5).
const SLACK: f64 = 1e-5;

impl Surface {
    /// Of the faces of a mesh, or the boundary of its tetrahedra.
    ///
    /// # Errors
    /// A mesh without faces, coordinates that are not finite, indices out of range, a surface that is one point.
    pub fn new(mesh: &Mesh) -> Result<Self, GeodesicError> {
        mesh.check_indices()?;
        let all = surface(mesh).fan_triangles();
        let mut repaired = Vec::new();
        let triangles: Vec<[u32; 3]> = all.iter().copied().filter(|[a, b, c]| a != b && b != c && c != a).collect();
        if triangles.len() < all.len() {
            let dropped = all.len() - triangles.len();
            repaired.push(format!("{}: {dropped} triangles that use a vertex twice are left out", mesh.name));
        }
        if triangles.is_empty() {
            return Err(GeodesicError(format!("{}: it has no faces; give a surface", mesh.name)));
        }
        let (lo, hi) = mesh.bounding_box().unwrap_or_default();
        // Halves, since the whole may overflow.
        let half = [0, 1, 2].map(|k| 0.5 * hi[k] - 0.5 * lo[k]);
        let scale = 2.0 * half[0].hypot(half[1]).hypot(half[2]);
        if !(scale > 0.0 && scale.is_finite()) {
            let text =
                format!("{}: the diagonal of its bounding box is {scale}; give a surface with a size", mesh.name);
            return Err(GeodesicError(text));
        }
        let (edges, face_edges) = edges_of(&triangles);
        let mut lengths: Vec<f64> = edges
            .iter()
            .map(|[a, b]| {
                let (p, q) = (mesh.points[*a as usize], mesh.points[*b as usize]);
                let d = [0, 1, 2].map(|k| (q[k] - p[k]) / scale);
                (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
            })
            .collect();
        let added = mollify(&face_edges, &mut lengths);
        if added > 0.0 {
            repaired.push(format!(
                "{}: edges count as {:e} longer, so that every triangle has an area",
                mesh.name,
                added * scale
            ));
        }
        let corners: Vec<[[f64; 2]; 3]> = face_edges.iter().map(|e| laid(e.map(|e| lengths[e as usize]))).collect();
        let area = corners.iter().map(|c| 0.5 * c[1][0] * c[2][1]).collect();
        let name = mesh.name.clone();
        Ok(Surface { name, n: mesh.n_verts(), triangles, edges, face_edges, lengths, corners, area, scale, repaired })
    }

    /// The mean length of an edge.
    pub fn mean_edge(&self) -> f64 {
        self.lengths.iter().sum::<f64>() / self.lengths.len() as f64
    }

    /// The gradients of the three hat functions of a triangle, in its frame: each corner's points away from the edge opposite.
    pub fn hats(&self, f: usize) -> [[f64; 2]; 3] {
        let (c, double) = (&self.corners[f], 2.0 * self.area[f]);
        [0, 1, 2].map(|k| {
            let (a, b) = (c[(k + 1) % 3], c[(k + 2) % 3]);
            [(a[1] - b[1]) / double, (b[0] - a[0]) / double]
        })
    }

    /// The unit vector of the k-th edge of a triangle from the vertex of lower number, in its frame; and whether the triangle
    /// runs through the edge that way.
    pub fn direction(&self, f: usize, k: usize) -> ([f64; 2], bool) {
        let (a, b) = (self.corners[f][k], self.corners[f][(k + 1) % 3]);
        let forward = self.triangles[f][k] < self.triangles[f][(k + 1) % 3];
        let length = self.lengths[self.face_edges[f][k] as usize];
        let sign = if forward { 1.0 } else { -1.0 };
        ([sign * (b[0] - a[0]) / length, sign * (b[1] - a[1]) / length], forward)
    }

    /// For each vertex whether it is at an edge of one triangle only.
    pub fn border(&self) -> Vec<bool> {
        let mut faces = vec![0u32; self.edges.len()];
        self.face_edges.iter().flatten().for_each(|e| faces[*e as usize] += 1);
        let mut border = vec![false; self.n];
        for (edge, _) in self.edges.iter().zip(&faces).filter(|(_, n)| **n == 1) {
            edge.iter().for_each(|v| border[*v as usize] = true);
        }
        border
    }

    /// For each vertex the lowest vertex that triangles join it with; itself where it is alone.
    pub fn components(&self) -> Vec<u32> {
        let found = components(self.n, self.edges.iter().map(|edge| &edge[..]));
        let mut lowest = vec![None; found.count];
        let name = |(v, c): (u32, &Option<u32>)| c.map_or(v, |c| *lowest[c as usize].get_or_insert(v));
        (0..).zip(&found.of_vertex).map(name).collect()
    }
}

/// The edges of triangles, and which are each triangle's.
fn edges_of(triangles: &[[u32; 3]]) -> (Vec<[u32; 2]>, Vec<[u32; 3]>) {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (f, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], (3 * f + k) as u32));
        }
    }
    sides.sort_unstable();
    let (mut edges, mut face_edges): (Vec<[u32; 2]>, _) = (Vec::new(), vec![[0; 3]; triangles.len()]);
    for (edge, side) in sides {
        if edges.last() != Some(&edge) {
            edges.push(edge);
        }
        face_edges[side as usize / 3][side as usize % 3] = edges.len() as u32 - 1;
    }
    (edges, face_edges)
}

/// Makes all edges longer by what the flattest triangle lacks; returns that.
fn mollify(face_edges: &[[u32; 3]], lengths: &mut [f64]) -> f64 {
    let slack = SLACK * lengths.iter().sum::<f64>() / lengths.len() as f64;
    let lack = |e: &[u32; 3]| {
        let [a, b, c] = e.map(|e| lengths[e as usize]);
        slack - (a + b - c).min(b + c - a).min(c + a - b)
    };
    let added = face_edges.iter().map(lack).fold(0.0, f64::max);
    if added > 0.0 {
        lengths.iter_mut().for_each(|l| *l += added);
    }
    added
}

/// The triangle of edges 0-1, 1-2, 2-0 in the plane.
fn laid([ab, bc, ca]: [f64; 3]) -> [[f64; 2]; 3] {
    // Kahan's formula for the area does not lose what flat triangles have.
    let mut s = [ab, bc, ca];
    s.sort_by(f64::total_cmp);
    let [c, b, a] = s;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    let height = 0.5 * product.max(0.0).sqrt() / ab;
    let along = ((ca - bc) * (ca + bc) + ab * ab) / (2.0 * ab);
    [[0.0; 2], [ab, 0.0], [along, height]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_from_its_lengths() {
        let c = laid([3.0, 5.0, 4.0]);
        assert!((c[2][0]).abs() < 1e-15 && (c[2][1] - 4.0).abs() < 1e-15, "{c:?}");
        let flat = laid([2.0, 1.0, 1.0 + 1e-9]);
        assert!((flat[2][1] - (1e-9_f64).sqrt()).abs() < 1e-8, "{flat:?}");
    }

    #[test]
    fn edges_and_components() {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [9.0; 3]];
        let mesh = Mesh::from_triangles("two", points, &[[0, 1, 2], [3, 2, 1], [1, 1, 2]]);
        let s = Surface::new(&mesh).unwrap();
        assert_eq!(s.edges, [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]);
        assert_eq!(s.face_edges, [[0, 2, 1], [4, 2, 3]]);
        assert_eq!(s.components(), [0, 0, 0, 0, 4]);
        assert_eq!(s.repaired.len(), 1);
        assert!((s.area[0] * s.scale * s.scale - 0.5).abs() < 1e-14);
        // Hat functions add up to 1, and grow by 1 over the height.
        let hats = s.hats(0);
        assert!((0..2).all(|d| (hats[0][d] + hats[1][d] + hats[2][d]).abs() < 1e-13));
        assert!((hats[2][0].hypot(hats[2][1]) - s.scale).abs() < 1e-12);
        let (e, forward) = s.direction(1, 1);
        assert!(!forward && (e[0].hypot(e[1]) - 1.0).abs() < 1e-15);
    }

    /// Three vertices on a line: its triangle has an area after a little is added.
    #[test]
    fn flat_triangles() {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let s = Surface::new(&Mesh::from_triangles("flat", points, &[[0, 1, 2], [0, 2, 3]])).unwrap();
        assert!(s.repaired.len() == 1 && s.area[0] > 0.0 && s.area[0] < 0.01 * s.area[1], "{:?}", s.area);
    }
}
