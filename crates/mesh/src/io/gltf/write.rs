//! Writing: one mesh, its faces as fans of triangles, its edges as lines, in 32-bit numbers.

use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::io::surface_faces;
use crate::mesh::Mesh;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::io::{self, Write};

use super::{BIN, CHUNK_HEADER, HEADER, JSON, MAGIC};

/// Numbers of glTF for component types and targets of buffer views.
pub(super) const UNSIGNED_SHORT: u32 = 5123;
pub(super) const UNSIGNED: u32 = 5125;
pub(super) const FLOAT: u32 = 5126;
pub(super) const ARRAY_BUFFER: u32 = 34962;
pub(super) const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// A mesh whose centre is farther from the origin than this many of its sizes is moved there, and its node moves it back:
/// 32-bit numbers have digits for its shape then.
const FAR: f64 = 16.0;

/// A file in the making: the bytes of the buffer, and what the JSON says of them.
pub(crate) struct Document {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    primitives: Vec<Value>,
    /// What is subtracted from positions.
    pub origin: [f64; 3],
    name: String,
}

impl Document {
    /// With the positions and elements of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let (low, high) = mesh.bounding_box().unwrap_or_default();
        let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        let center = [0, 1, 2].map(|d| low[d] / 2.0 + high[d] / 2.0);
        let far = center.iter().any(|c| c.abs() > FAR * size) && size > 0.0;
        let origin = if far { center.map(|c| f64::from(c as f32)) } else { [0.0; 3] };
        let name =
            std::path::Path::new(&mesh.name).file_stem().map_or_else(String::new, |s| s.to_string_lossy().into());
        let mut out = Document {
            buffer: Vec::new(),
            views: Vec::new(),
            accessors: Vec::new(),
            primitives: Vec::new(),
            origin,
            name,
        };
        let positions: Vec<[f32; 3]> = mesh.points.iter().map(|&p| out.local(p)).collect();
        let attributes = json!({ "POSITION": out.points(&positions) });
        let triangles = surface_faces(mesh).fan_triangles();
        let kinds = [(4, triangles.as_flattened()), (1, mesh.edges.as_flattened())];
        for (mode, indices) in kinds.into_iter().filter(|k| !k.1.is_empty()) {
            let indices = out.indices(indices);
            out.primitives.push(json!({ "attributes": attributes, "indices": indices, "mode": mode }));
        }
        if out.primitives.is_empty() {
            out.primitives.push(json!({ "attributes": attributes, "mode": 0 }));
        }
        out
    }

    /// A position as it is stored.
    pub fn local(&self, p: [f64; 3]) -> [f32; 3] {
        [0, 1, 2].map(|d| (p[d] - self.origin[d]) as f32)
    }

    fn view(&mut self, bytes: impl Iterator<Item = [u8; 4]>, target: Option<u32>) -> usize {
        let from = self.buffer.len();
        self.buffer.extend(bytes.flatten());
        let mut view = json!({ "buffer": 0, "byteOffset": from, "byteLength": self.buffer.len() - from });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Positions or displacements of all vertices.
    pub fn points(&mut self, points: &[[f32; 3]]) -> usize {
        let view = self.view(points.as_flattened().iter().map(|x| x.to_le_bytes()), Some(ARRAY_BUFFER));
        let bound = |pick: fn(f32, f32) -> f32| {
            points.iter().copied().reduce(|a, b| [0, 1, 2].map(|d| pick(a[d], b[d]))).unwrap_or_default()
        };
        let (min, max) = (bound(f32::min), bound(f32::max));
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": points.len(), "type": "VEC3", "min": min, "max": max
        }))
    }

    /// Gives the triangles texture coordinates, one a vertex, v downwards.
    pub fn texcoords(&mut self, uvs: &[[f32; 2]]) {
        let view = self.view(uvs.as_flattened().iter().map(|x| x.to_le_bytes()), Some(ARRAY_BUFFER));
        let accessor = self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": uvs.len(), "type": "VEC2"
        }));
        for p in self.primitives.iter_mut().filter(|p| p["mode"] == json!(4)) {
            p["attributes"]["TEXCOORD_0"] = json!(accessor);
        }
    }

    /// Numbers by themselves, such as times and weights.
    pub fn scalars(&mut self, numbers: &[f32]) -> usize {
        let view = self.view(numbers.iter().map(|x| x.to_le_bytes()), None);
        let min = numbers.iter().copied().fold(f32::INFINITY, f32::min);
        let max = numbers.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": numbers.len(), "type": "SCALAR",
            "min": [min], "max": [max]
        }))
    }

    fn indices(&mut self, indices: &[u32]) -> usize {
        let view = self.view(indices.iter().map(|i| i.to_le_bytes()), Some(ELEMENT_ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED, "count": indices.len(), "type": "SCALAR"
        }))
    }

    /// Gives every primitive these morph targets (accessors of displacements), at weight 0.
    pub fn morph(&mut self, targets: &[usize]) {
        let targets: Vec<Value> = targets.iter().map(|t| json!({ "POSITION": t })).collect();
        for p in &mut self.primitives {
            p["targets"] = json!(targets);
        }
    }

    /// Writes `.glb`, or `.gltf` with its buffer inside; `extra` goes to the top level of the JSON.
    pub fn write(self, binary: bool, targets: usize, extra: Value, w: &mut dyn Write) -> io::Result<()> {
        let mut mesh = json!({ "name": self.name, "primitives": self.primitives });
        if targets > 0 {
            mesh["weights"] = json!(vec![0.0; targets]);
        }
        let mut node = json!({ "name": self.name, "mesh": 0 });
        if self.origin != [0.0; 3] {
            node["translation"] = json!(self.origin);
        }
        let mut root = json!({
            "asset": { "version": "2.0", "generator": concat!("Proxel ", env!("CARGO_PKG_VERSION")) },
            "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [node], "meshes": [mesh],
            "accessors": self.accessors, "bufferViews": self.views
        });
        if let (Some(root), Value::Object(extra)) = (root.as_object_mut(), extra) {
            root.extend(extra);
        }
        container(root, json!({}), &self.buffer, binary, w)
    }
}

/// A file of this JSON and this one buffer, which is inside; `entry` is what else is said of the buffer.
pub(super) fn container(
    mut root: Value,
    mut entry: Value,
    buffer: &[u8],
    binary: bool,
    w: &mut dyn Write,
) -> io::Result<()> {
    entry["byteLength"] = json!(buffer.len());
    if !binary {
        entry["uri"] = json!(format!("data:application/octet-stream;base64,{}", STANDARD.encode(buffer)));
    }
    root["buffers"] = json!([entry]);
    let mut text = serde_json::to_vec(&root).map_err(io::Error::other)?;
    if !binary {
        return w.write_all(&text);
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    let filling = buffer.len().next_multiple_of(4) - buffer.len();
    let length = HEADER + 2 * CHUNK_HEADER + text.len() + buffer.len() + filling;
    let word = |n: usize| u32::try_from(n).map_err(|_| io::Error::other("it would be larger than 4 GB"));
    w.write_all(MAGIC)?;
    w.write_all(&2u32.to_le_bytes())?;
    w.write_all(&word(length)?.to_le_bytes())?;
    for (kind, bytes, filling) in [(JSON, &text[..], 0), (BIN, buffer, filling)] {
        w.write_all(&word(bytes.len() + filling)?.to_le_bytes())?;
        w.write_all(&kind.to_le_bytes())?;
        w.write_all(bytes)?;
        w.write_all(&[0; 4][..filling])?;
    }
    Ok(())
}

/// Checks that 32-bit numbers have the range of these positions.
pub(crate) fn require_range(file: &str, points: &[[f64; 3]]) -> Result<()> {
    let large = |p: &[f64; 3]| p.iter().any(|c| !((*c as f32).is_finite()));
    match points.iter().position(large) {
        None => Ok(()),
        Some(v) => Err(MeshError::new(
            ErrorKind::Unsupported,
            file,
            "a coordinate is beyond the 32-bit numbers of glTF",
            "write .obj, .ply or .vtu",
        )
        .at_item(Item::Vertex(v))),
    }
}

/// Writes a mesh.
pub(crate) fn write(mesh: &Mesh, binary: bool, w: &mut dyn Write) -> io::Result<()> {
    Document::new(mesh).write(binary, 0, json!({}), w)
}
