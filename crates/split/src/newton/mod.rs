//! Newton's method on the true Hessian, for the end of a minimisation; with [`crate::Auto`], for all of it.

mod cg;
mod direction;
mod hessian;
mod search;

pub use cg::{Cg, CgEnd, CgReport};
pub use hessian::{FactorCost, Hessian};
pub use search::{Found, Search};

use crate::{
    EnergyReport, Evaluation, Exhausted, InversionGuard, LocalReport, Method, NormalMatrix, Problem, Projection,
    StepReport, SystemError, Trial, vector,
};

/// How a Newton system is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolver {
    /// An f32 factor of the Hessian, corrected in f64 by a few conjugate-gradient steps.
    Factor,
    /// Truncated conjugate gradients preconditioned by the normal matrix: no memory but for vectors and the Hessian.
    ConjugateGradients,
}

/// Which Hessian is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProjectionRule {
    /// The true one; the clamped one only where that is not positive definite, and for up to `back_off` iterations after
    /// (Longva et al. 2023).
    OnDemand {
        /// Most iterations before the true one is tried again.
        back_off: usize,
        /// Whether, after six long steps with the clamped one in a row, a mean of the true and the clamped one is taken instead of the clamped one, with as
        /// much of the true one as leaves it positive definite: where stretches are far apart the clamped one is so much
        /// too stiff that its steps hardly move.
        blended: bool,
    },
    /// Always this one.
    Always(Projection),
    /// Clamped where the quadratic model foretold the last step well, absolute eigenvalues where not (Chen et al. 2024).
    TrustRegion,
}

/// Settings of [`Newton`].
#[derive(Clone, Debug, PartialEq)]
pub struct NewtonSettings {
    /// Its name, as users give it.
    pub name: String,
    /// How systems are solved.
    pub solver: LinearSolver,
    /// Which Hessian is used.
    pub projection: ProjectionRule,
    /// Whether the rotation-aware candidate is looked at beside the straight step.
    pub warp: bool,
    /// Most conjugate-gradient steps an iteration.
    pub max_inner: usize,
    /// Bytes that a factor of the Hessian may take.
    pub memory: f64,
    /// Added to the diagonal of the Hessian: the weight of a proximal term |x - x_k|^2 / 2.
    pub proximal: f64,
    /// Part of the mean diagonal that is added where the Hessian is factored, and only there: what keeps a motion that
    /// costs nothing, as a rotation of the whole, from spoiling the factor.
    pub shift: f64,
    /// Whether no step is longer than 0.8 of what inverts the first element.
    pub guarded: bool,
    /// Longest straight step that is tried where one gained much more than foretold; 1 is the whole Newton step.
    pub longest: f64,
}

/// Part of the longest step without an inverted element that is tried first (Smith and Schaefer 2015).
pub const FEASIBLE: f64 = 0.8;

/// A relative change of the energy that may be rounding.
const ROUNDING: f64 = 1e-12;

/// Newton's method on a [`Problem`].
pub struct Newton {
    settings: NewtonSettings,
    problem: Problem,
    normal: NormalMatrix,
    hessian: Hessian,
    cg: Cg,
    search: Search,
    guard: Option<InversionGuard>,
    x: Vec<f64>,
    grad: Vec<f64>,
    new_grad: Vec<f64>,
    evaluation: Option<Evaluation>,
    wait: usize,        // iterations before the true Hessian is tried again
    back_off: usize,    // how long the last wait was
    blend: f64,         // part of the clamped Hessian in the last mean
    clamped: usize,     // long steps in a row that were not with the true one
    last: Found,        // of the last step
    last_gradient: f64, // norm before the last step
    iteration: usize,
    factorisations: usize,
    characteristic: f64, // energy of strains of about one
    definite: bool,      // the last direction is from a factor of the true Hessian
    exhausted: Option<Exhausted>,
    double_for: usize, // iterations that factors still have 64 bits
    was_double: bool,  // they had before
}

impl Newton {
    /// From the problem's start.
    ///
    /// # Errors
    /// A problem that does not fit together, has a term without second derivatives, or a part that hangs on nothing.
    pub fn new(problem: Problem, settings: NewtonSettings) -> Result<Self, SystemError> {
        problem.check().map_err(|e| SystemError::Factor(e.to_string()))?;
        let normal = NormalMatrix::new(&problem)?;
        let x = problem.x0.clone();
        let bytes = FactorCost::of(&normal, problem.dim).bytes;
        if settings.solver == LinearSolver::Factor && bytes > settings.memory {
            return Err(SystemError::Factor(format!(
                "the factor of the Hessian would take {:.1} GB, {:.1} are allowed; take newton-cg or auto, or allow more \
                 (newton.memory)",
                bytes / 1e9,
                settings.memory / 1e9
            )));
        }
        Self::resume(problem, normal, x, settings, 0)
    }

    /// Goes on from x, where another method has got to after some iterations, with its normal matrix.
    ///
    /// # Errors
    /// A term without second derivatives.
    pub fn resume(
        mut problem: Problem,
        normal: NormalMatrix,
        x: Vec<f64>,
        settings: NewtonSettings,
        iteration: usize,
    ) -> Result<Self, SystemError> {
        let hessian = Hessian::new(&mut problem, &normal)?;
        Ok(Self::resume_with(problem, normal, hessian, x, settings, iteration))
    }

    /// As [`Self::resume`], with the Hessian of this problem from before.
    pub fn resume_with(
        problem: Problem,
        normal: NormalMatrix,
        hessian: Hessian,
        x: Vec<f64>,
        settings: NewtonSettings,
        iteration: usize,
    ) -> Self {
        let n = problem.n_free * problem.dim;
        let characteristic = problem.terms.iter().map(|term| term.scale().energy).sum();
        Newton {
            guard: settings.guarded.then(|| InversionGuard::new(&problem)),
            settings,
            problem,
            normal,
            hessian,
            cg: Cg::default(),
            search: Search::default(),
            x,
            grad: vec![0.0; n],
            new_grad: vec![0.0; n],
            evaluation: None,
            wait: 0,
            back_off: 0,
            blend: 1.0,
            clamped: 0,
            last: Found { t: 1.0, ratio: 1.0, ..Found::default() },
            last_gradient: f64::INFINITY,
            iteration,
            factorisations: 0,
            characteristic,
            definite: false,
            exhausted: None,
            double_for: 0,
            was_double: false,
        }
    }

    /// Problem, normal matrix and positions, for another method to go on.
    pub fn into_parts(self) -> (Problem, NormalMatrix, Vec<f64>) {
        (self.problem, self.normal, self.x)
    }

    /// The same with the Hessian, as it was assembled and factored last.
    pub fn into_parts_with_hessian(self) -> (Problem, NormalMatrix, Vec<f64>, Hessian) {
        (self.problem, self.normal, self.x, self.hessian)
    }

    /// Forgets what it knows of the energy at x, after the energy has changed.
    pub fn forget(&mut self) {
        self.evaluation = None;
    }

    /// How the last step was found.
    pub fn last(&self) -> &Found {
        &self.last
    }

    /// Energy and gradient at x, kept.
    fn here(&mut self) -> Evaluation {
        *self.evaluation.get_or_insert_with(|| {
            let energy = self.problem.energy(&self.x, Some(&mut self.grad));
            Evaluation { energy, gradient_norm: vector::norm(&self.grad) }
        })
    }

    /// The step along d to begin a search with, and the longest that it may come to.
    fn first_step(&mut self) -> (f64, f64) {
        let longest = if self.last.ratio > search::SURPASSED { self.settings.longest.max(1.0) } else { 1.0 };
        let Some(guard) = &mut self.guard else { return (1.0, longest) };
        let Some(Evaluation { energy, .. }) = self.evaluation else { return (1.0, longest) };
        if energy.inverted == 0 {
            guard.arm(&self.x);
        }
        if !guard.is_armed() {
            return (1.0, longest);
        }
        self.new_grad.clear();
        self.new_grad.extend(self.cg.d.iter().map(|d| -d));
        let limit = (FEASIBLE * guard.limit(&self.x, &self.new_grad, longest / FEASIBLE)).min(longest);
        (limit.min(1.0), limit)
    }
}

impl Method for Newton {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let start = self.here();
        let before = self.factorisations;
        self.definite = false;
        let solved = self.direction()?;
        let steps = self.first_step();
        let d = &self.cg.d;
        let slope = vector::dot(&self.grad, d);
        let normal = if self.settings.warp { Some(&mut self.normal) } else { None };
        let found = self.search.run(
            &mut self.problem,
            normal,
            &self.x,
            d,
            steps,
            start.energy.value,
            (slope, solved.curvature),
        )?;
        self.last = found;
        self.last_gradient = start.gradient_norm;
        let mut accepted = found.energy.is_some();
        if accepted {
            self.x.copy_from_slice(self.search.x());
            self.evaluation = None;
        } else {
            // Where rounding hides what a step gains, the gradient still shows it.
            vector::add_scaled(&mut self.x[..d.len()], 1.0, d);
            let energy = self.problem.energy(&self.x, Some(&mut self.new_grad));
            let gradient_norm = vector::norm(&self.new_grad);
            accepted = gradient_norm < start.gradient_norm
                && energy.value <= start.energy.value + ROUNDING * start.energy.value.abs();
            if accepted {
                std::mem::swap(&mut self.grad, &mut self.new_grad);
                self.evaluation = Some(Evaluation { energy, gradient_norm });
            } else {
                vector::add_scaled(&mut self.x[..d.len()], -1.0, d);
            }
        }
        let foretold = -(slope + 0.5 * solved.curvature);
        let rounding = Exhausted::PART * (start.energy.value.abs() + self.characteristic);
        self.exhausted = None;
        if self.definite && steps.0 == 1.0 && foretold <= rounding {
            let stays = !accepted || self.here().gradient_norm > Exhausted::LEFT * start.gradient_norm;
            self.exhausted = stays.then_some(Exhausted { foretold, rounding });
        }
        self.iteration += 1;
        Ok(StepReport {
            merit: None,
            iteration: self.iteration,
            inner: solved.steps,
            refactorised: self.factorisations > before,
            accepted,
            energy_z: f64::INFINITY,
            trial: Trial::default(),
            local: LocalReport::default(),
        })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        &self.problem
    }

    fn energy(&mut self) -> EnergyReport {
        self.here().energy
    }

    fn evaluate(&mut self) -> Evaluation {
        self.here()
    }

    fn is_evaluated(&self) -> bool {
        true
    }

    fn exhausted(&self) -> Option<Exhausted> {
        self.exhausted
    }

    fn factor_bytes(&self) -> u64 {
        self.normal.factor_bytes() + self.hessian.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }
}
