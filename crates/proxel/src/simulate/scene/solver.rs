//! How the steps of a scene are solved.

use crate::settings::{BaseWeight, DeformSettings, MethodName, PenaltyName};
use proxel_split::{Acceleration, Algorithm, Cycle, Extrapolation, History, Kind, Order};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// How each step is solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverSpec {
    /// The minimiser: auto, newton, admm (or admm-pd), aa-admm, wrapd and the others of `deform`.
    #[serde(deserialize_with = "method_name")]
    #[schemars(with = "String")]
    pub method: MethodName,
    /// Most iterations a step.
    pub max_iters: usize,
    /// A step has converged when its gradient is at most this part of the smaller one of the forces at its start and the
    /// body's characteristic force; where hard sets are split off, when primal and dual residual are at most this.
    pub tol: f64,
    /// Window of Anderson acceleration, m.
    pub window: usize,
    /// What is accelerated; for aa-admm the one that the problem allows, of those that accelerate the fewest numbers: three,
    /// else four, else one or, with hard sets, two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub algorithm: Option<AlgorithmName>,
    /// Whether an acceleration is used always, or while counted costs show that it pays.
    pub accelerate: AccelerateName,
    /// What proposes points; anderson for aa-admm and aadr, nothing for other methods.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extrapolation: Option<ExtrapolationName>,
    /// Mixing parameter beta of Anderson acceleration, in (0, 1].
    pub mixing: f64,
    /// eta of the restart of momentum, between 0 and 1.
    pub eta: f64,
    /// What a refused point does to the history.
    pub history: HistoryName,
    /// Over-relaxation alpha of a splitting in the x-z-u order, between 0 and 2; 1 is none.
    pub relaxation: f64,
    /// What squared weights are at first, over the measure of the element.
    pub base_weight: BaseWeight,
    /// What squared weights are multiplied by.
    pub penalty: PenaltyName,
}

/// What of a splitting is accelerated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AlgorithmName {
    /// z and u, x-z-u: Zhang et al. 2019, Algorithm 1.
    One,
    /// x and u, z-x-u: Algorithm 2; holds hard sets.
    Two,
    /// z, x-z-u: Algorithm 3.
    Three,
    /// u, z-x-u: Algorithm 4; holds hard sets.
    Four,
    /// z, with u along, where the dual is affine: appendix E.1.
    LocalAlone,
    /// u, with z along, where the dual is affine: appendix E.2.
    DualAlone,
    /// s of the Douglas-Rachford iteration: Ouyang et al. 2020, aadr.
    Envelope,
}

/// What proposes the next point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExtrapolationName {
    /// Anderson acceleration of type II.
    Anderson,
    /// Of type I.
    AndersonTypeOne,
    /// Nesterov's momentum with restart: fast ADMM, Goldstein et al. 2014.
    Momentum,
    /// With the correction of Guler 1992.
    CorrectedMomentum,
}

/// When an acceleration is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AccelerateName {
    /// In every iteration.
    #[default]
    Always,
    /// While it gains more than it costs, beside plain iterations: by counted costs, so that a run is the same on any machine.
    WhereItPays,
}

/// What a refused point does to the history.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HistoryName {
    /// As the authors of each algorithm do.
    #[default]
    AsPublished,
    /// It stays.
    Keep,
    /// It is dropped.
    Clear,
}

impl Default for SolverSpec {
    fn default() -> Self {
        /// Of the restart of Goldstein et al.
        const ETA: f64 = 0.999;
        let of = DeformSettings::default();
        SolverSpec {
            method: of.method,
            max_iters: of.max_iters,
            tol: of.tol,
            window: of.anderson.aa_admm,
            algorithm: None,
            accelerate: AccelerateName::default(),
            extrapolation: None,
            mixing: 1.0,
            eta: ETA,
            history: HistoryName::default(),
            relaxation: 1.0,
            base_weight: of.admm.base_weight,
            penalty: of.admm.penalty,
        }
    }
}

/// The names of methods, and `admm` for the plain one.
fn method_name<'de, D: Deserializer<'de>>(d: D) -> Result<MethodName, D::Error> {
    let name = String::deserialize(d)?;
    SolverSpec::method_of(&name).map_err(serde::de::Error::custom)
}

impl From<AlgorithmName> for Algorithm {
    fn from(name: AlgorithmName) -> Self {
        match name {
            AlgorithmName::One => Algorithm::One,
            AlgorithmName::Two => Algorithm::Two,
            AlgorithmName::Three => Algorithm::Three,
            AlgorithmName::Four => Algorithm::Four,
            AlgorithmName::LocalAlone => Algorithm::LocalAlone,
            AlgorithmName::DualAlone => Algorithm::DualAlone,
            AlgorithmName::Envelope => Algorithm::Envelope,
        }
    }
}

impl SolverSpec {
    /// The method of this name.
    ///
    /// # Errors
    /// A name that none has, with all that there are.
    pub fn method_of(name: &str) -> Result<MethodName, String> {
        if name == "admm" {
            return Ok(MethodName::AdmmPd);
        }
        MethodName::from_name(name).ok_or_else(|| {
            let all: Vec<&str> = MethodName::ALL.iter().map(|m| m.as_str()).collect();
            format!("unknown method `{name}`; use admm, {}", all.join(", "))
        })
    }

    /// Whether obstacles and limits can be hard sets of the method's splitting.
    pub(in crate::simulate) fn holds_sets(&self) -> bool {
        self.method.takes_hard_sets() || matches!(self.method, MethodName::AaAdmm | MethodName::Aadr)
    }

    /// The cycle of the plain iteration.
    pub(in crate::simulate) fn cycle(&self) -> Cycle {
        Cycle { order: Order::Xzu, relaxation: self.relaxation }
    }

    /// How its splitting is accelerated; none where it is not. `best` is the algorithm for aa-admm.
    pub(in crate::simulate) fn acceleration(&self, best: Algorithm, hard: bool) -> Option<Acceleration> {
        let by = match (self.method, self.extrapolation) {
            (MethodName::AaAdmm | MethodName::Aadr, None) => ExtrapolationName::Anderson,
            (_, by) => by?,
        };
        let anderson = |kind| Extrapolation::Anderson { window: self.window, mixing: self.mixing, kind };
        let by = match by {
            ExtrapolationName::Anderson => anderson(Kind::Two),
            ExtrapolationName::AndersonTypeOne => anderson(Kind::One),
            ExtrapolationName::Momentum => Extrapolation::Momentum { eta: Some(self.eta), corrected: false },
            ExtrapolationName::CorrectedMomentum => Extrapolation::Momentum { eta: Some(self.eta), corrected: true },
        };
        let algorithm = match (self.algorithm, self.method) {
            (Some(name), _) => name.into(),
            (None, MethodName::Aadr) => Algorithm::Envelope,
            (None, MethodName::AaAdmm) => best,
            (None, _) if hard => Algorithm::Two,
            (None, _) => Algorithm::One,
        };
        let history = match self.history {
            HistoryName::AsPublished => History::AsPublished,
            HistoryName::Keep => History::Keep,
            HistoryName::Clear => History::Clear,
        };
        Some(Acceleration { algorithm, by, history })
    }

    /// Keys that make no sense, or none for the method: where, what is wrong there, and what to do.
    pub(super) fn check(&self) -> Result<(), (String, String, String)> {
        let bad = |key: &str, what: String, remedy: &str| Err((format!("solver.{key}"), what, remedy.to_owned()));
        let name = self.method.as_str();
        let plain = SolverSpec::default();
        let accelerates = self.extrapolation.is_some() || matches!(self.method, MethodName::AaAdmm | MethodName::Aadr);
        let splits = self.method.is_splitting() && self.method != MethodName::Auto;
        if !(self.mixing > 0.0 && self.mixing <= 1.0) {
            return bad("mixing", format!("it is {}", self.mixing), "give a number above 0 and at most 1");
        }
        if !(self.eta > 0.0 && self.eta < 1.0) {
            return bad("eta", format!("it is {}", self.eta), "give a number between 0 and 1");
        }
        if !(self.relaxation > 0.0 && self.relaxation < 2.0) {
            return bad("relaxation", format!("it is {}", self.relaxation), "give a number between 0 and 2");
        }
        if self.extrapolation.is_some() && !splits {
            return bad("extrapolation", format!("{name} is no splitting"), "leave it out, or use aa-admm or admm");
        }
        if self.algorithm.is_some() && !(accelerates && splits) {
            let remedy = "leave it out, use aa-admm, or give an extrapolation";
            return bad("algorithm", format!("{name} accelerates nothing"), remedy);
        }
        if self.relaxation != plain.relaxation && !splits {
            return bad("relaxation", format!("{name} is no splitting"), "leave it out, or use admm");
        }
        Ok(())
    }
}
