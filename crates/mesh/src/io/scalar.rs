//! Numbers of binary files: type, width, byte order.

/// The number types of PLY, VTK and VTU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// The type of that name in PLY (both spellings), legacy VTK and VTU.
    pub fn named(name: &str) -> Option<Scalar> {
        Some(match name {
            "char" | "int8" | "Int8" => Scalar::I8,
            "uchar" | "uint8" | "unsigned_char" | "UInt8" => Scalar::U8,
            "short" | "int16" | "Int16" => Scalar::I16,
            "ushort" | "uint16" | "unsigned_short" | "UInt16" => Scalar::U16,
            "int" | "int32" | "Int32" | "vtkIdType" => Scalar::I32,
            "uint" | "uint32" | "unsigned_int" | "UInt32" => Scalar::U32,
            "long" | "int64" | "Int64" | "vtktypeint64" => Scalar::I64,
            "ulong" | "uint64" | "unsigned_long" | "UInt64" | "vtktypeuint64" => Scalar::U64,
            "float" | "float32" | "Float32" => Scalar::F32,
            "double" | "float64" | "Float64" => Scalar::F64,
            _ => return None,
        })
    }

    /// Its width in bytes.
    pub fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    pub fn is_float(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F64)
    }

    /// The number in the first [`size`](Self::size) bytes.
    pub fn f64(self, bytes: &[u8], big_endian: bool) -> f64 {
        let b = widened(&bytes[..self.size()], big_endian);
        match self {
            Scalar::F32 => f64::from(f32::from_bits(u64::from_le_bytes(b) as u32)),
            Scalar::F64 => f64::from_bits(u64::from_le_bytes(b)),
            Scalar::U64 => u64::from_le_bytes(b) as f64,
            _ => self.i64(bytes, big_endian) as f64,
        }
    }

    /// The integer in the first [`size`](Self::size) bytes; unsigned 64-bit numbers past the range
    /// become `i64::MAX`, floats are cut off (no format has them as indices).
    pub fn i64(self, bytes: &[u8], big_endian: bool) -> i64 {
        let u = u64::from_le_bytes(widened(&bytes[..self.size()], big_endian));
        match self {
            Scalar::I8 => i64::from(u as u8 as i8),
            Scalar::I16 => i64::from(u as u16 as i16),
            Scalar::I32 => i64::from(u as u32 as i32),
            Scalar::I64 => u as i64,
            Scalar::U8 | Scalar::U16 | Scalar::U32 | Scalar::U64 => i64::try_from(u).unwrap_or(i64::MAX),
            Scalar::F32 | Scalar::F64 => self.f64(bytes, big_endian) as i64,
        }
    }
}

/// The bytes in little-endian order, filled up with zeros.
fn widened(bytes: &[u8], big_endian: bool) -> [u8; 8] {
    let mut b = [0; 8];
    b[..bytes.len()].copy_from_slice(bytes);
    if big_endian {
        b[..bytes.len()].reverse();
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_orders() {
        assert_eq!(Scalar::I16.i64(&[0xff, 0xfe], true), -2);
        assert_eq!(Scalar::U16.i64(&[0xff, 0xfe], false), 0xfeff);
        assert_eq!(Scalar::U64.i64(&[0xff; 8], false), i64::MAX);
        assert_eq!(Scalar::F32.f64(&1.5f32.to_be_bytes(), true), 1.5);
        assert_eq!(Scalar::F64.f64(&(-0.1f64).to_le_bytes(), false), -0.1);
        assert_eq!(Scalar::named("vtktypeint64"), Some(Scalar::I64));
    }
}
