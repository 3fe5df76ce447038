//! From one minimum to the next: methods that begin with what is left of an earlier run.

mod kept;
mod response;

pub use kept::Kept;
pub use response::{Response, respond};

use crate::{
    AdmmSettings, Auto, AutoSettings, EnergyReport, Evaluation, Method, Parts, Problem, Residuals, StepReport,
    SystemError,
};

/// A Newton step of full length that gained what it foretold up to this part was in the region where its factor serves on.
const FORETOLD: f64 = 0.2;

/// One of the two, at work.
enum Phase {
    Kept(Box<Kept>),
    Auto(Box<Auto>),
    /// Between them; only after an error.
    Nothing,
}

/// [`Kept`] while its factor serves, then [`Auto`], from Newton on, until there is a factor that serves again: Newton's
/// method with a factor for several steps (Shamanskii 1967), as many as it is good for.
///
/// For a body that moves on a little from a minimum: [`respond`] gives the start, this the rest. Where the factor is of no
/// use one step is lost.
pub struct Warm {
    name: String,
    settings: AutoSettings,
    phase: Phase,
    admm: Option<AdmmSettings>, // while it is not with `auto`
    empty: Problem,
}

impl Warm {
    /// From the start of `auto`, which has nothing from before.
    pub fn cold(name: String, auto: Auto, settings: AutoSettings) -> Self {
        Self::begin(name, settings, Phase::Auto(Box::new(auto)), None)
    }

    /// Goes on from where another method has got to.
    ///
    /// # Errors
    /// A term without second derivatives.
    pub fn resume(name: String, parts: Parts, settings: AutoSettings) -> Result<Self, SystemError> {
        let Parts { problem, normal, x, admm, hessian } = parts;
        match hessian {
            Some(hessian) if hessian.is_factored() => {
                let kept = Kept::resume(problem, normal, hessian, x, 0);
                Ok(Self::begin(name, settings, Phase::Kept(Box::new(kept)), Some(admm)))
            }
            hessian => {
                let parts = Parts { problem, normal, x, admm, hessian };
                let auto = Auto::resume(name.clone(), parts, settings.clone(), 0)?;
                Ok(Self::begin(name, settings, Phase::Auto(Box::new(auto)), None))
            }
        }
    }

    fn begin(name: String, settings: AutoSettings, phase: Phase, admm: Option<AdmmSettings>) -> Self {
        Warm { name, settings, phase, admm, empty: Problem::empty() }
    }

    /// What it has worked with, for the next; none after an error.
    pub fn into_parts(self) -> Option<Parts> {
        match self.phase {
            Phase::Kept(kept) => {
                let (problem, normal, x, hessian) = kept.into_parts();
                Some(Parts { problem, normal, x, admm: self.admm?, hessian: Some(hessian) })
            }
            Phase::Auto(auto) => auto.into_parts(),
            Phase::Nothing => None,
        }
    }

    /// Whether the factor from before is at work.
    pub fn is_kept(&self) -> bool {
        matches!(self.phase, Phase::Kept(_))
    }

    fn enter_auto(&mut self, iteration: usize) -> Result<(), SystemError> {
        if let (Phase::Kept(kept), Some(admm)) = (std::mem::replace(&mut self.phase, Phase::Nothing), self.admm.take())
        {
            let (problem, normal, x, hessian) = kept.into_parts();
            let parts = Parts { problem, normal, x, admm, hessian: Some(hessian) };
            let auto = Auto::resume(self.name.clone(), parts, self.settings.clone(), iteration)?;
            self.phase = Phase::Auto(Box::new(auto));
        }
        Ok(())
    }

    /// After a step of `auto`: whether it has left a factor that serves on.
    fn is_renewed(&self, report: &StepReport) -> bool {
        let Phase::Auto(auto) = &self.phase else { return false };
        let Some(newton) = auto.newton() else { return false };
        let last = newton.last();
        let foretold = (last.ratio - 1.0).abs() < FORETOLD;
        report.accepted && newton.hessian().is_factored() && last.t == 1.0 && !last.warped && foretold
    }

    fn enter_kept(&mut self, iteration: usize) {
        let Phase::Auto(auto) = std::mem::replace(&mut self.phase, Phase::Nothing) else { return };
        let Some(Parts { problem, normal, x, admm, hessian: Some(hessian) }) = auto.into_parts() else { return };
        self.admm = Some(admm);
        self.phase = Phase::Kept(Box::new(Kept::resume(problem, normal, hessian, x, iteration)));
    }

    fn method(&self) -> Option<&dyn Method> {
        match &self.phase {
            Phase::Kept(kept) => Some(kept.as_ref()),
            Phase::Auto(auto) => Some(auto.as_ref()),
            Phase::Nothing => None,
        }
    }

    fn method_mut(&mut self) -> Option<&mut dyn Method> {
        match &mut self.phase {
            Phase::Kept(kept) => Some(kept.as_mut()),
            Phase::Auto(auto) => Some(auto.as_mut()),
            Phase::Nothing => None,
        }
    }
}

impl Method for Warm {
    fn name(&self) -> &str {
        &self.name
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        match &mut self.phase {
            Phase::Kept(kept) => {
                let mut report = kept.step()?;
                if !report.accepted {
                    self.enter_auto(report.iteration)?;
                    // That the old factor is of no use says nothing of a new one.
                    report.accepted = true;
                }
                Ok(report)
            }
            Phase::Auto(auto) => {
                let report = auto.step()?;
                if self.is_renewed(&report) {
                    self.enter_kept(report.iteration);
                }
                Ok(report)
            }
            Phase::Nothing => {
                let what = "the method ended with an error before; build it anew";
                Err(SystemError::Factor(what.to_string()))
            }
        }
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
        self.into_parts().map_or_else(Problem::empty, |parts| parts.problem)
    }
}
