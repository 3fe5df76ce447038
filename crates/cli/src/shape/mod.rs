//! `proxel planarize`, `proxel wire` and `proxel shape`: meshes under geometric constraints.

mod files;
mod planarize;
mod recipe;
mod wire;

pub use planarize::{PlanarizeArgs, planarize};
pub use recipe::{RecipeArgs, recipe};
pub use wire::{WireArgs, wire};

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::shape::{ShapeError, ShapeInput, ShapeMethod, ShapeSettings};
use proxel_mesh::{Mesh, read_mesh_lenient};
use std::path::PathBuf;

use crate::args::SolveArgs;
use crate::refusal::Refusal;

/// What every command has that shapes a mesh.
#[derive(Args)]
pub struct ShapeArgs {
    /// The mesh: polygons of any size.
    #[arg(value_name = "MESH", required_unless_present = "show_settings")]
    pub mesh: Option<PathBuf>,
    /// The surface that vertices are to be near to, open or closed; without it the mesh as it comes.
    #[arg(long, value_name = "REF")]
    pub reference: Option<PathBuf>,
    /// Weight of the squared distance of each vertex from the reference [default: 1; planarize --method shapeup: 10]
    #[arg(long, value_name = "W", allow_negative_numbers = true)]
    pub closeness: Option<f64>,
    #[command(flatten)]
    pub solve: SolveArgs,
    /// auto: accelerated ADMM, then Gauss-Newton until constraints hold to 1e-10; aa-admm: Algorithm 2 of Zhang et al.
    /// 2019; admm: the iteration as it is; alm: an augmented Lagrangian, Deng et al. 2015; aadr: Douglas-Rachford, Ouyang
    /// et al. 2020; shapeup: constraints by a penalty, Bouaziz et al. 2012, Peng et al. 2018.
    #[arg(long, value_name = "NAME", value_parser = methods(), help_heading = "Method")]
    #[arg(default_value = ShapeMethod::default().as_str())]
    pub method: String,
    /// Columns of Anderson acceleration.
    #[arg(long, value_name = "M", default_value_t = ShapeSettings::planarize().anderson, help_heading = "Method")]
    pub anderson: usize,
    #[command(flatten)]
    pub room: Room,
}

/// What a finish may take.
#[derive(Args)]
pub struct Room {
    /// Gigabytes that the factor of the Gauss-Newton steps of auto may take; without room for it the splitting goes on.
    #[arg(long, value_name = "GB", default_value_t = ShapeSettings::planarize().memory / 1e9, help_heading = "Method")]
    #[arg(allow_negative_numbers = true)]
    pub memory: f64,
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(ShapeMethod::ALL.map(ShapeMethod::as_str))
}

impl ShapeArgs {
    /// The mesh, prepared, and what it is to be near to: without a reference the mesh as it comes.
    fn read(&self, prepare: &dyn Fn(Mesh) -> Result<Mesh, ShapeError>) -> Result<ShapeInput, Refusal> {
        // Clap asks for it unless settings are shown.
        let Some(path) = &self.mesh else {
            return Err(Refusal::new("MESH is needed; see --help"));
        };
        // What a file has that is no mesh to solve on is refused with the face it is about.
        let mesh = read_mesh_lenient(path)?;
        let reference = match &self.reference {
            Some(path) => read_mesh_lenient(path)?,
            None => mesh.clone(),
        };
        Ok(ShapeInput { mesh: prepare(mesh)?, reference: Some(reference) })
    }

    /// The method that is asked for.
    fn method(&self) -> ShapeMethod {
        ShapeMethod::from_name(&self.method).unwrap_or_default() // clap lets no other through
    }

    /// The defaults of a command and method, and what was given.
    fn settings(&self, base: ShapeSettings, mu: Option<f64>, fairing: Option<f64>) -> ShapeSettings {
        ShapeSettings {
            method: base.method,
            mu: mu.unwrap_or(base.mu),
            anderson: self.anderson,
            closeness: self.closeness.unwrap_or(base.closeness),
            fairing: fairing.unwrap_or(base.fairing),
            tol: self.solve.tol,
            max_iters: self.solve.max_iters,
            memory: 1e9 * self.room.memory,
            time_limit: self.solve.run.time_limit,
            threads: self.solve.run.threads,
        }
    }
}
