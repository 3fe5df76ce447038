//! The global step with rotation awareness: L-BFGS preconditioned by the normal matrix, W section 4.1.

use crate::{GlobalReport, GlobalStep, NormalMatrix, Objective, Pairs, Precision, SystemError, vector};

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
    /// Precision of the first Hessian's factor.
    pub precision: Precision,
    /// Halve a step until it meets Armijo's condition with 1e-4; otherwise every step has length 1, as in W.
    pub line_search: bool,
}

impl Default for LbfgsSettings {
    fn default() -> Self {
        LbfgsSettings {
            window: 6,
            kappa: 1.0,
            max_inner: 100,
            stop: InnerStop::StepTaken,
            precision: Precision::Double,
            line_search: false,
        }
    }
}

/// L-BFGS whose first Hessian is the normal matrix, W(5a). Pairs are kept from one global step to the next.
pub struct Lbfgs {
    settings: LbfgsSettings,
    pairs: Pairs,
    g: Vec<f64>, // gradient at x
    q: Vec<f64>, // H g, the step is -q
    g_new: Vec<f64>,
}

impl Lbfgs {
    /// With an empty history.
    pub fn new(settings: LbfgsSettings) -> Self {
        let pairs = Pairs::new(settings.window);
        Lbfgs { settings, pairs, g: Vec::new(), q: Vec::new(), g_new: Vec::new() }
    }

    /// q <- H g; returns g . q.
    fn direction(&mut self, normal: &mut NormalMatrix) -> Result<f64, SystemError> {
        self.pairs.direction(&self.g, &mut self.q, normal)
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
            let (g, q, g_new) = (&self.g, &self.q, &self.g_new);
            self.pairs.remember(n, |s, y| {
                vector::scale_to(s, -t, q);
                vector::subtract(y, g_new, g);
            });
            std::mem::swap(&mut self.g, &mut self.g_new);
            if self.settings.stop == InnerStop::StepTaken && slope < enough {
                break;
            }
        }
        Ok(report)
    }

    fn precision(&self) -> Option<Precision> {
        Some(self.settings.precision)
    }

    fn reset(&mut self) {
        self.pairs.clear();
    }
}
