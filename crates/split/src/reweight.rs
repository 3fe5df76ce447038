//! When and how far the weights follow the stiffness.

/// The interval, in units of the base weight, that candidate weights are clamped to in iteration k = 0, 1, ...: W(22).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Static before iteration `from`, then [min, max]. W, section 6.1: from 50, [0.1, 10].
    Late {
        /// First iteration that may reweight.
        from: usize,
        /// beta_min
        min: f64,
        /// beta_max
        max: f64,
    },
    /// Static before iteration `from`, then [1, min(first growth^(k - from), cap)], W(24): 10, 1.5, 1e9, from 0. The first
    /// iterations of a map move everything, and what is stiff in them says little about the rest.
    Growing {
        /// First iteration that may reweight.
        from: usize,
        /// beta_max there
        first: f64,
        /// Factor an iteration
        growth: f64,
        /// Largest beta_max
        cap: f64,
    },
}

impl Range {
    /// (beta_min, beta_max) in iteration k, or none where the weights are static.
    pub fn at(&self, k: usize) -> Option<(f64, f64)> {
        match *self {
            Range::Late { from, min, max } => (k >= from).then_some((min, max)),
            Range::Growing { from, first, growth, cap } => {
                (k >= from).then(|| (1.0, (first * growth.powf((k - from) as f64)).min(cap)))
            }
        }
    }
}

/// Weights below the local stiffness are faster where they converge, and may run in circles where they do not: when the
/// local variables have stopped settling, the candidate weights of the elements that keep them from it are raised, and
/// taken at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hardening {
    /// Iterations that are judged together.
    pub window: usize,
    /// The dual residual, squared and summed over a window, has to fall at least to this part of the window before.
    pub required: f64,
    /// Factor of the candidate weights where it does not.
    pub factor: f64,
    /// Raised are elements whose w^2 |c(Dx) - z|^2 is at least this many times the mean of their term, or
    /// half of the largest.
    pub above: f64,
}

impl Default for Hardening {
    fn default() -> Self {
        Hardening { window: 10, required: 0.9, factor: 1.6, above: 3.0 }
    }
}

impl Hardening {
    /// For linear couplings, which are slow in rotations: a residual that falls slowly is none that runs in a circle.
    pub fn patient() -> Self {
        Hardening { required: 1.0, above: 10.0, ..Self::default() }
    }
}

/// Watches the dual residual for [`Hardening`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Settling {
    sum: f64,
    count: usize,
    before: Option<f64>,
}

impl Settling {
    /// Takes the square of a dual residual; true where it has not fallen as required.
    pub fn has_stopped(&mut self, moved2: f64, rule: &Hardening) -> bool {
        self.sum += moved2;
        self.count += 1;
        if self.count < rule.window {
            return false;
        }
        let stopped = self.before.is_some_and(|before| self.sum > rule.required * before);
        *self = Settling { before: (!stopped).then_some(self.sum), ..Default::default() };
        stopped
    }
}

/// Dynamic reweighting, W section 5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reweighting {
    /// Where candidate weights are clamped to.
    pub range: Range,
    /// gamma of W(23): all elements are reweighted when the ratio of one exceeds it.
    pub trigger: f64,
    /// When to raise candidate weights.
    pub hardening: Option<Hardening>,
}

impl Reweighting {
    /// Quasi-static deformation, W section 6.1.
    pub fn quasi_static() -> Self {
        Reweighting { range: Range::Late { from: 50, min: 0.1, max: 10.0 }, trigger: 1.5, hardening: None }
    }

    /// Parameterization, W section 6.2.
    pub fn parameterization() -> Self {
        Reweighting {
            range: Range::Growing { from: 1, first: 15.0, growth: 1.5, cap: 1e9 },
            trigger: 1.5,
            hardening: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settling_is_judged_by_windows() {
        let rule = Hardening { window: 2, required: 0.8, ..Default::default() };
        let mut settling = Settling::default();
        let verdicts: Vec<bool> =
            [4.0, 4.0, 2.0, 2.0, 2.0, 1.5, 9.0, 9.0].map(|m| settling.has_stopped(m, &rule)).to_vec();
        // 8, then 4: fell; then 3.5 of 4: stopped, and what follows is judged anew.
        assert_eq!(verdicts, [false, false, false, false, false, true, false, false]);
    }

    #[test]
    fn the_schedules_of_section_6() {
        let late = Reweighting::quasi_static().range;
        assert_eq!((late.at(49), late.at(50), late.at(900)), (None, Some((0.1, 10.0)), Some((0.1, 10.0))));
        let growing = Reweighting::parameterization().range;
        assert_eq!(growing.at(0), None);
        assert_eq!(growing.at(1), Some((1.0, 15.0)));
        assert_eq!(growing.at(2), Some((1.0, 22.5)));
        assert_eq!(growing.at(1000), Some((1.0, 1e9)));
    }
}
