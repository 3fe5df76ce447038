//! Changes of the weights on the way.

use super::{Admm, Sweeping};
use crate::{LocalReport, SystemError};

impl Admm {
    /// Squared weights become mu times the base weights; forces stay.
    pub(super) fn weigh(&mut self, mu: f64) {
        for ((term, p), u) in self.problem.terms.iter_mut().zip(&mut self.p).zip(&mut self.u) {
            term.propose_weights((mu, mu));
            term.take_weights(p, u);
        }
    }

    /// New weights in the normal matrix, or in what the global step has in its place.
    pub(super) fn refactor_normal(&mut self) -> Result<(), SystemError> {
        self.sweeping = Sweeping::Unknown;
        self.settings.global.reset();
        if self.settings.global.precision().is_some() {
            self.normal.refactor(&self.problem)?;
        }
        self.settings.global.weigh(&self.problem)
    }

    /// Raises or lowers the penalty where one residual is much larger than the other.
    pub(super) fn balance(&mut self, local: &LocalReport) -> Result<bool, SystemError> {
        let Some(mu) = self.balancing.as_mut().and_then(|balance| balance.next(local.gap2, local.moved2)) else {
            return Ok(false);
        };
        self.weigh(mu);
        self.refactor_normal()?;
        Ok(true)
    }

    /// Takes the candidate weights where one of them asks for it, W(22)-(23).
    pub(super) fn reweight(&mut self) -> Result<bool, SystemError> {
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
}
