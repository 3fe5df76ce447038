//! Iterations on v = z + u in the place of p and u, where they follow from it.

use super::Admm;
use crate::{LocalReport, Order, Pull};

/// What is kept of the terms that fold.
#[derive(Default)]
pub(super) struct Folding {
    v: Vec<Vec<f64>>, // of each term; empty for those that do not fold
    ended: bool,      // p and u are as a local step has left them, so that z = prox(v)
    holds: bool,      // v is the state
    follows: bool,    // p and u have been taken from v
}

impl Admm {
    /// Keeps v = z + u in the place of p and u from the second iteration on, for the terms that can ([`crate::Folded`]): half of
    /// what a local step reads and writes. The iteration is the same but for rounding. Nothing changes in the z-x-u order, with
    /// weights that change, and with global steps that ask for more than [`Pull::AtOrigin`].
    pub fn with_folding(mut self) -> Self {
        self.folding = Some(Folding::default());
        self
    }

    fn folds(&self) -> bool {
        let settings = &self.settings;
        let keeps_weights = settings.reweighting.is_none() && self.balancing.is_none() && self.safe.is_none();
        self.cycle.order == Order::Xzu
            && settings.global.pull() == Pull::AtOrigin
            && settings.renewed_at.is_none()
            && keeps_weights
    }

    /// A local step on v; none, and nothing done, where the state is p and u.
    pub(super) fn folded_half(&mut self) -> Option<LocalReport> {
        let folds = self.folds();
        let folding = self.folding.as_mut()?;
        if !folds || !(folding.holds || folding.ended) {
            // The caller's local step leaves z = prox(v).
            folding.ended = folds;
            return None;
        }
        let (terms, x, pull) = (&mut self.problem.terms, &self.x, &mut self.grad);
        if !folding.holds {
            folding.v.resize_with(terms.len(), Vec::new);
            let locals = self.p.iter().zip(&self.u);
            for ((term, v), (p, u)) in terms.iter_mut().zip(&mut folding.v).zip(locals) {
                v.clear();
                if term.folded().is_some() {
                    v.extend(p.iter().zip(u).map(|(p, u)| p + 2.0 * u));
                }
            }
            folding.holds = true;
        }
        folding.follows = false;
        let mut report = LocalReport::default();
        if terms.is_empty() {
            pull.fill(0.0);
        }
        let relaxation = self.cycle.relaxation;
        let locals = self.p.iter_mut().zip(&mut self.u).zip(&mut folding.v);
        let mut begins = true;
        for (t, (term, ((p, u), v))) in terms.iter_mut().zip(locals).enumerate() {
            if let (None, Some(folded), Some(intake)) = (self.fed, term.folded(), self.settings.global.intake(t))
                && let Some(of_term) = folded.feed(relaxation, x, v, intake)
            {
                self.fed = Some(t);
                report += of_term;
                continue;
            }
            report += match term.folded() {
                Some(folded) => folded.step(relaxation, x, v, pull, begins),
                None => term.pull_step(&self.cycle, x, p, u, pull, begins),
            };
            begins = false;
        }
        Some(report)
    }

    /// p and u as the last iteration has left them.
    pub(super) fn unfold(&mut self) {
        let Some(folding) = self.folding.as_mut().filter(|folding| folding.holds && !folding.follows) else { return };
        let locals = self.p.iter_mut().zip(&mut self.u).zip(&folding.v);
        for (term, ((p, u), v)) in self.problem.terms.iter_mut().zip(locals) {
            if let Some(folded) = term.folded() {
                folded.unfold(v, p, u);
            }
        }
        folding.follows = true;
    }

    /// The same, for somebody to set them: the next local step is of p and u.
    pub(super) fn open(&mut self) {
        self.unfold();
        if let Some(folding) = &mut self.folding {
            (folding.ended, folding.holds) = (false, false);
        }
    }
}
