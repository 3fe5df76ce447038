//! `proxel wire` and `proxel shape`: files in, files out, refusals.

mod common;
use common::Folder;

/// A grid of 6 x 6 wavy quads as OBJ.
fn roof(folder: &Folder) {
    let mut text = String::new();
    for i in 0..7 {
        for j in 0..7 {
            let (x, y) = (f64::from(i), f64::from(j));
            text += &format!("v {x} {y} {}\n", 0.3 * (0.7 * x).sin() * (0.5 * y).cos());
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
fn wires_are_woven() {
    let folder = Folder::new("wire");
    roof(&folder);
    let words =
        "wire roof.obj --subdivide --min-angle 60 --max-angle 120 --out net.ply --report r.json --preview p.png";
    let out = folder.run(words).is(0).out.clone();
    assert!(out.contains("converged after") && out.contains("edge error max"), "{out}");
    let report: serde_json::Value = serde_json::from_str(&folder.read("r.json")).expect("a report is JSON");
    assert!(report["edge_error_max"]["after"].as_f64().is_some_and(|v| v <= 1e-9), "{report}");
    assert!(report["angle_error_max"]["after"].as_f64().is_some_and(|v| v <= 1e-7), "{report}");
    assert!(
        report["command"] == "wire" && report["method"] == "auto" && report["settings"]["subdivide"] == 1,
        "{report}"
    );
    assert!(report["planarity_max"].is_null() && folder.has("p.png"));
    let ply = String::from_utf8_lossy(&std::fs::read(folder.0.join("net.ply")).expect("a PLY file")).into_owned();
    assert!(["edge_error", "angle_error", "reference_distance"].iter().all(|name| ply.contains(name)));
    assert!(ply.contains("element vertex 169") && ply.contains("element face 144"), "7^2 + 2*6*7 + 36, 4*36");
    // Settings, refusals.
    let shown = folder.run("wire --show-settings --edge-length 2").is(0).out.clone();
    let settings: serde_json::Value = serde_json::from_str(&shown).expect("settings are JSON");
    assert!(settings["edge_length"] == 2.0 && settings["min_angle"] == 45.0 && settings["mu"] == 1000.0, "{settings}");
    let shown = folder.run("wire --show-settings --method aa-admm").is(0).out.clone();
    let settings: serde_json::Value = serde_json::from_str(&shown).expect("settings are JSON");
    assert!(settings["mu"] == 3000.0, "{settings}");
    folder.run("wire roof.obj --out no.obj --edge-length=-1").is_refused(&["--edge-length is -1"]);
    folder.run("wire roof.obj --out no.obj --min-angle 100 --max-angle 90").is_refused(&["--min-angle is 100"]);
    folder.run("wire roof.obj --out no.obj --subdivide 9").is_refused(&["--subdivide is 9"]);
    assert!(!folder.has("no.obj"));
}

#[test]
fn recipes_are_followed() {
    let folder = Folder::new("shape");
    roof(&folder);
    let near = "[[constraint]]\nkind = \"near\"\nto = \"roof.obj\"\nweight = 1\n[[constraint]]\nkind = \"relative-laplacian\"\nweight = 0.1\n";
    let flat = format!("mesh = \"roof.obj\"\n[[constraint]]\nkind = \"planar\"\nname = \"panels\"\n{near}");
    folder.put("flat.toml", &flat);
    let out =
        folder.run("shape flat.toml --out flat.vtu --report r.json --trace t.csv --preview p.png").is(0).out.clone();
    assert!(out.contains("panels (hard, 36 elements)"), "{out}");
    let report: serde_json::Value = serde_json::from_str(&folder.read("r.json")).expect("a report is JSON");
    let first = &report["constraints"][0];
    assert!(first["name"] == "panels" && first["kind"] == "planar" && first["hard"] == true, "{report}");
    assert!(first["violation_max"]["before"].as_f64().is_some_and(|v| v > 1e-3), "{report}");
    assert!(first["violation_max"]["after"].as_f64().is_some_and(|v| v < 1e-9), "{report}");
    assert!(report["command"] == "shape");
    let vtu = String::from_utf8_lossy(&std::fs::read(folder.0.join("flat.vtu")).expect("a VTU file")).into_owned();
    assert!(vtu.contains("violation") && vtu.contains("reference_distance"));
    // The command line goes before the recipe; what contradicts itself stops, and is written.
    let shown = folder.run("shape flat.toml --show-settings --method admm --mu 7").is(0).out.clone();
    let settings: serde_json::Value = serde_json::from_str(&shown).expect("settings are JSON");
    assert!(settings["method"] == "admm" && settings["mu"] == 7.0 && settings["recipe"]["stay"] == 1e-3, "{settings}");
    let up = "[[constraint]]\nkind = \"at\"\nvertices = [0]\npoints = [[0, 0, 1]]\n";
    folder.put("both.toml", &format!("{flat}{up}[[constraint]]\nkind = \"fixed\"\nvertices = [0]\n"));
    let both = folder.run("shape both.toml --out both.obj --report b.json");
    both.is(3);
    assert!(both.err.contains("fixed 4") && folder.has("both.obj"), "{}", both.err);
    // Refusals, with the file and the place in it.
    folder.run("shape none.toml --out no.obj").is_refused(&["none.toml", "no such file"]);
    folder.put("bad.toml", "mesh = \"roof.obj\"\n[[constraint]]\nkind = \"planar\"\nfaces = [99]\n");
    folder.run("shape bad.toml --out no.obj").is_refused(&["bad.toml: constraint 0 (planar): face 99 is out of range"]);
    folder.put("key.toml", "mesh = \"roof.obj\"\n[[constraint]]\nkind = \"planar\"\nfacess = [1]\n");
    folder.run("shape key.toml --out no.obj").is_refused(&["key.toml: line 4", "did you mean `faces`?"]);
    assert!(!folder.has("no.obj"));
    let schema = folder.run("schema recipe").is(0).out.clone();
    assert!(schema.contains("relative-laplacian") && schema.contains("one-sided"), "the schema has kinds and keys");
}
