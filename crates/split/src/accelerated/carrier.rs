//! What of an iteration is accelerated.

use super::{BuildError, Merit};
use crate::{Admm, DualMap, LocalReport, Order, Problem};
use rayon::prelude::*;

/// Numbers handled by one task.
pub(super) const CHUNK: usize = 8192;

/// What a proposed point is made of; what else it needs is worked out from that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extrapolated {
    /// x, z and u.
    All,
    /// x and u; z is that of the last local step.
    PositionsAndDual,
    /// z alone.
    Local,
}

/// A variable of the fixed-point iteration that ADMM is, and the merit of its points: which of A's algorithms is run.
///
/// A cycle is a local step and a global step. A point is proposed before the local step or, where [`Carrier::LEADS`],
/// between the two; its merit is known after the local step or after the global one.
pub trait Carrier: Send + Sized {
    /// As in messages.
    const NAME: &'static str;
    /// Its order.
    const ORDER: Order;
    /// What a proposal has.
    const EXTRAPOLATED: Extrapolated;
    /// Whether the local step of a cycle comes before the proposal.
    const LEADS: bool = false;
    /// Cycles at the start that only make the variables fit each other, and are no part of the history.
    const SETTLES: usize = 0;
    /// Whether a merit is known only when weights may have changed.
    const LATE: bool = false;
    /// Whether the authors' implementation keeps the history when a point is rejected.
    const KEEPS_HISTORY: bool;

    /// Whether the conditions hold under which the iteration is one of this variable alone.
    ///
    /// # Errors
    /// The condition that does not.
    fn check(admm: &Admm) -> Result<(), BuildError>;

    /// For the terms of a problem under their weights.
    fn new(problem: &Problem) -> Self;

    /// The weights have changed.
    fn reweighted(&mut self, problem: &Problem);

    /// Takes what it needs of the point before a cycle.
    fn before(&mut self, problem: &mut Problem, x: &[f64], p: &[Vec<f64>], u: &[Vec<f64>]);

    /// After the local step: a merit, if it is known so early.
    fn after_local(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], local: &LocalReport) -> Option<Merit>;

    /// After the global step: the merit, if it was not known before.
    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        p: &[Vec<f64>],
        u: &[Vec<f64>],
        local: &LocalReport,
    ) -> Option<Merit>;

    /// The variable before the cycle, in coordinates whose Euclidean norm is the metric of the splitting.
    fn sensed(&self) -> &[f64];

    /// The residual G(q) - q of the cycle just done, in the same coordinates.
    fn residual(&self) -> &[f64];
}

/// w for every entry of the local vectors of all terms, one after another.
pub(super) fn packed_weights(problem: &Problem) -> Vec<f64> {
    let mut weights = vec![0.0; problem.terms.iter().map(|term| term.local_len()).sum()];
    let mut rest = weights.as_mut_slice();
    for term in &problem.terms {
        let (head, tail) = rest.split_at_mut(term.local_len());
        term.local_weights2(head);
        rest = tail;
    }
    weights.iter_mut().for_each(|w| *w = w.sqrt());
    weights
}

/// out <- w value(p, u), entry by entry of all terms, one after another.
pub(super) fn scaled(
    out: &mut [f64],
    weights: &[f64],
    p: &[Vec<f64>],
    u: &[Vec<f64>],
    value: impl Fn(f64, f64) -> f64 + Sync,
) {
    let (mut out, mut weights) = (out, weights);
    for (p, u) in p.iter().zip(u) {
        let (head, tail) = out.split_at_mut(p.len());
        let (w, w_tail) = weights.split_at(p.len());
        let numbers = head.par_iter_mut().zip(w).zip(p.par_iter().zip(u));
        numbers.with_min_len(CHUNK).for_each(|((out, w), (p, u))| *out = w * value(*p, *u));
        (out, weights) = (tail, w_tail);
    }
}

/// to <- to - from
pub(super) fn subtract(to: &mut [f64], from: &[f64]) {
    to.par_iter_mut().zip(from).with_min_len(CHUNK).for_each(|(to, from)| *to -= from);
}

/// That the iteration has this order.
pub(super) fn check_order(admm: &Admm, algorithm: &'static str, needs: Order) -> Result<(), BuildError> {
    if admm.cycle().order == needs { Ok(()) } else { Err(BuildError::Order { algorithm, needs }) }
}

/// That no hard set is on z: Remark 3.1.
pub(super) fn check_sets(admm: &Admm, algorithm: &'static str) -> Result<(), BuildError> {
    match admm.terms().iter().position(|term| term.is_hard()) {
        Some(term) => Err(BuildError::HardSet { term, algorithm }),
        None => Ok(()),
    }
}

/// That x is a function of p = z - u, and an affine one.
pub(super) fn check_exact(admm: &Admm, algorithm: &'static str) -> Result<(), BuildError> {
    let exact = admm.is_exact() && admm.terms().iter().all(|term| term.is_linear());
    if exact { Ok(()) } else { Err(BuildError::Inexact { algorithm }) }
}

/// That the dual of each term is such a function of its z.
pub(super) fn check_duals(admm: &Admm, algorithm: &'static str, least: DualMap) -> Result<(), BuildError> {
    match admm.terms().iter().position(|term| term.dual_map() < least) {
        Some(term) => Err(BuildError::NoDualMap { term, algorithm, affine: least == DualMap::Affine }),
        None => Ok(()),
    }
}
