//! Planar faces: results, invariances, counts on the paper's meshes, refusals.

use proxel::deform::Hooks;
use proxel::mesh::{Mesh, Polygons, read_mesh};
use proxel::report::TraceRow;
use proxel::shape::{ShapeInput, ShapeMethod, ShapeReport, ShapeSettings, Shaped, edge_lengths, planarity, planarize};
use proxel::split::Status;
use std::path::PathBuf;

/// A wavy roof of quads, with a hexagon in place of two of them and two triangles in place of another.
fn roof(n: usize) -> Mesh {
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (i as f64, j as f64);
            points.push([
                x,
                y + 0.1 * (0.7 * x).sin(),
                (0.35 * x).sin() * 1.5 + (0.4 * y + 0.2 * x).cos() + 0.02 * x * y,
            ]);
        }
    }
    let mut faces = Polygons::new();
    for i in 0..n {
        for j in 0..n {
            let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            match (i, j) {
                (2, 1) => faces.push(&[at(2, 1), at(3, 1), at(3, 2), at(3, 3), at(2, 3), at(2, 2)]),
                (2, 2) => {}
                (0, 0) => {
                    faces.push(&[quad[0], quad[1], quad[2]]);
                    faces.push(&[quad[0], quad[2], quad[3]]);
                }
                _ => faces.push(&quad),
            }
        }
    }
    Mesh { name: "roof".to_string(), points, faces, ..Mesh::default() }
}

fn run(mesh: &Mesh, settings: &ShapeSettings) -> Shaped {
    let input = ShapeInput { mesh: mesh.clone(), reference: None };
    planarize(&input, settings, &mut Hooks::default()).expect("a mesh that can be shaped")
}

fn told(shaped: &Shaped) -> &ShapeReport {
    shaped.report.shape.as_ref().expect("a report of shapes")
}

#[test]
fn faces_become_planar_and_stay_near() {
    let mesh = roof(8);
    let shaped = run(&mesh, &ShapeSettings::planarize());
    assert_eq!(shaped.status, Status::Converged, "{}", shaped.report.reason);
    let (mean, shortest) = edge_lengths(&mesh.points, &mesh.faces);
    // Measured anew on what is returned.
    let after = planarity(&shaped.positions, &mesh.faces);
    assert!(after.iter().all(|h| *h <= 1e-10 * mean), "{:?}", after.iter().copied().fold(0.0, f64::max));
    assert!(planarity(&mesh.points, &mesh.faces).iter().any(|h| *h > 0.01 * mean), "it was not planar before");
    assert!(edge_lengths(&shaped.positions, &mesh.faces).1 >= 0.5 * shortest);
    let report = told(&shaped);
    let max = report.planarity_max.expect("planarity is told");
    assert!((max.after * mean - after.iter().copied().fold(0.0, f64::max)).abs() < 1e-12 * mean);
    assert!(report.planarity_diagonals_max.is_some_and(|c| c.after < 1e-9 && c.before > 0.01));
    assert!(report.reference_distance_mean.is_some_and(|c| c.before == 0.0 && c.after < 0.4), "{report:?}");
    assert!(report.violated.is_empty());
    // The splittings come as near as their residuals say, and to the same shape.
    let settings = ShapeSettings { method: ShapeMethod::AaAdmm, max_iters: 400, ..ShapeSettings::planarize() };
    let accelerated = run(&mesh, &settings);
    let worst = told(&accelerated).planarity_max.expect("planarity is told").after;
    assert!(worst < 1e-4 && worst > max.after, "{worst}");
    let distance = |s: &Shaped| told(s).reference_distance_mean.expect("distances are told").after;
    assert!(distance(&shaped) <= 1.05 * distance(&accelerated), "{} {}", distance(&shaped), distance(&accelerated));
}

#[test]
fn without_room_for_a_factor_the_splitting_goes_on() {
    let mesh = roof(5);
    let settings = ShapeSettings { memory: 1.0, max_iters: 600, ..ShapeSettings::planarize() };
    let shaped = run(&mesh, &settings);
    assert!(shaped.report.reason.contains("would take 0.0 GB of 0.0 (--memory)"), "{}", shaped.report.reason);
    // As far as the splitting alone gets, and on from where it would have been left.
    let left = run(&mesh, &ShapeSettings { memory: 8e9, ..settings.clone() });
    assert!(
        shaped.report.iterations > left.report.iterations,
        "{} {}",
        shaped.report.iterations,
        left.report.iterations
    );
    assert_eq!((shaped.report.refactorisations, left.status), (0, Status::Converged));
    let bad = ShapeSettings { memory: 0.0, ..settings };
    let refused = planarize(&ShapeInput { mesh, reference: None }, &bad, &mut Hooks::default());
    assert!(refused.is_err_and(|e| e.to_string().contains("--memory is 0")));
}

#[test]
fn units_origin_and_threads_do_not_matter() {
    let mesh = roof(5);
    let settings = ShapeSettings { threads: Some(1), ..ShapeSettings::planarize() };
    let base = run(&mesh, &settings);
    let on_three = run(&mesh, &ShapeSettings { threads: Some(3), ..settings.clone() });
    assert_eq!(base.positions, on_three.positions, "the same bits on any number of threads");
    let size = 8.0;
    for (scale, shift, tolerance) in [(1024.0, 0.0, 1e-15), (3e5, 0.0, 1e-9), (1.0, 1e6, 1e-7)] {
        let moved = |p: &[f64; 3]| p.map(|c| scale * c + shift);
        let other = Mesh { points: mesh.points.iter().map(moved).collect(), ..mesh.clone() };
        let other = run(&other, &settings);
        for (p, q) in base.positions.iter().zip(&other.positions) {
            let off = moved(p).iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off <= tolerance * size * scale, "{scale} {shift}: {off}");
        }
    }
}

#[test]
fn what_is_planar_stays() {
    let mut mesh = roof(4);
    mesh.points.iter_mut().for_each(|p| p[2] = 0.5 * p[0] - 0.25 * p[1]);
    // A vertex of no face stays where it is, bit for bit.
    mesh.points.push([0.1, 1e3 / 3.0, -7.7]);
    let shaped = run(&mesh, &ShapeSettings::planarize());
    assert_eq!(shaped.status, Status::Converged, "{}", shaped.report.reason);
    assert_eq!(shaped.positions.last(), mesh.points.last());
    for (p, q) in mesh.points.iter().zip(&shaped.positions) {
        assert!((0..3).all(|d| (p[d] - q[d]).abs() < 1e-9), "{p:?} {q:?}");
    }
    assert!(
        shaped.report.warnings.iter().any(|w| w.contains("1 vertices are in no face")),
        "{:?}",
        shaped.report.warnings
    );
}

#[test]
fn bad_input_is_refused_by_name() {
    let refused = |mesh: Mesh, reference: Option<Mesh>| {
        planarize(&ShapeInput { mesh, reference }, &ShapeSettings::planarize(), &mut Hooks::default())
            .expect_err("refused")
            .to_string()
    };
    let with = |face: &[u32]| {
        let mut mesh = roof(3);
        mesh.faces.push(face);
        mesh
    };
    assert!(refused(with(&[0, 1]), None).contains("has 2 corners"));
    let text = refused(with(&[0, 1, 2, 1]), None);
    assert!(text.contains("occurs twice"), "{text}");
    assert!(refused(with(&[0, 1, 99]), None).contains("out of range"));
    assert!(refused(Mesh { faces: Polygons::new(), ..roof(3) }, None).contains("has no faces"));
    let flat = Mesh { points: vec![[1.0; 3]; 16], ..roof(3) };
    assert!(refused(flat.clone(), None).contains("extent"));
    assert!(refused(roof(3), Some(flat)).contains("no face of it has an area"));
    let mut nan = roof(3);
    nan.points[4][1] = f64::NAN;
    assert!(refused(nan, None).contains("NaN"));
    let settings = ShapeSettings { mu: -1.0, ..ShapeSettings::planarize() };
    let text = planarize(&ShapeInput { mesh: roof(3), reference: None }, &settings, &mut Hooks::default());
    assert!(text.is_err_and(|e| e.to_string().contains("--mu is -1")));
}

#[test]
fn odd_surfaces_are_shaped_and_told_of() {
    // A face collapsed to a point, three faces on an edge, and a second component.
    let mut mesh = roof(4);
    let first = mesh.points.len() as u32;
    mesh.points.extend([[9.0, 9.0, 9.0]; 4]);
    mesh.faces.push(&[first, first + 1, first + 2, first + 3]);
    mesh.points.extend([
        [1.0, 1.0, 5.0],
        [2.0, 1.0, 5.2],
        [20.0, 0.0, 0.0],
        [21.0, 0.0, 0.0],
        [21.0, 1.0, 0.1],
        [20.0, 1.0, 0.0],
    ]);
    mesh.faces.push(&[6, 11, first + 5, first + 4]);
    mesh.faces.push(&[first + 6, first + 7, first + 8, first + 9]);
    let shaped = run(&mesh, &ShapeSettings { max_iters: 3000, ..ShapeSettings::planarize() });
    assert!(shaped.report.warnings.iter().any(|w| w.contains("1 faces are collapsed")), "{:?}", shaped.report.warnings);
    assert!(shaped.positions.iter().flatten().all(|c| c.is_finite()));
    let (mean, _) = edge_lengths(&mesh.points, &mesh.faces);
    let worst = planarity(&shaped.positions, &mesh.faces).into_iter().fold(0.0, f64::max) / mean;
    match shaped.status {
        Status::Converged => assert!(worst <= 1e-10, "{worst}"),
        _ => assert!(worst < 1e-3 && !told(&shaped).violated.is_empty(), "{worst} {}", shaped.report.reason),
    }
}

/// Iterations to a normalised combined residual without mu of 1e-3, and what the report says after `most`.
fn counts(name: &str, anderson: usize, most: usize) -> Option<(Option<usize>, ShapeReport)> {
    let folder = PathBuf::from(std::env::var_os("PROXEL_DATA")?).join("geometry");
    let mesh = read_mesh(&folder.join(format!("{name}_poly.obj"))).ok()?;
    let reference = read_mesh(&folder.join(format!("{name}_tri.obj"))).ok()?;
    let settings =
        ShapeSettings { method: ShapeMethod::AaAdmm, anderson, max_iters: most, ..ShapeSettings::planarize() };
    let rows: usize = mesh.faces.iter().filter(|f| f.len() > 3).map(|f| 3 * f.len()).sum();
    let (mean, _) = edge_lengths(&mesh.points, &mesh.faces);
    // Merits are in the coordinates of the problem, scaled by a power of two.
    let edge = mean / mean.log2().round().exp2();
    let mut reached = None;
    let mut on_row = |row: &TraceRow| {
        let residual = (row.merit / settings.mu / rows as f64).sqrt() / edge;
        if residual <= 1e-3 {
            reached.get_or_insert(row.iteration);
        }
    };
    let mut hooks = Hooks { trace: Some(&mut on_row), ..Hooks::default() };
    let shaped = planarize(&ShapeInput { mesh, reference: Some(reference) }, &settings, &mut hooks).ok()?;
    shaped.report.shape.map(|shape| (reached, shape))
}

#[test]
fn costa_and_airport_take_the_iterations_of_the_authors() {
    // Measured with the authors' implementation: 122 and 131 without acceleration, 55 and 35 with m = 6.
    for (name, plain, accelerated) in [("costa2k", 122, 55), ("airport3k", 131, 35)] {
        let Some((reached, _)) = counts(name, 0, 135) else {
            eprintln!("skipped: PROXEL_DATA names no folder with geometry/{name}_poly.obj");
            return;
        };
        assert_eq!(reached, Some(plain), "{name}");
        let (reached, _) = counts(name, 6, accelerated).expect("what was read before is read again");
        assert!(reached.is_some_and(|n| n <= accelerated), "{name}: {reached:?}");
    }
}
