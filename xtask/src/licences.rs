//! A test of the licences of all dependencies, by the list in deny.toml that cargo-deny reads.

use crate::run::{root, target_dir};
use std::collections::BTreeSet;
use std::process::Command;

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// The texts in quotes after `key` in TOML or JSON: one, or a list of them.
fn quoted<'a>(text: &'a str, key: &str) -> Vec<&'a str> {
    let after = text.split_once(key).map_or("", |(_, after)| after);
    let end = if after.trim_start().starts_with('[') { ']' } else { '\n' };
    after.split(end).next().unwrap_or_default().split('"').skip(1).step_by(2).collect()
}

/// Whether a licence in SPDX, of terms joined by AND each of which lists alternatives, is met by what is allowed.
fn is_allowed(licence: &str, allowed: &BTreeSet<&str>) -> bool {
    // Cargo once wrote `/` for OR.
    let licence = licence.replace('/', " OR ");
    licence.split(" AND ").all(|term| {
        let term = term.trim_matches(['(', ')', ' ']);
        term.split(" OR ").any(|one| allowed.contains(one.trim_matches(['(', ')', ' '])))
    })
}

#[test]
fn licences_are_read_as_they_are_written() {
    let allowed = BTreeSet::from(["MIT", "Unicode-3.0", "Apache-2.0 WITH LLVM-exception"]);
    for good in [
        "MIT",
        "GPL-3.0 OR MIT",
        "MIT/Apache-2.0",
        "(GPL-2.0 OR MIT) AND Unicode-3.0",
        "Apache-2.0 WITH LLVM-exception",
    ] {
        assert!(is_allowed(good, &allowed), "{good}");
    }
    for bad in ["GPL-3.0", "Apache-2.0", "MIT AND GPL-3.0", "(GPL-2.0 OR BSD-2-Clause) AND MIT", ""] {
        assert!(!is_allowed(bad, &allowed), "{bad}");
    }
}

#[test]
fn licences_of_dependencies_are_those_that_deny_toml_allows() {
    let deny = read("deny.toml");
    let allowed: BTreeSet<&str> = quoted(&deny, "\nallow = ").into_iter().collect();
    assert!(allowed.len() >= 5, "deny.toml is not read as it is written: {allowed:?}");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let run = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(root())
        .env("CARGO_TARGET_DIR", target_dir())
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let text = String::from_utf8_lossy(&run.stdout);
    let mut seen = 0;
    // Each package begins with its name, version, id and licence.
    for package in text.split("{\"name\":\"").skip(1).filter(|p| p.contains("\",\"license\":")) {
        let name = package.split('"').next().unwrap_or_default();
        let (_, after) = package.split_once("\"license\":").unwrap();
        let licence = after.strip_prefix('"').and_then(|a| a.split('"').next()).unwrap_or("none");
        assert!(is_allowed(licence, &allowed), "{name} has the licence {licence}, which deny.toml does not allow");
        seen += 1;
    }
    assert!(seen > 50, "{seen} packages");
}
