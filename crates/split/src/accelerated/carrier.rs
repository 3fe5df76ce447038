//! What of an iteration is accelerated.

use super::{BuildError, Merit};
use crate::{Admm, DualMap, LocalReport, Order, Problem, vector};
use rayon::prelude::*;

/// Numbers handled by one task.
pub(super) const CHUNK: usize = 8192;

/// A pass that takes c(Dx) but no prox, in local steps.
pub(super) const COUPLE: f64 = 0.2;

/// What a proposed point is made of; what else it needs is worked out from that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extrapolated {
    /// x, z and u.
    All,
    /// x and u; z is that of the last local step.
    PositionsAndDual,
    /// x alone; z and u are those of the last local step.
    Positions,
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
    /// What judging a point costs, in local steps.
    const SENSING: f64 = 0.0;
    /// What an accelerated point costs besides its history, in local steps.
    const OVERHEAD: f64 = 0.0;
    /// What a rejected point costs: local and global steps.
    const REFUSAL: (f64, f64);
    /// Whether the authors' implementation keeps the history when a point is rejected.
    const KEEPS_HISTORY: bool;

    /// Whether the conditions hold under which the iteration is one of this variable alone.
    ///
    /// # Errors
    /// The condition that does not.
    fn check(admm: &Admm) -> Result<(), BuildError>;

    /// For the terms of a problem under their weights.
    fn new(problem: &Problem) -> Self;

    /// What is sensed of its variable.
    fn sense(&self) -> &Sense;

    /// The same, to be changed.
    fn sense_mut(&mut self) -> &mut Sense;

    /// The weights have changed.
    fn reweigh(&mut self, problem: &Problem) {
        self.sense_mut().reweigh(problem);
    }

    /// Takes what it needs of the point before a cycle.
    fn before(&mut self, _problem: &mut Problem, _x: &[f64], _p: &[Vec<f64>], _u: &[Vec<f64>]) {}

    /// After the local step: a merit, if it is known so early.
    fn after_local(&mut self, _p: &[Vec<f64>], _u: &[Vec<f64>], _local: &LocalReport) -> Option<Merit> {
        None
    }

    /// After the global step: the merit, if it was not known before.
    fn after_global(
        &mut self,
        _problem: &mut Problem,
        _x: &[f64],
        _p: &[Vec<f64>],
        _u: &[Vec<f64>],
        _local: &LocalReport,
    ) -> Option<Merit> {
        None
    }
}

/// The variable q of a carrier before a cycle and the residual G(q) - q of the cycle, entry by entry times w: coordinates
/// whose Euclidean norm is the metric of the splitting, unless the carrier says otherwise.
#[derive(Clone, Debug)]
pub struct Sense {
    pub(super) weights: Vec<f64>, // w, an entry for each of z
    pub(super) before: Vec<f64>,
    pub(super) residual: Vec<f64>,
}

impl Sense {
    /// For the terms of a problem under their weights; q consists of so many vectors of the length of z.
    pub(super) fn new(problem: &Problem, vectors: usize) -> Self {
        let weights = packed_weights(problem);
        let zeros = vec![0.0; vectors * weights.len()];
        Sense { residual: zeros.clone(), before: zeros, weights }
    }

    /// Of a q of so many numbers that are sensed as they are, without weights.
    pub(super) fn unweighted(len: usize) -> Self {
        Sense { weights: Vec::new(), before: vec![0.0; len], residual: vec![0.0; len] }
    }

    /// The weights have changed.
    pub(super) fn reweigh(&mut self, problem: &Problem) {
        self.weights = packed_weights(problem);
    }

    /// before <- w value(p, u), where q is one vector.
    pub(super) fn begin(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], value: impl Fn(f64, f64) -> f64 + Sync) {
        scaled(&mut self.before, &self.weights, p, u, value);
    }

    /// residual <- w value(p, u) - before, where q is one vector.
    pub(super) fn end(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], value: impl Fn(f64, f64) -> f64 + Sync) {
        departure(&mut self.residual, &self.before, &self.weights, p, u, value);
    }

    /// |residual|^2 as a merit.
    pub(super) fn merit(&self) -> Merit {
        Merit::of_square(vector::dot(&self.residual, &self.residual))
    }
}

/// Room for c(Dx) of each term.
pub(super) fn coupled(problem: &Problem) -> Vec<Vec<f64>> {
    problem.terms.iter().map(|term| vec![0.0; term.local_len()]).collect()
}

/// Where a carrier has its [`Sense`].
macro_rules! of_sense {
    ($field:tt) => {
        fn sense(&self) -> &Sense {
            &self.$field
        }

        fn sense_mut(&mut self) -> &mut Sense {
            &mut self.$field
        }
    };
}
pub(super) use of_sense;

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

/// out <- w value(p, u) - before, entry by entry of all terms, one after another; |out|^2.
pub(super) fn departure(
    out: &mut [f64],
    before: &[f64],
    weights: &[f64],
    p: &[Vec<f64>],
    u: &[Vec<f64>],
    value: impl Fn(f64, f64) -> f64 + Sync,
) -> f64 {
    let (mut out, mut before, mut weights, mut square) = (out, before, weights, 0.0);
    for (p, u) in p.iter().zip(u) {
        let (head, tail) = out.split_at_mut(p.len());
        let ((b, b_tail), (w, w_tail)) = (before.split_at(p.len()), weights.split_at(p.len()));
        square += departure_of(head, b, w, p, u, &value);
        (out, before, weights) = (tail, b_tail, w_tail);
    }
    square
}

/// The same for a part of one term; halves by halves, which allocates nothing.
fn departure_of(
    out: &mut [f64],
    before: &[f64],
    weights: &[f64],
    p: &[f64],
    u: &[f64],
    value: &(impl Fn(f64, f64) -> f64 + Sync),
) -> f64 {
    let n = out.len();
    if n <= CHUNK {
        for i in 0..n {
            out[i] = weights[i] * value(p[i], u[i]) - before[i];
        }
        return vector::dot(out, out);
    }
    let m = (n / 2).next_multiple_of(CHUNK);
    let ((o0, o1), (b0, b1), (w0, w1)) = (out.split_at_mut(m), before.split_at(m), weights.split_at(m));
    let ((p0, p1), (u0, u1)) = (p.split_at(m), u.split_at(m));
    let (l, r) = rayon::join(|| departure_of(o0, b0, w0, p0, u0, value), || departure_of(o1, b1, w1, p1, u1, value));
    l + r
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
