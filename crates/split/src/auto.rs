//! The splitting first, then Newton.

use crate::{
    Admm, AdmmSettings, EnergyReport, Evaluation, Method, Newton, NewtonSettings, Problem, Residuals, StepReport,
    SystemError,
};

/// Settings of [`Auto`].
#[derive(Clone, Debug, PartialEq)]
pub struct AutoSettings {
    /// Newton's.
    pub newton: NewtonSettings,
    /// Iterations of the splitting before Newton is tried.
    pub first: usize,
}

/// One of the two, at work.
enum Phase {
    Splitting(Box<Admm>),
    Newton(Box<Newton>, AdmmSettings),
    /// Between them; only after an error.
    Nothing,
}

/// The splitting ([`Admm`]) while it is the faster one, then [`Newton`].
pub struct Auto {
    name: String,
    settings: AutoSettings,
    phase: Phase,
    empty: Problem,
    iteration: usize,
}

impl Auto {
    /// Begins with the splitting.
    pub fn new(name: String, admm: Admm, settings: AutoSettings) -> Self {
        let empty = Problem {
            dim: 1,
            n_free: 0,
            x0: Vec::new(),
            terms: Vec::new(),
            quadratic: Default::default(),
            barrier: false,
        };
        Auto { name, settings, phase: Phase::Splitting(Box::new(admm)), empty, iteration: 0 }
    }

    fn to_newton(&mut self) -> Result<(), SystemError> {
        if let Phase::Splitting(admm) = std::mem::replace(&mut self.phase, Phase::Nothing) {
            let (problem, normal, x, admm) = admm.into_parts();
            let newton = Newton::resume(problem, normal, x, self.settings.newton.clone(), self.iteration)?;
            self.phase = Phase::Newton(Box::new(newton), admm);
        }
        Ok(())
    }

    fn to_splitting(&mut self) {
        if let Phase::Newton(newton, admm) = std::mem::replace(&mut self.phase, Phase::Nothing) {
            let (problem, normal, x) = newton.into_parts();
            self.phase = Phase::Splitting(Box::new(Admm::resume(problem, normal, x, admm, self.iteration)));
        }
    }

    fn method(&self) -> Option<&dyn Method> {
        match &self.phase {
            Phase::Splitting(admm) => Some(admm.as_ref()),
            Phase::Newton(newton, _) => Some(newton.as_ref()),
            Phase::Nothing => None,
        }
    }

    fn method_mut(&mut self) -> Option<&mut dyn Method> {
        match &mut self.phase {
            Phase::Splitting(admm) => Some(admm.as_mut()),
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
        if self.iteration == self.settings.first {
            self.to_newton()?;
        }
        let report = self.method_mut().ok_or_else(lost)?.step()?;
        self.iteration = report.iteration;
        if !report.accepted {
            self.to_splitting();
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

    fn residuals(&mut self) -> Residuals {
        self.method_mut().map_or(Residuals { primal: f64::INFINITY, dual: f64::INFINITY }, |m| m.residuals())
    }

    fn factor_bytes(&self) -> u64 {
        self.method().map_or(0, |m| m.factor_bytes())
    }

    fn into_problem(self: Box<Self>) -> Problem {
        match self.phase {
            Phase::Splitting(admm) => admm.into_problem(),
            Phase::Newton(newton, _) => newton.into_problem(),
            Phase::Nothing => self.empty,
        }
    }
}
