//! The cells of VTK, shared by the legacy and the XML files.

use std::borrow::Cow;

use super::numbers::vertex_index;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::fields::{Fields, primary_count};
use crate::mesh::Mesh;

pub(crate) const EDGE: u8 = 3;
pub(crate) const TRIANGLE: u8 = 5;
pub(crate) const POLYGON: u8 = 7;
pub(crate) const QUAD: u8 = 9;
pub(crate) const TET: u8 = 10;

/// The name under which regions are written, and those under which others write them.
pub(crate) const REGION: &str = "region";
const REGION_NAMES: [&str; 7] =
    [REGION, "RegionId", "CellEntityIds", "medit:ref", "gmsh:physical", "material", "attribute"];

pub(crate) fn is_region(name: &str) -> bool {
    REGION_NAMES.contains(&name)
}

/// Sorts the cells of one file into tetrahedra, faces and edges.
#[derive(Default)]
pub(crate) struct Cells {
    /// Where each cell of the file went, to give it its region later.
    went: Vec<Went>,
}

#[derive(Clone, Copy)]
struct Went {
    to: Kind,
    times: u32,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Tets,
    Faces,
    Edges,
}

impl Cells {
    /// Adds a cell; `base` is added to each index (pieces that follow each other).
    pub fn push(&mut self, file: &str, mesh: &mut Mesh, kind: u8, corners: &[i64], base: u32) -> Result<()> {
        let n = self.went.len();
        let wrong = |kind: ErrorKind, what: String, remedy: &str| {
            Err(MeshError::new(kind, file, format!("cell {n} (0-based): {what}"), remedy))
        };
        let item = match kind {
            TET => Item::Tetrahedron(mesh.tets.len()),
            3 | 4 => Item::Edge(mesh.edges.len()),
            _ => Item::Face(mesh.faces.len()),
        };
        let mut v = Vec::with_capacity(corners.len());
        for &c in corners {
            let c = vertex_index(c, 0).map_err(|e| e.into_error(file).at_item(item))?;
            let Some(c) = c.checked_add(base) else {
                return wrong(ErrorKind::IndexOutOfRange, format!("vertex index {c}"), "correct the index");
            };
            v.push(c);
        }
        let expected = match kind {
            1 => 1..=1,
            EDGE => 2..=2,
            4 => 2..=usize::MAX,
            TRIANGLE => 3..=3,
            6 | POLYGON => 3..=usize::MAX,
            8 | QUAD | TET => 4..=4,
            _ => 0..=usize::MAX,
        };
        if !expected.contains(&v.len()) {
            return wrong(
                ErrorKind::CountMismatch,
                format!("a cell of type {kind} with {} vertices", v.len()),
                "correct the cells",
            );
        }
        let mut went = Went { to: Kind::Faces, times: 1 };
        match kind {
            0..=2 => went.times = 0, // nothing, a vertex, vertices
            TET => {
                mesh.tets.push([v[0], v[1], v[2], v[3]]);
                went.to = Kind::Tets;
            }
            EDGE | 4 => {
                mesh.edges.extend(v.windows(2).map(|w| [w[0], w[1]]));
                went = Went { to: Kind::Edges, times: v.len() as u32 - 1 };
            }
            TRIANGLE | POLYGON | QUAD => mesh.faces.push(&v),
            8 => mesh.faces.push(&[v[0], v[1], v[3], v[2]]), // a pixel
            6 => {
                // A strip: every other triangle is turned around.
                for (k, w) in v.windows(3).enumerate() {
                    mesh.faces.push(&if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] });
                }
                went.times = v.len() as u32 - 2;
            }
            _ => {
                let name = match kind {
                    11 | 12 => "hexahedron",
                    13 => "prism",
                    14 => "pyramid",
                    21..=37 => "higher-order element",
                    _ => "cell of an unknown type",
                };
                return wrong(
                    ErrorKind::Unsupported,
                    format!("it is a {name} (type {kind})"),
                    "split it into first-order tetrahedra or polygons",
                );
            }
        }
        self.went.push(went);
        Ok(())
    }

    /// Gives every element the region of its cell; ignored unless all of them are integers.
    pub fn set_regions(&self, mesh: &mut Mesh, of_cell: &[f64]) {
        if of_cell.len() != self.went.len() || of_cell.iter().any(|&r| f64::from(r as i32) != r) {
            return;
        }
        let of = |kind: Kind, n: usize| {
            let mut out = Vec::with_capacity(n);
            for (went, &r) in self.went.iter().zip(of_cell) {
                if went.to == kind {
                    out.extend(std::iter::repeat_n(r as i32, went.times as usize));
                }
            }
            (n > 0).then_some(out)
        };
        mesh.tet_regions = of(Kind::Tets, mesh.tets.len());
        mesh.face_regions = of(Kind::Faces, mesh.faces.len());
        mesh.edge_regions = of(Kind::Edges, mesh.edges.len());
    }
}

/// The cells in the order in which they are written: tetrahedra, faces, edges.
pub(crate) fn cells(mesh: &Mesh) -> impl Iterator<Item = (u8, &[u32])> + Clone {
    let face = |p: &[u32]| match p.len() {
        3 => TRIANGLE,
        4 => QUAD,
        _ => POLYGON,
    };
    let tets = mesh.tets.iter().map(|t| (TET, &t[..]));
    let faces = mesh.faces.iter().map(move |p| (face(p), p));
    tets.chain(faces).chain(mesh.edges.iter().map(|e| (EDGE, &e[..])))
}

pub(crate) fn n_cells(mesh: &Mesh) -> usize {
    mesh.tets.len() + mesh.faces.len() + mesh.edges.len()
}

/// The regions of all cells as they are written, 0 where there are none; `None` without any.
pub(crate) fn cell_regions(mesh: &Mesh) -> Option<Vec<i32>> {
    let parts = [
        (&mesh.tet_regions, mesh.tets.len()),
        (&mesh.face_regions, mesh.faces.len()),
        (&mesh.edge_regions, mesh.edges.len()),
    ];
    if parts.iter().all(|(r, _)| r.is_none()) {
        return None;
    }
    let part = |(r, n): (&Option<Vec<i32>>, usize)| r.clone().unwrap_or_else(|| vec![0; n]);
    Some(parts.into_iter().flat_map(part).collect())
}

/// The cell arrays as they are written: filled up with NaN for the elements of lower dimension.
pub(crate) fn cell_arrays<'a>(mesh: &Mesh, fields: &'a Fields) -> Vec<(&'a str, usize, Cow<'a, [f64]>)> {
    let missing = n_cells(mesh) - primary_count(mesh);
    let filled = |f: &'a crate::fields::Field| {
        let mut data = Cow::Borrowed(&f.data[..]);
        if missing > 0 {
            data.to_mut().extend(std::iter::repeat_n(f64::NAN, missing * f.components));
        }
        (&f.name[..], f.components, data)
    };
    fields.cell.iter().map(filled).collect()
}
