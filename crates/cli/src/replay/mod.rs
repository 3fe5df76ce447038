//! `proxel replay`: a problem that --dump has written, once more.

mod frame;

use std::path::PathBuf;

use clap::Args;
use proxel::problem_file::ProblemFile;
use proxel::settings::MethodName;
use proxel::simulate::SolverSpec;

use crate::args::{RunArgs, show_settings};
use crate::deform::{Files, Inputs, solve_and_write};
use crate::interrupt::Interrupt;
use crate::refusal::Refusal;

/// The arguments of `proxel replay`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel deform body.mesh --pins hands.toml --out posed.vtu --dump problem.json
  proxel replay problem.json --report again.json        the same figures, to the bit
  proxel replay problem.json --method newton --out other.vtu
  proxel simulate scene.toml --frames 31 --out run --dump frame31.json
  proxel replay frame31.json --trace frame31.csv

Exit status: that of the command that has written FILE.")]
pub struct ReplayArgs {
    /// The problem.
    #[arg(value_name = "FILE.json")]
    pub problem: PathBuf,
    /// The result; the extension names the format. Of a frame: its body, where there is only one.
    #[arg(long, short, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Another method than that of the problem.
    #[arg(long, value_name = "NAME", value_parser = SolverSpec::method_of)]
    pub method: Option<MethodName>,
    /// Most iterations (of a frame: of each step), instead of those of the problem.
    #[arg(long, value_name = "N")]
    pub max_iters: Option<usize>,
    /// Another tolerance than that of the problem.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub tol: Option<f64>,
    #[command(flatten)]
    pub run: RunArgs,
}

/// Reads, solves, writes what is asked for.
pub fn run(args: &ReplayArgs) -> Result<u8, Refusal> {
    args.run.check()?;
    let problem = ProblemFile::read(&args.problem)?;
    let (input, mut settings) = match problem {
        ProblemFile::Simulate { scene, state } => return frame::run(args, *scene, state),
        ProblemFile::Deform { input, settings } => (*input, *settings),
    };
    settings.method = args.method.unwrap_or(settings.method);
    settings.max_iters = args.max_iters.unwrap_or(settings.max_iters);
    settings.tol = args.tol.unwrap_or(settings.tol);
    settings.threads = args.run.threads;
    settings.time_limit = args.run.time_limit;
    settings.check().map_err(Refusal::new)?;
    if args.run.show_settings {
        return show_settings(&settings);
    }
    let files = Files {
        meshes: args.out.iter().cloned().collect(),
        report: args.run.report.clone(),
        trace: args.run.trace.clone(),
        preview: args.run.preview.clone(),
        lattice: None,
    };
    files.check()?;
    let interrupt = Interrupt::listen()?;
    let inputs = Inputs { input, warnings: Vec::new(), read: 0.0 };
    solve_and_write(inputs, &settings, &files, &interrupt, args.run.quiet)
}
