//! Settings of the commands that shape a mesh, with their defaults.

use super::recipe::RecipeSolver;
use crate::settings::NewtonSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A method of `planarize` and `wire`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ShapeMethod {
    /// Accelerated ADMM to a few digits, then Newton's method on the constraints.
    #[default]
    Auto,
    /// Algorithm 2 of Zhang et al. 2019 on A(29).
    AaAdmm,
    /// The z-x-u iteration as it is.
    Admm,
    /// The augmented Lagrangian method of Deng et al. 2015: several updates of z and x in turns before each of u.
    Alm,
    /// The Douglas-Rachford iteration under Anderson acceleration: Ouyang et al. 2020. Closeness is split off too.
    Aadr,
    /// ShapeUp (Bouaziz et al. 2012) under Anderson acceleration (Peng et al. 2018): no constraint is hard, mu is the weight
    /// of the squared distances from their sets.
    Shapeup,
}

impl ShapeMethod {
    /// All of them.
    pub const ALL: [ShapeMethod; 6] = [
        ShapeMethod::Auto,
        ShapeMethod::AaAdmm,
        ShapeMethod::Admm,
        ShapeMethod::Alm,
        ShapeMethod::Aadr,
        ShapeMethod::Shapeup,
    ];

    /// Its name on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            ShapeMethod::Auto => "auto",
            ShapeMethod::AaAdmm => "aa-admm",
            ShapeMethod::Admm => "admm",
            ShapeMethod::Alm => "alm",
            ShapeMethod::Aadr => "aadr",
            ShapeMethod::Shapeup => "shapeup",
        }
    }

    /// From its name on the command line.
    pub fn from_name(name: &str) -> Option<ShapeMethod> {
        ShapeMethod::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// How a mesh is shaped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeSettings {
    /// The method.
    pub method: ShapeMethod,
    /// mu, the squared weight of hard constraints in the splitting; weights of soft ones are measured against 1. Under
    /// `shapeup` the weight of the constraints.
    pub mu: f64,
    /// m, columns of Anderson acceleration.
    pub anderson: usize,
    /// Weight of the closeness of each vertex to the reference.
    pub closeness: f64,
    /// Weight of relative Laplacian fairing: how much differential coordinates stay as they are.
    pub fairing: f64,
    /// Tolerance of residuals.
    pub tol: f64,
    /// Most iterations.
    pub max_iters: usize,
    /// Bytes that the factor of the finish of `auto` may take; without room for it the splitting goes on instead.
    pub memory: f64,
    /// Seconds after which a run stops.
    pub time_limit: Option<f64>,
    /// Threads; all processors without it.
    pub threads: Option<usize>,
}

impl ShapeSettings {
    /// Those of Zhang et al. 2019 for planar faces.
    pub fn planarize() -> Self {
        ShapeSettings {
            method: ShapeMethod::Auto,
            mu: 1e5,
            anderson: 6,
            closeness: 1.0,
            fairing: 0.1,
            tol: 1e-9,
            max_iters: 5000,
            memory: NewtonSettings::default().memory,
            time_limit: None,
            threads: None,
        }
    }

    /// Those of a recipe, which says itself what vertices are near to.
    pub fn recipe() -> Self {
        let solver = RecipeSolver::default();
        let (method, mu, anderson) = (solver.method, solver.mu, solver.anderson);
        ShapeSettings { method, mu, anderson, fairing: 0.0, ..ShapeSettings::planarize() }
    }

    /// The same for a method: those of the implementation of Peng et al. 2018 for `shapeup`.
    pub fn planarize_by(method: ShapeMethod) -> Self {
        let base = ShapeSettings { method, ..Self::planarize() };
        match method {
            ShapeMethod::Shapeup => ShapeSettings { mu: 150.0, closeness: 10.0, fairing: 10.0, ..base },
            _ => base,
        }
    }

    /// Checks numbers that would make no sense.
    ///
    /// # Errors
    /// Names the option, its value and what to give.
    pub fn check(&self) -> Result<(), String> {
        let positive = |option: &str, v: f64| match v > 0.0 && v.is_finite() {
            true => Ok(()),
            false => Err(format!("--{option} is {v}; give a positive number")),
        };
        positive("mu", self.mu)?;
        positive("closeness", self.closeness)?;
        positive("tol", self.tol)?;
        positive("memory", self.memory)?;
        if !(self.fairing >= 0.0 && self.fairing.is_finite()) {
            return Err(format!("--fairing is {}; give a number that is not negative", self.fairing));
        }
        if let Some(limit) = self.time_limit.filter(|t| !(*t > 0.0 && t.is_finite())) {
            return Err(format!("--time-limit is {limit}; give a positive number of seconds"));
        }
        match self.threads {
            Some(0) => Err("--threads is 0; give at least 1".to_string()),
            _ => Ok(()),
        }
    }
}
