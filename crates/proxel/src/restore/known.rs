//! What is known of an image before it is restored: the model, and what of it was left to be found.

use super::{Input, RestoreError};
use crate::settings::{BoundaryName, DataName, RegulariserName, RestoreSettings, VariationName};
use proxel_imaging::restore::{Data, Edges, Model, Regulariser, Risk, RiskSettings};
use proxel_imaging::restore::{choose_lambda, count_level, estimate_risk, noise_level};
use proxel_imaging::{Image, Norm};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What is said of the model when it is made.
pub(super) struct Known {
    pub(super) model: Model,
    pub(super) noise: Option<f64>,
    pub(super) tried: usize,
    pub(super) warnings: Vec<String>,
}

/// Of the noise's standard deviation: where normal noise has no outliers, Huber's estimate has 95 % of the efficiency of the
/// mean.
const TUNING: f64 = 1.345;

/// The lambda of local cosines over that of total variation, about: 1.1 to 1.6 on photographs under three blurs.
const COSINES: f64 = 1.5;

/// Where the first estimate of local cosines is above this part of that of total variation, no other lambda makes good for it.
const HOPELESS: f64 = 1.1;

/// # Errors
/// As [`super::restore`].
pub(super) fn known(
    input: &Input<'_>,
    settings: &RestoreSettings,
    cancel: &AtomicBool,
    began: Instant,
) -> Result<Known, RestoreError> {
    let mut model = model(input, settings);
    let (mut noise, mut tried) = (settings.noise, 0);
    if settings.data == DataName::Huber {
        noise = noise.or_else(|| noise_level(model.width, model.height, &model.channels));
        let found = settings.threshold.or(noise.map(|noise| TUNING * noise)).filter(|delta| *delta > 0.0);
        let none = "no noise was found in the image by which huber could tell large differences; give --threshold";
        model.data = Data::Huber { delta: found.ok_or_else(|| RestoreError(none.to_string()))? };
    }
    model.check()?;
    check_truth(input, &model)?;
    let mut warnings = Vec::new();
    if settings.lambda.is_none() {
        if noise.is_none() {
            let estimate = if model.data == Data::Poisson { count_level } else { noise_level };
            noise = estimate(model.width, model.height, &model.channels);
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
        tried += risks.len().saturating_sub(1);
        model.lambda = risks.last().map_or(model.lambda, |risk| risk.lambda);
        if let Some(other) = other(settings, &model).filter(|_| !late()) {
            // At the vertex, where the search has only been about it.
            let here = estimate_risk(&model, level, &RiskSettings::default())?;
            let first = Some(COSINES * model.lambda);
            let search = RiskSettings { first, most: HOPELESS * here.value, ..RiskSettings::default() };
            let risks = choose_lambda(&other, level, &search, &mut late)?;
            tried += risks.len();
            if let Some(&Risk { lambda, .. }) = risks.last().filter(|risk| risk.value < here.value) {
                model = Model { lambda, ..other };
            }
        }
        if late() {
            warnings.push("time was up before the least risk was bracketed: lambda is the best so far".to_string());
        }
    }
    Ok(Known { model, noise, tried, warnings })
}

/// The model as far as settings say it; data that are Huber's are put in by the caller.
fn model(input: &Input<'_>, settings: &RestoreSettings) -> Model {
    let blurs = input.psf.weights.len() > 1 || settings.scale > 1;
    let wraps = matches!(settings.regulariser, RegulariserName::Tgv | RegulariserName::Frame);
    let edges = match settings.boundary {
        BoundaryName::Periodic => Edges::Periodic,
        BoundaryName::Neumann => Edges::Neumann,
        BoundaryName::Auto | BoundaryName::Unknown if blurs || wraps => Edges::Unknown,
        // Nothing beyond the border counts, and a mirroring one says so without a larger field.
        BoundaryName::Auto | BoundaryName::Unknown => Edges::Neumann,
    };
    let mut model = Model::new(input.image, input.psf.clone(), edges, settings.lambda.unwrap_or(1.0));
    model.scale = settings.scale;
    model.regulariser = match settings.regulariser {
        RegulariserName::Auto | RegulariserName::Tv => Regulariser::Tv,
        RegulariserName::Tgv => Regulariser::Tgv { ratio: settings.tgv_ratio },
        RegulariserName::Frame => Regulariser::Frame,
    };
    model.norm = match settings.variation {
        VariationName::Vectorial => Norm::Vectorial,
        VariationName::Channels => Norm::Channels,
        VariationName::Anisotropic => Norm::Differences,
    };
    model.data = if settings.data == DataName::Poisson { Data::Poisson } else { Data::Squares };
    model.mask = input.mask.map(|mask| mask.iter().map(|m| f64::from(u8::from(*m > 0.0))).collect());
    model.range = settings.range;
    model.penalty = settings.penalty;
    model
}

/// What the model is compared with by its risk: local cosines, where all is left to us and a blur may have taken fine
/// texture.
fn other(settings: &RestoreSettings, model: &Model) -> Option<Model> {
    let blurs = model.psf.weights.len() > 1 && model.scale == 1;
    let free = settings.regulariser == RegulariserName::Auto && settings.variation != VariationName::Anisotropic;
    let takes = free && blurs && model.data == Data::Squares && model.edges != Edges::Neumann;
    takes.then(|| Model { regulariser: Regulariser::Frame, ..model.clone() })
}

fn check_truth(input: &Input<'_>, model: &Model) -> Result<(), RestoreError> {
    let Some(truth) = input.truth else { return Ok(()) };
    let size = |image: &Image| (image.width, image.height, image.channels.len());
    let (w, h, c) = size(input.image);
    let (w, h) = (w * model.scale, h * model.scale);
    let (tw, th, tc) = size(truth);
    if (tw, th, tc) == (w, h, c) {
        return Ok(());
    }
    Err(RestoreError(format!("the truth is {tw} x {th} of {tc} channels, the result {w} x {h} of {c}")))
}
