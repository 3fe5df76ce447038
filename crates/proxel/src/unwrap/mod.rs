//! Maps of surfaces into the plane, of least distortion.
//!
//! [`unwrap`] does it in one call: any mesh is cut to charts ([`proxel_mesh::charts`]), each chart is mapped from a
//! circle to the minimum of its energy, and the charts are packed. An [`Unwrapper`] does it step by step, and goes on from
//! where it is after its pins or seams were changed.

mod adjoint;
mod assemble;
mod bijective;
mod certified;
mod chart;
mod flat;
mod live;
mod metric;
mod order;
mod pictures;
mod pins;
mod problem;
mod scaffold;
mod start;
mod stretch;
mod watch;

pub use adjoint::{MapAdjoint, adjoint};
pub use flat::Flat;
pub use live::{Standing, Unwrapper};
pub use metric::{Metric, uniform};
pub use pictures::MapPictures;
pub use start::{Start, Weights, start};
pub use watch::{Hooks, MapRow, Progress};

use crate::report::{MapReport, Report, Seconds};
use crate::settings::UnwrapSettings;
use crate::threads;
use assemble::Laid;
use chart::{ChartInput, ChartMap};
use proxel_mesh::charts::{ChartOptions, Charts, charts};
use proxel_mesh::uv::UvMap;
use proxel_mesh::{Mesh, MeshError};
use proxel_split::Status;
use rayon::prelude::*;
use std::time::Instant;

/// Charts of fewer triangles are solved side by side; larger ones have all threads to themselves.
const SMALL: usize = 10_000;

/// What is to be mapped, and how.
#[derive(Clone, Debug, Default)]
pub struct UnwrapInput {
    /// The surface: its faces.
    pub mesh: Mesh,
    /// Edges along which it is cut, besides what has to be.
    pub seams: Vec<[u32; 2]>,
    /// The map to begin with.
    pub start: Option<UvMap>,
    /// Vertices and where they are held, in units of length of the mesh. Charts with pins are not moved or scaled afterwards.
    pub pins: Vec<(u32, [f64; 2])>,
    /// A positive weight for each face: how much its distortion counts.
    pub weights: Option<Vec<f64>>,
    /// A target metric for each face: the lengths that its edges are to have in the map. Energies are measured against it.
    pub metric: Option<Vec<Metric>>,
}

/// Why a map cannot be computed: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnwrapError(pub String);

impl std::fmt::Display for UnwrapError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UnwrapError {}

impl From<MeshError> for UnwrapError {
    fn from(e: MeshError) -> Self {
        UnwrapError(e.to_string())
    }
}

/// A map, and how it came about.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// The map of the faces of the mesh.
    pub uv: UvMap,
    /// How the worst of the charts ended.
    pub status: Status,
    /// All figures but the certificate's; `seconds.read`, `seconds.write` and `peak_bytes` are the caller's to fill.
    pub report: Report,
    /// The trace, where one was asked for: row k has the sums over all charts after k iterations of each.
    pub rows: Vec<MapRow>,
    /// The charts.
    pub charts: Charts,
}

/// Maps the faces of a mesh to the plane, and says how it went. A run that does not converge is no error: see
/// [`Unwrapped::status`].
///
/// # Errors
/// Input that cannot be mapped at all: no faces, coordinates that are not finite, indices out of range, seams that are no
/// edges, a method that cannot begin.
pub fn unwrap(input: &UnwrapInput, settings: &UnwrapSettings, hooks: &mut Hooks<'_>) -> Result<Unwrapped, UnwrapError> {
    let began = Instant::now();
    settings.check().map_err(UnwrapError)?;
    let pool = pool(settings)?;
    let threads = pool.current_num_threads();
    pool.install(|| unwrap_here(input, settings, hooks, threads, began))
}

/// The threads that settings ask for.
fn pool(settings: &UnwrapSettings) -> Result<rayon::ThreadPool, UnwrapError> {
    Ok(threads::pool(settings.threads).map_err(UnwrapError)?.0)
}

/// The charts of a mesh that can be mapped.
fn cut(input: &UnwrapInput) -> Result<Charts, UnwrapError> {
    let mesh = &input.mesh;
    mesh.check_indices()?;
    if let Some(weights) = &input.weights {
        pins::check_weights(mesh, weights)?;
    }
    if let Some(metric) = &input.metric {
        metric::check(mesh, metric)?;
    }
    let charts = charts(mesh, &ChartOptions { seams: input.seams.clone(), ..ChartOptions::default() })?;
    if charts.charts.is_empty() {
        return Err(UnwrapError(format!("{}: no face has any area to be mapped; give a mesh with faces", mesh.name)));
    }
    Ok(charts)
}

fn unwrap_here(
    input: &UnwrapInput,
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    threads: usize,
    began: Instant,
) -> Result<Unwrapped, UnwrapError> {
    let mesh = &input.mesh;
    if settings.bijective && !input.pins.is_empty() {
        let reason =
            "a map without overlaps begins at a circle, where pins cannot be kept; leave out --bijective or --pin";
        return Err(UnwrapError(format!("{}: {reason}", mesh.name)));
    }
    let mut charts = cut(input)?;
    let inputs = chart::inputs(input, &charts)?;
    let cutting = began.elapsed().as_secs_f64();
    let mut maps = solve_all(&inputs, settings, hooks, began)?;
    drop(inputs);
    let bounded = match settings.max_stretch {
        Some(bound) => stretch::bound(bound, input, &mut charts, &mut maps, settings, hooks, began)?,
        None => stretch::Bounded::default(),
    };
    let held = pins::pinned(input, &charts);
    let lay = |(map, held): (_, &bool)| -> Laid<'_> {
        let map: &ChartMap = map;
        Laid { uv: &map.uv, area: map.area, held: *held }
    };
    let laid: Vec<Laid<'_>> = maps.iter().zip(&held).map(lay).collect();
    let placed = assemble::place(mesh, &charts, &laid, settings)?;
    let rows = assemble::rows(&maps, cutting);
    let (status, reason) = verdict(&maps);
    let total: f64 = maps.iter().map(|m| m.area).sum();
    let mean = |of: &dyn Fn(&ChartMap) -> f64| maps.iter().map(|m| m.area * of(m)).sum::<f64>() / total;
    let energy_z = mean(&|m| m.energy_z);
    let gradient = maps.iter().map(|m| m.gradient_norm).fold(0.0, f64::max);
    let ratio = maps.iter().map(|m| m.gradient_norm / m.reference_gradient.max(f64::MIN_POSITIVE)).fold(0.0, f64::max);
    let sum = |of: &dyn Fn(&ChartMap) -> usize| maps.iter().map(of).sum::<usize>();
    let residual = |of: &dyn Fn(&ChartMap) -> f64| finite(maps.iter().map(of).fold(0.0, f64::max));
    let mut warnings = charts.warnings.clone();
    warnings.extend(placed.warnings);
    warnings.extend(bounded.warnings);
    let mut repaired = charts.repairs.clone();
    let degenerate = sum(&|m| m.degenerate);
    if degenerate > 0 {
        repaired.push(format!(
            "{}: {degenerate} triangles have no area; each got a small one in the map, and hardly counts in what is minimised",
            mesh.name
        ));
    }
    let report = Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: "unwrap".to_string(),
        settings: serde_json::to_value(settings).unwrap_or_default(),
        method: settings.method.as_str().to_string(),
        status: status.as_str().to_string(),
        reason,
        iterations: maps.iter().map(|m| m.outcome.iterations).max().unwrap_or(0),
        inner_iterations: sum(&|m| m.outcome.inner_iterations),
        refactorisations: sum(&|m| m.outcome.refactorisations),
        energy: finite(mean(&|m| m.energy)),
        gradient_norm: finite(gradient),
        gradient_ratio: finite(ratio),
        min_stretch: finite(maps.iter().map(|m| m.outcome.energy.min_stretch).fold(f64::INFINITY, f64::min)),
        max_stretch: finite(maps.iter().map(|m| m.outcome.energy.max_stretch).fold(f64::NEG_INFINITY, f64::max)),
        primal_residual: residual(&|m| m.residuals.primal),
        dual_residual: residual(&|m| m.residuals.dual),
        accepted: sum(&|m| m.outcome.accepted),
        rejected: sum(&|m| m.outcome.rejected),
        warnings,
        repaired,
        seconds: Seconds { setup: cutting, solve: began.elapsed().as_secs_f64() - cutting, ..Seconds::default() },
        factor_bytes: maps.iter().map(|m| m.factor_bytes).max(),
        threads,
        map: Some(MapReport {
            charts: charts.charts.len(),
            reversed_faces: charts.reversed_faces.len(),
            energy_z: finite(energy_z),
            energy_target: input.metric.as_ref().and_then(|_| finite(mean(&|m| m.energy))),
            density: placed.density,
            stretch_cuts: bounded.cuts,
            ..MapReport::default()
        }),
        ..Report::default()
    };
    Ok(Unwrapped { uv: placed.uv, status, report, rows, charts })
}

fn finite(v: f64) -> Option<f64> {
    v.is_finite().then_some(v)
}

/// The map of a chart, as the settings want it.
fn solve(
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<ChartMap, UnwrapError> {
    match settings.bijective {
        true => bijective::solve(input, settings, hooks, began),
        false => chart::solve(input, settings, hooks, began),
    }
}

/// Large charts one after another, then small ones side by side; the results do not depend on that.
fn solve_all(
    inputs: &[ChartInput<'_>],
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Vec<ChartMap>, UnwrapError> {
    let (traced, cancel) = (hooks.traced, hooks.cancel.clone());
    let is_small = |input: &ChartInput<'_>| input.chart.triangles.len() < SMALL && inputs.len() > 1;
    let mut maps: Vec<Option<Result<ChartMap, UnwrapError>>> = inputs.iter().map(|_| None).collect();
    for (map, input) in maps.iter_mut().zip(inputs).filter(|(_, input)| !is_small(input)) {
        *map = Some(solve(input, settings, hooks, began));
    }
    maps.par_iter_mut().zip(inputs).filter(|(_, input)| is_small(input)).for_each(|(map, input)| {
        let mut hooks = Hooks { progress: None, traced, cancel: cancel.clone() };
        *map = Some(solve(input, settings, &mut hooks, began));
    });
    maps.into_iter().flatten().collect()
}

/// The worst end of a chart, and its reason.
fn verdict(maps: &[ChartMap]) -> (Status, String) {
    let rank = |s: Status| match s {
        Status::Converged => 0,
        Status::Stopped => 1,
        Status::Failed => 2,
        Status::Cancelled => 3,
    };
    let worst = (0..maps.len()).rev().max_by_key(|c| rank(maps[*c].outcome.status));
    let Some(worst) = worst else { return (Status::Failed, "there is no chart".to_string()) };
    let outcome = &maps[worst].outcome;
    let reason = match maps.len() {
        1 => outcome.reason.clone(),
        n if outcome.status == Status::Converged => format!("all {n} charts; {worst} the last: {}", outcome.reason),
        n => {
            let others = maps.iter().filter(|m| m.outcome.status != Status::Converged).count();
            format!("{others} of {n} charts did not converge; chart {worst}: {}", outcome.reason)
        }
    };
    (outcome.status, reason)
}
