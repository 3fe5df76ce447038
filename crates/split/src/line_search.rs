//! Backtracking line search on the objective of a problem.

use crate::{EnergyReport, Problem, vector};

/// Halvings after which a step is no step: 1e-15 of the first one.
const MOST_TRIALS: usize = 50;

/// Values that differ by less than this part of themselves are equal but for rounding: they are sums over all elements.
const ROUNDING: f64 = 1e-14;

/// Armijo's condition by shrinking steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backtracking {
    /// Part of the decrease promised by the slope that a step has to bring.
    pub sufficient: f64,
    /// Factor from one trial to the next.
    pub shrink: f64,
}

/// Where a search starts: x, and the direction -q that is searched.
#[derive(Clone, Copy, Debug)]
pub struct Ray<'a> {
    /// Positions, of all nodes.
    pub x: &'a [f64],
    /// The direction is -q; of the free nodes.
    pub q: &'a [f64],
    /// E(x).
    pub value: f64,
    /// g . q > 0, the decrease of E for a step of length 1 to first order.
    pub slope: f64,
}

/// A step that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landing {
    /// Its length: the new positions are x - t q.
    pub t: f64,
    /// The objective there.
    pub energy: EnergyReport,
    /// Evaluations of objective and gradient that it took.
    pub trials: usize,
}

impl Backtracking {
    /// The first t of `first`, `first * shrink`, .. with E(x - t q) <= E(x) - sufficient t slope; `trial` and `grad` are then
    /// the positions and the gradient there. Where `may_invert` is false a point with an inverted element is none.
    ///
    /// Near a minimum the decrease drowns in rounding. There a point whose value equals E(x) to rounding is taken where the
    /// slope along the ray has fallen to (1 - 2 sufficient) of its size or turned as far (Hager and Zhang 2005, the
    /// approximate Wolfe condition); that reads the same from exact arithmetic of a quadratic.
    pub fn search(
        &self,
        problem: &mut Problem,
        ray: Ray<'_>,
        first: f64,
        may_invert: bool,
        trial: &mut [f64],
        grad: &mut [f64],
    ) -> Option<Landing> {
        let n = ray.q.len();
        let mut t = first;
        for trials in 1..=MOST_TRIALS {
            trial.copy_from_slice(ray.x);
            vector::add_scaled(&mut trial[..n], -t, ray.q);
            let energy = problem.energy(trial, Some(grad));
            let slope = vector::dot(grad, ray.q);
            let descended = energy.value <= ray.value - self.sufficient * t * ray.slope;
            let level = energy.value <= ray.value + ROUNDING * ray.value.abs();
            let flat = slope.abs() <= (1.0 - 2.0 * self.sufficient) * ray.slope;
            let lawful = may_invert || energy.inverted == 0;
            if slope.is_finite() && lawful && (descended || level && flat) {
                return Some(Landing { t, energy, trials });
            }
            t *= self.shrink;
        }
        None
    }
}
