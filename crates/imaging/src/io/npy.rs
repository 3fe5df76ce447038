//! NumPy `.npy`: (height, width) or (height, width, channels), C or Fortran order, either byte order.

use super::samples::planes;
use super::{Depth, Encoded, ImageFile, Result, check_size};
use crate::image::ImageError;

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

const SAVE: &str = "save it with numpy.save as a float64 array (height, width) or (height, width, channels)";

fn bad<T>(what: impl std::fmt::Display) -> Result<T> {
    Err(ImageError(format!("{what}; {SAVE}")))
}

/// The text behind a key of the header.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    header.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start())
}

fn split_header(data: &[u8]) -> Option<(&str, &[u8])> {
    let (version, rest) = data.strip_prefix(MAGIC)?.split_at_checked(2)?;
    let (length, rest) = match version[0] {
        1 => rest.split_first_chunk::<2>().map(|(n, rest)| (usize::from(u16::from_le_bytes(*n)), rest))?,
        2 | 3 => rest.split_first_chunk::<4>().map(|(n, rest)| (u32::from_le_bytes(*n) as usize, rest))?,
        _ => return None,
    };
    let (header, body) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, body))
}

pub(super) fn parse(data: &[u8]) -> Result<ImageFile> {
    let Some((header, body)) = split_header(data) else {
        return bad("its header is cut off or damaged");
    };
    let descr = value(header, "descr").and_then(|v| v.strip_prefix('\'')).and_then(|v| v.split('\'').next());
    let Some((order, kind)) = descr.and_then(|d| d.split_at_checked(1)) else {
        return bad("its numbers are of a type that is not read");
    };
    let (bytes, depth): (usize, Depth) = match kind {
        "f8" => (8, Depth::F64),
        "f4" => (4, Depth::F32),
        "u1" => (1, Depth::U8),
        "u2" => (2, Depth::U16),
        "u4" => (4, Depth::U32),
        _ => return bad(format_args!("its numbers are of type {}", descr.unwrap_or("").escape_debug())),
    };
    let shape: Option<Vec<usize>> = value(header, "shape")
        .and_then(|v| v.strip_prefix('(')?.split_once(')'))
        .and_then(|(v, _)| v.split(',').map(str::trim).filter(|s| !s.is_empty()).map(|s| s.parse().ok()).collect());
    let (height, width, channels) = match shape.as_deref() {
        Some(&[h, w]) => (h, w, 1),
        Some(&[h, w, c]) if c > 0 => (h, w, c),
        Some(other) => return bad(format_args!("its shape is {other:?}")),
        None => return bad("its header names no shape"),
    };
    let samples = check_size(width, height, channels, usize::MAX)?;
    if samples.checked_mul(bytes) != Some(body.len()) {
        let found = body.len();
        return bad(format_args!("it announces {samples} numbers but holds {found} bytes of them: it is truncated"));
    }
    let fortran = value(header, "fortran_order").is_some_and(|v| v.starts_with("True"));
    let number = |k: usize| {
        let mut b = [0; 8];
        b[..bytes].copy_from_slice(&body[k * bytes..][..bytes]);
        if order == ">" {
            b[..bytes].reverse();
        }
        let low = [b[0], b[1], b[2], b[3]];
        match depth {
            Depth::F64 => f64::from_le_bytes(b),
            Depth::F32 => f64::from(f32::from_le_bytes(low)),
            Depth::U8 => f64::from(b[0]) / 255.0,
            Depth::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
            Depth::U32 => f64::from(u32::from_le_bytes(low)) / f64::from(u32::MAX),
        }
    };
    let places: Vec<usize> = if fortran {
        let n = width * height;
        let at = |k: usize| (k / channels / width) + height * (k / channels % width) + n * (k % channels);
        (0..samples).map(at).collect()
    } else {
        (0..samples).collect()
    };
    let (image, _) = planes((width, height), &places, channels, None, number)?;
    Ok(ImageFile::new(image, depth))
}

pub(super) fn encode(file: &ImageFile) -> Encoded {
    let image = &file.image;
    let (w, h, c) = (image.width, image.height, image.channels.len());
    let shape = if c == 1 { format!("({h}, {w})") } else { format!("({h}, {w}, {c})") };
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    // Magic, version, length and header are a multiple of 64 bytes, and a newline ends it.
    let padding = 63 - (MAGIC.len() + 4 + header.len()) % 64;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut bytes = Vec::with_capacity(MAGIC.len() + 4 + header.len() + 8 * c * image.n_pixels());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&(header.len() as u16).to_le_bytes()); // far below 2^16: three numbers and some words
    bytes.extend_from_slice(header.as_bytes());
    for k in 0..image.n_pixels() {
        for plane in &image.channels {
            bytes.extend_from_slice(&plane[k].to_le_bytes());
        }
    }
    let carried =
        [("alpha", file.alpha.is_some()), ("EXIF", file.exif.is_some()), ("the ICC profile", file.icc.is_some())];
    let lost =
        carried.iter().filter(|(_, has)| *has).map(|(what, _)| format!("{what} is left out: .npy holds numbers only"));
    Encoded { bytes, lost: lost.collect() }
}
