//! Scenes that `proxel simulate` refuses, and what it says.

mod common;

use common::Folder;
use common::scenes::{SOFT, go, report, scene};
use serde_json::Value;

#[test]
fn bad_scenes_are_refused_by_name_and_leave_nothing() {
    let folder = Folder::new("simulate-bad");
    let good = scene("dt = 0.1\nframes = 1", SOFT, "", "");
    let deep = "[[obstacle]]\nname = \"ball\"\nshape = { sphere = { center = [0, 0, 0], radius = 0.6 } }";
    folder.put("loose.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\n");
    folder.put("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let loose = "[[body]]\nname = \"a\"\nmesh = \"loose.obj\"\nmodel = \"shell\"\n";
    let cases: Vec<(String, &str)> = vec![
        (good.replace("density", "densty"), "s.toml: line 8: unknown key `densty`; did you mean `density`?"),
        (good.replace("density = 1000", "density = -1"), "line 8: body[0].density: it is -1; give a positive"),
        (good.replace("dt = 0.1", "dt = 0"), "line 2: time.dt: it is 0; give a positive"),
        (good.replace("dt = 0.1", "dt = -3"), "time.dt: it is -3"),
        (good.replace("density = 1000", "velocity = [0, nan, 0]"), "line 8: body[0].velocity: it has a NaN"),
        ("[[body]]\nmesh = \"missing.obj\"\n".into(), "line 2: body[0].mesh:"),
        (format!("{good}{deep}"), "of `cube` starts"),
        (loose.into(), "line 1: body[0]: vertex 3 (0-based) has no mass"),
        (format!("{good}[[obstacle]]\nshape = {{ mesh = {{ file = \"open.obj\" }} }}\n"), "it is not closed: the edge"),
        (good.replace("young = 1e5", "young = -1"), "body[0].material:"),
        (good.replace("neo-hookean", "jelly"), "jelly"),
        (
            format!("{good}[[body.pin]]\nsphere = {{ center = [9, 9, 9], radius = 1 }}\n"),
            "body[0].pin[0]: group `pin0` chooses none",
        ),
        (
            format!("{good}[damping]\nstiffness = 0.1\n[solver]\nmethod = \"admm\"\n"),
            "damping.stiffness: admm-pd does not take it",
        ),
        (
            format!(
                "{good}[[obstacle]]\nfriction = 0.3\nshape = {{ sphere = {{ center = [9, 9, 9], radius = 1 }} }}\n[solver]\nmethod = \"admm\"\n"
            ),
            "obstacle[0].friction:",
        ),
        ("not toml".into(), "s.toml: line 1:"),
        (
            good.replace("dt = 0.1", "dt = \"fast\""),
            "line 2: invalid type: string \"fast\", expected a number; give a number",
        ),
        (good.replace("frames = 1", "frames = -1"), "line 3: invalid value: integer `-1`, expected a whole number"),
        (good.replace("[[body]]", "[body]"), "double brackets, [[..]]"),
        (String::new(), "s.toml: body: there is none; add a section [[body]]"),
    ];
    for (text, message) in cases {
        folder.put("s.toml", &text);
        let run = go(&folder, "simulate s.toml --out d");
        assert_eq!(run.code, 2, "{text}\n{}", run.stderr);
        assert!(run.stderr.contains(message), "{}\n should have said\n{message}", run.stderr);
        assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
        assert!(!folder.has("d"), "nothing is half written");
    }
    // The same faults in JSON.
    let lines = |time: &str, body: &str, rest: &str| {
        format!("{{\n\"time\": {{{time}}},\n\"body\": [{{\"name\": \"b\",\n{body}}}]{rest}\n}}")
    };
    let (time, ball) = ("\"frames\": 1", "\"generate\": {\"ball\": {\"radius\": 0.5, \"cell\": 0.25}}");
    let around =
        ",\n\"obstacle\": [{\"name\": \"o\", \"shape\": {\"sphere\": {\"center\": [0, 0, 0], \"radius\": 1}}}]";
    for (text, message) in [
        (lines(time, &format!("{ball}, \"densty\": 1"), ""), "line 4: unknown key `densty`; did you mean `density`?"),
        (lines(time, &format!("{ball},\n\"density\": -1"), ""), "line 5: body[0].density: it is -1"),
        (lines("\"dt\": 0", ball, ""), "line 2: time.dt: it is 0"),
        (lines("\"dt\": true", ball, ""), "line 2: invalid type: boolean `true`, expected a number; give a number"),
        (lines(time, "\"mesh\": \"missing.obj\"", ""), "line 4: body[0].mesh: missing.obj: no such file"),
        (
            lines(time, "\"mesh\": \"loose.obj\", \"model\": \"shell\"", ""),
            "line 3: body[0]: vertex 3 (0-based) has no mass",
        ),
        (
            lines(time, &format!("{ball}, \"velocity\": [0, NaN, 0]"), ""),
            "line 4: expected value; give a value; JSON has no NaN",
        ),
        (lines(time, ball, around), "(0-based) of `b` starts"),
        (String::new(), "line 1: EOF while parsing a value; the file ends too early"),
    ] {
        folder.put("s.json", &text);
        let run = go(&folder, "simulate s.json --out d");
        assert_eq!(run.code, 2, "{text}\n{}", run.stderr);
        assert!(run.stderr.contains(message), "{}\n should have said\n{message}", run.stderr);
        assert!(run.stderr.lines().count() == 1 && !folder.has("d"), "{}", run.stderr);
    }
    let json = r#"{"time": {"dt": 0.1, "frames": 1}, "body": [{"name": "b", "generate": {"ball": {"radius": 0.5, "cell": 0.25}}}]}"#;
    folder.put("s.json", json);
    assert_eq!(go(&folder, "simulate s.json --out d --quiet").code, 0);
    let shown = go(&folder, "simulate s.json --show-settings");
    assert!(shown.code == 0 && shown.stdout.contains("integrator = \"implicit-euler\""), "{}", shown.stdout);
    let schema: Value = serde_json::from_str(&go(&folder, "schema scene").stdout).unwrap();
    assert!(schema["properties"]["time"].is_object() && schema["properties"]["body"].is_object(), "{schema}");
    let late = go(&folder, "simulate s.json --out d --quiet --frames 100000 --time-limit 0.5");
    assert_eq!(late.code, 3, "{}", late.stderr);
    let report = report(&folder, "d");
    assert!(report["reason"].as_str().unwrap().contains("--time-limit"), "{}", report["reason"]);
    let frames = report["frames"].as_array().unwrap().len();
    assert!(folder.has(&format!("d/b_{:04}.vtu", frames - 1)) && !folder.has(&format!("d/b_{frames:04}.vtu")));
}
