//! Iterations in one pass, where the problem allows it.

use super::{Admm, Last};
use crate::{LocalReport, Order, StepReport, Trial, Uncoupled, vector};

/// What is known of it.
#[derive(Clone, Debug, Default)]
pub(super) enum Sweeping {
    /// To be looked at.
    #[default]
    Unknown,
    /// Nodes are tied to each other, or the term knows no such way.
    No,
    /// This is all that the nodes have of their own.
    Yes(Box<Uncoupled>),
}

impl Admm {
    fn uncoupled(&self) -> Option<Uncoupled> {
        let settings = &self.settings;
        let is_plain = self.cycle.order == Order::Zxu && self.alternations == 1 && settings.global.is_solve();
        let keeps_weights = settings.reweighting.is_none() && self.balancing.is_none() && self.safe.is_none();
        if !is_plain || !keeps_weights || settings.renewed_at.is_some() {
            return None;
        }
        Uncoupled::of(&self.problem, self.normal.diagonal()?)
    }

    /// A whole iteration in one pass; none, and nothing done, where it takes two halves.
    pub(super) fn sweep(&mut self) -> Option<StepReport> {
        if let Sweeping::Unknown = self.sweeping {
            self.sweeping = self.uncoupled().map_or(Sweeping::No, |own| Sweeping::Yes(Box::new(own)));
        }
        let Sweeping::Yes(own) = &self.sweeping else { return None };
        let ([term], [p], [u]) = (&mut self.problem.terms[..], &mut self.p[..], &mut self.u[..]) else { return None };
        self.before.resize(self.x.len(), 0.0);
        vector::copy(&mut self.before, &self.x);
        if !term.sweep(own, &mut self.x, p, u) {
            self.sweeping = Sweeping::No;
            return None;
        }
        self.forget();
        self.last = Last::Swept;
        self.iteration += 1;
        Some(StepReport {
            iteration: self.iteration,
            inner: 1,
            refactorised: false,
            accepted: true,
            energy_z: 0.0,
            merit: None,
            trial: Trial::default(),
            local: LocalReport::default(),
        })
    }
}
