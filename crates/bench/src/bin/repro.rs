//! `repro NAME --out DIR`: tables and figures of the papers.

use clap::Parser;
use proxel_bench::repro::{ALL, Options, run};
use std::path::PathBuf;
use std::process::ExitCode;

/// Reproduces a table or figure: writes NAME.md, NAME.csv and plots. PROXEL_DATA names the folder with the data.
#[derive(Parser)]
#[command(name = "repro", version, after_help = names())]
struct Arguments {
    /// What to reproduce
    name: String,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Models, with commas between; `beam` is generated
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    models: Vec<String>,
    /// Threads; all processors by default
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Most iterations of a run; 2000 by default, 300 with --quick
    #[arg(long, value_name = "N")]
    max_iters: Option<usize>,
    /// Multipliers (beta) of squared weights that static methods are tried with
    #[arg(long, value_delimiter = ',', value_name = "BETAS")]
    weight_scales: Vec<f64>,
    /// Runs of each kind; seconds are the least
    #[arg(long, default_value_t = 1, value_name = "N")]
    repeats: usize,
    /// Meshes of unwrap-robustness; 2000 by default, 60 with --quick
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    /// Few models, values and iterations, to see that all works
    #[arg(long)]
    quick: bool,
}

fn names() -> String {
    let lines: Vec<String> = ALL.iter().map(|r| format!("  {:<17} {}", r.name, r.about)).collect();
    format!("Names:\n{}", lines.join("\n"))
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let options = Options {
        out: arguments.out,
        models: arguments.models,
        threads: arguments.threads.map(usize::from),
        max_iters: arguments.max_iters,
        weight_scales: arguments.weight_scales,
        repeats: arguments.repeats,
        count: arguments.count,
        quick: arguments.quick,
    };
    match run(&arguments.name, &options, &mut |what| eprintln!("{what}")) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::from(2)
        }
    }
}
