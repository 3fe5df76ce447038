//! A body that follows its handles: error against time after a handle has moved, warm, beside WRAPD iterations and the time
//! of a cold solve.

use super::context::Context;
use crate::BenchError;
use crate::data::Model;
use crate::parts::{iteration, pool};
use crate::table::Table;
use proxel::deform::{DeformInput, Deformer, Frame, Hooks, deform};
use proxel::mesh::topology::components;
use proxel::pins::RigidMotion;
use proxel::settings::DeformSettings;
use proxel::split::{Method, Status};
use std::fmt::Write as _;
use std::time::{Duration, Instant};

/// How far the handle goes, as part of the bounding box's diagonal at rest.
const MOVED: f64 = 0.01;
/// What is to be left of the error in the time of [`ITERATIONS`] of WRAPD.
const LEFT: f64 = 0.1;
const ITERATIONS: f64 = 3.0;
/// What part of the cold time the warm solve may take.
const PART: f64 = 0.25;

type V3 = [f64; 3];

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let threads = context.options.threads.unwrap_or(2);
    let repeats = context.options.repeats.max(2);
    for name in context.models.clone() {
        let (model, _) = context.load(&name)?;
        let settings = DeformSettings { threads: Some(threads), ..DeformSettings::default() };
        let groups = handles(&model);
        let input = DeformInput { groups: groups.clone(), reference: None, ..model.input.clone() };
        let cold = seconds_of(repeats, || solve(&input, &settings))?;
        let three = ITERATIONS * wrapd_iteration(&model, threads)?;
        let _ = writeln!(
            context.text,
            "## {name}\n\nCold, `auto` to a gradient ratio of {:e}: {:.0} ms. {ITERATIONS} iterations of WRAPD: {:.1} ms. One \
             group of handles at a time goes {MOVED} of the diagonal along each axis, from the minimum.\n",
            settings.tol,
            cold * 1e3,
            three * 1e3,
        );
        let mut table = Table::new([
            "group (vertices)",
            "axis",
            "to 10 % of the error, ms",
            "part of 3 iterations",
            "error after 3 iterations' time",
            "warm, ms",
            "part of cold",
            "iterations",
        ]);
        let mut curves = String::new();
        let mut deformer = Deformer::new(&input, &settings).map_err(BenchError::from_display)?;
        converge(&mut deformer)?;
        for (k, (group, vertices)) in groups.iter().enumerate() {
            let axis = k % 3;
            let mut case = Case::new(&mut deformer, &model, group, axis)?;
            let warm = case.converged(repeats)?;
            let times = budgets(three);
            let mut errors = Vec::new();
            for budget in &times {
                errors.push(case.error_after(*budget, repeats)?);
            }
            let ten = errors.iter().filter(|e| e.1 <= LEFT).map(|e| e.0).fold(f64::INFINITY, f64::min);
            let said: Vec<String> = errors.iter().map(|(s, e)| format!("{:.1} ms {e:.2e}", s * 1e3)).collect();
            context.tell(&format!(
                "{name}: {group}, {}: warm {:.0} ms in {} iterations, cold {:.0} ms, 3 iterations {:.1} ms; {}",
                ["x", "y", "z"][axis],
                warm.0 * 1e3,
                warm.1,
                cold * 1e3,
                three * 1e3,
                said.join("; ")
            ));
            let at_three = errors.iter().filter(|e| e.0 <= three).map(|e| e.1).fold(1.0, f64::min);
            table.row([
                format!("{group} ({})", vertices.len()),
                ["x", "y", "z"][axis].to_string(),
                format!("{:.1}", ten * 1e3),
                format!("{:.2}", ten / three),
                format!("{at_three:.4}"),
                format!("{:.0}", warm.0 * 1e3),
                format!("{:.3}", warm.0 / cold),
                warm.1.to_string(),
            ]);
            let _ = write!(curves, "- {group}, {}:", ["x", "y", "z"][axis]);
            for (seconds, error) in &errors {
                let _ = write!(curves, " {:.1} ms {error:.2e};", seconds * 1e3);
            }
            curves.push('\n');
            case.back()?;
        }
        let _ = writeln!(
            context.text,
            "{table}\nAsked for: 1 or less in the part of 3 iterations, {PART} or less in the part of cold. Error: distance to the \
             new minimum over free vertices, over that of the old one.\n\nError against time:\n\n{curves}"
        );
    }
    Ok(())
}

/// The pinned vertices that hang together, as groups.
fn handles(model: &Model) -> Vec<(String, Vec<u32>)> {
    let mesh = &model.input.rest;
    let mut pinned = vec![false; mesh.n_verts()];
    model.input.fixed.iter().for_each(|f| pinned[f.0 as usize] = true);
    let edges: Vec<[u32; 2]> = proxel::mesh::topology::tet_edges(&mesh.tets)
        .into_iter()
        .filter(|e| e.iter().all(|v| pinned[*v as usize]))
        .collect();
    let parts = components(mesh.n_verts(), edges.iter().map(|e| e.as_slice()));
    let mut groups: Vec<(String, Vec<u32>)> = (0..parts.count).map(|c| (format!("handle {c}"), Vec::new())).collect();
    for (v, c) in parts.of_vertex.iter().enumerate() {
        if let Some(c) = c {
            groups[*c as usize].1.push(v as u32);
        }
    }
    groups.retain(|g| g.1.len() > 10);
    groups
}

fn solve(input: &DeformInput, settings: &DeformSettings) -> Result<(), BenchError> {
    let end = deform(input, settings, &mut Hooks::default()).map_err(BenchError::from_display)?;
    (end.status == Status::Converged)
        .then_some(())
        .ok_or_else(|| BenchError(format!("the cold solve did not converge: {}", end.report.reason)))
}

/// The least of some repetitions.
fn seconds_of(repeats: usize, mut work: impl FnMut() -> Result<(), BenchError>) -> Result<f64, BenchError> {
    let mut least = f64::INFINITY;
    for _ in 0..repeats {
        let began = Instant::now();
        work()?;
        least = least.min(began.elapsed().as_secs_f64());
    }
    Ok(least)
}

/// The least time of an iteration with one inner step.
fn wrapd_iteration(model: &Model, threads: usize) -> Result<f64, BenchError> {
    let pool = pool(threads)?;
    pool.install(|| {
        let mut method = iteration(model)?;
        seconds_of(20, || method.step().map(|_| ()).map_err(BenchError::from_display))
    })
}

fn converge(deformer: &mut Deformer) -> Result<Frame, BenchError> {
    let frame = deformer.step(None, &mut Hooks::default()).map_err(BenchError::from_display)?;
    match frame.status {
        Status::Converged => Ok(frame),
        _ => Err(BenchError(format!("the deformer did not converge: {}", frame.reason))),
    }
}

/// Times at which the error is looked at, up to some multiples of that of three iterations.
fn budgets(three: f64) -> Vec<Duration> {
    [0.1, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0].map(|part| Duration::from_secs_f64(part * three)).to_vec()
}

/// One handle on its way.
struct Case<'a> {
    deformer: &'a mut Deformer,
    group: &'a str,
    motion: RigidMotion,
    free: Vec<bool>,
    from: Vec<V3>,
    to: Vec<V3>,
}

impl<'a> Case<'a> {
    fn new(deformer: &'a mut Deformer, model: &Model, group: &'a str, axis: usize) -> Result<Self, BenchError> {
        let (low, high) = model.input.rest.bounding_box().unwrap_or_default();
        let diagonal = (0..3).map(|d| (high[d] - low[d]).powi(2)).sum::<f64>().sqrt();
        let mut t = [0.0; 3];
        t[axis] = MOVED * diagonal;
        let motion = RigidMotion::translation(t);
        let mut free = vec![true; model.input.rest.n_verts()];
        model.input.fixed.iter().for_each(|f| free[f.0 as usize] = false);
        let from = deformer.positions();
        let mut case = Case { deformer, group, motion, free, from, to: Vec::new() };
        case.send(&motion)?;
        case.to = converge(case.deformer)?.positions;
        Ok(case)
    }

    fn send(&mut self, motion: &RigidMotion) -> Result<(), BenchError> {
        self.deformer.move_group(self.group, motion).map_err(BenchError::from_display)
    }

    /// To the first minimum again, with the factor that belongs to it.
    fn back(&mut self) -> Result<(), BenchError> {
        self.send(&RigidMotion::identity())?;
        converge(self.deformer).map(|_| ())
    }

    /// Least seconds and iterations to the new minimum.
    fn converged(&mut self, repeats: usize) -> Result<(f64, usize), BenchError> {
        let mut best = (f64::INFINITY, 0);
        for _ in 0..repeats {
            self.back()?;
            let began = Instant::now();
            self.send(&self.motion.clone())?;
            let frame = converge(self.deformer)?;
            let seconds = began.elapsed().as_secs_f64();
            if seconds < best.0 {
                best = (seconds, frame.iterations);
            }
        }
        Ok(best)
    }

    /// Seconds that a step with this budget took, and the error after it.
    fn error_after(&mut self, budget: Duration, repeats: usize) -> Result<(f64, f64), BenchError> {
        let mut best = (f64::INFINITY, f64::INFINITY);
        for _ in 0..repeats {
            self.back()?;
            let began = Instant::now();
            self.send(&self.motion.clone())?;
            let step = self.deformer.step(Some(budget), &mut Hooks::default()).map_err(BenchError::from_display)?;
            let seconds = began.elapsed().as_secs_f64();
            let error = self.distance(&step.positions, &self.to) / self.distance(&self.from, &self.to);
            if (error, seconds) < (best.1, best.0) {
                best = (seconds, error);
            }
        }
        Ok(best)
    }

    fn distance(&self, a: &[V3], b: &[V3]) -> f64 {
        let free = (0..a.len()).filter(|v| self.free[*v]);
        free.map(|v| (0..3).map(|d| (a[v][d] - b[v][d]).powi(2)).sum::<f64>()).sum::<f64>().sqrt()
    }
}
