//! `ratios`: speed and memory as ratios within one run, beside their thresholds, as a Markdown table.

use clap::Parser;
use proxel_bench::ratios::{child, growth, measure, table};
use std::process::ExitCode;

/// Measures an iteration, its parts, decompositions and memory, taken in turns, and prints ratios beside their thresholds.
/// PROXEL_DATA names the folder with the data; without it a generated beam takes the place of the centaur.
#[derive(Parser)]
#[command(name = "ratios", version)]
struct Arguments {
    /// How often each part is timed
    #[arg(long, default_value_t = 30, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    /// Only these rows: decompositions, closest, images, wires, fields, iteration, memory, solves
    #[arg(long, value_name = "ROWS")]
    only: Option<String>,
    /// Also solve the model with every tetrahedron in 8, and say how iterations and time grow (minutes)
    #[arg(long)]
    scale: bool,
    /// Solve and print peak bytes, factor bytes and tetrahedra: what the program runs as its own child
    #[arg(long, hide = true)]
    memory_child: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut tell = |what: &str| eprintln!("{what}");
    let result = if arguments.memory_child {
        child()
    } else {
        measure(usize::from(arguments.repeats), arguments.only.as_deref(), &mut tell).and_then(|rows| {
            let mut text = table(&rows);
            if arguments.scale {
                text = format!("{text}\n{}", growth(&mut tell)?);
            }
            Ok(text)
        })
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
