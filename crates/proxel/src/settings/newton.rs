//! Settings of the methods with second derivatives.

use super::MethodName;
use proxel_split::{AutoSettings, LinearSolver, Projection, ProjectionRule};
use serde::{Deserialize, Serialize};

/// Which Hessian the methods of Newton's kind use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProjectionName {
    /// The true one, clamped only where it is not positive definite (Longva et al. 2023).
    #[default]
    OnDemand,
    /// Negative eigenvalues of elements become 0.
    Clamp,
    /// Negative eigenvalues of elements become positive.
    Abs,
    /// Clamp where the last step went as foretold, absolute where not (Chen et al. 2024).
    TrustRegion,
}

/// Settings of the methods of Newton's kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NewtonSettings {
    /// Which Hessian is used; for `projected-newton`, on demand means clamp.
    pub projection: ProjectionName,
    /// Most iterations with a projected Hessian after the true one was not positive definite.
    pub back_off: usize,
    /// Whether the rotation-aware candidate is looked at beside the straight step.
    pub warp: bool,
    /// Most conjugate-gradient steps an iteration.
    pub max_inner: usize,
    /// `auto` turns to Newton when WRAPD gains less than this part of all it has gained, in the time of a Newton iteration.
    pub gain: f64,
    /// Iterations over which that is averaged.
    pub window: usize,
    /// Iterations of WRAPD after which `auto` tries Newton anyway.
    pub longest: usize,
    /// Iterations of WRAPD after Newton has failed the first time.
    pub retreat: usize,
    /// Bytes that a factor of the Hessian may take; beyond, `auto` uses conjugate gradients, and others refuse.
    pub memory: f64,
}

impl Default for NewtonSettings {
    fn default() -> Self {
        NewtonSettings {
            projection: ProjectionName::OnDemand,
            back_off: 2,
            warp: true,
            max_inner: 400,
            gain: 0.07,
            window: 3,
            longest: 200,
            retreat: 20,
            memory: 8e9,
        }
    }
}

impl NewtonSettings {
    /// For the method of this name.
    pub fn of(&self, name: MethodName) -> proxel_split::NewtonSettings {
        let on_demand = match name {
            MethodName::ProjectedNewton => ProjectionRule::Always(Projection::Clamp),
            _ => ProjectionRule::OnDemand { back_off: self.back_off, blended: false },
        };
        proxel_split::NewtonSettings {
            name: name.as_str().to_string(),
            solver: match name {
                MethodName::NewtonCg => LinearSolver::ConjugateGradients,
                _ => LinearSolver::Factor,
            },
            projection: match self.projection {
                ProjectionName::OnDemand => on_demand,
                ProjectionName::Clamp => ProjectionRule::Always(Projection::Clamp),
                ProjectionName::Abs => ProjectionRule::Always(Projection::Absolute),
                ProjectionName::TrustRegion => ProjectionRule::TrustRegion,
            },
            warp: self.warp,
            max_inner: self.max_inner,
            memory: self.memory,
            proximal: 0.0,
            shift: 0.0,
            guarded: false,
            longest: 1.0,
        }
    }

    /// For `auto`.
    pub fn auto(&self) -> AutoSettings {
        AutoSettings {
            newton: self.of(MethodName::Auto),
            eager: false,
            patience: usize::MAX,
            gain: self.gain,
            window: self.window,
            longest: self.longest,
            retreat: self.retreat,
        }
    }
}
