//! Chores of the workspace, run as `cargo xtask NAME`: tests, lints, the demo, reproductions.
//!
//! They need nothing but cargo, and python3 where they are about the Python package. What a chore runs is printed
//! before it runs, and the exit status of what failed is passed on.

mod checks;
mod dist;
mod free_threaded;
#[cfg(test)]
mod licences;
mod packages;
#[cfg(test)]
mod rules;
mod run;
mod site;
mod summary;
mod test;

use run::{Failure, Step, cargo};
use std::ffi::OsString;
use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask CHORE

Chores:
  test [--full]           all tests, doctests and examples, those of the Python package where there is a
                          python3 for them, and the demo into target/demo; with --full the package with all
                          that it works with too, a Ray cluster among it, licences and packages
  lint                    formatting, clippy and the documentation, warnings being errors
  demo [ARGS]             proxel demo, as released
  repro NAME --out DIR    a reproduction of a published table or figure; --help lists them
  dist [--wheel] [--wheel-free-threaded] --out DIR
                          the wheel of the Python package, that for a Python without a global lock, or without
                          these flags the former, its sources and the command, as released
  performance [--measure] docs/performance.md from the committed results of the bench `ratios`, or from new ones
  licences [--advisories]  licences and sources of all dependencies by deny.toml, and with --advisories known
                          weaknesses too; brings cargo-deny where it is not installed
  semver [--baseline REV] what has changed of public interfaces since a revision, or the last tagged version,
                          against the version number; needs cargo-semver-checks
  package [--no-verify]   the crates as crates.io would be given them, built from their packages
  python [ARGS]           builds the wheel and runs its tests by pytest, with these arguments; --full, the
                          first of them, brings all packages that it works with
  site --out DIR          the documents as a site, with the gallery; a link that leads nowhere fails
  help                    this text

PYTHON names the Python to be used instead of python3, PYTHON_FREE_THREADED one without a global lock; what else is
needed comes from PyPI into the target folder.
PROXEL_DATA names the folder with quasistatic/, parameterization/, .. that tests and reproductions on real
models read. Without it those tests are skipped.";

fn main() -> ExitCode {
    let mut args = std::env::args_os().skip(1);
    let chore = args.next().unwrap_or_else(|| "help".into());
    let rest: Vec<OsString> = args.collect();
    let end = match chore.to_string_lossy().as_ref() {
        "test" => full(&rest).and_then(test::test),
        "lint" => none(&rest).and_then(|()| lint()),
        "demo" => run::proxel(["demo"]).args(rest).run(),
        "repro" => cargo(["run", "--release", "--package", "proxel-bench", "--bin", "repro", "--"]).args(rest).run(),
        "dist" => dist::dist(&rest),
        "performance" => performance(&rest),
        "licences" => checks::licences(&rest),
        "semver" => checks::semver(&rest),
        "package" => packages::package(&rest),
        "python" => dist::python(&rest),
        "site" => site::site(&rest),
        "help" | "--help" | "-h" => {
            println!("{HELP}");
            Ok(())
        }
        other => Err(Failure::usage(format!("there is no chore `{other}`\n\n{HELP}"))),
    };
    end.map_or_else(|failure| failure.report(), |()| ExitCode::SUCCESS)
}

/// The page of the results that are committed; with `--measure` of new ones, of which the file is left to commit.
fn performance(rest: &[OsString]) -> Result<(), Failure> {
    match rest {
        [] => {}
        [only] if only == "--measure" => {
            let ratios = ["run", "--release", "--package", "proxel-bench", "--bin", "ratios", "--"];
            cargo(ratios).args(["--json", "crates/bench/results/ratios.json"]).run()?;
        }
        _ => return Err(Failure::usage("performance takes --measure and nothing else")),
    }
    cargo(["run", "--package", "proxel-bench", "--bin", "ratios", "--", "--page"]).run()
}

/// Chores without arguments refuse them instead of ignoring them.
fn none(rest: &[OsString]) -> Result<(), Failure> {
    match rest.first() {
        None => Ok(()),
        Some(first) => Err(Failure::usage(format!("this chore takes no arguments, got `{}`", first.to_string_lossy()))),
    }
}

/// Whether `--full` was given, and nothing else.
fn full(rest: &[OsString]) -> Result<bool, Failure> {
    match rest {
        [only] if only == "--full" => Ok(true),
        _ => none(rest).map(|()| false),
    }
}

fn lint() -> Result<(), Failure> {
    let steps: [Step; 3] = [
        cargo(["fmt", "--all", "--check"]),
        cargo(["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]),
        // Libraries only: the command has the name of the facade and would overwrite its pages.
        cargo(["doc", "--workspace", "--lib", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings"),
    ];
    run::all(steps)?;
    println!("lint: formatting, clippy and documentation are clean");
    Ok(())
}
