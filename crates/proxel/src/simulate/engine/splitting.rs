//! Steps by a splitting, or by another method without a finish: one method for all of them, whose matrix is factored once for
//! each length of a step.

use super::{Solved, Task};
use crate::deform::constraints::{OBSTACLE_WEIGHT, shared};
use crate::deform::{method, splitting};
use crate::settings::{DeformSettings, MethodName};
use crate::simulate::SimulateError;
use crate::simulate::contact::{Known, Walls};
use crate::simulate::scene::{AccelerateName, SolverSpec};
use crate::simulate::stops::{Bound, Stops};
use crate::simulate::world::{Hold, World};
use proxel_model::contact::Contacts;
use proxel_model::obstacle::{Obstacle, Solids};
use proxel_split::{Admm, Algorithm, Inertia, Method, Outcome, Problem, ResidualTolerance, Stop, SystemError, Term};

/// A method, from step to step.
pub(super) struct Splitting {
    method: Box<dyn Method>,
    walls: bool,                       // obstacles are its last term
    hard: bool,                        // it has hard sets
    inertia: f64,                      // that its matrix was factored for
    reweighted: bool,                  // its weights are no longer those of the start
    fresh: Option<Vec<Box<dyn Term>>>, // terms that the next step begins with
}

impl Splitting {
    /// For a problem that has inertia, but neither elements nor obstacles yet.
    ///
    /// # Errors
    /// A problem that cannot be solved by the method; a system that cannot be factored.
    pub fn new(
        world: &World,
        settings: &DeformSettings,
        solver: &SolverSpec,
        mut problem: Problem,
        inertia: f64,
    ) -> Result<Self, SimulateError> {
        problem.terms = world.terms(Hold::AsSets)?.terms;
        let walls = !world.obstacles.is_empty();
        if walls {
            let term = wall(world, &Walls::new(world, 0.0, 0.0), &problem);
            problem.terms.push(term);
        }
        let hard = problem.has_hard_sets();
        let method = match settings.method {
            MethodName::Lbfgs | MethodName::Bcqn => method(problem, settings)?,
            _ => accelerated(splitting(problem, settings)?, solver, hard)
                .map_err(|e| SimulateError::new(format!("solver: {e}")))?,
        };
        Ok(Splitting { method, walls, hard, inertia, reweighted: false, fresh: None })
    }

    /// Whether obstacles are a term.
    pub fn has_walls(&self) -> bool {
        self.walls
    }

    /// Bytes of the factor.
    pub fn factor_bytes(&self) -> u64 {
        self.method.factor_bytes()
    }

    /// The next step begins with elements that have learnt nothing, as the first one did.
    ///
    /// # Errors
    /// As [`World::terms`].
    pub fn renew(&mut self, world: &World) -> Result<(), SimulateError> {
        self.fresh = Some(world.terms(Hold::AsSets)?.terms);
        Ok(())
    }

    /// Goes on to the problem of a step.
    fn begin(&mut self, world: &World, task: &Task<'_>) -> Result<(), SimulateError> {
        let fresh = self.fresh.take();
        let stiffer = task.inertia != self.inertia;
        let refactor = stiffer || (self.reweighted && (fresh.is_some() || self.walls));
        let masses = || world.mass[..world.n_free].iter().map(|m| task.inertia * m).collect();
        let inertia = stiffer.then(|| Inertia::new(masses(), task.target.to_vec(), 3)).transpose();
        let mut inertia = inertia.map_err(|e| SimulateError::new(e.to_string()))?;
        // Facts of the methods' comparison: every step begins where it would go by itself.
        let mut x = task.x.to_vec();
        x[..task.target.len()].copy_from_slice(task.target);
        let (mut fresh, mut moved, walls) = (fresh, Ok(()), self.walls);
        self.method.begin(&x, false, &mut |problem| {
            if walls {
                problem.terms.pop();
            }
            if let Some(terms) = fresh.take() {
                problem.terms = terms;
            }
            if walls {
                let term = wall(world, task.walls, problem);
                problem.terms.push(term);
            }
            problem.x0.copy_from_slice(&x);
            match inertia.take() {
                Some(inertia) => problem.quadratic.inertia = inertia,
                None => moved = problem.quadratic.inertia.set_target(task.target),
            }
        })?;
        moved.map_err(|e| SimulateError::new(e.to_string()))?;
        if refactor {
            self.method.refactor()?;
            self.inertia = task.inertia;
            self.reweighted = false;
        }
        Ok(())
    }

    /// Solves a step.
    ///
    /// # Errors
    /// A system that cannot be factored. A step that does not converge is no error.
    pub fn solve(
        &mut self,
        world: &World,
        task: &Task<'_>,
        bound: f64,
        (settings, contacts): (&DeformSettings, &Contacts),
        stops: &mut Stops<'_>,
    ) -> Result<Solved, SimulateError> {
        self.begin(world, task)?;
        let mut by_gradient = Bound(bound);
        let mut by_residual = ResidualTolerance::new(settings.tol);
        let converged: &mut dyn Stop = if self.hard { &mut by_residual } else { &mut by_gradient };
        let outcome: Outcome = stops.run(&mut *self.method, &mut [converged], settings.max_iters);
        self.reweighted |= outcome.refactorisations > 0;
        let residuals = self.method.squared_residuals();
        Ok(Solved {
            status: outcome.status,
            reason: outcome.reason,
            iterations: outcome.iterations,
            rejected: outcome.rejected,
            residuals,
            local_dim: self.method.problem().local_dim(),
            gradient: None,
            bound,
            contacts: contacts.with(Vec::new()),
            known: Known::new(),
            stresses: Vec::new(),
            x: outcome.x,
        })
    }

    /// Whether a gradient says nothing of its solutions.
    pub fn is_hard(&self) -> bool {
        self.hard
    }
}

/// The splitting of the scene: over-relaxed, accelerated.
fn accelerated(admm: Admm, solver: &SolverSpec, hard: bool) -> Result<Box<dyn Method>, SystemError> {
    let admm = admm.with_cycle(solver.cycle())?;
    match solver.acceleration(Algorithm::of(&admm), hard) {
        None => Ok(Box::new(admm)),
        Some(how) if solver.accelerate == AccelerateName::WhereItPays => Ok(how.where_it_pays(admm)?),
        Some(how) => Ok(how.of(admm)?),
    }
}

/// Obstacles as a term of a problem that has its elements.
fn wall(world: &World, walls: &Walls, problem: &Problem) -> Box<dyn Term> {
    let stiffness = problem.node_stiffness();
    let points = (*world.touching.points).clone();
    let weight2 = shared(&points, &stiffness).map(|k| OBSTACLE_WEIGHT * k).collect();
    let size = world.bodies.iter().map(|b| b.size).fold(f64::INFINITY, f64::min);
    Box::new(Obstacle::new(Solids(walls.solids().to_vec()), points, weight2, size))
}
