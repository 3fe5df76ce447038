//! Every bad input ends with exit status 2, one line that names file, item and remedy, and no output.

mod common;
use common::Folder;

const SOLVE: &str = "deform rest.node --init init.node --pins pins.txt --out out.vtu --report r.json --trace t.csv";

/// Runs on a small beam after `change`, and wants to be refused with these parts.
#[track_caller]
fn refuses(name: &str, change: impl FnOnce(&Folder), words: &str, parts: &[&str]) {
    let folder = Folder::new(name);
    folder.beam(2);
    change(&folder);
    let before = folder.names();
    folder.run(words).is_refused(parts);
    assert_eq!(folder.names(), before, "no file is left behind");
}

/// Replaces the line of `file` that begins with `start`.
fn edit(folder: &Folder, file: &str, start: &str, line: &str) {
    let text = folder.read(file);
    let mut found = 0;
    let lines = text.lines().map(|l| {
        let hit = l.starts_with(start);
        found += usize::from(hit);
        if hit { line } else { l }
    });
    let changed = lines.collect::<Vec<_>>().join("\n") + "\n";
    assert_eq!(found, 1, "{start} in {text}");
    folder.write(file, &changed);
}

#[test]
fn files_that_are_missing_or_truncated() {
    let solve = |rest: &str| SOLVE.replace("rest.node", rest);
    refuses("missing", |_| (), &solve("no.node"), &["no.node", "no such file"]);
    refuses(
        "missing-ele",
        |f| std::fs::remove_file(f.0.join("rest.ele")).unwrap(),
        SOLVE,
        &["rest.ele", "no such file"],
    );
    refuses("missing-init", |_| (), &SOLVE.replace("init.node", "no.npy"), &["no.npy", "no such file"]);
    refuses(
        "missing-pins",
        |_| (),
        &SOLVE.replace("pins.txt", "no.txt"),
        &["no.txt", "no such file", "check the path"],
    );
    let cut = |f: &Folder| {
        let text = f.read("rest.node");
        f.write("rest.node", &text[..text.len() / 2]);
    };
    refuses("truncated", cut, SOLVE, &["rest.node", "truncated"]);
    refuses("extension", |_| (), &solve("rest.xyz"), &["rest.xyz", "unknown extension `.xyz`", "use .node"]);
}

#[test]
fn numbers_that_are_none() {
    refuses("word", |f| edit(f, "rest.node", "5 ", "5 1 one 0"), SOLVE, &["rest.node", "line 7", "`one` is no number"]);
    refuses("nan", |f| edit(f, "rest.node", "5 ", "5 1 nan 0"), SOLVE, &["rest.node", "vertex 5", "not finite"]);
    refuses("inf", |f| edit(f, "init.node", "5 ", "5 1 0 inf"), SOLVE, &["init.node", "vertex 5", "not finite"]);
}

#[test]
fn elements_that_are_none() {
    let with = |tet: &'static str| move |f: &Folder| edit(f, "rest.ele", "3 ", tet);
    refuses("range", with("3 0 6 4 99"), SOLVE, &["rest.ele", "tetrahedron 3", "99 is out of range"]);
    refuses("negative-index", with("3 0 6 4 -7"), SOLVE, &["rest.ele", "tetrahedron 3", "-7 is negative"]);
    refuses("repeated", with("3 0 6 6 7"), SOLVE, &["tetrahedron 3", "vertex 6 occurs twice"]);
    refuses("zero", with("3 0 1 2 3"), SOLVE, &["tetrahedron 3", "volume is zero"]);
    let turned = with("3 0 6 2 11");
    refuses("negative-volume", turned, SOLVE, &["rest", "tetrahedron 3", "volume is negative", "--fix-orientation"]);
    refuses("empty", |f| f.put("rest.ele", "0 4 0\n"), SOLVE, &["rest", "no elements"]);
    refuses(
        "empty-nodes",
        |f| {
            f.put("rest.node", "0 3 0 0\n");
            f.put("rest.ele", "0 4 0\n");
        },
        SOLVE,
        &["no vertices"],
    );
}

#[test]
fn pins() {
    let with = |text: &'static str| move |f: &Folder| f.put("pins.txt", text);
    refuses("pin-range", with("0 1\n12"), SOLVE, &["pins.txt", "line 2", "12 is out of range", "0 to 11"]);
    refuses("pin-word", with("0 1 two"), SOLVE, &["pins.txt", "line 1", "`two` is no vertex index"]);
    refuses("pin-negative", with("-1"), SOLVE, &["pins.txt", "`-1` is negative"]);
    let loads = "[groups.push]\nindices = [8]\nforce = { total = [1, 0, 0] }\n";
    let solve = SOLVE.replace("pins.txt", "loads.toml");
    refuses("loads-only", move |f| f.put("loads.toml", loads), &solve, &["rest", "nothing holds it", "--pins"]);
    let weight = "deform rest.node --density 1000 --gravity 0,-9.81,0 --out out.vtu";
    refuses("weight-only", |_| (), weight, &["rest", "nothing holds it"]);
}

#[test]
fn sizes_that_differ() {
    let shorter = |f: &Folder| {
        let text = f.read("init.node").replacen("12 3", "11 3", 1);
        let cut = text.trim_end().rfind('\n').unwrap() + 1;
        f.write("init.node", &text[..cut]);
    };
    refuses("size", shorter, SOLVE, &["init.node", "has 11 vertices", "has 12", "same mesh"]);
    refuses(
        "reference",
        shorter,
        &format!("{} --reference init.node", SOLVE.replace("--init init.node", "")),
        &["init.node", "give a reference of the same mesh"],
    );
}

#[test]
fn materials() {
    let with = |extra: &str| format!("{SOLVE} {extra}");
    for nu in ["0.5", "-1", "0.7", "nan"] {
        refuses(
            &format!("poisson{nu}"),
            |_| (),
            &with(&format!("--poisson {nu}")),
            &["--poisson", "between -1 and 0.5"],
        );
    }
    for young in ["0", "-1e7", "inf"] {
        refuses(&format!("young{young}"), |_| (), &with(&format!("--young {young}")), &["--young", "positive"]);
    }
    refuses("mu", |_| (), &with("--mu -1"), &["--mu", "positive"]);
    refuses("energy", |_| (), &with("--material jelly"), &["'jelly'", "--material", "neo-hookean"]);
    refuses("regions", |f| f.put("m.toml", "[1]\nyoung = 1e5\n"), &with("--materials m.toml"), &["rest", "no regions"]);
    refuses(
        "regions-key",
        |f| f.put("m.toml", "[1]\nyong = 1e5\n"),
        &with("--materials m.toml"),
        &["m.toml", "line 2", "yong"],
    );
}

#[test]
fn settings_and_usage() {
    let with = |extra: &str| format!("{SOLVE} {extra}");
    refuses("tol", |_| (), &with("--tol -1"), &["tol is -1"]);
    refuses("threads", |_| (), &with("--threads 0"), &["threads is 0"]);
    refuses("scale", |_| (), &with("--weight-scale 0"), &["weight_scale", "positive"]);
    refuses("method", |_| (), &with("--method simplex"), &["'simplex'", "wrapd", "admm-pd"]);
    refuses("gravity", |_| (), &with("--gravity 1,2"), &["--gravity", "three numbers"]);
    refuses("option", |_| (), &with("--metod wrapd"), &["--metod", "--method", "--help"]);
    refuses("no-out", |_| (), "deform rest.node", &["--out"]);
}

#[test]
fn outputs_that_cannot_be_written() {
    let to = |out: &str| SOLVE.replace("out.vtu", out);
    refuses(
        "no-folder",
        |_| (),
        &to("no/such/out.vtu"),
        &["no/such/out.vtu", "there is no folder", "another output path"],
    );
    refuses(
        "is-folder",
        |f| std::fs::create_dir(f.0.join("dir.vtu")).unwrap(),
        &to("dir.vtu"),
        &["dir.vtu", "is a folder"],
    );
    refuses("format", |_| (), &to("out.xyz"), &["out.xyz", "unknown extension"]);
    refuses("preview", |_| (), &format!("{SOLVE} --preview p.jpg"), &["p.jpg", ".png"]);
    refuses("report", |_| (), &SOLVE.replace("r.json", "no/r.json"), &["no/r.json", "there is no folder"]);
    refuses("same", |_| (), &SOLVE.replace("t.csv", "r.json"), &["r.json", "--report and --trace"]);
    let parent_is_file = "deform rest.node --init init.node --pins pins.txt --out rest.node/x.vtu";
    refuses("file-as-folder", |_| (), parent_is_file, &["rest.node/x.vtu", "no folder"]);
}

#[test]
fn handles_that_overlap_contradict_or_leave_a_component_free() {
    let solve = SOLVE.replace("pins.txt", "p.toml");
    let with = |text: &'static str| move |f: &Folder| f.put("p.toml", text);
    // Groups that agree may share vertices.
    let two = "[groups.a]\nindices = [0, 1, 2]\n[groups.b]\nindices = [2, 3]\n";
    Folder::new("overlap").beam(2).write("p.toml", two).run(&solve).is(0);
    let apart = "[groups.a]\nindices = [0, 1, 2]\n[groups.b]\nindices = [2, 3]\ntranslate = [1, 0, 0]\n";
    refuses(
        "contradict",
        with(apart),
        &solve,
        &["p.toml", "`a` and `b`", "vertex 2", "different places, [0.0, 0.0, 1.0] and [1.0, 0.0, 1.0]"],
    );
    let soft = "[groups.a]\nindices = [0, 1]\n[groups.b]\nindices = [1]\nstiffness = 5\n";
    refuses("soft-overlap", with(soft), &solve, &["p.toml", "`a` and `b` overlap", "vertex 1"]);
    let none = "[groups.a]\nsphere = { center = [9, 9, 9], radius = 1 }\n";
    refuses("nothing", with(none), &solve, &["p.toml", "`a` chooses none of the 12 vertices", "correct its"]);
    // Two tetrahedra apart, one of them held, both heavy.
    let apart = |f: &Folder| {
        f.put("rest.node", "8 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n4 9 0 0\n5 10 0 0\n6 9 1 0\n7 9 0 1\n");
        f.put("rest.ele", "2 4 0\n0 0 1 2 3\n1 4 5 6 7\n");
        f.put("p.toml", "[groups.wall]\nindices = [0, 1, 2]\n");
    };
    let heavy = "deform rest.node --pins p.toml --density 1 --gravity 0,-1,0 --out out.vtu";
    refuses(
        "free",
        apart,
        heavy,
        &["rest", "component of vertex 4 (0-based), with 4 vertices", "nothing holds it", "--pins"],
    );
}

#[test]
fn constraints_and_sheets() {
    let solve = SOLVE.replace("pins.txt", "p.toml");
    let with = |text: &'static str| move |f: &Folder| f.put("p.toml", text);
    let twice = "[[equality]]\nvertices = [8, 9]\n[[equality]]\nvertices = [9, 8]\n";
    refuses("redundant", with(twice), &solve, &["rest", "equality 1 (0-based)", "follows", "remove it"]);
    let against = "[[equality]]\nvertices = [8, 9]\n[[equality]]\nvertices = [9, 8]\nvalue = [1, 0, 0]\n";
    refuses(
        "contradictory",
        with(against),
        &solve,
        &["rest", "equality 1 (0-based)", "contradicts", "correct or remove"],
    );
    let range = "[[equality]]\nvertices = [8, 12]\n";
    refuses("row-range", with(range), &solve, &["p.toml", "equality 0", "12 is out of range", "0 to 11"]);
    let flat = "[[obstacle]]\npoint = [0, 0, 0]\nnormal = [0, 0, 0]\n";
    refuses("obstacle", with(flat), &solve, &["p.toml", "obstacle 0", "direction"]);
    let with = |extra: &str| format!("{SOLVE} {extra}");
    refuses("limits", |_| (), &with("--strain-limit 1.1,1.2"), &["--strain-limit", "1.1,1.2", "0.95,1.05"]);
    refuses("limits-text", |_| (), &with("--strain-limit 0.9"), &["--strain-limit", "two numbers"]);
    refuses("bending", |_| (), &with("--bending 1"), &["rest", "no elastic triangles", "--mixed"]);
    refuses("bending-negative", |_| (), &with("--bending -1"), &["--bending", "negative"]);
    refuses("planar", |_| (), &with("--planar"), &["rest", "tetrahedra", "--planar"]);
    refuses("obstacle-text", |_| (), &with("--obstacle 1,2,3"), &["--obstacle", "a point and a normal"]);
    refuses(
        "obstacle-pin",
        |_| (),
        &with("--obstacle 9,0,0,1,0,0"),
        &["rest", "vertex 0", "behind obstacle 0", "move the pin"],
    );
    refuses("pressure", |_| (), &with("--pressure nan"), &["rest", "a pressure is NaN"]);
    refuses("demo", |_| (), "demo squid", &["'squid'", "octopus", "cloth"]);
}
