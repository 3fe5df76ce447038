//! Wire meshes: edges, angles, refusals, counts on the paper's mesh.

use proxel::deform::Hooks;
use proxel::mesh::topology::face_edges;
use proxel::mesh::{Mesh, Polygons, read_mesh};
use proxel::report::TraceRow;
use proxel::shape::{ShapeInput, ShapeMethod, ShapeReport, Shaped, WireSettings, subdivide, wire};
use proxel::split::{Status, normalized};
use std::path::PathBuf;

/// A cap of n x n quads, whose edges differ in length by a third.
fn cap(n: usize) -> Mesh {
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            let [x, y] = [i, j].map(|k| 2.0 * k as f64 / n as f64 - 1.0);
            points.push([x, y + 0.05 * (3.0 * x).sin(), 0.5 * (1.0 - 0.5 * x * x - 0.7 * y * y)]);
        }
    }
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut faces = Polygons::new();
    for i in 0..n {
        for j in 0..n {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Mesh { name: "cap".to_string(), points, faces, ..Mesh::default() }
}

fn run(mesh: &Mesh, settings: &WireSettings) -> Shaped {
    let input = ShapeInput { mesh: mesh.clone(), reference: None };
    wire(&input, settings, &mut Hooks::default()).expect("a mesh that can be shaped")
}

fn told(shaped: &Shaped) -> &ShapeReport {
    shaped.report.shape.as_ref().expect("a report of shapes")
}

fn lengths(points: &[[f64; 3]], mesh: &Mesh) -> Vec<f64> {
    let of = |[a, b]: [u32; 2]| {
        let (a, b) = (points[a as usize], points[b as usize]);
        (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
    };
    face_edges(&mesh.faces).into_iter().map(of).collect()
}

/// All angles of faces, in degrees, by the cosine: another way than that of the set.
fn angles(points: &[[f64; 3]], mesh: &Mesh) -> Vec<f64> {
    let mut out = Vec::new();
    for face in mesh.faces.iter() {
        for i in 0..face.len() {
            let p = |k: usize| points[face[k % face.len()] as usize];
            let side = |k: usize| [0, 1, 2].map(|d| p(k)[d] - p(i)[d]);
            let (a, b) = (side(i + 1), side(i + face.len() - 1));
            let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
            out.push((dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()).clamp(-1.0, 1.0).acos().to_degrees());
        }
    }
    out
}

#[test]
fn edges_get_one_length_and_angles_their_range() {
    let mesh = cap(12);
    let length = 0.17;
    let settings =
        WireSettings { edge_length: Some(length), min_angle: 70.0, max_angle: 110.0, ..WireSettings::default() };
    let shaped = run(&mesh, &settings);
    assert_eq!(shaped.status, Status::Converged, "{}", shaped.report.reason);
    // Measured anew on what is returned.
    let off =
        |points: &[[f64; 3]]| lengths(points, &mesh).iter().map(|l| (l - length).abs() / length).fold(0.0, f64::max);
    assert!(off(&mesh.points) > 0.1 && off(&shaped.positions) < 1e-9, "{}", off(&shaped.positions));
    let outside =
        |points: &[[f64; 3]]| angles(points, &mesh).iter().map(|a| (70.0 - a).max(a - 110.0)).fold(0.0, f64::max);
    assert!(outside(&shaped.positions) < 1e-7, "{} degrees", outside(&shaped.positions));
    let report = told(&shaped);
    let edge = report.edge_error_max.expect("edges are told");
    assert!((edge.before - off(&mesh.points)).abs() < 1e-12 && edge.after < 1e-9, "{edge:?}");
    assert!(report.planarity_max.is_none() && report.violated.is_empty(), "{report:?}");
    assert_eq!(
        shaped.faces.iter().map(|f| (&f.name[..], f.after.len())).collect::<Vec<_>>(),
        [("edge_error", 144), ("angle_error", 144)]
    );
    // No farther from the cap than the splitting by itself leaves it.
    let mut plain = settings.clone();
    (plain.shape.method, plain.shape.max_iters) = (ShapeMethod::AaAdmm, 1000);
    let distance = |s: &Shaped| told(s).reference_distance_mean.expect("distances are told").after;
    let splitting = run(&mesh, &plain);
    assert!(distance(&shaped) <= 1.05 * distance(&splitting), "{} {}", distance(&shaped), distance(&splitting));
}

#[test]
fn lengths_that_cannot_be_are_told() {
    // A triangle in a quad mesh: its angles cannot all be above 70 degrees.
    let mut mesh = cap(4);
    let faces: Vec<Vec<u32>> = mesh.faces.iter().map(<[u32]>::to_vec).collect();
    mesh.faces = Polygons::new();
    faces[1..].iter().for_each(|f| mesh.faces.push(f));
    mesh.faces.push(&faces[0][..3]);
    let mut settings = WireSettings { min_angle: 70.0, max_angle: 110.0, ..WireSettings::default() };
    settings.shape.max_iters = 400;
    let shaped = run(&mesh, &settings);
    assert_eq!(shaped.status, Status::Stopped, "{}", shaped.report.reason);
    let worst = &told(&shaped).violated;
    let triangle = |v: &&proxel::shape::Violated| v.kind == "angle" && v.vertices.iter().all(|n| faces[0].contains(n));
    assert!(worst.iter().any(|v| triangle(&v) && v.violation > 1.0), "{worst:?}");
    assert!(shaped.positions.iter().flatten().all(|c| c.is_finite()));
}

#[test]
fn the_same_bits_on_any_number_of_threads_and_the_same_shape_in_any_unit() {
    let mesh = cap(8);
    let mut settings = WireSettings { edge_length: Some(0.25), ..WireSettings::default() };
    settings.shape.threads = Some(1);
    let one = run(&mesh, &settings);
    settings.shape.threads = Some(3);
    assert_eq!(one.positions, run(&mesh, &settings).positions);
    let mut large = mesh.clone();
    large.points.iter_mut().for_each(|p| *p = p.map(|c| 1e3 * c));
    settings.edge_length = Some(250.0);
    let shaped = run(&large, &settings);
    assert_eq!(shaped.status, Status::Converged);
    let apart = one.positions.iter().flatten().zip(shaped.positions.iter().flatten());
    let apart = apart.map(|(a, b)| (a - b / 1e3).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-9, "{apart}");
}

/// Zhang et al. 2019, Figure 7: iterations to 1e-3 of plain ADMM and of m = 6, from a rounder subdivision than theirs.
#[test]
fn iterations_on_the_torso() {
    let Some(data) = std::env::var_os("PROXEL_DATA").map(PathBuf::from) else {
        eprintln!("skipped: PROXEL_DATA names no folder with geometry/MaleTorso.obj");
        return;
    };
    let read = |name: &str| read_mesh(&data.join("geometry").join(name)).expect("a mesh of the data");
    let mesh = subdivide(&read("MaleTorso.obj")).expect("a surface");
    assert_eq!((mesh.n_verts(), mesh.faces.len()), (230_400, 229_440));
    let input = ShapeInput { mesh, reference: Some(read("MaleTorso_target.obj")) };
    for (method, most) in [(ShapeMethod::Admm, 13), (ShapeMethod::AaAdmm, 6)] {
        let mut settings = WireSettings { edge_length: Some(1.34), ..WireSettings::default() };
        (settings.shape.method, settings.shape.max_iters) = (method, most);
        let mut rows: Vec<TraceRow> = Vec::new();
        let mut note = |row: &TraceRow| rows.push(*row);
        let mut hooks = Hooks { trace: Some(&mut note), ..Hooks::default() };
        let shaped = wire(&input, &settings, &mut hooks).expect("a mesh that can be shaped");
        let report = told(&shaped);
        assert!((report.mean_edge - 1.34).abs() < 1e-3, "{}", report.mean_edge);
        if method == ShapeMethod::AaAdmm {
            let merit = rows.last().expect("rows").merit;
            let scale = (report.mean_edge).log2().round().exp2();
            let residual = normalized(merit / settings.shape.mu, 6_886_080, report.mean_edge / scale);
            assert!(residual <= 1e-3, "{residual}");
        }
        let edge = report.edge_error_mean.expect("edges are told");
        assert!(edge.after < edge.before, "{edge:?}");
    }
}
