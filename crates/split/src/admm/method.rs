//! ADMM as a [`Method`].

use super::{Admm, Last};
use crate::{
    EnergyReport, Evaluation, Method, Order, Problem, Residual, Residuals, Splitting, SquaredResiduals, StepReport,
    SystemError,
};

impl Admm {
    /// An iteration in two halves, whether or not it could be one pass: its report has a local step.
    pub(crate) fn step_in_halves(&mut self) -> Result<StepReport, SystemError> {
        let mut local = self.local_half(); // W(10b), W(10c)
        let mut inner = 0;
        for _ in 1..self.alternations {
            inner += self.positions_step(&local)?;
            local = self.local_half();
        }
        let report = self.global_half(local)?; // W(10a), W(22)-(23)
        Ok(StepReport { inner: report.inner + inner, ..report })
    }

    fn residual(&mut self) -> Residual {
        self.unfold();
        let mut residual = Residual::default();
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&self.p).zip(&self.u) {
            residual += term.residual(&self.x, p, u);
        }
        residual
    }

    /// sum w^2 |c(Dx) - c(Dx_before)|^2 of the last iteration in the z-x-u order, the square of its dual residual; infinite
    /// where there was none.
    fn shift2(&mut self) -> f64 {
        if self.before.len() != self.x.len() {
            return f64::INFINITY;
        }
        let mut shift2 = 0.0;
        for (term, half) in self.problem.terms.iter_mut().zip(&mut self.coupled) {
            // A residual is that from p + u: of two halves, which add up exactly.
            term.couple(&self.before, half);
            half.iter_mut().for_each(|c| *c *= 0.5);
            shift2 += term.residual(&self.x, half, half).gap2;
        }
        shift2
    }
}

impl Method for Admm {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        if let Some(report) = self.sweep() {
            return Ok(report);
        }
        self.step_in_halves()
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
        Some(self.residual().gap2)
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
        self.unfold();
        Some(Splitting { problem: &mut self.problem, x: &self.x, p: &self.p, u: &self.u })
    }

    fn squared_residuals(&mut self) -> Option<SquaredResiduals> {
        let forward = match (&self.last, self.cycle.order) {
            (Last::None, _) => return None,
            (Last::Local(local), Order::Xzu) => {
                let combined = local.combined();
                return Some(SquaredResiduals { forward: self.forward_residual()?, combined });
            }
            (Last::Local(local), Order::Zxu) => local.gap2,
            (Last::Swept, _) => {
                let mut residual = Residual::default();
                for ((term, p), u) in self.problem.terms.iter_mut().zip(&self.p).zip(&self.u) {
                    residual += term.residual(&self.before, p, u);
                }
                residual.gap2
            }
        };
        Some(SquaredResiduals { forward, combined: self.residual().gap2 + self.shift2() })
    }

    fn factor_bytes(&self) -> u64 {
        self.normal.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }

    fn residuals(&mut self) -> Residuals {
        let residual = self.residual();
        let dual2 = if self.cycle.order == Order::Zxu { self.shift2() } else { self.moved2 };
        let relative = |part2: f64| (part2 / residual.size2.max(f64::MIN_POSITIVE)).sqrt();
        Residuals { primal: relative(residual.gap2), dual: relative(dual2) }
    }

    fn forces(&mut self) -> Option<Vec<f64>> {
        self.unfold();
        let mut forces = vec![0.0; self.x.len()];
        self.problem.penalty(&self.x, &self.p, &mut forces);
        Some(forces)
    }

    fn forces_of_term(&mut self, term: usize) -> Option<Vec<f64>> {
        self.unfold();
        let mut forces = vec![0.0; self.x.len()];
        self.problem.terms.get_mut(term)?.penalty(&self.x, &self.p[term], &mut forces);
        Some(forces)
    }
}
