//! Arrays as text: a row a line, numbers apart by blanks, commas or semicolons, `#` begins a comment.

use super::{Depth, ImageFile, Result, check_size};
use crate::image::{Image, ImageError};

pub(super) fn parse(data: &[u8]) -> Result<ImageFile> {
    let unknown =
        || ImageError("it is no image that is read: give PNG, TIFF, JPEG, .npy or rows of numbers".to_owned());
    let text = std::str::from_utf8(data).map_err(|_| unknown())?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let (mut width, mut values) = (0, Vec::new());
    for (k, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("");
        let before = values.len();
        for word in line.split(|c: char| c.is_whitespace() || c == ',' || c == ';').filter(|w| !w.is_empty()) {
            let value = word.parse::<f64>().map_err(|_| {
                // A file whose very first word is no number is no array at all.
                if values.is_empty() {
                    return unknown();
                }
                let word: String = word.chars().take(20).collect();
                ImageError(format!("line {}: `{}` is no number", k + 1, word.escape_debug()))
            })?;
            values.push(value);
        }
        let row = values.len() - before;
        if width == 0 {
            width = row;
        } else if row != 0 && row != width {
            return Err(ImageError(format!("line {} has {row} numbers, those before it {width}", k + 1)));
        }
    }
    if width == 0 {
        return Err(unknown());
    }
    let height = values.len() / width;
    check_size(width, height, 1, usize::MAX)?;
    Ok(ImageFile::new(Image::new(width, height, vec![values])?, Depth::F64))
}
