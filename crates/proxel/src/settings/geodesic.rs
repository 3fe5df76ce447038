//! Settings of `geodesic`, with their defaults.

use serde::{Deserialize, Serialize};

/// How the directions of the heat method are made the gradient of a distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GeodesicMethod {
    /// What was measured to be the fastest: `poisson`.
    #[default]
    Auto,
    /// One sparse system (Crane, Weischedel, Wardetzky 2013).
    Poisson,
    /// The nearest integrable field by ADMM (Tao et al. 2019), then sums along a tree of edges.
    Admm,
    /// The same, accelerated: A, Algorithm 2.
    AaAdmm,
}

impl GeodesicMethod {
    /// All of them.
    pub const ALL: [GeodesicMethod; 4] =
        [GeodesicMethod::Auto, GeodesicMethod::Poisson, GeodesicMethod::Admm, GeodesicMethod::AaAdmm];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            GeodesicMethod::Auto => "auto",
            GeodesicMethod::Poisson => "poisson",
            GeodesicMethod::Admm => "admm",
            GeodesicMethod::AaAdmm => "aa-admm",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// What the splitting has for unknowns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GradientForm {
    /// A gradient for each face; along an edge those of its faces agree.
    #[default]
    Faces,
    /// A difference for each edge; around a face they add up to zero.
    Edges,
}

impl GradientForm {
    /// All of them.
    pub const ALL: [GradientForm; 2] = [GradientForm::Faces, GradientForm::Edges];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            GradientForm::Faces => "faces",
            GradientForm::Edges => "edges",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// All settings of `geodesic`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GeodesicSettings {
    /// The method.
    pub method: GeodesicMethod,
    /// Unknowns of the splitting.
    pub form: GradientForm,
    /// Time of the heat step in squared mean lengths of edges.
    pub time: f64,
    /// Penalty of the splitting, over the weight of its objective.
    pub mu: f64,
    /// Columns of Anderson's history.
    pub anderson: usize,
    /// Tolerance of the residuals A(27) of the splitting.
    pub tol: f64,
    /// Iterations of the splitting.
    pub max_iters: usize,
    /// Seconds.
    pub time_limit: Option<f64>,
    /// Threads; all processors if none.
    pub threads: Option<usize>,
}

impl Default for GeodesicSettings {
    fn default() -> Self {
        GeodesicSettings {
            method: GeodesicMethod::default(),
            form: GradientForm::default(),
            time: 1.0,
            mu: 100.0,
            anderson: 6,
            tol: 1e-9,
            max_iters: 5000,
            time_limit: None,
            threads: None,
        }
    }
}

impl GeodesicSettings {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    /// The first that does not, by its option.
    pub fn check(&self) -> Result<(), String> {
        let positive = |name: &str, v: f64| {
            if v > 0.0 && v.is_finite() { Ok(()) } else { Err(format!("{name} is {v}; it must be positive")) }
        };
        positive("--time", self.time)?;
        positive("--mu", self.mu)?;
        positive("--tol", self.tol)?;
        if self.threads == Some(0) {
            return Err("--threads is 0; give at least 1".to_string());
        }
        match self.time_limit {
            Some(t) if !(t > 0.0 && t.is_finite()) => Err(format!("--time-limit is {t}; it must be positive")),
            _ => Ok(()),
        }
    }
}
