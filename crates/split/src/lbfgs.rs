//! The global step with rotation awareness: L-BFGS preconditioned by the normal matrix, W section 4.1.

use crate::{GlobalReport, GlobalStep, NormalMatrix, Objective, SystemError, vector};
use std::collections::VecDeque;

/// Which step the stopping rule W(17) looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InnerStop {
    /// The step just taken, as the authors' code does: stop after a step with g . Hg < kappa |Delta L|.
    StepTaken,
    /// The step to be taken next, as printed; it costs a solve that is thrown away when the rule stops.
    NextStep,
}

/// Settings of [`Lbfgs`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LbfgsSettings {
    /// Pairs kept. W: 6.
    pub window: usize,
    /// kappa of W(17). W: 1 for quasi-statics, 2 for parameterization.
    pub kappa: f64,
    /// Most inner steps. W: 100.
    pub max_inner: usize,
    /// Which step W(17) looks at.
    pub stop: InnerStop,
    /// Halve a step until it meets Armijo's condition with 1e-4; otherwise every step has length 1, as in W.
    pub line_search: bool,
}

impl Default for LbfgsSettings {
    fn default() -> Self {
        LbfgsSettings { window: 6, kappa: 1.0, max_inner: 100, stop: InnerStop::StepTaken, line_search: false }
    }
}

/// A curvature pair.
struct Pair {
    s: Vec<f64>, // change of x
    y: Vec<f64>, // change of the gradient
    rho: f64,    // 1 / s . y
}

/// L-BFGS whose first Hessian is the normal matrix, W(5a). Pairs are kept from one global step to the next.
pub struct Lbfgs {
    settings: LbfgsSettings,
    pairs: VecDeque<Pair>, // newest last
    spare: Vec<Pair>,      // storage of dropped pairs
    alpha: Vec<f64>,
    g: Vec<f64>, // gradient at x
    q: Vec<f64>, // H g, the step is -q
    g_new: Vec<f64>,
}

impl Lbfgs {
    /// With an empty history.
    pub fn new(settings: LbfgsSettings) -> Self {
        Lbfgs {
            settings,
            pairs: VecDeque::with_capacity(settings.window + 1),
            spare: Vec::with_capacity(settings.window + 1),
            alpha: Vec::with_capacity(settings.window),
            g: Vec::new(),
            q: Vec::new(),
            g_new: Vec::new(),
        }
    }

    /// q <- H g by the two loops (Nocedal and Wright, Algorithm 7.4); returns g . q.
    fn direction(&mut self, normal: &mut NormalMatrix) -> Result<f64, SystemError> {
        self.q.copy_from_slice(&self.g);
        self.alpha.clear();
        // First loop, newest to oldest: alpha_i = rho_i s_i . q, q -= alpha_i y_i; the update and the next product in one pass.
        let mut newer: Option<(&Pair, f64)> = None;
        for pair in self.pairs.iter().rev() {
            let s_q = match newer {
                None => vector::dot(&pair.s, &self.q),
                Some((newer, alpha)) => vector::add_scaled_then_dot(&mut self.q, -alpha, &newer.y, &pair.s),
            };
            let alpha = pair.rho * s_q;
            self.alpha.push(alpha);
            newer = Some((pair, alpha));
        }
        if let Some((oldest, alpha)) = newer {
            vector::add_scaled(&mut self.q, -alpha, &oldest.y);
        }
        normal.solve(&mut self.q)?;
        // Second loop, oldest to newest: beta = rho_i y_i . q, q += (alpha_i - beta) s_i.
        let mut older: Option<(&Pair, f64)> = None;
        for (pair, alpha) in self.pairs.iter().zip(self.alpha.iter().rev()) {
            let y_q = match older {
                None => vector::dot(&pair.y, &self.q),
                Some((older, c)) => vector::add_scaled_then_dot(&mut self.q, c, &older.s, &pair.y),
            };
            older = Some((pair, alpha - pair.rho * y_q));
        }
        Ok(match older {
            None => vector::dot(&self.g, &self.q),
            Some((newest, c)) => vector::add_scaled_then_dot(&mut self.q, c, &newest.s, &self.g),
        })
    }

    /// Keeps the pair of the step -t q from g to g_new; skips it where s . y is not positive, since H must stay so.
    fn remember(&mut self, t: f64) {
        if self.settings.window == 0 {
            return;
        }
        let n = self.g.len();
        let mut pair = if self.pairs.len() == self.settings.window { self.pairs.pop_front() } else { self.spare.pop() }
            .unwrap_or_else(|| Pair { s: vec![0.0; n], y: vec![0.0; n], rho: 0.0 });
        vector::subtract(&mut pair.y, &self.g_new, &self.g);
        pair.s.copy_from_slice(&self.q);
        pair.s.iter_mut().for_each(|s| *s *= -t);
        let s_y = vector::dot(&pair.s, &pair.y);
        if s_y > 0.0 && s_y.is_finite() {
            pair.rho = 1.0 / s_y;
            self.pairs.push_back(pair);
        } else {
            self.spare.push(pair);
        }
    }
}

/// Armijo's condition with 1e-4; a NaN does not meet it.
fn descended(value: f64, before: f64, slope: f64) -> bool {
    value <= before - 1e-4 * slope
}

impl GlobalStep for Lbfgs {
    fn run(
        &mut self,
        objective: &mut Objective<'_>,
        normal: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        let n = grad.len();
        std::mem::swap(&mut self.g, grad);
        for v in [&mut self.q, &mut self.g_new, grad] {
            v.resize(n, 0.0);
        }
        let mut report = GlobalReport::default();
        let mut value = objective.value;
        // Progress that rounding hides is no reason to go on.
        let enough = self.settings.kappa * objective.local_change.max(1e-15 * value.abs());
        while report.inner < self.settings.max_inner {
            let mut slope = self.direction(normal)?;
            report.solves += 1;
            let descends = slope > 0.0 && slope.is_finite();
            if !descends && !self.pairs.is_empty() {
                // The history has lost its way; the first Hessian alone is positive definite.
                self.reset();
                report.shortened += 1;
                slope = self.direction(normal)?;
                report.solves += 1;
            }
            let last = self.settings.stop == InnerStop::NextStep && report.inner > 0 && slope <= enough;
            if last || slope.is_nan() || slope <= 0.0 {
                break;
            }
            let before = value;
            let mut t = 1.0;
            vector::add_scaled(&mut x[..n], -t, &self.q);
            let mut arrived = objective.at(x, &mut self.g_new);
            while self.settings.line_search && !descended(arrived.value, before, t * slope) && t > 1e-10 {
                vector::add_scaled(&mut x[..n], t / 2.0, &self.q);
                t /= 2.0;
                report.shortened += 1;
                arrived = objective.at(x, &mut self.g_new);
            }
            value = arrived.value;
            report.energy = arrived.energy;
            report.inner += 1;
            self.remember(t);
            std::mem::swap(&mut self.g, &mut self.g_new);
            if self.settings.stop == InnerStop::StepTaken && slope < enough {
                break;
            }
        }
        Ok(report)
    }

    fn reset(&mut self) {
        self.spare.extend(self.pairs.drain(..));
    }
}
