//! PNG by the crate `png`: all colour types and depths in, grey and RGB of 8 and 16 bits out.

use std::borrow::Cow;
use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, Encoder, Info, Limits, Transformations, Unit};

use super::samples::{integers, interleaved, note_clipped, quantise};
use super::{Depth, Encoded, ImageFile, PngDisplay, Result, check_size};
use crate::image::ImageError;

pub(super) const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A deflated byte stands for at most so many (258 of the longest match by two bits).
const MOST_DEFLATED: usize = 1032;

/// For one row and the chunks beside pixels; pixels have their own bound.
const CHUNK_BYTES: usize = 1 << 28;

fn damaged(e: &png::DecodingError) -> ImageError {
    ImageError(format!("it is a damaged or truncated PNG ({e}): save it again"))
}

pub(super) fn parse(data: &[u8]) -> Result<ImageFile> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(data), Limits { bytes: CHUNK_BYTES });
    let header = decoder.read_header_info().map_err(|e| damaged(&e))?;
    let (width, height) = (header.width as usize, header.height as usize);
    let bits = header.color_type.samples() * header.bit_depth as usize;
    let (packed, palette) = ((header.bit_depth as u8) < 8, header.color_type == ColorType::Indexed);
    let most_pixels = data.len().saturating_mul(MOST_DEFLATED).saturating_mul(8) / bits;
    // As it will be held: a palette and a transparent colour become channels.
    check_size(width, height, 1, most_pixels)?;
    check_size(width, height, if palette { 4 } else { header.color_type.samples() + 1 }, usize::MAX)?;
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| damaged(&e))?;
    let size = reader.output_buffer_size().ok_or_else(|| ImageError("its size is beyond all memory".to_owned()))?;
    let mut bytes = vec![0; size];
    let frame = reader.next_frame(&mut bytes).map_err(|e| damaged(&e))?;
    let animated = reader.info().is_animated();
    reader.finish().map_err(|e| damaged(&e))?; // what stands behind the pixels
    let depth = if frame.bit_depth == BitDepth::Sixteen { Depth::U16 } else { Depth::U8 };
    let has_alpha = matches!(frame.color_type, ColorType::GrayscaleAlpha | ColorType::Rgba);
    let size = (frame.width as usize, frame.height as usize);
    let mut file = integers(size, &bytes[..frame.buffer_size()], depth, frame.color_type.samples(), has_alpha)?;
    if palette {
        file.notes.push("the palette is resolved: colours are written as RGB of 8 bits".to_owned());
    } else if packed {
        file.notes.push(format!("{bits} bits a pixel are written as 8"));
    }
    if animated {
        file.notes.push("of the animation the first picture is taken".to_owned());
    }
    carry(reader.info(), &mut file);
    Ok(file)
}

fn carry(info: &Info<'_>, file: &mut ImageFile) {
    file.exif = info.exif_metadata.as_deref().map(<[u8]>::to_vec);
    file.icc = info.icc_profile.as_deref().map(<[u8]>::to_vec);
    let chroma = info.chrm_chunk.as_ref().map(|c| {
        let [w, r, g, b] = [c.white, c.red, c.green, c.blue].map(|(x, y)| [x.into_scaled(), y.into_scaled()]);
        [w[0], w[1], r[0], r[1], g[0], g[1], b[0], b[1]]
    });
    file.png_display = PngDisplay {
        intent: info.srgb,
        gamma: info.gama_chunk.map(png::ScaledFloat::into_scaled),
        chromaticities: chroma,
        pixels_per_unit: info.pixel_dims.map(|p| (p.xppu, p.yppu, p.unit == Unit::Meter)),
    };
    if !(info.uncompressed_latin1_text.is_empty()
        && info.compressed_latin1_text.is_empty()
        && info.utf8_text.is_empty())
    {
        file.notes.push("texts of the PNG (title, author and the like) are left out".to_owned());
    }
    let hdr = info.coding_independent_code_points.is_some()
        || info.mastering_display_color_volume.is_some()
        || info.content_light_level.is_some();
    if hdr {
        file.notes.push("what the PNG says of high dynamic range (cICP, mDCV, cLLI) is left out".to_owned());
    }
}

pub(super) fn encode(file: &ImageFile) -> Result<Encoded> {
    let image = &file.image;
    let size = (u32::try_from(image.width), u32::try_from(image.height));
    let (Ok(width), Ok(height)) = size else {
        return Err(ImageError(format!("{} x {} pixels are too many for PNG; use .npy", image.width, image.height)));
    };
    let color = match (image.channels.len(), file.alpha.is_some()) {
        (1, false) => ColorType::Grayscale,
        (1, true) => ColorType::GrayscaleAlpha,
        (3, false) => ColorType::Rgb,
        (3, true) => ColorType::Rgba,
        (n, _) => return Err(ImageError(format!("a PNG has 1 or 3 channels, not {n}; use .tif or .npy"))),
    };
    let mut lost = Vec::new();
    note_clipped(file, &mut lost);
    if !matches!(file.depth, Depth::U8 | Depth::U16) {
        lost.push("values are rounded to the 16 bits of PNG; a TIFF keeps them".to_owned());
    }
    let mut info = Info::with_size(width, height);
    info.color_type = color;
    info.bit_depth = if file.depth == Depth::U8 { BitDepth::Eight } else { BitDepth::Sixteen };
    info.exif_metadata = file.exif.as_deref().map(Cow::Borrowed);
    info.icc_profile = file.icc.as_deref().map(Cow::Borrowed);
    show(&file.png_display, &mut info);
    let mut bytes = Vec::new();
    let failed = |e: png::EncodingError| ImageError(format!("the PNG cannot be made: {e}"));
    let mut writer = Encoder::with_info(&mut bytes, info).and_then(Encoder::write_header).map_err(failed)?;
    let samples = match file.depth {
        Depth::U8 => interleaved(file, |v| quantise(v, 255) as u8),
        _ => interleaved(file, |v| (quantise(v, 65535) as u16).to_be_bytes()).into_flattened(),
    };
    writer.write_image_data(&samples).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(Encoded { bytes, lost })
}

fn show(display: &PngDisplay, info: &mut Info<'_>) {
    use png::{PixelDimensions, ScaledFloat, SourceChromaticities};
    info.srgb = display.intent;
    info.source_gamma = display.gamma.map(ScaledFloat::from_scaled);
    info.source_chromaticities = display.chromaticities.map(|c| {
        let at = |k: usize| (ScaledFloat::from_scaled(c[k]), ScaledFloat::from_scaled(c[k + 1]));
        SourceChromaticities { white: at(0), red: at(2), green: at(4), blue: at(6) }
    });
    info.pixel_dims = display.pixels_per_unit.map(|(xppu, yppu, metre)| PixelDimensions {
        xppu,
        yppu,
        unit: if metre { Unit::Meter } else { Unit::Unspecified },
    });
}
