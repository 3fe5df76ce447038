//! Residual balancing: a penalty that adapts itself.

/// When one residual is `ratio` times the other, the penalty is changed by `factor` so that they come closer (He, Yang and
/// Wang 2000; Boyd et al. 2011, section 3.4.1). The scaled dual is changed the other way, so that forces stay.
///
/// The penalty multiplies the squared weights of all terms; sets follow rules of their own. A change costs a factorisation
/// and forgets what was learnt for an acceleration, so that it is considered every so many iterations only, and no more
/// after a while: with a penalty that goes on changing ADMM need not converge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balancing {
    /// How far apart the residuals may be.
    pub ratio: f64,
    /// Factor of a change.
    pub factor: f64,
    /// Iterations between two changes.
    pub every: usize,
    /// Changes that are made at most.
    pub most: usize,
}

impl Default for Balancing {
    fn default() -> Self {
        Balancing { ratio: 10.0, factor: 2.0, every: 5, most: 20 }
    }
}

/// A balancing under way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Balance {
    settings: Balancing,
    mu: f64, // what squared base weights are multiplied by
    waited: usize,
    changes: usize,
}

impl Balance {
    pub fn new(settings: Balancing) -> Self {
        Balance { settings, mu: 1.0, waited: 0, changes: 0 }
    }

    /// Begins anew: what was changed is the base from now on.
    pub fn restart(&mut self) {
        self.waited = 0;
        self.changes = 0;
    }

    /// Takes the squares of the residuals |W(c(Dx) - z)| and |W(z - z_before)|; the new penalty, if there is one.
    pub fn next(&mut self, primal2: f64, dual2: f64) -> Option<f64> {
        let Balancing { ratio, factor, every, most } = self.settings;
        self.waited += 1;
        if self.waited < every || self.changes >= most {
            return None;
        }
        let limit = ratio * ratio;
        if primal2 > limit * dual2 {
            self.mu *= factor;
        } else if dual2 > limit * primal2 {
            self.mu /= factor;
        } else {
            return None;
        }
        self.waited = 0;
        self.changes += 1;
        Some(self.mu)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_residual_is_given_more_weight() {
        let mut balance = Balance::new(Balancing { every: 2, most: 3, ..Balancing::default() });
        assert_eq!(balance.next(1e4, 1.0), None, "too early");
        assert_eq!(balance.next(1e4, 1.0), Some(2.0));
        assert_eq!(balance.next(1.0, 1e4), None);
        assert_eq!(balance.next(1.0, 99.0), None, "near enough");
        assert_eq!(balance.next(1.0, 101.0), Some(1.0));
        assert_eq!((balance.next(0.0, 1.0), balance.next(0.0, 1.0)), (None, Some(0.5)));
        assert_eq!((balance.next(0.0, 1.0), balance.next(0.0, 1.0)), (None, None), "at the end");
        assert_eq!(balance.next(f64::NAN, 1.0), None);
    }
}
