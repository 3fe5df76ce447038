//! `proxel geodesic`: files in, files out, and what it refuses.

mod common;
use common::Folder;
use serde_json::Value;
use std::fmt::Write as _;

/// A square of n x n cells of unit length, as `plate.obj`, and a vertex that no face uses.
fn plate(name: &str, n: usize) -> Folder {
    let folder = Folder::new(name);
    let mut text = String::new();
    for i in 0..=n {
        for j in 0..=n {
            writeln!(text, "v {i} {j} 0").unwrap();
        }
    }
    for i in 0..n {
        for j in 0..n {
            let a = i * (n + 1) + j + 1;
            writeln!(text, "f {a} {} {} {}", a + n + 1, a + n + 2, a + 1).unwrap();
        }
    }
    writeln!(text, "v 99 99 99").unwrap();
    folder.put("plate.obj", &text);
    folder
}

fn report(folder: &Folder) -> Value {
    serde_json::from_str(&folder.read("r.json")).unwrap()
}

#[test]
fn distances_as_attributes_and_as_a_list() {
    let folder = plate("geodesic", 30);
    folder.run("geodesic plate.obj --source 0 --out d.csv --report r.json --preview d.png").is(0);
    let list = folder.read("d.csv");
    let distance: Vec<f64> =
        list.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert_eq!((list.lines().next(), distance.len()), (Some("vertex,distance"), 962));
    // Coarse as it is, the heat method is a few per cent short.
    assert!((distance[30] - 30.0).abs() < 1.5 && (distance[960] - 1800f64.sqrt()).abs() < 1.5, "{distance:?}");
    assert!(distance[0].abs() < 1e-12 && distance[961] == f64::INFINITY);
    let r = report(&folder);
    assert_eq!(
        (&r["command"], &r["status"], &r["method"]),
        (&"geodesic".into(), &"converged".into(), &"poisson".into())
    );
    assert_eq!((&r["sources"], &r["unreached_vertices"]), (&serde_json::json!([0]), &1.into()));
    assert!(r["warnings"][0].as_str().unwrap().contains("no path leads"), "{r}");
    let far = distance.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max);
    assert_eq!(r["distance_max"].as_f64(), Some(far));
    // The nearest of two sources.
    folder.run("geodesic plate.obj --source 0,960 --out d.vtu --report r.json --quiet").is(0);
    assert!(folder.has("d.vtu"));
    assert!(report(&folder)["distance_max"].as_f64().unwrap() < 32.0);
    folder
        .run("geodesic plate.obj --source 0 --out d.ply --method aa-admm --tol 1e-6 --trace t.csv --report r.json")
        .is(0);
    let (r, trace) = (report(&folder), folder.read("t.csv"));
    let ply = std::fs::read(folder.0.join("d.ply")).unwrap();
    assert!(ply.windows(15).any(|w| w == b"double distance"));
    assert_eq!(trace.lines().count() as u64, r["iterations"].as_u64().unwrap() + 2);
    folder.run("geodesic plate.obj --source 0 --out d.ply --method admm --max-iters 3").is(3);
}

#[test]
fn refusals() {
    let folder = plate("geodesic-refusals", 2);
    folder.run("geodesic plate.obj --source 77 --out d.ply").is_refused(&["source 77 is no vertex", "there are 10"]);
    folder.run("geodesic plate.obj --source 0 --out d.obj").is_refused(&["d.obj", "no place for distances", ".csv"]);
    folder.run("geodesic plate.obj --source 0 --out d.ply --time 0").is_refused(&["--time is 0"]);
    folder.run("geodesic plate.obj --source 0,x --out d.ply").is_refused(&["--source"]);
    folder.run("geodesic plate.obj --out d.ply").is_refused(&["--source"]);
    folder.run("geodesic nothing.obj --source 0 --out d.ply").is_refused(&["nothing.obj"]);
    folder.put("points.obj", "v 0 0 0\nv 1 0 0\n");
    folder.run("geodesic points.obj --source 0 --out d.ply").is_refused(&["points.obj", "no faces"]);
    assert!(!folder.has("d.ply"));
    let settings: Value = serde_json::from_str(&folder.run("geodesic --show-settings").is(0).out).unwrap();
    assert_eq!(settings["method"], "auto");
}
