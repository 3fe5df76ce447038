//! Tests of what the documents promise: the direction of dependencies, libraries that stay silent, equations that are
//! where docs/equations.md says, links that lead somewhere, a README that shows code which compiles.

use crate::run::root;
use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};
use std::path::{Path, PathBuf};

fn read(path: &str) -> String {
    read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// All files below `dir` with this extension.
fn files(dir: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in read_dir(dir).unwrap_or_else(|e| panic!("{}: {e}", dir.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The crates of the workspace among the dependencies (not those of tests) of a manifest.
fn dependencies(krate: &str) -> BTreeSet<String> {
    let folder = if krate == "python" { String::new() } else { "crates/".to_owned() };
    let manifest = read(&format!("{folder}{krate}/Cargo.toml"));
    let mut inside = false;
    let mut found = BTreeSet::new();
    for line in manifest.lines() {
        if line.starts_with('[') {
            inside = line.ends_with("dependencies]") && !line.contains("dev-dependencies");
        } else if inside && line.starts_with("proxel") {
            let name = line.split(['.', ' ', '=']).next().unwrap_or_default();
            found.insert(name.trim_start_matches("proxel-").to_owned());
        }
    }
    found
}

#[test]
fn arrows_between_crates_point_down() {
    let allowed: [(&str, &[&str]); 10] = [
        ("linalg", &[]),
        ("mesh", &[]),
        ("testkit", &[]),
        ("split", &["linalg"]),
        ("model", &["linalg", "split"]),
        ("imaging", &["linalg", "split"]),
        ("proxel", &["imaging", "linalg", "mesh", "model", "split"]),
        ("cli", &["proxel", "imaging", "linalg", "mesh", "model", "split"]),
        ("python", &["proxel"]),
        ("bench", &["proxel", "imaging", "linalg", "mesh", "model", "split", "testkit"]),
    ];
    for entry in read_dir(root().join("crates")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(allowed.iter().any(|(krate, _)| *krate == name), "crates/{name} is not on the map of ARCHITECTURE.md");
    }
    for (krate, below) in allowed {
        for dependency in dependencies(krate) {
            assert!(below.contains(&dependency.as_str()), "{krate} must not depend on {dependency}");
        }
    }
    assert_eq!(dependencies("split").len(), 1, "the manifests are not read as they are written");
}

/// The source of a library without its tests, comments and documentation.
fn code(path: &Path) -> String {
    let text = read_to_string(path).unwrap();
    let before_tests = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    before_tests.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

#[test]
fn libraries_below_the_facade_neither_print_nor_read_a_clock() {
    let mut seen = 0;
    for krate in ["linalg", "split", "model", "imaging", "mesh"] {
        for path in files(&root().join("crates").join(krate).join("src"), "rs") {
            let name = path.strip_prefix(root()).unwrap().to_string_lossy().into_owned();
            if name.ends_with("tests.rs") || name.contains("/tests/") {
                continue;
            }
            let code = code(&path);
            for word in ["println!", "print!", "dbg!", "Instant::", "SystemTime", "std::env::var"] {
                assert!(!code.contains(word), "{name} uses {word}");
            }
            seen += 1;
        }
    }
    assert!(seen > 50, "{seen} files");
}

/// The equations that a text names: W(10b), and W(22) and W(23) for "W(22)-(23)".
fn equations(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let bytes = text.as_bytes();
    for (at, _) in text.match_indices(['W', 'A']) {
        let letter = bytes[at] as char;
        if at > 0 && (bytes[at - 1].is_ascii_alphanumeric() || bytes[at - 1] == b'_') {
            continue;
        }
        let Some((first, after)) = parenthesised(&text[at + 1..]) else { continue };
        found.insert(format!("{letter}({first})"));
        let Some((last, _)) = after.strip_prefix('-').and_then(parenthesised) else { continue };
        if let (Ok(first), Ok(last)) = (first.parse::<u32>(), last.parse::<u32>()) {
            found.extend((first..=last).map(|n| format!("{letter}({n})")));
        } else {
            found.insert(format!("{letter}({last})"));
        }
    }
    found
}

/// "(10b) and more" as "10b" and " and more": digits and at most one letter.
fn parenthesised(text: &str) -> Option<(&str, &str)> {
    let (inside, after) = text.strip_prefix('(')?.split_once(')')?;
    let digits = inside.trim_end_matches(|c: char| c.is_ascii_lowercase());
    let numbered = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()) && inside.len() <= digits.len() + 1;
    numbered.then_some((inside, after))
}

#[test]
fn equations_are_found_in_text() {
    let found = equations("W(10b), as A(27); W(22)-(24), but no RAW(3), W(x), W (4) or A(5");
    let expected = ["W(10b)", "A(27)", "W(22)", "W(23)", "W(24)"].map(str::to_owned);
    assert_eq!(found, BTreeSet::from(expected));
}

/// The rows of the tables of docs/equations.md: first column, file, item.
fn table() -> Vec<(String, String, String)> {
    let text = read("docs/equations.md");
    let rows = text.lines().filter(|l| l.starts_with("| ") && l.contains("| crates/"));
    rows.map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").map(str::trim).collect();
        assert_eq!(cells.len(), 4, "four cells a row: {row}");
        (cells[0].to_owned(), cells[2].to_owned(), cells[3].trim_matches('`').to_owned())
    })
    .collect()
}

#[test]
fn equations_in_the_source_are_listed_and_the_list_is_true() {
    let table = table();
    assert!(table.len() > 30, "{} rows", table.len());
    for (equation, file, item) in &table {
        let source = read(file);
        let word = |c: char| c.is_alphanumeric() || c == '_';
        assert!(source.split(|c: char| !word(c)).any(|w| w == item), "{equation}: {file} has no {item}");
    }
    let listed: BTreeSet<String> = table.iter().flat_map(|(equation, _, _)| equations(equation)).collect();
    for path in files(&root().join("crates"), "rs") {
        let missing: Vec<String> = equations(&read_to_string(&path).unwrap()).difference(&listed).cloned().collect();
        assert!(missing.is_empty(), "{} names {missing:?}, which docs/equations.md does not list", path.display());
    }
}

/// The documents at the root and in docs/.
fn documents() -> Vec<PathBuf> {
    let at_root = read_dir(root()).unwrap().map(|e| e.unwrap().path());
    let mut found: Vec<PathBuf> = at_root.filter(|p| p.extension().is_some_and(|e| e == "md")).collect();
    found.extend(files(&root().join("docs"), "md"));
    found
}

#[test]
fn links_of_the_documents_lead_somewhere() {
    let mut followed = 0;
    for path in documents() {
        let text = read_to_string(&path).unwrap();
        for (at, _) in text.match_indices("](") {
            let target = text[at + 2..].split([')', '#']).next().unwrap_or_default();
            if target.is_empty() || target.contains("://") {
                continue;
            }
            let there = path.parent().unwrap().join(target);
            assert!(there.exists(), "{}: {target} does not exist", path.display());
            followed += 1;
        }
    }
    assert!(followed > 10, "{followed} links");
}

/// A `|` within a cell, as in |g|^2, ends it: what follows is shown in another column, or not at all.
#[test]
fn rows_of_tables_have_the_cells_of_their_heads() {
    let mut rows = 0;
    for path in documents() {
        let (text, mut is_code, mut head) = (read_to_string(&path).unwrap(), false, None);
        for (line, number) in text.lines().zip(1..) {
            is_code ^= line.starts_with("```");
            if is_code || !line.starts_with('|') {
                head = None;
                continue;
            }
            let bars = line.replace("\\|", "").matches('|').count();
            assert_eq!(bars, *head.get_or_insert(bars), "{}: line {number} is no row of its table", path.display());
            rows += 1;
        }
    }
    assert!(rows > 300, "{rows} rows");
}

#[test]
fn the_readme_shows_the_example_as_it_is() {
    let readme = read("README.md");
    let (_, after) = readme.split_once("```rust\n").expect("README.md has Rust code");
    let (shown, _) = after.split_once("```").expect("a block has an end");
    let example = read("crates/proxel/examples/pose.rs");
    let begin = example.find("use ").expect("the example uses the library");
    assert_eq!(shown, &example[begin..], "README.md and crates/proxel/examples/pose.rs differ");
}
