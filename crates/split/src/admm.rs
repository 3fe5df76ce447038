//! The alternating direction method of multipliers, with whatever coupling, global step and weights it is put together
//! from: W, Algorithm 1.
//!
//! | method | coupling of the terms | global step | reweighting |
//! |---|---|---|---|
//! | ADMM-PD (Overby et al. 2017) | identity | [`crate::Direct`] | none |
//! | W-ADMM | identity | [`crate::Direct`] | W(22)-(23) |
//! | R-ADMM | polar | [`crate::Lbfgs`] | none |
//! | WRAPD | polar | [`crate::Lbfgs`] | W(22)-(23) |

mod safe;

use crate::balancing::{Balance, Balancing};
use crate::penalty::SafePenalty;
use crate::{
    BuildError, Cycle, EnergyReport, Evaluation, GlobalStep, LocalReport, Method, NormalMatrix, Objective, Order,
    Problem, Pull, Residual, Residuals, Reweighting, Splitting, SquaredResiduals, StepReport, SystemError, Term, Trial,
    reweight::Settling, vector,
};
use rayon::prelude::*;

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

/// ADMM on a [`Problem`]. One iteration is one local step over all elements and one global step.
pub struct Admm {
    settings: AdmmSettings,
    problem: Problem,
    normal: NormalMatrix,
    x: Vec<f64>,               // positions
    p: Vec<Vec<f64>>,          // z - u, what the global step aims at; a vector a term
    u: Vec<Vec<f64>>,          // scaled duals, likewise
    grad: Vec<f64>,            // gradient over the free nodes: of the global step's objective, or of the problem's
    moved2: f64,               // sum w^2 |z - z_before|^2 of the last local step
    last: Option<LocalReport>, // of the last iteration
    before: Vec<f64>,          // x of the free nodes before the last global step of the z-x-u order; else empty
    cycle: Cycle,
    alternations: usize, // local and global steps before an update of the duals, in the z-x-u order
    coupled: Vec<Vec<f64>>, // c(Dx) after the global step of the z-x-u order; else empty
    balancing: Option<Balance>,
    safe: Option<SafePenalty>,
    settling: Settling,
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
            last: None,
            before: Vec::new(),
            cycle: Cycle::PLAIN,
            alternations: 1,
            coupled: Vec::new(),
            balancing: None,
            safe: None,
            settling: Settling::default(),
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
        Ok(self)
    }

    /// Balances the residuals by the penalty from here on.
    pub fn with_balancing(mut self, balancing: Balancing) -> Self {
        self.balancing = Some(Balance::new(balancing));
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

    /// Squared weights become mu times the base weights; forces stay.
    fn weigh(&mut self, mu: f64) {
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&mut self.p).zip(&mut self.u) {
            term.propose_weights((mu, mu));
            term.take_weights(p, u);
        }
    }

    /// New weights in the normal matrix, or in what the global step has in its place.
    fn refactor_normal(&mut self) -> Result<(), SystemError> {
        self.settings.global.reset();
        if self.settings.global.precision().is_some() {
            self.normal.refactor(&self.problem)?;
        }
        self.settings.global.weigh(&self.problem)
    }

    /// Raises or lowers the penalty where one residual is much larger than the other.
    fn balance(&mut self, local: &LocalReport) -> Result<bool, SystemError> {
        let Some(mu) = self.balancing.as_mut().and_then(|balance| balance.next(local.gap2, local.moved2)) else {
            return Ok(false);
        };
        self.weigh(mu);
        self.refactor_normal()?;
        Ok(true)
    }

    /// Takes the candidate weights where one of them asks for it, W(22)-(23).
    fn reweight(&mut self) -> Result<bool, SystemError> {
        let Some(reweighting) = self.settings.reweighting else { return Ok(false) };
        let Some(range) = reweighting.range.at(self.iteration) else { return Ok(false) };
        let mut hardened = false;
        if let Some(rule) = &reweighting.hardening
            && self.settling.has_stopped(self.moved2, rule)
        {
            for ((term, p), u) in self.problem.terms.iter_mut().zip(&self.p).zip(&self.u) {
                hardened |= term.harden(rule, &self.x, p, u);
            }
        }
        let ratio = self.problem.terms.iter_mut().map(|term| term.propose_weights(range)).fold(1.0, f64::max);
        if ratio <= reweighting.trigger && !hardened {
            return Ok(false);
        }
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&mut self.p).zip(&mut self.u) {
            term.take_weights(p, u);
        }
        self.refactor_normal()?;
        Ok(true)
    }

    /// The first half of an iteration: W(10b) and W(10c).
    pub(crate) fn local_half(&mut self) -> LocalReport {
        self.evaluation = None;
        self.energy = None;
        if self.settings.renewed_at == Some(self.iteration) {
            for ((term, p), u) in self.problem.terms.iter_mut().zip(&mut self.p).zip(&mut self.u) {
                term.couple(&self.x, p);
                u.fill(0.0);
            }
        }
        let (x, p, u, grad) = (&self.x, &mut self.p, &mut self.u, &mut self.grad);
        match self.settings.global.pull() {
            Pull::AtPoint => self.problem.cycle_step(&self.cycle, x, p, u, grad),
            Pull::AtOrigin => self.problem.pull_step(&self.cycle, x, p, u, grad),
        }
    }

    /// Gradient and value of the global step's objective, after p has been set from outside.
    pub(crate) fn aim(&mut self, local: &mut LocalReport) {
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
        self.last = Some(local);
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
        self.evaluation = None;
        self.energy = None;
        self.f = None;
        State { x: &mut self.x[..self.problem.n_free * self.problem.dim], p: &mut self.p, u: &mut self.u }
    }

    /// The same, and the problem that it is a state of.
    pub(crate) fn state_and_problem(&mut self) -> (State<'_>, &mut Problem) {
        self.evaluation = None;
        self.energy = None;
        self.f = None;
        let n = self.problem.n_free * self.problem.dim;
        (State { x: &mut self.x[..n], p: &mut self.p, u: &mut self.u }, &mut self.problem)
    }

    /// The problem, x of all nodes, p and u.
    #[expect(clippy::type_complexity, reason = "four slices by name would need a struct that is used once")]
    pub(crate) fn parts(&mut self) -> (&mut Problem, &[f64], &[Vec<f64>], &[Vec<f64>]) {
        (&mut self.problem, &self.x, &self.p, &self.u)
    }

    /// For energies and residuals elsewhere than at the current x.
    pub(crate) fn problem_mut(&mut self) -> &mut Problem {
        &mut self.problem
    }

    /// The matrix of the global step.
    pub fn normal(&self) -> &NormalMatrix {
        &self.normal
    }

    /// p = z - u, one vector a term.
    pub fn p(&self) -> &[Vec<f64>] {
        &self.p
    }

    /// Scaled duals, one vector a term.
    pub fn u(&self) -> &[Vec<f64>] {
        &self.u
    }

    /// z = p + u, all terms one after another.
    pub fn local(&self) -> Vec<f64> {
        self.p.iter().zip(&self.u).flat_map(|(p, u)| p.iter().zip(u).map(|(p, u)| p + u)).collect()
    }

    /// u, all terms one after another.
    pub fn dual(&self) -> Vec<f64> {
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
        self.last = None;
        self.energy = None;
        self.f = None;
        self.evaluation = None;
    }

    /// Problem, matrix, positions and settings, for another method to go on.
    pub fn into_parts(self) -> (Problem, NormalMatrix, Vec<f64>, AdmmSettings) {
        (self.problem, self.normal, self.x, self.settings)
    }
}

impl Method for Admm {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let mut local = self.local_half(); // W(10b), W(10c)
        let mut inner = 0;
        for _ in 1..self.alternations {
            inner += self.positions_step(&local)?;
            local = self.local_half();
        }
        let report = self.global_half(local)?; // W(10a), W(22)-(23)
        Ok(StepReport { inner: report.inner + inner, ..report })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        &self.problem
    }

    fn energy(&mut self) -> EnergyReport {
        *self.energy.get_or_insert_with(|| match self.f {
            Some(f) => self.problem.energy_beside(f, &self.x),
            None => self.problem.energy(&self.x, None),
        })
    }

    fn evaluate(&mut self) -> Evaluation {
        *self.evaluation.get_or_insert_with(|| {
            let energy = self.problem.energy(&self.x, Some(&mut self.grad));
            self.energy = Some(energy);
            Evaluation { energy, gradient_norm: self.problem.gradient_norm(&mut self.grad) }
        })
    }

    fn forward_residual(&mut self) -> Option<f64> {
        let mut residual = Residual::default();
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&self.p).zip(&self.u) {
            residual += term.residual(&self.x, p, u);
        }
        Some(residual.gap2)
    }

    fn begin(&mut self, x: &[f64], keeps_duals: bool, change: &mut dyn FnMut(&mut Problem)) -> Result<(), SystemError> {
        if x.len() != self.x.len() {
            let (got, want) = (x.len(), self.x.len());
            return Err(SystemError::Stalled(format!("a start of {got} numbers for a problem of {want}")));
        }
        self.restart_with(x, keeps_duals, change);
        self.iteration = 0;
        if let Some(balance) = &mut self.balancing {
            balance.restart();
        }
        self.problem.check().map_err(|e| SystemError::Factor(e.to_string()))?;
        match self.safe {
            Some(_) => self.take_safe_penalty(),
            None => Ok(()),
        }
    }

    fn refactor(&mut self) -> Result<(), SystemError> {
        self.refactor_normal()
    }

    fn splitting(&mut self) -> Option<Splitting<'_>> {
        Some(Splitting { problem: &mut self.problem, x: &self.x, p: &self.p, u: &self.u })
    }

    fn squared_residuals(&mut self) -> Option<SquaredResiduals> {
        let last = self.last?;
        if self.cycle.order == Order::Xzu {
            return Some(SquaredResiduals { forward: self.forward_residual()?, combined: last.combined() });
        }
        let (mut now, mut then) = (Vec::new(), Vec::new());
        let (mut weights, mut moved2) = (Vec::new(), 0.0);
        for term in &mut self.problem.terms {
            for of in [&mut now, &mut then, &mut weights] {
                of.resize(term.local_len(), 0.0);
            }
            term.couple(&self.x, &mut now);
            term.couple(&self.before, &mut then);
            term.local_weights2(&mut weights);
            for (w, (now, then)) in weights.iter_mut().zip(now.iter_mut().zip(&then)) {
                *now -= then;
                *w *= *now;
            }
            moved2 += vector::dot(&weights, &now);
        }
        Some(SquaredResiduals { forward: last.gap2, combined: self.forward_residual()? + moved2 })
    }

    fn factor_bytes(&self) -> u64 {
        self.normal.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }

    fn residuals(&mut self) -> Residuals {
        let mut residual = Residual::default();
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&self.p).zip(&self.u) {
            residual += term.residual(&self.x, p, u);
        }
        let relative = |part2: f64| (part2 / residual.size2.max(f64::MIN_POSITIVE)).sqrt();
        Residuals { primal: relative(residual.gap2), dual: relative(self.moved2) }
    }

    fn forces(&mut self) -> Option<Vec<f64>> {
        let mut forces = vec![0.0; self.x.len()];
        self.problem.penalty(&self.x, &self.p, &mut forces);
        Some(forces)
    }

    fn forces_of_term(&mut self, term: usize) -> Option<Vec<f64>> {
        let mut forces = vec![0.0; self.x.len()];
        self.problem.terms.get_mut(term)?.penalty(&self.x, &self.p[term], &mut forces);
        Some(forces)
    }
}
