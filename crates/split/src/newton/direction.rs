//! How a Newton system is assembled, factored and solved.

use super::{CgEnd, CgReport, FactorCost, Found, LinearSolver, Newton, ProjectionRule};
use crate::{Precision, Projection, SystemError};

impl Newton {
    /// The direction, left in `cg.d`; inner steps, and whether the Hessian behind it is the true one.
    pub(super) fn direction(&mut self) -> Result<CgReport, SystemError> {
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
        self.leave_double();
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
        let mut found = self.by_new_factor(tolerance, is_tried, clamped)?;
        if found.is_none_or(|report| is_poor(&report)) && self.turn_to_double() {
            found = self.by_new_factor(tolerance, false, clamped)?;
        }
        if let Some(report) = found {
            return Ok(report);
        }
        // Not even absolute eigenvalues can be factored: with some more on the diagonal they can, and that is still a good
        // preconditioner.
        for lift in LIFTS {
            self.factorisations += 1;
            if self.hessian.factor_lifted(&self.normal, lift)? {
                return self.preconditioned(tolerance, WITH_LIFTED_FACTOR);
            }
        }
        self.by_gradients()
    }

    /// With a factor of the first Hessian that the rule asks for and that can be factored; none where none can. The true one
    /// is assembled already where it `is_tried`.
    fn by_new_factor(
        &mut self,
        tolerance: f64,
        is_tried: bool,
        clamped: usize,
    ) -> Result<Option<CgReport>, SystemError> {
        for projection in self.projections().into_iter().flatten() {
            if projection == Projection::Clamp
                && self.is_blended(clamped)
                && let Some(report) = self.by_blend(tolerance)?
            {
                self.clamped = clamped + 1;
                return Ok(Some(report));
            }
            if !(is_tried && projection == Projection::None) {
                self.assemble(projection)?;
            }
            if !self.factor()? {
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
            } else {
                self.definite = projection == Projection::None;
            }
            return Ok(Some(report));
        }
        Ok(None)
    }

    /// Factors the assembled Hessian; false where it is not positive definite to that precision.
    fn factor(&mut self) -> Result<bool, SystemError> {
        self.factorisations += 1;
        match self.hessian.precision() {
            Precision::Double if self.settings.shift > 0.0 => self.hessian.factor_lifted(&self.normal, DOUBLE_SHIFT),
            _ => self.hessian.factor(&self.normal, self.settings.shift),
        }
    }

    /// Factors get 64 bits where they had 32 and there is memory for it: for some iterations the first time, since it may be
    /// the map that is bad, which soon gets better; for good the second time.
    fn turn_to_double(&mut self) -> bool {
        // Twice as many bytes as an f32 factor.
        let bytes = 2.0 * FactorCost::of(&self.normal, self.problem.dim).bytes;
        if self.hessian.precision() == Precision::Double || bytes > self.settings.memory {
            return false;
        }
        self.hessian.set_precision(Precision::Double);
        self.double_for = if self.was_double { usize::MAX } else { FIRST_DOUBLE };
        self.was_double = true;
        self.wait = 0;
        self.back_off = 0;
        true
    }

    /// At the beginning of an iteration: 32 bits again, where their time has come.
    fn leave_double(&mut self) {
        if self.hessian.precision() == Precision::Double {
            self.double_for = self.double_for.saturating_sub(1);
            if self.double_for == 0 {
                self.hessian.set_precision(Precision::Single);
            }
        }
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
            if self.factor()? {
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

    /// Conjugate gradients on the assembled Hessian, preconditioned with the factor as it is.
    fn preconditioned(&mut self, tolerance: f64, limit: usize) -> Result<CgReport, SystemError> {
        let (matrix, factor, scratch) = self.hessian.parts();
        self.cg.solve(
            &self.grad,
            tolerance,
            limit,
            |p, q| matrix.multiply(p, q).map_err(SystemError::from),
            |z| factor.map_or(Ok(()), |factor| factor.solve(z, 1, scratch)).map_err(SystemError::from),
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

/// Whether corrections of a factor have left most of the residual: the f32 factor has lost the matrix in rounding.
fn is_poor(report: &CgReport) -> bool {
    report.end == CgEnd::Limit && report.residual > USEFUL
}

/// Iterations for which factors have 64 bits the first time.
const FIRST_DOUBLE: usize = 6;

/// Part of each entry of the diagonal that is added to it where a Hessian is factored in f64 that would be shifted in f32: what
/// rounding may take from a row of the factor.
const DOUBLE_SHIFT: f64 = 1e-13;

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
