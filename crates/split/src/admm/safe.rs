//! ADMM under a penalty that is proven to be large enough.

use super::Admm;
use crate::SystemError;
use crate::penalty::{self, SafePenalty};

impl Admm {
    /// Under a penalty for which Theorem 3.5 of A holds from here on: squared weights are mu times the base weights, and
    /// z = Dx, u = W^-2 grad g(z), so that Assumption 3.5 holds.
    ///
    /// # Errors
    /// An iteration or a problem that the theorem does not speak of: [`SafePenalty::of`]; a singular system.
    pub fn with_safe_penalty(mut self) -> Result<Self, SystemError> {
        self.take_safe_penalty()?;
        Ok(self)
    }

    /// The safe penalty, if it has one.
    pub fn safe_penalty(&self) -> Option<SafePenalty> {
        self.safe
    }

    pub(super) fn take_safe_penalty(&mut self) -> Result<(), SystemError> {
        let exact = self.is_exact() && self.problem.terms.iter().all(|term| term.is_linear());
        penalty::check(self.cycle.order, self.cycle.is_plain(), exact, self.is_reweighted())?;
        self.weigh(1.0);
        let safe = SafePenalty::of(&mut self.problem, &self.x)?;
        self.weigh(safe.mu);
        self.refactor_normal()?;
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&mut self.p).zip(&mut self.u) {
            term.couple(&self.x, p);
            term.dual(p, u);
            p.iter_mut().zip(u.iter()).for_each(|(p, u)| *p -= u);
        }
        self.safe = Some(safe);
        Ok(())
    }
}
