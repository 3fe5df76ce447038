//! Maps without overlaps: the border of a chart is kept from crossing itself by a scaffold around it.

use super::chart::{self, ChartInput, ChartMap, Order, Watcher, in_units, middle};
use super::flat::{Flat, best_scale, flips, symmetric_dirichlet};
use super::scaffold::Scaffold;
use super::start::bijective_starts;
use super::watch::TimeLimit;
use super::{Hooks, UnwrapError};
use crate::settings::UnwrapSettings;
use proxel_mesh::Mesh;
use proxel_mesh::uv::{CertificateOptions, UvMap, certify};
use proxel_model::elements::{Batch, BatchShape, BatchWeights, Flattened, batch};
use proxel_model::energy::{Energy, Lame, SymmetricDirichlet};
use proxel_split::{
    Cancel, GradientTolerance, IterationLimit, Method, Newton, NoProgress, NormalMatrix, Observer, Outcome, Problem,
    Quadratic, Residuals, Status, StepReport, Stop, SystemError,
};
use std::time::{Duration, Instant};

fn env(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// Minimises the energy of the map of a chart among the maps without overlaps: the free minimum where that has none, bit
/// for bit; else by scaffolds (Jiang, Schaefer and Panozzo 2017) from a start without overlaps.
pub(super) fn solve(
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<ChartMap, UnwrapError> {
    let entered = Instant::now();
    let mut free = chart::solve(input, settings, hooks, began)?;
    let Some(flat) = &Flat::new(&input.points, &input.chart.triangles, &input.chart.loops) else { return Ok(free) };
    let overlaps = overlaps(flat, &free.uv)?;
    if overlaps == Some(0) {
        return Ok(free);
    }
    let mut start = None;
    for uv in bijective_starts(flat, input.start.as_deref())? {
        if self::overlaps(flat, &uv)? == Some(0) {
            start = Some(uv);
            break;
        }
    }
    let Some(start) = start else {
        free.outcome.status = Status::Stopped;
        free.outcome.reason = "the map overlaps itself, and there is no start without overlaps to begin --bijective with; cut \
                               the surface with --seams"
            .to_string();
        return Ok(free);
    };
    let factor = best_scale(flat, &start);
    let uv: Vec<[f64; 2]> = start.iter().map(|p| p.map(|v| v * factor)).collect();
    Run { flat, input, settings, hooks, began, entered }.from(uv, free)
}

/// Pairs of triangles that lie over each other; none where a triangle is flipped.
fn overlaps(flat: &Flat<'_>, uv: &[[f64; 2]]) -> Result<Option<u64>, UnwrapError> {
    if flips(flat.triangles, uv) > 0 {
        return Ok(None);
    }
    let mesh = Mesh::from_triangles("chart", flat.points.to_vec(), flat.triangles);
    let map = UvMap { coordinates: uv.to_vec(), corners: flat.triangles.concat() };
    let found = certify(&mesh.points, &mesh.faces, &map, &CertificateOptions::default())?.overlaps;
    Ok(Some(if found.is_injective() { 0 } else { found.triangle_pairs.max(1) }))
}

/// A run with scaffolds.
struct Run<'a, 'b, 'c> {
    flat: &'a Flat<'c>,
    input: &'a ChartInput<'c>,
    settings: &'a UnwrapSettings,
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    entered: Instant,
}

impl Run<'_, '_, '_> {
    fn from(mut self, mut uv: Vec<[f64; 2]>, free: ChartMap) -> Result<ChartMap, UnwrapError> {
        let chart = self.flat;
        let held = [middle(&uv) as u32];
        let plain = Order::new(chart, &held);
        let threshold_of = free.reference_gradient;
        let mut rows = free.rows;
        let mut outcome = free.outcome;
        let mut energy = symmetric_dirichlet(chart, &uv);
        let mut weight = env("W0", 0.01);
        for outer in 0..env("OUTER", 200.0) as usize {
            let t0 = Instant::now();
            let Some(scaffold) = Scaffold::around(&uv, chart.loops) else {
                outcome.reason = "border touches".into();
                break;
            };
            let t1 = t0.elapsed();
            let order = plain.with_between(scaffold.n_free);
            let problem = augmented(chart, &order, &scaffold, &uv, self.input, self.settings, weight)?;
            let characteristic = problem.characteristic_gradient();
            let normal = NormalMatrix::new(&problem).map_err(|e| UnwrapError(e.to_string()))?;
            let x = problem.x0.clone();
            let t2 = t0.elapsed();
            let mut newton = Newton::resume(problem, normal, x, self.settings.newton(), outcome.iterations)
                .map_err(|e| UnwrapError(e.to_string()))?;
            let mut tolerance =
                GradientTolerance::against(self.settings.tol, 4.0 * threshold_of, characteristic);
            let mut limit = IterationLimit((outcome.iterations + env("INNER", 3.0) as usize).min(self.settings.max_iters));
            let mut stuck = NoProgress::new(2);
            let mut cancel = Cancel(self.hooks.cancel.clone());
            let mut time = TimeLimit::new(self.began, self.settings.time_limit);
            let mut watcher = Watcher {
                chart,
                order: &order,
                hooks: self.hooks,
                began: self.entered,
                watching: Duration::ZERO,
                rows: Vec::new(),
            };
            let mut stops: [&mut dyn Stop; 5] = [&mut tolerance, &mut cancel, &mut time, &mut limit, &mut stuck];
            let result = proxel_split::run(&mut newton, &mut stops, &mut watcher);
            rows.append(&mut watcher.rows);
            let g = newton.evaluate();
            uv = order.user(&result.x);
            let e = symmetric_dirichlet(chart, &uv);
            if std::env::var("VERB").is_ok() {
                println!(
                    "outer {outer} E {e:.8} gain {:.2e} tri {} steiner {} its {} acc {} t {:.3} S {:.2e} g {:.2e} w {weight:.1e} | cdt {:.3} setup {:.3} all {:.3} {}",
                    (energy - e) / e,
                    scaffold.triangles.len(),
                    scaffold.n_free,
                    result.iterations - outcome.iterations,
                    result.accepted,
                    newton.last().t,
                    g.energy.value / 4.0 + 1.0 - e,
                    g.gradient_norm,
                    t1.as_secs_f64(),
                    t2.as_secs_f64(),
                    t0.elapsed().as_secs_f64(),
                    result.reason
                );
            }
            outcome.iterations = result.iterations;
            let gain = (energy - e) / e;
            energy = e;
            outcome.x = result.x;
            if gain < env("GAIN", 1e-6) {
                break;
            }
            weight = (weight * env("DROP", 0.9)).max(env("WMIN", 1e-4));
        }
        Ok(ChartMap { uv: in_units(chart, &uv, self.input), outcome, rows, energy, ..free })
    }
}

/// The chart and its scaffold.
fn augmented(
    chart: &Flat<'_>,
    order: &Order,
    scaffold: &Scaffold,
    uv: &[[f64; 2]],
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
    weight: f64,
) -> Result<Problem, UnwrapError> {
    let refuse = |e: &dyn std::fmt::Display| UnwrapError(e.to_string());
    let n = uv.len();
    let total = n + scaffold.points.len();
    let (own, barrier) = chart::term(chart, order, total, input, settings)?;
    let numbers = |v: u32| match v as usize {
        v if v < n => order.number[v],
        v if v < n + scaffold.n_free => (order.between + v - n) as u32,
        v => v as u32,
    };
    let elements: Vec<u32> = scaffold.triangles.iter().flatten().map(|v| numbers(*v)).collect();
    let mut x0 = order.solver(uv);
    x0.resize(2 * total, 0.0);
    for (k, p) in scaffold.points.iter().enumerate() {
        x0[2 * numbers((n + k) as u32) as usize..][..2].copy_from_slice(p);
    }
    let at = |v: u32| [x0[2 * v as usize], x0[2 * v as usize + 1]];
    let (mut shapes, mut centers, mut weights) = (Vec::new(), Vec::new(), Vec::new());
    for t in elements.chunks_exact(3) {
        let [p, q, r] = [at(t[0]), at(t[1]), at(t[2])];
        let shape = [[q[0] - p[0], r[0] - p[0]], [q[1] - p[1], r[1] - p[1]]];
        let area = 0.5 * (shape[0][0] * shape[1][1] - shape[0][1] * shape[1][0]);
        shapes.push(shape);
        centers.push([(p[0] + q[0] + r[0]) / 3.0, (p[1] + q[1] + r[1]) / 3.0, 0.0]);
        weights.push(weight / (scaffold.triangles.len() as f64 * area));
    }
    let lame = Lame::new(chart::MODULUS, 0.0).map_err(|e| refuse(&e))?;
    let (around, _) = batch(&Batch {
        shape: BatchShape::PlanarTriangles,
        positions: &[],
        flattened: Some(Flattened { shapes: &shapes, centers: &centers, n_nodes: total }),
        elements: &elements,
        fill: Some(&weights),
        energy: <SymmetricDirichlet as Energy<2>>::NAME,
        lame: &lame,
        limits: None,
        rotation_aware: true,
        singular_values: true,
        weights: &|stiffness| BatchWeights { base: stiffness.largest, softening: 1.0 },
    })
    .map_err(|e| refuse(&e))?;
    Ok(Problem {
        dim: 2,
        n_free: order.n_free + scaffold.n_free,
        x0,
        terms: vec![own, around],
        quadratic: Quadratic::default(),
        barrier,
    })
}
