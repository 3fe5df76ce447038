//! The mesh as it stands in a file: flat arrays, 0-based, in file order.

use crate::error::{ErrorKind, Item, MeshError, Result};

/// Polygons of any size, flat: polygon `i` is `indices[offsets[i]..offsets[i + 1]]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Polygons {
    offsets: Vec<u32>,
    indices: Vec<u32>,
}

impl Default for Polygons {
    fn default() -> Self {
        Polygons { offsets: vec![0], indices: Vec::new() }
    }
}

impl Polygons {
    /// No polygons.
    pub fn new() -> Self {
        Self::default()
    }

    /// The number of polygons.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Appends one polygon.
    pub fn push(&mut self, corners: &[u32]) {
        self.indices.extend_from_slice(corners);
        self.offsets.push(self.indices.len() as u32);
    }

    /// The corners of polygon `i`.
    pub fn get(&self, i: usize) -> &[u32] {
        &self.indices[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }

    /// All polygons in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> + Clone {
        self.offsets.windows(2).map(|w| &self.indices[w[0] as usize..w[1] as usize])
    }

    /// The corners of all polygons, one after the other.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// Where each polygon starts in [`indices`](Self::indices), and the end: `len() + 1` numbers.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// The polygons as triangles if all of them are.
    pub fn as_triangles(&self) -> Option<Vec<[u32; 3]>> {
        let all = self.indices.len() == 3 * self.len() && self.iter().all(|p| p.len() == 3);
        all.then(|| self.indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
    }

    /// Every polygon as a fan around its first corner.
    pub fn fan_triangles(&self) -> Vec<[u32; 3]> {
        let mut out = Vec::with_capacity(self.indices.len().saturating_sub(2 * self.len()));
        for p in self.iter() {
            out.extend((2..p.len()).map(|k| [p[0], p[k - 1], p[k]]));
        }
        out
    }
}

impl From<&[[u32; 3]]> for Polygons {
    fn from(triangles: &[[u32; 3]]) -> Self {
        Polygons {
            offsets: (0..=triangles.len() as u32).map(|i| 3 * i).collect(),
            indices: triangles.as_flattened().to_vec(),
        }
    }
}

/// A mesh of tetrahedra, faces and edges over common vertices, as a file gives it: nothing is
/// renumbered, merged, dropped or turned around. Lengths are in the units of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Where it comes from; messages start with it.
    pub name: String,
    /// Vertex positions, (n, 3). Planar files have z = 0.
    pub points: Vec<[f64; 3]>,
    /// Tetrahedra; positively oriented means det(b - a, c - a, d - a) > 0.
    pub tets: Vec<[u32; 4]>,
    /// Triangles, quads and polygons in file order.
    pub faces: Polygons,
    /// Edges (springs, feature lines).
    pub edges: Vec<[u32; 2]>,
    /// A region (material, reference, physical group) of each tetrahedron.
    pub tet_regions: Option<Vec<i32>>,
    /// A region of each face.
    pub face_regions: Option<Vec<i32>>,
    /// A region of each edge.
    pub edge_regions: Option<Vec<i32>>,
    /// The number of the first vertex in the file (0 or 1), kept when a TetGen pair is written.
    pub index_base: u32,
    /// Whether the file is two-dimensional; all z are 0 then.
    pub planar: bool,
}

impl Mesh {
    /// A mesh of tetrahedra.
    pub fn from_tets(name: impl Into<String>, points: Vec<[f64; 3]>, tets: Vec<[u32; 4]>) -> Self {
        Mesh { name: name.into(), points, tets, ..Mesh::default() }
    }

    /// A mesh of triangles.
    pub fn from_triangles(name: impl Into<String>, points: Vec<[f64; 3]>, triangles: &[[u32; 3]]) -> Self {
        Mesh { name: name.into(), points, faces: Polygons::from(triangles), ..Mesh::default() }
    }

    /// The number of vertices.
    pub fn n_verts(&self) -> usize {
        self.points.len()
    }

    /// Copies everything but the positions, which are `points`.
    ///
    /// # Errors
    /// [`ErrorKind::CountMismatch`] unless there is one position for each vertex.
    pub fn with_points(&self, points: Vec<[f64; 3]>) -> Result<Mesh> {
        if points.len() != self.points.len() {
            return Err(self.error(
                ErrorKind::CountMismatch,
                format!("it has {} vertices, the positions {}", self.points.len(), points.len()),
                "give one position for each vertex",
            ));
        }
        Ok(Mesh { points, ..self.clone() })
    }

    /// The smallest and the largest corner of the axis-aligned box around all vertices;
    /// `None` without vertices.
    pub fn bounding_box(&self) -> Option<([f64; 3], [f64; 3])> {
        let first = *self.points.first()?;
        Some(self.points.iter().fold((first, first), |(mut lo, mut hi), p| {
            for c in 0..3 {
                lo[c] = lo[c].min(p[c]);
                hi[c] = hi[c].max(p[c]);
            }
            (lo, hi)
        }))
    }

    /// Checks what every algorithm relies on: some vertices, finite coordinates, indices in range,
    /// regions of the right number.
    ///
    /// # Errors
    /// The first violation, by kind.
    pub fn check_indices(&self) -> Result<()> {
        if self.points.is_empty() {
            return Err(self.error(ErrorKind::Empty, "no vertices", "give a mesh with vertices"));
        }
        for (i, p) in self.points.iter().enumerate() {
            if let Some(c) = p.iter().find(|c| !c.is_finite()) {
                return Err(self
                    .error(ErrorKind::NonFinite, format!("a coordinate is {c}"), "replace it by a finite number")
                    .at_item(Item::Vertex(i)));
            }
        }
        for (i, t) in self.tets.iter().enumerate() {
            self.check_element(Item::Tetrahedron(i), t)?;
        }
        for (i, p) in self.faces.iter().enumerate() {
            self.check_element(Item::Face(i), p)?;
        }
        for (i, e) in self.edges.iter().enumerate() {
            self.check_element(Item::Edge(i), e)?;
        }
        let regions = [
            (&self.tet_regions, self.tets.len(), "tetrahedra"),
            (&self.face_regions, self.faces.len(), "faces"),
            (&self.edge_regions, self.edges.len(), "edges"),
        ];
        for (regions, n, what) in regions {
            if let Some(r) = regions
                && r.len() != n
            {
                return Err(self.error(
                    ErrorKind::CountMismatch,
                    format!("{} regions for {n} {what}", r.len()),
                    "give one region for each element or none",
                ));
            }
        }
        Ok(())
    }

    fn check_element(&self, item: Item, corners: &[u32]) -> Result<()> {
        let n = self.points.len();
        match corners.iter().find(|&&v| v as usize >= n) {
            None => Ok(()),
            Some(&v) => {
                let base = u64::from(self.index_base);
                Err(self
                    .error(
                        ErrorKind::IndexOutOfRange,
                        format!(
                            "vertex index {} is out of range, the {n} vertices are numbered {base} to {}",
                            u64::from(v) + base,
                            n as u64 + base - 1
                        ),
                        "correct the index or add the missing vertices",
                    )
                    .at_item(item))
            }
        }
    }

    /// Checks that no element uses a vertex twice.
    ///
    /// # Errors
    /// [`ErrorKind::RepeatedVertex`] with the first such element.
    pub fn check_repeated(&self) -> Result<()> {
        let tets = self.tets.iter().enumerate().map(|(i, t)| (Item::Tetrahedron(i), &t[..]));
        let faces = self.faces.iter().enumerate().map(|(i, p)| (Item::Face(i), p));
        let edges = self.edges.iter().enumerate().map(|(i, e)| (Item::Edge(i), &e[..]));
        for (item, corners) in tets.chain(faces).chain(edges) {
            if let Some(v) = repeated(corners) {
                return Err(self
                    .error(
                        ErrorKind::RepeatedVertex,
                        format!("vertex {} occurs twice in it", u64::from(v) + u64::from(self.index_base)),
                        "remove or repair the element",
                    )
                    .at_item(item));
            }
        }
        Ok(())
    }

    /// An error about this mesh.
    pub fn error(&self, kind: ErrorKind, what: impl Into<String>, remedy: impl Into<String>) -> MeshError {
        let name = if self.name.is_empty() { "mesh" } else { &self.name };
        MeshError::new(kind, name, what, remedy)
    }
}

/// The first vertex that occurs twice. Quadratic up to a size that any sane polygon has, and by
/// sorting past it.
pub(crate) fn repeated(corners: &[u32]) -> Option<u32> {
    if corners.len() <= 16 {
        return (1..corners.len()).find(|&i| corners[..i].contains(&corners[i])).map(|i| corners[i]);
    }
    let mut sorted = corners.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).find(|w| w[0] == w[1]).map(|w| w[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_keep_order_and_size() {
        let mut p = Polygons::new();
        p.push(&[0, 1, 2]);
        p.push(&[2, 1, 3, 4]);
        assert_eq!((p.len(), p.get(1)), (2, &[2, 1, 3, 4][..]));
        assert_eq!(p.as_triangles(), None);
        assert_eq!(p.fan_triangles(), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    }

    #[test]
    fn repeated_vertex_in_small_and_large_elements() {
        assert_eq!(repeated(&[3, 1, 2, 1]), Some(1));
        let mut big: Vec<u32> = (0..100).collect();
        assert_eq!(repeated(&big), None);
        big[99] = 7;
        assert_eq!(repeated(&big), Some(7));
    }
}
