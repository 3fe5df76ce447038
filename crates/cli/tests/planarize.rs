//! `proxel planarize`: files in, files out, refusals.

mod common;
use common::Folder;

/// A grid of 6 x 6 wavy quads as OBJ.
fn roof(folder: &Folder) {
    let mut text = String::new();
    for i in 0..7 {
        for j in 0..7 {
            let (x, y) = (f64::from(i), f64::from(j));
            text += &format!("v {x} {y} {}\n", (0.7 * x).sin() * (0.5 * y).cos() + 0.1 * x * y / 6.0);
        }
    }
    for i in 0..6 {
        for j in 0..6 {
            let v = 7 * i + j + 1;
            text += &format!("f {} {} {} {}\n", v, v + 7, v + 8, v + 1);
        }
    }
    folder.put("roof.obj", &text);
}

#[test]
fn a_roof_becomes_planar() {
    let folder = Folder::new("planarize");
    roof(&folder);
    let run = folder.run("planarize roof.obj --out flat.obj --report r.json --trace t.csv --preview p.png");
    let out = run.is(0).out.clone();
    assert!(out.contains("converged after") && out.contains("planarity max"), "{out}");
    let report: serde_json::Value = serde_json::from_str(&folder.read("r.json")).expect("a report is JSON");
    assert!(report["planarity_max"]["before"].as_f64().is_some_and(|v| v > 1e-2), "{report}");
    assert!(report["planarity_max"]["after"].as_f64().is_some_and(|v| v <= 1e-10), "{report}");
    assert_eq!(report["violated"].as_array().map(Vec::len), Some(0));
    assert!(report["edge_error_max"].is_null() && report["status"] == "converged" && report["command"] == "planarize");
    let rows = folder.read("t.csv").lines().count();
    assert_eq!(
        rows as u64,
        report["iterations"].as_u64().map_or(0, |n| n + 2),
        "a header, the start, a row an iteration"
    );
    // Faces as they were, and numbers that read back to the same bits: what is planar stays, and is written alike.
    let faces =
        |name: &str| folder.read(name).lines().filter(|l| l.starts_with('f')).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(faces("roof.obj"), faces("flat.obj"));
    folder.run("convert flat.obj --out again.obj").is(0);
    let points =
        |name: &str| folder.read(name).lines().filter(|l| l.starts_with("v ")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(points("flat.obj"), points("again.obj"));
    // Attributes.
    folder.run("planarize roof.obj --reference roof.obj --out flat.ply --quiet --method aa-admm --max-iters 20").is(3);
    let ply = String::from_utf8_lossy(&std::fs::read(folder.0.join("flat.ply")).expect("a PLY file")).into_owned();
    assert!(ply.contains("planarity") && ply.contains("reference_distance"), "attributes are in the header");
}

#[test]
fn settings_are_shown_and_bad_input_is_refused() {
    let folder = Folder::new("planarize-bad");
    let run = folder.run("planarize --show-settings --mu 10 --anderson 3");
    let settings: serde_json::Value = serde_json::from_str(&run.is(0).out).expect("settings are JSON");
    assert!(settings["mu"] == 10.0 && settings["anderson"] == 3 && settings["method"] == "auto", "{settings}");
    roof(&folder);
    folder.run("planarize roof.obj --out flat.obj --mu 0").is_refused(&["--mu is 0"]);
    folder.run("planarize none.obj --out flat.obj").is_refused(&["none.obj", "no such file"]);
    folder.put("twice.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nf 1 2 3 2\n");
    folder.run("planarize twice.obj --out flat.obj").is_refused(&["twice.obj", "face 0"]);
    folder.put("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    folder
        .run("planarize roof.obj --reference line.obj --out flat.obj")
        .is_refused(&["line.obj", "no face of it has an area"]);
    assert!(!folder.has("flat.obj"));
}
