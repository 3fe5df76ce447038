//! The description of a simulation: what a scene file holds, in SI units, with all defaults.
//!
//! ```toml
//! [time]
//! dt = 0.03333333333333333                      # seconds from frame to frame
//! frames = 30
//!
//! [[body]]
//! name = "cube"
//! generate = { bar = { cells = [3, 3, 3], size = [1, 1, 1] } }
//! material = { energy = "neo-hookean", young = 1e5, poisson = 0.4 }
//! density = 1000
//! translate = [0, 2, 0]
//!
//! [[obstacle]]
//! name = "floor"
//! shape = { half-space = { point = [0, 0, 0], normal = [0, 1, 0] } }
//! ```

mod body;
mod check;
mod file;
mod locate;
mod obstacle;

pub use body::{BodySpec, Generate, PinSpec, Split};
pub use file::SceneFile;
pub use obstacle::{MotionKey, ObstacleSpec, ShapeSpec};

use crate::settings::{DeformSettings, MethodName, PenaltyName};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// A scene: bodies, what moves them, and what is in their way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(title = "Proxel scene")]
pub struct Scene {
    /// What it is, for the reader.
    pub title: String,
    /// Frames and steps.
    pub time: TimeSpec,
    /// How each step is solved.
    pub solver: SolverSpec,
    /// What acts everywhere.
    pub forces: ForceSpec,
    /// Rayleigh damping.
    pub damping: DampingSpec,
    /// What is written besides the frames for ParaView.
    pub output: OutputSpec,
    /// The bodies.
    #[serde(rename = "body")]
    pub bodies: Vec<BodySpec>,
    /// What nothing may enter.
    #[serde(rename = "obstacle")]
    pub obstacles: Vec<ObstacleSpec>,
}

/// How velocities follow positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// Implicit Euler: first order, dissipates.
    #[default]
    ImplicitEuler,
    /// The two-step backward differentiation formula, for steps of any length: second order; its first step is one of
    /// implicit Euler.
    Bdf2,
}

/// Frames and steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TimeSpec {
    /// Seconds from frame to frame.
    pub dt: f64,
    /// Frames after frame 0, which is the start.
    pub frames: usize,
    /// Steps a frame.
    pub substeps: usize,
    /// How velocities follow positions.
    pub integrator: Integrator,
    /// Whether a step that does not converge is done again as two of half its length, and so on, up to 16 parts.
    pub adaptive: bool,
}

impl Default for TimeSpec {
    fn default() -> Self {
        TimeSpec { dt: 1.0 / 30.0, frames: 60, substeps: 1, integrator: Integrator::default(), adaptive: false }
    }
}

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
    /// body's characteristic force; with hard strain limits, when primal and dual residual are at most this.
    pub tol: f64,
    /// Window of Anderson acceleration, m.
    pub window: usize,
    /// What squared weights are multiplied by.
    pub penalty: PenaltyName,
}

impl Default for SolverSpec {
    fn default() -> Self {
        let of = DeformSettings::default();
        SolverSpec {
            method: of.method,
            max_iters: of.max_iters,
            tol: of.tol,
            window: of.anderson.aa_admm,
            penalty: of.admm.penalty,
        }
    }
}

/// The names of methods, and `admm` for the plain one.
fn method_name<'de, D: Deserializer<'de>>(d: D) -> Result<MethodName, D::Error> {
    let name = String::deserialize(d)?;
    SolverSpec::method_of(&name).map_err(serde::de::Error::custom)
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
}

/// What acts everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ForceSpec {
    /// Acceleration, m/s^2.
    pub gravity: [f64; 3],
    /// Air that moves, or rests, around triangles of bodies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind: Option<WindSpec>,
}

impl Default for ForceSpec {
    fn default() -> Self {
        ForceSpec { gravity: [0.0, -9.81, 0.0], wind: None }
    }
}

/// Air, which pushes every triangle of sheets along its normal n. With v_n = n . (velocity of the triangle - wind) and A the
/// area as it is, taken at the start of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WindSpec {
    /// Its velocity, m/s; zero for air at rest, which only drags.
    pub velocity: [f64; 3],
    /// What c means.
    #[serde(default)]
    pub law: WindLaw,
    /// c: for `force` in kg/m^3, half the density of air times a drag coefficient; for `acceleration` in 1/m^3.
    pub drag: f64,
}

/// What the drag of wind is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WindLaw {
    /// A force -c A v_n |v_n| n on each triangle, in equal parts on its corners; damped so that no step turns v_n around.
    #[default]
    Force,
    /// An acceleration -c A v_n |v_n| n of each corner by each of its triangles, whatever its mass.
    Acceleration,
}

/// Rayleigh damping: forces -(mass M + stiffness K) v with the mass matrix M and the elastic Hessian K at the start of a
/// step, made positive semidefinite.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DampingSpec {
    /// 1/s; drag in proportion to mass.
    pub mass: f64,
    /// s; for auto and the methods of Newton's kind.
    pub stiffness: f64,
}

/// What is written besides the frames for ParaView.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OutputSpec {
    /// Surfaces as `obj/BODY_0000.obj`, ..
    pub obj: bool,
    /// Surfaces as `ply/BODY_0000.ply`, .. with velocities.
    pub ply: bool,
    /// All surfaces in motion as `scene.glb`.
    pub glb: bool,
    /// Pictures as `preview/0000.png`, .., and all of them as the animated picture `preview.png`.
    pub preview: bool,
}

/// The JSON Schema of scenes.
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(Scene).to_value()
}
