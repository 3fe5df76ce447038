//! `proxel wire`.

use clap::Args;
use proxel::shape::{WireSettings, subdivide, wire as shaped};
use proxel_mesh::Mesh;

use super::{ShapeArgs, files};
use crate::args::show_settings;
use crate::refusal::Refusal;

/// The arguments of `proxel wire`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel wire net.obj --edge-length 0.02 --out wires.obj --preview wires.png
  proxel wire torso.obj --subdivide --edge-length 1.34 --reference scan.obj --out wires.ply --report wires.json
  proxel wire net.obj --min-angle 60 --max-angle 120 --out wires.vtu

Vertices and faces keep number and order, after --subdivide those of the mesh that it makes. Figures of the report are
those of the positions as written: errors of edges over the length wanted, of angles in degrees, distances over the
mean edge of the input. VTU and PLY files have both errors of each face and the distance of each vertex.")]
pub struct WireArgs {
    #[command(flatten)]
    pub shape: ShapeArgs,
    /// The length of all edges, in units of the mesh; without it the mean length of its edges.
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    pub edge_length: Option<f64>,
    /// The least angle between edges of a face that follow each other, in degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = WireSettings::default().min_angle)]
    #[arg(allow_negative_numbers = true)]
    pub min_angle: f64,
    /// The largest such angle, in degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = WireSettings::default().max_angle)]
    #[arg(allow_negative_numbers = true)]
    pub max_angle: f64,
    /// Split every face into quads first, once or N times; new vertices are placed fairly, the others stay.
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "1")]
    #[arg(default_value_t = WireSettings::default().subdivide)]
    pub subdivide: usize,
    /// Penalty of edges and angles [default: 1000; admm, aa-admm: 3000; aadr: 10000; shapeup: 100]
    #[arg(long, value_name = "MU", allow_negative_numbers = true, help_heading = "Method")]
    pub mu: Option<f64>,
}

/// Reads, solves, writes.
pub fn wire(args: &WireArgs) -> Result<u8, Refusal> {
    let base = WireSettings::by(args.shape.method()).shape;
    let settings = WireSettings {
        edge_length: args.edge_length,
        min_angle: args.min_angle,
        max_angle: args.max_angle,
        subdivide: args.subdivide,
        shape: args.shape.settings(base, args.mu, None),
    };
    settings.check().map_err(Refusal::new)?;
    if args.shape.solve.run.show_settings {
        return show_settings(&settings);
    }
    let prepare = |mut mesh: Mesh| {
        for _ in 0..settings.subdivide {
            mesh = subdivide(&mesh)?;
        }
        Ok(mesh)
    };
    let mut read = || args.shape.read(&prepare);
    files::run(&args.shape.solve, &mut read, &mut |input, hooks| shaped(input, &settings, hooks))
}
