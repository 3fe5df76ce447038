//! From coarse to fine: A(32) again and again, between images that are warped by what is known.

use super::plane::Plane;
use super::texture::texture;
use super::{Consistency, Linearised};
use crate::{Image, ImageError};

/// How the two images are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PyramidSettings {
    /// beta of A(32), for images with values from 0 to 255. The authors take 3 for their sensor; with the noise of one in 255
    /// that simulated pairs have, wavefronts are then wrong by a third, and by a twentieth at most with ten times as much.
    pub beta: f64,
    /// mu, the penalty of the splitting.
    pub mu: f64,
    /// L: the wavefront has at least so many pixels more than the image on each side.
    pub margin: usize,
    /// The coarsest level has no side below this, if the image has not.
    pub coarsest: usize,
    /// Warps of each level.
    pub warps: usize,
    /// Whether textures are compared instead of the images.
    pub texture: bool,
    /// Whether a 3 x 3 median of phi ends each warp: A(32) has as many unknowns as pixels to tell of them, and what is rough in phi
    /// is made of noise.
    pub median: bool,
}

impl Default for PyramidSettings {
    fn default() -> Self {
        PyramidSettings { beta: 30.0, mu: 100.0, margin: 16, coarsest: 64, warps: 3, texture: true, median: true }
    }
}

/// Where a linearised problem stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// 0 is the finest.
    pub level: usize,
    /// From 0.
    pub warp: usize,
    /// Columns of the image of this level.
    pub width: usize,
    /// Its rows.
    pub height: usize,
    /// Whether it is the last of all.
    pub is_last: bool,
}

/// Sides below this leave nothing to compare beside the border.
const SMALLEST: usize = 16;

/// Two images as planes of one scale, values from 0 to 255: colours are averaged, the least and the largest value of both
/// become 0 and 255, and what is left of the structure is taken out where textures are asked for.
///
/// # Errors
/// Sizes that differ or are too small, and images in which nothing can be seen.
pub fn comparable(reference: &Image, captured: &Image, textures: bool) -> Result<[Plane; 2], ImageError> {
    let (a, b) = (reference, captured);
    if (a.width, a.height) != (b.width, b.height) {
        let text = format!("{} x {} and {} x {}", a.width, a.height, b.width, b.height);
        return Err(ImageError(format!(
            "the images have {text} pixels; give two of one size, of the same field of view"
        )));
    }
    if a.width.min(a.height) < SMALLEST {
        let text = format!("the images have {} x {} pixels; a side needs at least {SMALLEST}", a.width, a.height);
        return Err(ImageError(text));
    }
    let planes = [grey("reference", a)?, grey("captured", b)?];
    for (plane, name) in planes.iter().zip(["reference", "captured"]) {
        let (lo, hi) = plane.range();
        let differs = hi > lo;
        if !differs {
            return Err(ImageError(format!("the {name} image is {lo} everywhere: there is nothing to compare")));
        }
    }
    if !textures {
        return Ok(scaled(&planes, 0.0, 255.0));
    }
    let planes = scaled(&planes, -1.0, 1.0).map(|plane| texture(&plane));
    Ok(scaled(&planes, 0.0, 255.0))
}

/// The mean of the channels.
fn grey(name: &str, image: &Image) -> Result<Plane, ImageError> {
    let n = image.n_pixels();
    if image.channels.is_empty() || image.channels.iter().any(|c| c.len() != n || c.iter().any(|v| !v.is_finite())) {
        return Err(ImageError(format!("the {name} image does not have a finite number for each pixel and channel")));
    }
    let part = 1.0 / image.channels.len() as f64;
    let mut values = vec![0.0; n];
    for channel in &image.channels {
        // Each part before the sum, which then cannot overflow.
        values.iter_mut().zip(channel).for_each(|(v, c)| *v += part * c);
    }
    Ok(Plane { width: image.width, height: image.height, values })
}

/// Both by one affine map, so that the least and largest value of both are `lo` and `hi`.
fn scaled(planes: &[Plane; 2], lo: f64, hi: f64) -> [Plane; 2] {
    let ranges = [planes[0].range(), planes[1].range()];
    let (least, most) = (ranges[0].0.min(ranges[1].0), ranges[0].1.max(ranges[1].1));
    // Halves: the difference of two finite numbers may not be one.
    let half = 0.5 * most - 0.5 * least;
    let unit = |v: f64| if half > 0.0 { (0.5 * v - 0.5 * least) / half } else { 0.0 };
    planes.clone().map(|mut plane| {
        plane.values.iter_mut().for_each(|v| *v = lo + (hi - lo) * unit(*v));
        plane
    })
}

/// phi of A(32) on a level: the image's place in a field that is larger on all sides.
struct Field {
    phi: Plane,
    margin: usize,
}

/// Products of 2, 3 and 5 are transformed fast.
fn fast(n: usize) -> usize {
    (n..)
        .find(|n| {
            [2, 3, 5].iter().fold(*n, |mut n, p| {
                while n.is_multiple_of(*p) && n > 1 {
                    n /= p;
                }
                n
            }) == 1
        })
        .unwrap_or(n)
}

impl Field {
    /// 0 around an image, or what a coarser level has found.
    fn new(image: &Plane, margin: usize, coarse: Option<&Field>) -> Field {
        let (w, h) = (fast(image.width + 2 * margin), fast(image.height + 2 * margin));
        let phi = Plane::from_fn(w, h, |i, j| {
            // Pixel k of an image of differences stands for k + 1/2. Shifts double with the number of pixels, hence phi is
            // four times as large.
            let half = |k: usize| 0.5 * (k as f64 - margin as f64) + margin as f64;
            coarse.map_or(0.0, |c| 4.0 * c.phi.cubic(half(i), half(j)))
        });
        Field { phi, margin }
    }

    /// grad phi at a pixel of the image: along the row and down.
    fn shift(&self, i: usize, j: usize) -> [f64; 2] {
        let at = |i: usize, j: usize| self.phi.values[(i + self.margin) * self.phi.width + j + self.margin];
        let own = at(i, j);
        [at(i, j + 1) - own, at(i + 1, j) - own]
    }

    /// A(32) for the increment of phi: g the mean gradient of I1 and of I2(. + grad phi), g_t their difference. Pixels whose
    /// light comes from outside I2 are masked.
    fn linearised(&self, one: &Plane, two: &Plane, settings: &PyramidSettings) -> Linearised {
        let (w, h) = (one.width, one.height);
        let place = |i: usize, j: usize| {
            let [x, y] = self.shift(i, j);
            (i as f64 + y, j as f64 + x)
        };
        let warped = Plane::from_fn(w, h, |i, j| {
            let (y, x) = place(i, j);
            two.cubic(y, x)
        });
        let (a, b) = (one.derivatives(), warped.derivatives());
        let seen = |i: usize, j: usize| {
            let (y, x) = place(i, j);
            y >= 0.0 && x >= 0.0 && y <= (h - 1) as f64 && x <= (w - 1) as f64
        };
        let (wide, high) = (self.phi.width, self.phi.height);
        let spread = |f: &(dyn Fn(usize) -> f64 + Sync)| {
            let of = |i: usize, j: usize| {
                let (Some(i), Some(j)) = (i.checked_sub(self.margin), j.checked_sub(self.margin)) else { return 0.0 };
                if i < h && j < w && seen(i, j) { f(i * w + j) } else { 0.0 }
            };
            Plane::from_fn(wide, high, of).values
        };
        let data = Consistency {
            gx: spread(&|k| 0.5 * (a[0].values[k] + b[0].values[k])),
            gy: spread(&|k| 0.5 * (a[1].values[k] + b[1].values[k])),
            gt: spread(&|k| warped.values[k] - one.values[k]),
        };
        Linearised { width: wide, height: high, data, beta: settings.beta, mu: settings.mu }
    }

    /// phi at the centres of the pixels of the image.
    fn of_image(&self, image: &Plane) -> Plane {
        // A difference belongs to the place between two pixels, so that phi as it was solved for stands half a pixel off.
        let at = |k: usize| (k + self.margin) as f64 + 0.5;
        Plane::from_fn(image.width, image.height, |i, j| self.phi.cubic(at(i), at(j)))
    }
}

/// What solves one problem: phi of it.
pub type Solve<'a, E> = dyn FnMut(Stage, &Linearised) -> Result<Vec<f64>, E> + 'a;

/// phi with I2(. + grad phi) = I1, mean 0, in square pixels, as large as the images: on each level of a pyramid of halved
/// images, from the coarsest, `solve` is given the problem A(32) of an increment after each warp.
///
/// # Errors
/// What `solve` returns.
pub fn coarse_to_fine<E>(
    [reference, captured]: &[Plane; 2],
    settings: &PyramidSettings,
    solve: &mut Solve<'_, E>,
) -> Result<Plane, E> {
    let mut levels = vec![(reference.clone(), captured.clone())];
    while let Some((one, two)) = levels.last() {
        if one.width.min(one.height).div_ceil(2) < settings.coarsest.max(SMALLEST) {
            break;
        }
        let next = (one.halved(), two.halved());
        levels.push(next);
    }
    // Beside a border there is always a pixel whose difference does not belong to the image.
    let margin = settings.margin.max(1);
    let mut field: Option<Field> = None;
    for (level, (one, two)) in levels.iter().enumerate().rev() {
        let mut now = Field::new(one, margin, field.as_ref());
        for warp in 0..settings.warps {
            let is_last = level == 0 && warp + 1 == settings.warps;
            let stage = Stage { level, warp, width: one.width, height: one.height, is_last };
            let increment = solve(stage, &now.linearised(one, two, settings))?;
            now.phi.values.iter_mut().zip(increment).for_each(|(phi, d)| *phi += d);
            if settings.median {
                now.phi = now.phi.median();
            }
        }
        field = Some(now);
    }
    let mut phi = match field {
        Some(field) => field.of_image(reference),
        None => reference.clone(),
    };
    let mean = phi.values.iter().sum::<f64>() / phi.values.len().max(1) as f64;
    phi.values.iter_mut().for_each(|v| *v -= mean);
    Ok(phi)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, height: usize, f: impl Fn(usize) -> f64) -> Image {
        Image { width, height, channels: vec![(0..width * height).map(f).collect()] }
    }

    #[test]
    fn pairs_that_cannot_be_compared() {
        let good = image(20, 20, |k| (k as f64).sin());
        let wrong = |a: &Image, b: &Image| comparable(a, b, true).expect_err("refused").0;
        assert!(wrong(&good, &image(20, 21, |k| k as f64)).contains("20 x 20 and 20 x 21"));
        assert!(wrong(&image(20, 15, |k| k as f64), &image(20, 15, |k| k as f64)).contains("at least 16"));
        assert!(wrong(&good, &image(20, 20, |_| 0.25)).contains("captured image is 0.25 everywhere"));
        assert!(wrong(&image(20, 20, |k| if k == 7 { f64::NAN } else { 1.0 }), &good).contains("finite"));
        let [a, b] = comparable(&good, &image(20, 20, |k| 1e300 * (k as f64).cos()), false).unwrap();
        assert!(b.range() == (0.0, 255.0) || (b.range().0 >= 0.0 && b.range().1 == 255.0));
        assert!(a.values.iter().all(|v| v.is_finite()));
    }

    #[test]
    fn sizes_of_fields_are_products_of_small_primes() {
        let sizes: Vec<usize> = [1, 7, 32, 97, 544, 1056].map(fast).to_vec();
        assert_eq!(sizes, [1, 8, 32, 100, 576, 1080]);
        let field = Field::new(&Plane::from_fn(20, 10, |_, _| 0.0), 3, None);
        assert_eq!((field.phi.width, field.phi.height), (27, 16));
    }

    /// A quadratic phi, laid out as it is solved for, is the same on the finer level and in the image.
    #[test]
    fn levels_and_the_image_agree_on_where_phi_is() {
        let of = |y: f64, x: f64| 0.01 * y * y - 0.02 * x * y + 0.3 * x;
        let (coarse, fine) = (Plane::from_fn(40, 40, |_, _| 0.0), Plane::from_fn(80, 80, |_, _| 0.0));
        let mut field = Field::new(&coarse, 4, None);
        // Number k of the field is phi half a pixel before pixel k - 4. Coarse pixel c lies at 2c + 1/2 among the fine ones.
        let place = |k: usize| 2.0 * (k as f64 - 4.5) + 0.5;
        field.phi = Plane::from_fn(field.phi.width, field.phi.height, |i, j| 0.25 * of(place(i), place(j)));
        let finer = Field::new(&fine, 4, Some(&field));
        let image = finer.of_image(&fine);
        for (i, j) in [(10, 20), (33, 47), (60, 8)] {
            assert!((image.at(i, j) - of(i as f64, j as f64)).abs() < 1e-9, "{i}, {j}");
        }
    }
}
