//! `proxel unwrap` from files to files. What maps are worth is measured by the tests' own reader.

mod common;

use common::Folder;
use common::maps::{close, folder, mapped, maps, report, unwrap};
use common::surface::{Mapped, Surface};
use serde_json::Value;

/// What the report says was repaired.
fn repaired(r: &Value) -> Vec<&str> {
    r["repaired"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect()
}

/// One repair was made, and its text has these parts.
#[track_caller]
fn repaired_one(r: &Value, parts: &[&str]) {
    let repaired = repaired(r);
    assert_eq!(repaired.len(), 1, "{repaired:?}");
    assert!(parts.iter().all(|p| repaired[0].contains(p)), "{repaired:?}");
}

/// Side of the patches below, in cells: faces 780 to 785 are well inside, as vertices 500 and 501.
const N: usize = 40;

#[test]
fn a_clean_patch() {
    let folder = folder("clean", &Surface::patch(N));
    let (r, map) = maps(&folder, "");
    assert_eq!(repaired(&r), Vec::<&str>::new());
    assert_eq!((&r["charts"], &r["seam_length"], &r["reversed_faces"]), (&1.into(), &0.0.into(), &0.into()));
    // The packed map has another scale; the energy is that at the best one.
    let (r, free) = maps(&folder, "--no-pack");
    close(r["energy"].as_f64().unwrap(), free.energy(), 1e-12);
    assert!(free.energy() > 1.0 && free.energy() < 1.01, "{}", free.energy());
    assert!(map.uv.iter().flatten().all(|v| (0.0..=1.0).contains(v)), "packed into the unit square");
    assert_eq!(map.faces.len(), 2 * N * N);
}

#[test]
fn surfaces_that_need_repair_are_mapped_and_the_report_says_what_was_done() {
    let (r, map) = maps(&folder("sphere", &Surface::sphere(24)), "");
    repaired_one(&r, &["1 part", "no boundary", "cut open"]);
    assert_eq!(r["charts"], 1);
    let cut = map.places().values().filter(|p| p.len() > 1).count();
    assert!(cut > 0 && r["seam_length"].as_f64().unwrap() > 0.0, "{cut} vertices on seams");

    let mut lone = Surface::patch(N);
    lone.points.push([5.0, 5.0, 5.0]);
    let (r, map) = maps(&folder("unreferenced", &lone), "");
    assert!(r["warnings"][0].as_str().unwrap().contains("1681"), "{r}");
    assert_eq!(map.points[1681], [5.0; 3], "it stays in the file");

    let mut merged = Surface::patch(N);
    merged.points[500] = merged.points[501];
    let (r, map) = maps(&folder("zero-area", &merged), "--no-pack");
    repaired_one(&r, &["2 triangles have no area"]);
    assert_eq!(map.faces.len(), 2 * N * N);

    let mut twice = Surface::patch(N);
    twice.faces.push(twice.faces[0].clone());
    let (r, map) = maps(&folder("duplicate", &twice), "");
    repaired_one(&r, &["face 3200", "repeats an earlier face"]);
    assert_eq!(map.faces[3200], map.faces[0], "with the same place");

    // Three faces at an edge within the surface, and an edge of the border where one stands against the others.
    let mut fin = Surface::patch(N);
    let inner = [N / 2 * (N + 1) + N / 2, N / 2 * (N + 1) + N / 2 + 1].map(|v| v as i64);
    fin.points.push([0.0, 0.0, 3.0]);
    fin.faces.push(vec![inner[0], inner[1], 1681]);
    let (r, _) = maps(&folder("non-manifold", &fin), "");
    repaired_one(&r, &["1 edge is joined by three faces", &format!("{} {}", inner[0], inner[1])]);
    let mut flap = Surface::patch(N);
    flap.points.push([0.0, 0.0, 3.0]);
    flap.faces.push(vec![flap.faces[1600][0], flap.faces[1600][1], 1681]);
    let (r, _) = maps(&folder("flap", &flap), "");
    repaired_one(&r, &["face 3200", "turned around"]);

    let mut reversed = Surface::patch(N);
    reversed.faces[800].reverse();
    let f = folder("reversed", &reversed);
    let (r, map) = maps(&f, "--no-pack");
    repaired_one(&r, &["face 800", "turned around"]);
    assert_eq!(r["reversed_faces"], 1);
    // As listed it is clockwise, all others are counter-clockwise.
    let turned: Vec<usize> =
        map.energies().iter().enumerate().filter(|(_, (_, e))| e.is_infinite()).map(|(f, _)| f).collect();
    assert_eq!(turned, [800]);

    let half = Surface::patch(20);
    let two = half.clone().with(&half.moved(1.0, [5.0, 0.0, 0.0]));
    let (r, _) = maps(&folder("two", &two), "");
    assert_eq!((&r["charts"], repaired(&r).len()), (&2.into(), 0));

    let mut hole = Surface::patch(N);
    hole.faces.drain(780..786);
    let (r, map) = maps(&folder("hole", &hole), "");
    assert_eq!((&r["charts"], repaired(&r).len(), map.faces.len()), (&1.into(), 0, 2 * N * N - 6));

    let (r, map) = maps(&folder("moebius", &Surface::moebius(40)), "");
    let what = repaired(&r);
    assert!(what[0].contains("one-sided") && what[0].contains("cut along"), "{what:?}");
    // A cut across has the three vertices of a column, and each of them two places.
    let cut: Vec<usize> = map.places().iter().filter(|(_, p)| p.len() > 1).map(|(v, _)| *v).collect();
    assert!(cut.len() >= 3, "{cut:?}");
}

#[test]
fn what_cannot_be_mapped_is_refused_in_one_line() {
    let mut nan = Surface::patch(N);
    nan.points[500] = [f64::NAN; 3];
    let mut beyond = Surface::patch(N);
    beyond.faces[3][0] = 1_000_000;
    let mut negative = Surface::patch(N);
    negative.faces[3][0] = -1_000_000;
    for (name, surface, parts) in [
        ("nan", nan, &["in.obj", "line 501", "vertex 500", "not finite"][..]),
        ("beyond", beyond, &["in.obj", "face 3", "1000001 is out of range", "correct the index"]),
        ("negative", negative, &["in.obj", "face 3", "-1000000", "correct the index"]),
        ("empty", Surface::default(), &["in.obj", "no vertices"]),
    ] {
        let folder = folder(name, &surface);
        unwrap(&folder, "--trace t.csv").is_refused(parts);
        assert_eq!(folder.names(), ["in.obj"], "{name}");
    }
}

#[test]
fn a_negative_index_that_resolves_is_legal() {
    let folder = Folder::new("unwrap-relative");
    folder.put("in.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.2\nf -4 -3 -2\nf -4 -2 -1\n");
    unwrap(&folder, "--no-pack").is(0);
    assert_eq!(report(&folder)["repaired"].as_array().unwrap().len(), 0);
    assert_eq!(folder.read("out.obj").lines().filter(|l| l.starts_with("vt ")).count(), 4);
}

#[test]
fn neither_units_nor_the_origin_matter() {
    let patch = Surface::patch(N);
    let map = |name: &str, scale: f64, offset: [f64; 3]| {
        let (_, map) = maps(&folder(name, &patch.moved(scale, offset)), "--no-pack");
        map.uv.iter().map(|p| p.map(|x| x / scale)).collect::<Vec<_>>()
    };
    let plain = map("plain", 1.0, [0.0; 3]);
    let size = maps(&folder("size", &patch), "--no-pack").1.size();
    for (name, scale, offset, tolerance) in
        [("small", 1e-6, [0.0; 3], 1e-9), ("large", 1e8, [0.0; 3], 1e-9), ("far", 1.0, [1e6; 3], 1e-7)]
    {
        let other = map(name, scale, offset);
        assert_eq!(other.len(), plain.len());
        let difference = plain.iter().zip(&other).flat_map(|(a, b)| [a[0] - b[0], a[1] - b[1]]);
        let worst = difference.fold(0.0, |m: f64, d| m.max(d.abs())) / size;
        assert!(worst <= tolerance, "{name}: {worst:e} of the size");
    }
}

#[test]
fn one_triangle_and_many_components() {
    let triangle = Surface { points: vec![[0.0; 3], [3.0, 0.0, 0.0], [0.0, 0.0, 1.0]], faces: vec![vec![0, 1, 2]] };
    let (r, map) = maps(&folder("triangle", &triangle), "--no-pack");
    close(map.energy(), 1.0, 1e-12);
    assert_eq!((map.uv.len(), &r["charts"]), (3, &1.into()));

    let piece = Surface::patch(3);
    let all = (1..44).fold(piece.clone(), |all, k| all.with(&piece.moved(1.0, [3.0 * k as f64, 0.0, 0.0])));
    let (r, map) = maps(&folder("components", &all), "");
    assert_eq!(r["charts"], 44);
    assert_eq!(map.uv.len(), all.points.len(), "no seam within a component");
    // Equal pieces get equal texel density: the same edge has the same length in each.
    let n = piece.points.len();
    let place = map.places();
    let edge = |k: usize| {
        let (a, b) = (place[&(n * k)][0], place[&(n * k + n - 1)][0]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    for k in 1..44 {
        close(edge(k), edge(0), 1e-9);
    }
}

#[test]
fn polygons_stay_polygons() {
    let quads = Surface::quads(12);
    let (_, map) = maps(&folder("quads", &quads), "--no-pack");
    let vertices = |f: &Vec<(usize, usize)>| f.iter().map(|c| c.0 as i64).collect::<Vec<_>>();
    assert_eq!(map.faces.iter().map(vertices).collect::<Vec<_>>(), quads.faces);
    assert_eq!(map.uv.len(), quads.points.len());
}

#[test]
fn objects_materials_and_all_other_lines_stay_as_they_are() {
    let text = "# a thing\nmtllib some.mtl\nv 0 0 0 1 0.5 0\nv 1.0 0 0\nv 1 1.00 0\nv  0 1 3e-1\nv 2 0 0\nv 2 1 0.1\n\
                vn 0 0 1\nvt 0.5 0.5\no Left \u{e9}\ng a b\nusemtl red\ns 1\nf 1/1/1 2/1/1 3//1\nf 1//1 3//1 4//1\n\
                o Right\nusemtl blue\n#f 1 2 3\nf 2 5 6 3\n\np 1\n";
    let folder = Folder::new("unwrap-lines");
    folder.put("in.obj", text);
    unwrap(&folder, "--no-pack").is(0);
    // Without the texture coordinates nothing differs.
    let without = |text: &str| -> Vec<String> {
        let corner = |word: &str| {
            let parts: Vec<&str> = word.split('/').collect();
            format!("{}/{}", parts[0], parts.get(2).unwrap_or(&""))
        };
        let line = |l: &str| match l.strip_prefix("f ") {
            Some(rest) => rest.split(' ').map(corner).collect::<Vec<_>>().join(" "),
            None => l.to_owned(),
        };
        text.split('\n').filter(|l| !l.starts_with("vt ")).map(line).collect()
    };
    let out = folder.read("out.obj");
    assert_eq!(without(&out), without(text));
    let map = mapped(&folder);
    assert_eq!((map.uv.len(), map.faces.len()), (6, 3));
    assert_eq!(report(&folder)["charts"], 1);
}

#[test]
fn wrong_options_and_lists_are_refused_and_leave_no_file() {
    let folder = folder("refused", &Surface::patch(4));
    let refuses = |options: &str, parts: &[&str]| {
        let before = folder.names();
        folder.run(&format!("unwrap in.obj {options}")).is_refused(parts);
        assert_eq!(folder.names(), before, "{options}");
    };
    let with = |file: &str, text: &str, option: &str, parts: &[&str]| {
        folder.put(file, text);
        refuses(&format!("--out out.obj {option} {file}"), parts);
    };
    with("no-edge.txt", "0 1\n0 12\n", "--seams", &["seam 1", "vertex 0 to 12", "no edge"]);
    with("unknown.txt", "0 1\n# two\n0 25\n", "--seams", &["unknown.txt", "line 3", "`25`", "0 to 24"]);
    with("three.txt", "0 1 2\n", "--seams", &["three.txt", "line 1", "3 words"]);
    with("pin.txt", "25 0 0\n", "--pin", &["pin.txt", "line 1", "`25`", "0 to 24"]);
    with("pin2.txt", "1 0\n", "--pin", &["pin2.txt", "line 1", "a vertex, u and v"]);
    with("pin3.txt", "1 0 inf\n", "--pin", &["pin3.txt", "line 1", "`inf`", "finite"]);
    with("few.txt", "1 1 1\n", "--weights", &["few.txt", "3 weights", "32 faces", "25 vertices"]);
    with("minus.txt", "1 1\n-1\n", "--weights", &["minus.txt", "line 2", "-1 is not positive"]);
    refuses("--out out.obj --seams none.txt", &["none.txt", "cannot be read", "check the path"]);
    refuses("--out out.obj --from-uv", &["in.obj", "no texture coordinates", "--from-uv"]);
    refuses("--out out.obj --seams vt", &["in.obj", "no texture coordinates", "--seams vt"]);
    refuses("--out out.stl", &["out.stl", "no texture coordinates", "write .obj"]);
    refuses("--out out.xyz", &["out.xyz", "unknown extension"]);
    refuses("--out none/out.obj", &["none/out.obj", "no folder none"]);
    refuses("--out out.obj --report ./out.obj", &["out.obj", "--out and --report", "two names"]);
    refuses("--out out.obj --trace t --report t", &["--report and --trace", "two names"]);
    refuses("--out out.obj --preview p.jpg", &["p.jpg", "--preview", ".png"]);
    refuses("--out out.obj --tol 0", &["tol is 0"]);
    refuses("--out out.obj --threads 0", &["threads is 0"]);
    refuses("--out out.obj --method magic", &["'magic'", "--method", "wrapd"]);
    refuses("--out out.obj --padding -1", &["padding"]);
    refuses("", &["--out"]);
    folder.run("unwrap none.obj --out out.obj").is_refused(&["none.obj", "no such file"]);
    folder.put("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    folder.run("unwrap points.obj --out out.obj").is_refused(&["points.obj", "no faces"]);
    assert!(!folder.has("out.obj"));
}

#[test]
fn a_limit_ends_with_status_3_and_the_best_result() {
    let folder = folder("limits", &Surface::patch(12));
    for (options, part) in [("--time-limit 1e-6", "--time-limit"), ("--max-iters 1", "--max-iters")] {
        let run = unwrap(&folder, &format!("{options} --no-pack"));
        run.is(3);
        let r = report(&folder);
        assert_eq!(r["status"], "stopped");
        assert!(r["reason"].as_str().unwrap().contains(part), "{r}");
        let map = mapped(&folder);
        assert_eq!((map.faces.len(), &r["flips"]), (288, &0.into()));
        close(r["energy"].as_f64().unwrap(), map.energy(), 1e-12);
    }
}

#[test]
fn settings_are_shown_with_defaults_filled_in() {
    let folder = Folder::new("unwrap-settings");
    let run = folder.run("unwrap --show-settings --max-iters 7");
    run.is(0);
    let settings: Value = serde_json::from_str(&run.out).unwrap();
    for (key, value) in [
        ("method", Value::from("auto")),
        ("energy", "symmetric-dirichlet".into()),
        ("max_iters", 7.into()),
        ("tol", 1e-9.into()),
        ("pack", true.into()),
        ("time_limit", Value::Null),
    ] {
        assert_eq!(settings[key], value, "{key}");
    }
    assert_eq!(folder.names(), Vec::<String>::new());
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let small = Surface::sphere(20).with(&Surface::patch(10).moved(1.0, [4.0, 0.0, 0.0]));
    let folder = folder("threads", &small);
    let outs: Vec<String> = [1, 2, 3, 2]
        .iter()
        .map(|n| {
            unwrap(&folder, &format!("--threads {n}")).is(0);
            assert_eq!(report(&folder)["threads"], *n);
            folder.read("out.obj")
        })
        .collect();
    assert!(outs.windows(2).all(|w| w[0] == w[1]));
}

#[test]
fn the_trace_has_a_row_for_each_iteration() {
    let folder = folder("trace", &Surface::patch(12));
    for method in ["wrapd", "auto", "cm"] {
        let (r, map) = maps(&folder, &format!("--no-pack --trace t.csv --method {method}"));
        let text = folder.read("t.csv");
        let mut lines = text.lines();
        let header = "iteration,seconds,energy,gradient_norm,position_error,primal_residual,dual_residual,merit,inner,\
                      refactorised,accepted,inverted,flips,energy_z";
        assert_eq!(lines.next().unwrap(), header);
        let number = |w: &str| w.parse::<f64>().unwrap();
        let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(number).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == 14), "{text}");
        let numbers: Vec<f64> = rows.iter().map(|row| row[0]).collect();
        let iterations = r["iterations"].as_u64().unwrap();
        assert_eq!(numbers, (0..=iterations).map(|k| k as f64).collect::<Vec<_>>());
        assert!(rows.windows(2).all(|w| w[0][1] <= w[1][1]), "time goes on");
        let last = rows.last().unwrap();
        close(last[2], map.energy(), 1e-9);
        assert!(rows[0][2] > last[2], "{method}");
        assert_eq!((last[11], last[12]), (0.0, 0.0));
    }
    // The local variable of the splitting ends where the map does.
    maps(&folder, "--no-pack --trace t.csv --method wrapd");
    let text = folder.read("t.csv");
    let last: Vec<f64> = text.lines().last().unwrap().split(',').map(|w| w.parse().unwrap()).collect();
    close(last[13], last[2], 1e-6);
}

#[test]
fn quiet_is_quiet() {
    let mut surface = Surface::patch(6);
    surface.points.push([9.0; 3]);
    surface.faces[20].reverse();
    let folder = folder("quiet", &surface);
    let run = unwrap(&folder, "--quiet");
    run.is(0);
    assert_eq!((run.out.as_str(), run.err.as_str()), ("", ""));
    let run = unwrap(&folder, "");
    assert!(run.err.contains("repaired: 1 face") && run.err.contains("warning: 1 vertex"), "{run:?}");
    assert!(run.out.contains("energy 1.") && run.out.contains("wrote out.obj"), "{run:?}");
}

#[test]
fn other_formats() {
    let folder = folder("formats", &Surface::quads(6));
    let (r, _) = maps(&folder, "--no-pack");
    for (out, tolerance) in [("out.ply", 1e-12), ("out.glb", 1e-6), ("out.gltf", 1e-6)] {
        folder.run(&format!("unwrap in.obj --no-pack --out {out} --report other.json")).is(0);
        let other: Value = serde_json::from_str(&folder.read("other.json")).unwrap();
        close(other["energy"].as_f64().unwrap(), r["energy"].as_f64().unwrap(), tolerance);
        assert_eq!(other["flips"], 0);
    }
    folder.put("in.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n3 0 1 2\n3 0 2 3\n");
    folder.run("unwrap in.off --out off.obj --no-pack").is(0);
    let map = Mapped::parse(&folder.read("off.obj"));
    assert_eq!((map.points.len(), map.faces.len(), map.uv.len()), (4, 2, 4));
}
