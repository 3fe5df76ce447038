//! Methods to compare with, on shapes: they end where others end.

use proxel::deform::Hooks;
use proxel::mesh::{Mesh, Polygons};
use proxel::report::TraceRow;
use proxel::shape::{ShapeInput, ShapeMethod, ShapeReport, ShapeSettings, Shaped, WireSettings, planarize, wire};

/// A sheet of n x n quads that is hardly curved, so that its minimum is one.
fn sheet(n: usize) -> Mesh {
    let (mut points, mut faces) = (Vec::new(), Polygons::new());
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (i as f64, j as f64);
            points.push([x + 0.1 * (0.9 * y).sin(), y, 0.4 * (0.5 * x).sin() + 0.2 * (0.4 * y + 0.2 * x).cos()]);
        }
    }
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    for i in 0..n {
        for j in 0..n {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Mesh { name: "sheet".to_string(), points, faces, ..Mesh::default() }
}

fn planar(settings: &ShapeSettings) -> (Shaped, Vec<TraceRow>) {
    let mut rows = Vec::new();
    let mut on_row = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { trace: Some(&mut on_row), ..Hooks::default() };
    let input = ShapeInput { mesh: sheet(5), reference: None };
    let shaped = planarize(&input, settings, &mut hooks).expect("a mesh that can be shaped");
    (shaped, rows)
}

fn told(shaped: &Shaped) -> &ShapeReport {
    shaped.report.shape.as_ref().expect("a report of shapes")
}

#[test]
fn splittings_of_one_problem_end_at_one_shape() {
    let of = |method, anderson, mu| {
        // A penalty that suits so small a mesh, and a fairing that decides where vertices are on the sheet: nearest points on
        // facets alone let them slide forever.
        let base = ShapeSettings { fairing: 10.0, ..ShapeSettings::planarize() };
        ShapeSettings { method, anderson, mu, tol: 1e-8, max_iters: 20_000, ..base }
    };
    let (plain, _) = planar(&of(ShapeMethod::Admm, 0, 100.0));
    for (method, anderson) in
        [(ShapeMethod::AaAdmm, 6), (ShapeMethod::Alm, 0), (ShapeMethod::Aadr, 0), (ShapeMethod::Aadr, 6)]
    {
        let (other, rows) = planar(&of(method, anderson, 100.0));
        assert!(rows.iter().skip(1).all(|row| row.merit.is_finite()), "{method:?}: merits are told");
        assert!(told(&other).planarity_max.is_some_and(|c| c.after < 1e-6 && c.before > 1e-3));
        // Vertices slide along the sheet in a valley that is all but flat: objectives agree before places do.
        let objective = |s: &Shaped| s.report.energy.expect("an objective");
        let [a, b] = [&plain, &other].map(objective);
        assert!((a - b).abs() < 0.2 * a && a > 0.0, "{method:?} {anderson}: {a} {b}");
    }
}

#[test]
fn a_penalty_trades_planarity_for_distance() {
    let by = |mu: f64, anderson: usize| {
        let base = ShapeSettings::planarize_by(ShapeMethod::Shapeup);
        let settings =
            ShapeSettings { mu, anderson, closeness: 1.0, fairing: 10.0, tol: 1e-7, max_iters: 20_000, ..base };
        let (shaped, rows) = planar(&settings);
        // What is minimised never rises, accelerated or not.
        let rises = rows.windows(2).skip(1).filter(|w| w[1].merit > w[0].merit * (1.0 + 1e-10)).count();
        assert_eq!(rises, 0, "mu = {mu}, m = {anderson}");
        assert!(shaped.report.primal_residual.is_none(), "there are no residuals");
        shaped
    };
    let planarity = |s: &Shaped| told(s).planarity_max.expect("planarity is told").after;
    let (weak, strong) = (by(10.0, 6), by(1000.0, 6));
    assert!(planarity(&strong) < 0.1 * planarity(&weak), "{} {}", planarity(&strong), planarity(&weak));
    assert!(!told(&strong).violated.is_empty(), "what does not hold is named though it is soft");
    // Accelerated it is farther down the same valley.
    let objective = |s: &Shaped| s.report.energy.expect("an objective");
    let (with, without) = (objective(&weak), objective(&by(10.0, 0)));
    assert!(with <= without && with > 0.9 * without, "{with} {without}");
}

#[test]
fn they_make_wire_meshes_too() {
    let mesh = sheet(4);
    let run = |method| {
        let base = WireSettings::by(method);
        let shape = ShapeSettings { max_iters: 3000, tol: 1e-7, ..base.shape };
        let settings = WireSettings { min_angle: 60.0, max_angle: 120.0, shape, ..base };
        let input = ShapeInput { mesh: mesh.clone(), reference: None };
        wire(&input, &settings, &mut Hooks::default()).expect("a mesh that can be shaped")
    };
    for method in ShapeMethod::ALL {
        let shaped = run(method);
        let worst = told(&shaped).edge_error_max.expect("edges are told");
        let limit = if method == ShapeMethod::Shapeup { 0.05 } else { 1e-3 };
        assert!(worst.after < limit && worst.before > 0.01, "{method:?}: {worst:?} ({})", shaped.report.reason);
        assert_eq!(shaped.report.method, method.as_str());
    }
}
