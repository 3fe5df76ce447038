//! Colours: sRGB outside, linear light inside.

/// The default colour of a body.
pub const SAND: [f32; 3] = [0.93, 0.78, 0.60];

/// The colour of what is pinned.
pub const PIN_RED: [f32; 3] = [0.86, 0.13, 0.16];

/// Between `a` (t = 0) and `b` (t = 1).
pub fn blend(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    [0, 1, 2].map(|c| a[c] + t * (b[c] - a[c]))
}

/// Even steps of lightness from blue over teal and green to yellow, for numbers in [0, 1];
/// grey for NaN. Anchors in the manner of viridis (van der Walt and Smith 2015).
pub fn colour_map(t: f64) -> [f32; 3] {
    const ANCHORS: [[f32; 3]; 7] = [
        [0.259, 0.286, 0.561],
        [0.192, 0.408, 0.557],
        [0.141, 0.545, 0.553],
        [0.153, 0.675, 0.510],
        [0.365, 0.784, 0.388],
        [0.667, 0.863, 0.196],
        [0.992, 0.906, 0.145],
    ];
    if t.is_nan() {
        return [0.6; 3];
    }
    let x = t.clamp(0.0, 1.0) * (ANCHORS.len() - 1) as f64;
    let i = (x as usize).min(ANCHORS.len() - 2);
    blend(ANCHORS[i], ANCHORS[i + 1], (x - i as f64) as f32)
}

/// sRGB to linear light (IEC 61966-2-1).
pub(super) fn to_linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Linear light to an sRGB byte.
pub(super) fn to_byte(c: f32) -> u8 {
    let c = c.clamp(0.0, 1.0);
    let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (255.0 * s + 0.5) as u8
}
