//! Newton's method on an augmented Lagrangian of contact and of hard limits.

use super::prelude::Prelude;
use super::{Engine, Forces, How, Solved, Task};
use crate::deform::{REFUSALS, admm_settings};
use crate::settings::MethodName;
use crate::simulate::SimulateError;
use crate::simulate::contact::{Grips, WorkingSet, is_complementary, learn};
use crate::simulate::stops::{Bound, Stops};
use crate::simulate::world::World;
use proxel_model::contact::Contacts;
use proxel_split::{
    Admm, Auto, Hessian, LinearSolver, Newton, NewtonSettings, NoProgress, NormalMatrix, Outcome, Parts, Price,
    Problem, Status, VIOLATION, solver_for,
};

/// Renewals of planes and forces in a step.
const RENEWALS: usize = 200;
/// A set of planes is looked through for those that are not touched once this part of the gradient is left;
const SETTLED: f64 = 0.1;
/// after so many changes only once it is solved.
const LOOSE: usize = 2;
/// Renewals after which friction learns of forces at anchors only: with every renewal it may go to and fro.
const RUBBING: usize = 30;
/// After these it stays as it is, so that there is a minimum to find.
const GRIPPING: usize = 120;
/// With hard limits, whose multipliers need more of them.
const RENEWALS_OF_LIMITS: usize = 400;
/// Limits are held more stiffly by this factor where a renewal has left more than `LAGGING` of how far their multipliers were
/// off, up to `STIFFEST` times.
const STIFFER: f64 = 4.0;
const LAGGING: f64 = 0.3;
const STIFFEST: f64 = 1e4;
/// Where Newton finds no way on, its changes having drowned in rounding of limits held so stiffly, they are held less stiffly by
/// this factor, and never again as stiffly as they were.
const SOFTER: f64 = 16.0;
/// Rounds that Newton may leave without progress while planes and forces still change.
const PATIENCE: usize = 4;
/// With hard limits, which are held less stiffly then.
const PATIENCE_OF_LIMITS: usize = 12;
/// Under contact `tol` is at most this: which planes are pressed on cannot be told from forces that are off by more.
const SETTLED_TOL: f64 = 1e-4;
/// Part of the gradient that is left when planes and forces are renewed.
const INNER: f64 = 0.05;

/// A place with all points outside of obstacles, and what is known there.
struct Best {
    gradient: f64,
    x: Vec<f64>,
    contacts: Contacts,
}

impl Engine {
    /// Newton's method on an augmented Lagrangian of contact and of hard limits: planes, forces and stresses are renewed
    /// between its runs.
    pub(super) fn by_newton(
        &mut self,
        world: &World,
        task: &Task<'_>,
        forces: Forces,
        stops: &mut Stops<'_>,
    ) -> Result<Solved, SimulateError> {
        let mut whole = task.x.to_vec();
        whole[..task.target.len()].copy_from_slice(task.target);
        let walled = !world.obstacles.is_empty();
        let mut working = WorkingSet::new(world, task.walls, task.x);
        let touches = if walled { working.first(world, task.walls, &whole, task.known) } else { Vec::new() };
        let is_met = !touches.is_empty();
        self.set_contacts(touches);
        let (mut before, mut growth, mut stiffest) = (f64::INFINITY, 1.0, STIFFEST);
        let (mut settled, mut stresses) = (false, Vec::new());
        let mut x = self.begin(task, is_met);
        let (mut iterations, mut rejected, mut rescued, mut stuck) = (0, 0, false, 0);
        let (mut status, mut reason) = (Status::Stopped, String::new());
        let (mut most, mut changes, mut best): (f64, usize, Option<Best>) = (0.0, 0, None);
        let tol = self.settings.tol;
        let mut bound = forces.bound(tol);
        let renewals = if self.strain.is_some() { RENEWALS_OF_LIMITS } else { RENEWALS };
        for renewal in 0..renewals {
            let left = self.settings.max_iters.saturating_sub(iterations);
            if !self.contacts.touches().is_empty() {
                bound = forces.bound(tol.min(SETTLED_TOL));
            }
            let inner = match self.is_constrained() && !(settled && self.contacts.touches().is_empty()) {
                true => bound.max(INNER * self.gradient(&x)),
                false => bound,
            };
            let tangled = self.forbidden(&x) > 0;
            let outcome = match tangled && self.settings.method == MethodName::Auto && !rescued {
                true => {
                    rescued = true;
                    self.run_auto(x, inner, left, stops)?
                }
                false => match self.prelude(x, inner, left, stops)? {
                    Prelude::Done(outcome) => *outcome,
                    Prelude::From(x, so_far) => {
                        let mut outcome = self.run_newton(x, inner, left - so_far.min(left), stops)?;
                        outcome.iterations += so_far;
                        outcome
                    }
                },
            };
            iterations += outcome.iterations;
            rejected += outcome.rejected;
            x = outcome.x;
            (status, reason) = (outcome.status, outcome.reason);
            if matches!(status, Status::Cancelled | Status::Failed) || stops.is_over() {
                break;
            }
            let mut is_outside = true;
            if walled && task.walls.rub() && [RUBBING, GRIPPING].contains(&renewal) {
                working.set_grips(if renewal == RUBBING { Grips::AtAnchors } else { Grips::Kept });
                // Whatever comes of it is to be preferred.
                if let Some(best) = &mut best {
                    best.gradient = f64::INFINITY;
                }
            }
            if walled {
                let renewed = working.renew(world, task.walls, &self.contacts, &x);
                self.set_contacts(renewed.touches);
                is_outside = renewed.changed == 0 && renewed.depth <= VIOLATION;
            }
            let mut gradient = self.gradient(&x);
            most = gradient.max(most);
            let is_solved = gradient <= bound || (gradient <= SETTLED * most && changes < LOOSE);
            if walled && is_outside && is_solved {
                let accepted = working.accept(world, task.walls, &self.contacts, &x);
                self.set_contacts(accepted.touches);
                changes += usize::from(accepted.changed > 0);
                gradient = self.gradient(&x);
                most = gradient;
                is_outside = is_complementary(world, task.walls, &self.contacts, &x);
                if best.as_ref().is_none_or(|best| gradient <= best.gradient) {
                    best = Some(Best { gradient, x: x.clone(), contacts: self.contacts.clone() });
                }
            }
            let inverted = self.forbidden(&x) > 0;
            let renewed = self.strain.as_ref().map(|strain| strain.renewed(&x));
            let off = renewed.as_ref().map_or(0.0, |(_, off)| *off);
            settled = off <= VIOLATION;
            if let Some((strain, _)) = &renewed {
                stresses = strain.multipliers();
            }
            let held = settled && self.strain_violation(&x) <= VIOLATION;
            if gradient <= bound && !inverted && held && is_outside {
                if renewal >= GRIPPING && task.walls.rub() {
                    let touches = self.contacts.touches().to_vec();
                    self.set_contacts(task.walls.gripping(&touches));
                    let off = self.gradient(&x);
                    self.set_contacts(touches);
                    if off > bound || off.is_nan() {
                        status = Status::Stopped;
                        reason = format!(
                            "friction did not settle: forces are balanced with that of earlier normal forces, and off \
                             by {off:e} with that of the last ones ({bound:e} is asked)"
                        );
                        break;
                    }
                }
                status = Status::Converged;
                reason = format!("gradient {gradient:e} is at most {bound:e}, forces of contact included");
                break;
            }
            if let Some((strain, off)) = renewed {
                let lags = off > LAGGING * before && !settled && growth < stiffest;
                let factor = match status == Status::Stopped && growth > 1.0 {
                    true => (1.0 / SOFTER).max(1.0 / growth),
                    false if lags => STIFFER,
                    false => 1.0,
                };
                if factor < 1.0 {
                    stiffest = growth / STIFFER;
                }
                (before, growth) = (off, growth * factor);
                self.set_strain(strain.stiffer(factor));
            }
            if iterations >= self.settings.max_iters {
                (status, reason) = (Status::Stopped, format!("{iterations} iterations done (max_iters)"));
                break;
            }
            stuck += usize::from(status == Status::Stopped || inverted);
            let touching = self.is_constrained();
            let patience = match (touching, self.strain.is_some()) {
                (_, true) => PATIENCE_OF_LIMITS,
                (true, false) => PATIENCE,
                (false, false) => 0,
            };
            if stuck > patience {
                // Newton finds no way on: the splitting may, once, where nothing touches.
                if rescued || touching || self.settings.method != MethodName::Auto {
                    status = Status::Stopped;
                    break;
                }
                (rescued, stuck) = (true, 0);
                let outcome = self.run_auto(x, bound, self.settings.max_iters - iterations, stops)?;
                iterations += outcome.iterations;
                rejected += outcome.rejected;
                x = outcome.x;
            }
            (status, reason) =
                (Status::Stopped, format!("forces of contact and of limits did not settle in {} rounds", renewal + 1));
        }
        if let Some(best) = best.filter(|_| status != Status::Converged && self.strain.is_none()) {
            // Outside of all obstacles, which what came after need not be.
            x = best.x;
            self.set_contacts(best.contacts.touches().to_vec());
        }
        let known = learn(&self.contacts, &x);
        Ok(Solved {
            gradient: Some(self.gradient(&x)),
            x,
            status,
            reason,
            iterations,
            rejected,
            residuals: None,
            local_dim: 0,
            bound,
            contacts: self.contacts.clone(),
            known,
            stresses,
        })
    }

    /// Whether multipliers are to be renewed.
    fn is_constrained(&self) -> bool {
        !self.contacts.touches().is_empty() || self.strain.is_some()
    }

    fn newton_settings(&self, normal: &NormalMatrix) -> NewtonSettings {
        let of = self.settings.newton.of(self.settings.method);
        if self.settings.method != MethodName::Auto {
            return of;
        }
        let (price, cost) = Price::of(&self.problem, normal);
        let solver: LinearSolver = solver_for(&price, &cost, of.memory);
        NewtonSettings { solver, ..of }
    }

    fn run_newton(
        &mut self,
        x: Vec<f64>,
        bound: f64,
        limit: usize,
        stops: &mut Stops<'_>,
    ) -> Result<Outcome, SimulateError> {
        let (normal, hessian) = self.take_matrices()?;
        let settings = self.newton_settings(&normal);
        let mut problem = std::mem::replace(&mut self.problem, Problem::empty());
        let hessian = match hessian {
            Some(hessian) => hessian,
            None => Hessian::new(&mut problem, &normal)?,
        };
        let mut newton = Newton::resume_with(problem, normal, hessian, x, settings, 0);
        let (mut converged, mut stuck) = (Bound(bound), NoProgress::new(REFUSALS));
        let outcome = stops.run(&mut newton, &mut [&mut converged, &mut stuck], limit);
        let (problem, normal, _, hessian) = newton.into_parts_with_hessian();
        self.put_back(problem, normal, Some(hessian));
        Ok(outcome)
    }

    /// The splitting, then Newton, as they find it: out of inverted elements.
    fn run_auto(
        &mut self,
        x: Vec<f64>,
        bound: f64,
        limit: usize,
        stops: &mut Stops<'_>,
    ) -> Result<Outcome, SimulateError> {
        let (normal, _) = self.take_matrices()?;
        self.wear();
        let problem = std::mem::replace(&mut self.problem, Problem::empty());
        let admm = Admm::resume(problem, normal, x, admm_settings(&self.settings), 0);
        let name = self.settings.method.as_str().to_string();
        let mut auto = Auto::new(name, admm, self.settings.newton.auto());
        let (mut converged, mut stuck) = (Bound(bound), NoProgress::new(REFUSALS));
        let outcome = stops.run(&mut auto, &mut [&mut converged, &mut stuck], limit);
        let Some(Parts { problem, normal, hessian, .. }) = auto.into_parts() else {
            return Err(SimulateError::new(format!("a step failed: {}", outcome.reason)));
        };
        self.put_back(problem, normal, hessian);
        Ok(outcome)
    }

    pub(super) fn take_matrices(&mut self) -> Result<(NormalMatrix, Option<Hessian>), SimulateError> {
        if let How::Newton(matrices) = &mut self.how
            && let Some(normal) = matrices.normal.take()
        {
            return Ok((normal, matrices.hessian.take()));
        }
        Err(SimulateError::new("a step lost its matrix; begin the simulation anew".into()))
    }

    /// Terms will have to be made anew before the next step.
    pub(super) fn wear(&mut self) {
        if let How::Newton(matrices) = &mut self.how {
            matrices.worn = true;
        }
    }

    pub(super) fn put_back(&mut self, problem: Problem, normal: NormalMatrix, hessian: Option<Hessian>) {
        self.problem = problem;
        self.return_matrices(normal, hessian);
    }

    /// Where the problem was not taken.
    pub(super) fn return_matrices(&mut self, normal: NormalMatrix, hessian: Option<Hessian>) {
        if let How::Newton(matrices) = &mut self.how {
            matrices.normal = Some(normal);
            matrices.hessian = hessian;
        }
    }
}
