//! `cargo xtask package`: what crates.io would be given, crate by crate.

use crate::run::{Failure, cargo};
use std::ffi::OsString;

/// The crates that are published, each after those that it depends on. The others have `publish = false`.
pub const PUBLISHED: [&str; 7] =
    ["proxel-linalg", "proxel-mesh", "proxel-split", "proxel-model", "proxel-imaging", "proxel", "proxel-cli"];

/// `cargo xtask package [--no-verify]`: the packages, each built from what is in it and from the other packages;
/// nothing is sent anywhere.
pub fn package(args: &[OsString]) -> Result<(), Failure> {
    let verified = match args {
        [] => true,
        [only] if only == "--no-verify" => false,
        _ => return Err(Failure::usage("package takes --no-verify and nothing else")),
    };
    // What is not committed yet is tried too; `cargo publish` refuses it.
    let step =
        cargo(["package", "--locked", "--allow-dirty"]).args(PUBLISHED.iter().flat_map(|krate| ["--package", krate]));
    if verified { step } else { step.args(["--no-verify"]) }.run()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{root, target_dir};
    use std::collections::BTreeSet;
    use std::fs::{read_dir, read_to_string};
    use std::path::{Component, Path};
    use std::process::Command;

    fn read(path: &str) -> String {
        read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
    }

    /// The text of `key = "text"` at the start of a line.
    fn text<'a>(manifest: &'a str, key: &str) -> Option<&'a str> {
        manifest.lines().find_map(|l| l.strip_prefix(key)?.strip_prefix(" = \"")?.strip_suffix('"'))
    }

    /// Folders of the members below crates/, and their manifests.
    fn crates() -> Vec<(String, String)> {
        let folders = read_dir(root().join("crates")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        folders.map(|f| (format!("crates/{f}"), read(&format!("crates/{f}/Cargo.toml")))).collect()
    }

    #[test]
    fn there_is_one_version_in_one_place() {
        let manifest = read("Cargo.toml");
        let (_, after) = manifest.split_once("[workspace.package]").unwrap();
        let version = text(after, "version").unwrap().to_owned();
        assert_eq!(version, env!("CARGO_PKG_VERSION"));
        let mut seen = 0;
        for line in manifest.lines().filter(|l| l.starts_with("proxel") && l.contains("path = ")) {
            // Of testkit no version is named: dependencies of tests that have none are left out of what is published.
            let expected = if line.starts_with("proxel-testkit") { None } else { Some(version.as_str()) };
            let named = line.split_once("version = \"").and_then(|(_, after)| after.split('"').next());
            assert_eq!(named, expected, "Cargo.toml: {line}");
            seen += 1;
        }
        assert!(seen >= 7, "{seen} crates in workspace.dependencies");
        let mut manifests = crates();
        manifests.extend(["python", "xtask"].map(|f| (f.to_owned(), read(&format!("{f}/Cargo.toml")))));
        for (folder, manifest) in manifests {
            assert!(manifest.contains("\nversion.workspace = true\n"), "{folder}: it has a version of its own");
            for line in manifest.lines().filter(|l| l.starts_with("proxel") && !l.contains("crates/")) {
                assert!(line.contains("workspace = true"), "{folder}: {line} is not that of the workspace");
            }
        }
        let python = read("python/pyproject.toml");
        let project = python.split("[project]").nth(1).and_then(|after| after.split("\n[").next()).unwrap();
        assert!(project.contains("\ndynamic = [\"version\"]") && text(project, "version").is_none());
        assert!(read("CITATION.cff").contains(&format!("\nversion: {version}\n")), "CITATION.cff");
    }

    #[test]
    fn what_is_published_says_what_it_is() {
        let mut published = BTreeSet::new();
        for (folder, manifest) in crates() {
            if manifest.contains("\npublish = false\n") {
                continue;
            }
            published.insert(text(&manifest, "name").unwrap().to_owned());
            assert!(text(&manifest, "description").is_some_and(|d| d.len() > 10), "{folder}: it has no description");
            for key in ["license", "repository", "rust-version", "keywords", "categories"] {
                assert!(manifest.contains(&format!("\n{key}.workspace = true\n")), "{folder}: it has no {key}");
            }
            assert_eq!(text(&manifest, "readme"), Some("README.md"), "{folder}");
        }
        assert_eq!(published, PUBLISHED.map(str::to_owned).into(), "PUBLISHED and the manifests differ");
    }

    /// `a/../b` as `b`; None where it leads out.
    fn inside(path: &Path) -> Option<String> {
        let mut parts: Vec<&str> = Vec::new();
        for part in path.components() {
            match part {
                Component::ParentDir => drop(parts.pop()?),
                Component::Normal(name) => parts.push(name.to_str()?),
                _ => return None,
            }
        }
        Some(parts.join("/"))
    }

    #[test]
    fn packages_have_their_licences_and_nothing_from_outside() {
        assert_eq!(inside(Path::new("src/io/../../data/a")), Some("data/a".to_owned()));
        assert_eq!(inside(Path::new("src/../../a")), None);
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        for (folder, manifest) in crates() {
            let name = text(&manifest, "name").unwrap();
            if !PUBLISHED.contains(&name) {
                continue;
            }
            let run = Command::new(&cargo)
                .args(["package", "--list", "--allow-dirty", "--package", name])
                .current_dir(root())
                .env("CARGO_TARGET_DIR", target_dir())
                .output()
                .unwrap();
            assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
            let listed: BTreeSet<String> = String::from_utf8_lossy(&run.stdout).lines().map(str::to_owned).collect();
            for file in ["README.md", "LICENSE-MIT", "LICENSE-APACHE", "Cargo.toml"] {
                assert!(listed.contains(file), "{name}: {file} is not packaged");
            }
            for file in listed.iter().filter(|f| f.ends_with(".rs")) {
                let source = read(&format!("{folder}/{file}"));
                for included in source.split("include_str!(\"").chain(source.split("include_bytes!(\"")) {
                    let Some(target) = included.split('"').next().filter(|t| t.starts_with("..")) else { continue };
                    let there = inside(&Path::new(file).with_file_name(target));
                    let packaged = there.is_some_and(|path| listed.contains(&path));
                    assert!(packaged, "{name}: {file} includes {target}, which is not packaged");
                }
            }
        }
    }
}
