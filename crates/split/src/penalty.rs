//! A penalty under which the x-z-u iteration is proven to descend: Theorem 3.5 of A.

use crate::{BuildError, Order, Problem};

/// What is known of a term over the set where it is at most some level, in coordinates in which the norm of the splitting is
/// the Euclidean one: g^(y) = g(W^-1 y), B = W in A(26).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelBound {
    /// A Lipschitz constant of the gradient of g^ over the convex hull of that set, all of which is in its domain.
    pub lipschitz: f64,
    /// A bound of the square of that gradient's norm over the set.
    pub force2: f64,
}

/// The penalty, and what it was worked out from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafePenalty {
    /// What squared base weights are multiplied by.
    pub mu: f64,
    /// L_c of Assumption 3.5 under the penalty, L_c/mu in the symbols of A: below 1/2.
    pub lipschitz: f64,
    /// T(x0, z0), the objective at the start.
    pub start: f64,
}

/// How far above the least penalty that will do it is taken: what is asked for is an inequality.
const MARGIN: f64 = 1.01;

/// The level set that the iteration stays in is that of T(x0, z0) plus an excess, which the penalty has to keep c_1 below.
/// In A the excess is 1, in whatever units; any other one serves as well, and the one of these parts and multiples of
/// T(x0, z0), 2^k, that lets the penalty be the least is taken.
const EXCESSES: std::ops::RangeInclusive<i32> = -6..=6;

impl SafePenalty {
    /// The factor that part of |W (z^{k+1} - z^k)|^2 has in what the augmented Lagrangian falls by in an iteration, A(59):
    /// 1/2 - (L/mu)^2 - L/(2 mu) with the penalty in W.
    pub fn descent(&self) -> f64 {
        0.5 - self.lipschitz * (self.lipschitz + 0.5)
    }

    /// For an iteration that starts at x with z = Dx and the dual of A(21), Assumption 3.5(1): the least mu, but for a
    /// margin of 1 %, with c_1 at most the excess and mu/2 - L_c^2/mu > L_c/2, which is mu > 2 L_c. Bounds are those of the terms
    /// under their present weights.
    ///
    /// # Errors
    /// A term without a [`LevelBound`]; an f that may be negative; a start where the objective is not finite.
    pub fn of(problem: &mut Problem, x: &[f64]) -> Result<Self, BuildError> {
        let refuse = |text: &str| Err(BuildError::Setting(format!("a safe penalty: {text}")));
        let f = &problem.quadratic;
        if f.loads.iter().any(|b| *b != 0.0) || !f.potentials.is_empty() || f.constant < 0.0 {
            return refuse(
                "Theorem 3.5 needs an f that is never negative: leave loads, gravity and pressure out, or take static weights \
                 (--penalty weights)",
            );
        }
        if let Some(t) = problem.terms.iter().position(|term| term.is_hard() || term.level_bound(1.0).is_none()) {
            return refuse(&format!(
                "Theorem 3.5 needs energies whose gradients are Lipschitz on level sets, as that of stvk is and those that end \
                 at inversion, have kinks or hard limits are not; term {t} has none (--penalty weights)"
            ));
        }
        let start = problem.energy(x, None).value;
        if !start.is_finite() {
            return refuse("the objective is not finite at the start; begin where no element is collapsed");
        }
        let bound = |level: f64| {
            problem
                .terms
                .iter()
                .filter_map(|term| term.level_bound(level))
                .fold((0.0_f64, 0.0), |(l, f), term| (l.max(term.lipschitz), f + term.force2))
        };
        // Without any energy z stays where its gradient is 0.
        let least = |excess: f64| {
            let (lipschitz, force2) = bound(start + excess);
            let mu = 2.0 * lipschitz;
            (if force2 > 0.0 { mu.max(0.5 * force2 / excess) } else { mu }, lipschitz)
        };
        let excesses = EXCESSES.map(|k| start * f64::from(k).exp2());
        let (mu, lipschitz) = excesses.map(least).fold((f64::INFINITY, 0.0), |a, b| if b.0 < a.0 { b } else { a });
        let mu = MARGIN * mu;
        if !(mu > 0.0 && mu.is_finite()) {
            return refuse("the bounds are no numbers: the start is too far from rest (--penalty weights)");
        }
        Ok(SafePenalty { mu, lipschitz: lipschitz / mu, start })
    }
}

/// That an iteration is one that Theorem 3.5 speaks of.
pub(crate) fn check(order: Order, plain: bool, exact: bool, reweighted: bool) -> Result<(), BuildError> {
    match () {
        () if order != Order::Xzu || !plain => {
            Err(BuildError::Order { algorithm: "a safe penalty (Theorem 3.5)", needs: Order::Xzu })
        }
        () if !exact => Err(BuildError::Inexact { algorithm: "a safe penalty" }),
        () if reweighted => Err(BuildError::Reweighted { algorithm: "a safe penalty" }),
        () => Ok(()),
    }
}
