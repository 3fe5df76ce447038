//! Interleaved samples of files from and to planes of numbers.

use super::{Depth, ImageFile, Result};
use crate::image::{Image, ImageError};

/// Planes of interleaved samples, and apart from them the one that is alpha, by its place. Checked to be finite.
pub(super) fn planes<T: Copy>(
    (width, height): (usize, usize),
    samples: &[T],
    channels: usize,
    alpha: Option<usize>,
    value: impl Fn(T) -> f64,
) -> Result<(Image, Option<Vec<f64>>)> {
    let n = width * height;
    if channels == 0 || samples.len() != n * channels {
        return Err(ImageError("its pixels are incomplete: it is truncated or damaged".to_owned()));
    }
    let mut planes: Vec<Vec<f64>> =
        (0..channels).map(|c| samples[c..].iter().step_by(channels).map(|v| value(*v)).collect()).collect();
    let alpha = alpha.filter(|a| *a < channels).map(|a| planes.remove(a));
    if alpha.as_ref().is_some_and(|a| a.iter().any(|v| !v.is_finite())) {
        return Err(ImageError("alpha has values that are not finite".to_owned()));
    }
    Ok((Image::new(width, height, planes)?, alpha))
}

/// The same of bytes that hold integers of `Depth::U8`, or big-endian ones of `Depth::U16`; alpha is the last.
pub(super) fn integers(
    size: (usize, usize),
    bytes: &[u8],
    depth: Depth,
    channels: usize,
    has_alpha: bool,
) -> Result<ImageFile> {
    let alpha = has_alpha.then_some(channels.saturating_sub(1));
    let (image, alpha) = if depth == Depth::U8 {
        planes(size, bytes, channels, alpha, |v| f64::from(v) / 255.0)?
    } else {
        let (pairs, _) = bytes.as_chunks::<2>();
        planes(size, pairs, channels, alpha, |v| f64::from(u16::from_be_bytes(v)) / 65535.0)?
    };
    Ok(ImageFile { alpha, ..ImageFile::new(image, depth) })
}

/// The integer in [0, most] nearest to v times most, v clipped to [0, 1].
pub(super) fn quantise(v: f64, most: u32) -> u32 {
    (v.clamp(0.0, 1.0) * f64::from(most)).round() as u32
}

/// All samples, interleaved, alpha last.
pub(super) fn interleaved<T>(file: &ImageFile, value: impl Fn(f64) -> T) -> Vec<T> {
    let planes: Vec<&Vec<f64>> = file.image.channels.iter().chain(file.alpha.as_ref()).collect();
    let mut out = Vec::with_capacity(file.image.n_pixels() * planes.len());
    for k in 0..file.image.n_pixels() {
        out.extend(planes.iter().map(|p| value(p[k])));
    }
    out
}

/// Says how many values leave [0, 1] where integers are written.
pub(super) fn note_clipped(file: &ImageFile, lost: &mut Vec<String>) {
    let outside = file.image.channels.iter().flatten().filter(|v| **v < 0.0 || **v > 1.0).count();
    if outside > 0 {
        let all = file.image.n_pixels() * file.image.channels.len();
        lost.push(format!(
            "{outside} of {all} values lie outside [0, 1] and are clipped; a floating-point TIFF keeps them"
        ));
    }
}
