//! What `proxel unwrap` is told: seams, starts, pins, weights, target metrics.

mod common;

use common::Folder;
use common::maps::{close, folder, mapped, maps, report, unwrap};
use common::surface::{Mapped, Surface};

#[test]
fn seams_of_a_file() {
    let n = 12;
    let folder = folder("seams", &Surface::patch(n));
    let column = |i: usize| (n / 2 * (n + 1) + i) as u32;
    let path = |edges: usize| (0..edges).map(|i| format!("{}, {}\n", column(i), column(i + 1))).collect::<String>();
    // From the border into the middle: still one chart, and each vertex along it but the last has two places.
    folder.put("seam.txt", &format!("# half\n{}", path(n / 2)));
    let (r, map) = maps(&folder, "--no-pack --seams seam.txt");
    assert_eq!(r["charts"], 1);
    let cut: Vec<usize> = map.places().iter().filter(|(_, p)| p.len() == 2).map(|(v, _)| *v).collect();
    assert_eq!(cut, (0..n / 2).map(|i| column(i) as usize).collect::<Vec<_>>());
    let length: f64 = (0..n / 2).map(|i| distance(&map, column(i), column(i + 1))).sum();
    let box_ = [0, 1, 2].map(|k| {
        let (low, high) = map.points.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        high - low
    });
    let diagonal = box_.iter().map(|d| d * d).sum::<f64>().sqrt();
    close(r["seam_length"].as_f64().unwrap(), length / diagonal, 1e-12);

    // From border to border.
    folder.put("seam.txt", &path(n));
    let (r, _) = maps(&folder, "--no-pack --seams seam.txt");
    assert_eq!(r["charts"], 2);
}

/// Distance of two vertices on the surface.
fn distance(map: &Mapped, a: u32, b: u32) -> f64 {
    let (p, q) = (map.points[a as usize], map.points[b as usize]);
    [0, 1, 2].map(|k| (p[k] - q[k]).powi(2)).iter().sum::<f64>().sqrt()
}

#[test]
fn texture_coordinates_of_the_file_are_ignored_or_seams_or_the_start() {
    let n = 12;
    let folder = folder("vt", &Surface::patch(n));
    let column: String = (0..n).map(|i| format!("{} {}\n", n / 2 * (n + 1) + i, n / 2 * (n + 1) + i + 1)).collect();
    folder.put("seam.txt", &column);
    unwrap(&folder, "--no-pack --seams seam.txt --max-iters 1").is(3);
    let cut = folder.read("out.obj");
    folder.put("in.obj", &cut);

    let (r, ignored) = maps(&folder, "--no-pack");
    assert_eq!(r["charts"], 1);
    let fresh = Folder::new("unwrap-vt-fresh");
    fresh.put("in.obj", &Surface::patch(n).obj());
    assert_eq!(ignored, maps(&fresh, "--no-pack").1);

    let (seams, as_seams) = maps(&folder, "--no-pack --seams vt");
    assert_eq!(seams["charts"], 2);
    // From the coordinates along their seams: to the same energy from a start that is better.
    let (start, _) = maps(&folder, "--no-pack --from-uv --trace t.csv");
    assert_eq!(start["charts"], 2, "they are the seams, too");
    close(start["energy"].as_f64().unwrap(), as_seams.energy(), 1e-9);
    let row: Vec<f64> = folder.read("t.csv").lines().nth(1).unwrap().split(',').map(|w| w.parse().unwrap()).collect();
    close(row[2], Mapped::parse(&cut).energy(), 1e-9);
}

#[test]
fn pinned_vertices_come_out_bit_for_bit() {
    let folder = folder("pins", &Surface::patch(12));
    let pins = [(0u32, [0.1, 0.2]), (12, [0.3, 6.3 / 3.0]), (168, [2.2, 2.0 / 3.0 + 2.0])];
    let text: String = pins.iter().map(|(v, p)| format!("{v} {} {}\n", p[0], p[1])).collect();
    folder.put("pins.txt", &text);
    for options in ["--no-pack --pin pins.txt", "--pin pins.txt", "--pin pins.txt --method wrapd"] {
        unwrap(&folder, options).is(0);
        let places = mapped(&folder).places();
        for (v, p) in &pins {
            assert_eq!(places[&(*v as usize)], [*p], "{options}");
        }
        assert_eq!(report(&folder)["flips"], 0);
    }
    folder.put("pins.txt", "0 0 0\n0 1 1\n");
    unwrap(&folder, "--pin pins.txt").is_refused(&["vertex 0", "pin"]);
}

#[test]
fn what_counts_more_is_distorted_less() {
    let n = 16;
    let folder = folder("weights", &Surface::patch(n));
    let (_, plain) = maps(&folder, "--no-pack");
    let heavy = n * n; // the first half of the faces
    let mean = |map: &Mapped| {
        let (sum, area) = map.energies()[..heavy].iter().fold((0.0, 0.0), |(s, t), (a, e)| (s + a * (e - 1.0), t + a));
        sum / area
    };
    let faces: String = (0..2 * n * n).map(|f| if f < heavy { "100 " } else { "1\n" }).collect();
    folder.put("weights.txt", &faces);
    let (_, by_face) = maps(&folder, "--no-pack --weights weights.txt");
    assert!(mean(&by_face) < 0.9 * mean(&plain), "{} and {}", mean(&by_face), mean(&plain));
    assert!(by_face.energy() > plain.energy(), "the rest pays for it");
    let vertices: String = (0..(n + 1) * (n + 1)).map(|v| if v <= n * (n + 1) / 2 { "100\n" } else { "1\n" }).collect();
    folder.put("weights.txt", &vertices);
    let (_, by_vertex) = maps(&folder, "--no-pack --weights weights.txt");
    assert!(mean(&by_vertex) < 0.9 * mean(&plain), "{} and {}", mean(&by_vertex), mean(&plain));
    // The same weight everywhere changes nothing but the unit of energy.
    folder.put("weights.txt", &"4 ".repeat(2 * n * n));
    let (_, same) = maps(&folder, "--no-pack --weights weights.txt");
    let worst = same.uv.iter().zip(&plain.uv).fold(0.0, |m: f64, (a, b)| m.max((a[0] - b[0]).hypot(a[1] - b[1])));
    assert!(worst < 1e-7 * plain.size(), "{worst:e}");
}

#[test]
fn target_metrics_say_how_long_edges_become() {
    let n = 12;
    let folder = folder("metric", &Surface::patch(n));
    let (_, plain) = maps(&folder, "--no-pack");
    // The same factor everywhere scales the map; blanks and commas part the numbers of a tensor.
    folder.put("metric.txt", &"2.5\n".repeat(2 * n * n));
    let (report, scaled) = maps(&folder, "--no-pack --metric metric.txt");
    close(scaled.size() / plain.size(), 2.5, 1e-7);
    close(report["energy"].as_f64().unwrap(), plain.energy(), 1e-9);
    close(report["energy_target"].as_f64().unwrap(), plain.energy(), 1e-9);
    // Twice as long along x only: flatter against the target than against the surface.
    folder.put("metric.txt", &"4, 0 0  1 0 1 # along x\n".repeat(2 * n * n));
    let (report, _) = maps(&folder, "--no-pack --metric metric.txt");
    let (energy, target) = (report["energy"].as_f64().unwrap(), report["energy_target"].as_f64().unwrap());
    assert!(target < 1.2 && energy > 1.1 * target, "{energy} {target}");
    for (text, words) in [
        ("1\n".to_string(), ["1 metrics", "faces"]),
        ("1 2\n".to_string(), ["line 1", "2 words"]),
        ("-1\n".to_string(), ["line 1", "not positive"]),
        ("1 2 0 1 0 1\n".repeat(2 * n * n), ["face 0", "positive definite"]),
    ] {
        folder.put("metric.txt", &text);
        unwrap(&folder, "--metric metric.txt").is_refused(&words);
    }
}
