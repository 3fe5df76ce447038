//! The wavefront that a coded sensor has seen: A(32), with [`proxel_imaging::wavefront`] as its parts.
//!
//! ```
//! use proxel::imaging::wavefront::{SimulateSettings, simulate};
//! use proxel::settings::WavefrontSettings;
//! use proxel::wavefront::{Hooks, wavefront};
//!
//! let pair = simulate(&SimulateSettings { size: 64, max_shift: 1.0, seed: 1 })?;
//! let found = wavefront(&pair.reference, &pair.captured, &WavefrontSettings::default(), &mut Hooks::default())?;
//! let off = |k: usize| found.phi.channels[0][k] - pair.phi.channels[0][k];
//! let square = |f: &dyn Fn(usize) -> f64| (0..64 * 64).map(|k| f(k).powi(2)).sum::<f64>();
//! assert!(square(&off) < 0.15f64.powi(2) * square(&|k| pair.phi.channels[0][k]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod preview;
#[cfg(test)]
mod tests;

use crate::deform::{TimeLimit, row};
use crate::report::{Report, Seconds, TraceRow, WavefrontReport};
use crate::settings::{WavefrontMethod, WavefrontSettings};
use crate::threads;
use proxel_imaging::wavefront::{Linearised, PyramidSettings, Solver, Stage, coarse_to_fine, comparable};
use proxel_imaging::{Image, ImageError};
use proxel_split::{
    BuildError, Cancel, IterationLimit, ResidualTolerance, Residuals, Status, StepReport, Stop, SystemError, Verdict,
};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

pub use preview::draw_wavefront;

/// Why a wavefront cannot be computed: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WavefrontError(pub String);

impl std::fmt::Display for WavefrontError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WavefrontError {}

impl From<ImageError> for WavefrontError {
    fn from(e: ImageError) -> Self {
        WavefrontError(e.0)
    }
}

impl From<BuildError> for WavefrontError {
    fn from(e: BuildError) -> Self {
        WavefrontError(e.to_string())
    }
}

impl From<SystemError> for WavefrontError {
    fn from(e: SystemError) -> Self {
        WavefrontError(e.to_string())
    }
}

/// What the caller wants to hear and say while a run goes on.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called with every row of the trace: iterations are counted through all levels and warps, and each warp begins with its
    /// row 0 left out.
    pub trace: Option<&'a mut (dyn FnMut(&TraceRow) + Send)>,
    /// Set it to end the run with the best so far.
    pub cancel: Arc<AtomicBool>,
}

/// A wavefront, and how it came about.
#[derive(Clone, Debug)]
pub struct Wavefront {
    /// phi at the pixels of the images, one channel, mean 0: square pixels times the scale of the settings.
    pub phi: Image,
    /// How the run ended.
    pub status: Status,
    /// All figures; `seconds.read`, `seconds.write` and `peak_bytes` are the caller's to fill.
    pub report: Report,
}

/// phi with captured(p + grad phi(p)) = reference(p) at every pixel p.
///
/// Converged if every problem A(32) of the finest level is, to the tolerance of the settings. What time or the caller ends
/// keeps what is known then.
///
/// # Errors
/// Images of two sizes, smaller than 16 pixels, of one value or with values that are not finite; settings that make no sense.
pub fn wavefront(
    reference: &Image,
    captured: &Image,
    settings: &WavefrontSettings,
    hooks: &mut Hooks<'_>,
) -> Result<Wavefront, WavefrontError> {
    let began = Instant::now();
    settings.check().map_err(WavefrontError)?;
    let (pool, threads) = threads::pool(settings.threads).map_err(WavefrontError)?;
    pool.install(|| {
        let planes = comparable(reference, captured, settings.texture)?;
        let setup = began.elapsed().as_secs_f64();
        let mut run = Run::new(settings, hooks, began);
        let mut phi = coarse_to_fine(&planes, &pyramid(settings), &mut |stage, of| run.solve(stage, of))?;
        phi.values.iter_mut().for_each(|v| *v *= settings.scale);
        let solve = began.elapsed().as_secs_f64() - setup;
        let phi = Image::new(phi.width, phi.height, vec![phi.values])?;
        let status = run.status();
        let mut report = run.report(&phi, status);
        report.threads = threads;
        report.seconds = Seconds { setup, solve, ..Seconds::default() };
        if reference.channels.len() > 1 || captured.channels.len() > 1 {
            report.warnings.push("colours were averaged: a wavefront is found from grey".to_string());
        }
        Ok(Wavefront { phi, status, report })
    })
}

/// The settings of the pyramid.
pub fn pyramid(settings: &WavefrontSettings) -> PyramidSettings {
    PyramidSettings {
        beta: settings.beta,
        mu: settings.mu,
        margin: settings.margin,
        coarsest: settings.coarsest,
        warps: settings.warps,
        texture: settings.texture,
        median: settings.median,
    }
}

/// What a name stands for.
pub fn solver(settings: &WavefrontSettings) -> Solver {
    let window = settings.anderson;
    match settings.method {
        WavefrontMethod::Admm => Solver::Admm { relaxation: 1.0 },
        WavefrontMethod::Auto | WavefrontMethod::Relaxed => Solver::Admm { relaxation: settings.relaxation },
        WavefrontMethod::Aa => Solver::AlgorithmOne { window },
        WavefrontMethod::AaZ => Solver::LocalAlone { window },
        WavefrontMethod::Fast => Solver::Fast,
        WavefrontMethod::Gmres => Solver::Gmres { restart: settings.restart },
        WavefrontMethod::Pcg => Solver::Pcg,
    }
}

/// What a report says of phi itself, for phi as it is written.
pub fn measure(report: &mut WavefrontReport, phi: &Image, scale: f64) {
    let plane = phi.channels.first().map_or(&[][..], Vec::as_slice);
    let (lo, hi) = plane.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    let mut largest = 0.0_f64;
    for (k, v) in plane.iter().enumerate() {
        let right = if (k + 1) % phi.width > 0 { plane[k + 1] - v } else { 0.0 };
        let down = plane.get(k + phi.width).map_or(0.0, |below| below - v);
        largest = largest.max((right / scale).hypot(down / scale));
    }
    (report.phi_min, report.phi_max, report.shift_max) = (lo, hi, largest);
    report.phi_rms = (plane.iter().map(|v| v * v).sum::<f64>() / plane.len().max(1) as f64).sqrt();
}

/// All problems of a pyramid, one after the other.
struct Run<'a, 'b> {
    settings: &'a WavefrontSettings,
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    watching: Duration, // time spent on what only the trace needs
    iterations: usize,
    inner: usize,
    rejected: usize,
    solved: usize,
    levels: usize,
    unconverged: Vec<String>, // at coarser levels
    verdict: Option<Verdict>, // of the finest level, the worst so far
    ended: bool,              // nothing more is to be solved
    residuals: Residuals,
    energy: f64,
}

impl<'a, 'b> Run<'a, 'b> {
    fn new(settings: &'a WavefrontSettings, hooks: &'a mut Hooks<'b>, began: Instant) -> Self {
        Run {
            settings,
            hooks,
            began,
            watching: Duration::ZERO,
            iterations: 0,
            inner: 0,
            rejected: 0,
            solved: 0,
            levels: 0,
            unconverged: Vec::new(),
            verdict: None,
            ended: false,
            residuals: Residuals { primal: f64::INFINITY, dual: f64::INFINITY },
            energy: f64::NAN,
        }
    }

    /// The increment of one warp; 0 after the end.
    fn solve(&mut self, stage: Stage, of: &Linearised) -> Result<Vec<f64>, WavefrontError> {
        self.levels = self.levels.max(stage.level + 1);
        if self.ended {
            return Ok(vec![0.0; of.width * of.height]);
        }
        let mut method = of.method(solver(self.settings))?;
        let mut converged = ResidualTolerance::new(self.settings.tol);
        let mut cancel = Cancel(self.hooks.cancel.clone());
        let mut time = TimeLimit::new(self.began, self.settings.time_limit);
        let mut limit = IterationLimit(self.settings.max_iters);
        // The problem is convex and has no sets: the last point is the best, so that no energies are compared on the way.
        let verdict = loop {
            let report = method.step()?;
            self.inner += report.inner;
            self.rejected += report.trial.rejected;
            self.trace(&mut *method, &report);
            let stops: [&mut dyn Stop; 4] = [&mut converged, &mut cancel, &mut time, &mut limit];
            if let Some(verdict) = stops.into_iter().find_map(|stop| stop.check(&mut *method, &report)) {
                self.iterations += report.iteration;
                break verdict;
            }
        };
        self.solved += 1;
        // Asked for at the end: methods that make their point on demand have it then.
        self.residuals = method.residuals();
        self.energy = method.energy().value;
        let x = method.x().to_vec();
        if x.iter().any(|v| !v.is_finite()) {
            return Err(WavefrontError("the wavefront stopped being finite; give a larger --mu or --beta".to_string()));
        }
        self.judge(stage, verdict);
        Ok(x)
    }

    fn judge(&mut self, stage: Stage, verdict: Verdict) {
        let out_of_time = self.settings.time_limit.is_some_and(|t| self.began.elapsed().as_secs_f64() >= t);
        self.ended = verdict.status == Status::Cancelled || (verdict.status != Status::Converged && out_of_time);
        if self.ended || stage.level == 0 {
            // The first that has not converged says why.
            if self.verdict.as_ref().is_none_or(|v| v.status == Status::Converged) {
                self.verdict = Some(verdict);
            }
        } else if verdict.status != Status::Converged {
            let Stage { width, height, warp, .. } = stage;
            self.unconverged.push(format!("{width} x {height}, warp {warp}: {}", verdict.reason));
        }
    }

    fn status(&self) -> Status {
        self.verdict.as_ref().map_or(Status::Stopped, |v| v.status)
    }

    fn trace(&mut self, method: &mut dyn proxel_split::Method, report: &StepReport) {
        let Some(trace) = self.hooks.trace.as_deref_mut() else { return };
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        let mut row = row(method, report, seconds, f64::INFINITY);
        row.iteration += self.iterations;
        trace(&row);
        self.watching += now.elapsed();
    }

    fn report(&self, phi: &Image, status: Status) -> Report {
        let finite = |v: f64| Some(v).filter(|v| v.is_finite());
        let mut of = WavefrontReport { levels: self.levels, problems: self.solved, ..WavefrontReport::default() };
        measure(&mut of, phi, self.settings.scale);
        let warnings = self.unconverged.iter().map(|text| format!("a coarser level has not converged: {text}"));
        Report {
            version: env!("CARGO_PKG_VERSION").to_string(),
            command: "wavefront".to_string(),
            settings: serde_json::to_value(self.settings).unwrap_or_default(),
            method: match self.settings.method {
                WavefrontMethod::Auto => WavefrontMethod::Relaxed,
                method => method,
            }
            .as_str()
            .to_string(),
            status: status.as_str().to_string(),
            reason: self.verdict.as_ref().map(|v| v.reason.clone()).unwrap_or_default(),
            iterations: self.iterations,
            inner_iterations: self.inner,
            energy: finite(self.energy),
            primal_residual: finite(self.residuals.primal),
            dual_residual: finite(self.residuals.dual),
            accepted: self.iterations,
            rejected: self.rejected,
            warnings: warnings.collect(),
            wavefront: Some(of),
            ..Report::default()
        }
    }
}
