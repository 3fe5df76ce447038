//! What accelerated iterations cost.

use super::carrier::Carrier;
use crate::{Admm, Method, Trial};

/// What the parts of an iteration cost, in nanoseconds of a core as they were measured on bars of 1,620 tetrahedra; counted
/// from the problem's sizes, so that a run is the same on any machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterationPrice {
    local: f64,  // a local step
    solve: f64,  // a global step
    sensed: f64, // a pass over what is sensed
    values: f64, // a pass over what is extrapolated
}

/// A number that a pass over a vector reads or writes: in a cache ..
const NEAR: f64 = 0.25;
/// .. and in memory.
const FAR: f64 = 1.0;
/// Numbers of a history that fit a cache.
const CACHE: f64 = 262_144.0;
/// An entry of a factor, which a solve reads twice, for each coordinate.
const ENTRY: f64 = 0.7;
/// Passes over what is sensed: scaling before and after, the difference, the norm; those of a column, and others.
const SENSED: [f64; 2] = [1.0, 7.0];
/// Passes over what is extrapolated, likewise: packing, the image, the difference, the proposal, unpacking.
const VALUES: [f64; 2] = [1.0, 9.0];

impl IterationPrice {
    /// Of an iteration whose carrier senses and extrapolates so many numbers, under a history of `columns`.
    pub(super) fn new(admm: &Admm, sensed: usize, values: usize, columns: usize) -> Self {
        let problem = admm.problem();
        let local = problem.terms.iter().map(|term| term.local_work()).sum();
        let solve = ENTRY * (problem.dim * admm.normal().symbolic().factor_nnz()) as f64 + admm.global_work();
        let history = ((sensed + values) * (columns + 2)) as f64;
        let number = if history > CACHE { FAR } else { NEAR };
        IterationPrice { local, solve, sensed: number * sensed as f64, values: number * values as f64 }
    }

    /// A step of the carrier, in plain iterations.
    pub(super) fn of<C: Carrier>(&self, trial: &Trial) -> f64 {
        let columns = trial.columns as f64;
        let passes = |[each, others]: [f64; 2]| each * columns + others;
        let history = passes(SENSED) * self.sensed + passes(VALUES) * self.values;
        let (locals, solves) = C::REFUSAL;
        let refusal = locals * self.local + solves * self.solve + 2.0 * self.values;
        let accelerated = f64::from(u8::from(trial.columns > 0)) * C::OVERHEAD * self.local;
        let plain = self.local + self.solve;
        let extra = C::SENSING * self.local + accelerated + history + trial.rejected as f64 * refusal;
        1.0 + extra / plain.max(f64::MIN_POSITIVE)
    }
}
