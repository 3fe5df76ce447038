//! JPEG by the crate `zune-jpeg`: grey and RGB, 8 bits.

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::samples::integers;
use super::{Depth, ImageFile, Result, check_size};
use crate::image::ImageError;

pub(super) const MAGIC: &[u8] = b"\xff\xd8\xff";

/// A block of 8 x 8 samples takes at least one bit, so a byte at most so many.
const MOST_BY_BYTE: usize = 8 * 64;

pub(super) fn parse(data: &[u8]) -> Result<ImageFile> {
    let damaged =
        |e: &dyn std::fmt::Display| ImageError(format!("it is a damaged or truncated JPEG ({e}): save it again"));
    let limit = usize::from(u16::MAX);
    let options = DecoderOptions::default().set_strict_mode(true).set_max_width(limit).set_max_height(limit);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(data), options);
    decoder.decode_headers().map_err(|e| damaged(&e))?;
    let header = decoder.info().ok_or_else(|| damaged(&"no header"))?;
    let channels = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => 1,
        Some(ColorSpace::YCbCr | ColorSpace::RGB) => 3,
        _ => return Err(ImageError("its colours are neither grey nor RGB (CMYK?); convert it to RGB".to_owned())),
    };
    let size = (usize::from(header.width), usize::from(header.height));
    check_size(size.0, size.1, 1, data.len().saturating_mul(MOST_BY_BYTE))?;
    check_size(size.0, size.1, channels, usize::MAX)?;
    let out = if channels == 1 { ColorSpace::Luma } else { ColorSpace::RGB };
    let options = decoder.options().jpeg_set_out_colorspace(out);
    decoder.set_options(options);
    let bytes = decoder.decode().map_err(|e| damaged(&e))?;
    let mut file = integers(size, &bytes, Depth::U8, channels, false)?;
    file.icc = decoder.icc_profile();
    file.exif = decoder.exif().cloned();
    if decoder.xmp().is_some() || decoder.iptc().is_some() {
        file.notes.push("XMP and IPTC of the JPEG are left out".to_owned());
    }
    Ok(file)
}
