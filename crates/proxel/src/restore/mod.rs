//! Images out of blurred, noisy and incomplete ones: total variation, A(31), with [`proxel_imaging::restore`] as its parts.
//!
//! ```
//! use proxel::imaging::{Image, Psf};
//! use proxel::restore::{Hooks, Input, restore};
//! use proxel::settings::RestoreSettings;
//!
//! let step = |k: usize| if k % 32 < 16 { 0.2 } else { 0.8 };
//! let noisy = (0..1024).map(|k| step(k) + 0.05 * ((k * k * 7919 % 1013) as f64 / 506.5 - 1.0)).collect();
//! let image = Image::new(32, 32, vec![noisy])?;
//! let seen = Input { command: "denoise", image: &image, psf: Psf::identity(), mask: None, truth: None };
//! let settings = RestoreSettings { lambda: Some(8.0), ..RestoreSettings::default() };
//! let found = restore(&seen, &settings, &mut Hooks::default())?;
//! assert!((0..1024).all(|k| (found.image.channels[0][k] - step(k)).abs() < 0.05));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod known;
mod preview;
mod tiles;
mod watch;

use crate::deform::TimeLimit;
use crate::report::{Report, RestoreReport, Seconds};
use crate::settings::{BoundaryName, RegulariserName, RestoreMethod, RestoreSettings};
use crate::threads;
use known::{Known, known};
use proxel_imaging::restore::{Data, Edges, Gap, Iteration, Model, Regulariser, psnr};
use proxel_imaging::{Image, ImageError, Psf};
use proxel_split::{Cancel, IterationLimit, Outcome, ResidualTolerance, Residuals, Status, Stop, SystemError, run};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use watch::{GapTolerance, Part, Watcher};

pub use preview::draw_restored;
pub use watch::RestoreRow;

/// Why an image cannot be restored: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RestoreError(pub String);

impl std::fmt::Display for RestoreError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for RestoreError {}

impl From<ImageError> for RestoreError {
    fn from(e: ImageError) -> Self {
        RestoreError(e.0)
    }
}

impl From<SystemError> for RestoreError {
    fn from(e: SystemError) -> Self {
        RestoreError(e.to_string())
    }
}

/// What is known.
pub struct Input<'a> {
    /// The command, for the report: `deblur`, `denoise` or `inpaint`.
    pub command: &'a str,
    /// What was seen, linear.
    pub image: &'a Image,
    /// The blur; [`Psf::identity`] for none.
    pub psf: Psf,
    /// Positive where a pixel was measured, 0 where not; all were if there is none.
    pub mask: Option<&'a [f64]>,
    /// What is to be found, to measure against. It never changes a run.
    pub truth: Option<&'a Image>,
}

/// What the caller wants to hear and say while a run goes on.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called with iteration and objective.
    pub progress: Option<&'a mut (dyn FnMut(usize, f64) + Send)>,
    /// Called with every row of the trace.
    pub trace: Option<&'a mut (dyn FnMut(&RestoreRow) + Send)>,
    /// Set it to end the run with the best so far.
    pub cancel: Arc<AtomicBool>,
}

/// An image, and how it came about.
#[derive(Clone, Debug)]
pub struct Restored {
    /// Of the size of what was seen, times the scale of the settings.
    pub image: Image,
    /// How the run ended.
    pub status: Status,
    /// All figures; `seconds.read`, `seconds.write` and `peak_bytes` are the caller's to fill.
    pub report: Report,
}

/// The image of least objective.
///
/// Converged when the duality gap is below the tolerance times the objective; with a range of values, and for Poisson's data,
/// which are not negative, when the residuals are.
///
/// # Errors
/// Images of different sizes, an image of one value whose noise is to be estimated, a blur larger than the image, settings
/// that make no sense.
pub fn restore(input: &Input<'_>, settings: &RestoreSettings, hooks: &mut Hooks<'_>) -> Result<Restored, RestoreError> {
    let began = Instant::now();
    settings.check().map_err(RestoreError)?;
    let (pool, threads) = threads::pool(settings.threads).map_err(RestoreError)?;
    let mut restored = pool.install(|| solve(input, settings, hooks, began))?;
    restored.report.threads = threads;
    Ok(restored)
}

fn finite(v: f64) -> Option<f64> {
    Some(v).filter(|v| v.is_finite())
}

/// What became of one problem.
struct Run {
    /// How it ended; its fields are in `planes`.
    outcome: Outcome,
    planes: Vec<Vec<f64>>,
    gap: Option<Gap>,
    residuals: Residuals,
    field: [usize; 2],
    /// Seconds until the first iteration.
    setup: f64,
}

fn run_model(
    model: &Model,
    settings: &RestoreSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
    part: Part<'_>,
) -> Result<Run, RestoreError> {
    let built = model.build(None)?;
    let field = built.field.clone();
    let (relaxation, window) = (settings.relaxation, settings.anderson);
    let iteration = match settings.method {
        RestoreMethod::Auto | RestoreMethod::Relaxed => Iteration::Admm { relaxation },
        RestoreMethod::Admm => Iteration::Admm { relaxation: 1.0 },
        RestoreMethod::Fast => Iteration::Fast { both: false },
        RestoreMethod::Aa => Iteration::Anderson { window, both: false, relaxation },
        RestoreMethod::AaZu => Iteration::Anderson { window, both: true, relaxation: 1.0 },
    };
    let mut iterated = built.method(taken(settings.method).as_str(), iteration)?;
    let setup = began.elapsed().as_secs_f64();
    let mut gap = GapTolerance::new(settings.tol, settings.max_iters, &field);
    let mut residuals = ResidualTolerance::new(settings.tol);
    let mut cancel = Cancel(hooks.cancel.clone());
    let mut time = TimeLimit::new(began, settings.time_limit);
    let mut limit = IterationLimit(settings.max_iters);
    let hard = model.range.is_some() || model.data == Data::Poisson;
    let converged: &mut dyn Stop = if hard { &mut residuals } else { &mut gap };
    let mut stops: Vec<&mut dyn Stop> = vec![converged, &mut cancel, &mut time, &mut limit];
    let mut watcher = Watcher::new(hooks, began, &field, part);
    let mut outcome = run(iterated.as_mut(), &mut stops, &mut watcher);
    let last = outcome.is_last && outcome.iterations > 0;
    let gap = if last { gap.at(outcome.iterations, iterated.as_mut()) } else { None };
    let planes = field.image(&std::mem::take(&mut outcome.x));
    let residuals = iterated.residuals();
    Ok(Run { outcome, planes, gap, residuals, field: [field.grid.width, field.grid.height], setup })
}

/// What `auto` is.
fn taken(method: RestoreMethod) -> RestoreMethod {
    if method == RestoreMethod::Auto { RestoreMethod::Relaxed } else { method }
}

fn solve(
    input: &Input<'_>,
    settings: &RestoreSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Restored, RestoreError> {
    let Known { model, noise, tried, warnings } = known(input, settings, &hooks.cancel, began)?;
    let mut of = about(&model, settings, (noise, tried));
    let mut report = Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: input.command.to_string(),
        settings: serde_json::to_value(settings).unwrap_or_default(),
        method: taken(settings.method).as_str().to_string(),
        warnings,
        ..Report::default()
    };
    let (image, status, setup);
    if let Some(side) = tiles::side(&model, settings.tile) {
        setup = began.elapsed().as_secs_f64();
        let tiled = tiles::restore(input, model, settings, side, hooks, began)?;
        (image, status) = (tiled.image, tiled.status);
        (report.reason, report.iterations) = (tiled.reason, tiled.iterations);
        [report.accepted, report.rejected] = tiled.proposals;
        [report.primal_residual, report.dual_residual] = tiled.residuals;
        (of.field, of.tiles) = (tiled.field, tiled.parts);
        of.relative_gap = tiled.gap.map(|gap| gap.relative());
        of.gap_range = tiled.gap.and_then(|gap| gap.range);
    } else {
        let run = run_model(&model, settings, hooks, began, Part { index: 0, truth: input.truth })?;
        let outcome = run.outcome;
        image = Image::new(model.width * model.scale, model.height * model.scale, run.planes)?;
        (status, setup) = (outcome.status, run.setup);
        (report.reason, report.iterations, report.inner_iterations) =
            (outcome.reason, outcome.iterations, outcome.inner_iterations);
        (report.accepted, report.rejected, report.energy) =
            (outcome.accepted, outcome.rejected, finite(outcome.energy.value));
        (report.primal_residual, report.dual_residual) = (finite(run.residuals.primal), finite(run.residuals.dual));
        of.field = run.field;
        of.duality_gap = run.gap.map(|gap| gap.gap);
        of.relative_gap = run.gap.map(|gap| gap.relative());
        of.gap_range = run.gap.and_then(|gap| gap.range);
    }
    of.psnr = input.truth.and_then(|truth| finite(psnr(&image.channels, &truth.channels)));
    let same = input.truth.filter(|_| settings.scale == 1);
    of.psnr_input = same.and_then(|truth| finite(psnr(&input.image.channels, &truth.channels)));
    report.status = status.as_str().to_string();
    report.seconds = Seconds { setup, solve: began.elapsed().as_secs_f64() - setup, ..Seconds::default() };
    report.restore = Some(of);
    Ok(Restored { image, status, report })
}

/// What is known of a restoration before it runs.
fn about(model: &Model, settings: &RestoreSettings, (noise, tried): (Option<f64>, usize)) -> RestoreReport {
    let boundary = match model.edges {
        Edges::Periodic => BoundaryName::Periodic,
        Edges::Neumann => BoundaryName::Neumann,
        Edges::Unknown => BoundaryName::Unknown,
    };
    let regulariser = match model.regulariser {
        Regulariser::Tv => RegulariserName::Tv,
        Regulariser::Tgv { .. } => RegulariserName::Tgv,
        Regulariser::Frame => RegulariserName::Frame,
    };
    RestoreReport {
        boundary: boundary.as_str().to_string(),
        data: settings.data.as_str().to_string(),
        threshold: if let Data::Huber { delta } = model.data { Some(delta) } else { None },
        scale: model.scale,
        regulariser: regulariser.as_str().to_string(),
        objective: objective(model),
        lambda: model.lambda,
        lambdas_tried: tried,
        noise,
        penalty: model.penalties().0,
        ..RestoreReport::default()
    }
}

/// What is minimised, in words of ASCII; M leaves out what was not measured.
fn objective(model: &Model) -> String {
    let data = match model.data {
        Data::Squares => "|M (K x - f)|^2",
        Data::Poisson => "sum M (K x - f log(K x))",
        Data::Huber { .. } => "sum M huber(K x - f)",
    };
    let regulariser = match model.regulariser {
        Regulariser::Tv => "sum |grad x|",
        Regulariser::Tgv { .. } => "min over w of sum |grad x - w| + R |E w|",
        Regulariser::Frame => "sum over (k, l) other than (0, 0) of |W_kl x| / sqrt(k^2 + l^2)",
    };
    format!("lambda {data} + {regulariser}")
}
