//! Buffers and the typed views of them. Nothing is allocated that the bytes at hand do not fill.

use super::json::{Accessor, Root};
use super::{Parts, malformed, unsupported};
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::io::scalar::Scalar;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

/// The buffers of a file.
pub(super) struct Buffers<'a> {
    pub file: &'a str,
    root: &'a Root,
    data: Vec<Cow<'a, [u8]>>,
}

impl<'a> Buffers<'a> {
    /// Decodes or reads them; files lie in `folder`, where there is one.
    pub fn new(file: &'a str, parts: &'a Parts<'a>, folder: Option<&Path>) -> Result<Self> {
        let mut data = Vec::new();
        for (i, buffer) in parts.root.buffers.iter().enumerate() {
            let bytes = match (&buffer.uri, parts.chunk) {
                (None, Some(chunk)) if i == 0 => Cow::Borrowed(chunk),
                (None, _) => return Err(malformed(file, format!("buffer {i} has neither an address nor a chunk"))),
                (Some(uri), _) => Cow::Owned(fetch(file, i, uri, folder)?),
            };
            let n = buffer.byte_length;
            if bytes.len() < n {
                return Err(MeshError::new(
                    ErrorKind::OversizedClaim,
                    file,
                    format!("buffer {i} claims {n} bytes and has {}", bytes.len()),
                    "the file or its buffer is truncated",
                ));
            }
            data.push(bytes);
        }
        Ok(Buffers { file, root: &parts.root, data })
    }

    /// The accessor, and its bytes with the stride of its elements.
    fn view(&self, a: usize, kind: &str, scalars: usize) -> Result<(&Accessor, Scalar, &[u8], usize)> {
        let bad = |what: String| malformed(self.file, format!("accessor {a}: {what}"));
        let accessor = self.accessor(a)?;
        let remedy = "export the mesh without sparse accessors and compression";
        if accessor.sparse.is_some() {
            return Err(unsupported(self.file, format!("accessor {a} is sparse"), remedy));
        }
        let Some(v) = accessor.buffer_view else {
            return Err(unsupported(self.file, format!("accessor {a} has no buffer view"), remedy));
        };
        if accessor.kind != kind {
            return Err(bad(format!("its type is {}, {kind} is needed", accessor.kind)));
        }
        let scalar = scalar(accessor.component_type);
        let scalar =
            scalar.ok_or_else(|| bad(format!("component type {} is none of glTF", accessor.component_type)))?;
        let size = scalars * scalar.size();
        let (bytes, stride) = self.strided(&format!("accessor {a}"), v, accessor.byte_offset, accessor.count, size)?;
        Ok((accessor, scalar, bytes, stride))
    }

    /// The accessor of that number.
    pub fn accessor(&self, a: usize) -> Result<&Accessor> {
        let missing = || malformed(self.file, format!("accessor {a}: it does not exist"));
        self.root.accessors.get(a).ok_or_else(missing)
    }

    /// All bytes of a buffer view, on behalf of `what`.
    pub fn bytes(&self, what: &str, v: usize) -> Result<&[u8]> {
        let bad = |why: String| malformed(self.file, format!("{what}: {why}"));
        let view = self.root.buffer_views.get(v).ok_or_else(|| bad(format!("buffer view {v} does not exist")))?;
        let bytes = self.data.get(view.buffer).ok_or_else(|| bad(format!("buffer {} does not exist", view.buffer)))?;
        let bytes = ends(view.byte_offset, view.byte_length).and_then(|r| bytes.get(r));
        bytes.ok_or_else(|| bad(format!("buffer view {v} reaches past its buffer")))
    }

    /// The bytes of `count` elements of `size` bytes from `offset` of a view on, and from each to the next; there are
    /// as many bytes as the elements need.
    pub fn strided(&self, what: &str, v: usize, offset: usize, count: usize, size: usize) -> Result<(&[u8], usize)> {
        let bytes = self.bytes(what, v)?;
        let stride = self.root.buffer_views.get(v).and_then(|view| view.byte_stride).unwrap_or(size);
        if stride < size {
            let why = format!("the stride {stride} of buffer view {v} is less than an element of {size} bytes");
            return Err(malformed(self.file, format!("{what}: {why}")));
        }
        // The last element need not be followed by the rest of a stride.
        let needed = match count {
            0 => Some(0),
            n => (n - 1).checked_mul(stride).and_then(|b| b.checked_add(size)),
        };
        let bytes = needed.and_then(|n| bytes.get(ends(offset, n)?)).ok_or_else(|| {
            let what = format!("{what}: {count} elements are claimed, buffer view {v} does not hold them");
            MeshError::new(ErrorKind::OversizedClaim, self.file, what, "the count is wrong or the file is truncated")
        })?;
        Ok((bytes, stride))
    }

    /// Points: three numbers each, 32-bit or quantised (KHR_mesh_quantization). `first` is the number of the first vertex,
    /// for messages.
    pub fn points(&self, a: usize, first: usize) -> Result<Vec<[f64; 3]>> {
        self.vectors(a, "VEC3", first)
    }

    /// Texture coordinates, as [`points`](Self::points); v runs downwards.
    pub fn texcoords(&self, a: usize, first: usize) -> Result<Vec<[f64; 2]>> {
        self.vectors(a, "VEC2", first)
    }

    fn vectors<const D: usize>(&self, a: usize, kind: &str, first: usize) -> Result<Vec<[f64; D]>> {
        let (accessor, scalar, bytes, stride) = self.view(a, kind, D)?;
        // Normalised integers: c / (2^(b-1) - 1) signed, at least -1; c / (2^b - 1) unsigned. glTF 2.0, section 3.11.
        let largest = match scalar {
            Scalar::I8 => 127.0,
            Scalar::U8 => 255.0,
            Scalar::I16 => 32767.0,
            Scalar::U16 => 65535.0,
            _ => 1.0,
        };
        let mut out = Vec::with_capacity(accessor.count);
        for i in 0..accessor.count {
            let mut p = [0.0; D];
            for (d, x) in p.iter_mut().enumerate() {
                *x = scalar.f64(&bytes[i * stride + d * scalar.size()..], false);
                if accessor.normalized && !scalar.is_float() {
                    *x = (*x / largest).max(-1.0);
                }
            }
            if let Some(x) = p.iter().find(|x| !x.is_finite()) {
                let what = format!("accessor {a}: a coordinate is {x}");
                return Err(MeshError::new(ErrorKind::NonFinite, self.file, what, "replace it by a finite number")
                    .at_item(Item::Vertex(first + i)));
            }
            out.push(p);
        }
        Ok(out)
    }

    /// Vertex numbers of a primitive, each below `n`.
    pub fn indices(&self, a: usize, n: usize) -> Result<Vec<u32>> {
        let (accessor, scalar, bytes, stride) = self.view(a, "SCALAR", 1)?;
        if !matches!(scalar, Scalar::U8 | Scalar::U16 | Scalar::U32) {
            return Err(malformed(self.file, format!("accessor {a}: indices must be unsigned integers")));
        }
        let mut out = Vec::with_capacity(accessor.count);
        for i in 0..accessor.count {
            let index = scalar.i64(&bytes[i * stride..], false);
            if index < 0 || index as usize >= n {
                let what = format!("accessor {a}: index {index} (the {i}-th) is out of range, there are {n} vertices");
                let remedy = "correct the index or add the missing vertices";
                return Err(MeshError::new(ErrorKind::IndexOutOfRange, self.file, what, remedy));
            }
            out.push(index as u32);
        }
        Ok(out)
    }
}

fn ends(from: usize, n: usize) -> Option<Range<usize>> {
    Some(from..from.checked_add(n)?)
}

/// The numbers of a component type.
pub(super) fn scalar(component_type: u32) -> Option<Scalar> {
    Some(match component_type {
        5120 => Scalar::I8,
        5121 => Scalar::U8,
        5122 => Scalar::I16,
        5123 => Scalar::U16,
        5125 => Scalar::U32,
        5126 => Scalar::F32,
        _ => return None,
    })
}

/// The bytes behind an address: in the address itself, or in a file beside the one that names it.
fn fetch(file: &str, i: usize, uri: &str, folder: Option<&Path>) -> Result<Vec<u8>> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let encoded = rest.split_once(";base64,").map(|(_, encoded)| encoded);
        let encoded = encoded.ok_or_else(|| malformed(file, format!("buffer {i}: its data is not in base 64")))?;
        return STANDARD
            .decode(encoded)
            .map_err(|e| malformed(file, format!("buffer {i}: its data is no base 64: {e}")));
    }
    let remedy = "put the buffer beside the file, or export the mesh as .glb";
    let Some(folder) = folder else {
        return Err(unsupported(file, format!("buffer {i} lies in another file"), remedy));
    };
    let name = decoded(uri);
    let plain = Path::new(&name).components().all(|c| matches!(c, std::path::Component::Normal(_)));
    if name.is_empty() || !plain || uri.contains("://") {
        return Err(unsupported(file, format!("buffer {i}: `{uri}` is no file beside this one"), remedy));
    }
    crate::io::read_bytes(&folder.join(name))
}

/// With %20 and its like as the bytes that they stand for.
fn decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut out, mut at) = (Vec::with_capacity(bytes.len()), 0);
    while at < bytes.len() {
        let hex = (bytes[at] == b'%').then(|| uri.get(at + 1..at + 3)).flatten();
        match hex.and_then(|h| u8::from_str_radix(h, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                at += 3;
            }
            None => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}
