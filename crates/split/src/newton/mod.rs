//! Newton's method on the true Hessian, for the end of a minimisation; with [`crate::Auto`], for all of it.

mod cg;
mod hessian;
mod search;

pub use cg::{Cg, CgEnd, CgReport};
pub use hessian::{FactorCost, Hessian};
pub use search::{Found, Search};

use crate::{
    EnergyReport, Evaluation, InversionGuard, LocalReport, Method, NormalMatrix, Problem, Projection, StepReport,
    SystemError, Trial, vector,
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

    /// The direction, left in `cg.d`; inner steps, and whether the Hessian behind it is the true one.
    fn direction(&mut self) -> Result<CgReport, SystemError> {
        match self.settings.solver {
            LinearSolver::Factor => self.by_factor(),
            LinearSolver::ConjugateGradients => self.by_gradients(),
        }
    }

    /// The Hessian that the rule asks for, first to last.
    fn projections(&mut self) -> [Option<Projection>; 3] {
        let (clamp, absolute) = (Projection::Clamp, Projection::Absolute);
        match self.settings.projection {
            ProjectionRule::OnDemand { .. } if self.wait > 0 => {
                self.wait -= 1;
                [Some(clamp), Some(absolute), None]
            }
            ProjectionRule::OnDemand { .. } => [Some(Projection::None), Some(clamp), Some(absolute)],
            ProjectionRule::Always(Projection::Clamp) => [Some(clamp), Some(absolute), None],
            ProjectionRule::Always(projection) => [Some(projection), Some(absolute), None],
            ProjectionRule::TrustRegion if (self.last.ratio - 1.0).abs() < TRUSTED => {
                [Some(clamp), Some(absolute), None]
            }
            ProjectionRule::TrustRegion => [Some(absolute), None, None],
        }
    }

    /// With a new factor of the Hessian, or where that will do with the old one.
    fn by_factor(&mut self) -> Result<CgReport, SystemError> {
        // As exact as quadratic convergence can use: the gradient falls by the square of its last fall.
        let fall = self.fall();
        let tolerance = (0.1 * fall * fall).clamp(1e-6, 1e-2);
        let is_tried = self.is_old_factor_good();
        let clamped = std::mem::take(&mut self.clamped);
        let clamped = if self.last.t < LONG { 0 } else { clamped };
        if is_tried {
            self.assemble(Projection::None)?;
            let report = self.preconditioned(tolerance, WITH_OLD_FACTOR)?;
            if report.end == CgEnd::Solved || (report.end == CgEnd::Limit && report.residual <= USEFUL) {
                return Ok(report);
            }
        }
        for projection in self.projections().into_iter().flatten() {
            if projection == Projection::Clamp
                && self.is_blended(clamped)
                && let Some(report) = self.by_blend(tolerance)?
            {
                self.clamped = clamped + 1;
                return Ok(report);
            }
            if !(is_tried && projection == Projection::None) {
                self.assemble(projection)?;
            }
            self.factorisations += 1;
            if !self.hessian.factor(&self.normal, self.settings.shift)? {
                self.delay(projection);
                continue;
            }
            if projection == Projection::None {
                self.back_off = 0;
            } else {
                self.clamped = clamped + 1;
            }
            let report = self.preconditioned(tolerance, CORRECTIONS)?;
            if report.end == CgEnd::NegativeCurvature {
                // The factor's rounding made the matrix definite; its step still descends.
                self.delay(projection);
            }
            return Ok(report);
        }
        // Not even absolute eigenvalues can be factored in f32: with some more on the diagonal they can, and that is still a
        // good preconditioner.
        for lift in LIFTS {
            self.factorisations += 1;
            if self.hessian.factor_lifted(&self.normal, lift)? {
                return self.preconditioned(tolerance, WITH_LIFTED_FACTOR);
            }
        }
        self.by_gradients()
    }

    fn is_blended(&self, clamped: usize) -> bool {
        clamped >= CRAWL && matches!(self.settings.projection, ProjectionRule::OnDemand { blended: true, .. })
    }

    /// With the mean of the true and the clamped Hessian; none where that takes more of the clamped one than it is worth.
    fn by_blend(&mut self, tolerance: f64) -> Result<Option<CgReport>, SystemError> {
        let mut part = (self.blend * LESS).max(LEAST_BLEND);
        let both = self.hessian.assemble_both(&mut self.problem, &self.x)?;
        while part < 1.0 {
            self.hessian.blend(&both, part);
            self.hessian.add_to_diagonal(self.settings.proximal);
            self.factorisations += 1;
            if self.hessian.factor(&self.normal, self.settings.shift)? {
                self.blend = part;
                return self.preconditioned(tolerance, CORRECTIONS).map(Some);
            }
            part *= MORE;
        }
        self.blend = 1.0;
        Ok(None)
    }

    fn assemble(&mut self, projection: Projection) -> Result<(), SystemError> {
        self.hessian.assemble(&mut self.problem, &self.x, projection)?;
        self.hessian.add_to_diagonal(self.settings.proximal);
        Ok(())
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

    /// Conjugate gradients on the assembled Hessian, preconditioned with the factor as it is.
    fn preconditioned(&mut self, tolerance: f64, limit: usize) -> Result<CgReport, SystemError> {
        let (matrix, factor, scratch) = self.hessian.parts();
        self.cg.solve(
            &self.grad,
            tolerance,
            limit,
            |p, q| matrix.multiply(p, q).map_err(SystemError::from),
            |z| factor.map_or(Ok(()), |factor| factor.solve_in_place(z, 1, scratch)).map_err(SystemError::from),
        )
    }

    /// Whether the last step went as foretold: then the Hessian has hardly changed, and its factor is still a good
    /// preconditioner.
    fn is_old_factor_good(&self) -> bool {
        let Found { t, ratio, warped, .. } = self.last;
        let on_demand = matches!(self.settings.projection, ProjectionRule::OnDemand { .. });
        on_demand
            && self.wait == 0
            && self.hessian.is_factored()
            && !warped
            && t == 1.0
            && (ratio - 1.0).abs() < TRUSTED
    }

    /// What the last step left of the gradient; 1 before the first.
    fn fall(&mut self) -> f64 {
        let norm = self.here().gradient_norm;
        if self.last_gradient.is_finite() { norm / self.last_gradient } else { 1.0 }
    }

    /// The true Hessian was not positive definite.
    fn delay(&mut self, projection: Projection) {
        let rule = self.settings.projection;
        if let (ProjectionRule::OnDemand { back_off, .. }, Projection::None) = (rule, projection) {
            self.wait = self.back_off;
            self.back_off = (self.back_off + 1).min(back_off);
        }
    }

    fn by_gradients(&mut self) -> Result<CgReport, SystemError> {
        let projection = match self.settings.projection {
            ProjectionRule::OnDemand { .. } => Projection::None,
            ProjectionRule::Always(projection) => projection,
            ProjectionRule::TrustRegion if (self.last.ratio - 1.0).abs() < TRUSTED => Projection::Clamp,
            ProjectionRule::TrustRegion => Projection::Absolute,
        };
        self.assemble(projection)?;
        // Eisenstat and Walker 1996, choice 2.
        let fall = self.fall();
        let tolerance = (0.9 * fall * fall).clamp(1e-5, 0.1);
        let (matrix, normal) = (self.hessian.matrix(), &mut self.normal);
        self.cg.solve(
            &self.grad,
            tolerance,
            self.settings.max_inner,
            |p, q| matrix.multiply(p, q).map_err(SystemError::from),
            |z| normal.solve(z),
        )
    }
}

/// Conjugate-gradient steps that correct an f32 factor.
const CORRECTIONS: usize = 4;

/// And one of an earlier Hessian: a step costs a twelfth to a sixth of a factorisation.
const WITH_OLD_FACTOR: usize = 5;

/// What they may leave of the residual, at most, to be of more use than a new factor.
const USEFUL: f64 = 0.1;

/// And one of a matrix with more on its diagonal.
const WITH_LIFTED_FACTOR: usize = 30;

/// Parts of the diagonal that are added to it where f32 makes the matrix indefinite.
const LIFTS: [f64; 4] = [1e-6, 1e-5, 1e-4, 1e-3];

/// Steps with the clamped Hessian that show that it is too stiff, if they were long and yet did not lead to where the true one
/// is positive definite;
const CRAWL: usize = 6;

/// long: at least this part of the whole.
const LONG: f64 = 0.5;

/// From one iteration to the next the part of the clamped Hessian in a blend is tried at this part of what it was,
const LESS: f64 = 0.5;

/// then at this multiple of that, until the blend is positive definite;
const MORE: f64 = 2.0;

/// never at less than this.
const LEAST_BLEND: f64 = 1e-3;

/// The model is trusted where a step gained what it foretold up to this part.
const TRUSTED: f64 = 0.1;

impl Method for Newton {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let start = self.here();
        let before = self.factorisations;
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

    fn factor_bytes(&self) -> u64 {
        self.normal.factor_bytes() + self.hessian.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }
}
