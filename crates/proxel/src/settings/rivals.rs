//! Settings of the first-order methods that stand beside the rotation-aware ones.

use proxel_split::{Backtracking, QuasiNewtonSettings};
use serde::{Deserialize, Serialize};

/// Settings of the quasi-Newton methods `lbfgs` and `bcqn`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuasiNewton {
    /// Pairs that are kept.
    pub window: usize,
    /// Part of the decrease promised by the slope that a step has to bring.
    pub sufficient: f64,
    /// Factor from one trial step to the next.
    pub shrink: f64,
}

impl QuasiNewton {
    /// Liu, Bouaziz and Kavan 2017.
    pub fn liu() -> Self {
        QuasiNewton { window: 5, sufficient: 0.03, shrink: 0.5 }
    }

    /// Zhu, Bridson and Kaufman 2018.
    pub fn zhu() -> Self {
        QuasiNewton { window: 5, sufficient: 0.2, shrink: 0.5 }
    }

    /// For the method.
    pub(crate) fn to_method(&self, name: &str, blended_and_guarded: bool) -> QuasiNewtonSettings {
        QuasiNewtonSettings {
            name: name.to_string(),
            window: self.window,
            line_search: Backtracking { sufficient: self.sufficient, shrink: self.shrink },
            blended: blended_and_guarded,
            guarded: blended_and_guarded,
        }
    }

    /// Checks numbers that would make no sense.
    pub(super) fn check(&self, name: &str) -> Result<(), String> {
        if !(self.sufficient > 0.0 && self.sufficient < 0.5) {
            return Err(format!("{name}.sufficient is {}; it must be between 0 and 0.5", self.sufficient));
        }
        if !(self.shrink > 0.0 && self.shrink < 1.0) {
            return Err(format!("{name}.shrink is {}; it must be between 0 and 1", self.shrink));
        }
        Ok(())
    }
}

/// Windows of Anderson acceleration: differences that are kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AndersonWindows {
    /// For `aa-admm`; Zhang et al. 2019 take 6.
    pub aa_admm: usize,
    /// For `aadr`.
    pub aadr: usize,
    /// For the plain splitting methods; 0 is none.
    pub others: usize,
}

impl Default for AndersonWindows {
    fn default() -> Self {
        AndersonWindows { aa_admm: 6, aadr: 6, others: 0 }
    }
}
