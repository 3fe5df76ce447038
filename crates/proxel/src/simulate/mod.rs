//! Implicit dynamics: bodies in motion among obstacles, from a scene.
//!
//! A [`SceneFile`] describes bodies, what holds and moves them, and what is in their way. [`Simulation`] advances it frame
//! by frame; each step minimises, over the positions x of all bodies,
//!
//! ```text
//! sum_i m_i (1 + a t) / (2 t^2) |x_i - y_i|^2 + elastic energy(x)     with no point inside of an obstacle,
//! y = X + (t V + t^2 f / m) / (1 + a t)
//! ```
//!
//! where t, X and V are those of the integrator (for implicit Euler the length of the step, positions and velocities), f
//! explicit forces and a damping in proportion to mass: A section 4.1. [`Folder`] writes frames, and lets a run
//! go on from the last complete one.

mod body;
mod closed_mesh;
mod contact;
mod damping;
mod engine;
mod folder;
mod forces;
mod growing;
mod measure;
mod obstacles;
mod picture;
mod place;
mod record;
mod report;
mod scene;
mod scenery;
mod simulation;
mod state;
mod stops;
mod track;
mod world;

pub use folder::{Folder, Ledger};
pub use place::BodyState;
pub use record::{Frame, FrameRecord};
pub use scene::{
    AccelerateName, AlgorithmName, BodySpec, DampingSpec, ExtrapolationName, ForceSpec, Generate, HistoryName,
    Integrator, MotionKey, ObstacleSpec, OutputSpec, PinSpec, Scene, SceneFile, ShapeSpec, SolverSpec, Split, TimeSpec,
    WindLaw, WindSpec, schema,
};
pub use simulation::Simulation;
pub(crate) use state::PlainState;
pub use state::State;
pub use stops::{Hooks, Progress, Trace};

use crate::deform::DeformError;
use crate::pins::InputError;
use crate::settings::MethodName;
use proxel_mesh::MeshError;
use proxel_split::SystemError;

/// Why a scene cannot be simulated, or no further: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SimulateError(String);

impl SimulateError {
    pub(crate) fn new(text: String) -> Self {
        SimulateError(text)
    }
}

impl std::fmt::Display for SimulateError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for SimulateError {}

impl From<InputError> for SimulateError {
    fn from(e: InputError) -> Self {
        SimulateError(e.to_string())
    }
}

impl From<DeformError> for SimulateError {
    fn from(e: DeformError) -> Self {
        SimulateError(e.to_string())
    }
}

impl From<MeshError> for SimulateError {
    fn from(e: MeshError) -> Self {
        SimulateError(e.to_string())
    }
}

impl From<SystemError> for SimulateError {
    fn from(e: SystemError) -> Self {
        SimulateError(e.to_string())
    }
}

/// Whether steps end with Newton's method, which holds contact by an augmented Lagrangian instead of splitting it off.
pub(crate) fn has_finish(method: MethodName) -> bool {
    matches!(method, MethodName::Auto | MethodName::Newton | MethodName::NewtonCg | MethodName::ProjectedNewton)
}
