//! `proxel deform --keyframes`: what it writes, how it ends, what it refuses.

mod common;
use common::Folder;

const RUN: &str = "deform rest.node --pins pins.toml --keyframes keys.toml --threads 1";

const PINS: &str = "[groups.left]\nindices = [0, 1, 2, 3]\n[groups.right]\nindices = [12, 13, 14, 15]\n";

const KEYS: &str = "frames = 5\n[[keyframe]]\ntime = 0\n[[keyframe]]\ntime = 2\n\
                    groups.right = { rotate = { axis = [1, 0, 0], angle = 90 }, translate = [0.4, 0, 0] }\n";

fn folder(name: &str) -> Folder {
    let folder = Folder::new(name);
    folder.beam(3).write("pins.toml", PINS).write("keys.toml", KEYS);
    folder
}

fn report(folder: &Folder) -> serde_json::Value {
    serde_json::from_str(&folder.read("r.json")).unwrap()
}

/// The coordinates of an .obj file.
fn points(text: &str) -> Vec<Vec<f64>> {
    let lines = text.lines().filter_map(|l| l.strip_prefix("v "));
    lines.map(|l| l.split_whitespace().map(|w| w.parse().unwrap()).collect()).collect()
}

#[test]
fn every_frame_has_its_handles_where_they_are_to_be() {
    let folder = folder("series");
    let run = folder.run(&format!("{RUN} --out walk.obj --report r.json --trace t.csv"));
    run.is(0);
    assert!(run.out.starts_with("converged: 5 of 5 frames, 5 converged"), "{run:?}");
    assert!(run.err.is_empty(), "{run:?}");
    let r = report(&folder);
    let frames = r["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 5);
    assert_eq!(r["status"], "converged");
    let sum: u64 = frames.iter().map(|f| f["iterations"].as_u64().unwrap()).sum();
    assert_eq!(r["iterations"].as_u64(), Some(sum));
    for (k, frame) in frames.iter().enumerate() {
        assert_eq!(frame["time"].as_f64(), Some(0.5 * k as f64));
        assert_eq!(frame["status"], "converged");
        // At rest all that there is of a gradient is rounding.
        assert!(k == 0 || frame["gradient_ratio"].as_f64().unwrap() <= 1e-9, "{frame}");
        let before = k.checked_sub(1).map(|b| frames[b]["energy"].as_f64());
        assert!(before.is_none_or(|b| frame["energy"].as_f64() > b), "it is wrung more and more");
    }
    let rest = points(&folder.read("walk_0000.obj"));
    let half = points(&folder.read("walk_0002.obj"));
    // Half-way: an eighth of a turn around the centroid of the right side, and half of the shift.
    let (sin, cos) = 45f64.to_radians().sin_cos();
    for (p, q) in rest.iter().zip(&half) {
        let want = match p[0] {
            0.0 => p.clone(),
            3.0 => {
                let (y, z) = (p[1] - 0.5, p[2] - 0.5);
                vec![p[0] + 0.2, 0.5 + cos * y - sin * z, 0.5 + sin * y + cos * z]
            }
            _ => continue,
        };
        assert!((0..3).all(|d| (q[d] - want[d]).abs() < 1e-12), "{q:?} is not {want:?}");
    }
    let trace = folder.read("t.csv");
    let mut lines = trace.lines();
    assert!(lines.next().unwrap().starts_with("frame,iteration,seconds,"));
    let rows: Vec<Vec<&str>> = lines.map(|l| l.split(',').collect()).collect();
    assert!(rows.iter().all(|r| r.len() == 13 && r.iter().all(|w| w.parse::<f64>().is_ok())));
    let starts = rows.iter().filter(|r| r[1] == "0").count();
    assert_eq!(starts, 5, "a row 0 for each frame");
}

#[test]
fn one_animated_file_or_a_list_by_the_extension() {
    let folder = folder("formats");
    folder.run(&format!("{RUN} --out walk.gltf")).is(0);
    let text: serde_json::Value = serde_json::from_str(&folder.read("walk.gltf")).unwrap();
    assert_eq!(text["animations"].as_array().unwrap().len(), 1);
    folder.run(&format!("{RUN} --out walk.pvd")).is(0);
    assert!(folder.read("walk.pvd").contains("timestep=\"1.5\"") && folder.has("walk_0004.vtu"));
    folder.run(&format!("{RUN} --out walk.bones")).is_refused(&["walk.bones"]);
}

#[test]
fn json_says_the_same() {
    let folder = folder("json");
    folder.put(
        "keys.json",
        r#"{"frames": 5, "keyframe": [{"time": 0}, {"time": 2, "groups": {"right":
            {"matrix": [[1, 0, 0, 0.4], [0, 0, -1, 1], [0, 1, 0, 0], [0, 0, 0, 1]]}}}]}"#,
    );
    folder.run(&format!("{RUN} --out a.obj")).is(0);
    folder.run(&format!("{} --out b.obj", RUN.replace("keys.toml", "keys.json"))).is(0);
    let (a, b) = (points(&folder.read("a_0003.obj")), points(&folder.read("b_0003.obj")));
    assert!(a.len() == 16 && a.iter().zip(&b).all(|(a, b)| (0..3).all(|d| (a[d] - b[d]).abs() < 1e-7)));
}

#[test]
fn what_is_not_converged_is_said_and_written() {
    let folder = folder("stopped");
    let run = folder.run(&format!("{RUN} --out walk.obj --report r.json --max-iters 1"));
    run.is(3);
    let r = report(&folder);
    assert_eq!((r["status"].as_str(), r["frames"].as_array().unwrap().len()), (Some("stopped"), 5));
    assert!(r["reason"].as_str().unwrap().contains("--max-iters"), "{r}");
    assert!(folder.has("walk_0004.obj"));
    // No time at all: the first frame, and that it is all.
    let run = folder.run(&format!("{RUN} --out short.obj --report r.json --time-limit 0"));
    run.is(3);
    assert!(run.out.contains("1 of 5 frames"), "{run:?}");
    assert!(folder.has("short_0000.obj") && !folder.has("short_0001.obj"));
    // No time for each: all frames, and no minimum but that of the first.
    folder.run(&format!("{RUN} --out quick.obj --report r.json --frame-time 0")).is(3);
    let r = report(&folder);
    let stopped = r["frames"].as_array().unwrap().iter().filter(|f| f["status"] == "stopped").count();
    assert!(stopped >= 4 && folder.has("quick_0004.obj"), "{r}");
}

#[test]
fn what_cannot_be_is_refused_with_file_and_remedy() {
    let folder = folder("refused");
    let try_keys = |keys: &str| {
        folder.put("keys.toml", keys);
        folder.run(&format!("{RUN} --out walk.obj"))
    };
    let one = "[[keyframe]]\ntime = 1\n";
    try_keys(&format!("{one}{one}")).is_refused(&["keys.toml", "keyframe 1 (0-based)", "does not come after"]);
    try_keys(&format!("{one}groups.foot = {{}}")).is_refused(&["keys.toml", "group `foot`", "`left`, `right`"]);
    try_keys(&format!("{one}groups.left = {{ matrix = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]] }}")).is_refused(&[
        "keys.toml",
        "no rotation",
        "targets",
    ]);
    try_keys(&format!("{one}groups.left = {{ scale = 2 }}")).is_refused(&["keys.toml", "line 3", "scale"]);
    try_keys("[[keyframe]]\ntime = soon\n").is_refused(&["keys.toml", "line 2"]);
    folder.put("keys.toml", "frames_per_second = 1000\n[[keyframe]]\ntime = 0\n[[keyframe]]\ntime = 2\n");
    folder.run(&format!("{RUN} --out walk.glb")).is_refused(&["walk.glb", "2001 frames", ".pvd"]);
    folder.run("deform rest.node --keyframes keys.toml --out walk.obj").is_refused(&["--pins"]);
    folder.run(&format!("{RUN} --out walk.obj --frame-time -1")).is_refused(&["--frame-time"]);
    folder.run(&RUN.replace("keys.toml", "no.toml --out walk.obj")).is_refused(&["no.toml", "no such file"]);
    folder.run(&format!("{RUN} --out walk.glb --report walk.glb")).is_refused(&["walk.glb", "--report"]);
    assert!(!folder.names().iter().any(|n| n.starts_with("walk")), "{:?}", folder.names());
}

#[test]
fn the_demo_leaves_files_that_do_it_again() {
    let folder = Folder::new("demo-animation");
    folder.run("demo animation --out d --quiet --threads 1").is(0);
    let again =
        "deform d/animation.mesh --pins d/animation-pins.toml --keyframes d/animation-keys.toml --out again.glb";
    folder.run(&format!("{again} --threads 1")).is(0);
    let bytes = |name: &str| std::fs::read(folder.0.join(name)).unwrap();
    assert!(bytes("d/animation.glb") == bytes("again.glb"), "not the same bytes");
}
