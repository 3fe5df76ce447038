//! lambda by an estimate of the risk.

use super::{Data, Edges, Form, Iteration, Model};
use crate::{ImageError, Psf};
use proxel_split::{Method, SystemError};

/// How lambda is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RiskSettings {
    /// Iterations of each solve.
    pub iterations: usize,
    /// Images that are larger on a side than twice this are represented by four tiles of this side.
    pub tile: usize,
    /// What the noise's share in a frequency is compared with: see [`Risk`].
    pub damping: f64,
    /// The lambda that is tried first; by the noise if none.
    pub first: Option<f64>,
    /// Where the estimate of the first is above this nothing else is tried.
    pub most: f64,
}

impl Default for RiskSettings {
    fn default() -> Self {
        RiskSettings { iterations: 60, tile: 160, damping: 0.02, first: None, most: f64::INFINITY }
    }
}

/// An estimate of the squared error of a restoration, from one blurred and noisy image.
///
/// With x(f) the result for f, A = conj(H) / (|H|^2 + damping), which undoes the blur where noise allows, and white noise of
/// variance s^2, the expectation of
///
/// ```text
/// |A (K x(f) - f)|^2 - s^2 N mean |A|^2 + 2 s^2 tr(A^T A K x'(f))
/// ```
///
/// is that of |A K (x(f) - x_true)|^2: Stein's unbiased estimate (Stein 1981; Eldar 2009 for its weighted form). The trace is
/// found by one difference along random signs (Ramani, Blu and Unser 2008), for which the same number of iterations is run
/// from the same start, so that it is the derivative of what is computed, converged or not.
///
/// Noise whose variance s_i^2 is another for each pixel stands as
///
/// ```text
/// |A (K x(f) - f)|^2 - mean |A|^2 sum s_i^2 + 2 tr(diag(s)^2 A^T A K x'(f))
/// ```
///
/// which holds to first order for counts of light (Luisier, Blu and Unser 2011), s_i^2 = s^2 f_i. For [`Data::Huber`] the
/// pixels that differ from the median of their surroundings by more than four s are outliers, and left out: that the result
/// does not follow them is no error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Risk {
    /// lambda
    pub lambda: f64,
    /// The estimate over the number of pixels.
    pub value: f64,
}

/// The lambda of least estimated risk: steps of a factor of 2 from the first until both neighbours are worse, and the vertex of
/// the parabola through the three, whose value is that of the best of them. All that were tried, the chosen one last; only the
/// first where its estimate is above `most`. `noise` is s: the standard deviation, for [`Data::Poisson`] that of a pixel of
/// value 1.
///
/// # Errors
/// No noise; what [`Model::build`] refuses; a problem that the splitting refuses, as its text.
pub fn choose_lambda(
    model: &Model,
    noise: f64,
    settings: &RiskSettings,
    stop: &mut dyn FnMut() -> bool,
) -> Result<Vec<Risk>, ImageError> {
    check(noise)?;
    let tiles = tiles(model, settings.tile);
    let mut tried: Vec<Risk> = Vec::new();
    // lambda = b / (2 s^2) is the maximum of the likelihood for steps of mean 2b; 1/rho_0 is such a step.
    // That of counts is not halved.
    let halves = if model.data == Data::Poisson { 1.0 } else { 2.0 };
    let first = settings.first.unwrap_or(1.0 / (halves * noise * noise * model.natural));
    let at = |k: i32, tried: &mut Vec<Risk>| -> Result<f64, ImageError> {
        let lambda = first * 2f64.powi(k);
        if let Some(known) = tried.iter().find(|risk| risk.lambda == lambda) {
            return Ok(known.value);
        }
        let value = mean(&tiles, lambda, noise, settings)?;
        tried.push(Risk { lambda, value });
        Ok(value)
    };
    /// Steps to either side.
    const FARTHEST: i32 = 10;
    let mut k: i32 = 0;
    let mut here = at(0, &mut tried)?;
    if here.is_nan() || here > settings.most {
        return Ok(tried);
    }
    let way = if at(1, &mut tried)? < here { 1 } else { -1 };
    while k.abs() < FARTHEST && !stop() {
        let next = at(k + way, &mut tried)?;
        if next.is_nan() || next >= here {
            break;
        }
        (k, here) = (k + way, next);
    }
    let value = |tried: &[Risk], k: i32| {
        let lambda = first * 2f64.powi(k);
        tried.iter().find(|risk| risk.lambda == lambda).map(|risk| risk.value)
    };
    let (below, above) = (value(&tried, k - 1), value(&tried, k + 1));
    let shift = match (below, above) {
        (Some(below), Some(above)) if below + above > 2.0 * here => {
            (0.5 * (below - above) / (below + above - 2.0 * here)).clamp(-0.5, 0.5)
        }
        _ => 0.0,
    };
    tried.push(Risk { lambda: first * 2f64.powf(f64::from(k) + shift), value: here });
    Ok(tried)
}

/// The estimate for the lambda that the model has, by the same parts of the image as [`choose_lambda`].
///
/// # Errors
/// As [`choose_lambda`].
pub fn estimate_risk(model: &Model, noise: f64, settings: &RiskSettings) -> Result<Risk, ImageError> {
    check(noise)?;
    let value = mean(&tiles(model, settings.tile), model.lambda, noise, settings)?;
    Ok(Risk { lambda: model.lambda, value })
}

fn check(noise: f64) -> Result<(), ImageError> {
    if noise > 0.0 && noise.is_finite() {
        return Ok(());
    }
    Err(ImageError(format!("lambda cannot be found for noise of {noise}; give --lambda")))
}

/// The estimate over the number of pixels.
fn mean(tiles: &[Model], lambda: f64, noise: f64, settings: &RiskSettings) -> Result<f64, ImageError> {
    let (mut value, mut pixels) = (0.0, 0.0);
    for tile in tiles {
        let tile = Model { lambda, ..tile.clone() };
        value += risk(&tile, noise, settings)?;
        pixels += (tile.width * tile.height * tile.channels.len()) as f64;
    }
    Ok(value / pixels)
}

/// The image itself, or four parts of it around the middles of its quarters, whose borders are unknown.
fn tiles(model: &Model, side: usize) -> Vec<Model> {
    let side_of = |n: usize, blur: usize| side.max(2 * blur).min(n);
    let (w, h) = (side_of(model.width, model.psf.width), side_of(model.height, model.psf.height));
    if model.width <= 2 * side && model.height <= 2 * side {
        return vec![model.clone()];
    }
    let mut tiles = Vec::new();
    for (i, j) in [(1, 1), (1, 3), (3, 1), (3, 3)] {
        let first = |k: usize, n: usize, side: usize| (k * n / 4).saturating_sub(side / 2).min(n - side);
        let (top, left) = (first(i, model.height, h), first(j, model.width, w));
        let cut = |plane: &Vec<f64>| -> Vec<f64> {
            (top..top + h).flat_map(|i| plane[i * model.width + left..][..w].iter().copied()).collect()
        };
        let mask = model.mask.as_ref().map(cut);
        if mask.as_ref().is_some_and(|mask| !mask.iter().any(|m| *m > 0.0)) {
            continue;
        }
        tiles.push(Model {
            width: w,
            height: h,
            channels: model.channels.iter().map(cut).collect(),
            edges: Edges::Unknown,
            mask,
            form: Form::Auto,
            ..model.clone()
        });
    }
    tiles
}

/// The estimate, times the number of pixels.
fn risk(model: &Model, noise: f64, settings: &RiskSettings) -> Result<f64, ImageError> {
    let text = |e: SystemError| ImageError(e.to_string());
    let solved = |model: &Model| -> Result<Vec<Vec<f64>>, ImageError> {
        let built = model.build(None)?;
        let field = built.field.clone();
        let mut method: Box<dyn Method> = built.method("risk", Iteration::Admm { relaxation: 1.8 }).map_err(text)?;
        for _ in 0..settings.iterations {
            method.step().map_err(text)?;
        }
        Ok(field.seen(method.x()))
    };
    /// Of the noise: small against what the restoration reacts to, large against rounding.
    const STEP: f64 = 0.1;
    // s_i of each pixel, with random signs.
    let probes: Vec<Vec<f64>> = (model.channels.iter().enumerate())
        .map(|(c, plane)| {
            let mut probe = signs(plane.len(), c as u64);
            probe.iter_mut().zip(plane).for_each(|(p, f)| *p *= deviation(model, noise, *f));
            probe
        })
        .collect();
    let mut moved = model.clone();
    for (plane, probe) in moved.channels.iter_mut().zip(&probes) {
        plane.iter_mut().zip(probe).for_each(|(v, p)| *v += STEP * p);
    }
    let (here, there) = (solved(model)?, solved(&moved)?);
    let inverse = Inverse::new(model, settings.damping);
    let mut value = 0.0;
    for (c, plane) in model.channels.iter().enumerate() {
        let counted = counted(model, noise, plane);
        let masked = |v: Vec<f64>| -> Vec<f64> {
            match &counted {
                Some(counted) => v.iter().zip(counted).map(|(v, m)| v * m).collect(),
                None => v,
            }
        };
        let off = masked(here[c].iter().zip(plane).map(|(k, f)| k - f).collect());
        let slope = masked(there[c].iter().zip(&here[c]).map(|(a, b)| (a - b) / STEP).collect());
        let probe = masked(probes[c].clone());
        let variance = proxel_split::vector::dot(&probe, &probe);
        let (off, probe, slope) = (inverse.apply(&off), inverse.apply(&probe), inverse.apply(&slope));
        let (square, trace) = (proxel_split::vector::dot(&off, &off), proxel_split::vector::dot(&probe, &slope));
        value += square - variance * inverse.gain + 2.0 * trace;
    }
    Ok(value)
}

/// The standard deviation of the noise of a pixel that was seen as f.
fn deviation(model: &Model, noise: f64, f: f64) -> f64 {
    if model.data == Data::Poisson { noise * f.max(0.0).sqrt() } else { noise }
}

/// 1 for each pixel that the estimate counts, 0 for others; none where it counts all.
fn counted(model: &Model, noise: f64, plane: &[f64]) -> Option<Vec<f64>> {
    let Data::Huber { .. } = model.data else { return model.mask.clone() };
    let mut counted = inliers(model.width, model.height, plane, noise);
    if let Some(mask) = &model.mask {
        counted.iter_mut().zip(mask).for_each(|(c, m)| *c *= m);
    }
    Some(counted)
}

/// 1 where a pixel differs from the median of the 3 x 3 about it, less at borders, by at most four s.
fn inliers(width: usize, height: usize, plane: &[f64], noise: f64) -> Vec<f64> {
    const FAR: f64 = 4.0;
    let mut around = Vec::with_capacity(9);
    (0..plane.len())
        .map(|k| {
            let (i, j) = (k / width, k % width);
            around.clear();
            for row in i.saturating_sub(1)..(i + 2).min(height) {
                around.extend_from_slice(&plane[row * width + j.saturating_sub(1)..row * width + (j + 2).min(width)]);
            }
            let middle = around.len() / 2;
            let (_, median, _) = around.select_nth_unstable_by(middle, f64::total_cmp);
            f64::from(u8::from((plane[k] - *median).abs() <= FAR * noise))
        })
        .collect()
}

/// Random signs, the same for each call.
fn signs(n: usize, seed: u64) -> Vec<f64> {
    // SplitMix64.
    let mut state = seed.wrapping_add(0x2545_f491_4f6c_dd1d);
    (0..n)
        .map(|_| {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
        })
        .collect()
}

/// A = conj(H) / (|H|^2 + damping) on a field as large as the image, which wraps around.
struct Inverse {
    grid: crate::Grid,
    fourier: crate::Fourier,
    spectrum: Vec<realfft::num_complex::Complex<f64>>,
    gain: f64, // the mean of |A|^2
}

impl Inverse {
    fn new(model: &Model, damping: f64) -> Self {
        let fourier = crate::Fourier::new(model.width, model.height);
        // What blurs finer pixels than these is no blur of them that could be undone.
        let psf = if model.scale == 1 { model.psf.clone() } else { Psf::identity() };
        let mut spectrum = psf.spectrum(&fourier);
        let mut gain = 0.0;
        for (j, column) in spectrum.chunks_mut(model.height).enumerate() {
            for h in column {
                *h = h.conj() / (h.norm_sqr() + damping);
                gain += fourier.multiplicity(j) * h.norm_sqr();
            }
        }
        let grid = crate::Grid::new(model.width, model.height);
        Inverse { gain: gain / grid.n_pixels() as f64, grid, fourier, spectrum }
    }

    fn apply(&self, of: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; of.len()];
        crate::convolve(self.grid, &self.fourier, &self.spectrum, false, of, &mut out);
        out
    }
}
