//! TIFF: read by the crate `tiff`, written here, uncompressed, so that every reader takes it.

use std::io::Cursor;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::exif;
use super::samples::{interleaved, note_clipped, planes, quantise};
use super::{Depth, Encoded, ImageFile, Result, check_size};
use crate::image::ImageError;

/// An LZW code of 12 bits stands for at most 4096 bytes: no compression that is read reaches further.
const MOST_COMPRESSED: usize = 4096;

/// For one strip or tile, and for the values of a tag.
const PIECE_BYTES: usize = 1 << 31;
const TAG_BYTES: usize = 1 << 26;

const ASSOCIATED_ALPHA: u64 = 1;
const UNASSOCIATED_ALPHA: u64 = 2;

pub(super) fn is_tiff(data: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| data.starts_with(*magic))
}

/// Kept and turned to sentences: `tiff`'s errors name no remedy.
fn failed(e: &tiff::TiffError) -> ImageError {
    ImageError(match e {
        tiff::TiffError::UnsupportedError(e) => {
            format!("this kind of TIFF is not read ({e}); save it as grey or RGB, uncompressed, LZW or deflate")
        }
        e => format!("it is a damaged or truncated TIFF ({e}): save it again"),
    })
}

pub(super) fn parse(data: &[u8]) -> Result<ImageFile> {
    let limits = {
        let mut limits = Limits::default();
        limits.intermediate_buffer_size = PIECE_BYTES;
        limits.decoding_buffer_size = super::MAX_SAMPLES * 8;
        limits.ifd_value_size = TAG_BYTES.min(data.len());
        limits
    };
    let mut decoder = Decoder::new(Cursor::new(data)).map_err(|e| failed(&e))?.with_limits(limits);
    let tag = |decoder: &mut Decoder<Cursor<&[u8]>>, tag| decoder.find_tag(tag).ok().flatten();
    if tag(&mut decoder, Tag::Unknown(50706)).is_some() {
        return Err(ImageError(
            "a DNG is not read, since its pixels need developing first; develop it to a TIFF".into(),
        ));
    }
    let color = decoder.colortype().map_err(|e| failed(&e))?;
    let (width, height) = decoder.dimensions().map_err(|e| failed(&e))?;
    let (width, height) = (width as usize, height as usize);
    let extra = tag(&mut decoder, Tag::ExtraSamples).and_then(|v| v.into_u64_vec().ok()).unwrap_or_default();
    let samples_a_pixel =
        tag(&mut decoder, Tag::SamplesPerPixel).and_then(|v| v.into_u16().ok()).map_or(1, usize::from);
    let (colours, bits) = match color {
        ColorType::Gray(bits) | ColorType::GrayA(bits) | ColorType::Multiband { bit_depth: bits, .. } => (1, bits),
        ColorType::RGB(bits) | ColorType::RGBA(bits) => (3, bits),
        other => {
            let what = format!("its colours ({other:?}) are neither grey nor RGB; save it as grey or RGB");
            return Err(ImageError(what));
        }
    };
    let channels = samples_a_pixel.max(colours);
    // Before the tag was there, a fourth sample was alpha.
    let old = if extra.is_empty() && channels == 4 && colours == 3 { vec![UNASSOCIATED_ALPHA] } else { extra };
    let kinds = old.iter().enumerate();
    let alpha_at = kinds.clone().find(|(_, kind)| [ASSOCIATED_ALPHA, UNASSOCIATED_ALPHA].contains(kind));
    let alpha = alpha_at.map(|(k, _)| colours + k);
    let associated = alpha_at.is_some_and(|(_, kind)| *kind == ASSOCIATED_ALPHA);
    if !matches!(bits, 8 | 16 | 32 | 64) {
        return Err(ImageError(format!("its samples have {bits} bits; save it with 8, 16 or 32")));
    }
    let most = data.len().saturating_mul(MOST_COMPRESSED) / (usize::from(bits) / 8);
    let samples = check_size(width, height, channels, most)?;
    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut result).map_err(|e| failed(&e))?;
    let planar = layout.planes > 1;
    let (size, form) = ((width, height), Form { channels, alpha, planar, samples });
    let (image, alpha, depth) = match result {
        DecodingResult::U8(v) => form.planes(size, &v, Depth::U8, |v| f64::from(v) / 255.0)?,
        DecodingResult::U16(v) => form.planes(size, &v, Depth::U16, |v| f64::from(v) / 65535.0)?,
        DecodingResult::U32(v) => form.planes(size, &v, Depth::U32, |v| f64::from(v) / f64::from(u32::MAX))?,
        DecodingResult::F16(v) => form.planes(size, &v, Depth::F32, |v| v.to_f64())?,
        DecodingResult::F32(v) => form.planes(size, &v, Depth::F32, f64::from)?,
        DecodingResult::F64(v) => form.planes(size, &v, Depth::F64, |v| v)?,
        _ => {
            let what = "its samples are signed integers or have 64 bits, which have no range from 0 to 1; \
                save it as unsigned integers or floating-point numbers";
            return Err(ImageError(what.to_owned()));
        }
    };
    let mut file = ImageFile { alpha, ..ImageFile::new(image, depth) };
    if associated {
        divide_by_alpha(&mut file);
    }
    file.icc = tag(&mut decoder, Tag::IccProfile).and_then(|v| v.into_u8_vec().ok());
    let said = exif::parse(data).map(exif::kept).filter(|kept| !kept.is_empty());
    file.exif = said.and_then(|kept| exif::block(&kept));
    if file.exif.is_none() && tag(&mut decoder, Tag::ExifDirectory).is_some() {
        file.notes.push("EXIF is left out: it is damaged, or that of a BigTIFF".to_owned());
    }
    if decoder.more_images() {
        file.notes.push("of the pages of the TIFF the first is taken".to_owned());
    }
    Ok(file)
}

struct Form {
    channels: usize,
    alpha: Option<usize>,
    planar: bool, // all of channel 0, then all of channel 1, ...
    samples: usize,
}

type Planes = (crate::Image, Option<Vec<f64>>, Depth);

impl Form {
    fn planes<T: Copy>(&self, size: (usize, usize), v: &[T], depth: Depth, value: impl Fn(T) -> f64) -> Result<Planes> {
        if v.len() != self.samples {
            let (n, channels) = (v.len(), self.channels);
            return Err(ImageError(format!(
                "it has {n} samples for {channels} channels: save it as grey or RGB, with alpha"
            )));
        }
        let (image, alpha) = if self.planar {
            let n = size.0 * size.1;
            let places: Vec<usize> = (0..n).flat_map(|k| (0..self.channels).map(move |c| c * n + k)).collect();
            planes(size, &places, self.channels, self.alpha, |k| value(v[k]))?
        } else {
            planes(size, v, self.channels, self.alpha, value)?
        };
        Ok((image, alpha, depth))
    }
}

/// Colours that alpha was multiplied into, without it; where nothing is seen there is no colour, and 0 stays.
fn divide_by_alpha(file: &mut ImageFile) {
    let alpha = file.alpha.as_deref().unwrap_or(&[]);
    for plane in &mut file.image.channels {
        for (v, a) in plane.iter_mut().zip(alpha) {
            let divided = *v / a;
            *v = if *a > 0.0 && divided.is_finite() { divided } else { 0.0 };
        }
    }
    file.notes.push("colours were multiplied by alpha (associated); they are divided by it, and written so".to_owned());
}

/// Bytes of a little-endian TIFF: header, pixels in one strip, values of tags, directory.
struct Writer {
    bytes: Vec<u8>,
    entries: Vec<(u16, u16, u32, [u8; 4])>, // tag, type, count, value or offset
}

impl Writer {
    /// A tag with values of a type, in bytes.
    fn tag(&mut self, tag: u16, kind: u16, value: &[u8]) -> Result<()> {
        let (size, _) = exif::sizes(kind).unwrap_or((1, 1));
        let mut held = [0; 4];
        if value.len() <= 4 {
            held[..value.len()].copy_from_slice(value);
        } else {
            if self.bytes.len() % 2 == 1 {
                self.bytes.push(0); // offsets are even
            }
            held = offset(self.bytes.len())?.to_le_bytes();
            self.bytes.extend_from_slice(value);
        }
        self.entries.push((tag, kind, offset(value.len() / size)?, held));
        Ok(())
    }

    /// A directory of its own, and a tag that says where.
    fn directory(&mut self, tag: u16, inside: &[exif::Entry]) -> Result<()> {
        if self.bytes.len() % 2 == 1 {
            self.bytes.push(0);
        }
        let laid = exif::lay_out(inside, self.bytes.len());
        let (bytes, first) = laid.ok_or_else(|| ImageError("the image is too large for TIFF; use .npy".to_owned()))?;
        self.bytes.extend(bytes);
        self.long(tag, first)
    }

    fn shorts(&mut self, tag: u16, values: &[u16]) -> Result<()> {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.tag(tag, 3, &bytes)
    }

    fn long(&mut self, tag: u16, value: u32) -> Result<()> {
        self.tag(tag, 4, &value.to_le_bytes())
    }

    fn finish(mut self) -> Result<Vec<u8>> {
        if self.bytes.len() % 2 == 1 {
            self.bytes.push(0);
        }
        let at = offset(self.bytes.len())?;
        self.bytes[4..8].copy_from_slice(&at.to_le_bytes());
        self.entries.sort_by_key(|e| e.0);
        self.bytes.extend_from_slice(&(self.entries.len() as u16).to_le_bytes()); // some dozens
        for (tag, kind, count, value) in &self.entries {
            self.bytes.extend_from_slice(&tag.to_le_bytes());
            self.bytes.extend_from_slice(&kind.to_le_bytes());
            self.bytes.extend_from_slice(&count.to_le_bytes());
            self.bytes.extend_from_slice(value);
        }
        self.bytes.extend_from_slice(&[0; 4]); // no further page
        Ok(self.bytes)
    }
}

fn offset(n: usize) -> Result<u32> {
    u32::try_from(n).map_err(|_| ImageError("the image is too large for TIFF (4 GiB); use .npy".to_owned()))
}

pub(super) fn encode(file: &ImageFile) -> Result<Encoded> {
    let image = &file.image;
    let colours = image.channels.len();
    let samples = colours + usize::from(file.alpha.is_some());
    let (bits, format) = match file.depth {
        Depth::U8 => (8, 1),
        Depth::U16 => (16, 1),
        Depth::U32 => (32, 1),
        Depth::F32 => (32, 3),
        Depth::F64 => (64, 3),
    };
    let pixel_bytes = image.n_pixels().saturating_mul(samples).saturating_mul(bits / 8);
    let n_bytes = offset(pixel_bytes)?;
    let mut lost = Vec::new();
    if !file.depth.is_float() {
        note_clipped(file, &mut lost);
    }
    let said = file.exif.as_deref().and_then(exif::parse).map(exif::kept);
    if file.exif.is_some() && said.is_none() {
        lost.push("EXIF is left out: it is damaged".to_owned());
    }
    if !file.png_display.is_empty() {
        lost.push("gamma, primaries and resolution of the PNG are left out".to_owned());
    }
    let mut w = Writer { bytes: Vec::with_capacity(pixel_bytes.saturating_add(1024)), entries: Vec::new() };
    w.bytes.extend_from_slice(b"II*\0\0\0\0\0");
    match file.depth {
        Depth::U8 => w.bytes.extend(interleaved(file, |v| quantise(v, 255) as u8)),
        Depth::U16 => w.bytes.extend(interleaved(file, |v| (quantise(v, 65535) as u16).to_le_bytes()).as_flattened()),
        Depth::U32 => w.bytes.extend(interleaved(file, |v| quantise(v, u32::MAX).to_le_bytes()).as_flattened()),
        Depth::F32 => {
            let outside = |v: &f64| !(*v as f32).is_finite();
            if let Some(v) = image.channels.iter().chain(file.alpha.as_ref()).flatten().find(|v| outside(v)) {
                return Err(ImageError(format!("the value {v} is beyond single precision; use 64 bits or .npy")));
            }
            w.bytes.extend(interleaved(file, |v| (v as f32).to_le_bytes()).as_flattened());
        }
        Depth::F64 => w.bytes.extend(interleaved(file, f64::to_le_bytes).as_flattened()),
    }
    let too_many = |_| ImageError(format!("{samples} channels are too many for TIFF; use .npy"));
    let count = u16::try_from(samples).map_err(too_many)?;
    let rgb = colours == 3;
    w.long(256, offset(image.width)?)?;
    w.long(257, offset(image.height)?)?;
    w.shorts(258, &vec![bits as u16; samples])?;
    w.shorts(259, &[1])?; // not compressed
    w.shorts(262, &[if rgb { 2 } else { 1 }])?; // RGB or 0 is black
    w.long(273, 8)?; // where the strip begins
    w.shorts(277, &[count])?;
    w.long(278, offset(image.height)?)?; // rows of the strip
    w.long(279, n_bytes)?;
    w.shorts(284, &[1])?; // interleaved
    w.shorts(339, &vec![format; samples])?;
    let extra = samples - if rgb { 3 } else { 1 };
    if extra > 0 {
        let mut kinds = vec![0; extra]; // of no stated meaning
        if file.alpha.is_some() {
            kinds[extra - 1] = UNASSOCIATED_ALPHA as u16;
        }
        w.shorts(338, &kinds)?;
    }
    for entry in said.unwrap_or_default() {
        match &entry.value {
            exif::Value::Bytes(value) => w.tag(entry.tag, entry.kind, value)?,
            exif::Value::Directory(inside) => w.directory(entry.tag, inside)?,
        }
    }
    if let Some(icc) = &file.icc {
        w.tag(34675, 7, icc)?;
    }
    Ok(Encoded { bytes: w.finish()?, lost })
}
