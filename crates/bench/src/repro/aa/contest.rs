//! A step that `auto` of `simulate` and plain ADMM both solve.

use super::course::Course;
use super::step::Way;
use crate::BenchError;
use crate::bars;
use crate::motion::{self, Moving};
use proxel::simulate::{BodyState, FrameRecord, Hooks, SceneFile, Simulation};
use proxel::split::{Method, NormalMatrix, Order, Price, Problem, normalized, vector};
use std::path::{Path, PathBuf};

/// What is to be solved: bars, or a body among obstacles or within limits.
enum What {
    Bars(Box<bars::Scene>),
    Moving(Box<Moving>),
}

/// A step, and the simulation that stands at its start.
pub(super) struct Contest {
    what: What,
    scene: SceneOf,
    /// Where each vertex of each body is in positions.
    places: Vec<Vec<usize>>,
    /// The mean edge.
    pub a: f64,
}

/// What makes simulations of the same bodies.
enum SceneOf {
    Text(String),
    Moving(motion::Scene),
}

/// How `auto` ended.
pub(super) struct Auto {
    pub record: FrameRecord,
    /// The least of the repeats: seconds of the whole frame.
    pub seconds: f64,
    /// Of the plain iteration entered at its end: see [`Contest::forward`].
    pub forward: f64,
    pub x: Vec<f64>,
}

/// The scenes of Figure 2, whose bars the reproduction generates by itself.
const SOFT: &str = include_str!("../../../../../scenes/aa-figure2-soft.toml");
const RUBBER: &str = include_str!("../../../../../scenes/aa-figure2-rubber.toml");

impl Contest {
    /// The bars of Figure 2, at a frame from 1; those before in so many plain iterations each.
    pub fn of_bars(is_soft: bool, frame: usize, before: usize) -> Result<Self, BenchError> {
        let (poisson, text) = if is_soft { (0.399, SOFT) } else { (0.499, RUBBER) };
        let mut scene = bars::Scene::new(poisson, [12, 3, 3])?;
        // A body's vertices are found by where they are at the start, pins moved.
        let start = scene.positions();
        let simulation = simulation(text, 1, 1.0, None)?;
        let quantum = 1e-6 * scene.bars.mean_edge();
        let key = |p: &[f64; 3]| p.map(|v| (v / quantum).round() as i64);
        let mut known: Vec<([i64; 3], usize)> = start.iter().enumerate().map(|(at, p)| (key(p), at)).collect();
        known.sort_unstable();
        let place = |p: &[f64; 3]| {
            let k = known.binary_search_by(|(q, _)| q.cmp(&key(p))).map(|k| known[k].1);
            k.map_err(|_| BenchError(format!("the scene has a vertex at {p:?} that the bars do not have")))
        };
        let frame_0 = simulation.frame(FrameRecord::default()).map_err(BenchError::from_display)?;
        let places = frame_0.bodies.iter().map(|(_, mesh, _)| mesh.points.iter().map(place).collect());
        let places = places.collect::<Result<Vec<Vec<usize>>, BenchError>>()?;
        while scene.frame() < frame {
            scene.advance(before)?;
        }
        let a = scene.bars.mean_edge();
        Ok(Contest { what: What::Bars(Box::new(scene)), scene: SceneOf::Text(text.to_string()), places, a })
    }

    /// The next frame of a body in motion, whose mesh is written into the folder.
    pub fn of_body(moving: Moving, folder: &Path, name: &str) -> Result<Self, BenchError> {
        let scene = SceneOf::Moving(motion::Scene::new(&moving, folder, name)?);
        let places = vec![moving.places()];
        let a = moving.body.mean_edge();
        Ok(Contest { what: What::Moving(Box::new(moving)), scene, places, a })
    }

    /// The step by `auto` at a tolerance: once to make what steps have in common, then `repeats` times.
    pub fn auto(&self, tol: f64, most: usize, repeats: usize, threads: Option<usize>) -> Result<Auto, BenchError> {
        let mut simulation = match &self.scene {
            SceneOf::Text(text) => simulation(text, most, tol, threads)?,
            SceneOf::Moving(scene) => scene.simulation("auto", most, tol, threads)?,
        };
        let (frame, x, v) = match &self.what {
            What::Bars(scene) => (scene.frame() - 1, scene.positions(), scene.velocities()),
            What::Moving(moving) => (moving.frames(), moving.positions(), moving.blown_velocities()),
        };
        let pick = |of: &[[f64; 3]], places: &[usize]| places.iter().map(|at| of[*at]).collect();
        let bodies: Vec<BodyState> =
            self.places.iter().map(|p| BodyState { positions: pick(&x, p), velocities: pick(&v, p) }).collect();
        let mut best: Option<FrameRecord> = None;
        for _ in 0..=repeats.max(1) {
            simulation.place(frame, &bodies).map_err(BenchError::from_display)?;
            let record = simulation.advance(&mut Hooks::default()).map_err(BenchError::from_display)?;
            if best.as_ref().is_none_or(|b| record.seconds < b.seconds) {
                best = Some(record);
            }
        }
        let Some(record) = best else { return Err(BenchError("no run".to_string())) };
        let mut problem = self.problem()?;
        let (mut x, mut forces) = (problem.x0.clone(), vec![0.0; problem.x0.len()]);
        let ended = simulation.frame(record.clone()).map_err(BenchError::from_display)?;
        for ((_, mesh, fields), places) in ended.bodies.iter().zip(&self.places) {
            let contact = fields.point.iter().find(|f| f.name == "contact_force");
            let contact = contact.map_or(&[][..], |f| f.data.as_chunks::<3>().0);
            for (k, at) in places.iter().enumerate() {
                x[3 * at..3 * at + 3].copy_from_slice(&mesh.points[k]);
                if let Some(f) = contact.get(k) {
                    forces[3 * at..3 * at + 3].copy_from_slice(f);
                }
            }
        }
        let forward = match self.has_limits() {
            true => self.forward_bound(&problem, record.gradient.unwrap_or(f64::INFINITY)),
            false => self.forward(&mut problem, &x, &forces)?,
        };
        Ok(Auto { seconds: record.seconds, record, forward, x })
    }

    /// Whether there are no sets, and all methods end in the same minimum.
    pub fn has_one_minimum(&self) -> bool {
        matches!(self.what, What::Bars(_))
    }

    /// Whether forces of limits, which frames do not tell, belong to the gradient.
    pub fn has_limits(&self) -> bool {
        matches!(&self.what, What::Moving(moving) if moving.body.limits.is_some())
    }

    /// The forward residual A(22), normalised by A(27), of the plain iteration entered at x with z = Dx and the dual of the
    /// elements' forces and of those of contact: its x-step goes by -A^-1 grad, the gradient having those forces, and the
    /// residual is |W D A^-1 grad|, the root of d . grad - d . G d with d = A^-1 grad, A = G + D^T W^2 D.
    fn forward(&self, problem: &mut Problem, x: &[f64], forces: &[f64]) -> Result<f64, BenchError> {
        let mut grad = vec![0.0; 3 * problem.n_free];
        problem.energy(x, Some(&mut grad));
        grad.iter_mut().zip(forces).for_each(|(g, f)| *g -= f);
        let mut moved = grad.clone();
        let mut normal = NormalMatrix::new(problem).map_err(BenchError::from_display)?;
        normal.solve(&mut moved).map_err(BenchError::from_display)?;
        let inertia = problem.quadratic.inertia.stiffness();
        let terms = moved.iter().zip(&grad).enumerate().map(|(i, (d, g))| d * (g - inertia[i / 3] * d));
        Ok(normalized(terms.sum::<f64>().max(0.0), problem.local_dim(), self.a))
    }

    /// A bound of the same from the norm of the gradient alone: |grad|^2 / (4 min G), since s/(m + s)^2 <= 1/(4 m).
    fn forward_bound(&self, problem: &Problem, gradient: f64) -> f64 {
        let least = problem.quadratic.inertia.stiffness().iter().copied().fold(f64::INFINITY, f64::min);
        normalized(gradient * gradient / (4.0 * least), problem.local_dim(), self.a)
    }

    /// The problem of plain ADMM: the paper's.
    pub fn problem(&self) -> Result<Problem, BenchError> {
        match &self.what {
            What::Bars(scene) => scene.problem(),
            What::Moving(moving) => moving.problem(motion::Splitting::Linear, 1.0),
        }
    }

    fn plain(&self) -> Result<(Box<dyn Method>, Order), BenchError> {
        match &self.what {
            What::Bars(scene) => Ok((Box::new(scene.admm()?), Order::Xzu)),
            What::Moving(moving) => Way::plain("admm", 1.0).method(moving),
        }
    }

    /// Plain ADMM for so many iterations, with positions after some of them. Where there are no sets the points of the course
    /// have the norm of the objective's gradient in the place of the position error.
    pub fn by_admm(&self, most: usize, at: &[usize]) -> Result<(Course, Vec<Vec<f64>>), BenchError> {
        let (mut method, order) = self.plain()?;
        let (mut iteration, mut kept) = (0, vec![Vec::new(); at.len()]);
        let (mut problem, smooth) = (self.problem()?, self.has_one_minimum());
        let mut grad = vec![0.0; 3 * problem.n_free];
        let mut watch = |x: &[f64]| {
            iteration += 1;
            at.iter().zip(&mut kept).filter(|(k, _)| **k == iteration).for_each(|(_, kept)| *kept = x.to_vec());
            if !smooth {
                return (f64::INFINITY, 0.0);
            }
            problem.energy(x, Some(&mut grad));
            (vector::norm(&grad), 0.0)
        };
        let course = Course::watched("", "admm", &mut *method, order, self.a, (most, 0.0), &mut watch)?;
        Ok((course, kept))
    }

    /// What an iteration of Newton's method costs in iterations of the splitting, counted.
    pub fn price(&self) -> Result<f64, BenchError> {
        let problem = self.problem()?;
        let normal = NormalMatrix::new(&problem).map_err(BenchError::from_display)?;
        let price = Price::of(&problem, &normal).0;
        Ok(price.factor.min(price.gradients))
    }

    /// How far positions violate limits, or are inside of obstacles in metres, at most.
    pub fn violation(&self, x: &[f64]) -> f64 {
        let most = |of: Vec<f64>| of.into_iter().fold(0.0, f64::max);
        match &self.what {
            What::Bars(_) => 0.0,
            What::Moving(moving) => most(moving.violations(x)).max(most(moving.depths(x))),
        }
    }
}

fn simulation(text: &str, max_iters: usize, tol: f64, threads: Option<usize>) -> Result<Simulation, BenchError> {
    let solver = format!("method = \"auto\"\nmax_iters = {max_iters}\ntol = {tol:e}");
    let text = text.replace("method = \"auto\"", &solver);
    let file =
        SceneFile::parse("the scene".to_string(), text, false, PathBuf::new()).map_err(BenchError::from_display)?;
    Simulation::new(&file, threads).map_err(BenchError::from_display)
}
