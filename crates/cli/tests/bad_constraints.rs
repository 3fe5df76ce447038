//! Constraints, surfaces and sizes that make no sense: refused in one line that names item and remedy, or told.

mod common;
use common::{Folder, Run};

/// A beam, its skin, a second skin apart from it, and a sheet.
fn folder(name: &str) -> Folder {
    let folder = Folder::new(name);
    folder.beam(3).run("convert rest.node --out skin.obj --quiet").is(0);
    let skin = folder.read("skin.obj");
    let vertices = |shift: f64| -> String {
        let points = skin.lines().filter_map(|l| l.strip_prefix("v "));
        let lines = points.map(|l| {
            let p: Vec<f64> = l.split_whitespace().map(|x| x.parse().unwrap()).collect();
            format!("v {} {} {}\n", p[0], p[1] + shift, p[2])
        });
        lines.collect()
    };
    let n = skin.lines().filter(|l| l.starts_with("v ")).count();
    let faces = |shift: usize| -> String {
        let faces = skin.lines().filter_map(|l| l.strip_prefix("f "));
        let lines = faces.map(|l| {
            let corners = l.split_whitespace().map(|v| v.split('/').next().unwrap().parse::<usize>().unwrap() + shift);
            format!("f {}\n", corners.map(|v| v.to_string()).collect::<Vec<_>>().join(" "))
        });
        lines.collect()
    };
    folder.put("two.obj", &format!("{}{}{}{}", vertices(0.0), vertices(4.0), faces(0), faces(n)));
    folder.put("plane.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
    folder.put("hold.toml", "[groups.wall]\nplane = { point = [0.01, 0, 0], normal = [-1, 0, 0] }\n");
    folder
}

/// Wants to be refused with these parts, and nothing written.
#[track_caller]
fn refuses(folder: &Folder, words: &str, parts: &[&str]) {
    let before = folder.names();
    folder.run(&format!("deform {words} --out out.obj --report r.json")).is_refused(parts);
    assert_eq!(folder.names(), before, "no file is left behind");
}

fn runs(folder: &Folder, words: &str) -> Run {
    let run = folder.run(&format!("deform {words} --out out.obj"));
    run.is(0);
    run
}

#[test]
fn rows_that_say_nothing_or_too_much() {
    let f = folder("rows");
    let with = |rows: &str| f.put("p.toml", &format!("{}{rows}", f.read("hold.toml")));
    with("[[equality]]\nvertices = [12, 13]\ncoefficients = [0, 0]\n");
    refuses(&f, "rest.node --pins p.toml", &["p.toml", "equality 0", "add up to 0", "or remove it"]);
    with("[[equality]]\nvertices = [12, 12]\ncoefficients = [3, -3]\n");
    refuses(&f, "rest.node --pins p.toml", &["p.toml", "equality 0", "add up to 0"]);
    with("[[equality]]\nvertices = [0, 1]\nvalue = [9, 9, 9]\n");
    for mesh in ["rest.node", "skin.obj"] {
        refuses(&f, &format!("{mesh} --pins p.toml"), &[mesh, "equality 0 (0-based) contradicts", "pins", "remove"]);
    }
    with("[[equality]]\nvertices = [0, 1]\ncoefficients = [1, 0.1]\nvalue = [0, 0.1, 0]\n");
    refuses(&f, "rest.node --pins p.toml", &["rest.node", "equality 0 (0-based) follows from", "pins"]);
    with("[[equality]]\nvertices = [12, 13]\n[[equality]]\nvertices = [12, 13]\ncoefficients = [2, 2]\n");
    refuses(&f, "skin.obj --pins p.toml", &["skin.obj", "equality 1 (0-based) follows from", "--resolution"]);
    refuses(&f, "rest.node --pins p.toml --method newton", &["newton cannot hold equalities", "--method auto"]);
    // Coefficients of any size say the same.
    for size in ["1e300", "1e-300"] {
        with(&format!("[[equality]]\nvertices = [12]\ncoefficients = [{size}]\nvalue = [3.1e{}, 0, 0]\n", &size[2..]));
        runs(&f, "rest.node --pins p.toml --tol 1e-6 --quiet");
        let moved = proxel_mesh::read_points(&f.0.join("out.obj")).unwrap();
        assert!(moved.iter().any(|p| (p[0] - 3.1).abs() < 1e-9 && p[1].abs() < 1e-9), "{size}: {moved:?}");
    }
}

#[test]
fn obstacles_and_pressures() {
    let f = folder("obstacles");
    for mesh in ["rest.node", "skin.obj"] {
        let held = format!("{mesh} --pins hold.toml");
        refuses(&f, &format!("{held} --obstacle 0.5,0,0,1,0,0"), &[mesh, "behind obstacle 0", "move the pin"]);
        refuses(&f, &format!("{held} --obstacle 0,0,0,0,0,0"), &[mesh, "obstacle 0", "normal with a direction"]);
        refuses(&f, &format!("{held} --obstacle 0,0,nan,0,0,1"), &[mesh, "obstacle 0", "finite numbers"]);
        refuses(&f, &format!("{held} --pressure inf"), &[mesh, "a pressure is inf", "finite"]);
        // The length of a normal says nothing, however large or small it is.
        for length in ["1e200", "1e-200"] {
            refuses(&f, &format!("{held} --obstacle 0.5,0,0,{length},0,0"), &[mesh, "held 5e-1 behind obstacle 0"]);
        }
    }
    f.put("few.toml", &format!("{}[groups.p]\nindices = [12]\npressure = 5\n", f.read("hold.toml")));
    refuses(&f, "skin.obj --pins few.toml", &["skin.obj", "acts on 0 faces", "all corners"]);
}

#[test]
fn components_that_nothing_holds() {
    let f = folder("free");
    let n = f.read("skin.obj").lines().filter(|l| l.starts_with("v ")).count();
    let first = format!("component of vertex {n} (0-based), with {n} vertices");
    f.put("first.txt", "0 1 2 3\n");
    let push =
        format!("[groups.wall]\nindices = [0, 1, 2]\n[groups.push]\nindices = [{n}]\nforce = {{ each = [1, 0, 0] }}\n");
    f.put("push.toml", &push);
    for kind in ["--embed --resolution 10", "--shell"] {
        let heavy = format!("two.obj {kind} --pins first.txt --density 1 --gravity 0,-1,0");
        refuses(&f, &heavy, &["two.obj", &first, "nothing holds it", "--pins"]);
        refuses(&f, &format!("two.obj {kind} --pins push.toml"), &["two.obj", &first, "nothing holds it"]);
        let run = runs(&f, &format!("two.obj {kind} --pins first.txt"));
        assert!(run.err.contains(&format!("of vertex {n} (0-based), with {n} vertices")), "{run:?}");
        assert!(run.err.contains("anchored in place"), "{run:?}");
    }
    // Soft springs hold.
    f.put("soft.toml", "[groups.all]\nplane = { point = [9, 0, 0], normal = [-1, 0, 0] }\nstiffness = 1e6\n");
    runs(&f, "two.obj --resolution 10 --pins soft.toml --density 1 --gravity 0,-1,0 --tol 1e-6");
}

#[test]
fn surfaces_without_inside_extent_or_elements() {
    let f = folder("inside");
    f.put("flat.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 3 2 1\nf 4 3 1\n");
    f.put("points.obj", "v 0 0 0\nv 1 0 0\n");
    f.put("line.obj", "v 0 0 0\nv 1 1 1\nv 3 3 3\nv 0 1 0\nf 1 2 4\nf 1 2 3\n");
    f.put("fan.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 0 -1\nf 1 2 3\nf 1 2 4\nf 1 2 5\n");
    for mesh in ["plane.obj", "flat.obj", "fan.obj"] {
        refuses(&f, &format!("{mesh} --embed"), &[mesh, "no inside", "--shell"]);
    }
    for kind in ["", "--embed", "--shell"] {
        refuses(&f, &format!("points.obj {kind}"), &["points.obj", "no elements", "give a mesh"]);
    }
    refuses(&f, "line.obj --shell", &["line.obj", "triangle 1 (0-based) has no area", "[0, 1, 2]", "remove it"]);
    let run = runs(&f, "fan.obj --shell --bending 1 --tol 1e-3");
    assert!(run.err.contains("three or more triangles") && run.err.contains("the first is"), "{run:?}");
    for ending in ["obj", "ply", "stl", "off", "vtu", "msh", "mesh", "gltf", "glb", "node"] {
        f.put(&format!("empty.{ending}"), "");
        refuses(&f, &format!("empty.{ending}"), &[&format!("empty.{ending}")]);
    }
    f.put("twice.obj", &format!("{}f 1 2 3\n", f.read("plane.obj")));
    let run = runs(&f, "twice.obj --shell");
    assert!(run.err.contains("1 elements have the corners of another, the first is triangle 2"), "{run:?}");
    f.put("apart.obj", &format!("{}v 8 8 8\n", f.read("skin.obj")));
    let run = runs(&f, "apart.obj --pins hold.toml --resolution 6");
    assert!(run.err.contains("1 vertices belong to no face") && run.err.contains("stay in place"), "{run:?}");
}

#[test]
fn sizes_that_no_machine_has() {
    let f = folder("sizes");
    for n in ["0", "257", "1000000000"] {
        refuses(&f, &format!("skin.obj --resolution {n}"), &["resolution is", "1 to 256"]);
    }
    // A cube at the finest resolution would have 17 million cells.
    let cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    f.put("cube.obj", cube);
    refuses(&f, "cube.obj --resolution 256", &["cube.obj", "cells, which are more than", "lower resolution"]);
    for (name, size) in [("huge.obj", "e200"), ("tiny.obj", "e-200")] {
        let (points, faces) = cube.split_at(cube.find('f').unwrap());
        f.put(name, &format!("{}{faces}", points.replace('1', &format!("1{size}"))));
        refuses(&f, name, &[name, "apart", "other units"]);
    }
    refuses(&f, "skin.obj --material spring --embed", &["skin.obj", "springs", "--material"]);
    refuses(&f, "rest.node --pins pins.txt --lattice-out l.vtu", &["rest.node", "no lattice", "--lattice-out"]);
}
