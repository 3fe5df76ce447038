//! The elements of accessors of any type as the bytes that they are, sparse ones expanded.

use super::accessor::{Buffers, scalar};
use super::malformed;
use crate::error::{ErrorKind, MeshError, Result};
use crate::io::scalar::Scalar;
use serde::Deserialize;
use serde_json::Value;

/// Elements one after the other.
pub(super) struct Elements {
    pub bytes: Vec<u8>,
    /// Bytes of each.
    pub size: usize,
    pub scalar: Scalar,
    /// Whether they are vectors of three.
    pub is_vec3: bool,
}

impl Elements {
    /// Element `i`.
    pub fn get(&self, i: usize) -> Option<&[u8]> {
        self.bytes.get(i.checked_mul(self.size)?..)?.get(..self.size)
    }
}

#[derive(Deserialize)]
struct Sparse {
    count: usize,
    indices: Part,
    values: Part,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Part {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: usize,
    component_type: Option<u32>,
}

/// Columns of an element, and the numbers in each.
fn shape(kind: &str) -> Option<(usize, usize)> {
    Some(match kind {
        "SCALAR" => (1, 1),
        "VEC2" => (1, 2),
        "VEC3" => (1, 3),
        "VEC4" => (1, 4),
        "MAT2" => (2, 2),
        "MAT3" => (3, 3),
        "MAT4" => (4, 4),
        _ => return None,
    })
}

impl Buffers<'_> {
    /// The first `n` elements of accessor `a`, whose JSON is `json`; there are `n` vertices.
    pub fn elements(&self, a: usize, json: &Value, n: usize) -> Result<Elements> {
        let name = format!("accessor {a}");
        let bad = |what: &str| malformed(self.file, format!("{name}: {what}"));
        let accessor = self.accessor(a)?;
        if accessor.count < n {
            let what = format!("{name} has {} elements for {n} vertices", accessor.count);
            return Err(MeshError::new(ErrorKind::CountMismatch, self.file, what, "export the mesh again"));
        }
        let scalar = scalar(accessor.component_type).ok_or_else(|| bad("its component type is none of glTF"))?;
        let (columns, rows) = shape(&accessor.kind).ok_or_else(|| bad("its type is none of glTF"))?;
        // Columns of matrices begin at multiples of four bytes. glTF 2.0, section 3.6.2.4.
        let column = rows * scalar.size();
        let size = if columns == 1 { column } else { columns * column.next_multiple_of(4) };
        let mut bytes = Vec::new();
        match accessor.buffer_view {
            Some(v) => {
                let (from, stride) = self.strided(&name, v, accessor.byte_offset, accessor.count, size)?;
                bytes.reserve_exact(n * size);
                // One after the other they begin a stride apart, the last one perhaps with less behind it.
                from.chunks(stride).take(n).for_each(|element| bytes.extend_from_slice(&element[..size]));
            }
            // Zeros; vertices that are there bound their number.
            None => bytes.resize(n * size, 0),
        }
        if let Some(sparse) = json.get("sparse").filter(|s| !s.is_null()) {
            let sparse = Sparse::deserialize(sparse).map_err(|_| bad("its sparse part is incomplete"))?;
            self.replace(&name, &sparse, accessor.count, size, &mut bytes)?;
        }
        Ok(Elements { bytes, size, scalar, is_vec3: accessor.kind == "VEC3" })
    }

    /// Puts the elements of a sparse part, of an accessor of `count`, in their places.
    fn replace(&self, name: &str, sparse: &Sparse, count: usize, size: usize, bytes: &mut [u8]) -> Result<()> {
        let Sparse { count: some, indices, values } = sparse;
        let kind = indices.component_type.and_then(scalar);
        let Some(kind @ (Scalar::U8 | Scalar::U16 | Scalar::U32)) = kind else {
            return Err(malformed(self.file, format!("{name}: indices must be unsigned integers")));
        };
        let (at, step) = self.strided(name, indices.buffer_view, indices.byte_offset, *some, kind.size())?;
        let (new, stride) = self.strided(name, values.buffer_view, values.byte_offset, *some, size)?;
        for (at, new) in at.chunks(step).zip(new.chunks(stride)).take(*some) {
            let index = usize::try_from(kind.i64(at, false)).unwrap_or(usize::MAX);
            if index >= count {
                let what = format!("{name}: its sparse part replaces element {index} of {count}");
                return Err(MeshError::new(ErrorKind::IndexOutOfRange, self.file, what, "correct the index"));
            }
            // Elements behind the last vertex are not carried.
            let place = index.checked_mul(size).and_then(|from| bytes.get_mut(from..)?.get_mut(..size));
            if let Some(place) = place {
                place.copy_from_slice(&new[..size]);
            }
        }
        Ok(())
    }
}
