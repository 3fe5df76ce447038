//! Images out of blurred, noisy and incomplete ones: total variation, A(31), with [`proxel_imaging::restore`] as its parts.
//!
//! ```
//! use proxel::imaging::{Image, Psf};
//! use proxel::restore::{Hooks, Input, restore};
//! use proxel::settings::RestoreSettings;
//!
//! let step = |k: usize| if k % 32 < 16 { 0.2 } else { 0.8 };
//! let noisy = (0..1024).map(|k| step(k) + 0.05 * ((k * k * 7919 % 1013) as f64 / 506.5 - 1.0)).collect();
//! let seen = Input { command: "denoise", image: &Image::new(32, 32, vec![noisy])?, psf: Psf::identity(), mask: None, truth: None };
//! let settings = RestoreSettings { lambda: Some(8.0), ..RestoreSettings::default() };
//! let found = restore(&seen, &settings, &mut Hooks::default())?;
//! assert!((0..1024).all(|k| (found.image.channels[0][k] - step(k)).abs() < 0.05));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod preview;
mod watch;

use crate::deform::TimeLimit;
use crate::report::{Report, RestoreReport, Seconds};
use crate::settings::{BoundaryName, DataName, RegulariserName, RestoreMethod, RestoreSettings, VariationName};
use crate::threads;
use proxel_imaging::restore::{
    Data, Edges, Iteration, Model, Regulariser, RiskSettings, choose_lambda, noise_level, psnr,
};
use proxel_imaging::{Image, ImageError, Norm, Psf};
use proxel_split::{Cancel, IterationLimit, ResidualTolerance, Status, Stop, SystemError, run};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use watch::{GapTolerance, Watcher};

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

/// What is said of the model when it is made.
struct Known {
    model: Model,
    noise: Option<f64>,
    tried: usize,
    warnings: Vec<String>,
}

/// Of the noise's standard deviation: where normal noise has no outliers, Huber's estimate has 95 % of the efficiency of the
/// mean.
const TUNING: f64 = 1.345;

fn known(
    input: &Input<'_>,
    settings: &RestoreSettings,
    cancel: &AtomicBool,
    began: Instant,
) -> Result<Known, RestoreError> {
    let blurs = input.psf.weights.len() > 1 || settings.scale > 1;
    let bends = settings.regulariser == RegulariserName::Tgv;
    let edges = match settings.boundary {
        BoundaryName::Periodic => Edges::Periodic,
        BoundaryName::Neumann => Edges::Neumann,
        BoundaryName::Auto | BoundaryName::Unknown if blurs || bends => Edges::Unknown,
        // Nothing beyond the border counts, and a mirroring one says so without a larger field.
        BoundaryName::Auto | BoundaryName::Unknown => Edges::Neumann,
    };
    let mut model = Model::new(input.image, input.psf.clone(), edges, settings.lambda.unwrap_or(1.0));
    model.scale = settings.scale;
    if bends {
        model.regulariser = Regulariser::Tgv { ratio: settings.tgv_ratio };
    }
    model.norm = match settings.variation {
        VariationName::Vectorial => Norm::Vectorial,
        VariationName::Channels => Norm::Channels,
        VariationName::Anisotropic => Norm::Differences,
    };
    model.mask = input.mask.map(|mask| mask.iter().map(|m| f64::from(u8::from(*m > 0.0))).collect());
    model.range = settings.range;
    model.penalty = settings.penalty;
    let (mut noise, mut tried) = (settings.noise, 0);
    model.data = match settings.data {
        DataName::Quadratic => Data::Squares,
        DataName::Poisson => Data::Poisson,
        DataName::Huber => {
            noise = noise.or_else(|| noise_level(model.width, model.height, &model.channels));
            let found = settings.threshold.or(noise.map(|noise| TUNING * noise)).filter(|delta| *delta > 0.0);
            let none = "no noise was found in the image by which huber could tell large differences; give --threshold";
            Data::Huber { delta: found.ok_or_else(|| RestoreError(none.to_string()))? }
        }
    };
    model.check()?;
    if let Some(truth) = input.truth {
        let size = |image: &Image| (image.width, image.height, image.channels.len());
        let (w, h, c) = size(input.image);
        let (w, h) = (w * model.scale, h * model.scale);
        let (tw, th, tc) = size(truth);
        if (tw, th, tc) != (w, h, c) {
            let text = format!("the truth is {tw} x {th} of {tc} channels, the result {w} x {h} of {c}");
            return Err(RestoreError(text));
        }
    }
    let mut warnings = Vec::new();
    if settings.lambda.is_none() {
        if noise.is_none() {
            noise = noise_level(model.width, model.height, &model.channels);
        }
        let level =
            noise.ok_or_else(|| RestoreError("the image is too small to estimate its noise; give --lambda".into()))?;
        if level <= 0.0 {
            let text = "no noise was found in the image, so that lambda has no measure; give --noise or --lambda";
            return Err(RestoreError(text.to_string()));
        }
        // Half of the time is the solver's.
        let limit = settings.time_limit.map(|s| Duration::from_secs_f64(s / 2.0));
        let mut late = || cancel.load(Ordering::Relaxed) || limit.is_some_and(|limit| began.elapsed() > limit);
        let risks = choose_lambda(&model, level, &RiskSettings::default(), &mut late)?;
        tried = risks.len().saturating_sub(1);
        if let Some(risk) = risks.last() {
            model.lambda = risk.lambda;
        }
        if late() {
            warnings.push("time was up before the least risk was bracketed: lambda is the best so far".to_string());
        }
    }
    Ok(Known { model, noise, tried, warnings })
}

fn solve(
    input: &Input<'_>,
    settings: &RestoreSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Restored, RestoreError> {
    let Known { model, noise, tried, warnings } = known(input, settings, &hooks.cancel, began)?;
    let built = model.build(None)?;
    let field = built.field.clone();
    let (relaxation, window) = (settings.relaxation, settings.anderson);
    let iteration = match settings.method {
        RestoreMethod::Auto | RestoreMethod::Relaxed => Iteration::Admm { relaxation },
        RestoreMethod::Admm => Iteration::Admm { relaxation: 1.0 },
        RestoreMethod::Fast => Iteration::Fast,
        RestoreMethod::Aa => Iteration::Anderson { window, both: false, relaxation },
        RestoreMethod::AaZu => Iteration::Anderson { window, both: true, relaxation: 1.0 },
    };
    let method = match settings.method {
        RestoreMethod::Auto => RestoreMethod::Relaxed,
        method => method,
    };
    let mut iterated = built.method(method.as_str(), iteration)?;
    let setup = began.elapsed().as_secs_f64();
    let mut gap = GapTolerance::new(settings.tol, &field);
    let mut residuals = ResidualTolerance::new(settings.tol);
    let mut cancel = Cancel(hooks.cancel.clone());
    let mut time = TimeLimit::new(began, settings.time_limit);
    let mut limit = IterationLimit(settings.max_iters);
    let hard = model.range.is_some() || model.data == Data::Poisson;
    let converged: &mut dyn Stop = if hard { &mut residuals } else { &mut gap };
    let mut stops: Vec<&mut dyn Stop> = vec![converged, &mut cancel, &mut time, &mut limit];
    let mut watcher = Watcher::new(hooks, began, &field, input.truth);
    let outcome = run(iterated.as_mut(), &mut stops, &mut watcher);
    let last = outcome.is_last && outcome.iterations > 0;
    let end = if last { gap.at(outcome.iterations, iterated.as_mut()) } else { None };
    let measured = iterated.residuals();
    let channels = field.image(&outcome.x);
    let image = Image::new(field.size.0, field.size.1, channels)?;
    let finite = |v: f64| Some(v).filter(|v| v.is_finite());
    let of = RestoreReport {
        boundary: match model.edges {
            Edges::Periodic => BoundaryName::Periodic,
            Edges::Neumann => BoundaryName::Neumann,
            Edges::Unknown => BoundaryName::Unknown,
        }
        .as_str()
        .to_string(),
        data: settings.data.as_str().to_string(),
        threshold: if let Data::Huber { delta } = model.data { Some(delta) } else { None },
        scale: model.scale,
        regulariser: settings.regulariser.as_str().to_string(),
        lambda: model.lambda,
        lambdas_tried: tried,
        noise,
        penalty: model.penalties().0,
        field: [field.grid.width, field.grid.height],
        duality_gap: end.map(|gap| gap.gap),
        relative_gap: end.map(|gap| gap.relative()),
        gap_range: end.and_then(|gap| gap.range),
        psnr: input.truth.and_then(|truth| finite(psnr(&image.channels, &truth.channels))),
        psnr_input: input
            .truth
            .filter(|_| model.scale == 1)
            .and_then(|truth| finite(psnr(&input.image.channels, &truth.channels))),
    };
    let report = Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: input.command.to_string(),
        settings: serde_json::to_value(settings).unwrap_or_default(),
        method: method.as_str().to_string(),
        status: outcome.status.as_str().to_string(),
        reason: outcome.reason,
        iterations: outcome.iterations,
        inner_iterations: outcome.inner_iterations,
        energy: finite(outcome.energy.value),
        primal_residual: finite(measured.primal),
        dual_residual: finite(measured.dual),
        accepted: outcome.accepted,
        rejected: outcome.rejected,
        warnings,
        seconds: Seconds { setup, solve: began.elapsed().as_secs_f64() - setup, ..Seconds::default() },
        restore: Some(of),
        ..Report::default()
    };
    Ok(Restored { image, status: outcome.status, report })
}
