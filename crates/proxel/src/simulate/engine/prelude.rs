//! The splitting before Newton's method, where an iteration of that is dear.

use super::Engine;
use crate::deform::admm_settings;
use crate::settings::MethodName;
use crate::simulate::SimulateError;
use crate::simulate::stops::Stops;
use proxel_split::{
    Admm, Evaluation, Method, NormalMatrix, Outcome, Price, Problem, Status, StepReport, Stop, Verdict,
};

/// An iteration of Newton's method that costs less than so many of the splitting needs none before it: what the
/// splitting takes to show its rate would cost more than it saves.
const DEAR: f64 = 10.0;
/// What an iteration of Newton's method costs near the end, where the factor of an earlier Hessian preconditions: this
/// part of one that factors its own. Between 0.3 and 0.4 on a body of 103,680 tetrahedra.
const REUSED: f64 = 1.0 / 3.0;
/// Iterations that a rate is taken over.
const WINDOW: usize = 3;

/// How the splitting ended.
pub(super) enum Prelude {
    /// Where the gradient is below the bound, or by the user.
    Done(Box<Outcome>),
    /// Newton is to go on from here, after so many iterations.
    From(Vec<f64>, usize),
}

impl Engine {
    /// Iterates by the splitting of `auto` from x, for as long as its gradient, going on as it does, is below the bound
    /// before Newton's method would have it there: by counted costs, so that a run is the same on any machine. Nothing
    /// is done where Newton's iterations are cheap, or where there are forces of contact, of limits or of stiffness
    /// damping, which the splitting does not have.
    ///
    /// # Errors
    /// A step that was left without its matrix.
    pub(super) fn prelude(
        &mut self,
        x: Vec<f64>,
        bound: f64,
        limit: usize,
        stops: &mut Stops<'_>,
    ) -> Result<Prelude, SimulateError> {
        let walled = !self.contacts.touches().is_empty();
        let others = self.strain.is_some() || self.damping.is_some();
        if self.settings.method != MethodName::Auto || walled || others {
            return Ok(Prelude::From(x, 0));
        }
        let (normal, hessian) = self.take_matrices()?;
        let price = price(&self.problem, &normal);
        if price < DEAR || price.is_nan() {
            self.return_matrices(normal, hessian);
            return Ok(Prelude::From(x, 0));
        }
        self.wear();
        let problem = std::mem::replace(&mut self.problem, Problem::empty());
        let mut admm = Admm::resume(problem, normal, x, admm_settings(&self.settings), 0);
        let mut race = Race { bound, price, last: Vec::new() };
        let outcome = stops.run(&mut admm, &mut [&mut race], limit);
        let (problem, normal, ..) = admm.into_parts();
        self.put_back(problem, normal, hessian);
        Ok(match outcome.status {
            Status::Stopped if outcome.iterations < limit && !stops.is_over() => {
                Prelude::From(outcome.x, outcome.iterations)
            }
            _ => Prelude::Done(Box::new(outcome)),
        })
    }
}

/// What an iteration of Newton's method costs in iterations of the splitting, counted.
fn price(problem: &Problem, normal: &NormalMatrix) -> f64 {
    let price = Price::of(problem, normal).0;
    price.factor.min(price.gradients)
}

/// Ends the splitting where its gradient is below the bound, and where Newton's method is expected to be there first.
struct Race {
    bound: f64,
    price: f64,
    last: Vec<f64>, // logarithms of the last gradients
}

impl Race {
    /// Whether Newton would win, with this gradient now.
    fn is_lost(&mut self, gradient: f64) -> bool {
        if self.last.len() > WINDOW {
            self.last.remove(0);
        }
        self.last.push(gradient.ln());
        let [first, .., now] = self.last[..] else { return false };
        if self.last.len() <= WINDOW {
            return false;
        }
        let rate = (first - now) / WINDOW as f64;
        let left = now - self.bound.ln();
        // A gradient that grows, or is no number, never gets there.
        !(rate > 0.0 && left / rate <= self.price * newton(left))
    }
}

/// What Newton's method costs for this many factors of e in the gradient, in iterations that factor their Hessian: one,
/// and [`REUSED`] for each of those that double the digits that are right, from one digit on.
fn newton(left: f64) -> f64 {
    1.0 + REUSED * (1.0 + left.max(0.0) / std::f64::consts::LN_10).log2()
}

impl Stop for Race {
    fn check(&mut self, method: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        let Evaluation { energy, gradient_norm } = method.evaluate();
        let barred = method.problem().barrier && energy.inverted > 0;
        if gradient_norm <= self.bound && !barred {
            let reason = format!("gradient {gradient_norm:e} is at most {:e}", self.bound);
            return Some(Verdict { status: Status::Converged, reason });
        }
        let lost = self.is_lost(gradient_norm) && !barred;
        lost.then(|| Verdict { status: Status::Stopped, reason: "Newton's method is to go on".to_string() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Iterations of the splitting, whose gradient falls by this factor each, before Newton follows or the bound is
    /// reached.
    fn stays(factor: f64, bound: f64, price: f64) -> usize {
        let mut race = Race { bound, price, last: Vec::new() };
        let mut gradient = 1.0;
        for k in 0..1000 {
            if gradient <= bound || race.is_lost(gradient) {
                return k;
            }
            gradient *= factor;
        }
        1000
    }

    #[test]
    fn the_splitting_goes_on_where_it_is_there_first() {
        // Two digits cost Newton 1 + log2(3)/3 = 1.5 iterations: 15 of the splitting at a price of 10.
        assert_eq!(stays(0.7, 1e-2, 10.0), 13);
        assert_eq!(stays(0.8, 1e-2, 10.0), WINDOW);
        assert_eq!(stays(0.9, 1e-2, 30.0), 44);
        // Nine digits cost 2.1.
        assert_eq!(stays(0.7, 1e-9, 10.0), WINDOW);
        assert_eq!(stays(0.3, 1e-9, 10.0), 18);
        // What grows or is no number is left to Newton.
        assert_eq!(stays(1.1, 1e-2, 100.0), WINDOW);
        assert_eq!(stays(f64::NAN, 1e-2, 100.0), WINDOW);
    }
}
