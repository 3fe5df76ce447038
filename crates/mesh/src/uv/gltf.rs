//! Texture coordinates of glTF: one for each vertex, so that vertices on seams are split.

use std::io::{self, Write};
use std::path::Path;

use serde_json::json;

use super::UvMap;
use super::layout::Layout;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::io::gltf::{Document, Texcoords, parse_uv, read_uv, require_range};
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

/// A mesh whose vertices have one coordinate each.
pub(super) struct Split {
    mesh: Mesh,
    texcoords: Vec<[f32; 2]>,
}

impl Split {
    /// The map must have passed [`UvMap::check`].
    pub fn new(file: &str, mesh: &Mesh, uv: &UvMap) -> Result<Self> {
        require_range(file, &mesh.points)?;
        let layout = Layout::new(&mesh.faces, uv);
        let n = mesh.n_verts();
        let mut points = mesh.points.clone();
        let mut texcoords = vec![None; n];
        // The vertex of each UV vertex; behind them, of each vertex at a corner that is not mapped.
        let mut of_uv = vec![UvMap::NONE; layout.positions.len() + n];
        let mut indices = Vec::with_capacity(uv.corners.len());
        for (&v, &c) in mesh.faces.indices().iter().zip(&layout.corners) {
            let mapped = c != UvMap::NONE;
            let slot = &mut of_uv[if mapped { c as usize } else { layout.positions.len() + v as usize }];
            if *slot == UvMap::NONE {
                let uv = if mapped { layout.positions[c as usize] } else { [0.0; 2] };
                let uv = stored(uv);
                if uv.iter().any(|x| !x.is_finite()) {
                    let what = "a texture coordinate is beyond the 32-bit numbers of glTF";
                    let e = MeshError::new(ErrorKind::Unsupported, file, what, "write .obj or .ply");
                    return Err(e.at_item(Item::Vertex(v as usize)));
                }
                match &mut texcoords[v as usize] {
                    free @ None => {
                        *free = Some(uv);
                        *slot = v;
                    }
                    Some(_) => {
                        *slot = points.len() as u32;
                        points.push(mesh.points[v as usize]);
                        texcoords.push(Some(uv));
                    }
                }
            }
            indices.push(*slot);
        }
        let mut faces = Polygons::new();
        for ends in mesh.faces.offsets().windows(2) {
            faces.push(&indices[ends[0] as usize..ends[1] as usize]);
        }
        let mesh = Mesh { name: mesh.name.clone(), points, faces, edges: mesh.edges.clone(), ..Mesh::default() };
        Ok(Split { mesh, texcoords: texcoords.into_iter().map(Option::unwrap_or_default).collect() })
    }

    pub fn write(&self, binary: bool, w: &mut dyn Write) -> io::Result<()> {
        let mut document = Document::new(&self.mesh);
        document.texcoords(&self.texcoords);
        document.write(binary, 0, json!({}), w)
    }
}
