//! Image files: PNG, TIFF, JPEG, `.npy` and text in; PNG, TIFF and `.npy` out.
//!
//! What a file is, its first bytes say, never its name. Numbers are taken linearly: an integer v of n bits is
//! v / (2^n - 1), with no gamma; floating-point samples stay as they are. What a format carries beside colours (alpha,
//! bit depth, EXIF, ICC) is carried on where the other format can hold it, and what is lost is told.
//!
//! Files are checked for what they claim before memory is taken for it: by [`MAX_SAMPLES`], and by how many pixels so
//! many compressed bytes can hold at most.

mod exif;
#[cfg(test)]
mod fuzz;
mod jpeg;
mod npy;
mod other;
mod png;
mod samples;
mod text;
mod tiff;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::image::{Image, ImageError};

/// The most samples (width times height times channels, with alpha) that a file may have: 2^29, 4 GiB as f64.
pub const MAX_SAMPLES: usize = 1 << 29;

/// The most bytes of a file that are read: those of [`MAX_SAMPLES`] numbers of eight bytes, and a header.
const MAX_FILE: u64 = (MAX_SAMPLES as u64) * 8 + (1 << 20);

type Result<T> = std::result::Result<T, ImageError>;

/// How a file holds one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// Unsigned, 8 bits: v / 255.
    U8,
    /// Unsigned, 16 bits: v / 65535.
    U16,
    /// Unsigned, 32 bits: v / (2^32 - 1).
    U32,
    /// IEEE single precision, as it is.
    F32,
    /// IEEE double precision, as it is.
    F64,
}

impl Depth {
    /// Whether values outside [0, 1] can be held.
    pub fn is_float(self) -> bool {
        matches!(self, Depth::F32 | Depth::F64)
    }
}

/// The formats that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `.png`: one or three channels of 8 or 16 bits, alpha, EXIF, ICC.
    Png,
    /// `.tif`, `.tiff`: any number of channels, 8, 16 or 32 bits or floating point, alpha, EXIF, ICC; not compressed.
    Tiff,
    /// `.npy`: float64, (height, width) or (height, width, channels), and nothing beside it.
    Npy,
}

impl Format {
    /// By the extension, in either case.
    ///
    /// # Errors
    /// Another extension, or none; the formats that there are.
    pub fn from_path(path: &Path) -> Result<Format> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Format::Png),
            Some("tif" | "tiff") => Ok(Format::Tiff),
            Some("npy") => Ok(Format::Npy),
            Some("jpg" | "jpeg") => refuse(path.display(), "JPEG loses detail and is not written; use .png or .tif"),
            _ => refuse(path.display(), "images are written as .png, .tif or .npy"),
        }
    }
}

/// What PNG says of how its numbers are to be shown, carried from PNG to PNG only.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PngDisplay {
    intent: Option<::png::SrgbRenderingIntent>, // sRGB
    gamma: Option<u32>,                         // gAMA, times 100000
    chromaticities: Option<[u32; 8]>,           // cHRM: white, red, green, blue, times 100000
    pixels_per_unit: Option<(u32, u32, bool)>,  // pHYs: x, y, whether the unit is the metre
}

impl PngDisplay {
    fn is_empty(&self) -> bool {
        *self == PngDisplay::default()
    }
}

/// An image with what its file carries beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageFile {
    /// The colours, without alpha.
    pub image: Image,
    /// Opacity in [0, 1], not multiplied into the colours; as many as pixels.
    pub alpha: Option<Vec<f64>>,
    /// Of the samples of the file, and of those that are written.
    pub depth: Depth,
    /// The EXIF block, as it stands in PNG's `eXIf`: it begins with `II` or `MM`.
    pub exif: Option<Vec<u8>>,
    /// The ICC profile of the colours.
    pub icc: Option<Vec<u8>>,
    /// See there.
    pub png_display: PngDisplay,
    /// What was changed or left out in reading, a sentence each.
    pub notes: Vec<String>,
}

impl ImageFile {
    /// An image and nothing beside it.
    pub fn new(image: Image, depth: Depth) -> Self {
        ImageFile {
            image,
            alpha: None,
            depth,
            exif: None,
            icc: None,
            png_display: PngDisplay::default(),
            notes: vec![],
        }
    }

    /// The same file with other colours. Alpha stays where the size is the same, the ICC profile where the number of
    /// channels is, and a note says what did not.
    #[must_use]
    pub fn with_image(mut self, image: Image) -> Self {
        let same_size = (image.width, image.height) == (self.image.width, self.image.height);
        if !same_size && self.alpha.take().is_some() {
            self.notes.push("alpha is left out: the image has another size now".to_owned());
        }
        if image.channels.len() != self.image.channels.len() && self.icc.take().is_some() {
            self.notes.push("the ICC profile is left out: it is for another number of channels".to_owned());
        }
        self.image = image;
        self
    }
}

/// The bytes of a file, and what of the image they do not hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoded {
    /// To be written.
    pub bytes: Vec<u8>,
    /// A sentence each.
    pub lost: Vec<String>,
}

fn refuse<T>(name: impl std::fmt::Display, what: impl std::fmt::Display) -> Result<T> {
    Err(ImageError(format!("{name}: {what}")))
}

/// Reads an image file, or an array (`.npy`, or text: rows of numbers, `#` begins a comment).
///
/// # Errors
/// No file; a format that is not read, by its name; a damaged or truncated file; sizes above [`MAX_SAMPLES`] or that
/// the file cannot hold; samples that are not finite, by channel, row and column.
pub fn read_image(path: &Path) -> Result<ImageFile> {
    let name = path.display().to_string();
    let mut data = Vec::new();
    let file = File::open(path).and_then(|file| file.take(MAX_FILE + 1).read_to_end(&mut data));
    match file {
        Err(e) => refuse(&name, format_args!("cannot read: {e}")),
        Ok(n) if n as u64 > MAX_FILE => {
            refuse(&name, format_args!("it has more than {MAX_FILE} bytes; cut it to tiles"))
        }
        Ok(_) => parse_image(&name, &data),
    }
}

/// As [`read_image`], of bytes; `name` is for messages, and for its extension, by which files of cameras are known.
///
/// # Errors
/// As there.
pub fn parse_image(name: &str, data: &[u8]) -> Result<ImageFile> {
    if let Some(what) = other::refused(name, data) {
        return refuse(name, what);
    }
    let parsed = if data.starts_with(png::MAGIC) {
        png::parse(data)
    } else if data.starts_with(jpeg::MAGIC) {
        jpeg::parse(data)
    } else if tiff::is_tiff(data) {
        tiff::parse(data)
    } else if data.starts_with(npy::MAGIC) {
        npy::parse(data)
    } else if data.is_empty() {
        Err(ImageError("the file is empty".to_owned()))
    } else {
        text::parse(data)
    };
    // What decoders say may have several lines.
    parsed.map_err(|e| ImageError(format!("{name}: {}", e.0.replace(['\n', '\r'], " "))))
}

/// The bytes of a file in a format. Integers are rounded to the nearest, and values outside [0, 1] clipped to it.
///
/// # Errors
/// More channels than PNG can hold; values that single precision cannot hold; sizes that the format cannot.
pub fn encode(file: &ImageFile, format: Format) -> Result<Encoded> {
    // The fields are public: what they hold is checked again.
    let image = &file.image;
    let planes = image.channels.iter().chain(file.alpha.as_ref());
    let size = image.width.checked_mul(image.height).filter(|n| *n > 0);
    if image.channels.is_empty() || planes.clone().any(|p| Some(p.len()) != size) {
        return Err(ImageError("an image whose planes do not have its width times its height numbers".to_owned()));
    }
    if planes.flatten().any(|v| !v.is_finite()) {
        return Err(ImageError("an image with numbers that are not finite cannot be written".to_owned()));
    }
    match format {
        Format::Png => png::encode(file),
        Format::Tiff => tiff::encode(file),
        Format::Npy => Ok(npy::encode(file)),
    }
}

/// A size as it is claimed, before memory is taken: samples within [`MAX_SAMPLES`], and no more than `most_by_bytes`,
/// what a file of its length can hold.
fn check_size(width: usize, height: usize, channels: usize, most_by_bytes: usize) -> Result<usize> {
    let samples = width.checked_mul(height).and_then(|n| n.checked_mul(channels.max(1)));
    match samples {
        Some(0) => Err(ImageError(format!("it has {width} x {height} pixels; give at least one"))),
        Some(n) if n <= MAX_SAMPLES && n <= most_by_bytes => Ok(n),
        Some(n) if n <= MAX_SAMPLES => Err(ImageError(format!(
            "it claims {width} x {height} pixels, more than its bytes can hold: it is truncated or damaged"
        ))),
        _ => Err(ImageError(format!(
            "it claims {width} x {height} pixels with {channels} channels, more than {MAX_SAMPLES} samples; cut it to tiles"
        ))),
    }
}

#[cfg(test)]
mod tests;
