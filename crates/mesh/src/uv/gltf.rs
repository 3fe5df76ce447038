//! Texture coordinates of glTF: one for each vertex, so that vertices on seams are split.

use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use serde_json::json;

use super::layout::Layout;
use super::{Source, UvMap};
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::io::gltf::{
    Division, Document, Group, Rewritten, Texcoords, parse_uv, read_uv, require_range, rewrite as io_rewrite,
};
use crate::mesh::{Mesh, Polygons};

pub(super) fn read(path: &Path) -> Result<Option<UvMap>> {
    read_uv(path).and_then(map)
}

pub(super) fn parse(file: &str, data: &[u8]) -> Result<Option<UvMap>> {
    parse_uv(file, data).and_then(map)
}

/// The v of glTF runs downwards from the top of the image, that of a map upwards.
fn turned([u, v]: [f64; 2]) -> [f64; 2] {
    [u, 1.0 - v]
}

fn map((mesh, values): (Mesh, Texcoords)) -> Result<Option<UvMap>> {
    if values.iter().all(Option::is_none) {
        return Ok(None);
    }
    let values: Texcoords = values.into_iter().map(|v| v.map(turned)).collect();
    UvMap::from_values(&mesh.faces, &values).map(Some)
}

/// As it is stored.
fn stored(uv: [f64; 2]) -> [f32; 2] {
    turned(uv).map(|x| x as f32)
}

/// What glTF keeps of a coordinate.
pub(super) fn rounded(uv: [f64; 2]) -> [f64; 2] {
    turned(stored(uv).map(f64::from))
}

/// Vertices with one coordinate each: those of the mesh keep their numbers, with the first of their coordinates, and
/// copies for further ones follow.
struct OneEach {
    origins: Vec<u32>, // of each: the vertex of the mesh
    texcoords: Vec<Option<[f32; 2]>>,
}

impl OneEach {
    fn new(n: usize) -> Self {
        OneEach { origins: (0..n as u32).collect(), texcoords: vec![None; n] }
    }

    /// A vertex that is at this coordinate.
    fn take(&mut self, v: u32, uv: [f32; 2]) -> u32 {
        match self.texcoords.get_mut(v as usize) {
            Some(free @ None) => {
                *free = Some(uv);
                v
            }
            _ => {
                self.origins.push(v);
                self.texcoords.push(Some(uv));
                self.origins.len() as u32 - 1
            }
        }
    }

    /// Of vertices that no face uses: (0, 0).
    fn texcoords(self) -> Vec<[f32; 2]> {
        self.texcoords.into_iter().map(Option::unwrap_or_default).collect()
    }
}

/// Where the corners of a map go: to the vertex that was first taken for their UV vertex.
struct Corners<'a> {
    faces: &'a Polygons,
    layout: Layout,
    taken: Vec<u32>, // of each UV vertex; behind them, of each vertex at a corner that is not mapped
}

impl<'a> Corners<'a> {
    /// Of a map of `n` vertices that has passed [`UvMap::check`].
    fn new(n: usize, faces: &'a Polygons, uv: &UvMap) -> Self {
        let layout = Layout::new(faces, uv);
        let taken = vec![UvMap::NONE; layout.positions.len() + n];
        Corners { faces, layout, taken }
    }

    /// The vertices of these corners, whose vertices are counted from `first` on.
    fn divide(&mut self, file: &str, corners: Range<usize>, first: usize, into: &mut OneEach) -> Result<Vec<u32>> {
        let mut out = Vec::with_capacity(corners.len());
        for (&v, &c) in self.faces.indices()[corners.clone()].iter().zip(&self.layout.corners[corners]) {
            let mapped = c != UvMap::NONE;
            let slot = if mapped { c as usize } else { self.layout.positions.len() + v as usize };
            if self.taken[slot] == UvMap::NONE {
                let uv = stored(if mapped { self.layout.positions[c as usize] } else { [0.0; 2] });
                if uv.iter().any(|x| !x.is_finite()) {
                    let what = "a texture coordinate is beyond the 32-bit numbers of glTF";
                    let e = MeshError::new(ErrorKind::Unsupported, file, what, "write .obj or .ply");
                    return Err(e.at_item(Item::Vertex(v as usize)));
                }
                self.taken[slot] = into.take((v as usize - first) as u32, uv);
            }
            out.push(self.taken[slot]);
        }
        Ok(out)
    }
}

/// A glTF file with another map, and everything else as it was. The map must have passed [`UvMap::check`], the file `out` is
/// for messages.
pub(super) fn rewrite(out: &str, mesh: &Mesh, source: Source<'_>, uv: &UvMap) -> Result<Rewritten> {
    let mut corners = Corners::new(mesh.n_verts(), &mesh.faces, uv);
    let offsets = mesh.faces.offsets();
    let accept = |faces: &Polygons| super::files::require_same_faces(mesh, faces);
    io_rewrite(source.file, source.data, source.folder, accept, |group: &Group| {
        let mut vertices = OneEach::new(group.verts);
        let of_piece = |faces: &Range<usize>| {
            let range = offsets[faces.start] as usize..offsets[faces.end] as usize;
            corners.divide(out, range, group.first, &mut vertices)
        };
        let indices = group.pieces.iter().map(|p| &p.faces).map(of_piece).collect::<Result<Vec<_>>>()?;
        Ok(Division { origins: std::mem::take(&mut vertices.origins), texcoords: vertices.texcoords(), indices })
    })
}

/// A mesh whose vertices have one coordinate each.
pub(super) struct Split {
    mesh: Mesh,
    texcoords: Vec<[f32; 2]>,
}

impl Split {
    /// The map must have passed [`UvMap::check`].
    pub fn new(file: &str, mesh: &Mesh, uv: &UvMap) -> Result<Self> {
        require_range(file, &mesh.points)?;
        let mut vertices = OneEach::new(mesh.n_verts());
        let all = 0..mesh.faces.indices().len();
        let indices = Corners::new(mesh.n_verts(), &mesh.faces, uv).divide(file, all, 0, &mut vertices)?;
        let mut faces = Polygons::new();
        for ends in mesh.faces.offsets().windows(2) {
            faces.push(&indices[ends[0] as usize..ends[1] as usize]);
        }
        let points = vertices.origins.iter().map(|&v| mesh.points[v as usize]).collect();
        let mesh = Mesh { name: mesh.name.clone(), points, faces, edges: mesh.edges.clone(), ..Mesh::default() };
        Ok(Split { mesh, texcoords: vertices.texcoords() })
    }

    pub fn write(&self, binary: bool, w: &mut dyn Write) -> io::Result<()> {
        let mut document = Document::new(&self.mesh);
        document.texcoords(&self.texcoords);
        document.write(binary, 0, json!({}), w)
    }
}
