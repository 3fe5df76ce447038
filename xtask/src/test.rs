//! `cargo xtask test`.

use crate::run::{Failure, Step, cannot_start, cargo, check, proxel, root, target_dir};
use crate::summary::Summary;
use crate::{checks, dist, packages, site};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// Runs everything that can fail and says at the end what did.
pub fn test(full: bool) -> Result<(), Failure> {
    let data = data()?;
    let with_data = |step: Step| match &data {
        Some(dir) => step.env("PROXEL_DATA", dir),
        None => step,
    };
    let demo = target_dir().join("demo");
    // The demo, the examples and the Python package first, so that the output ends with the results of the tests. A step that fails does
    // not keep the others from being tried.
    let demo_end = run_demo(&demo);
    let examples_end = examples().and_then(|names| {
        let example = |name: &String| cargo(["run", "--quiet", "--package", "proxel", "--example", name]).run();
        names.iter().try_for_each(example)
    });
    let python_end = dist::python_where_possible(full);
    // The pages, with the pictures that the tests of the package have left.
    let pages = target_dir().join("site");
    let site_end = match &python_end {
        Ok(None) => site::build(&pages, Some(&dist::pictures())),
        _ => Ok(()),
    };
    // What a version needs before it is published.
    let release_end = if full { checks::licences(&[]).and_then(|()| packages::package(&[])) } else { Ok(()) };
    let (tests_end, summary) = run_tests(with_data(cargo(["test", "--workspace", "--no-fail-fast"])));

    let word = |end: &Result<(), Failure>| if end.is_ok() { "ok" } else { "FAILED" };
    let models = match &data {
        Some(dir) => format!("real models from {}", dir.display()),
        None => "no real models (PROXEL_DATA is not set)".to_owned(),
    };
    println!();
    println!("demo {} ({}), examples {}, {models}", word(&demo_end), demo.display(), word(&examples_end));
    match &python_end {
        Ok(None) => println!("the Python package: ok, the site {} ({})", word(&site_end), pages.display()),
        Ok(Some(reason)) => println!("the Python package: skipped: {reason}"),
        Err(_) => println!("the Python package: FAILED"),
    }
    if full {
        println!("licences and packages: {}", word(&release_end));
    }
    println!("{summary}: {}", word(&tests_end));
    demo_end.and(examples_end).and(python_end.map(|_| ())).and(site_end).and(release_end).and(tests_end)
}

/// The examples of the facade, which assert what they say.
fn examples() -> Result<Vec<String>, Failure> {
    let folder = root().join("crates").join("proxel").join("examples");
    let unreadable = |e: std::io::Error| Failure::other(format!("{}: {e}", folder.display()));
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        names.extend(path.file_stem().map(|name| name.to_string_lossy().into_owned()));
    }
    names.sort();
    Ok(names)
}

/// The folder that PROXEL_DATA names, as an absolute path: tests run in the folders of their packages.
fn data() -> Result<Option<PathBuf>, Failure> {
    let Some(given) = std::env::var_os("PROXEL_DATA").filter(|v| !v.is_empty()) else { return Ok(None) };
    let dir = root().join(&given);
    match dir.canonicalize() {
        Ok(dir) if dir.is_dir() => Ok(Some(dir)),
        _ => Err(Failure::usage(format!(
            "PROXEL_DATA is `{}`, which is no folder; correct or unset it",
            given.to_string_lossy()
        ))),
    }
}

/// What `proxel demo` can pose.
const SAMPLES: [&str; 5] = ["octopus", "cloth", "planar", "springs", "mixed"];

/// The demo leaves the files of every sample, and the picture is one.
fn run_demo(dir: &Path) -> Result<(), Failure> {
    SAMPLES.iter().try_for_each(|sample| run_sample(dir, sample))
}

fn run_sample(dir: &Path, sample: &str) -> Result<(), Failure> {
    let files = ["vtu", "obj", "png"].map(|ending| dir.join(format!("{sample}.{ending}")));
    for file in &files {
        match std::fs::remove_file(file) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Failure::other(format!("{} is in the way: {e}", file.display())));
            }
            _ => {}
        }
    }
    proxel(["demo", sample, "--out"]).args([dir]).run()?;
    for file in &files {
        let length = std::fs::metadata(file).map_or(0, |m| m.len());
        if length == 0 {
            return Err(Failure::other(format!("the demo did not leave {}", file.display())));
        }
    }
    let picture = std::fs::read(&files[2]).map_err(|e| Failure::other(format!("{}: {e}", files[2].display())))?;
    match picture.starts_with(b"\x89PNG\r\n\x1a\n") {
        true => Ok(()),
        false => Err(Failure::other(format!("{} is no PNG file", files[2].display()))),
    }
}

/// Passes the output on while adding up the closing lines.
fn run_tests(mut step: Step) -> (Result<(), Failure>, Summary) {
    let line = step.line();
    eprintln!("$ {line}");
    let mut summary = Summary::default();
    let end = (|| {
        let mut child = step.command().stdout(Stdio::piped()).spawn().map_err(|e| cannot_start(&line, &e))?;
        if let Some(out) = child.stdout.take() {
            let mut here = std::io::stdout().lock();
            for bytes in BufReader::new(out).split(b'\n') {
                let bytes = bytes.map_err(|e| Failure::other(format!("output of `{line}`: {e}")))?;
                let text = String::from_utf8_lossy(&bytes);
                summary.read(&text);
                // Nobody may be listening any more; the tests' result counts nevertheless.
                let _ = writeln!(here, "{text}");
            }
        }
        let status = child.wait().map_err(|e| cannot_start(&line, &e))?;
        check(&line, status)?;
        // A run without tests proves nothing.
        if summary.passed == 0 {
            return Err(Failure::other(format!("`{line}` ran no tests")));
        }
        Ok(())
    })();
    (end, summary)
}
