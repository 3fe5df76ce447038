//! lambda by an estimate of the risk.

use super::{Edges, Form, Iteration, Model};
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
}

impl Default for RiskSettings {
    fn default() -> Self {
        RiskSettings { iterations: 60, tile: 160, damping: 0.02 }
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Risk {
    /// lambda
    pub lambda: f64,
    /// The estimate over the number of pixels.
    pub value: f64,
}

/// The lambda of least estimated risk: steps of a factor of 2 from a guess by the noise until both neighbours are worse, and
/// the vertex of the parabola through the three. All that were tried, the chosen one last.
///
/// # Errors
/// No noise; what [`Model::build`] refuses; a problem that the splitting refuses, as its text.
pub fn choose_lambda(
    model: &Model,
    noise: f64,
    settings: &RiskSettings,
    stop: &mut dyn FnMut() -> bool,
) -> Result<Vec<Risk>, ImageError> {
    if !(noise > 0.0 && noise.is_finite()) {
        return Err(ImageError(format!("lambda cannot be found for noise of {noise}; give --lambda")));
    }
    let tiles = tiles(model, settings.tile);
    let mut tried: Vec<Risk> = Vec::new();
    // lambda = b / (2 s^2) is the maximum of the likelihood for steps of mean 2b; 1/rho_0 is such a step.
    let first = 1.0 / (2.0 * noise * noise * model.natural);
    let at = |k: i32, tried: &mut Vec<Risk>| -> Result<f64, ImageError> {
        let lambda = first * 2f64.powi(k);
        if let Some(known) = tried.iter().find(|risk| risk.lambda == lambda) {
            return Ok(known.value);
        }
        let mut value = 0.0;
        let mut pixels = 0.0;
        for tile in &tiles {
            let tile = Model { lambda, ..tile.clone() };
            value += risk(&tile, noise, settings)?;
            pixels += (tile.width * tile.height * tile.channels.len()) as f64;
        }
        tried.push(Risk { lambda, value: value / pixels });
        Ok(value / pixels)
    };
    /// Steps to either side.
    const FARTHEST: i32 = 10;
    let mut k: i32 = 0;
    let mut here = at(0, &mut tried)?;
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
    let step = STEP * noise;
    let signs: Vec<Vec<f64>> =
        model.channels.iter().enumerate().map(|(c, plane)| signs(plane.len(), c as u64)).collect();
    let mut moved = model.clone();
    for (plane, signs) in moved.channels.iter_mut().zip(&signs) {
        plane.iter_mut().zip(signs).for_each(|(v, s)| *v += step * s);
    }
    let (here, there) = (solved(model)?, solved(&moved)?);
    let inverse = Inverse::new(model, settings.damping);
    let mut value = 0.0;
    for c in 0..model.channels.len() {
        let masked = |v: Vec<f64>| match &model.mask {
            Some(mask) => v.iter().zip(mask).map(|(v, m)| v * m).collect(),
            None => v,
        };
        let measured = model.mask.as_ref().map_or(1.0, |m| m.iter().sum::<f64>() / m.len() as f64);
        let off = masked(here[c].iter().zip(&model.channels[c]).map(|(k, f)| k - f).collect());
        let slope = masked(there[c].iter().zip(&here[c]).map(|(a, b)| (a - b) / step).collect());
        let (off, probe, slope) =
            (inverse.apply(&off), inverse.apply(&masked(signs[c].clone())), inverse.apply(&slope));
        let (square, trace) = (proxel_split::vector::dot(&off, &off), proxel_split::vector::dot(&probe, &slope));
        let n = (model.width * model.height) as f64 * measured;
        value += square - noise * noise * n * inverse.gain + 2.0 * noise * noise * trace;
    }
    Ok(value)
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
