//! The command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::builder::PossibleValuesParser;
use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand};
use proxel::samples::NAMES;
use proxel::settings::DeformSettings;

use crate::batch::BatchCommand;
use crate::deform::DeformArgs;
use crate::demo_animation::ANIMATION;
use crate::demo_unwrap::UNWRAP;
use crate::geodesic::GeodesicArgs;
use crate::imaging::{DeblurArgs, DenoiseArgs, InpaintArgs};
use crate::refusal::Refusal;
use crate::replay::ReplayArgs;
use crate::shape::{PlanarizeArgs, RecipeArgs, WireArgs};
use crate::simulate::{SchemaArgs, SimulateArgs};
use crate::unwrap::UnwrapArgs;
use crate::wavefront::WavefrontArgs;

/// Poses elastic bodies, lets them move, and flattens surfaces: minimises deformation energies under constraints.
#[derive(Parser)]
#[command(name = "proxel", version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  proxel demo                                           pose the built-in octopus, no files needed
  proxel info body.mesh                                 what a mesh is, and what is wrong with it
  proxel deform body.node --pins hands.toml --out posed.vtu
  proxel unwrap spot.obj --out spot-uv.obj              texture coordinates
  proxel planarize roof.obj --out flat.obj              planar faces, for panels of glass
  proxel wire net.obj --edge-length 0.02 --out w.obj    edges of one length, for wires
  proxel shape recipe.toml --out shaped.obj             any constraints on any part of a mesh
  proxel simulate scene.toml --out run                  bodies in motion, for ParaView
  proxel geodesic bunny.obj --source 9689 --out distance.vtu
  proxel deblur photo.png --psf kernel.png --out sharp.png
  proxel wavefront reference.png captured.png --out phi.tif
  proxel batch unwrap scans --out uv --jobs 8           all meshes in a folder
  proxel convert body.msh --out body.vtu --refine 1

Exit status: 0 converged or done, 1 failed, 2 bad input, 3 stopped before convergence, 130 cancelled.
Mesh formats, by extension: TetGen .node/.ele, Medit .mesh, Gmsh .msh, .vtk, .vtu, .obj, .ply, .stl,
.off, .gltf, .glb; positions also as .npy. Indices are 0-based everywhere, in file order.";

#[derive(Subcommand)]
pub enum Command {
    /// Find the pose of least elastic energy under pins and loads.
    Deform(Box<DeformArgs>),
    /// Map a surface to the plane with the least distortion: UV coordinates.
    Unwrap(Box<UnwrapArgs>),
    /// Make the faces of a mesh planar, near to a reference surface.
    Planarize(Box<PlanarizeArgs>),
    /// Give all edges of a mesh one length, and angles a range, near to a reference surface.
    Wire(Box<WireArgs>),
    /// Bring a mesh under any constraints that a recipe lists.
    Shape(Box<RecipeArgs>),
    /// Let bodies of a scene move: implicit dynamics with obstacles and hard strain limits.
    Simulate(Box<SimulateArgs>),
    /// Measure distances along a surface from some of its vertices.
    Geodesic(Box<GeodesicArgs>),
    /// Sharpen an image whose blur is known.
    Deblur(Box<DeblurArgs>),
    /// Take the noise out of an image.
    Denoise(Box<DenoiseArgs>),
    /// Fill the gaps of an image.
    Inpaint(Box<InpaintArgs>),
    /// Find the wavefront that a coded sensor has seen, from an image without and one with it.
    Wavefront(Box<WavefrontArgs>),
    /// Solve a problem again that --dump has written.
    Replay(Box<ReplayArgs>),
    /// Print the JSON Schema of an input.
    Schema(SchemaArgs),
    /// Do the same to many meshes, each in a process of its own, and go on where it was left.
    #[command(subcommand, arg_required_else_help = true)]
    Batch(BatchCommand),
    /// Pose a built-in octopus or another sample, and write it with a picture.
    Demo(DemoArgs),
    /// Say what a mesh is and what is wrong with it.
    Info(InfoArgs),
    /// Change the format of a mesh, refine it, turn inverted tetrahedra.
    Convert(ConvertArgs),
}

/// The arguments of `proxel info`.
#[derive(Args)]
#[command(after_help = "Exit status 2 if the mesh could not be used for solving.")]
pub struct InfoArgs {
    /// Mesh files, in any format.
    #[arg(required = true, value_name = "MESH")]
    pub meshes: Vec<PathBuf>,
}

/// The arguments of `proxel convert`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel convert body.msh --out body.node
  proxel convert rest.node --out fine.node --refine 1 --init init.node --init-out fine-init.node \\
      --pins handles.txt --pins-out fine-handles.txt")]
pub struct ConvertArgs {
    /// The mesh to read (.npy: positions only).
    #[arg(value_name = "MESH")]
    pub mesh: PathBuf,
    /// The mesh to write; the extension names the format.
    #[arg(long, short, value_name = "FILE")]
    pub out: PathBuf,
    /// Split every tetrahedron into 8 (triangle into 4, edge into 2), N times.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub refine: u32,
    /// A start of the same mesh, to be refined along with it.
    #[arg(long, value_name = "FILE", requires = "init_out")]
    pub init: Option<PathBuf>,
    /// Where the refined start goes (.npy, or a mesh format).
    #[arg(long, value_name = "FILE", requires = "init")]
    pub init_out: Option<PathBuf>,
    /// Pins of the same mesh; a midpoint is pinned where both ends are.
    #[arg(long, value_name = "FILE", requires = "pins_out")]
    pub pins: Option<PathBuf>,
    /// Where the refined pins go: .toml or .json for groups, else a list.
    #[arg(long, value_name = "FILE", requires = "pins")]
    pub pins_out: Option<PathBuf>,
    /// Turn tetrahedra of negative volume by swapping two corners.
    #[arg(long)]
    pub fix_orientation: bool,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}

/// The arguments of `proxel demo`.
#[derive(Args)]
pub struct DemoArgs {
    /// What is posed: octopus; cloth: bending and hard strain limits; planar: a strip in two dimensions; springs: a net;
    /// mixed: tetrahedra, triangles and edges in one mesh; animation: a bar that follows keyframes, as
    /// SAMPLE.glb; unwrap: a map of the octopus's skin, with pictures.
    #[arg(value_name = "SAMPLE", value_parser = demo_names(), default_value = OCTOPUS)]
    pub sample: String,
    /// The folder for SAMPLE.vtu, SAMPLE.obj and SAMPLE.png; made if it is not there.
    #[arg(long, short, value_name = "DIR", default_value = "proxel-demo")]
    pub out: PathBuf,
    /// Threads; all processors if not given.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}

/// The sample that is a body.
pub const OCTOPUS: &str = "octopus";

fn demo_names() -> PossibleValuesParser {
    PossibleValuesParser::new([OCTOPUS].into_iter().chain(NAMES).chain([ANIMATION, UNWRAP]))
}

/// What every command that solves something writes besides its result, and what ends it.
#[derive(Args)]
pub struct RunArgs {
    /// A report of the run, as JSON.
    #[arg(long, value_name = "R.json")]
    pub report: Option<PathBuf>,
    /// One row an iteration, as CSV.
    #[arg(long, value_name = "T.csv")]
    pub trace: Option<PathBuf>,
    /// A picture: of rest, start and result, of a map coloured by its distortion, or of the last frame.
    #[arg(long, value_name = "P.png")]
    pub preview: Option<PathBuf>,
    /// Threads; all processors if not given. The result is the same for any number.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Stop after so many seconds, with the best result so far (exit status 3).
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub time_limit: Option<f64>,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
    /// Print all settings with defaults filled in, and solve nothing.
    #[arg(long)]
    pub show_settings: bool,
}

impl RunArgs {
    /// Checks what the settings of a problem do not.
    pub fn check(&self) -> Result<(), Refusal> {
        if let Some(limit) = self.time_limit.filter(|t| !(*t > 0.0 && t.is_finite())) {
            return Err(Refusal::new(format!("--time-limit is {limit}; give a positive number of seconds")));
        }
        match self.threads {
            Some(0) => Err(Refusal::new("--threads is 0; give at least 1")),
            _ => Ok(()),
        }
    }
}

/// The options of the commands that make one result.
#[derive(Args)]
pub struct SolveArgs {
    /// The result; the extension names the format.
    #[arg(long, short, value_name = "FILE", required_unless_present = "show_settings")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub run: RunArgs,
    /// Stop after so many iterations.
    #[arg(long, value_name = "N", default_value_t = DeformSettings::default().max_iters)]
    pub max_iters: usize,
    /// Converged when the gradient is below T times that of the start or the problem's
    /// characteristic one, whichever is less; with strain limits or obstacles, when primal and dual
    /// residual are below T.
    #[arg(long, value_name = "T", default_value = format!("{:e}", DeformSettings::default().tol), allow_negative_numbers = true)]
    pub tol: f64,
}

/// Prints all settings, for --show-settings; the exit status.
pub fn show_settings(settings: &impl serde::Serialize) -> Result<u8, Refusal> {
    let text = serde_json::to_string_pretty(settings);
    say!("{}", text.map_err(|e| Refusal::new(format!("the settings cannot be printed: {e}")))?);
    Ok(0)
}

/// The command to run; else the exit status, once what clap has to say is said.
pub fn parse() -> Result<Command, ExitCode> {
    match Cli::try_parse() {
        Ok(cli) => Ok(cli.command),
        Err(e) => match e.kind() {
            ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
                // What cannot be printed cannot be complained about either.
                let _ = e.print();
                let help_asked_for = e.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
                Err(ExitCode::from(if help_asked_for { 0 } else { crate::BAD_INPUT }))
            }
            _ => {
                eprintln!("{}", one_line(&e.to_string()));
                Err(ExitCode::from(crate::BAD_INPUT))
            }
        },
    }
}

/// Clap's several lines as one: what is wrong, tips, where help is.
pub fn one_line(text: &str) -> String {
    let mut parts: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim).filter(|l| !l.is_empty()) {
        match parts.last_mut() {
            _ if line.starts_with("Usage:") => {}
            _ if line.starts_with("For more information") => parts.push("see --help".to_owned()),
            // Lists: "the following arguments were not provided:" and then one a line.
            Some(last) if last.ends_with(':') => *last += &format!(" {line}"),
            _ => parts.push(line.to_owned()),
        }
    }
    parts.join("; ")
}

/// Three numbers parted by commas.
pub fn vector(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<&str> = text.split(',').collect();
    let [x, y, z] = parts[..] else { return Err("give three numbers parted by commas, such as 0,-9.81,0".into()) };
    let number = |s: &str| s.trim().parse::<f64>().map_err(|_| format!("`{s}` is no number"));
    Ok([number(x)?, number(y)?, number(z)?])
}

/// Six numbers parted by commas.
pub fn six(text: &str) -> Result<[f64; 6], String> {
    let number = |s: &str| s.trim().parse::<f64>().map_err(|_| format!("`{s}` is no number"));
    let numbers = text.split(',').map(number).collect::<Result<Vec<f64>, String>>()?;
    numbers.try_into().map_err(|_| "give a point and a normal, such as 0,-1,0,0,1,0".to_owned())
}

/// Two numbers parted by a comma; the second may be `inf`.
pub fn pair(text: &str) -> Result<[f64; 2], String> {
    let (low, high) = text.split_once(',').ok_or("give two numbers parted by a comma, such as 0.95,1.05")?;
    let number = |s: &str| s.trim().parse::<f64>().map_err(|_| format!("`{s}` is no number"));
    Ok([number(low)?, number(high)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn usage_errors_become_one_line() {
        let say = |args: &[&str]| one_line(&Cli::try_parse_from(args).err().unwrap().to_string());
        assert_eq!(
            say(&["proxel", "convert", "a.obj"]),
            "error: the following required arguments were not provided: --out <FILE>; see --help"
        );
        let text = say(&["proxel", "deform", "a.obj", "--out", "b.obj", "--metod", "wrapd"]);
        assert!(text.contains("unexpected argument '--metod'") && text.contains("'--method'"), "{text}");
    }

    #[test]
    fn vectors() {
        assert_eq!(vector("0,-9.81, 1e3"), Ok([0.0, -9.81, 1e3]));
        assert!(vector("1,2").is_err() && vector("1,2,x").is_err());
        assert_eq!(pair("0.95, inf"), Ok([0.95, f64::INFINITY]));
        assert!(pair("1").is_err() && pair("1,2,3").is_err());
    }
}
