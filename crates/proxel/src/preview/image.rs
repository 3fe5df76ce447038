//! The finished picture.

use std::path::Path;

use proxel_mesh::{ErrorKind, MeshError, atomic_write};

use super::color::{blend, to_byte, to_linear};

/// 8-bit sRGB pixels, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Image {
    /// A picture of a vertical gradient between two sRGB colours.
    pub(super) fn filled(width: usize, height: usize, [top, bottom]: [[f32; 3]; 2]) -> Self {
        let row = |y: usize| {
            let t = (y as f32 + 0.5) / height.max(1) as f32;
            blend(top, bottom, t).map(|c| to_byte(to_linear(c)))
        };
        let pixels = (0..height).flat_map(|y| std::iter::repeat_n(row(y), width)).collect();
        Image { width, height, pixels }
    }

    /// Of rows of `width` pixels; what is left of a last row that is not full is dropped.
    pub(crate) fn from_pixels(width: usize, mut pixels: Vec<[u8; 3]>) -> Self {
        let height = pixels.len() / width.max(1);
        pixels.truncate(width * height);
        Image { width, height, pixels }
    }

    pub(super) fn put_row(&mut self, x: usize, y: usize, row: &[[u8; 3]]) {
        let first = y * self.width + x;
        self.pixels[first..first + row.len()].copy_from_slice(row);
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels, row by row from the top.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.pixels
    }

    /// Writes a PNG file, whole or not at all.
    ///
    /// # Errors
    /// A path that cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<(), MeshError> {
        atomic_write(path, |w| {
            let mut encoder = png::Encoder::new(w, self.width as u32, self.height as u32);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(self.pixels.as_flattened())?;
            Ok(writer.finish()?)
        })
    }
}

/// Writes pictures of equal size, PNG files of 8-bit RGB such as [`Image::write_png`] makes, as one animated PNG that shows
/// each for `seconds`, whole or not at all. One picture at a time is in memory.
///
/// # Errors
/// A picture that cannot be read or has another size, a path that cannot be written.
pub fn animate_pngs(path: &Path, frames: &[std::path::PathBuf], seconds: f64) -> Result<(), MeshError> {
    /// The longest time that the format can hold, in milliseconds.
    const LONGEST: f64 = 65535.0;
    let Some(first) = frames.first() else {
        let what = "there are no pictures to animate";
        return Err(MeshError::new(ErrorKind::Empty, path.display().to_string(), what, "give at least one"));
    };
    let (width, height, _) = read_png(first)?;
    let milliseconds = (1000.0 * seconds).round().clamp(1.0, LONGEST) as u16;
    let mut failed = None;
    let end = atomic_write(path, |w| {
        let mut encoder = png::Encoder::new(w, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_animated(frames.len() as u32, 0)?;
        encoder.set_frame_delay(milliseconds, 1000)?;
        let mut writer = encoder.write_header()?;
        for frame in frames {
            match read_png(frame) {
                Ok((w, h, pixels)) if (w, h) == (width, height) => writer.write_image_data(&pixels)?,
                Ok(_) => return Err(std::io::Error::other("pictures of several sizes")),
                Err(e) => {
                    failed = Some(e);
                    return Err(std::io::Error::other("a picture cannot be read"));
                }
            }
        }
        Ok(writer.finish()?)
    });
    failed.map_or(end, Err)
}

/// Width, height and the bytes of an 8-bit RGB picture.
fn read_png(path: &Path) -> Result<(u32, u32, Vec<u8>), MeshError> {
    let bad = |what: String| {
        MeshError::new(ErrorKind::Io, path.display().to_string(), format!("it cannot be read: {what}"), "draw it anew")
    };
    let file = std::fs::File::open(path).map_err(|e| bad(e.to_string()))?;
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().map_err(|e| bad(e.to_string()))?;
    let size = reader.output_buffer_size().ok_or_else(|| bad("it is too large".to_string()))?;
    let mut pixels = vec![0; size];
    let info = reader.next_frame(&mut pixels).map_err(|e| bad(e.to_string()))?;
    if (info.color_type, info.bit_depth) != (png::ColorType::Rgb, png::BitDepth::Eight) {
        return Err(bad("it has other colours than 8-bit RGB".to_string()));
    }
    pixels.truncate(info.buffer_size());
    Ok((info.width, info.height, pixels))
}
