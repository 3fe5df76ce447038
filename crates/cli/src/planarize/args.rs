//! The arguments of `proxel planarize`, and the settings that they mean.

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::shape::{ShapeMethod, ShapeSettings};

use crate::args::SolveArgs;
use crate::refusal::Refusal;

/// The arguments of `proxel planarize`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel planarize roof.obj --out flat.obj --preview flat.png
  proxel planarize roof.obj --reference scan.ply --out flat.vtu --report flat.json
  proxel planarize roof.obj --method aa-admm --max-iters 1000 --trace t.csv --out flat.obj

Vertices and faces keep number and order. Figures of the report are those of the positions as written, lengths over
the mean edge of the input; VTU and PLY files have the planarity of each face and the distance of each vertex.")]
pub struct PlanarizeArgs {
    /// The mesh: polygons of any size.
    #[arg(value_name = "MESH", required_unless_present = "show_settings")]
    pub mesh: Option<PathBuf>,
    /// The surface that vertices are to be near to, open or closed; without it the mesh as it comes.
    #[arg(long, value_name = "REF")]
    pub reference: Option<PathBuf>,
    /// Weight of the squared distance of each vertex from the reference.
    #[arg(long, value_name = "W", allow_negative_numbers = true)]
    #[arg(default_value_t = ShapeSettings::planarize().closeness)]
    pub closeness: f64,
    /// Weight of relative Laplacian fairing: how much vertices stay as they are among their neighbours.
    #[arg(long, value_name = "W", default_value_t = ShapeSettings::planarize().fairing, allow_negative_numbers = true)]
    pub fairing: f64,
    #[command(flatten)]
    pub solve: SolveArgs,
    /// auto: accelerated ADMM, then Gauss-Newton until faces are planar to 1e-10 of the mean edge, no edge below half
    /// of the shortest; aa-admm: Algorithm 2 of Zhang et al. 2019; admm: the iteration as it is.
    #[arg(long, value_name = "NAME", value_parser = methods(), help_heading = "Method")]
    #[arg(default_value = ShapeMethod::default().as_str())]
    pub method: String,
    /// Penalty of planarity in the splitting.
    #[arg(long, value_name = "MU", allow_negative_numbers = true, help_heading = "Method")]
    #[arg(default_value_t = ShapeSettings::planarize().mu)]
    pub mu: f64,
    /// Columns of Anderson acceleration.
    #[arg(long, value_name = "M", default_value_t = ShapeSettings::planarize().anderson, help_heading = "Method")]
    pub anderson: usize,
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(ShapeMethod::ALL.map(ShapeMethod::as_str))
}

impl PlanarizeArgs {
    /// All settings: defaults, and what was given.
    pub fn settings(&self) -> Result<ShapeSettings, Refusal> {
        let settings = ShapeSettings {
            method: ShapeMethod::from_name(&self.method).unwrap_or_default(), // clap lets no other through
            mu: self.mu,
            anderson: self.anderson,
            closeness: self.closeness,
            fairing: self.fairing,
            tol: self.solve.tol,
            max_iters: self.solve.max_iters,
            time_limit: self.solve.run.time_limit,
            threads: self.solve.run.threads,
        };
        settings.check().map_err(Refusal::new)?;
        Ok(settings)
    }
}
