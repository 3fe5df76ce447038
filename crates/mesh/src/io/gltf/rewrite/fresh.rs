//! Accessors and buffer views that a file gets anew.

use super::super::accessor::Buffers;
use super::super::malformed;
use super::super::raw::Elements;
use super::super::write::{ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, FLOAT, UNSIGNED, UNSIGNED_SHORT};
use super::Division;
use crate::error::{ErrorKind, MeshError, Result};
use serde_json::{Value, json};

/// Attributes begin at multiples of this many bytes, as the spec wants it (glTF 2.0, section 3.6.2.4).
const ALIGNMENT: usize = 4;
/// A vertex number of 16 bits; the largest one restarts strips.
const MOST_SHORT: usize = u16::MAX as usize;

/// New accessors and views, numbered behind those of the file; the offsets of the views are within `bytes`.
pub(super) struct Fresh<'a> {
    buffers: &'a Buffers<'a>,
    old: Vec<Value>,
    old_views: usize,
    pub bytes: Vec<u8>,
    pub views: Vec<Value>,
    pub accessors: Vec<Value>,
}

impl<'a> Fresh<'a> {
    /// For a file of this JSON.
    pub fn new(buffers: &'a Buffers<'a>, root: &Value) -> Self {
        let list = |key: &str| root.get(key).and_then(Value::as_array);
        let old = list("accessors").cloned().unwrap_or_default();
        let old_views = list("bufferViews").map_or(0, Vec::len);
        Fresh { buffers, old, old_views, bytes: Vec::new(), views: Vec::new(), accessors: Vec::new() }
    }

    /// Elements of a view, each followed by zeros up to `stride`; its number.
    fn view<'b>(
        &mut self,
        elements: impl ExactSizeIterator<Item = &'b [u8]>,
        size: usize,
        stride: usize,
        target: u32,
    ) -> Result<usize> {
        let from = self.bytes.len();
        let length = elements.len().checked_mul(stride).filter(|n| {
            from.checked_add(*n).and_then(|end| end.checked_next_multiple_of(ALIGNMENT)).is_some_and(|end| end <= MOST)
        });
        let length = length.ok_or_else(|| too_large(self.buffers.file))?;
        self.bytes.reserve(length + ALIGNMENT);
        for element in elements {
            self.bytes.extend_from_slice(element);
            self.bytes.extend(std::iter::repeat_n(0, stride - size));
        }
        self.bytes.resize((from + length).next_multiple_of(ALIGNMENT), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": from, "byteLength": length, "target": target });
        if stride != size {
            view["byteStride"] = json!(stride);
        }
        self.views.push(view);
        Ok(self.old_views + self.views.len() - 1)
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.old.len() + self.accessors.len() - 1
    }

    /// Accessor `a` of `verts` vertices, for vertices with these origins.
    pub fn carry(&mut self, a: usize, positions: bool, verts: usize, origins: &[u32]) -> Result<usize> {
        let missing = || malformed(self.buffers.file, format!("accessor {a}: it does not exist"));
        let mut accessor = self.old.get(a).cloned().ok_or_else(missing)?;
        let elements = self.buffers.elements(a, &accessor, verts)?;
        let stride = elements.size.next_multiple_of(ALIGNMENT);
        let all = origins.iter().map(|&o| elements.get(o as usize).unwrap_or_default());
        let view = self.view(all, elements.size, stride, ARRAY_BUFFER)?;
        let count = accessor.get("count").and_then(super::number);
        if let Some(accessor) = accessor.as_object_mut() {
            for key in ["byteOffset", "sparse"] {
                accessor.remove(key);
            }
            if count != Some(verts) {
                // What lay behind the last vertex is gone.
                accessor.remove("min");
                accessor.remove("max");
            }
            if positions && !(accessor.contains_key("min") && accessor.contains_key("max")) {
                let [min, max] = bounds(&elements);
                accessor.insert("min".into(), min);
                accessor.insert("max".into(), max);
            }
        }
        accessor["bufferView"] = json!(view);
        accessor["count"] = json!(origins.len());
        Ok(self.accessor(accessor))
    }

    /// The new coordinates.
    pub fn texcoords(&mut self, division: &Division) -> Result<usize> {
        let bytes: Vec<[u8; 8]> = division.texcoords.iter().map(|&uv| bytes_of(uv)).collect();
        let view = self.view(bytes.iter().map(<[u8; 8]>::as_slice), 8, 8, ARRAY_BUFFER)?;
        let count = division.texcoords.len();
        Ok(self.accessor(json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": "VEC2" })))
    }

    /// Triangles over `n` vertices; `turned` says that a mirror turns them around.
    pub fn indices(&mut self, indices: &[u32], turned: bool, n: usize) -> Result<usize> {
        let order = if turned { [0, 2, 1] } else { [0, 1, 2] };
        let own: Vec<[u8; 4]> = indices.chunks_exact(3).flat_map(|t| order.map(|k| t[k].to_le_bytes())).collect();
        let (size, kind) = if n <= MOST_SHORT { (2, UNSIGNED_SHORT) } else { (4, UNSIGNED) };
        let view = self.view(own.iter().map(|i| &i[..size]), size, size, ELEMENT_ARRAY_BUFFER)?;
        let count = own.len();
        Ok(self.accessor(json!({ "bufferView": view, "componentType": kind, "count": count, "type": "SCALAR" })))
    }

    /// Displacements by nothing: an accessor without a view is one of zeros.
    pub fn zeros(&mut self, n: usize) -> usize {
        let zero = [0.0; 3];
        self.accessor(json!({ "componentType": FLOAT, "count": n, "type": "VEC3", "min": zero, "max": zero }))
    }
}

/// Sizes in a `.glb` are 32-bit.
pub(super) const MOST: usize = u32::MAX as usize;

pub(super) fn too_large(file: &str) -> MeshError {
    let remedy = "share meshes between fewer nodes, or write .obj or .ply";
    MeshError::new(ErrorKind::Unsupported, file, "its buffer would be larger than 4 GB", remedy)
}

fn bytes_of([u, v]: [f32; 2]) -> [u8; 8] {
    let (u, v) = (u.to_le_bytes(), v.to_le_bytes());
    [u[0], u[1], u[2], u[3], v[0], v[1], v[2], v[3]]
}

/// The least and the largest numbers of vectors of three, as they are stored.
fn bounds(elements: &Elements) -> [Value; 2] {
    let dimensions = if elements.is_vec3 { 3 } else { 0 };
    let width = elements.scalar.size();
    let mut bounds = [vec![f64::INFINITY; dimensions], vec![f64::NEG_INFINITY; dimensions]];
    for element in elements.bytes.chunks_exact(elements.size) {
        for (d, number) in element.chunks_exact(width).take(dimensions).enumerate() {
            let x = elements.scalar.f64(number, false);
            bounds[0][d] = bounds[0][d].min(x);
            bounds[1][d] = bounds[1][d].max(x);
        }
    }
    bounds.map(|b| json!(b))
}
