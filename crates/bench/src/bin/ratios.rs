//! `ratios`: speed and memory as ratios within one run, beside their thresholds, as a Markdown table and as JSON.

use clap::Parser;
use proxel_bench::BenchError;
use proxel_bench::ratios::{Machine, Results, child, fill_page, growth, measure, table};
use std::path::PathBuf;
use std::process::ExitCode;

/// Measures an iteration, its parts, decompositions and memory, taken in turns, and prints ratios beside their thresholds.
/// PROXEL_DATA names the folder with the data; without it a generated beam takes the place of the centaur.
#[derive(Parser)]
#[command(name = "ratios", version)]
struct Arguments {
    /// How often each part is timed
    #[arg(long, default_value_t = 30, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    /// Only these rows: decompositions, closest, images, precision, wires, fields, iteration, memory, solves
    #[arg(long, value_name = "ROWS")]
    only: Option<String>,
    /// Also solve the model with every tetrahedron in 8, and say how iterations and time grow (minutes)
    #[arg(long)]
    scale: bool,
    /// Also write the rows, and what machine this is, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Measure nothing: put the committed results, crates/bench/results/ratios.json, into docs/performance.md
    #[arg(long, conflicts_with_all = ["only", "scale", "json"])]
    page: bool,
    /// Solve and print peak bytes, factor bytes and tetrahedra: what the program runs as its own child
    #[arg(long, hide = true)]
    memory_child: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut tell = |what: &str| eprintln!("{what}");
    let result = if arguments.memory_child {
        child()
    } else if arguments.page {
        fill_page()
    } else {
        measured(&arguments, &mut tell)
    };
    match result {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(e) => {
            eprintln!("{e}");
            ExitCode::from(2)
        }
    }
}

fn measured(arguments: &Arguments, tell: &mut dyn FnMut(&str)) -> Result<String, BenchError> {
    let (machine, repeats) = (Machine::here(), usize::from(arguments.repeats));
    let rows = measure(repeats, arguments.only.as_deref(), tell)?;
    let mut text = table(&rows);
    if let Some(path) = &arguments.json {
        Results::new(rows, repeats, machine).write(path)?;
    }
    if arguments.scale {
        text = format!("{text}\n{}", growth(tell)?);
    }
    Ok(text)
}
