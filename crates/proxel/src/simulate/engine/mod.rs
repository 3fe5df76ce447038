//! The problem of a step and what solves it: the parts that steps have in common are kept.

mod newton;
mod prelude;
mod splitting;

use super::contact::{Known, Walls};
use super::damping::StiffnessDamping;
use super::stops::Stops;
use super::world::{Hold, Terms, World};
use super::{SimulateError, SolverSpec, has_finish};
use crate::deform::constraints::shared;
use crate::settings::{DeformSettings, MethodName};
use proxel_model::contact::Contacts;
use proxel_model::strain_limit::StrainLimits;
use proxel_split::{
    EnergyReport, Hessian, Inertia, NormalMatrix, Potential, Precision, Problem, Quadratic, SquaredResiduals, Status,
    SystemError, Term, vector,
};
use splitting::Splitting;
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
    /// Stresses that held elements within their limits then; none at first.
    pub stresses: &'a [f64],
}

/// How a step ended.
pub(super) struct Solved {
    pub x: Vec<f64>,
    pub status: Status,
    pub reason: String,
    pub iterations: usize,
    pub rejected: usize,
    /// Of the splitting, and numbers in its z; none where nothing was split.
    pub residuals: Option<SquaredResiduals>,
    pub local_dim: usize,
    /// Norm of the gradient over free nodes, forces of contact included, and what convergence asks of it; none for hard
    /// sets that are split off.
    pub gradient: Option<f64>,
    pub bound: f64,
    /// Forces between points and walls.
    pub contacts: Contacts,
    pub known: Known,
    /// Stresses that hold elements within their limits.
    pub stresses: Vec<f64>,
}

/// Solves steps of a world.
pub(super) struct Engine {
    problem: Problem,              // what is minimised, without sets: elements, inertia, potentials
    barriers: Vec<bool>,           // of each term: whether it forbids inversion
    limits: Vec<Option<[f64; 2]>>, // of each term
    how: How,
    damping: Option<StiffnessDamping>,
    contacts: Contacts,
    strain: Option<StrainLimits>, // hard limits, for Newton's method
    settings: DeformSettings,
    inertia: f64, // of the problem
    characteristic: f64,
    penalty: f64,              // norm of the stiffness of contact over all points, and of limits
    mean_edge: f64,            // at rest
    start: EnergyReport,       // of the problem at the start of the step
    upright: Option<Vec<f64>>, // the last positions that were seen to have no inverted elements
}

/// What gradients are measured by.
#[derive(Clone, Copy, Debug)]
struct Forces {
    reference: f64,
    floor: f64, // below it is rounding
}

impl Forces {
    /// What the gradient has to be below: the tolerance times the forces.
    fn bound(&self, tol: f64) -> f64 {
        (MARGIN * tol * self.reference).max(self.floor)
    }
}

/// How steps are solved.
enum How {
    /// By Newton's method, with contact as a potential.
    Newton(Box<Matrices>),
    /// By a splitting, with obstacles and limits as sets, or by a method that has neither.
    Splitting(Box<Splitting>),
}

/// What Newton's method keeps from step to step.
#[derive(Default)]
struct Matrices {
    normal: Option<NormalMatrix>, // none where every node is held
    hessian: Option<Hessian>,
    factored: usize, // refactorisations of the normal matrix when its weights were those of the start
    worn: bool,      // whether a splitting has been at work: terms remember it
}

/// The stiffness of contact, in units of that of the nodes that touch. The larger, the sooner multipliers converge, and the
/// more digits a factor loses.
const PENALTY: f64 = 100.0;
/// The stiffness of hard limits, in units of that of the nodes of an element.
const HOLD: f64 = 100.0;
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
    pub fn new(
        world: &World,
        settings: DeformSettings,
        solver: &SolverSpec,
        damped: bool,
        inertia: f64,
    ) -> Result<Self, SimulateError> {
        let Terms { terms, barriers, limits } = world.terms(Hold::Not)?;
        // Where materials differ, an element that may be inverted must not keep the others from converging.
        let barrier = !barriers.is_empty() && barriers.iter().all(|b| *b);
        let stiffness: f64 = terms.iter().map(|term| term.scale().weight2).sum();
        let constant = NOISE * stiffness;
        let mut quadratic = Quadratic { form: world.form.clone(), constant, ..Quadratic::default() };
        quadratic.inertia = inertia_of(world, inertia, &world.start[..3 * world.n_free])?;
        let x0 = world.start.clone();
        let problem = Problem { dim: 3, n_free: world.n_free, x0, terms, quadratic, barrier };
        let how = match has_finish(settings.method) || world.n_free == 0 {
            true => How::Newton(Box::default()),
            false => {
                let (x0, quadratic) = (problem.x0.clone(), problem.quadratic.clone());
                let split = Problem { dim: 3, n_free: world.n_free, x0, terms: Vec::new(), quadratic, barrier };
                How::Splitting(Box::new(Splitting::new(world, &settings, solver, split, inertia)?))
            }
        };
        let mut engine = Engine {
            characteristic: problem.characteristic_gradient(),
            problem,
            barriers,
            limits,
            how,
            damping: None,
            contacts: Contacts::default(),
            strain: None,
            penalty: 0.0,
            settings,
            inertia,
            mean_edge: world.mean_edge(),
            start: EnergyReport::default(),
            upright: None,
        };
        if matches!(engine.how, How::Newton(_)) && world.n_free > 0 {
            engine.prepare_newton(world, damped)?;
        }
        Ok(engine)
    }

    /// Matrices and potentials for Newton's method.
    fn prepare_newton(&mut self, world: &World, damped: bool) -> Result<(), SimulateError> {
        let mut stiffness = self.problem.node_stiffness();
        stiffness.iter_mut().zip(&world.mass).for_each(|(k, m)| *k += self.inertia * m);
        if !world.obstacles.is_empty() {
            let points = world.touching.points.clone();
            let k: Vec<f64> = shared(&points, &stiffness).map(|k| PENALTY * k).collect();
            self.penalty = vector::norm(&k);
            let slip = world.touching.who.iter().map(|(b, _)| STICKING * world.bodies[*b].size).collect();
            self.contacts = Contacts::new(points, k.into(), slip);
            self.problem.quadratic.potentials.push(Arc::new(self.contacts.clone()));
        }
        let limited = world.limited()?;
        if !limited.is_empty() {
            let strain = StrainLimits::new(limited, &stiffness, HOLD);
            self.penalty = self.penalty.hypot(strain.penalty());
            let buckling = strain.buckling();
            self.problem.quadratic.potentials.push(Arc::new(strain.clone()));
            self.problem.quadratic.potentials.push(Arc::new(buckling));
            self.strain = Some(strain);
        }
        let normal = self.factor()?;
        if damped {
            let none = StiffnessDamping::none(normal.matrix().0).map_err(SystemError::from)?;
            self.problem.quadratic.potentials.push(Arc::new(none.clone()));
            self.damping = Some(none);
        }
        self.how = How::Newton(Box::new(Matrices { normal: Some(normal), ..Matrices::default() }));
        Ok(())
    }

    /// Bytes of factors.
    pub fn factor_bytes(&self) -> u64 {
        match &self.how {
            How::Splitting(splitting) => splitting.factor_bytes(),
            How::Newton(matrices) => {
                matrices.normal.as_ref().map_or(0, NormalMatrix::factor_bytes)
                    + matrices.hessian.as_ref().map_or(0, Hessian::factor_bytes)
            }
        }
    }

    /// The terms, all of them elements of bodies.
    pub fn elements(&mut self) -> &mut [Box<dyn Term>] {
        &mut self.problem.terms
    }

    /// The mean length of all edges of elements at rest.
    pub fn mean_edge(&self) -> f64 {
        self.mean_edge
    }

    fn factor(&self) -> Result<NormalMatrix, SimulateError> {
        let single = self.settings.method == MethodName::Auto;
        let precision = if single { self.settings.admm.lbfgs().precision } else { Precision::Double };
        Ok(NormalMatrix::with_precision(&self.problem, precision)?)
    }

    /// Makes everything as it was after [`Self::new`], in bits too, so that a run which goes on from a frame does the same:
    /// terms without what they have learnt, no factor of a Hessian.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn renew(&mut self, world: &World) -> Result<(), SimulateError> {
        let Matrices { normal, hessian, factored, worn } = match &mut self.how {
            How::Splitting(splitting) => return splitting.renew(world),
            How::Newton(matrices) => &mut **matrices,
        };
        // Newton's method leaves terms as they were.
        if std::mem::take(worn) {
            self.problem.terms = world.terms(Hold::Not)?.terms;
        }
        let Some(normal) = normal else { return Ok(()) };
        if normal.refactorisations() != *factored {
            // A splitting on the way has changed weights.
            normal.refactor(&self.problem)?;
            *factored = normal.refactorisations();
        }
        if let Some(hessian) = hessian {
            hessian.renew(&mut self.problem, normal);
        }
        Ok(())
    }

    /// Whether the problem has a term that is an obstacle.
    pub fn has_wall_term(&self) -> bool {
        matches!(&self.how, How::Splitting(splitting) if splitting.has_walls())
    }

    /// Solves a step.
    ///
    /// # Errors
    /// A system that cannot be factored. A step that does not converge is no error.
    pub fn solve(&mut self, world: &World, task: &Task<'_>, stops: &mut Stops<'_>) -> Result<Solved, SimulateError> {
        self.prepare(world, task)?;
        let forces = self.forces(task);
        let bound = forces.bound(self.settings.tol);
        if world.n_free == 0 {
            return Ok(self.nothing_to_do(task));
        }
        let How::Splitting(splitting) = &mut self.how else { return self.by_newton(world, task, forces, stops) };
        let mut solved = splitting.solve(world, task, bound, (&self.settings, &self.contacts), stops)?;
        if !splitting.is_hard() {
            solved.gradient = Some(self.gradient(&solved.x));
        }
        Ok(solved)
    }

    fn prepare(&mut self, world: &World, task: &Task<'_>) -> Result<(), SimulateError> {
        self.set_contacts(Vec::new());
        // What is held as in the step before, whatever this engine has solved since: the forces at the start depend on it.
        if let Some(strain) = &self.strain {
            let known = strain.with(task.stresses).unwrap_or_else(|| strain.forgotten());
            self.set_strain(known);
        }
        let changed = task.inertia != self.inertia;
        if changed {
            self.problem.quadratic.inertia = inertia_of(world, task.inertia, task.target)?;
            self.inertia = task.inertia;
        } else {
            let set = self.problem.quadratic.inertia.set_target(task.target);
            set.map_err(|e| SimulateError::new(e.to_string()))?;
        }
        let How::Newton(matrices) = &mut self.how else { return Ok(()) };
        let Matrices { normal: Some(normal), hessian, factored, .. } = &mut **matrices else { return Ok(()) };
        if changed {
            normal.refactor(&self.problem)?;
            *factored = normal.refactorisations();
        }
        if let (Some((factor, anchor, loads)), Some(none)) = (&task.damping, &self.damping) {
            if hessian.is_none() {
                *hessian = Some(Hessian::new(&mut self.problem, normal)?);
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

    /// The forces at the start, of inertia and of elements, which may cancel each other, or the characteristic force if
    /// that is less.
    fn forces(&mut self, task: &Task<'_>) -> Forces {
        let n = 3 * self.problem.n_free;
        let mut inertia = vec![0.0; n];
        self.problem.quadratic.inertia.value_and_gradient(task.x, Some(&mut inertia));
        let mut rest = vec![0.0; n];
        self.start = self.problem.energy(task.x, Some(&mut rest));
        vector::add_scaled(&mut rest, -1.0, &inertia);
        let forces = vector::norm(&inertia) + vector::norm(&rest);
        let reference = if forces.is_finite() { forces.min(self.characteristic) } else { self.characteristic };
        // Rounding of positions, times the stiffness of elements, of inertia and of contact.
        let farthest = task.x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let size = vector::extent(&self.problem.x0, 3).max(f64::MIN_POSITIVE);
        let stiffness = vector::norm(self.problem.quadratic.inertia.stiffness());
        let floor = ROUNDING * (self.characteristic * (farthest / size).max(1.0) + stiffness * farthest)
            + f64::EPSILON / 2.0 * self.penalty * farthest;
        Forces { reference, floor }
    }

    fn nothing_to_do(&self, task: &Task<'_>) -> Solved {
        Solved {
            x: task.x.to_vec(),
            status: Status::Converged,
            reason: "every vertex is held; there is nothing to move".to_string(),
            iterations: 0,
            rejected: 0,
            residuals: None,
            local_dim: 0,
            gradient: Some(0.0),
            bound: 0.0,
            contacts: self.contacts.with(Vec::new()),
            known: Known::new(),
            stresses: Vec::new(),
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
        let (predicted, before) = (self.problem.energy(&x, None), self.start);
        self.note(&x, &predicted);
        let worse = predicted.inverted > 0 && self.forbidden(&x) > self.forbidden(task.x);
        let lower = predicted.value <= before.value;
        let higher = before.value.is_finite() && !lower;
        if worse || higher { task.x.to_vec() } else { x }
    }

    /// Inverted elements of materials that forbid them.
    fn forbidden(&mut self, x: &[f64]) -> u64 {
        if self.upright.as_deref() == Some(x) {
            return 0;
        }
        let terms = self.problem.terms.iter_mut().zip(&self.barriers).filter(|(_, barrier)| **barrier);
        terms.map(|(term, _)| term.energy(x, None).inverted).sum()
    }

    fn gradient(&mut self, x: &[f64]) -> f64 {
        let mut grad = vec![0.0; 3 * self.problem.n_free];
        let report = self.problem.energy(x, Some(&mut grad));
        self.note(x, &report);
        vector::norm(&grad)
    }

    /// Keeps in mind where nothing is inverted.
    fn note(&mut self, x: &[f64], report: &EnergyReport) {
        if report.inverted == 0 {
            let upright = self.upright.get_or_insert_default();
            upright.clear();
            upright.extend_from_slice(x);
        }
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

    /// Puts limits into the problem: after contact.
    fn set_strain(&mut self, strain: StrainLimits) {
        let at = usize::from(!self.contacts.points().is_empty());
        if let Some([limits, buckling]) = self.problem.quadratic.potentials.get_mut(at..at + 2) {
            (*limits, *buckling) = (Arc::new(strain.clone()), Arc::new(strain.buckling()));
            self.strain = Some(strain);
        }
    }

    /// Adds the forces of hard limits to a gradient.
    pub fn add_forces_of_limits(&self, x: &[f64], grad: &mut [f64]) {
        if let Some(strain) = &self.strain {
            strain.value_and_gradient(x, Some(grad));
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
    pub fn strain_violation(&mut self, x: &[f64]) -> f64 {
        let terms = self.problem.terms.iter_mut().zip(&self.limits);
        let beyond = terms.filter_map(|(term, limits)| {
            let ([low, high], report) = ((*limits)?, term.energy(x, None));
            let (below, above) = (low - report.min_stretch, report.max_stretch - high);
            Some(if below.is_nan() || above.is_nan() { f64::INFINITY } else { below.max(above) })
        });
        beyond.fold(0.0, f64::max)
    }
}

/// Inertia of this stiffness over mass.
fn inertia_of(world: &World, inertia: f64, target: &[f64]) -> Result<Inertia, SimulateError> {
    let stiffness = world.mass[..world.n_free].iter().map(|m| inertia * m).collect();
    Inertia::new(stiffness, target.to_vec(), 3).map_err(|e| SimulateError::new(e.to_string()))
}
