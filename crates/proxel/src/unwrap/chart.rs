//! The map of one chart.

use super::flat::{Flat, flips, symmetric_dirichlet};
use super::start::{Start, start};
use super::{Hooks, MapRow, UnwrapError};
use crate::settings::{UnwrapMethod, UnwrapSettings};
use proxel_model::elements::{Batch, BatchShape, BatchWeights, Flattened, batch, morton};
use proxel_model::energy::Lame;
use proxel_split::{
    Admm, AdmmSettings, Auto, Cancel, Direct, GlobalStep, GradientTolerance, IterationLimit, Lbfgs, Method, Newton,
    NoProgress, Observer, Outcome, Problem, Quadratic, QuasiNewton, StepReport, Stop, SystemError,
};
use std::time::{Duration, Instant};

/// Steps that a method may refuse in a row.
const REFUSALS: usize = 5;

/// A chart and its map.
pub(super) struct ChartMap {
    pub uv: Vec<[f64; 2]>, // in the user's units
    pub outcome: Outcome,
    pub start: Start,
    pub energy: f64,   // normalised
    pub energy_z: f64, // of the local variable at the end
    pub gradient_norm: f64,
    pub reference_gradient: f64,
    pub factor_bytes: u64,
    pub area: f64, // in the user's units
    pub rows: Vec<MapRow>,
    pub setup: f64,
    pub solve: f64,
    pub degenerate: usize,
}

/// Weights, moduli: symmetric Dirichlet with the stiffness 8 at rest, s^2 + s^-2 - 2 for each stretch, is that of mu = 4.
const MODULUS: f64 = 4.0;

/// Vertices of a chart as the solver has them: the pinned one last, others along a space-filling curve.
struct Order {
    number: Vec<u32>, // of each vertex
}

impl Order {
    fn new(chart: &Flat<'_>, pinned: usize) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in chart.points {
            for d in 0..3 {
                (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
            }
        }
        let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        let mut keyed: Vec<(bool, u64, u32)> =
            (0..chart.points.len()).map(|v| (v == pinned, morton(chart.points[v], low, size), v as u32)).collect();
        keyed.sort_unstable();
        let mut number = vec![0; keyed.len()];
        for (place, (_, _, v)) in keyed.iter().enumerate() {
            number[*v as usize] = place as u32;
        }
        Order { number }
    }

    fn solver(&self, uv: &[[f64; 2]]) -> Vec<f64> {
        let mut x = vec![0.0; 2 * uv.len()];
        for (uv, at) in uv.iter().zip(&self.number) {
            x[2 * *at as usize..][..2].copy_from_slice(uv);
        }
        x
    }

    fn user(&self, x: &[f64]) -> Vec<[f64; 2]> {
        self.number.iter().map(|at| [x[2 * *at as usize], x[2 * *at as usize + 1]]).collect()
    }
}

/// The vertex nearest to the middle of the map's bounding box: what is held, since a map can be anywhere.
fn middle(uv: &[[f64; 2]]) -> usize {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in uv {
        for d in 0..2 {
            (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
        }
    }
    let distance = |p: &[f64; 2]| (0..2).map(|d| (p[d] - 0.5 * (low[d] + high[d])).powi(2)).sum::<f64>();
    (0..uv.len()).min_by(|a, b| distance(&uv[*a]).total_cmp(&distance(&uv[*b]))).unwrap_or(0)
}

/// Minimises the energy of the map of a chart.
pub(super) fn solve(
    chart: &Flat<'_>,
    given: Option<Vec<[f64; 2]>>,
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<ChartMap, UnwrapError> {
    let entered = Instant::now();
    let start = match given {
        Some(uv) => Start { flips: flips(chart.triangles, &uv), uv, weights: super::start::Weights::Cotangent },
        None => start(chart)?,
    };
    if start.flips > 0 && !settings.method.takes_flips() {
        return Err(UnwrapError(format!(
            "the start of the map has {} flipped triangles, from which {} cannot begin; use --method auto or wrapd",
            start.flips,
            settings.method.as_str()
        )));
    }
    let order = Order::new(chart, middle(&start.uv));
    let problem = problem(chart, &order, &start, settings)?;
    let mut method = method(problem, settings).map_err(|e| UnwrapError(e.to_string()))?;
    let mut tolerance = GradientTolerance::new(settings.tol, method.as_mut());
    let reference_gradient = tolerance.reference();
    let setup = entered.elapsed().as_secs_f64();
    let mut limit = IterationLimit(settings.max_iters);
    let mut stuck = NoProgress::new(REFUSALS);
    let mut cancel = Cancel(hooks.cancel.clone());
    let mut time = super::watch::TimeLimit::new(began, settings.time_limit);
    let mut watcher = Watcher { chart, order: &order, hooks, began: entered, watching: Duration::ZERO, rows: Vec::new() };
    let mut stops: [&mut dyn Stop; 5] = [&mut tolerance, &mut cancel, &mut time, &mut limit, &mut stuck];
    let outcome = proxel_split::run(method.as_mut(), &mut stops, &mut watcher);
    let rows = watcher.rows;
    let factor_bytes = method.factor_bytes();
    let mut problem = method.into_problem();
    let mut grad = vec![0.0; 2 * problem.n_free];
    problem.energy(&outcome.x, Some(&mut grad));
    let gradient_norm = problem.gradient_norm(&mut grad);
    let flat = order.user(&outcome.x);
    let energy = symmetric_dirichlet(chart, &flat);
    let unit = chart.scale.recip();
    Ok(ChartMap {
        energy,
        energy_z: 1.0 + outcome.last.energy_z / MODULUS,
        uv: flat.iter().map(|p| p.map(|v| v * unit)).collect(),
        outcome,
        start,
        gradient_norm,
        reference_gradient,
        factor_bytes,
        area: unit * unit,
        rows,
        setup,
        solve: entered.elapsed().as_secs_f64() - setup,
        degenerate: chart.degenerate.len(),
    })
}

fn problem(
    chart: &Flat<'_>,
    order: &Order,
    start: &Start,
    settings: &UnwrapSettings,
) -> Result<Problem, UnwrapError> {
    let lame = Lame::new(MODULUS, 0.0).map_err(|e| UnwrapError(e.to_string()))?;
    let elements: Vec<u32> = chart.triangles.iter().flatten().map(|v| order.number[*v as usize]).collect();
    let centers: Vec<[f64; 3]> =
        chart.triangles.iter().map(|t| [0, 1, 2].map(|d| t.map(|v| chart.points[v as usize][d] / 3.0).iter().sum())).collect();
    let scale = settings.admm.weight_scale;
    let (term, barrier) = batch(&Batch {
        shape: BatchShape::PlanarTriangles,
        positions: &[],
        flattened: Some(Flattened { shapes: &chart.shapes, centers: &centers, n_nodes: chart.points.len() }),
        elements: &elements,
        fill: None,
        energy: &settings.energy,
        lame: &lame,
        limits: None,
        rotation_aware: settings.method.is_rotation_aware(),
        singular_values: settings.admm.singular_values,
        weights: &|stiffness| BatchWeights { base: scale * stiffness.largest, softening: 1.0 },
    })
    .map_err(|e| UnwrapError(e.to_string()))?;
    Ok(Problem {
        dim: 2,
        n_free: chart.points.len() - 1,
        x0: order.solver(&start.uv),
        terms: vec![term],
        quadratic: Quadratic::default(),
        barrier,
    })
}

/// Puts the method together: parts, no special cases.
fn method(problem: Problem, settings: &UnwrapSettings) -> Result<Box<dyn Method>, SystemError> {
    use UnwrapMethod::{Akvf, Auto as AutoName, Bcqn, Cm, Newton as NewtonName, ProjectedNewton, Slim, WrapdCm};
    let name = settings.method;
    Ok(match name {
        Cm | Slim | Akvf | ProjectedNewton | NewtonName => Box::new(Newton::new(problem, settings.newton())?),
        Bcqn => Box::new(QuasiNewton::new(problem, settings.bcqn.to_method(name.as_str(), true))?),
        _ => {
            let global: Box<dyn GlobalStep> = match name.is_rotation_aware() {
                true => Box::new(Lbfgs::new(settings.admm.lbfgs())),
                false => Box::new(Direct),
            };
            let admm = Admm::new(
                problem,
                AdmmSettings {
                    name: name.as_str().to_string(),
                    global,
                    reweighting: name.is_reweighted().then(|| settings.admm.reweighting()),
                    renewed_at: settings.admm.renewed_at,
                },
            )?;
            match name {
                AutoName | WrapdCm => Box::new(Auto::new(name.as_str().to_string(), admm, settings.auto())),
                _ => Box::new(admm),
            }
        }
    })
}

/// Feeds the hooks; keeps the rows of the trace.
struct Watcher<'a, 'b, 'c> {
    chart: &'a Flat<'c>,
    order: &'a Order,
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    watching: Duration, // time spent on what only the hooks need
    rows: Vec<MapRow>,
}

impl Observer for Watcher<'_, '_, '_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        if let Some(progress) = self.hooks.progress.as_deref_mut() {
            let energy = method.energy();
            let value = 1.0 + energy.value / MODULUS;
            progress(&super::Progress { iteration: report.iteration, seconds, energy: value, inverted: energy.inverted });
        }
        if self.hooks.traced {
            let evaluation = method.evaluate();
            let uv = self.order.user(method.x());
            let residuals = method.residuals();
            self.rows.push(MapRow {
                iteration: report.iteration,
                seconds,
                energy: symmetric_dirichlet(self.chart, &uv),
                gradient_norm: evaluation.gradient_norm / MODULUS,
                primal_residual: residuals.primal,
                dual_residual: residuals.dual,
                inner: report.inner,
                refactorised: report.refactorised,
                accepted: report.accepted,
                flips: flips(self.chart.triangles, &uv) as u64,
                energy_z: 1.0 + report.energy_z / MODULUS,
            });
        }
        self.watching += now.elapsed();
    }
}
