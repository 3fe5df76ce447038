//! NumPy `.npy`: positions as an (n, 3) array of f64 or f32, C or Fortran order, either byte order.

use std::io::{self, Write};

use crate::error::{ErrorKind, Item, MeshError, Result};

const MAGIC: &[u8] = b"\x93NUMPY";

/// Parses (n, 3) positions.
pub(crate) fn parse_points(file: &str, data: &[u8]) -> Result<Vec<[f64; 3]>> {
    let bad = |what: String| {
        MeshError::new(
            ErrorKind::Malformed,
            file,
            what,
            "save the positions with numpy.save as an (n, 3) array of float64",
        )
    };
    let rest = data.strip_prefix(MAGIC).ok_or_else(|| bad("it is no .npy file".into()))?;
    let (header, body) = split_header(rest).ok_or_else(|| bad("its header is cut off".into()))?;
    let header = std::str::from_utf8(header).map_err(|_| bad("its header is no text".into()))?;
    let value = |key: &str| -> Option<&str> {
        let (_, rest) = header.split_once(&format!("'{key}':"))?;
        Some(rest.trim_start())
    };
    let descr = value("descr").ok_or_else(|| bad("its header names no `descr`".into()))?;
    let descr = descr.strip_prefix('\'').and_then(|d| d.split('\'').next()).unwrap_or("structured");
    let (width, big) = match descr {
        "<f8" => (8, false),
        ">f8" => (8, true),
        "<f4" => (4, false),
        ">f4" => (4, true),
        other => return Err(bad(format!("its numbers are of type {}", super::numbers::show(other.as_bytes())))),
    };
    let fortran = value("fortran_order").is_some_and(|v| v.starts_with("True"));
    let shape: Option<Vec<usize>> = value("shape")
        .and_then(|v| v.strip_prefix('('))
        .and_then(|v| v.split_once(')'))
        .and_then(|(v, _)| v.split(',').map(str::trim).filter(|s| !s.is_empty()).map(|s| s.parse().ok()).collect());
    let n = match shape.as_deref() {
        Some(&[n, 3]) => n,
        Some(other) => return Err(bad(format!("its shape is {other:?} instead of (n, 3)"))),
        None => return Err(bad("its header names no `shape`".into())),
    };
    if n.checked_mul(3 * width) != Some(body.len()) {
        return Err(MeshError::new(
            ErrorKind::Truncated,
            file,
            format!("it announces {n} positions but holds {} bytes of numbers", body.len()),
            "it is truncated or damaged: save it again",
        ));
    }
    let number = |k: usize| -> f64 {
        let bytes = &body[k * width..][..width];
        let mut b = [0; 8];
        b[..width].copy_from_slice(bytes);
        if big {
            b[..width].reverse();
        }
        match width {
            8 => f64::from_le_bytes(b),
            _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        }
    };
    let at = |i: usize, c: usize| number(if fortran { c * n + i } else { 3 * i + c });
    let points: Vec<[f64; 3]> = (0..n).map(|i| [at(i, 0), at(i, 1), at(i, 2)]).collect();
    match points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
        None => Ok(points),
        Some(i) => Err(MeshError::new(
            ErrorKind::NonFinite,
            file,
            format!("position {:?} is not finite", points[i]),
            "replace it by finite numbers",
        )
        .at_item(Item::Vertex(i))),
    }
}

fn split_header(rest: &[u8]) -> Option<(&[u8], &[u8])> {
    let (version, rest) = rest.split_at_checked(2)?;
    let (len, rest) = if version[0] == 1 {
        let (len, rest) = rest.split_first_chunk::<2>()?;
        (u16::from_le_bytes(*len) as usize, rest)
    } else {
        let (len, rest) = rest.split_first_chunk::<4>()?;
        (u32::from_le_bytes(*len) as usize, rest)
    };
    rest.split_at_checked(len)
}

/// Writes positions as (n, 3) float64, C order, version 1.0.
pub(crate) fn write_points(points: &[[f64; 3]], w: &mut dyn Write) -> io::Result<()> {
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 3), }}", points.len());
    // The numbers start at a multiple of 64 bytes and the header ends with a line break.
    let pad = 63 - (MAGIC.len() + 4 + header.len()) % 64;
    header.extend(std::iter::repeat_n(' ', pad));
    header.push('\n');
    w.write_all(MAGIC)?;
    w.write_all(&[1, 0])?;
    w.write_all(&(header.len() as u16).to_le_bytes())?;
    w.write_all(header.as_bytes())?;
    for c in points.as_flattened() {
        w.write_all(&c.to_le_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(descr: &str, fortran: &str, shape: &str, body: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let mut out = [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes()].concat();
        out.extend_from_slice(header.as_bytes());
        out.extend_from_slice(body);
        out
    }

    #[test]
    fn round_trip_is_exact_and_aligned() {
        let points = [[1.0 / 3.0, -0.0, 5e-324], [f64::MAX, 1.0, 2.0]];
        let mut out = Vec::new();
        write_points(&points, &mut out).unwrap();
        assert_eq!((out.len() - 48) % 64, 0);
        let back = parse_points("p.npy", &out).unwrap();
        assert_eq!(
            back.as_flattened().iter().map(|c| c.to_bits()).collect::<Vec<_>>(),
            points.as_flattened().iter().map(|c| c.to_bits()).collect::<Vec<_>>()
        );
    }

    #[test]
    fn orders_and_types() {
        let body: Vec<u8> = (0..6).flat_map(|i| (i as f32).to_be_bytes()).collect();
        let c = parse_points("p", &npy(">f4", "False", "(2, 3)", &body)).unwrap();
        assert_eq!(c, [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
        let f = parse_points("p", &npy(">f4", "True", "(2, 3)", &body)).unwrap();
        assert_eq!(f, [[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]]);
    }

    #[test]
    fn refusals() {
        let kind = |d: &[u8]| parse_points("p", d).unwrap_err().kind();
        assert_eq!(kind(b"PK\x03\x04"), ErrorKind::Malformed);
        assert_eq!(kind(&npy("<f8", "False", "(2, 3)", &[0; 40])), ErrorKind::Truncated);
        assert_eq!(kind(&npy("<f8", "False", "(99999999999999999, 3)", &[])), ErrorKind::Truncated);
        assert_eq!(kind(&npy("<i8", "False", "(1, 3)", &[0; 24])), ErrorKind::Malformed);
        assert_eq!(kind(&npy("<f8", "False", "(3,)", &[0; 24])), ErrorKind::Malformed);
        let nan: Vec<u8> = [0.0, f64::NAN, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        assert_eq!(kind(&npy("<f8", "False", "(1, 3)", &nan)), ErrorKind::NonFinite);
    }
}
