//! Newton's method on an augmented Lagrangian of contact.

use super::running::Running;
use super::{Engine, Solved, Task};
use crate::deform::REFUSALS;
use crate::settings::MethodName;
use crate::simulate::SimulateError;
use crate::simulate::contact::learn;
use crate::simulate::stops::{Bound, Stops};
use crate::simulate::world::World;
use proxel_split::{
    Auto, Hessian, LinearSolver, Newton, NewtonSettings, NoProgress, NormalMatrix, Outcome, Price, Problem, Residuals,
    Status, solver_for,
};

/// Renewals of planes and forces in a step.
const RENEWALS: usize = 60;
/// Rounds that Newton may leave without progress while planes and forces still change.
const PATIENCE: usize = 4;
/// Part of the gradient that is left when planes and forces are renewed.
const INNER: f64 = 0.05;

impl Engine {
    /// Newton's method on an augmented Lagrangian of contact, whose planes and forces are renewed between its runs.
    pub(super) fn by_newton(
        &mut self,
        world: &World,
        task: &Task<'_>,
        bound: f64,
        stops: &mut Stops<'_>,
    ) -> Result<Solved, SimulateError> {
        let mut whole = task.x.to_vec();
        whole[..task.target.len()].copy_from_slice(task.target);
        let touches = match world.obstacles.is_empty() {
            true => Vec::new(),
            false => task.walls.meet(world, task.x, &whole, task.known),
        };
        let is_met = !touches.is_empty();
        self.set_contacts(touches);
        let mut x = self.begin(task, is_met);
        let (mut iterations, mut rejected, mut rescued, mut stuck) = (0, 0, false, 0);
        let (mut status, mut reason) = (Status::Stopped, String::new());
        for renewal in 0..RENEWALS {
            let left = self.settings.max_iters.saturating_sub(iterations);
            let inner = if self.contacts.touches().is_empty() { bound } else { bound.max(INNER * self.gradient(&x)) };
            let tangled = self.forbidden(&x) > 0;
            let outcome = match tangled && self.settings.method == MethodName::Auto && !rescued {
                true => {
                    rescued = true;
                    self.run_auto(x, inner, left, stops)?
                }
                false => self.run_newton(x, inner, left, stops)?,
            };
            iterations += outcome.iterations;
            rejected += outcome.rejected;
            x = outcome.x;
            (status, reason) = (outcome.status, outcome.reason);
            if matches!(status, Status::Cancelled | Status::Failed) || stops.is_over() {
                break;
            }
            if !world.obstacles.is_empty() {
                let touches = task.walls.renew(world, &self.contacts, &x, task.x);
                self.set_contacts(touches);
            }
            let gradient = self.gradient(&x);
            let inverted = self.forbidden(&x) > 0;
            if gradient <= bound && !inverted {
                status = Status::Converged;
                reason = format!("gradient {gradient:e} is at most {bound:e}, forces of contact included");
                break;
            }
            if iterations >= self.settings.max_iters {
                (status, reason) = (Status::Stopped, format!("{iterations} iterations done (max_iters)"));
                break;
            }
            stuck += usize::from(status == Status::Stopped || inverted);
            let touching = !self.contacts.touches().is_empty();
            if stuck > if touching { PATIENCE } else { 0 } {
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
            (status, reason) = (Status::Stopped, format!("forces of contact did not settle in {} rounds", renewal + 1));
        }
        let known = learn(&self.contacts, &x);
        Ok(Solved {
            gradient: Some(self.gradient(&x)),
            x,
            status,
            reason,
            iterations,
            rejected,
            residuals: Residuals { primal: f64::INFINITY, dual: f64::INFINITY },
            bound,
            contacts: self.contacts.clone(),
            known,
        })
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
        let Some(normal) = self.normal.take() else { return Err(SimulateError::new("a step lost its matrix".into())) };
        let settings = self.newton_settings(&normal);
        let mut problem = std::mem::replace(&mut self.problem, Problem::empty());
        let hessian = match self.hessian.take() {
            Some(hessian) => hessian,
            None => Hessian::new(&mut problem, &normal)?,
        };
        let mut newton = Newton::resume_with(problem, normal, hessian, x, settings, 0);
        let (mut converged, mut stuck) = (Bound(bound), NoProgress::new(REFUSALS));
        let outcome = stops.run(&mut newton, &mut [&mut converged, &mut stuck], limit);
        let (problem, normal, _, hessian) = newton.into_parts_with_hessian();
        (self.problem, self.normal, self.hessian) = (problem, Some(normal), Some(hessian));
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
        let problem = std::mem::replace(&mut self.problem, Problem::empty());
        let Some(normal) = self.normal.take() else { return Err(SimulateError::new("a step lost its matrix".into())) };
        let admm = self.admm(problem, normal, x)?;
        let name = self.settings.method.as_str().to_string();
        let mut auto = Running::Auto(Box::new(Auto::new(name, admm, self.settings.newton.auto())));
        let (mut converged, mut stuck) = (Bound(bound), NoProgress::new(REFUSALS));
        let outcome = stops.run(auto.method(), &mut [&mut converged, &mut stuck], limit);
        self.take_back(auto);
        Ok(outcome)
    }
}
