//! Methods of Newton's kind: the minimum of the others, the rate of Newton's end, and the way back where it has none.

use proxel::deform::{DeformInput, Deformation, Hooks, deform};
use proxel::mesh::Mesh;
use proxel::mesh::generate::{CellSplit, beam};
use proxel::report::TraceRow;
use proxel::settings::{DeformSettings, MethodName, ProjectionName};
use proxel::split::Status;

/// A beam held at one end, pulled and turned at the other; its inside starts half as far turned as it should be.
fn twisted(cells: [usize; 3], angle: f64) -> DeformInput {
    let rest = beam(cells, [3.0, 0.6, 0.6], CellSplit::Five).expect("a beam");
    let (low, high) = rest.bounding_box().expect("vertices");
    let mut start = rest.points.clone();
    let mut fixed = Vec::new();
    for (v, p) in rest.points.iter().enumerate() {
        let part = (p[0] - low[0]) / (high[0] - low[0]);
        let is_end = !(1e-9..=1.0 - 1e-9).contains(&part);
        let (sin, cos) = (angle * part * if is_end { 1.0 } else { 0.5 + 0.5 * part }).sin_cos();
        let (y, z) = (p[1] - (low[1] + high[1]) / 2.0, p[2] - (low[2] + high[2]) / 2.0);
        start[v] = [p[0] + 0.1 * part, y * cos - z * sin, y * sin + z * cos];
        if is_end {
            fixed.push((v as u32, start[v]));
        }
    }
    DeformInput { rest, start: Some(start), fixed, ..Default::default() }
}

/// A sheet of triangles in space, held on the left, pulled and turned out of its plane on the right.
fn sheet() -> DeformInput {
    let (n, m) = (8u32, 3u32);
    let points: Vec<[f64; 3]> =
        (0..=n).flat_map(|i| (0..=m).map(move |j| [f64::from(i) * 0.3, f64::from(j) * 0.3, 0.0])).collect();
    let at = |i: u32, j: u32| i * (m + 1) + j;
    let triangles: Vec<[u32; 3]> = (0..n)
        .flat_map(|i| (0..m).map(move |j| (i, j)))
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    let mut start = points.clone();
    let mut fixed = Vec::new();
    for j in 0..=m {
        fixed.push((at(0, j), points[at(0, j) as usize]));
        let p = points[at(n, j) as usize];
        let (sin, cos) = 0.7_f64.sin_cos();
        let held = [p[0] + 0.5, 0.45 + (p[1] - 0.45) * cos, (p[1] - 0.45) * sin];
        start[at(n, j) as usize] = held;
        fixed.push((at(n, j), held));
    }
    // Inner vertices out of the plane, so that no direction is without stiffness.
    for i in 1..n {
        for j in 0..=m {
            start[at(i, j) as usize][2] = 0.02 * f64::from(i + j);
        }
    }
    let rest = Mesh::from_triangles("sheet", points, &triangles);
    DeformInput { rest, start: Some(start), fixed, ..Default::default() }
}

fn run(input: &DeformInput, settings: &DeformSettings) -> (Deformation, Vec<TraceRow>) {
    let mut rows = Vec::new();
    let mut keep = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { trace: Some(&mut keep), ..Hooks::default() };
    let result = deform(input, settings, &mut hooks).expect("good input");
    (result, rows)
}

fn with(method: MethodName) -> DeformSettings {
    DeformSettings { method, ..DeformSettings::default() }
}

const SECOND_ORDER: [MethodName; 4] =
    [MethodName::Auto, MethodName::Newton, MethodName::NewtonCg, MethodName::ProjectedNewton];

#[test]
fn they_end_where_wrapd_does() {
    let input = twisted([10, 3, 3], 1.2);
    let (wrapd, _) = run(&input, &with(MethodName::Wrapd));
    assert_eq!(wrapd.status, Status::Converged, "{}", wrapd.report.reason);
    let energy = wrapd.report.energy.expect("an energy");
    let input = DeformInput { reference: Some(wrapd.positions), ..input };
    for method in SECOND_ORDER {
        for projection in [ProjectionName::OnDemand, ProjectionName::Abs, ProjectionName::TrustRegion] {
            let mut settings = with(method);
            settings.newton.projection = projection;
            let (result, rows) = run(&input, &settings);
            let name = format!("{method:?} {projection:?}");
            assert_eq!(result.status, Status::Converged, "{name}: {}", result.report.reason);
            assert!((result.report.energy.expect("an energy") / energy - 1.0).abs() < 1e-10, "{name}");
            assert!(result.report.position_error.expect("a reference") < 1e-6, "{name}");
            // The splitting may climb; Newton never does, but for rounding.
            if method != MethodName::Auto {
                assert!(rows.windows(2).all(|r| r[1].energy <= r[0].energy * (1.0 + 1e-12)), "{name}");
            }
        }
    }
}

#[test]
fn the_end_of_newton_is_quadratic() {
    let input = twisted([10, 3, 3], 0.8);
    for method in [MethodName::Newton, MethodName::Auto] {
        let (result, rows) = run(&input, &with(method));
        assert_eq!(result.status, Status::Converged, "{method:?}: {}", result.report.reason);
        // From 1e-3 of the first gradient three steps are enough: 1e-3, 1e-6, 1e-12.
        let first = rows[0].gradient_norm;
        let near = rows.iter().position(|r| r.gradient_norm <= 1e-3 * first).expect("it converged");
        assert!(rows.len() - 1 - near <= 4, "{method:?}: {near} of {}", rows.len());
        assert!(rows.len() <= 40, "{method:?}: {}", rows.len());
    }
}

#[test]
fn surfaces_and_springs_too() {
    let input = twisted([8, 2, 2], 0.5);
    let surface = sheet();
    for (name, input, energy) in
        [("triangles", &surface, "arap"), ("springs", &input, "spring"), ("stvk", &input, "stvk")]
    {
        let mut settings = with(MethodName::Wrapd);
        settings.material.energy = energy.to_string();
        settings.tol = 1e-8;
        let (wrapd, _) = run(input, &settings);
        settings.method = MethodName::Auto;
        let (auto, _) = run(input, &settings);
        assert_eq!(auto.status, Status::Converged, "{name}: {}", auto.report.reason);
        assert_eq!(wrapd.status, Status::Converged, "{name}: {}", wrapd.report.reason);
        let (a, b) = (auto.report.energy.expect("an energy"), wrapd.report.energy.expect("an energy"));
        assert!(a <= b * (1.0 + 1e-6), "{name}: {a} above {b}");
    }
}

#[test]
fn a_factor_that_does_not_fit_is_refused_or_done_without() {
    let input = twisted([8, 3, 3], 0.8);
    let tight = |method: MethodName| {
        let mut settings = with(method);
        settings.newton.memory = 1e5;
        settings
    };
    let error = deform(&input, &tight(MethodName::Newton), &mut Hooks::default()).expect_err("refused").to_string();
    assert!(error.contains("GB") && error.contains("newton-cg") && error.contains("newton.memory"), "{error}");
    for method in [MethodName::Auto, MethodName::NewtonCg] {
        let (result, _) = run(&input, &tight(method));
        assert_eq!(result.status, Status::Converged, "{method:?}: {}", result.report.reason);
    }
}

#[test]
fn auto_begins_anew_where_the_start_is_hopeless() {
    let mut input = twisted([8, 3, 3], 0.8);
    let (good, _) = run(&input, &with(MethodName::Auto));
    let fixed: Vec<u32> = input.fixed.iter().map(|f| f.0).collect();
    let start = input.start.clone().unwrap_or_else(|| input.rest.points.clone());
    let mut spoilt = start.clone();
    for (v, p) in spoilt.iter_mut().enumerate().filter(|(v, _)| !fixed.contains(&(*v as u32))) {
        // Every third vertex to the middle, the others mirrored.
        *p = if v % 3 == 0 { [0.1, 0.0, 0.0] } else { [p[0], -p[1], p[2]] };
    }
    input.start = Some(spoilt.clone());
    let (result, _) = run(&input, &with(MethodName::Auto));
    assert_eq!(result.status, Status::Converged, "{}", result.report.reason);
    assert_eq!(result.report.inverted, Some(0));
    let said = |warnings: &[String]| warnings.iter().any(|w| w.contains("smooth start"));
    assert!(said(&result.report.warnings) && result.start != spoilt, "{:?}", result.report.warnings);
    let energy = good.report.energy.expect("an energy");
    assert!((result.report.energy.expect("an energy") / energy - 1.0).abs() < 1e-9);
    // Other methods begin where they are told, and so does auto where that makes sense.
    let few = DeformSettings { max_iters: 1, ..with(MethodName::Wrapd) };
    let (told, _) = run(&input, &few);
    assert!(!said(&told.report.warnings) && told.start == spoilt);
    input.start = Some(start.clone());
    let (kept, _) = run(&input, &with(MethodName::Auto));
    assert!(!said(&kept.report.warnings));
    let moved = kept.start.iter().zip(&start).enumerate().filter(|(v, _)| !fixed.contains(&(*v as u32)));
    assert!(moved.clone().count() > 0 && moved.clone().all(|(_, (a, b))| (0..3).all(|d| (a[d] - b[d]).abs() < 1e-12)));
}
