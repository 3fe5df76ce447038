//! `proxel unwrap --bijective` on a ramp whose flat map winds over itself.

mod common;
use common::Folder;
use std::fmt::Write as _;

/// One turn and a quarter around a pillar, as `ramp.obj`.
fn ramp(name: &str) -> Folder {
    let folder = Folder::new(name);
    let (along, mut text) = (50, String::new());
    for i in 0..=along {
        let angle = 0.05 * std::f64::consts::PI * f64::from(i);
        for radius in [1.0, 1.2, 1.4] {
            writeln!(text, "v {} {} {}", radius * angle.cos(), radius * angle.sin(), 0.1 * angle).unwrap();
        }
    }
    for a in (0..along).flat_map(|i| [3 * i + 1, 3 * i + 2]) {
        writeln!(text, "f {a} {} {} {}", a + 1, a + 4, a + 3).unwrap();
    }
    folder.put("ramp.obj", &text);
    folder
}

#[test]
fn the_file_has_no_overlaps_and_the_report_says_so() {
    let folder = ramp("bijective");
    let report = || -> serde_json::Value { serde_json::from_str(&folder.read("r.json")).unwrap() };
    folder.run("unwrap ramp.obj --out free.obj --report r.json").is(0);
    let free = report();
    assert!(free["overlaps"].as_u64().unwrap() > 0, "{free}");
    for out in ["map.obj", "map.ply"] {
        folder.run(&format!("unwrap ramp.obj --bijective --out {out} --report r.json")).is(0);
        let map = report();
        assert_eq!(map["settings"]["bijective"], true);
        assert_eq!((&map["overlaps"], &map["boundary_crossings"], &map["flips"]), (&0.into(), &0.into(), &0.into()));
        assert!(map["energy"].as_f64().unwrap() < 1.05 * free["energy"].as_f64().unwrap(), "{map}");
    }
}

#[test]
fn pins_are_refused() {
    let folder = ramp("bijective-pins");
    folder.put("pins.txt", "0 0 0\n");
    let run = folder.run("unwrap ramp.obj --bijective --pin pins.txt --out map.obj");
    run.is(2);
    assert!(!folder.has("map.obj") && run.err.contains("--pin"), "{run:?}");
}
