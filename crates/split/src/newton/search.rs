//! Where a Newton step leads: straight on, or along the rotations that it means.

use crate::{EnergyReport, NormalMatrix, PointSpring, Problem, Quadratic, SystemError, vector};

/// Part of the linear prediction that a step has to gain (Armijo).
const ARMIJO: f64 = 1e-4;

/// A step that gains this part of what the quadratic model predicts needs no second opinion.
const PREDICTED: f64 = 0.9;

/// Changes of the energy, as part of it, that may be rounding.
const HIDDEN: f64 = 1e-11;

/// Halvings of a step before it is given up.
const SHORTENINGS: usize = 30;

/// A straight step that gains so many times what the quadratic model predicts, after one that did so too, is doubled while
/// that lowers the energy. Near a barrier s^-2 it gains 1.3 times as much, and would bring s to 4/3 s only, again and again.
pub(super) const SURPASSED: f64 = 1.25;

/// Most doublings of a rotation-aware step.
const DOUBLINGS: usize = 2;

/// What a search found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Energy at the new point; none where no point is better.
    pub energy: Option<EnergyReport>,
    /// Whether the rotation-aware candidate was taken.
    pub warped: bool,
    /// Length of the step taken.
    pub t: f64,
    /// (E(x) - E(x + t d)) over the quadratic model's prediction, of the straight step.
    pub ratio: f64,
    /// Points looked at.
    pub looked: usize,
}

/// Looks for a better point along a direction.
#[derive(Default)]
pub struct Search {
    straight: Vec<f64>,
    warped: Vec<f64>,
    best: Vec<f64>,
    rhs: Vec<f64>,
    step: Vec<f64>,
}

impl Search {
    /// The new point, where one was found.
    pub fn x(&self) -> &[f64] {
        &self.best
    }

    /// Goes from x, where the energy is `start`, along d with `slope` = g . d < 0 and `curvature` = d . H d. The first
    /// length, from `first` on and each at most half of the one before, at which the straight or the rotation-aware point
    /// meets Armijo's condition ends the search, with the lower of the two. A straight step that is better than foretold
    /// may become longer, up to `longest`.
    ///
    /// # Errors
    /// A normal matrix that does not fit.
    pub fn run(
        &mut self,
        problem: &mut Problem,
        normal: Option<&mut NormalMatrix>,
        x: &[f64],
        d: &[f64],
        (first, longest): (f64, f64),
        start: f64,
        (slope, curvature): (f64, f64),
    ) -> Result<Found, SystemError> {
        let mut normal = normal;
        let mut found = Found { t: first, ..Found::default() };
        self.best.resize(x.len(), 0.0);
        for turn in 0..SHORTENINGS {
            let t = found.t;
            let enough = start + ARMIJO * t * slope;
            self.straight.clear();
            self.straight.extend_from_slice(x);
            vector::add_scaled(&mut self.straight[..d.len()], t, d);
            let straight = problem.energy(&self.straight, None);
            found.looked += 1;
            let model = t * slope + 0.5 * t * t * curvature;
            let ratio = (straight.value - start) / model;
            if turn == 0 {
                found.ratio = ratio;
            }
            // What rounding hides in the energy cannot tell candidates apart, and the straight one is Newton's.
            let hidden = -t * slope <= HIDDEN * start.abs();
            let sure = (ratio > PREDICTED && model < 0.0) || hidden;
            if let (Some(normal), false) = (&mut normal, sure) {
                self.warp(problem, normal, x, d, t)?;
                let warped = problem.energy(&self.warped, None);
                found.looked += 1;
                let lower = warped.value < straight.value || !straight.value.is_finite();
                if lower && warped.value <= enough {
                    std::mem::swap(&mut self.best, &mut self.warped);
                    found.energy = Some(warped);
                    found.warped = true;
                    if turn == 0 {
                        self.lengthen(problem, normal, x, d, warped, &mut found)?;
                    }
                    return Ok(found);
                }
            }
            if straight.value <= enough {
                std::mem::swap(&mut self.best, &mut self.straight);
                found.energy = Some(straight);
                if turn == 0 && ratio > SURPASSED {
                    self.stride(problem, x, d, longest, straight, &mut found);
                }
                return Ok(found);
            }
            if hidden {
                return Ok(found); // a shorter step would only be accepted for going nowhere
            }
            // The minimum of the parabola through both ends.
            let over = straight.value - start - t * slope;
            let least = if over > 0.0 && over.is_finite() { -0.5 * slope * t * t / over } else { 0.0 };
            found.t = least.clamp(0.1 * t, 0.5 * t);
        }
        Ok(found)
    }

    /// Doubles the straight step while that lowers the energy.
    fn stride(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        d: &[f64],
        longest: f64,
        mut least: EnergyReport,
        found: &mut Found,
    ) {
        while 2.0 * found.t <= longest {
            self.straight.clear();
            self.straight.extend_from_slice(x);
            vector::add_scaled(&mut self.straight[..d.len()], 2.0 * found.t, d);
            let longer = problem.energy(&self.straight, None);
            found.looked += 1;
            let lower = longer.value < least.value;
            if !lower {
                break;
            }
            std::mem::swap(&mut self.best, &mut self.straight);
            found.t *= 2.0;
            least = longer;
        }
        found.energy = Some(least);
    }

    /// Doubles the rotation-aware step while that lowers the energy: bodies that have far to turn take the same turn again.
    fn lengthen(
        &mut self,
        problem: &mut Problem,
        normal: &mut NormalMatrix,
        x: &[f64],
        d: &[f64],
        first: EnergyReport,
        found: &mut Found,
    ) -> Result<(), SystemError> {
        let mut least = first;
        for _ in 0..DOUBLINGS {
            self.warp(problem, normal, x, d, 2.0 * found.t)?;
            let longer = problem.energy(&self.warped, None);
            found.looked += 1;
            let lower = longer.value < least.value;
            if !lower {
                break;
            }
            std::mem::swap(&mut self.best, &mut self.warped);
            found.t *= 2.0;
            least = longer;
        }
        found.energy = Some(least);
        Ok(())
    }

    /// warped <- the positions whose deformation gradients match the turned and stretched ones best, in the norm of the
    /// normal matrix.
    fn warp(
        &mut self,
        problem: &mut Problem,
        normal: &mut NormalMatrix,
        x: &[f64],
        d: &[f64],
        t: f64,
    ) -> Result<(), SystemError> {
        let n = d.len();
        self.step.clear();
        self.step.extend(d.iter().map(|d| t * d));
        self.rhs.resize(n, 0.0);
        self.rhs.fill(0.0);
        for term in &mut problem.terms {
            if let Some(curvature) = term.curvature() {
                curvature.add_warped_gradient(x, &self.step, &mut self.rhs);
            }
        }
        for (node, k, _) in &problem.quadratic.springs {
            for c in 0..problem.dim {
                let at = *node as usize * problem.dim + c;
                if at < n {
                    self.rhs[at] -= k * self.step[at];
                }
            }
        }
        for (node, k) in problem.quadratic.inertia.stiffness().iter().enumerate().take(problem.n_free) {
            for at in node * problem.dim..(node + 1) * problem.dim {
                self.rhs[at] -= k * self.step[at];
            }
        }
        let Quadratic { form, points, .. } = &problem.quadratic;
        if !(form.is_empty() && points.is_empty()) {
            let mut step = vec![0.0; x.len()];
            step[..n].copy_from_slice(&self.step);
            let mut force = vec![0.0; n];
            if !form.is_empty() {
                form.value_and_gradient(&step, problem.dim, Some(&mut force));
            }
            for spring in points {
                PointSpring { target: [0.0; 3], ..*spring }.value_and_gradient(&step, problem.dim, Some(&mut force));
            }
            vector::add_scaled(&mut self.rhs, -1.0, &force);
        }
        normal.solve(&mut self.rhs)?;
        self.warped.clear();
        self.warped.extend_from_slice(x);
        vector::add_scaled(&mut self.warped[..n], -1.0, &self.rhs);
        Ok(())
    }
}
