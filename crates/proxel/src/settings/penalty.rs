//! What the penalty of a splitting is.

use super::MethodName;
use serde::{Deserialize, Serialize};

/// What squared weights are multiplied by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PenaltyName {
    /// Nothing: the weights are what the method makes of them.
    #[default]
    Weights,
    /// The least factor for which the plain iteration is proven to descend, Theorem 3.5 of Zhang et al. 2019:
    /// [`proxel_split::SafePenalty`]. For energies that are Lipschitz on level sets, which is stvk, without loads and hard sets;
    /// slow.
    Safe,
}

impl PenaltyName {
    /// The names on the command line.
    pub const NAMES: [&'static str; 2] = ["weights", "safe"];

    /// From its name on the command line.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "weights" => Some(PenaltyName::Weights),
            "safe" => Some(PenaltyName::Safe),
            _ => None,
        }
    }

    /// Whether a method can have it.
    ///
    /// # Errors
    /// Which ones can.
    pub(crate) fn check(self, method: MethodName) -> Result<(), String> {
        match (self, method) {
            (PenaltyName::Weights, _) | (_, MethodName::AdmmPd | MethodName::AaAdmm) => Ok(()),
            _ => Err(format!(
                "a safe penalty is one of linear couplings and static weights, not of {}; use --method admm-pd or aa-admm",
                method.as_str()
            )),
        }
    }
}
