//! Maps without overlaps: a scaffold around a chart keeps its border from crossing itself.

use super::chart::{self, ChartInput, ChartMap, in_units};
use super::flat::{Flat, best_scale, flips, symmetric_dirichlet};
use super::order::{Order, middle};
use super::problem::MODULUS;
use super::scaffold::{Scaffold, augmented};
use super::start::bijective_starts;
use super::watch::{TimeLimit, Watcher};
use super::{Hooks, UnwrapError};
use crate::settings::{UnwrapMethod, UnwrapSettings};
use proxel_mesh::Mesh;
use proxel_mesh::uv::{CertificateOptions, UvMap, certify};
use proxel_split::{
    Cancel, EnergyReport, GradientTolerance, IterationLimit, Method, Newton, NewtonSettings, NormalMatrix, Observer,
    Outcome, Problem, Status, StepReport, Stop, SystemError, Verdict,
};
use std::time::{Duration, Instant};

/// Weight of the first scaffold, as part of the chart's: E / (100 |S|) for each triangle, Jiang et al. 2017, section 3.2.
const WEIGHT: f64 = 1e-2;

/// Each further one weighs this part of the one before: the lighter it is, the narrower the gaps that it leaves.
const LIGHTER: f64 = 0.9;

/// But no less than this.
const LEAST: f64 = 1e-4;

/// Steps of Newton's method with one scaffold.
const STEPS: usize = 3;

/// Where a new scaffold lowers the energy by less than this part, the next one is the last, unless it lowers it by more.
const SETTLED: f64 = 1e-5;

/// While one lowers it by more than this part, steps are those of SLIM (Rabinovich et al. 2017), which far from the minimum
/// get on faster than Newton's.
const FAR: f64 = 0.1;

/// Most steps with the last one.
const LAST: usize = 30;

/// Steps refused in a row, after which a scaffold is renewed.
const REFUSALS: usize = 2;

/// Minimises the energy of the map of a chart among the maps without overlaps: the free minimum where that has none, bit
/// for bit; else with scaffolds (Jiang, Schaefer and Panozzo 2017, "Simplicial complex augmentation framework for bijective
/// maps") from a start without overlaps. Iterations of both are counted.
///
/// With each scaffold Newton's method takes a few steps on the energy of chart and scaffold. A new scaffold is at rest, so
/// that the energy of the chart alone never rises; the map has converged when the gradient of the whole has vanished and
/// yet another scaffold would hardly lower the energy of the chart.
pub(super) fn solve(
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<ChartMap, UnwrapError> {
    let mut free = chart::solve(input, settings, hooks, began)?;
    let Some(flat) = &input.flat() else { return Ok(free) };
    if is_bijective(flat, &free.uv)? {
        return Ok(free);
    }
    for uv in bijective_starts(flat, input.start.as_deref())? {
        let factor = best_scale(flat, &uv);
        let uv: Vec<[f64; 2]> = uv.iter().map(|p| p.map(|v| v * factor)).collect();
        if is_bijective(flat, &uv)? {
            return Run::new(flat, input, settings, free, uv).run(hooks, began);
        }
    }
    let outcome = &mut free.outcome;
    if outcome.status == Status::Converged {
        outcome.status = Status::Stopped;
    }
    outcome.reason = format!(
        "the map overlaps itself, and --bijective found no start without overlaps; cut the surface with --seams, or begin \
         with --from-uv; without --bijective: {}",
        outcome.reason
    );
    Ok(free)
}

/// Whether no triangle is flipped and none lies over another, by exact arithmetic.
fn is_bijective(flat: &Flat<'_>, uv: &[[f64; 2]]) -> Result<bool, UnwrapError> {
    let finite = uv.iter().flatten().all(|v| v.is_finite());
    if !finite || flips(flat.triangles, uv) > 0 {
        return Ok(false);
    }
    let mesh = Mesh::from_triangles("chart", flat.points.to_vec(), flat.triangles);
    let map = UvMap { coordinates: uv.to_vec(), corners: flat.triangles.concat() };
    Ok(certify(&mesh.points, &mesh.faces, &map, &CertificateOptions::default())?.overlaps.is_injective())
}

/// A run with scaffolds, and how far it is.
struct Run<'a, 'b> {
    flat: &'a Flat<'b>,
    input: &'a ChartInput<'b>,
    settings: &'a UnwrapSettings,
    order: Order,
    uv: Vec<[f64; 2]>, // without overlaps, in units of the shapes
    weight: f64,       // of the scaffold
    is_far: bool,      // from the minimum
    map: ChartMap,     // the counts so far
}

/// What came of one scaffold.
struct Round {
    end: Option<Verdict>, // of the whole run
    is_still: bool,       // whether the gradient has vanished
    threshold: f64,       // below which it has
    gain: f64,            // by how much the chart's energy has fallen, as part of it
}

impl<'a, 'b> Run<'a, 'b> {
    fn new(
        flat: &'a Flat<'b>,
        input: &'a ChartInput<'b>,
        settings: &'a UnwrapSettings,
        free: ChartMap,
        uv: Vec<[f64; 2]>,
    ) -> Self {
        let order = Order::new(flat, &[middle(&uv) as u32]);
        Run { flat, input, settings, order, uv, weight: WEIGHT, is_far: true, map: free }
    }

    fn run(mut self, hooks: &mut Hooks<'_>, began: Instant) -> Result<ChartMap, UnwrapError> {
        // Rows of the trace go on where those of the free map ended.
        let before = Duration::try_from_secs_f64(self.map.rows.last().map_or(0.0, |row| row.seconds));
        let now = Instant::now();
        let since = now.checked_sub(before.unwrap_or_default()).unwrap_or(now);
        let mut clock = (since, Duration::ZERO);
        let mut settled = false;
        let verdict = loop {
            let round = match self.round(if settled { LAST } else { STEPS }, hooks, began, &mut clock) {
                Ok(round) => round,
                Err(e) => break Verdict { status: Status::Failed, reason: e.to_string() },
            };
            if let Some(verdict) = round.end {
                break verdict;
            }
            let small = round.gain <= SETTLED;
            if small && settled {
                break self.verdict(&round);
            }
            settled = small;
            self.is_far = round.gain > FAR;
            self.weight = (LIGHTER * self.weight).max(LEAST);
        };
        self.finish(verdict)
    }

    /// Steps with a new scaffold.
    fn round(
        &mut self,
        steps: usize,
        hooks: &mut Hooks<'_>,
        began: Instant,
        clock: &mut (Instant, Duration),
    ) -> Result<Round, SystemError> {
        let refuse = |what: &str| SystemError::Stalled(format!("{what}; the map is the last one without overlaps"));
        let chart = self.flat;
        let scaffold = Scaffold::around(&self.uv, chart.loops)
            .ok_or_else(|| refuse("the border has come so near to itself that no scaffold fits around it"))?;
        let order = self.order.with_between(scaffold.n_free);
        let mut problem = augmented(chart, &order, &scaffold, &self.uv, self.input, self.settings, self.weight)?;
        let before = own_energy(&mut problem, &order.solver(&self.uv));
        let reference = self.map.reference_gradient * MODULUS;
        let tolerance = GradientTolerance::against(self.settings.tol, reference, problem.characteristic_gradient());
        let normal = NormalMatrix::new(&problem)?;
        let (x, iteration) = (problem.x0.clone(), self.map.outcome.iterations);
        let mut newton = Newton::resume(problem, normal, x, self.steps(), iteration)?;
        let mut watcher = Watcher {
            chart,
            settings: self.settings,
            order: &order,
            hooks,
            began: clock.0,
            watching: clock.1,
            rows: Vec::new(),
        };
        let mut cancel = Cancel(watcher.hooks.cancel.clone());
        let mut time = TimeLimit::new(began, self.settings.time_limit);
        let mut limit = IterationLimit(self.settings.max_iters);
        let mut stops: [&mut dyn Stop; 3] = [&mut cancel, &mut time, &mut limit];
        let mut report = StepReport { iteration, ..Default::default() };
        let (mut refused, mut end) = (0, None);
        let outcome = &mut self.map.outcome;
        let is_still = loop {
            if newton.evaluate().gradient_norm <= tolerance.threshold() {
                break true;
            }
            end = stops.iter_mut().find_map(|stop| stop.check(&mut newton, &report));
            if end.is_some() || report.iteration >= iteration + steps || refused >= REFUSALS {
                break false;
            }
            report = newton.step()?;
            watcher.observe(&mut newton, &report);
            refused = if report.accepted { 0 } else { refused + 1 };
            count(outcome, &report);
        };
        self.map.rows.append(&mut watcher.rows);
        clock.1 = watcher.watching;
        self.map.gradient_norm = newton.evaluate().gradient_norm / MODULUS;
        self.map.factor_bytes = self.map.factor_bytes.max(newton.factor_bytes());
        let uv = order.user(newton.x());
        // What counts is exact arithmetic, not the energy's.
        if flips(chart.triangles, &uv) > 0 || scaffold.is_flipped(&order, newton.x(), &uv) {
            return Err(refuse("a step in floating-point arithmetic has turned over a triangle"));
        }
        let mut problem = Box::new(newton).into_problem();
        let after = own_energy(&mut problem, &order.solver(&uv));
        let size = problem.terms.first().map_or(1.0, |own| MODULUS * own.scale().measure);
        let gain = (before.value - after.value) / (after.value + size);
        self.map.outcome.energy = after;
        self.uv = uv;
        Ok(Round { end, is_still, threshold: tolerance.threshold(), gain })
    }

    /// The same for every method that found the free map.
    fn steps(&self) -> NewtonSettings {
        let method = if self.is_far { UnwrapMethod::Slim } else { UnwrapMethod::Auto };
        UnwrapSettings { method, ..self.settings.clone() }.newton()
    }

    /// After the last scaffold.
    fn verdict(&self, round: &Round) -> Verdict {
        let Round { threshold, gain, .. } = round;
        let (gradient, weight, tol) = (self.map.gradient_norm * MODULUS, self.weight, self.settings.tol);
        let renewed = format!("renewing the scaffold lowers the energy by {gain:.1e} of it (at most {SETTLED:e})");
        match round.is_still {
            true => Verdict {
                status: Status::Converged,
                reason: format!(
                    "gradient {gradient:e} of chart and scaffold (weight {weight:.1e}) is at most {threshold:e} (tolerance \
                     {tol:e}); {renewed}"
                ),
            },
            false => Verdict {
                status: Status::Stopped,
                reason: format!(
                    "gradient {gradient:e} of chart and scaffold (weight {weight:.1e}) cannot be lowered to {threshold:e}; \
                     give a larger --tol than {tol:e}; {renewed}"
                ),
            },
        }
    }

    fn finish(mut self, verdict: Verdict) -> Result<ChartMap, UnwrapError> {
        let sound = is_bijective(self.flat, &self.uv)?;
        let outcome = &mut self.map.outcome;
        (outcome.status, outcome.reason) = (verdict.status, verdict.reason);
        if !sound {
            outcome.status = Status::Failed;
            outcome.reason = format!("the map overlaps itself for all its scaffold; {}", outcome.reason);
        }
        outcome.x = self.order.solver(&self.uv);
        let uv = in_units(self.flat, &self.uv, self.input);
        let energy = symmetric_dirichlet(self.flat, &self.uv);
        Ok(ChartMap { uv, energy, energy_z: f64::INFINITY, ..self.map })
    }
}

/// Of the chart alone, which is the first term.
fn own_energy(problem: &mut Problem, x: &[f64]) -> EnergyReport {
    problem.terms.first_mut().map(|own| own.energy(x, None)).unwrap_or_default()
}

fn count(outcome: &mut Outcome, report: &StepReport) {
    outcome.iterations = report.iteration;
    outcome.inner_iterations += report.inner;
    outcome.refactorisations += usize::from(report.refactorised);
    *(if report.accepted { &mut outcome.accepted } else { &mut outcome.rejected }) += 1;
    outcome.last = *report;
}
