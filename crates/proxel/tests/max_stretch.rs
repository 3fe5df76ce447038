//! The bound on stretch: it holds, with few cuts, and costs nothing where it holds already.

use std::collections::BTreeMap;

use proxel::mesh::Mesh;
use proxel::mesh::generate::cloth;
use proxel::settings::UnwrapSettings;
use proxel::unwrap::{Hooks, UnwrapInput, Unwrapped, unwrap};

fn run(mesh: &Mesh, max_stretch: Option<f64>) -> Unwrapped {
    let settings = UnwrapSettings { max_stretch, pack: false, ..UnwrapSettings::default() };
    unwrap(&UnwrapInput { mesh: mesh.clone(), ..UnwrapInput::default() }, &settings, &mut Hooks::default()).unwrap()
}

/// Largest max(s1, 1 / s2) over the triangles, from the eigenvalues of J^T J; all charts in their own scale.
fn worst(mesh: &Mesh, map: &Unwrapped) -> f64 {
    let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let mut corner = 0;
    let mut worst = 0.0f64;
    for face in mesh.faces.iter() {
        let [a, b, c] = [0, 1, 2].map(|k| mesh.points[face[k] as usize]);
        let [p, q, r] = [0, 1, 2].map(|k| map.uv.at(corner + k).unwrap());
        corner += face.len();
        // The metrics on the surface and in the map; generalised eigenvalues are the squares of the stretches.
        let (e, f) = (minus(b, a), minus(c, a));
        let g = [dot(e, e), dot(e, f), dot(f, f)];
        let (u, v) = ([q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]]);
        let h = [u[0] * u[0] + u[1] * u[1], u[0] * v[0] + u[1] * v[1], v[0] * v[0] + v[1] * v[1]];
        let det = g[0] * g[2] - g[1] * g[1];
        let trace = (g[2] * h[0] - 2.0 * g[1] * h[1] + g[0] * h[2]) / det;
        let product = (h[0] * h[2] - h[1] * h[1]) / det;
        let root = (0.25 * trace * trace - product).max(0.0).sqrt();
        let large = 0.5 * trace + root;
        worst = worst.max(large.sqrt()).max((large / product).sqrt());
    }
    worst
}

/// An octahedron, refined and blown up.
fn sphere(levels: usize) -> Mesh {
    let mut points =
        vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let mut triangles: Vec<[u32; 3]> = (0..4).flat_map(|k| [[k, (k + 1) % 4, 4], [(k + 1) % 4, k, 5]]).collect();
    for _ in 0..levels {
        let mut middle = BTreeMap::new();
        let mut fine = Vec::new();
        for t in triangles {
            let m = [0, 1, 2].map(|k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let (p, q): ([f64; 3], [f64; 3]) = (points[a as usize], points[b as usize]);
                    let sum = [0, 1, 2].map(|d| p[d] + q[d]);
                    let norm = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                    points.push(sum.map(|x| x / norm));
                    points.len() as u32 - 1
                })
            });
            fine.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
        }
        triangles = fine;
    }
    Mesh::from_triangles("sphere", points, &triangles)
}

/// A sheet with a bump in the middle, three times as high as wide.
fn bump() -> Mesh {
    let mut mesh = cloth([40, 40], [4.0, 4.0]).unwrap();
    let (low, high) = mesh.bounding_box().unwrap();
    let flat = (0..3).min_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap();
    for p in &mut mesh.points {
        let r2: f64 = (0..3).filter(|&d| d != flat).map(|d| (p[d] - 0.5 * (low[d] + high[d])).powi(2)).sum();
        p[flat] = 1.5 * (-4.0 * r2).exp();
    }
    mesh
}

#[test]
fn a_sphere_keeps_the_bound_with_few_charts() {
    let mesh = sphere(4);
    let free = run(&mesh, None);
    assert_eq!(free.charts.charts.len(), 1);
    assert!(worst(&mesh, &free) > 1.5, "the bound is one");
    let held = run(&mesh, Some(1.5));
    assert!(worst(&mesh, &held) <= 1.5 + 1e-9, "{}", worst(&mesh, &held));
    assert!(held.charts.charts.len() <= 4, "{} charts", held.charts.charts.len());
    assert!(held.report.warnings.is_empty(), "{:?}", held.report.warnings);
    let cuts = held.report.map.unwrap().stretch_cuts;
    assert!((1..=6).contains(&cuts), "{cuts} cuts");
    // All faces are there, each once, and the same comes out again.
    assert_eq!(held.charts.charts.iter().map(|c| c.triangles.len()).sum::<usize>(), mesh.faces.len());
    assert_eq!(run(&mesh, Some(1.5)).uv, held.uv);
}

#[test]
fn a_bump_is_cut_open() {
    let mesh = bump();
    let free = run(&mesh, None);
    assert!(free.charts.seams.is_empty() && worst(&mesh, &free) > 1.6);
    let held = run(&mesh, Some(1.6));
    assert!(worst(&mesh, &held) <= 1.6 + 1e-9, "{}", worst(&mesh, &held));
    assert!(held.charts.charts.len() <= 4, "{} charts", held.charts.charts.len());
    assert!(held.report.energy < free.report.energy);
}

#[test]
fn a_bound_that_holds_changes_nothing() {
    let mesh = bump();
    let free = run(&mesh, None);
    let held = run(&mesh, Some(worst(&mesh, &free) + 0.01));
    assert_eq!((held.uv, held.charts), (free.uv, free.charts));
    assert_eq!(held.report.map.unwrap().stretch_cuts, 0);
}

#[test]
fn what_no_cut_can_hold_is_said_and_not_splintered() {
    let mesh = sphere(1);
    let held = run(&mesh, Some(1.0001));
    assert!(held.charts.charts.iter().all(|c| c.triangles.len() >= 8));
    let warnings = held.report.warnings;
    assert!(warnings.iter().any(|w| w.contains("more than 1.0001")), "{warnings:?}");
}

#[test]
fn pinned_charts_stay_whole() {
    let mesh = bump();
    let settings = UnwrapSettings { max_stretch: Some(1.2), pack: false, ..UnwrapSettings::default() };
    let input = UnwrapInput { mesh, pins: vec![(0, [0.0, 0.0])], ..UnwrapInput::default() };
    let held = unwrap(&input, &settings, &mut Hooks::default()).unwrap();
    assert_eq!(held.charts.charts.len(), 1);
    assert!(held.report.warnings[0].contains("it has pins"), "{:?}", held.report.warnings);
}

#[test]
fn bounds_of_1_and_less_are_refused() {
    for bound in [1.0, 0.5, -2.0, f64::NAN, f64::INFINITY] {
        let settings = UnwrapSettings { max_stretch: Some(bound), ..UnwrapSettings::default() };
        let e = settings.check().unwrap_err();
        assert!(e.contains("--max-stretch") && e.contains("above 1"), "{e}");
    }
    let settings = UnwrapSettings { max_stretch: Some(2.0), fixed_boundary: true, ..UnwrapSettings::default() };
    assert!(settings.check().unwrap_err().contains("--fixed-boundary"));
}
