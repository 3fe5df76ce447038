//! Named arrays over vertices and elements that go out with a mesh.

use crate::error::{ErrorKind, Result};
use crate::mesh::Mesh;

/// One named array: `components` numbers for each vertex or element, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Its name in the file.
    pub name: String,
    /// Numbers each: 1 scalar, 3 vector, 9 tensor (row-major).
    pub components: usize,
    /// The numbers, (n, components) flat.
    pub data: Vec<f64>,
}

/// Arrays for [`write_mesh`](crate::write_mesh). VTU and legacy VTK carry all of them, PLY the
/// point arrays (and the cell arrays of surfaces); other formats carry none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fields {
    /// Arrays over the vertices.
    pub point: Vec<Field>,
    /// Arrays over the primary elements: tetrahedra where there are any, else faces, else edges.
    /// Elements of lower dimension in the same file get NaN.
    pub cell: Vec<Field>,
    /// Colours of the vertices, red, green and blue in sRGB; PLY alone carries them.
    pub colors: Option<Vec<[u8; 3]>>,
}

impl Fields {
    /// No arrays.
    pub fn none() -> Self {
        Self::default()
    }

    /// Whether there are no arrays.
    pub fn is_empty(&self) -> bool {
        self.point.is_empty() && self.cell.is_empty() && self.colors.is_none()
    }

    /// Adds a point array of `components` numbers a vertex.
    pub fn point(&mut self, name: impl Into<String>, components: usize, data: Vec<f64>) -> &mut Self {
        self.point.push(Field { name: name.into(), components, data });
        self
    }

    /// Adds a cell array of `components` numbers an element.
    pub fn cell(&mut self, name: impl Into<String>, components: usize, data: Vec<f64>) -> &mut Self {
        self.cell.push(Field { name: name.into(), components, data });
        self
    }

    /// Colours the vertices, one colour each.
    pub fn colors(&mut self, colors: Vec<[u8; 3]>) -> &mut Self {
        self.colors = Some(colors);
        self
    }

    /// Checks that every array has the length that the mesh asks for.
    pub(crate) fn check(&self, mesh: &Mesh) -> Result<()> {
        let point = self.point.iter().map(|f| (f, mesh.n_verts(), "vertices"));
        let cell = self.cell.iter().map(|f| (f, primary_count(mesh), "elements"));
        for (f, n, what) in point.chain(cell) {
            if f.components == 0 || f.components.checked_mul(n) != Some(f.data.len()) {
                return Err(mesh.error(
                    ErrorKind::CountMismatch,
                    format!(
                        "array `{}` has {} numbers for {n} {what} of {} components",
                        f.name,
                        f.data.len(),
                        f.components
                    ),
                    "give every array its full length",
                ));
            }
        }
        match &self.colors {
            Some(c) if c.len() != mesh.n_verts() => Err(mesh.error(
                ErrorKind::CountMismatch,
                format!("{} colours for {} vertices", c.len(), mesh.n_verts()),
                "give one colour for each vertex",
            )),
            _ => Ok(()),
        }
    }
}

/// How many elements cell arrays are over: the dimension of the highest elements present.
pub(crate) fn primary_count(mesh: &Mesh) -> usize {
    [mesh.tets.len(), mesh.faces.len(), mesh.edges.len()].into_iter().find(|&n| n > 0).unwrap_or(0)
}
