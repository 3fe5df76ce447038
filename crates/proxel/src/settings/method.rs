//! The methods by name, and what kind each is.

use serde::{Deserialize, Serialize};

/// A method of `deform`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MethodName {
    /// ADMM of Overby et al. 2017: linear coupling, static weights.
    AdmmPd,
    /// Rotation-aware, static weights.
    RAdmm,
    /// Linear coupling, dynamic weights.
    WAdmm,
    /// Rotation-aware, dynamic weights: Brown and Narain 2021.
    Wrapd,
    /// L-BFGS on the energy, preconditioned: Liu, Bouaziz and Kavan 2017.
    Lbfgs,
    /// Blended cured quasi-Newton: Zhu, Bridson and Kaufman 2018.
    Bcqn,
    /// Anderson-accelerated Douglas-Rachford splitting: Ouyang et al. 2020.
    Aadr,
    /// Anderson-accelerated ADMM: Zhang et al. 2019.
    AaAdmm,
    /// WRAPD while it is the faster one, then Newton.
    #[default]
    Auto,
    /// Newton on the true Hessian, projected on demand.
    Newton,
    /// The same without a factor: truncated conjugate gradients.
    NewtonCg,
    /// Newton on a Hessian that is always projected.
    ProjectedNewton,
}

impl MethodName {
    /// All of them.
    pub const ALL: [MethodName; 12] = [
        MethodName::AdmmPd,
        MethodName::RAdmm,
        MethodName::WAdmm,
        MethodName::Wrapd,
        MethodName::Lbfgs,
        MethodName::Bcqn,
        MethodName::Aadr,
        MethodName::AaAdmm,
        MethodName::Auto,
        MethodName::Newton,
        MethodName::NewtonCg,
        MethodName::ProjectedNewton,
    ];

    /// Its name on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            MethodName::AdmmPd => "admm-pd",
            MethodName::RAdmm => "r-admm",
            MethodName::WAdmm => "w-admm",
            MethodName::Wrapd => "wrapd",
            MethodName::Lbfgs => "lbfgs",
            MethodName::Bcqn => "bcqn",
            MethodName::Aadr => "aadr",
            MethodName::AaAdmm => "aa-admm",
            MethodName::Auto => "auto",
            MethodName::Newton => "newton",
            MethodName::NewtonCg => "newton-cg",
            MethodName::ProjectedNewton => "projected-newton",
        }
    }

    /// From its name on the command line.
    pub fn from_name(name: &str) -> Option<MethodName> {
        MethodName::ALL.into_iter().find(|m| m.as_str() == name)
    }

    /// Whether the local variable is the stretch of the polar decomposition.
    pub fn is_rotation_aware(self) -> bool {
        use MethodName::{Auto, Newton, NewtonCg, ProjectedNewton, RAdmm, Wrapd};
        matches!(self, RAdmm | Wrapd | Auto | Newton | NewtonCg | ProjectedNewton)
    }

    /// Whether it splits the problem, so that its weights have to keep a splitting stable.
    pub fn is_splitting(self) -> bool {
        use MethodName::{Bcqn, Lbfgs, Newton, NewtonCg, ProjectedNewton};
        !matches!(self, Lbfgs | Bcqn | Newton | NewtonCg | ProjectedNewton)
    }

    /// Whether hard sets are split off, so that they can hold: the ADMM family. Other methods need derivatives.
    pub fn takes_hard_sets(self) -> bool {
        use MethodName::{AdmmPd, Auto, RAdmm, WAdmm, Wrapd};
        matches!(self, AdmmPd | RAdmm | WAdmm | Wrapd | Auto)
    }

    /// Whether weights follow the stiffness.
    pub fn is_reweighted(self) -> bool {
        matches!(self, MethodName::WAdmm | MethodName::Wrapd | MethodName::Auto)
    }
}
