//! `proxel planarize`.

use clap::Args;
use proxel::shape::{ShapeSettings, planarize as shaped};

use super::{ShapeArgs, files};
use crate::args::show_settings;
use crate::refusal::Refusal;

/// The arguments of `proxel planarize`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel planarize roof.obj --out flat.obj --preview flat.png
  proxel planarize roof.obj --reference scan.ply --out flat.vtu --report flat.json
  proxel planarize roof.obj --method aa-admm --max-iters 1000 --trace t.csv --out flat.obj

Vertices and faces keep number and order. Figures of the report are those of the positions as written, lengths over
the mean edge of the input; VTU and PLY files have the planarity of each face and the distance of each vertex.
auto keeps every edge at half of the shortest of the input or more.")]
pub struct PlanarizeArgs {
    #[command(flatten)]
    pub shape: ShapeArgs,
    /// Weight of relative Laplacian fairing: how much vertices stay as they are among their neighbours [default: 0.1;
    /// shapeup: 10]
    #[arg(long, value_name = "W", allow_negative_numbers = true)]
    pub fairing: Option<f64>,
    /// Penalty of planarity [default: 1e5; shapeup: 150]
    #[arg(long, value_name = "MU", allow_negative_numbers = true, help_heading = "Method")]
    pub mu: Option<f64>,
}

/// Reads, solves, writes.
pub fn planarize(args: &PlanarizeArgs) -> Result<u8, Refusal> {
    let base = ShapeSettings::planarize_by(args.shape.method());
    let settings = args.shape.settings(base, args.mu, args.fairing);
    settings.check().map_err(Refusal::new)?;
    if args.shape.solve.run.show_settings {
        return show_settings(&settings);
    }
    files::run(&args.shape.solve, &mut || args.shape.read(&Ok), &mut |input, hooks| shaped(input, &settings, hooks))
}
