//! The arguments of `proxel unwrap`, and the settings that they mean.

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::settings::{UnwrapMethod, UnwrapSettings};

use crate::args::SolveArgs;
use crate::refusal::Refusal;

/// The arguments of `proxel unwrap`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel unwrap spot.obj --out spot-uv.obj --preview uv.png
  proxel unwrap suit.obj --from-uv --out suit-uv.obj                  keep its seams, improve its map
  proxel unwrap horse.obj --bijective --out horse-uv.obj              no overlaps, for light maps and baking
  proxel unwrap face.ply --no-pack --method wrapd --trace t.csv --out face-uv.glb

Faces, vertices and all other attributes stay as they are; texture coordinates are per corner. What the report
says of flips, overlaps and distortion is measured on the file as written and read back.")]
pub struct UnwrapArgs {
    /// The surface: .obj, .ply, .stl, .off, .gltf, .glb or any other mesh with faces.
    #[arg(value_name = "MESH", required_unless_present = "show_settings")]
    pub mesh: Option<PathBuf>,
    /// Where the surface is cut: auto: only where it has to be; vt: where its texture coordinates are; or a file with
    /// two vertices (0-based) of an edge a line.
    #[arg(long, value_name = "auto|vt|FILE", default_value = "auto")]
    pub seams: String,
    /// Begin with the texture coordinates of the file. They are the seams too, unless --seams names a file.
    #[arg(long)]
    pub from_uv: bool,
    /// Most stretch of a triangle, above 1: max(s1, 1/s2) of its map, relative to lengths of the mesh. Charts with more
    /// are cut further.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub max_stretch: Option<f64>,
    /// Vertices that are held: a file with vertex (0-based), u and v a line, in units of length of the mesh.
    #[arg(long, value_name = "FILE")]
    pub pin: Option<PathBuf>,
    /// How much faces count: a file with a positive number for each face, or for each vertex.
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// Lengths that edges are to have in the map: a file with a line for each face, which has one number (how many times its
    /// own length) or six (xx xy xz yy yz zz of a symmetric positive definite M: an edge e gets the length sqrt(e^T M e)).
    #[arg(long, value_name = "FILE")]
    pub metric: Option<PathBuf>,
    /// No two triangles of the map may overlap: where those of the best map do, it is found anew with the empty space
    /// around it triangulated, so that borders cannot cross. Pins are refused.
    #[arg(long, conflicts_with = "pin")]
    pub bijective: bool,
    /// Hold the outer border of each chart where it begins: on a circle, or with --from-uv where it is.
    #[arg(long)]
    pub fixed_boundary: bool,
    /// Leave charts in units of length of the mesh instead of packing them into the unit square.
    #[arg(long)]
    pub no_pack: bool,
    /// Least distance of charts, in pixels.
    #[arg(long, value_name = "P", default_value_t = UnwrapSettings::default().padding, allow_negative_numbers = true)]
    pub padding: f64,
    /// Pixels along a side of the page.
    #[arg(long, value_name = "N", default_value_t = UnwrapSettings::default().resolution)]
    pub resolution: u32,
    /// Texels per unit of length on the surface, instead of as many as fit.
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    pub density: Option<f64>,
    /// A picture of the surface with a checkerboard laid on by the map, from the front and from behind.
    #[arg(long, value_name = "P.png")]
    pub preview_3d: Option<PathBuf>,
    /// The surface with the distortion of the map as colours of vertices.
    #[arg(long, value_name = "H.ply")]
    pub heatmap: Option<PathBuf>,
    #[command(flatten)]
    pub solve: SolveArgs,
    #[command(flatten)]
    pub method: UnwrapMethodArgs,
}

/// How it is solved.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub struct UnwrapMethodArgs {
    /// auto: wrapd until no triangle is flipped, then Newton; wrapd: rotation-aware, dynamic weights; r-admm:
    /// rotation-aware; w-admm: dynamic weights; admm-pd: neither; wrapd+cm: wrapd, then composite
    /// majorization; cm, slim, akvf, bcqn, projected-newton, newton: from a start without flips.
    #[arg(long, value_name = "NAME", value_parser = methods(), default_value = UnwrapMethod::default().as_str())]
    pub method: String,
    /// The energy that is minimised. Reports and traces have the symmetric Dirichlet energy of the map in any case.
    #[arg(long, value_name = "NAME", value_parser = energies(), default_value = UnwrapSettings::default().energy)]
    pub energy: String,
}

fn energies() -> PossibleValuesParser {
    PossibleValuesParser::new(proxel::model::energy::names(2))
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(UnwrapMethod::ALL.map(UnwrapMethod::as_str))
}

impl UnwrapArgs {
    /// All settings: defaults, and what was given.
    pub fn settings(&self) -> Result<UnwrapSettings, Refusal> {
        let settings = UnwrapSettings {
            method: UnwrapMethod::from_name(&self.method.method).unwrap_or_default(), // clap lets no other through
            energy: self.method.energy.clone(),
            bijective: self.bijective,
            fixed_boundary: self.fixed_boundary,
            max_stretch: self.max_stretch,
            pack: !self.no_pack,
            padding: self.padding,
            resolution: self.resolution,
            density: self.density,
            tol: self.solve.tol,
            max_iters: self.solve.max_iters,
            time_limit: self.solve.run.time_limit,
            threads: self.solve.run.threads,
            ..UnwrapSettings::default()
        };
        settings.check().map_err(Refusal::new)?;
        Ok(settings)
    }
}
