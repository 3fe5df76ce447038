//! Pairs of images with a known wavefront.

use super::plane::Plane;
use crate::{Image, ImageError};

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulateSettings {
    /// Rows and columns, at least 32 and at most 16384.
    pub size: usize,
    /// The largest |grad phi| of the image, in pixels; above 0 and at most a tenth of the size.
    pub max_shift: f64,
    /// Of the random numbers.
    pub seed: u64,
}

/// A pair and what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedPair {
    /// I1: speckle, without the wavefront.
    pub reference: Image,
    /// I2(y + grad phi(y)) = I1(y).
    pub captured: Image,
    /// phi at the centres of pixels, with mean 0, in square pixels.
    pub phi: Image,
}

/// Standard deviation of the noise of both images.
const NOISE: f64 = 1.0 / 255.0;

/// Light of a closed cell, and what an open one lacks, so that noise stays within [0, 1].
const DARK: f64 = 0.05;

/// Waves of phi.
const WAVES: usize = 6;

/// Random numbers: SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Of variance 1 (Box and Muller).
    fn normal(&mut self) -> f64 {
        let (a, b) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * a.ln()).sqrt() * (2.0 * std::f64::consts::PI * b).cos()
    }
}

/// A sum of plane waves, none shorter than half the image.
struct Phase(Vec<([f64; 2], f64, f64)>); // frequency (row, column), phase, amplitude

impl Phase {
    fn value(&self, row: f64, column: f64) -> f64 {
        self.0.iter().map(|([a, b], phase, size)| size * (a * row + b * column + phase).sin()).sum()
    }

    /// Along the row and along the column, as shifts are.
    fn gradient(&self, row: f64, column: f64) -> [f64; 2] {
        let mut g = [0.0; 2];
        for ([a, b], phase, size) in &self.0 {
            let c = size * (a * row + b * column + phase).cos();
            g[0] += c * b;
            g[1] += c * a;
        }
        g
    }
}

/// A coded mask as its speckle would be seen, blurred cells of random light, once as it is and once behind a smooth
/// wavefront; 8-bit noise on both.
///
/// # Errors
/// Settings out of range.
pub fn simulate(settings: &SimulateSettings) -> Result<SimulatedPair, ImageError> {
    let SimulateSettings { size, max_shift, seed } = *settings;
    if !(32..=16384).contains(&size) {
        return Err(ImageError(format!("--simulate: the size is {size}; give one from 32 to 16384")));
    }
    if !(max_shift > 0.0 && max_shift <= 0.1 * size as f64) {
        let most = 0.1 * size as f64;
        return Err(ImageError(format!(
            "--simulate: the shift is {max_shift} pixels; give one above 0 and up to {most}"
        )));
    }
    let mut random = Random(seed);
    let unit = 2.0 * std::f64::consts::PI / size as f64;
    let mut wave = || {
        // Between half a wave and two across the image.
        let (angle, frequency) = (2.0 * std::f64::consts::PI * random.uniform(), 0.5 + 1.5 * random.uniform());
        let (sin, cos) = angle.sin_cos();
        let phase = 2.0 * std::f64::consts::PI * random.uniform();
        ([unit * frequency * sin, unit * frequency * cos], phase, 1.0 / (frequency * frequency))
    };
    let mut phase = Phase((0..WAVES).map(|_| wave()).collect());
    let steepest = Plane::from_fn(size, size, |i, j| {
        let g = phase.gradient(i as f64, j as f64);
        g[0].hypot(g[1])
    });
    let factor = max_shift / steepest.range().1;
    phase.0.iter_mut().for_each(|(_, _, size)| *size *= factor);
    // A border as wide as light can come from.
    let border = max_shift.ceil() as usize + 8;
    let wide = size + 2 * border;
    let cells: Vec<f64> = (0..wide * wide).map(|_| if random.uniform() < 0.5 { DARK } else { 1.0 - DARK }).collect();
    let mask = blurred(&blurred(&Plane { width: wide, height: wide, values: cells }));
    let noise: Vec<f64> = (0..2 * size * size).map(|_| NOISE * random.normal()).collect();
    let reference =
        Plane::from_fn(size, size, |i, j| mask.at((i + border) as isize, (j + border) as isize) + noise[i * size + j]);
    let captured = Plane::from_fn(size, size, |i, j| {
        // The place y with y + grad phi(y) = (i, j): grad phi changes by far less than 1 from pixel to pixel.
        let (mut row, mut column) = (i as f64, j as f64);
        for _ in 0..50 {
            let g = phase.gradient(row, column);
            (row, column) = (i as f64 - g[1], j as f64 - g[0]);
        }
        mask.cubic(row + border as f64, column + border as f64) + noise[(size + i) * size + j]
    });
    let mut phi = Plane::from_fn(size, size, |i, j| phase.value(i as f64, j as f64));
    let mean = phi.values.iter().sum::<f64>() / phi.values.len() as f64;
    phi.values.iter_mut().for_each(|v| *v -= mean);
    let image = |plane: Plane| Image::new(size, size, vec![plane.values]);
    Ok(SimulatedPair { reference: image(reference)?, captured: image(captured)?, phi: image(phi)? })
}

/// [1 4 6 4 1] / 16 in both directions.
fn blurred(plane: &Plane) -> Plane {
    const WEIGHTS: [f64; 5] = [0.0625, 0.25, 0.375, 0.25, 0.0625];
    let sum = |f: &dyn Fn(isize) -> f64| (0..5).map(|k| WEIGHTS[k] * f(k as isize - 2)).sum::<f64>();
    let (w, h) = (plane.width, plane.height);
    let rows = Plane::from_fn(w, h, |i, j| sum(&|k| plane.at(i as isize, j as isize + k)));
    Plane::from_fn(w, h, |i, j| sum(&|k| rows.at(i as isize + k, j as isize)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pair_follows_its_wavefront() {
        let settings = SimulateSettings { size: 96, max_shift: 1.5, seed: 3 };
        let pair = simulate(&settings).unwrap();
        assert_eq!(pair, simulate(&settings).unwrap());
        assert_ne!(pair.reference, simulate(&SimulateSettings { seed: 4, ..settings }).unwrap().reference);
        let plane = |image: &Image| Plane { width: 96, height: 96, values: image.channels[0].clone() };
        let (one, two, phi) = (plane(&pair.reference), plane(&pair.captured), plane(&pair.phi));
        let [along, down] = phi.derivatives();
        let (mut off, mut still, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
        for i in 8..88 {
            for j in 8..88 {
                let (gx, gy) = (along.at(i, j), down.at(i, j));
                largest = largest.max(gx.hypot(gy));
                off += (two.cubic(i as f64 + gy, j as f64 + gx) - one.at(i, j)).powi(2);
                still += (two.at(i, j) - one.at(i, j)).powi(2);
            }
        }
        assert!(largest > 1.0 && largest < 1.51, "{largest}");
        // What is left is the noise of both images and twice the interpolation.
        let (off, still) = ((off / 6400.0).sqrt(), (still / 6400.0).sqrt());
        assert!(off < 2.0 * NOISE && still > 5.0 * off, "{off} and {still}");
        assert!(phi.values.iter().sum::<f64>().abs() < 1e-9);
    }

    #[test]
    fn settings_out_of_range() {
        for (size, max_shift) in [(31, 1.0), (64, 0.0), (64, f64::NAN), (64, 7.0), (1 << 20, 1.0)] {
            assert!(simulate(&SimulateSettings { size, max_shift, seed: 0 }).is_err(), "{size}, {max_shift}");
        }
    }
}
