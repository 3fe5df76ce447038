//! The map of one chart.

use super::flat::{Flat, best_scale, flips, symmetric_dirichlet};
use super::metric::{self, Stretch};
use super::order::{Order, middle};
use super::pins::similarity;
use super::problem::{MODULUS, Relaxed, local_energy, method, problem};
use super::start::{Start, start};
use super::watch::{TimeLimit, Watcher};
use super::{Hooks, MapRow, UnwrapError, UnwrapInput};
use crate::settings::UnwrapSettings;
use proxel_mesh::charts::{Chart, Charts};
use proxel_split::{
    Cancel, GradientTolerance, IterationLimit, Method, NoProgress, Outcome, Residuals, RoundingReached, Status, Stop,
};
use std::time::{Duration, Instant};

/// Steps that a method may refuse in a row.
const REFUSALS: usize = 5;

/// A chart with what is asked of its map.
pub(super) struct ChartInput<'a> {
    pub chart: &'a Chart,
    pub points: Vec<[f64; 3]>,        // of its vertices
    pub start: Option<Vec<[f64; 2]>>, // in any units
    pub pins: Vec<(u32, [f64; 2])>,   // in the user's units
    pub weights: Option<Vec<f64>>,    // of its triangles
    pub metric: Option<Vec<Stretch>>, // of its triangles
}

impl ChartInput<'_> {
    /// With the rest shapes of its triangles; none where it has no area.
    pub fn flat(&self) -> Option<Flat<'_>> {
        Flat::stretched(&self.points, &self.chart.triangles, &self.chart.loops, self.metric.as_deref())
    }
}

/// The charts of a mesh, and what of the input concerns each.
pub(super) fn inputs<'a>(input: &UnwrapInput, charts: &'a Charts) -> Result<Vec<ChartInput<'a>>, UnwrapError> {
    let mut pins: Vec<Option<[f64; 2]>> = vec![None; if input.pins.is_empty() { 0 } else { input.mesh.n_verts() }];
    for (v, target) in &input.pins {
        let Some(pin) = pins.get_mut(*v as usize) else {
            let n = input.mesh.n_verts();
            return Err(UnwrapError(format!("pin: vertex {v} (0-based) does not exist; there are {n}")));
        };
        if pin.is_some_and(|p| p != *target) {
            return Err(UnwrapError(format!("pin: vertex {v} (0-based) is held at two places; keep one of them")));
        }
        if target.iter().any(|t| !t.is_finite()) {
            return Err(UnwrapError(format!("pin: the place of vertex {v} (0-based) is not finite")));
        }
        *pin = Some(*target);
    }
    let mut starts: Vec<Option<Vec<[f64; 2]>>> = vec![None; charts.charts.len()];
    if let Some(map) = &input.start {
        map.check(&input.mesh.faces)?;
        starts = charts.charts.iter().map(|chart| Some(vec![[f64::NAN; 2]; chart.vertices.len()])).collect();
        for (corner, place) in charts.places.iter().enumerate() {
            if let (Some(place), Some(uv)) = (place, map.at(corner))
                && let Some(Some(start)) = starts.get_mut(place.chart as usize)
            {
                start[place.vertex as usize] = uv;
            }
        }
    }
    let of_chart = |(chart, start): (&'a Chart, Option<Vec<[f64; 2]>>)| ChartInput {
        chart,
        points: chart.vertices.iter().map(|v| input.mesh.points[*v as usize]).collect(),
        // A map that leaves a vertex out is no start.
        start: start.filter(|uv| uv.iter().flatten().all(|v| v.is_finite())),
        pins: (0..chart.vertices.len() as u32)
            .filter_map(|v| Some((v, (*pins.get(chart.vertices[v as usize] as usize)?)?)))
            .collect(),
        weights: input.weights.as_ref().map(|w| chart.faces.iter().map(|f| w[*f as usize]).collect()),
        metric: metric::of_faces(input, &chart.faces),
    };
    Ok(charts.charts.iter().zip(starts).map(of_chart).collect())
}

/// The map of a chart.
#[derive(Clone)]
pub(super) struct ChartMap {
    pub uv: Vec<[f64; 2]>, // in the user's units
    pub outcome: Outcome,
    pub energy: f64,   // normalised
    pub energy_z: f64, // of the local variable at the end
    pub gradient_norm: f64,
    pub reference_gradient: f64,
    pub residuals: Residuals,
    pub factor_bytes: u64,
    pub area: f64, // in the user's units
    pub rows: Vec<MapRow>,
    pub degenerate: usize,
}

/// A chart whose method is at its start.
pub(super) struct Prepared {
    pub order: Order,
    pub start: Start,
    pub method: Option<Box<dyn Method>>, // none where nothing is free, or after a failure
    pub failure: Option<String>,         // why there is no method: the start is then all there is
}

/// Makes the start and puts the method together.
pub(super) fn prepare(
    chart: &Flat<'_>,
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
) -> Result<Prepared, UnwrapError> {
    let start = begin(chart, input)?;
    if start.flips > 0 && !settings.method.takes_flips() {
        return Err(UnwrapError(format!(
            "the start of the map has {} flipped triangles, from which {} cannot begin; use --method auto or wrapd",
            start.flips,
            settings.method.as_str()
        )));
    }
    let mut fixed: Vec<u32> = input.pins.iter().map(|p| p.0).collect();
    if settings.fixed_boundary {
        fixed.extend(input.chart.loops.first().into_iter().flatten());
        fixed.sort_unstable();
        fixed.dedup();
    }
    if fixed.is_empty() {
        fixed.push(middle(&start.uv) as u32);
    }
    let order = Order::new(chart, &fixed);
    let problem = problem(chart, &order, &start, input, settings)?;
    if problem.n_free == 0 {
        return Ok(Prepared { order, start, method: None, failure: None });
    }
    let relaxed = || Relaxed::new(chart, &order, input, settings);
    // A map that was found before is near its minimum: nothing is left for the splitting to do.
    let is_near = start.weights.is_none() && start.flips == 0 && symmetric_dirichlet(chart, &start.uv) < NEAR;
    let made = method(problem, relaxed, is_near, settings);
    Ok(match made {
        Ok(method) => Prepared { order, start, method: Some(method), failure: None },
        Err(e) => Prepared { order, start, method: None, failure: Some(e.to_string()) },
    })
}

/// A given map of less energy than this is taken for one that was minimised before.
const NEAR: f64 = 4.0;

/// Minimises the energy of the map of a chart.
pub(super) fn solve(
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<ChartMap, UnwrapError> {
    let entered = Instant::now();
    let Some(chart) = &input.flat() else {
        return Ok(without_area(input));
    };
    let Prepared { order, start, method, failure } = prepare(chart, input, settings)?;
    let Some(mut method) = method else {
        let mut map = ChartMap { uv: in_units(chart, &start.uv, input), ..held(chart, &start.uv) };
        if let Some(failure) = failure {
            map.outcome.status = Status::Failed;
            map.outcome.reason = format!("{failure}; the map is the one that it would have begun from");
        }
        return Ok(map);
    };
    let mut tolerance = tolerance(&start, settings, method.as_mut());
    let reference_gradient = tolerance.reference();
    let mut limit = IterationLimit(settings.max_iters);
    let mut stuck = NoProgress::new(REFUSALS);
    let mut cancel = Cancel(hooks.cancel.clone());
    let mut time = TimeLimit::new(began, settings.time_limit);
    let mut watcher =
        Watcher { chart, settings, order: &order, hooks, began: entered, watching: Duration::ZERO, rows: Vec::new() };
    let mut rounding = RoundingReached;
    let mut stops: [&mut dyn Stop; 6] = [&mut tolerance, &mut rounding, &mut cancel, &mut time, &mut limit, &mut stuck];
    let outcome = proxel_split::run(method.as_mut(), &mut stops, &mut watcher);
    let rows = watcher.rows;
    let factor_bytes = method.factor_bytes();
    let residuals = method.residuals();
    let mut problem = method.into_problem();
    let mut grad = vec![0.0; 2 * problem.n_free];
    problem.energy(&outcome.x, Some(&mut grad));
    let gradient_norm = problem.gradient_norm(&mut grad);
    let mut flat = order.user(&outcome.x);
    if input.pins.is_empty() && !settings.fixed_boundary {
        turn_back(&mut flat, &start.uv);
        if outcome.status != Status::Converged && flips(chart.triangles, &flat) == 0 {
            let factor = best_scale(chart, &flat);
            flat.iter_mut().for_each(|p| *p = p.map(|v| v * factor));
        }
    }
    Ok(ChartMap {
        uv: in_units(chart, &flat, input),
        energy_z: local_energy(settings, outcome.last.energy_z),
        outcome,
        gradient_norm: gradient_norm / MODULUS,
        reference_gradient: reference_gradient / MODULUS,
        residuals,
        factor_bytes,
        rows,
        ..held(chart, &flat)
    })
}

/// When a chart has converged. A given map may be a minimum already, whose gradient is rounding: what is asked for then is
/// not less than rounding leaves.
pub(super) fn tolerance(start: &Start, settings: &UnwrapSettings, method: &mut dyn Method) -> GradientTolerance {
    let from_start = GradientTolerance::new(settings.tol, method);
    match start.weights {
        None => {
            let characteristic = method.problem().characteristic_gradient();
            GradientTolerance::against(settings.tol, from_start.reference(), GIVEN * characteristic)
        }
        Some(_) => from_start,
    }
}

/// How many times more rounding the gradient of a map that was read may have.
const GIVEN: f64 = 1e3;

/// Moves and turns a map such that it lies as the start lay: that costs nothing, and where the map has come to on its way
/// says nothing.
pub(super) fn turn_back(flat: &mut [[f64; 2]], start: &[[f64; 2]]) {
    let n = flat.len().max(1) as f64;
    let mean = |of: &[[f64; 2]]| [0, 1].map(|d| of.iter().map(|p| p[d]).sum::<f64>() / n);
    let (from, to) = (mean(flat), mean(start));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (p, q) in flat.iter().zip(start) {
        let (p, q) = ([p[0] - from[0], p[1] - from[1]], [q[0] - to[0], q[1] - to[1]]);
        dot += p[0] * q[0] + p[1] * q[1];
        cross += p[0] * q[1] - p[1] * q[0];
    }
    let size = dot.hypot(cross);
    if size > 0.0 && size.is_finite() {
        let (c, s) = (dot / size, cross / size);
        for p in flat {
            let q = [p[0] - from[0], p[1] - from[1]];
            *p = [to[0] + c * q[0] - s * q[1], to[1] + s * q[0] + c * q[1]];
        }
    }
}

/// In the user's units; pins exactly where they were put.
pub(super) fn in_units(chart: &Flat<'_>, flat: &[[f64; 2]], input: &ChartInput<'_>) -> Vec<[f64; 2]> {
    let unit = chart.scale.recip();
    let mut uv: Vec<[f64; 2]> = flat.iter().map(|p| p.map(|v| v * unit)).collect();
    for (v, target) in &input.pins {
        uv[*v as usize] = *target;
    }
    uv
}

/// A map that is as it is, with nothing to solve.
fn held(chart: &Flat<'_>, flat: &[[f64; 2]]) -> ChartMap {
    let unit = chart.scale.recip();
    ChartMap {
        energy: symmetric_dirichlet(chart, flat),
        area: unit * unit,
        ..unsolved("nothing of the map is free", chart.degenerate.len())
    }
}

/// A chart whose triangles all lack an area goes to the circle, as small as it is.
fn without_area(input: &ChartInput<'_>) -> ChartMap {
    let outer = input.chart.loops.first().map_or(&[][..], |l| l);
    let mut uv = vec![[0.0; 2]; input.points.len()];
    for (k, v) in outer.iter().enumerate() {
        let angle = 2.0 * std::f64::consts::PI * k as f64 / outer.len() as f64;
        uv[*v as usize] = [angle.cos(), angle.sin()];
    }
    ChartMap { uv, ..unsolved("a chart without area has no best map", input.chart.triangles.len()) }
}

/// No map yet, and nothing to be done about it.
fn unsolved(reason: &str, degenerate: usize) -> ChartMap {
    ChartMap {
        uv: Vec::new(),
        outcome: finished(reason),
        energy: 1.0,
        energy_z: f64::INFINITY,
        gradient_norm: 0.0,
        reference_gradient: 1.0,
        residuals: Residuals { primal: 0.0, dual: 0.0 },
        factor_bytes: 0,
        area: 0.0,
        rows: Vec::new(),
        degenerate,
    }
}

fn finished(reason: &str) -> Outcome {
    Outcome {
        status: Status::Converged,
        reason: reason.to_string(),
        iterations: 0,
        inner_iterations: 0,
        refactorisations: 0,
        accepted: 0,
        rejected: 0,
        missed: 0,
        x: Vec::new(),
        energy: Default::default(),
        is_last: true,
        last: Default::default(),
    }
}

/// The given map in the scale that suits the chart best, or one from the circle; where pins hold it, turned to them.
fn begin(chart: &Flat<'_>, input: &ChartInput<'_>) -> Result<Start, UnwrapError> {
    let mut start = match &input.start {
        Some(uv) => {
            let factor = best_scale(chart, uv);
            let uv: Vec<[f64; 2]> = uv.iter().map(|p| p.map(|v| v * factor)).collect();
            Start { flips: flips(chart.triangles, &uv), uv, weights: None }
        }
        None => start(chart)?,
    };
    if !input.pins.is_empty() {
        let targets: Vec<[f64; 2]> = input.pins.iter().map(|(_, t)| t.map(|v| v * chart.scale)).collect();
        let points: Vec<[f64; 2]> = input.pins.iter().map(|(v, _)| start.uv[*v as usize]).collect();
        if let Some(([a, b], offset)) = similarity(&points, &targets) {
            for p in &mut start.uv {
                *p = [a * p[0] - b * p[1] + offset[0], b * p[0] + a * p[1] + offset[1]];
            }
        }
        for ((v, _), target) in input.pins.iter().zip(&targets) {
            start.uv[*v as usize] = *target;
        }
        start.flips = flips(chart.triangles, &start.uv);
    }
    Ok(start)
}
