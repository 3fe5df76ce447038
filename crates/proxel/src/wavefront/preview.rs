//! A wavefront in colours, with the bar that says what they mean.

use crate::preview::{Image as Picture, colour_map};
use proxel_imaging::Image;

/// Longest side of the wavefront in a picture, in pixels.
const LONGEST: usize = 1024;

/// Shortest, so that the bar can be read.
const SHORTEST: usize = 120;

/// Margin, width of the bar, and of the numbers beside it.
const MARGIN: usize = 12;
const BAR: usize = 18;
const LABEL: usize = 84;

/// Side of a dot of a glyph, in pixels.
const ZOOM: usize = 2;

const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [40; 3];

/// Rows of five bits, most significant to the left, of what numbers are written with.
const GLYPHS: [(char, [u8; 7]); 14] = [
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('2', [14, 17, 1, 2, 4, 8, 31]),
    ('3', [31, 2, 4, 2, 1, 17, 14]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]),
    ('.', [0, 0, 0, 0, 0, 12, 12]),
    ('-', [0, 0, 0, 31, 0, 0, 0]),
    ('+', [0, 4, 4, 31, 4, 4, 0]),
    ('e', [0, 0, 14, 17, 31, 16, 14]),
];

/// The first channel of an image by the colours of [`colour_map`], its least value blue and its largest yellow, and beside it
/// a bar with five values.
pub fn draw_wavefront(phi: &Image) -> Picture {
    let plane = phi.channels.first().map_or(&[][..], Vec::as_slice);
    let (lo, hi) = plane.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    let longest = phi.width.max(phi.height).max(1);
    // Whole factors, so that a pixel stays a square.
    let (shrink, grow) = (longest.div_ceil(LONGEST), (SHORTEST / longest).max(1));
    let (w, h) = ((phi.width / shrink).max(1) * grow, (phi.height / shrink).max(1) * grow);
    let (width, height) = (w + 4 * MARGIN + BAR + LABEL, h.max(SHORTEST) + 2 * MARGIN);
    let mut pixels = vec![PAPER; width * height];
    let color = |t: f64| colour_map(t).map(|c| (255.0 * c + 0.5) as u8);
    let part = |v: f64| if hi > lo { (v - lo) / (hi - lo) } else { 0.5 };
    for y in 0..h {
        for x in 0..w {
            let (i, j) = (y / grow * shrink, x / grow * shrink);
            let value = plane.get(i * phi.width + j).copied().unwrap_or(f64::NAN);
            pixels[(y + MARGIN) * width + x + MARGIN] = color(part(value));
        }
    }
    let (left, tall) = (w + 2 * MARGIN, height - 2 * MARGIN);
    for y in 0..tall {
        let shade = color(1.0 - y as f64 / (tall - 1) as f64);
        (0..BAR).for_each(|x| pixels[(y + MARGIN) * width + left + x] = shade);
    }
    for k in 0..=4 {
        let t = f64::from(k) / 4.0;
        let y = MARGIN + ((1.0 - t) * (tall - 1) as f64) as usize;
        (0..MARGIN / 2).for_each(|x| pixels[y * width + left + BAR + x] = INK);
        let top = y.saturating_sub(7 * ZOOM / 2).min(height - 7 * ZOOM);
        // Of two large numbers of unlike sign the difference may not be finite.
        let value = (1.0 - t) * lo + t * hi;
        write(&mut pixels, width, left + BAR + MARGIN, top, &label(value, lo.abs().max(hi.abs())));
    }
    Picture::from_pixels(width, pixels)
}

/// Three digits or so of the largest value.
fn label(value: f64, largest: f64) -> String {
    if !value.is_finite() || largest == 0.0 {
        return "0".to_string();
    }
    let digits = 2 - largest.log10().floor() as i32;
    if (-1..=5).contains(&digits) { format!("{value:.*}", digits.max(0) as usize) } else { format!("{value:.1e}") }
}

fn write(pixels: &mut [[u8; 3]], width: usize, x: usize, y: usize, text: &str) {
    for (k, c) in text.chars().enumerate() {
        let Some((_, rows)) = GLYPHS.iter().find(|(glyph, _)| *glyph == c) else { continue };
        for (row, bits) in rows.iter().enumerate() {
            for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                for (a, b) in (0..ZOOM * ZOOM).map(|n| (n / ZOOM, n % ZOOM)) {
                    let (px, py) = (x + (6 * k + column) * ZOOM + b, y + row * ZOOM + a);
                    if px < width
                        && let Some(pixel) = pixels.get_mut(py * width + px)
                    {
                        *pixel = INK;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_the_scale_have_the_ends_of_the_colours() {
        let values = (0..200 * 150).map(f64::from).collect();
        let picture = draw_wavefront(&Image::new(200, 150, vec![values]).unwrap());
        let at = |x: usize, y: usize| picture.pixels()[y * picture.width() + x];
        let bytes = |t: f64| colour_map(t).map(|c| (255.0 * c + 0.5) as u8);
        assert_eq!(at(MARGIN, MARGIN), bytes(0.0));
        assert_eq!(at(MARGIN + 199, MARGIN + 149), bytes(1.0));
        let bar = MARGIN + 200 + MARGIN;
        assert_eq!((at(bar, MARGIN), at(bar, picture.height() - MARGIN - 1)), (bytes(1.0), bytes(0.0)));
        assert!(picture.pixels().iter().filter(|p| **p == INK).count() > 300, "numbers beside the bar");
    }

    #[test]
    fn small_large_and_flat_ones() {
        for (w, h, value) in [(1, 1, 0.0), (16, 3000, 5.0), (2500, 20, -1e300)] {
            let picture = draw_wavefront(&Image::new(w, h, vec![vec![value; w * h]]).unwrap());
            assert!(picture.width() < 1300 && picture.height() < 1300);
        }
        assert_eq!(label(0.123456, 0.5), "0.123");
        assert_eq!(label(-12.5, 80.0), "-12.5");
        assert_eq!(label(1.5e9, 2e9), "1.5e9");
    }
}
