//! The finished picture.

use std::path::Path;

use proxel_mesh::{MeshError, atomic_write};

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
