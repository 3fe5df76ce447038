//! Whole runs of `proxel deform`: what they write, how they end.

mod common;
use common::Folder;

const SOLVE: &str = "deform rest.node --init init.node --pins pins.txt --out out.node --threads 1";

fn report(folder: &Folder) -> serde_json::Value {
    serde_json::from_str(&folder.read("r.json")).unwrap()
}

/// The coordinates of a .node file.
fn nodes(folder: &Folder, name: &str) -> Vec<Vec<f64>> {
    let text = folder.read(name);
    text.lines().skip(1).map(|l| l.split_whitespace().skip(1).map(|w| w.parse().unwrap()).collect()).collect()
}

#[test]
fn a_stretched_beam_goes_back_and_says_so() {
    let folder = Folder::new("back");
    folder.beam(3);
    let run = folder.run(&format!("{SOLVE} --report r.json --trace t.csv"));
    run.is(0);
    assert!(run.out.starts_with("converged after ") && run.out.contains("wrote out.node, t.csv, r.json"), "{run:?}");
    assert_eq!(run.err, "");
    let (rest, result) = (nodes(&folder, "rest.node"), nodes(&folder, "out.node"));
    for (p, q) in rest.iter().zip(&result) {
        assert!((0..3).all(|c| (p[c] - q[c]).abs() < 1e-7), "{p:?} is not {q:?}");
    }
    assert_eq!(rest[..4], result[..4], "pins are exact");
    assert_eq!(
        folder.names(),
        ["init.node", "out.ele", "out.node", "pins.txt", "r.json", "rest.ele", "rest.node", "t.csv"]
    );
}

#[test]
fn the_report_has_every_key() {
    let folder = Folder::new("report");
    folder.beam(2).write("pins.txt", "0 1 2 3 3\n");
    folder.run(&format!("{SOLVE} --report r.json --reference rest.node")).is(0);
    let r = report(&folder);
    let keys = "version command settings method status reason iterations inner_iterations refactorisations energy \
                gradient_norm gradient_ratio inverted min_stretch max_stretch position_error primal_residual \
                dual_residual accepted rejected warnings repaired seconds peak_bytes factor_bytes threads reactions";
    for key in keys.split_whitespace() {
        assert!(r.get(key).is_some(), "{key} is missing");
    }
    for key in ["read", "setup", "solve", "write"] {
        assert!(r["seconds"][key].as_f64().unwrap() >= 0.0);
    }
    assert_eq!((r["status"].as_str(), r["command"].as_str()), (Some("converged"), Some("deform")));
    assert_eq!(r["settings"]["tol"].as_f64(), Some(1e-9));
    assert!(r["gradient_ratio"].as_f64().unwrap() <= 1e-9 * 1.01);
    assert!(r["position_error"].as_f64().unwrap() < 1e-6);
    assert_eq!(r["warnings"].as_array().unwrap().len(), 1);
    assert!(r["warnings"][0].as_str().unwrap().contains("1 duplicate pin"));
    #[cfg(target_os = "linux")]
    assert!(r["peak_bytes"].as_u64().unwrap() > 1 << 20);
}

#[test]
fn the_trace_has_a_row_an_iteration() {
    let folder = Folder::new("trace");
    folder.beam(2);
    folder.run(&format!("{SOLVE} --report r.json --trace t.csv --max-iters 7 --tol 1e-14")).is(3);
    let text = folder.read("t.csv");
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "iteration,seconds,energy,gradient_norm,position_error,primal_residual,dual_residual,merit,inner,refactorised,accepted,inverted"
    );
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|w| w.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 8);
    for (k, row) in rows.iter().enumerate() {
        assert_eq!((row.len(), row[0]), (12, k as f64));
        assert!(!row.iter().any(|x| x.is_nan()));
    }
    assert!(rows.windows(2).all(|w| w[0][1] <= w[1][1]), "seconds ascend");
    assert!(rows[0][4].is_infinite(), "no reference, no error");
    let r = report(&folder);
    assert_eq!((r["iterations"].as_u64(), r["status"].as_str()), (Some(7), Some("stopped")));
}

#[test]
fn groups_need_no_start() {
    let folder = Folder::new("groups");
    folder.beam(3).write(
        "pins.toml",
        "[groups.left]\nplane = { point = [0, 0, 0], normal = [-1, 0, 0] }\n\
         [groups.right]\nplane = { point = [3, 0, 0], normal = [1, 0, 0] }\ntranslate = [0.5, 0, 0]\n\
         rotate = { axis = [1, 0, 0], angle = 90 }\n",
    );
    folder.run("deform rest.node --pins pins.toml --out out.vtu --preview p.png --material stable-neo-hookean").is(0);
    let text = String::from_utf8_lossy(&std::fs::read(folder.0.join("out.vtu")).unwrap()).into_owned();
    for name in ["stretches", "energy_density", "von_mises_stress", "reaction_force"] {
        assert!(text.contains(name), "{name} is not in out.vtu");
    }
    assert!(std::fs::read(folder.0.join("p.png")).unwrap().starts_with(b"\x89PNG\r\n"));
}

#[test]
fn what_is_odd_is_solved_with_a_warning() {
    let folder = Folder::new("odd");
    folder.beam(2);
    let run = folder.run("deform rest.node --init init.node --out out.node");
    run.is(0);
    assert!(run.err.contains("warning: ") && run.err.contains("anchored"), "{run:?}");
    // An inverted start is no bad input.
    let text = folder.read("init.node");
    let mirrored: Vec<String> = text.lines().map(|l| l.replace(" 2 ", " -2 ").replace(" 4 ", " -4 ")).collect();
    folder.write("init.node", &mirrored.join("\n"));
    let run = folder.run(&format!("{SOLVE} --max-iters 50"));
    assert!(run.status == Some(0) || run.status == Some(3), "{run:?}");
}

#[test]
fn orientation_is_fixed_where_asked() {
    let folder = Folder::new("fix");
    folder.beam(2);
    folder.turn_first();
    folder.run(SOLVE).is_refused(&["tetrahedron 0", "--fix-orientation"]);
    let run = folder.run(&format!("{SOLVE} --fix-orientation --report r.json"));
    run.is(0);
    assert_eq!(report(&folder)["repaired"].as_array().unwrap().len(), 1);
    assert!(run.err.contains("repaired: "), "{run:?}");
    folder.run("info out.node").is(0);
}

#[test]
fn settings_are_shown_with_defaults_and_nothing_is_solved() {
    let folder = Folder::new("settings");
    let run = folder.run("deform --show-settings --method r-admm --mu 2 --gravity -1,0,0 --base-weight geometric-mean");
    run.is(0);
    let s: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!((s["method"].as_str(), s["material"]["mu"].as_f64()), (Some("r-admm"), Some(2.0)));
    assert_eq!(
        (s["max_iters"].as_u64(), s["tol"].as_f64(), s["gravity"][0].as_f64()),
        (Some(5000), Some(1e-9), Some(-1.0))
    );
    assert_eq!(s["admm"]["window"].as_u64(), Some(6));
    assert_eq!(s["admm"]["base_weight"].as_str(), Some("geometric-mean"));
    folder.run("deform --show-settings --poisson 0.5").is_refused(&["--poisson"]);
    assert_eq!(folder.names(), [""; 0]);
}

#[test]
fn quiet_is_quiet() {
    let folder = Folder::new("quiet");
    let run = folder.beam(2).run(&format!("{SOLVE} --quiet"));
    assert_eq!((run.is(0).out.as_str(), run.err.as_str()), ("", ""));
}

#[test]
fn a_time_limit_leaves_the_best_result() {
    let folder = Folder::new("time");
    folder.beam(40);
    folder.run(&format!("{SOLVE} --time-limit 0 --report r.json")).is(3);
    let r = report(&folder);
    assert_eq!(r["status"].as_str(), Some("stopped"));
    assert!(r["reason"].as_str().unwrap().contains("--time-limit"));
    assert_eq!(nodes(&folder, "out.node").len(), 164);
}

/// A run that does not end by itself for hours: weights that allow tiny steps only.
#[cfg(unix)]
const ENDLESS: &str = "deform rest.node --init init.node --pins pins.txt --out out.node --report r.json --trace t.csv \
                       --tol 1e-300 --max-iters 1000000000 --method admm-pd --weight-scale 1e5";

#[cfg(unix)]
fn started(folder: &Folder) -> std::process::Child {
    let child =
        folder.command(ENDLESS).stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::piped()).spawn();
    std::thread::sleep(std::time::Duration::from_millis(2000));
    child.unwrap()
}

#[cfg(unix)]
fn signal(child: &std::process::Child, name: &str) {
    let sent = std::process::Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_the_best_result() {
    let folder = Folder::new("interrupt");
    folder.beam(100);
    let child = started(&folder);
    signal(&child, "-INT");
    let run = common::Run::of(child.wait_with_output().unwrap());
    run.is(130);
    let r = report(&folder);
    assert_eq!(r["status"].as_str(), Some("cancelled"));
    assert_eq!(nodes(&folder, "out.node").len(), 404);
    let rows = folder.read("t.csv").lines().count() as u64 - 1;
    assert_eq!(rows, r["iterations"].as_u64().unwrap() + 1);
}

#[cfg(unix)]
#[test]
fn a_killed_process_leaves_no_half_file() {
    let folder = Folder::new("kill");
    folder.beam(100);
    let before = folder.names();
    let mut child = started(&folder);
    signal(&child, "-KILL");
    assert_eq!(child.wait().unwrap().code(), None);
    assert_eq!(folder.names(), before);
}

#[test]
fn a_sheet_with_limits_hangs_within_them_and_reports_what_its_corners_carry() {
    let folder = Folder::new("sheet");
    // 6 x 6 squares of 0.1, in the plane z = 0.
    let mut obj = String::new();
    for v in 0..49 {
        obj += &format!("v {} {} 0\n", 0.1 * f64::from(v % 7), 0.1 * f64::from(v / 7));
    }
    for c in 0..36 {
        let a = c % 6 + 7 * (c / 6) + 1;
        obj += &format!("f {a} {} {}\nf {a} {} {}\n", a + 1, a + 8, a + 8, a + 7);
    }
    folder.write("cloth.obj", &obj);
    folder.write(
        "p.toml",
        "[groups.left]\nindices = [0, 42]\n[groups.right]\nindices = [6, 48]\ntranslate = [-0.05, 0, 0]\n",
    );
    let words = "deform cloth.obj --pins p.toml --material arap --young 100 --poisson 0 --bending 1e-4 \
                 --strain-limit 0.95,1.05 --density 0.2 --gravity 0,0,-9.81 --out out.vtu --report r.json";
    for method in ["wrapd", "r-admm"] {
        folder.run(&format!("{words} --method {method}")).is(0);
        let r = report(&folder);
        let stretch = |key: &str| r[key].as_f64().unwrap();
        assert!(stretch("min_stretch") >= 0.95 - 1e-6 && stretch("max_stretch") <= 1.05 + 1e-6, "{r}");
        assert!(r["gradient_norm"].is_null() && r["primal_residual"].as_f64().unwrap() <= 1e-9, "{r}");
        let down = |group: &str| r["reactions"][group][2].as_f64().unwrap();
        let weight = 0.36 * 0.2 * 9.81;
        assert!((down("left") + down("right") + weight).abs() < 1e-6 * weight, "{r}");
        assert!((down("left") - down("right")).abs() < 0.1 * weight, "{r}");
    }
}
