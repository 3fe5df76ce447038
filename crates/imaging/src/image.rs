//! Images as numbers.

/// Channels of numbers on a grid, each row by row from the top: value (row i, column j) of channel c is
/// `channels[c][i * width + j]`. Linear values; those of a file with integers lie in [0, 1].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// One plane a channel, `width * height` long each.
    pub channels: Vec<Vec<f64>>,
}

/// Why numbers are no image, or a file none that can be used: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageError(pub String);

impl std::fmt::Display for ImageError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ImageError {}

impl Image {
    /// Of planes.
    ///
    /// # Errors
    /// No pixels, no channels, planes of another length, and numbers that are not finite, by channel, row and column.
    pub fn new(width: usize, height: usize, channels: Vec<Vec<f64>>) -> Result<Self, ImageError> {
        let n = width.checked_mul(height).filter(|n| *n > 0);
        let Some(n) = n else {
            return Err(ImageError(format!("an image of {width} x {height} pixels; give at least one")));
        };
        if channels.is_empty() {
            return Err(ImageError("an image without channels".to_string()));
        }
        for (c, plane) in channels.iter().enumerate() {
            if plane.len() != n {
                let (len, text) = (plane.len(), format!("{width} x {height}"));
                return Err(ImageError(format!("channel {c} has {len} numbers for {text} pixels")));
            }
            if let Some(k) = plane.iter().position(|v| !v.is_finite()) {
                let (row, column, value) = (k / width, k % width, plane[k]);
                let place = format!("channel {c}, row {row}, column {column}");
                return Err(ImageError(format!(
                    "{place}: the value is {value}; put a number there (inpaint finds such pixels by a --mask)"
                )));
            }
        }
        Ok(Image { width, height, channels })
    }

    /// Pixels.
    pub fn n_pixels(&self) -> usize {
        self.width * self.height
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_that_are_no_image_are_refused() {
        let wrong = |w, h, planes: Vec<Vec<f64>>| Image::new(w, h, planes).expect_err("refused").0;
        assert!(wrong(0, 3, vec![vec![]]).contains("0 x 3"));
        assert!(wrong(usize::MAX, 2, vec![vec![]]).contains("pixels"));
        assert!(wrong(2, 2, vec![]).contains("without channels"));
        assert!(wrong(2, 2, vec![vec![0.0; 4], vec![0.0; 3]]).contains("channel 1 has 3 numbers"));
        assert!(wrong(2, 2, vec![vec![0.0, 0.0, f64::NAN, 0.0]]).contains("row 1, column 0"));
        assert_eq!(Image::new(2, 3, vec![vec![0.5; 6]]).map(|i| i.n_pixels()), Ok(6));
    }
}
