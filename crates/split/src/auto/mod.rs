//! The splitting first, then Newton: [`Auto`], and the rule that says when.

mod gains;
mod price;

pub use gains::Gains;
pub use price::{Price, solver_for};

use crate::{
    Admm, AdmmSettings, EnergyReport, Evaluation, Exhausted, Hessian, LinearSolver, Method, Newton, NewtonSettings,
    NormalMatrix, Problem, Projection, ProjectionRule, Relax, Residuals, StepReport, SystemError, Untangle,
};

/// Settings of [`Auto`].
#[derive(Clone, Debug, PartialEq)]
pub struct AutoSettings {
    /// Newton's; its solver is chosen by [`solver_for`].
    pub newton: NewtonSettings,
    /// Newton follows as soon as nothing is inverted, whatever the splitting gains.
    pub eager: bool,
    /// Otherwise it follows when the splitting gains less than this part of all it has gained, in the time of a Newton iteration.
    pub gain: f64,
    /// Iterations over which that is averaged.
    pub window: usize,
    /// Iterations after which Newton is tried anyway: from the start of the problem where that has no inverted elements
    /// and the splitting has got into some that it does not leave, else from where the splitting is.
    pub longest: usize,
    /// Iterations that may bring no fewer inverted elements before a relaxed energy is turned to, where there is one.
    pub patience: usize,
    /// Iterations of the splitting after Newton has failed the first time; twice as many each further time.
    pub retreat: usize,
}

impl AutoSettings {
    /// Chooses Newton's solver for a problem; returns what its iteration costs in iterations of the splitting.
    fn choose(&mut self, problem: &Problem, normal: &NormalMatrix) -> f64 {
        let (price, cost) = Price::of(problem, normal);
        self.newton.solver = solver_for(&price, &cost, self.newton.memory);
        match self.newton.solver {
            LinearSolver::Factor => price.factor,
            LinearSolver::ConjugateGradients => price.gradients,
        }
    }
}

/// Problem, matrices, positions and settings of the splitting: what a method hands to the one that goes on.
pub struct Parts {
    /// The problem.
    pub problem: Problem,
    /// Its normal matrix.
    pub normal: NormalMatrix,
    /// Positions, `dim` numbers a node.
    pub x: Vec<f64>,
    /// How the splitting is put together.
    pub admm: AdmmSettings,
    /// The Hessian as it was assembled and factored last, where it was.
    pub hessian: Option<Hessian>,
}

/// One of the two, at work.
enum Phase {
    Splitting(Box<Admm>),
    Untangling(Box<Untangle>, AdmmSettings),
    Newton(Box<Newton>, AdmmSettings),
    /// Between them; only after an error.
    Nothing,
}

/// The splitting ([`Admm`]) while it is the faster one, then [`Newton`]; back to the splitting where Newton finds no way on.
///
/// Newton begins where nothing is inverted: the prox of the splitting cannot leave the domain of an energy, and so finds the
/// way out of inverted and collapsed states that a descent of the energy may lack.
pub struct Auto {
    name: String,
    settings: AutoSettings,
    phase: Phase,
    empty: Problem,
    price: f64,
    gains: Gains,
    iteration: usize,
    until: usize,    // no Newton before this iteration
    begun: usize,    // when the splitting began
    retreats: usize, // how often Newton failed
    short: usize,    // Newton steps in a row that were cut to almost nothing
    relax: Option<Box<dyn Relax>>,
    exhausted: Option<Exhausted>, // of the last step, though the splitting may follow
    fair: Option<Vec<f64>>,       // where Newton failed last without inverted elements
    fewest: u64,                  // inverted elements so far
    waited: usize,                // iterations since then
}

/// A Newton step cut to this part of its length, some times in a row, leads nowhere.
const SHORT: f64 = 0.02;
const SHORT_STEPS: usize = 4;

/// Part of the elements that may be inverted for a relaxed energy to be of use.
const FEW: f64 = 0.02;

/// Most conjugate-gradient steps of an iteration on a relaxed energy that cannot be factored: it need not be exact.
const UNTANGLING: usize = 30;

/// Retreats are doubled up to this many times.
const DOUBLINGS: usize = 6;

impl Auto {
    /// Begins with the splitting, and stays with it where a term has no second derivatives.
    pub fn new(name: String, mut admm: Admm, mut settings: AutoSettings) -> Self {
        let price = settings.choose(admm.problem(), admm.normal());
        let until = if admm.has_curvature() { 0 } else { usize::MAX };
        Self::begin(name, settings, Phase::Splitting(Box::new(admm)), price, 0, until)
    }

    /// Goes on with Newton from where another method has got to after some iterations; the splitting, should it be needed,
    /// begins there too.
    ///
    /// # Errors
    /// A term without second derivatives.
    pub fn resume(
        name: String,
        parts: Parts,
        mut settings: AutoSettings,
        iteration: usize,
    ) -> Result<Self, SystemError> {
        let Parts { mut problem, normal, x, admm, hessian } = parts;
        let price = settings.choose(&problem, &normal);
        let hessian = match hessian {
            Some(hessian) => hessian,
            None => Hessian::new(&mut problem, &normal)?,
        };
        let newton = Newton::resume_with(problem, normal, hessian, x, settings.newton.clone(), iteration);
        Ok(Self::begin(name, settings, Phase::Newton(Box::new(newton), admm), price, iteration, 0))
    }

    fn begin(name: String, settings: AutoSettings, phase: Phase, price: f64, iteration: usize, until: usize) -> Self {
        Auto {
            name,
            settings,
            phase,
            empty: Problem::empty(),
            price,
            gains: Gains::default(),
            iteration,
            until,
            begun: iteration,
            retreats: 0,
            short: 0,
            relax: None,
            exhausted: None,
            fair: None,
            fewest: u64::MAX,
            waited: 0,
        }
    }

    /// With a relaxed energy that leads out of inverted elements where the splitting does not.
    #[must_use]
    pub fn with_relaxation(mut self, relax: Box<dyn Relax>) -> Self {
        self.relax = Some(relax);
        self
    }

    /// What it has worked with, for another method to go on; none after an error.
    pub fn into_parts(self) -> Option<Parts> {
        match self.phase {
            Phase::Splitting(admm) => {
                let (problem, normal, x, admm) = admm.into_parts();
                Some(Parts { problem, normal, x, admm, hessian: None })
            }
            Phase::Untangling(untangle, admm) => {
                let (problem, normal, x) = untangle.into_parts();
                Some(Parts { problem, normal, x, admm, hessian: None })
            }
            Phase::Newton(newton, admm) => {
                let (problem, normal, x, hessian) = newton.into_parts_with_hessian();
                Some(Parts { problem, normal, x, admm, hessian: Some(hessian) })
            }
            Phase::Nothing => None,
        }
    }

    /// How Newton's systems are solved.
    pub fn solver(&self) -> LinearSolver {
        self.settings.newton.solver
    }

    /// Whether Newton is at work.
    pub fn is_in_newton(&self) -> bool {
        matches!(self.phase, Phase::Newton(..))
    }

    fn enter_newton(&mut self) -> Result<(), SystemError> {
        let begins_anew = self.problem().barrier && self.energy().inverted > 0 && self.is_way_fair();
        if let Phase::Splitting(admm) = std::mem::replace(&mut self.phase, Phase::Nothing) {
            let (problem, normal, mut x, admm) = admm.into_parts();
            if begins_anew {
                x.copy_from_slice(self.fair.as_deref().unwrap_or(&problem.x0));
            }
            let newton = Newton::resume(problem, normal, x, self.settings.newton.clone(), self.iteration)?;
            self.phase = Phase::Newton(Box::new(newton), admm);
            self.short = 0;
        }
        Ok(())
    }

    /// Whether the splitting no longer gets rid of inverted elements.
    fn is_tangled(&mut self) -> bool {
        let inverted = self.energy().inverted;
        if self.relax.is_none() || !self.problem().barrier || self.iteration < self.until || inverted == 0 {
            return false;
        }
        self.waited = if inverted < self.fewest { 0 } else { self.waited + 1 };
        self.fewest = self.fewest.min(inverted);
        self.waited >= self.settings.patience
    }

    /// Few inverted elements are turned by a relaxed energy; of many, that makes more. Then Newton goes on from the start, if
    /// nothing is inverted there.
    fn leave_tangle(&mut self) -> Result<(), SystemError> {
        let inverted = self.energy().inverted as f64;
        let elements: usize = self.problem().terms.iter().map(|term| term.n_elems()).sum();
        if self.fair.is_some() || (inverted > FEW * elements as f64 && self.is_way_fair()) {
            return self.enter_newton();
        }
        self.enter_untangling()
    }

    /// Whether Newton has been without inverted elements before, or the problem is at its start.
    fn is_way_fair(&mut self) -> bool {
        if self.fair.is_some() {
            return true;
        }
        let Phase::Splitting(admm) = &mut self.phase else { return false };
        let problem = admm.problem_mut();
        let start = std::mem::take(&mut problem.x0);
        let inverted = problem.energy(&start, None).inverted;
        problem.x0 = start;
        inverted == 0
    }

    fn enter_untangling(&mut self) -> Result<(), SystemError> {
        let Some(relaxed) = self.relax.as_ref().map(|relax| relax.relaxed()).transpose()? else { return Ok(()) };
        if let Phase::Splitting(admm) = std::mem::replace(&mut self.phase, Phase::Nothing) {
            let (problem, normal, x, admm) = admm.into_parts();
            let settings = NewtonSettings {
                projection: ProjectionRule::Always(Projection::Clamp),
                warp: false,
                guarded: false,
                longest: 1.0,
                max_inner: UNTANGLING,
                ..self.settings.newton.clone()
            };
            let untangle = Untangle::new(problem, relaxed, normal, x, settings, self.iteration)?;
            self.phase = Phase::Untangling(Box::new(untangle), admm);
            self.begun = self.iteration;
        }
        Ok(())
    }

    /// After a step of untangling.
    fn leave_untangling(&mut self, report: &StepReport) -> Result<(), SystemError> {
        let done = self.energy().inverted == 0;
        if !(done || !report.accepted || self.iteration - self.begun >= self.settings.longest) {
            return Ok(());
        }
        if let Phase::Untangling(untangle, admm) = std::mem::replace(&mut self.phase, Phase::Nothing) {
            let (problem, normal, x) = untangle.into_parts();
            self.phase = Phase::Splitting(Box::new(Admm::resume(problem, normal, x, admm, self.iteration)));
            self.fewest = u64::MAX;
            self.waited = 0;
            if !done {
                // One way out is left: from the start, where nothing was inverted, if it was not.
                self.relax = None;
            }
            self.enter_newton()?;
        }
        Ok(())
    }

    fn enter_splitting(&mut self) {
        let is_fair = self.problem().barrier && self.energy().inverted == 0;
        if let Phase::Newton(newton, admm) = std::mem::replace(&mut self.phase, Phase::Nothing) {
            let (problem, normal, x) = newton.into_parts();
            if is_fair {
                self.fair = Some(x.clone());
            }
            self.phase = Phase::Splitting(Box::new(Admm::resume(problem, normal, x, admm, self.iteration)));
            self.until = self.iteration + (self.settings.retreat << self.retreats.min(DOUBLINGS));
            self.begun = self.iteration;
            self.retreats += 1;
            self.gains = Gains::default();
        }
    }

    /// After an iteration of the splitting: whether Newton is to follow.
    fn is_time(&mut self) -> bool {
        let energy = self.energy();
        let small = self.settings.eager || self.gains.are_small(energy.value, self.price, &self.settings);
        let fair = energy.inverted == 0 || !self.problem().barrier;
        self.iteration >= self.until
            && ((small && fair) || self.iteration - self.begun.max(self.until) >= self.settings.longest)
    }

    /// After an iteration of Newton: whether it leads nowhere.
    fn is_lost(&mut self, report: &StepReport) -> bool {
        if let Phase::Newton(newton, _) = &self.phase {
            self.short = if newton.last().t < SHORT { self.short + 1 } else { 0 };
        }
        !report.accepted || self.short >= SHORT_STEPS
    }

    fn method(&self) -> Option<&dyn Method> {
        match &self.phase {
            Phase::Splitting(admm) => Some(admm.as_ref()),
            Phase::Untangling(untangle, _) => Some(untangle.as_ref()),
            Phase::Newton(newton, _) => Some(newton.as_ref()),
            Phase::Nothing => None,
        }
    }

    fn method_mut(&mut self) -> Option<&mut dyn Method> {
        match &mut self.phase {
            Phase::Splitting(admm) => Some(admm.as_mut()),
            Phase::Untangling(untangle, _) => Some(untangle.as_mut()),
            Phase::Newton(newton, _) => Some(newton.as_mut()),
            Phase::Nothing => None,
        }
    }
}

/// What a method that has lost its parts to an error says.
fn lost() -> SystemError {
    SystemError::Factor("the method ended with an error before; build it anew".to_string())
}

impl Method for Auto {
    fn name(&self) -> &str {
        &self.name
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let report = self.method_mut().ok_or_else(lost)?.step()?;
        self.iteration = report.iteration;
        self.exhausted = None;
        if self.is_in_newton() {
            self.exhausted = self.method().and_then(|m| m.exhausted());
            if self.is_lost(&report) {
                self.enter_splitting();
            }
        } else if matches!(self.phase, Phase::Untangling(..)) {
            self.leave_untangling(&report)?;
        } else if self.is_tangled() {
            self.leave_tangle()?;
        } else if self.is_time() {
            self.enter_newton()?;
        }
        Ok(report)
    }

    fn x(&self) -> &[f64] {
        self.method().map_or(&[], |m| m.x())
    }

    fn problem(&self) -> &Problem {
        self.method().map_or(&self.empty, |m| m.problem())
    }

    fn energy(&mut self) -> EnergyReport {
        self.method_mut().map_or_else(EnergyReport::default, |m| m.energy())
    }

    fn evaluate(&mut self) -> Evaluation {
        self.method_mut().map_or_else(Evaluation::default, |m| m.evaluate())
    }

    fn is_evaluated(&self) -> bool {
        self.method().is_some_and(|m| m.is_evaluated())
    }

    fn exhausted(&self) -> Option<Exhausted> {
        self.exhausted
    }

    fn residuals(&mut self) -> Residuals {
        self.method_mut().map_or(Residuals { primal: f64::INFINITY, dual: f64::INFINITY }, |m| m.residuals())
    }

    fn forces(&mut self) -> Option<Vec<f64>> {
        self.method_mut().and_then(|m| m.forces())
    }

    fn forces_of_term(&mut self, term: usize) -> Option<Vec<f64>> {
        self.method_mut().and_then(|m| m.forces_of_term(term))
    }

    fn factor_bytes(&self) -> u64 {
        self.method().map_or(0, |m| m.factor_bytes())
    }

    fn into_problem(self: Box<Self>) -> Problem {
        match self.phase {
            Phase::Splitting(admm) => admm.into_problem(),
            Phase::Untangling(untangle, _) => untangle.into_problem(),
            Phase::Newton(newton, _) => newton.into_problem(),
            Phase::Nothing => self.empty,
        }
    }
}
