//! The options of `proxel simulate` and `proxel schema`.

use std::path::PathBuf;

use clap::Args;
use proxel::settings::{MethodName, PenaltyName};
use proxel::simulate::{Scene, SceneFile, SolverSpec};

use crate::args::RunArgs;
use crate::refusal::Refusal;

/// The arguments of `proxel simulate`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel simulate scene.toml --out run                  frames, frames.csv, report.json, frames.pvd for ParaView
  proxel simulate scene.toml --out run --resume         go on from the last complete frame
  proxel schema scene > scene.schema.json               what a scene can say

Exit status: 0 all steps converged, 1 failed, 2 bad scene, 3 some steps stopped before convergence or the time
was over, 130 cancelled. Every complete frame is kept.")]
pub struct SimulateArgs {
    /// The scene, .toml or .json.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The folder for frames; made if it is not there.
    #[arg(long, short, value_name = "DIR", required_unless_present = "show_settings")]
    pub out: Option<PathBuf>,
    /// Go on from the last complete frame in DIR, with the same result as without the break.
    #[arg(long)]
    pub resume: bool,
    /// The minimiser of each step, instead of the scene's.
    #[arg(long, value_name = "NAME", value_parser = method)]
    pub method: Option<MethodName>,
    /// What squared weights are multiplied by, instead of the scene's: weights, nothing; safe, the least factor for which each
    /// step is proven to converge (admm and aa-admm, stvk).
    #[arg(long, value_name = "NAME", value_parser = PenaltyName::NAMES)]
    pub penalty: Option<String>,
    /// Frames after the start, instead of the scene's.
    #[arg(long, value_name = "N")]
    pub frames: Option<usize>,
    /// Most iterations a step, instead of the scene's.
    #[arg(long, value_name = "N")]
    pub max_iters: Option<usize>,
    /// Tolerance of each step, instead of the scene's.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub tol: Option<f64>,
    /// The last frame that was begun as a problem in one file: `proxel replay` solves it again.
    #[arg(long, value_name = "FILE.json")]
    pub dump: Option<PathBuf>,
    #[command(flatten)]
    pub run: RunArgs,
}

/// The arguments of `proxel schema`.
#[derive(Args)]
pub struct SchemaArgs {
    /// What is described: scene, the input of `proxel simulate`; recipe, that of `proxel shape`.
    #[arg(value_name = "WHAT", value_parser = ["scene", "recipe"])]
    pub what: String,
}

fn method(name: &str) -> Result<MethodName, String> {
    SolverSpec::method_of(name)
}

impl SimulateArgs {
    /// The scene with the options in the place of its settings.
    pub fn read(&self) -> Result<SceneFile, Refusal> {
        self.run.check()?;
        let mut file = SceneFile::read(&self.scene)?;
        file.change(|scene: &mut Scene| {
            let solver = &mut scene.solver;
            solver.method = self.method.unwrap_or(solver.method);
            solver.penalty = self.penalty.as_deref().and_then(PenaltyName::from_name).unwrap_or(solver.penalty);
            solver.max_iters = self.max_iters.unwrap_or(solver.max_iters);
            solver.tol = self.tol.unwrap_or(solver.tol);
            scene.time.frames = self.frames.unwrap_or(scene.time.frames);
        })?;
        Ok(file)
    }
}
