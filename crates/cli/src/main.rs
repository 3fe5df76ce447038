//! The command `proxel`.
//!
//! Exit status: 0 converged or done, 1 failed, 2 bad input or usage, 3 stopped before convergence,
//! 130 cancelled.

/// As `println!`, but a reader that has gone away, as `head` does, is no reason to fail.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

mod args;
mod batch;
mod convert;
mod deform;
mod demo;
mod demo_animation;
mod demo_unwrap;
mod files;
mod geodesic;
mod imaging;
mod info;
mod interrupt;
mod progress;
mod refusal;
mod replay;
mod shape;
mod simulate;
mod unwrap;
mod wavefront;

use std::process::ExitCode;

use args::Command;

/// Bad input or usage.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    if let Err(refusal) = batch::limit_this_process() {
        eprintln!("error: {refusal}");
        return ExitCode::from(BAD_INPUT);
    }
    let command = match args::parse() {
        Ok(command) => command,
        Err(code) => return code,
    };
    let end = match command {
        Command::Deform(args) => deform::run(&args),
        Command::Unwrap(args) => unwrap::run(&args),
        Command::Geodesic(args) => geodesic::run(&args),
        Command::Planarize(args) => shape::planarize(&args),
        Command::Wire(args) => shape::wire(&args),
        Command::Shape(args) => shape::recipe(&args),
        Command::Deblur(args) => imaging::deblur(&args),
        Command::Denoise(args) => imaging::denoise(&args),
        Command::Inpaint(args) => imaging::inpaint(&args),
        Command::Wavefront(args) => wavefront::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Schema(args) => simulate::schema(&args),
        Command::Batch(command) => batch::run(command),
        Command::Demo(args) => demo::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Convert(args) => convert::run(&args),
    };
    ExitCode::from(end.unwrap_or_else(|refusal| {
        eprintln!("error: {refusal}");
        BAD_INPUT
    }))
}
