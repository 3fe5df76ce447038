//! The problem of a step and what solves it: the parts that steps have in common are kept.

mod newton;
mod running;

use super::contact::{Known, Walls};
use super::damping::StiffnessDamping;
use super::stops::{Bound, Stops};
use super::world::{Terms, World};
use super::{SimulateError, has_finish};
use crate::deform::constraints::{OBSTACLE_WEIGHT, shared};
use crate::deform::{admm_settings, method};
use crate::settings::{DeformSettings, MethodName, PenaltyName};
use proxel_model::contact::Contacts;
use proxel_model::obstacle::{Obstacle, Solids};
use proxel_split::{
    Admm, Auto, Hessian, Inertia, NormalMatrix, Precision, Problem, Quadratic, ResidualTolerance, Residuals, Status,
    Stop, SystemError, Term, vector,
};
use running::Running;
use std::sync::Arc;

/// What a step minimises, inertia aside.
pub(super) struct Task<'a> {
    /// Positions at the start of the step, held nodes where they are at its end.
    pub x: &'a [f64],
    /// Where free nodes would go by themselves, y.
    pub target: &'a [f64],
    /// What masses are multiplied by: the stiffness of inertia over mass.
    pub inertia: f64,
    /// Stiffness damping over the time that velocities are measured over, what they are measured from, and forces of held
    /// nodes through it.
    pub damping: Option<(f64, Vec<f64>, Vec<f64>)>,
    /// The obstacles.
    pub walls: &'a Walls,
    /// Forces between points and walls in the step before.
    pub known: &'a Known,
}

/// How a step ended.
pub(super) struct Solved {
    pub x: Vec<f64>,
    pub status: Status,
    pub reason: String,
    pub iterations: usize,
    pub rejected: usize,
    pub residuals: Residuals,
    /// Norm of the gradient over free nodes, forces of contact included, and what convergence asks of it; none for hard
    /// sets that are split off.
    pub gradient: Option<f64>,
    pub bound: f64,
    /// Forces between points and walls.
    pub contacts: Contacts,
    pub known: Known,
}

/// Solves steps of a world.
pub(super) struct Engine {
    problem: Problem,
    barriers: Vec<bool>, // of each term of elements: whether it forbids inversion
    normal: Option<NormalMatrix>,
    hessian: Option<Hessian>,
    damping: Option<StiffnessDamping>,
    contacts: Contacts,
    settings: DeformSettings,
    inertia: f64,    // that the normal matrix was factored for
    factored: usize, // refactorisations of the normal matrix when its weights were those of the start
    characteristic: f64,
    penalty: f64,        // norm of the stiffness of contact over all points
    split_contact: bool, // steps are solved by a splitting, with obstacles as a term; else by Newton's method
}

/// The stiffness of contact, in units of that of the nodes that touch. The larger, the sooner multipliers converge, and the
/// more digits a factor loses.
const PENALTY: f64 = 100.0;
/// Slips up to this part of a body's size, a step, stick.
const STICKING: f64 = 1e-5;
/// Energies of elements are exact to 1e-16 of the sum of squared weights, stiffness times volume, and Newton's method takes
/// changes below 1e-12 of an objective for rounding: this part of that sum is added to it, which is less by far where
/// steps are short.
const NOISE: f64 = 1e-4;
/// Of the tolerance, for the rounding of what is evaluated again.
const MARGIN: f64 = 0.99;
/// The gradient below this part of the characteristic one is rounding, for positions of the size of the bodies.
const ROUNDING: f64 = 1e-15;

impl Engine {
    /// For a world whose scene has these settings.
    ///
    /// # Errors
    /// A problem that cannot be solved by the method.
    pub fn new(world: &World, settings: DeformSettings, damped: bool, inertia: f64) -> Result<Self, SimulateError> {
        let Terms { terms, barriers } = world.terms()?;
        // Where materials differ, an element that may be inverted must not keep the others from converging.
        let barrier = !barriers.is_empty() && barriers.iter().all(|b| *b);
        let stiffness: f64 = terms.iter().map(|term| term.scale().weight2).sum();
        let constant = NOISE * stiffness;
        let quadratic = Quadratic { form: world.form.clone(), constant, ..Quadratic::default() };
        let x0 = world.start.clone();
        let problem = Problem { dim: 3, n_free: world.n_free, x0, terms, quadratic, barrier };
        let split_contact = !has_finish(settings.method) || problem.has_hard_sets();
        let mut engine = Engine {
            characteristic: problem.characteristic_gradient(),
            problem,
            barriers,
            normal: None,
            hessian: None,
            damping: None,
            contacts: Contacts::default(),
            penalty: 0.0,
            settings,
            inertia,
            factored: 0,
            split_contact,
        };
        engine.set_inertia(world, inertia, &world.start[..3 * world.n_free])?;
        if !split_contact && !world.obstacles.is_empty() {
            let mut stiffness = engine.problem.node_stiffness();
            stiffness.iter_mut().zip(&world.mass).for_each(|(k, m)| *k += inertia * m);
            let points = world.touching.points.clone();
            let k: Vec<f64> = shared(&points, &stiffness).map(|k| PENALTY * k).collect();
            engine.penalty = vector::norm(&k);
            let slip = world.touching.who.iter().map(|(b, _)| STICKING * world.bodies[*b].size).collect();
            engine.contacts = Contacts::new(points, k.into(), slip);
            engine.problem.quadratic.potentials.push(Arc::new(engine.contacts.clone()));
        }
        if world.n_free > 0 {
            let walls = Walls::new(world, 0.0, 0.0);
            engine.add_walls(world, &walls);
            engine.factor()?;
            if let (true, Some(normal)) = (damped, &engine.normal) {
                let none = StiffnessDamping::none(normal.matrix().0).map_err(SystemError::from)?;
                engine.problem.quadratic.potentials.push(Arc::new(none.clone()));
                engine.damping = Some(none);
            }
        }
        Ok(engine)
    }

    /// Bytes of factors.
    pub fn factor_bytes(&self) -> u64 {
        self.normal.as_ref().map_or(0, NormalMatrix::factor_bytes)
            + self.hessian.as_ref().map_or(0, Hessian::factor_bytes)
    }

    /// The terms that are bodies.
    pub fn elements(&mut self, world: &World) -> &mut [Box<dyn Term>] {
        let n = self.problem.terms.len() - usize::from(self.has_wall_term(world));
        &mut self.problem.terms[..n]
    }

    fn factor(&mut self) -> Result<(), SimulateError> {
        let name = self.settings.method;
        let single = name == MethodName::Auto || (name.is_splitting() && name.is_rotation_aware());
        let precision = if single { self.settings.admm.lbfgs().precision } else { Precision::Double };
        self.normal = Some(NormalMatrix::with_precision(&self.problem, precision)?);
        self.factored = 0;
        Ok(())
    }

    /// Whether a method has changed weights, and with them the normal matrix.
    fn is_reweighted(&self) -> bool {
        self.normal.as_ref().is_some_and(|normal| normal.refactorisations() != self.factored)
    }

    /// Makes everything as it was after [`Self::new`], in bits too, so that a run which goes on from a frame does the same:
    /// terms without what they have learnt, no factor of a Hessian.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn renew(&mut self, world: &World) -> Result<(), SimulateError> {
        self.problem.terms = world.terms()?.terms;
        self.add_walls(world, &Walls::new(world, 0.0, 0.0));
        if self.is_reweighted() {
            self.refactor()?;
        }
        if let (Some(hessian), Some(normal)) = (&mut self.hessian, &self.normal) {
            hessian.renew(&mut self.problem, normal);
        }
        Ok(())
    }

    /// New numbers in the normal matrix.
    fn refactor(&mut self) -> Result<(), SimulateError> {
        if let Some(normal) = &mut self.normal {
            normal.refactor(&self.problem)?;
            self.factored = normal.refactorisations();
        }
        Ok(())
    }

    fn set_inertia(&mut self, world: &World, inertia: f64, target: &[f64]) -> Result<(), SimulateError> {
        let stiffness = world.mass[..world.n_free].iter().map(|m| inertia * m).collect();
        let of = Inertia::new(stiffness, target.to_vec(), 3).map_err(|e| SimulateError::new(e.to_string()))?;
        self.problem.quadratic.inertia = of;
        Ok(())
    }

    /// Obstacles as the last term, where the splitting has them.
    fn add_walls(&mut self, world: &World, walls: &Walls) {
        if !self.has_wall_term(world) {
            return;
        }
        let stiffness = self.problem.node_stiffness();
        let points = (*world.touching.points).clone();
        let weight2 = shared(&points, &stiffness).map(|k| OBSTACLE_WEIGHT * k).collect();
        let size = world.bodies.iter().map(|b| b.size).fold(f64::INFINITY, f64::min);
        let term = Obstacle::new(Solids(walls.solids().to_vec()), points, weight2, size);
        self.problem.terms.push(Box::new(term));
    }

    /// Whether the problem has a term that is an obstacle.
    pub fn has_wall_term(&self, world: &World) -> bool {
        self.split_contact && !world.obstacles.is_empty() && world.n_free > 0
    }

    /// Solves a step.
    ///
    /// # Errors
    /// A system that cannot be factored. A step that does not converge is no error.
    pub fn solve(&mut self, world: &World, task: &Task<'_>, stops: &mut Stops<'_>) -> Result<Solved, SimulateError> {
        self.prepare(world, task)?;
        let bound = self.bound(task);
        if world.n_free == 0 {
            return Ok(self.nothing_to_do(task));
        }
        match self.split_contact {
            true => self.by_splitting(task, bound, stops),
            false => self.by_newton(world, task, bound, stops),
        }
    }

    fn prepare(&mut self, world: &World, task: &Task<'_>) -> Result<(), SimulateError> {
        self.set_contacts(Vec::new());
        let changed = task.inertia != self.inertia;
        if changed {
            self.set_inertia(world, task.inertia, task.target)?;
            self.inertia = task.inertia;
        } else {
            let set = self.problem.quadratic.inertia.set_target(task.target);
            set.map_err(|e| SimulateError::new(e.to_string()))?;
        }
        if self.has_wall_term(world) {
            self.problem.terms.pop();
            self.add_walls(world, task.walls);
        }
        if world.n_free == 0 {
            return Ok(());
        }
        if self.normal.is_none() {
            self.factor()?;
        } else if changed || (self.is_reweighted() && self.has_wall_term(world)) {
            self.refactor()?;
        }
        if let (Some((factor, anchor, loads)), Some(none), Some(normal)) = (&task.damping, &self.damping, &self.normal)
        {
            if self.hessian.is_none() {
                self.hessian = Some(Hessian::new(&mut self.problem, normal)?);
            }
            let pattern = normal.matrix().0;
            let damping =
                none.at(pattern, &mut self.problem, task.x, *factor, anchor.clone()).map_err(SystemError::from)?;
            if let Some(last) = self.problem.quadratic.potentials.last_mut() {
                *last = Arc::new(damping);
            }
            self.problem.quadratic.loads.clone_from(loads);
        }
        Ok(())
    }

    /// What the gradient has to be below: the tolerance times the forces at the start, of inertia and of elements, which
    /// may cancel each other, or the characteristic force if that is less.
    fn bound(&mut self, task: &Task<'_>) -> f64 {
        let n = 3 * self.problem.n_free;
        let mut inertia = vec![0.0; n];
        self.problem.quadratic.inertia.value_and_gradient(task.x, Some(&mut inertia));
        let mut rest = vec![0.0; n];
        self.problem.energy(task.x, Some(&mut rest));
        vector::add_scaled(&mut rest, -1.0, &inertia);
        let forces = vector::norm(&inertia) + vector::norm(&rest);
        let reference = if forces.is_finite() { forces.min(self.characteristic) } else { self.characteristic };
        // Rounding of positions, times the stiffness of elements, of inertia and of contact.
        let farthest = task.x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let size = vector::extent(&self.problem.x0, 3).max(f64::MIN_POSITIVE);
        let stiffness = vector::norm(self.problem.quadratic.inertia.stiffness());
        let floor = ROUNDING * (self.characteristic * (farthest / size).max(1.0) + stiffness * farthest)
            + f64::EPSILON / 2.0 * self.penalty * farthest;
        (MARGIN * self.settings.tol * reference).max(floor)
    }

    fn nothing_to_do(&self, task: &Task<'_>) -> Solved {
        Solved {
            x: task.x.to_vec(),
            status: Status::Converged,
            reason: "every vertex is held; there is nothing to move".to_string(),
            iterations: 0,
            rejected: 0,
            residuals: Residuals { primal: 0.0, dual: 0.0 },
            gradient: Some(0.0),
            bound: 0.0,
            contacts: self.contacts.with(Vec::new()),
            known: Known::new(),
        }
    }

    /// Where to begin: where everything would go by itself, unless that inverts elements of a material that forbids it, or
    /// something stands in the way.
    fn begin(&mut self, task: &Task<'_>, is_met: bool) -> Vec<f64> {
        let mut x = task.x.to_vec();
        x[..task.target.len()].copy_from_slice(task.target);
        if is_met {
            return task.x.to_vec();
        }
        let (predicted, before) = (self.problem.energy(&x, None), self.problem.energy(task.x, None));
        let worse = self.forbidden(&x) > self.forbidden(task.x);
        let lower = predicted.value <= before.value;
        let higher = before.value.is_finite() && !lower;
        if worse || higher { task.x.to_vec() } else { x }
    }

    /// A pure splitting, or one of the other methods that have no finish.
    fn by_splitting(&mut self, task: &Task<'_>, bound: f64, stops: &mut Stops<'_>) -> Result<Solved, SimulateError> {
        let hard = self.problem.has_hard_sets();
        // Facts of the methods' comparison: every step begins where it would go by itself.
        let mut x = task.x.to_vec();
        x[..task.target.len()].copy_from_slice(task.target);
        let problem = std::mem::replace(&mut self.problem, Problem::empty());
        let mut method = self.build(problem, x)?;
        let mut by_gradient = Bound(bound);
        let mut by_residual = ResidualTolerance::new(self.settings.tol);
        let converged: &mut dyn Stop = if hard { &mut by_residual } else { &mut by_gradient };
        let outcome = stops.run(method.method(), &mut [converged], self.settings.max_iters);
        let residuals = method.method().residuals();
        self.take_back(method);
        let gradient = (!hard).then(|| self.gradient(&outcome.x));
        Ok(Solved {
            status: outcome.status,
            reason: outcome.reason,
            iterations: outcome.iterations,
            rejected: outcome.rejected,
            residuals,
            gradient,
            bound,
            contacts: self.contacts.with(Vec::new()),
            known: Known::new(),
            x: outcome.x,
        })
    }

    /// The method, with the matrix of before where it can take one.
    fn build(&mut self, mut problem: Problem, x: Vec<f64>) -> Result<Running, SimulateError> {
        use MethodName::{AdmmPd, Auto as AutoName, RAdmm, WAdmm, Wrapd};
        let name = self.settings.method;
        if let (AdmmPd | RAdmm | WAdmm | Wrapd | AutoName, Some(normal)) = (name, self.normal.take()) {
            let admm = self.admm(problem, normal, x)?;
            return Ok(match name {
                AutoName => {
                    Running::Auto(Box::new(Auto::new(name.as_str().to_string(), admm, self.settings.newton.auto())))
                }
                _ => Running::Admm(Box::new(admm)),
            });
        }
        problem.x0 = x;
        Ok(Running::Other(method(problem, &self.settings)?))
    }

    fn admm(&self, problem: Problem, normal: NormalMatrix, x: Vec<f64>) -> Result<Admm, SystemError> {
        let admm = Admm::resume(problem, normal, x, admm_settings(&self.settings), 0);
        match self.settings.admm.penalty {
            PenaltyName::Weights => Ok(admm),
            PenaltyName::Safe => admm.with_safe_penalty(),
        }
    }

    fn take_back(&mut self, method: Running) {
        let back = method.give_back();
        self.problem = back.problem;
        self.normal = back.normal;
        if back.hessian.is_some() {
            self.hessian = back.hessian;
        }
    }

    /// Inverted elements of materials that forbid them.
    fn forbidden(&mut self, x: &[f64]) -> u64 {
        let terms = self.problem.terms.iter_mut().zip(&self.barriers).filter(|(_, barrier)| **barrier);
        terms.map(|(term, _)| term.energy(x, None).inverted).sum()
    }

    fn gradient(&mut self, x: &[f64]) -> f64 {
        let mut grad = vec![0.0; 3 * self.problem.n_free];
        self.problem.energy(x, Some(&mut grad));
        vector::norm(&grad)
    }

    /// Puts touches into the problem.
    fn set_contacts(&mut self, touches: Vec<proxel_model::contact::Touch>) {
        self.contacts = self.contacts.with(touches);
        if let Some(first) = self.problem.quadratic.potentials.first_mut() {
            if self.contacts.points().is_empty() {
                return;
            }
            *first = Arc::new(self.contacts.clone());
        }
    }

    /// Norm of the gradient over free nodes that no touch with a force, and no point within the tolerance of a wall, is
    /// on.
    pub fn gradient_off_contact(&mut self, x: &[f64], contacts: &Contacts) -> f64 {
        let mut grad = vec![0.0; 3 * self.problem.n_free];
        self.problem.energy(x, Some(&mut grad));
        for touch in contacts.touches() {
            if contacts.pressure(touch, x) > 0.0 {
                for node in contacts.points().parts(touch.point as usize).0 {
                    if let Some(g) = grad.get_mut(3 * *node as usize..3 * *node as usize + 3) {
                        g.fill(0.0);
                    }
                }
            }
        }
        vector::norm(&grad)
    }

    /// How far limited stretches are beyond their limits, at most.
    pub fn strain_violation(&mut self, world: &World, x: &[f64]) -> f64 {
        let terms = self.elements(world);
        terms.iter_mut().map(|term| term.energy(x, None).violation).fold(0.0, |a, b| if b <= a { a } else { b })
    }
}
