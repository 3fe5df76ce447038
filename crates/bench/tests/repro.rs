//! Reproductions end to end, without data, so that they cannot rot.

use proxel_bench::repro::{Options, run};
use std::path::{Path, PathBuf};

/// A folder of its own for a test, empty.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).expect("an old folder of this test");
    }
    folder
}

fn read(folder: &Path, file: &str) -> String {
    std::fs::read_to_string(folder.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// Iterations to a level, from the CSV; none where the cell is empty.
fn iterations(csv: &str, problem: &str, method: &str, level: &str) -> Option<u32> {
    let start = format!("{problem},{method},{level},");
    let line = csv.lines().find(|l| l.starts_with(&start)).unwrap_or_else(|| panic!("no row {start}"));
    line[start.len()..].split(',').next().and_then(|cell| cell.parse().ok())
}

#[test]
fn figure2_shows_that_rotation_awareness_turns_a_chain_in_fewer_iterations() {
    let out = folder("figure2");
    run("wrapd-figure2", &Options { out: out.clone(), quick: true, ..Options::default() }, &mut |_| ())
        .expect("figure 2");
    let csv = read(&out, "wrapd-figure2.csv");
    assert_eq!(csv.lines().next(), Some("problem,method,level,iterations,seconds"));
    let of = |method: &str| iterations(&csv, "chain of 8; 90 degrees", method, "1e-4").expect("converged");
    assert!(of("r-admm") <= 10, "{}", of("r-admm"));
    assert!(of("admm-pd") >= 4 * of("r-admm"), "{} against {}", of("admm-pd"), of("r-admm"));
    let text = read(&out, "wrapd-figure2.md");
    for plot in ["wrapd-figure2-energy.svg", "wrapd-figure2-chains.svg"] {
        assert!(text.contains(plot) && read(&out, plot).starts_with("<svg"), "{plot}");
    }
}

#[test]
fn table1_of_a_generated_beam_lists_every_method_and_level() {
    let out = folder("table1");
    let options = Options { out: out.clone(), models: vec!["beam".into()], quick: true, ..Options::default() };
    run("wrapd-table1", &options, &mut |_| ()).expect("table 1");
    let csv = read(&out, "wrapd-table1.csv");
    assert_eq!(csv.lines().count(), 1 + 3 * 12 * 8, "{csv}"); // a header, 3 values of nu, 12 methods, 8 levels
    let wrapd: Vec<u32> = ["1e-1", "1e-2", "1e-3", "1e-4"]
        .iter()
        .map(|level| iterations(&csv, "beam", "wrapd", level).expect("reached"))
        .collect();
    assert!(wrapd.is_sorted() && wrapd[3] <= 150, "{wrapd:?}");
    assert_eq!(
        iterations(&csv, "beam", "w-admm", "1e-4"),
        None,
        "a linear coupling cannot turn the beam in 300 iterations"
    );
    for method in ["lbfgs", "aadr", "aa-admm"] {
        assert!(iterations(&csv, "beam", method, "1e-2").is_some(), "{method}: {csv}");
    }
    assert!(csv.contains("beam nu=0.499,wrapd,1e-4,"));
    let text = read(&out, "wrapd-table1.md");
    assert!(text.contains("a generated beam") && text.contains("auto over best"), "{text}");
    assert!(read(&out, "wrapd-table1-beam.svg").contains("position error"));
}

#[test]
fn the_other_reproductions_run_on_a_generated_beam() {
    for (name, rows) in [("wrapd-figure4", 8 * 4), ("wrapd-sweeps", 0), ("schedules", 0)] {
        let out = folder(name);
        let options = Options { out: out.clone(), models: vec!["beam".into()], quick: true, ..Options::default() };
        run(name, &options, &mut |_| ()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let csv = read(&out, &format!("{name}.csv"));
        let reached = csv.lines().filter(|l| l.contains(",1e-4,") && !l.ends_with(",,")).count();
        assert!(reached >= 2, "{name}: {csv}");
        assert!(rows == 0 || csv.lines().count() == 1 + rows, "{name}: {csv}");
    }
}

#[test]
fn a_name_that_is_not_known_is_refused_with_those_that_are() {
    let error =
        run("table-one", &Options { out: folder("unknown"), ..Options::default() }, &mut |_| ()).expect_err("refused");
    assert!(error.to_string().contains("wrapd-table1"), "{error}");
}

#[test]
fn growth_and_race_of_a_generated_beam() {
    let out = folder("growth");
    let options = Options { out: out.clone(), quick: true, models: vec!["beam".to_string()], ..Options::default() };
    run("growth", &options, &mut |_| ()).expect("growth");
    let text = read(&out, "growth.md");
    let rows = text.lines().filter(|l| l.matches(" s)").count() == 4).count();
    assert_eq!(rows, 2, "every method converges at both sizes: {text}");
    assert!(read(&out, "growth.svg").contains("newton-cg"));
    run("race", &options, &mut |_| ()).expect("race");
    let csv = read(&out, "race.csv");
    let of = |method: &str| iterations(&csv, "beam", method, "energy 1e-10").expect("reached");
    assert!(of("auto") < of("wrapd"), "{csv}");
}

#[test]
fn hopeless_starts_of_a_generated_beam_are_solved() {
    let out = folder("hopeless");
    let options = Options { out: out.clone(), quick: true, models: vec!["beam".to_string()], ..Options::default() };
    run("hopeless", &options, &mut |_| ()).expect("hopeless");
    let text = read(&out, "hopeless.md");
    assert!(text.contains("4 of 4 runs"), "{text}");
}

#[test]
fn figure8_compares_two_methods_on_cloth_with_limits() {
    let out = folder("figure8");
    let options = Options { out: out.clone(), quick: true, ..Options::default() };
    run("wrapd-figure8", &options, &mut |_| ()).expect("figure 8");
    let csv = read(&out, "wrapd-figure8.csv");
    let wrapd = iterations(&csv, "cloth", "wrapd", "1e-3").expect("reached");
    assert!(wrapd <= 300, "{wrapd}");
    let text = read(&out, "wrapd-figure8.md");
    assert!(text.contains("[0.95") && text.contains("1.05"), "{text}");
    for picture in ["wrapd-figure8-wrapd.png", "wrapd-figure8-admm-pd.png"] {
        let bytes = std::fs::read(out.join(picture)).expect("a picture");
        assert!(text.contains(picture) && bytes.starts_with(b"\x89PNG"), "{picture}");
    }
    assert!(read(&out, "wrapd-figure8.svg").contains("position error"));
}
