//! `proxel.deblur`, `proxel.denoise`, `proxel.inpaint` and `proxel.wavefront`.

use crate::arrays::pixels;
use crate::drive::{Cancel, Listener, Progress, drive};
use crate::error::{InputError, refused};
use crate::outcome::{Draw, Outcome, trace};
use crate::settings::{given, merged};
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use proxel::imaging::{Image, Psf};
use proxel::report::TraceRow;
use proxel::restore::{Hooks, Input, RestoreRow, draw_restored, restore as solve};
use proxel::settings::{RestoreSettings, WavefrontSettings};
use proxel::wavefront::{Hooks as WaveHooks, draw_wavefront, wavefront as solve_wavefront};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An image (h, w, c).
fn image(array: &PyReadonlyArray3<'_, f64>, what: &str) -> PyResult<Image> {
    let (h, w, c) = array.as_array().dim();
    let flat = array.as_slice().map_err(refused)?;
    let plane = |k: usize| flat.iter().skip(k).step_by(c).copied().collect();
    Image::new(w, h, (0..c).map(plane).collect()).map_err(|e| InputError::new_err(format!("{what}: {e}")))
}

/// What blurs an image: a name, or weights around a centre.
#[derive(FromPyObject)]
pub enum Blur<'py> {
    /// gaussian:S, motion:LENGTH,ANGLE or disk:R.
    Named(String),
    /// Weights (h, w) and the row and column of the centre.
    Weights(PyReadonlyArray2<'py, f64>, Option<(usize, usize)>),
}

impl Blur<'_> {
    fn psf(&self) -> PyResult<Psf> {
        match self {
            Blur::Named(text) => match Psf::named(text) {
                Some(psf) => psf.map_err(|e| InputError::new_err(format!("psf `{text}`: {e}"))),
                None => Err(InputError::new_err(format!(
                    "psf `{text}`: there is none of this name; give gaussian:S, motion:LENGTH,ANGLE, disk:R or an array"
                ))),
            },
            Blur::Weights(array, center) => {
                let (h, w) = array.as_array().dim();
                Psf::new(w, h, array.as_slice().map_err(refused)?.to_vec(), *center).map_err(refused)
            }
        }
    }
}

/// What is known of an image, apart from its pixels.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Known<'py> {
    psf: Option<Blur<'py>>,
    mask: Option<PyReadonlyArray2<'py, f64>>,
    truth: Option<PyReadonlyArray3<'py, f64>>,
    has_channels: bool,
}

/// The image of least objective: [`proxel::restore::restore`], as the command says.
#[pyfunction]
#[pyo3(signature = (command, seen, known, keywords, callback, cancel, traced))]
pub fn restore<'py>(
    py: Python<'py>,
    command: &str,
    seen: PyReadonlyArray3<'py, f64>,
    known: Known<'py>,
    keywords: &Bound<'py, PyDict>,
    callback: Option<Bound<'py, PyAny>>,
    cancel: Option<Py<Cancel>>,
    traced: bool,
) -> PyResult<(Bound<'py, PyAny>, Outcome)> {
    let settings: RestoreSettings = merged(&RestoreSettings::default(), given(keywords)?)?;
    let seen = image(&seen, "the image")?;
    let truth = known.truth.as_ref().map(|t| image(t, "the truth")).transpose()?;
    let psf = known.psf.as_ref().map_or(Ok(Psf::identity()), Blur::psf)?;
    let mask = match &known.mask {
        Some(mask) if mask.as_array().dim() != (seen.height, seen.width) => {
            let (h, w) = mask.as_array().dim();
            let text =
                format!("the mask is {w} x {h}, the image {} x {}; give one of its size", seen.width, seen.height);
            return Err(InputError::new_err(text));
        }
        Some(mask) => Some(mask.as_slice().map_err(refused)?.to_vec()),
        None => None,
    };
    let input = Input { command, image: &seen, psf, mask: mask.as_deref(), truth: truth.as_ref() };
    let mut lines: Vec<RestoreRow> = Vec::new();
    let solved = drive(py, &Listener { callback, cancel }, |link| {
        let mut on_progress = |iteration: usize, energy: f64| {
            link.tell(Progress { iteration, energy, seconds: f64::NAN, ..Progress::default() });
        };
        let mut on_row = |row: &RestoreRow| lines.push(*row);
        let mut hooks = Hooks { cancel: link.cancel.clone(), ..Hooks::default() };
        if link.is_heard() {
            hooks.progress = Some(&mut on_progress);
        }
        if traced {
            hooks.trace = Some(&mut on_row);
        }
        solve(&input, &settings, &mut hooks)
    })?;
    let mut result = solved.map_err(refused)?;
    let columns = match traced {
        false => None,
        true => {
            let columns = trace(py, &lines.iter().map(|r| r.row).collect::<Vec<_>>())?;
            let column = |of: fn(&RestoreRow) -> f64| crate::arrays::column(py, lines.iter().map(of).collect());
            columns.set_item("part", column(|r| r.part as f64))?;
            columns.set_item("duality_gap", column(|r| r.duality_gap))?;
            columns.set_item("psnr", column(|r| r.psnr))?;
            Some(columns)
        }
    };
    let array = pixels(py, &result.image, known.has_channels)?;
    let after = result.image;
    let draw: Draw = Box::new(move || Ok(draw_restored(&seen, &after)));
    Ok((array, Outcome::new(&mut result.report, &PyDict::new(py), Some(draw))?.traced(columns)))
}

/// The wavefront between two images: [`proxel::wavefront::wavefront`].
#[pyfunction]
#[pyo3(signature = (reference, captured, keywords, callback, cancel, traced))]
pub fn wavefront<'py>(
    py: Python<'py>,
    reference: PyReadonlyArray3<'py, f64>,
    captured: PyReadonlyArray3<'py, f64>,
    keywords: &Bound<'py, PyDict>,
    callback: Option<Bound<'py, PyAny>>,
    cancel: Option<Py<Cancel>>,
    traced: bool,
) -> PyResult<(Bound<'py, PyAny>, Outcome)> {
    let settings: WavefrontSettings = merged(&WavefrontSettings::default(), given(keywords)?)?;
    let (one, two) = (image(&reference, "the reference")?, image(&captured, "the captured image")?);
    let mut lines: Vec<TraceRow> = Vec::new();
    let solved = drive(py, &Listener { callback, cancel }, |link| {
        let mut on_row = |row: &TraceRow| {
            link.tell(row.into());
            lines.push(*row);
        };
        let mut hooks = WaveHooks { cancel: link.cancel.clone(), ..WaveHooks::default() };
        if traced || link.is_heard() {
            hooks.trace = Some(&mut on_row);
        }
        solve_wavefront(&one, &two, &settings, &mut hooks)
    })?;
    let mut result = solved.map_err(refused)?;
    let columns = traced.then(|| trace(py, &lines)).transpose()?;
    let array = pixels(py, &result.phi, false)?;
    let phi = result.phi;
    let draw: Draw = Box::new(move || Ok(draw_wavefront(&phi)));
    Ok((array, Outcome::new(&mut result.report, &PyDict::new(py), Some(draw))?.traced(columns)))
}
