//! An image before and after.

use crate::preview::Image as Picture;
use proxel_imaging::Image;

/// Longest side of each of the two, in pixels.
const LONGEST: usize = 1024;

/// Between them, in pixels.
const GAP: usize = 8;

const PAPER: [u8; 3] = [255; 3];

/// What was seen to the left, the result to the right; larger images by every second or later pixel. Grey from the first
/// channel where there are not three.
pub fn draw_restored(before: &Image, after: &Image) -> Picture {
    let shrink = before.width.max(before.height).div_ceil(LONGEST).max(1);
    let (w, h) = ((before.width / shrink).max(1), (before.height / shrink).max(1));
    let width = 2 * w + GAP;
    let mut pixels = vec![PAPER; width * h];
    for (image, left) in [(before, 0), (after, w + GAP)] {
        for y in 0..h {
            for x in 0..w {
                let at = y * shrink * image.width + x * shrink;
                let value = |c: usize| image.channels.get(c).and_then(|plane| plane.get(at)).copied().unwrap_or(0.0);
                let byte = |v: f64| (255.0 * v.clamp(0.0, 1.0) + 0.5) as u8;
                let grey = image.channels.len() < 3;
                pixels[y * width + left + x] = [0, 1, 2].map(|c| byte(value(if grey { 0 } else { c })));
            }
        }
    }
    Picture::from_pixels(width, pixels)
}
