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

fn of_cap(name: &str) -> (PathBuf, String, String) {
    let out = folder(name);
    let options = Options { out: out.clone(), quick: true, models: vec!["cap".into()], ..Options::default() };
    run(name, &options, &mut |_| ()).unwrap_or_else(|e| panic!("{name}: {e}"));
    let (csv, text) = (read(&out, &format!("{name}.csv")), read(&out, &format!("{name}.md")));
    (out, csv, text)
}

#[test]
fn table2_of_a_generated_cap_lists_every_method_and_phase() {
    let (_, csv, text) = of_cap("wrapd-table2");
    assert_eq!(csv.lines().count(), 1 + 12 * 3, "{csv}");
    let of = |method: &str, level: &str| iterations(&csv, "cap", method, level);
    for method in ["auto", "wrapd", "wrapd+cm", "cm", "slim", "akvf", "bcqn", "projected-newton", "newton"] {
        let (early, late) = (of(method, "early"), of(method, "late"));
        assert!(early.is_some() && early <= late, "{method}: {early:?}, {late:?}");
    }
    assert!(of("auto", "late") <= of("slim", "late") && of("auto", "late") <= Some(20), "{csv}");
    assert!(text.contains("a generated cap of a sphere") && !text.contains("do not agree"), "{text}");
    assert!(text.contains("`auto` against the fastest other method"), "{text}");
}

#[test]
fn table3_of_a_generated_cap_subdivides_it() {
    let (out, csv, text) = of_cap("wrapd-table3");
    for problem in ["cap of 1536 triangles", "cap of 6144 triangles"] {
        for method in ["auto", "wrapd", "wrapd+cm", "cm"] {
            assert!(iterations(&csv, problem, method, "early").is_some(), "{problem}: {method}: {csv}");
        }
    }
    assert!(text.contains("auto n^") && text.contains("| 6376 |"), "{text}");
    assert!(read(&out, "wrapd-table3.svg").contains("triangles"));
}

#[test]
fn figures_of_a_generated_cap_have_plots_and_pictures() {
    for (name, rows) in [("wrapd-figure3", 2), ("wrapd-figure5", 4), ("wrapd-figure11", 7)] {
        let (out, csv, text) = of_cap(name);
        assert_eq!(csv.lines().count(), 1 + 3 * rows, "{name}: {csv}");
        let plot = read(&out, &format!("{name}-cap.svg"));
        assert!(plot.contains("energy error"), "{name}");
        if name == "wrapd-figure3" {
            assert!(plot.contains("inner steps"), "{name}");
            continue;
        }
        for what in ["map", "surface"] {
            let file = format!("{name}-cap-{what}.png");
            assert!(text.contains(&file), "{text}");
            assert!(std::fs::read(out.join(&file)).expect("a picture").starts_with(b"\x89PNG"), "{file}");
        }
    }
}

#[test]
fn random_disks_end_flip_free_and_converged() {
    let out = folder("unwrap-robustness");
    let options = Options { out: out.clone(), quick: true, count: Some(20), ..Options::default() };
    run("unwrap-robustness", &options, &mut |_| ()).expect("robustness");
    let text = read(&out, "unwrap-robustness.md");
    assert!(text.contains("20 of 20 disks"), "{text}");
    let csv = read(&out, "unwrap-robustness.csv");
    assert_eq!(csv.lines().filter(|l| l.contains(",auto,flip-free and converged,") && !l.ends_with(",,")).count(), 20);
}

#[test]
fn figure9_counts_surfaces_by_their_time_a_vertex() {
    let out = folder("wrapd-figure9");
    let options = Options {
        out: out.clone(),
        quick: true,
        models: vec!["cap".into()],
        count: Some(3),
        max_iters: Some(60),
        ..Options::default()
    };
    run("wrapd-figure9", &options, &mut |_| ()).expect("figure 9");
    let text = read(&out, "wrapd-figure9.md");
    assert!(text.contains("4 surfaces") && text.contains("| auto |"), "{text}");
    assert!(read(&out, "wrapd-figure9.svg").contains("seconds a vertex"));
}

#[test]
fn the_bars_of_aa_admm_and_their_rates() {
    let out = folder("aa");
    let options = Options { out: out.clone(), quick: true, ..Options::default() };
    run("aa-figure2", &options, &mut |_| ()).expect("figure 2");
    let csv = read(&out, "aa-figure2.csv");
    assert!(csv.starts_with("problem,method,level,iterations,seconds,rejected,residual\n"), "{csv}");
    let forward = |method: &str, level: &str| {
        let start = format!("soft-rubber,{method},{level},");
        let row = csv.lines().find(|l| l.starts_with(&start) && l.ends_with(",forward")).expect("a row");
        row[start.len()..].split(',').next().and_then(|n| n.parse::<usize>().ok())
    };
    let plain = forward("admm", "1e-6").expect("reached");
    for method in ["aa-admm-1 m=6", "aa-admm-2 m=6", "aa-admm-3 m=6", "aa-admm-4 m=6"] {
        let accelerated = forward(method, "1e-6").expect("reached");
        assert!(2 * accelerated < plain, "{method}: {accelerated} against {plain}");
        assert!(forward(method, "1e-10").is_some(), "{method}");
    }
    assert!(read(&out, "aa-figure2-soft-rubber.svg").contains("normalised forward residual"));
    run("aa-figure3", &options, &mut |_| ()).expect("figure 3");
    assert!(read(&out, "aa-figure3.csv").contains("soft-rubber,over-relaxation 1.6,1e-6,"));
    run("aa-linear-rate", &options, &mut |_| ()).expect("rates that are not above the proven ones");
    let text = read(&out, "aa-linear-rate.md");
    assert!(text.contains("rho(K)") && text.matches("| z-x-u |").count() == 3, "{text}");
}

#[test]
fn the_nearest_integrable_field() {
    let out = folder("aa-figure12");
    let options = Options { out: out.clone(), quick: true, ..Options::default() };
    run("aa-figure12", &options, &mut |_| ()).expect("figure 12");
    let csv = read(&out, "aa-figure12.csv");
    let reached = |method: &str| {
        let start = format!("ball,{method},1e-5,");
        let row = csv.lines().find(|l| l.starts_with(&start) && l.ends_with(",combined")).expect("a row");
        row[start.len()..].split(',').next().and_then(|n| n.parse::<usize>().ok()).expect("reached")
    };
    for form in ["", "edges "] {
        let (plain, accelerated) = (reached(&format!("{form}admm")), reached(&format!("{form}aa-admm-2 m=6")));
        assert!(3 * accelerated < 2 * plain, "{form}: {accelerated} against {plain}");
    }
    assert!(out.join("aa-figure12-ball.png").exists() && read(&out, "aa-figure12.md").contains("| ball |"));
}

#[test]
fn a_wavefront_on_z_alone_and_by_gmres() {
    let out = folder("aa-figure11");
    let options = Options { out: out.clone(), quick: true, max_iters: Some(1000), ..Options::default() };
    run("aa-figure11", &options, &mut |_| ()).expect("figure 11");
    let csv = read(&out, "aa-figure11.csv");
    let reached = |method: &str| {
        let start = format!("speckle,{method},1e-4,");
        let row = csv.lines().find(|l| l.starts_with(&start) && l.ends_with(",combined")).expect("a row");
        row[start.len()..].split(',').next().and_then(|n| n.parse::<usize>().ok()).expect("reached")
    };
    let (plain, alone, gmres) = (reached("admm"), reached("aa z m=6"), reached("gmres(10)"));
    assert!(5 * alone <= 4 * plain && 5 * gmres <= 4 * plain, "{alone} and {gmres} of {plain}");
    assert!(read(&out, "aa-figure11.md").contains("| gmres(10) |"));
}

#[test]
fn a_deconvolution_in_every_variable() {
    let out = folder("aa-figure10");
    let options = Options { out: out.clone(), quick: true, max_iters: Some(400), ..Options::default() };
    run("aa-figure10", &options, &mut |_| ()).expect("figure 10");
    let csv = read(&out, "aa-figure10.csv");
    let reached = |method: &str| {
        let start = format!("chart,{method},1e-4,");
        let row = csv.lines().find(|l| l.starts_with(&start) && l.ends_with(",combined")).expect("a row");
        row[start.len()..].split(',').next().and_then(|n| n.parse::<usize>().ok()).expect("reached")
    };
    // Over-relaxation takes off a third of the iterations where the x-update is exact; splitting both terms adds to them.
    let (plain, relaxed, both) = (reached("v, admm"), reached("v, relaxed 1.8"), reached("both split, aa m=6"));
    assert!(4 * relaxed < 3 * plain && relaxed < both, "{relaxed} of {plain}, {both}");
    assert!(read(&out, "aa-figure10.md").contains("| (z, u), aa m=6 |"));
}

#[test]
fn automatic_deconvolution_beside_the_best() {
    let out = folder("imaging-quality");
    let options = Options { out: out.clone(), quick: true, ..Options::default() };
    run("imaging-quality", &options, &mut |_| ()).expect("a comparison");
    let csv = read(&out, "imaging-quality.csv");
    let row = csv.lines().find(|l| l.starts_with("chart,")).expect("a row");
    let numbers: Vec<f64> = row.split(',').filter_map(|v| v.parse().ok()).collect();
    let [noise, _, seen, auto, best, _, wiener, laplacian] = numbers[numbers.len() - 8..] else { panic!("{row}") };
    assert!((noise - 0.01).abs() < 0.004, "{row}");
    assert!(auto > seen + 3.0 && auto > best - 1.0 && best >= auto, "{row}");
    // The weight of the Laplacian knows that an image has less of what is finer.
    assert!(auto > laplacian && laplacian > wiener && wiener > seen, "{row}");
    assert!(read(&out, "imaging-quality.md").contains("| chart "));
}
