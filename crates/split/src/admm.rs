//! The alternating direction method of multipliers, with whatever coupling, global step and weights it is put together
//! from: W, Algorithm 1.
//!
//! | method | coupling of the terms | global step | reweighting |
//! |---|---|---|---|
//! | ADMM-PD (Overby et al. 2017) | identity | [`crate::Direct`] | none |
//! | W-ADMM | identity | [`crate::Direct`] | W(22)-(23) |
//! | R-ADMM | polar | [`crate::Lbfgs`] | none |
//! | WRAPD | polar | [`crate::Lbfgs`] | W(22)-(23) |

mod folding;
mod method;
mod safe;
mod sweep;
mod weights;

use crate::balancing::{Balance, Balancing};
use crate::penalty::SafePenalty;
use crate::{
    BuildError, Cycle, EnergyReport, Evaluation, GlobalStep, LocalReport, NormalMatrix, Objective, Order, Problem,
    Pull, Reweighting, StepReport, SystemError, Term, Trial, reweight::Settling,
};
use folding::Folding;
use rayon::prelude::*;
use sweep::Sweeping;

/// Numbers handled by one task.
const CHUNK: usize = 8192;

/// How an [`Admm`] is put together.
pub struct AdmmSettings {
    /// Its name, as users give it.
    pub name: String,
    /// How the positions follow the local variables.
    pub global: Box<dyn GlobalStep>,
    /// Whether and how the weights follow the stiffness.
    pub reweighting: Option<Reweighting>,
    /// Before this iteration, counted from 0, the local variables and duals begin again: z = c(Dx), u = 0. Where the first
    /// iteration moves everything, as that of a map from a circle does, its duals say nothing about the rest; the
    /// authors' code for parameterization does so before the second.
    pub renewed_at: Option<usize>,
}

/// What an iteration hands to the next.
pub(crate) struct State<'a> {
    pub x: &'a mut [f64], // of the free nodes
    pub p: &'a mut [Vec<f64>],
    pub u: &'a mut [Vec<f64>],
}

/// What is known of the last iteration.
enum Last {
    /// There was none.
    None,
    /// This of its local step.
    Local(LocalReport),
    /// It was one pass, which measures nothing.
    Swept,
}

/// ADMM on a [`Problem`]. One iteration is one local step over all elements and one global step.
pub struct Admm {
    settings: AdmmSettings,
    problem: Problem,
    normal: NormalMatrix,
    x: Vec<f64>,      // positions
    p: Vec<Vec<f64>>, // z - u, what the global step aims at; a vector a term
    u: Vec<Vec<f64>>, // scaled duals, likewise
    grad: Vec<f64>,   // gradient over the free nodes: of the global step's objective, or of the problem's
    moved2: f64,      // sum w^2 |z - z_before|^2 of the last local step
    last: Last,
    before: Vec<f64>, // x before the last global step of the z-x-u order; else empty
    cycle: Cycle,
    alternations: usize, // local and global steps before an update of the duals, in the z-x-u order
    coupled: Vec<Vec<f64>>, // c(Dx) after the global step of the z-x-u order; else empty
    balancing: Option<Balance>,
    safe: Option<SafePenalty>,
    settling: Settling,
    sweeping: Sweeping,
    folding: Option<Folding>,
    fed: Option<usize>, // the term whose pull the global step has taken in the place of `grad`
    iteration: usize,
    energy: Option<EnergyReport>,
    f: Option<f64>, // f(x), where the global step has found it
    evaluation: Option<Evaluation>,
}

impl Admm {
    /// z = c(D x0), u = 0, base weights, first factor.
    ///
    /// # Errors
    /// A problem that does not fit together (as [`SystemError::Factor`]) or a singular system.
    pub fn new(problem: Problem, mut settings: AdmmSettings) -> Result<Self, SystemError> {
        problem.check().map_err(|e| SystemError::Factor(e.to_string()))?;
        let normal = match settings.global.precision() {
            Some(precision) => NormalMatrix::with_precision(&problem, precision)?,
            None => NormalMatrix::none()?,
        };
        settings.global.weigh(&problem)?;
        let mut x = problem.x0.clone();
        problem.quadratic.equalities.enforce(&mut x, problem.dim);
        Ok(Self::resume(problem, normal, x, settings, 0))
    }

    /// Goes on from x, where another method has got to after some iterations, with the weights and the matrix of before:
    /// z = c(D x), u = 0.
    pub fn resume(
        mut problem: Problem,
        normal: NormalMatrix,
        x: Vec<f64>,
        mut settings: AdmmSettings,
        iteration: usize,
    ) -> Self {
        settings.global.reset();
        let u: Vec<Vec<f64>> = problem.terms.iter().map(|term| vec![0.0; term.local_len()]).collect();
        let mut p = u.clone();
        for (term, p) in problem.terms.iter_mut().zip(&mut p) {
            term.couple(&x, p);
        }
        let grad = vec![0.0; problem.n_free * problem.dim];
        let moved2 = f64::INFINITY;
        Admm {
            settings,
            problem,
            normal,
            x,
            p,
            u,
            grad,
            moved2,
            last: Last::None,
            before: Vec::new(),
            cycle: Cycle::PLAIN,
            alternations: 1,
            coupled: Vec::new(),
            balancing: None,
            safe: None,
            settling: Settling::default(),
            sweeping: Sweeping::Unknown,
            folding: None,
            fed: None,
            iteration,
            energy: None,
            f: None,
            evaluation: None,
        }
    }

    /// Runs another cycle from here on: the z-x-u order, over-relaxation.
    ///
    /// # Errors
    /// A relaxation outside (0, 2), and one other than 1 in the z-x-u order.
    pub fn with_cycle(mut self, cycle: Cycle) -> Result<Self, BuildError> {
        let alpha = cycle.relaxation;
        if !(alpha > 0.0 && alpha < 2.0) {
            return Err(BuildError::Setting(format!("the relaxation is {alpha}; it must be between 0 and 2")));
        }
        if cycle.order == Order::Zxu && alpha != 1.0 {
            return Err(BuildError::Setting("over-relaxation is one of the x-z-u order".to_string()));
        }
        self.coupled = match cycle.order {
            Order::Xzu => Vec::new(),
            Order::Zxu => self.u.clone(),
        };
        self.cycle = cycle;
        self.sweeping = Sweeping::Unknown;
        Ok(self)
    }

    /// The augmented Lagrangian method as Deng et al. 2015 run it: so many updates of z and x in turns before each update of
    /// u, in the z-x-u order. One is ADMM. [`StepReport::inner`] counts them.
    ///
    /// # Errors
    /// None of them, and the other order.
    pub fn with_alternations(mut self, alternations: usize) -> Result<Self, BuildError> {
        if alternations == 0 {
            return Err(BuildError::Setting("0 alternations; give at least 1".to_string()));
        }
        if self.cycle.order != Order::Zxu {
            return Err(BuildError::Order { algorithm: "alm", needs: Order::Zxu });
        }
        self.alternations = alternations;
        self.sweeping = Sweeping::Unknown;
        Ok(self)
    }

    /// Balances the residuals by the penalty from here on.
    pub fn with_balancing(mut self, balancing: Balancing) -> Self {
        self.balancing = Some(Balance::new(balancing));
        self.sweeping = Sweeping::Unknown;
        self
    }

    /// The terms of its problem.
    pub(crate) fn terms(&self) -> &[Box<dyn Term>] {
        &self.problem.terms
    }

    /// A free node that has no inertia, if there is one.
    pub(crate) fn free_of_inertia(&self) -> Option<usize> {
        let stiffness = self.problem.quadratic.inertia.stiffness();
        (0..self.problem.n_free).find(|node| stiffness.get(*node).is_none_or(|k| *k == 0.0))
    }

    /// Iterations done.
    pub fn iterations(&self) -> usize {
        self.iteration
    }

    /// Order and relaxation.
    pub fn cycle(&self) -> Cycle {
        self.cycle
    }

    /// Whether weights may change while it runs.
    pub fn is_reweighted(&self) -> bool {
        self.settings.reweighting.is_some() || self.balancing.is_some()
    }

    /// Whether the global step ends at the minimiser, whatever it starts from.
    pub fn is_exact(&self) -> bool {
        let sees_potentials = self.settings.global.pull() == Pull::AtOrigin;
        self.settings.global.is_exact() && (sees_potentials || self.problem.quadratic.potentials.is_empty())
    }

    /// What a global step costs beside solves with the normal matrix.
    pub(crate) fn global_work(&self) -> f64 {
        self.settings.global.work()
    }

    /// What was known of x, p and u is known no more.
    fn forget(&mut self) {
        self.evaluation = None;
        self.energy = None;
        self.f = None;
    }

    /// The first half of an iteration: W(10b) and W(10c).
    pub(crate) fn local_half(&mut self) -> LocalReport {
        self.forget();
        self.fed = None;
        if self.settings.renewed_at == Some(self.iteration) {
            for ((term, p), u) in self.problem.terms.iter_mut().zip(&mut self.p).zip(&mut self.u) {
                term.couple(&self.x, p);
                u.fill(0.0);
            }
        }
        if let Some(report) = self.folded_half() {
            return report;
        }
        let (x, p, u, grad) = (&self.x, &mut self.p, &mut self.u, &mut self.grad);
        match self.settings.global.pull() {
            Pull::AtPoint => self.problem.cycle_step(&self.cycle, x, p, u, grad),
            Pull::AtOrigin => self.problem.pull_step(&self.cycle, x, p, u, grad),
        }
    }

    /// Gradient and value of the global step's objective, after p has been set from outside.
    pub(crate) fn aim(&mut self, local: &mut LocalReport) {
        self.fed = None;
        match self.settings.global.pull() {
            Pull::AtPoint => local.objective = self.problem.penalty(&self.x, &self.p, &mut self.grad).value,
            Pull::AtOrigin => self.problem.pull(&self.p, &mut self.grad),
        }
    }

    /// u <- c(Dx) - p, A(6) third line; z stays, p follows.
    fn dual_step(&mut self) {
        let locals = self.p.iter_mut().zip(&mut self.u).zip(&mut self.coupled);
        for (term, ((p, u), coupled)) in self.problem.terms.iter_mut().zip(locals).filter(|(term, _)| term.has_dual()) {
            term.couple(&self.x, coupled);
            let numbers = p.par_iter_mut().zip(u.par_iter_mut()).zip(coupled.par_iter());
            numbers.with_min_len(CHUNK).for_each(|((p, u), c)| {
                let z = *p + *u;
                *u = c - *p;
                *p = z - *u;
            });
        }
    }

    /// W(10a); inner steps.
    fn positions_step(&mut self, local: &LocalReport) -> Result<usize, SystemError> {
        let mut objective = Objective {
            problem: &mut self.problem,
            p: &self.p,
            value: local.objective,
            local_change: local.lagrangian_change().abs(),
            fed: self.fed,
        };
        let global = self.settings.global.run(&mut objective, &mut self.normal, &mut self.x, &mut self.grad)?;
        self.energy = global.energy;
        self.f = global.quadratic;
        Ok(global.inner)
    }

    /// The second half: W(10a), and the weights.
    pub(crate) fn global_half(&mut self, local: LocalReport) -> Result<StepReport, SystemError> {
        if self.cycle.order == Order::Zxu {
            self.before.clear();
            self.before.extend_from_slice(&self.x);
        }
        let inner = self.positions_step(&local)?;
        self.moved2 = local.moved2;
        self.last = Last::Local(local);
        if self.cycle.order == Order::Zxu {
            self.dual_step();
        }
        let refactorised = self.reweight()? || self.balance(&local)?;
        self.iteration += 1;
        Ok(StepReport {
            iteration: self.iteration,
            inner,
            refactorised,
            accepted: true,
            energy_z: local.value_after,
            merit: None,
            trial: Trial::default(),
            local,
        })
    }

    /// Iterations done, for an accelerator to take back those that it has rejected.
    pub(crate) fn set_iteration(&mut self, iteration: usize) {
        self.iteration = iteration;
    }

    /// Positions of the free nodes, p and u, for an accelerator to read and to set.
    pub(crate) fn state(&mut self) -> State<'_> {
        self.forget();
        self.open();
        State { x: &mut self.x[..self.problem.n_free * self.problem.dim], p: &mut self.p, u: &mut self.u }
    }

    /// The same, and the problem that it is a state of.
    pub(crate) fn state_and_problem(&mut self) -> (State<'_>, &mut Problem) {
        self.forget();
        self.open();
        self.sweeping = Sweeping::Unknown;
        let n = self.problem.n_free * self.problem.dim;
        (State { x: &mut self.x[..n], p: &mut self.p, u: &mut self.u }, &mut self.problem)
    }

    /// The problem, x of all nodes, p and u.
    #[expect(clippy::type_complexity, reason = "four slices by name would need a struct that is used once")]
    pub(crate) fn parts(&mut self) -> (&mut Problem, &[f64], &[Vec<f64>], &[Vec<f64>]) {
        self.unfold();
        (&mut self.problem, &self.x, &self.p, &self.u)
    }

    /// For energies and residuals elsewhere than at the current x.
    pub(crate) fn problem_mut(&mut self) -> &mut Problem {
        self.open();
        &mut self.problem
    }

    /// The matrix of the global step.
    pub fn normal(&self) -> &NormalMatrix {
        &self.normal
    }

    /// p = z - u, one vector a term.
    pub fn p(&mut self) -> &[Vec<f64>] {
        self.unfold();
        &self.p
    }

    /// Scaled duals, one vector a term.
    pub fn u(&mut self) -> &[Vec<f64>] {
        self.unfold();
        &self.u
    }

    /// z = p + u, all terms one after another.
    pub fn local(&mut self) -> Vec<f64> {
        self.unfold();
        self.p.iter().zip(&self.u).flat_map(|(p, u)| p.iter().zip(u).map(|(p, u)| p + u)).collect()
    }

    /// u, all terms one after another.
    pub fn dual(&mut self) -> Vec<f64> {
        self.unfold();
        self.u.concat()
    }

    /// Whether the problem has second derivatives, and no equalities, so that Newton's method applies.
    pub fn has_curvature(&mut self) -> bool {
        let quadratic = &self.problem.quadratic;
        if !(quadratic.potentials.iter().all(|p| p.has_hessian()) && quadratic.equalities.is_empty()) {
            return false;
        }
        self.problem.terms.iter_mut().all(|term| term.curvature().is_some())
    }

    /// Goes on from other positions, such as those of moved fixed nodes, after `change` has changed what is not an element:
    /// targets, loads, right-hand sides. The duals stay, which know the forces: z = c(D x), and u as it was.
    pub fn restart(&mut self, x: &[f64], change: impl FnOnce(&mut Problem)) {
        self.restart_with(x, true, change);
    }

    /// The same, with u = 0 unless the duals are to be kept.
    fn restart_with(&mut self, x: &[f64], keeps_duals: bool, change: impl FnOnce(&mut Problem)) {
        self.open();
        change(&mut self.problem);
        if !keeps_duals {
            self.u.iter_mut().for_each(|u| u.fill(0.0));
        }
        self.x.copy_from_slice(x);
        self.problem.quadratic.equalities.enforce(&mut self.x, self.problem.dim);
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&mut self.p).zip(&self.u) {
            term.couple(&self.x, p);
            p.iter_mut().zip(u).for_each(|(p, u)| *p -= u);
        }
        self.settings.global.reset();
        self.settling = Settling::default();
        self.moved2 = f64::INFINITY;
        self.last = Last::None;
        self.sweeping = Sweeping::Unknown;
        self.forget();
    }

    /// Problem, matrix, positions and settings, for another method to go on.
    pub fn into_parts(self) -> (Problem, NormalMatrix, Vec<f64>, AdmmSettings) {
        (self.problem, self.normal, self.x, self.settings)
    }
}
