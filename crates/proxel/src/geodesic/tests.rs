use super::*;
use crate::settings::GradientForm;
use proxel_mesh::generate::{ball, cloth};
use proxel_mesh::topology::boundary_surface;
use proxel_split::{Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Direct, Order};

/// The skin of a ball of radius 1, with the vertices of its inside left unused.
fn sphere(cell: f64) -> Mesh {
    let body = ball(1.0, cell).unwrap();
    Mesh::from_triangles("sphere", body.points.clone(), &boundary_surface(&body.tets))
}

fn solve(mesh: &Mesh, sources: &[u32], settings: &GeodesicSettings) -> Geodesic {
    geodesic(mesh, sources, settings, &mut Hooks::default()).unwrap()
}

fn by(method: GeodesicMethod, form: GradientForm) -> GeodesicSettings {
    GeodesicSettings { method, form, ..GeodesicSettings::default() }
}

/// Root mean square of the difference over what is finite in both.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    let pairs: Vec<f64> =
        a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()).map(|(a, b)| (a - b).powi(2)).collect();
    (pairs.iter().sum::<f64>() / pairs.len() as f64).sqrt()
}

/// Great circles: finer meshes come nearer to them.
#[test]
fn arcs_on_a_sphere() {
    let mut errors = Vec::new();
    for cell in [0.2, 0.1] {
        let mesh = sphere(cell);
        let used = mesh.faces.get(0)[0];
        let result = solve(&mesh, &[used], &GeodesicSettings::default());
        assert_eq!(result.status, Status::Converged);
        let at = |v: usize| mesh.points[v];
        let arc = |v: usize| {
            let (a, b) = (at(used as usize), at(v));
            let dot: f64 = (0..3).map(|k| a[k] * b[k]).sum();
            dot.clamp(-1.0, 1.0).acos()
        };
        let arcs: Vec<f64> = (0..mesh.n_verts()).map(arc).collect();
        errors.push(difference(&result.distance, &arcs));
        let inside = result.distance.iter().filter(|d| !d.is_finite()).count();
        assert_eq!(result.report.geodesic.unwrap().unreached_vertices, inside);
        assert!(inside > 0 && result.distance[used as usize].abs() < 1e-12);
    }
    assert!(errors[0] < 0.06 && errors[1] < 0.7 * errors[0], "{errors:?}");
}

/// Straight lines on a plate, from near its border: 1.1 per cent off in the mean, 1.7 if heat could not leave through it.
#[test]
fn lines_on_a_plate() {
    let mesh = cloth([40, 40], [1.0, 1.0]).unwrap();
    let far = |v: usize, p: [f64; 3]| (0..3).map(|k| (mesh.points[v][k] - p[k]).powi(2)).sum::<f64>().sqrt();
    let (lo, hi) = mesh.bounding_box().unwrap();
    let place = [0, 1, 2].map(|k| lo[k] + [0.3, 0.1, 0.1][k] * (hi[k] - lo[k]));
    let source = (0..mesh.n_verts()).min_by(|a, b| far(*a, place).total_cmp(&far(*b, place))).unwrap();
    let result = solve(&mesh, &[source as u32], &GeodesicSettings::default());
    let error = |v: usize| {
        let line = far(v, mesh.points[source]);
        if line > 0.0 { (result.distance[v] - line).abs() / line } else { 0.0 }
    };
    let mean = (0..mesh.n_verts()).map(error).sum::<f64>() / mesh.n_verts() as f64;
    assert!(mean < 0.013, "{mean}");
}

/// On a surface without handles the nearest integrable field by ADMM, plain and accelerated, has the same potential as the
/// sparse system.
#[test]
fn the_splitting_has_the_same_minimum() {
    let mesh = sphere(0.25);
    let source = mesh.faces.get(7)[1];
    let want = solve(&mesh, &[source], &by(GeodesicMethod::Poisson, GradientForm::Faces));
    let mut iterations = Vec::new();
    for method in [GeodesicMethod::Admm, GeodesicMethod::AaAdmm] {
        let result = solve(&mesh, &[source], &by(method, GradientForm::Faces));
        assert_eq!(result.status, Status::Converged, "{}", result.report.reason);
        let error = difference(&result.distance, &want.distance);
        assert!(error < 1e-7, "{method:?}: {error:e}");
        iterations.push(result.report.iterations);
    }
    assert!(2 * iterations[1] < iterations[0], "{iterations:?}");
    // Differences along edges are weighed otherwise, and measure the same.
    let edges = solve(&mesh, &[source], &by(GeodesicMethod::AaAdmm, GradientForm::Edges));
    assert_eq!(edges.status, Status::Converged, "{}", edges.report.reason);
    let error = difference(&edges.distance, &want.distance);
    assert!(error > 1e-6 && error < 0.02, "{error:e}");
}

/// Iterations in one pass have the bits of those in two halves, which a driver that looks in between runs, and know the same
/// residuals.
#[test]
fn one_pass_or_two_halves() {
    let mesh = sphere(0.15);
    for form in [GradientForm::Faces, GradientForm::Edges] {
        let settings = by(GeodesicMethod::Admm, form);
        let start = || {
            let parts =
                AdmmSettings { name: "admm".into(), global: Box::new(Direct), reweighting: None, renewed_at: None };
            let problem = gradient_problem(&mesh, &[mesh.faces.get(0)[0]], &settings).unwrap();
            Admm::new(problem, parts).unwrap().with_cycle(Cycle { order: Order::Zxu, ..Cycle::PLAIN }).unwrap()
        };
        let (mut whole, admm) = (start(), start());
        let mut halves = Acceleration::anderson(Algorithm::Two, 0).of(admm).unwrap();
        for k in 0..40 {
            whole.step().unwrap();
            halves.step().unwrap();
            let same = whole.x().iter().zip(halves.x()).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same, "{form:?}: iteration {k}");
        }
        let (a, b) = (whole.squared_residuals().unwrap(), halves.squared_residuals().unwrap());
        let (a, b) = ([a.forward, a.combined], [b.forward, b.combined]);
        assert!((0..2).all(|i| (a[i] - b[i]).abs() <= 1e-10 * b[i] && a[i] > 0.0), "{a:?} {b:?}");
        let (a, b) = (whole.residuals(), halves.residuals());
        assert!((a.primal - b.primal).abs() <= 1e-10 * b.primal && (a.dual - b.dual).abs() <= 1e-10 * b.dual);
    }
}

#[test]
fn an_edge_of_many_faces_takes_the_other_form() {
    let turned = |k: u32| [f64::from(k).cos(), f64::from(k).sin(), 0.5];
    let points = [[0.0; 3], [0.0, 0.0, 1.0]].into_iter().chain((0..17).map(turned)).collect();
    let faces: Vec<[u32; 3]> = (2..19).map(|k| [0, 1, k]).collect();
    let mesh = Mesh::from_triangles("fan.obj", points, &faces);
    let problem = |form| gradient_problem(&mesh, &[0], &by(GeodesicMethod::Admm, form));
    let said = problem(GradientForm::Edges).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(said.starts_with("fan.obj: the edge between vertices 0 and 1 has 17 faces"), "{said}");
    assert!(said.ends_with("take --form faces") && problem(GradientForm::Faces).is_ok(), "{said}");
}

/// A square from its centre: all eight symmetries of the mesh, and the units do not matter.
#[test]
fn symmetric_distances() {
    let n = 16;
    let mut mesh = cloth([n, n], [1.0, 1.0]).unwrap();
    let middle = (0..mesh.n_verts())
        .min_by(|a, b| {
            let far = |v: usize| mesh.points[v].iter().map(|c| c * c).sum::<f64>();
            let (lo, hi) = mesh.bounding_box().unwrap();
            let centre = [0, 1, 2].map(|k| 0.5 * (lo[k] + hi[k]));
            let d = |v: usize| (0..3).map(|k| (mesh.points[v][k] - centre[k]).powi(2)).sum::<f64>();
            d(*a).total_cmp(&d(*b)).then(far(*a).total_cmp(&far(*b)))
        })
        .unwrap() as u32;
    let centre = mesh.points[middle as usize];
    let result = solve(&mesh, &[middle], &GeodesicSettings::default());
    // The cells' diagonals leave the half turn as a symmetry of the mesh.
    let turned = |p: [f64; 3]| [0, 1, 2].map(|k| 2.0 * centre[k] - p[k]);
    for v in 0..mesh.n_verts() {
        let p = turned(mesh.points[v]);
        let near = |w: &usize| (0..3).all(|k| (mesh.points[*w][k] - p[k]).abs() < 1e-9);
        let w = (0..mesh.n_verts()).find(near).unwrap();
        assert!((result.distance[v] - result.distance[w]).abs() < 1e-9, "{v} {w}");
    }
    for scale in [1e-6, 1e8] {
        mesh.points.iter_mut().for_each(|p| *p = p.map(|c| c * scale));
        let other = solve(&mesh, &[middle], &GeodesicSettings::default());
        for (a, b) in result.distance.iter().zip(&other.distance) {
            assert!((a - b / scale).abs() < 1e-9, "{a} {b}");
        }
        mesh.points.iter_mut().for_each(|p| *p = p.map(|c| c / scale));
    }
}

/// Flat triangles, a face with a vertex twice, three faces at an edge, parts that no path joins: told, not refused.
#[test]
fn odd_meshes() {
    let mut points: Vec<[f64; 3]> = cloth([6, 6], [1.0, 1.0]).unwrap().points;
    let n = points.len() as u32;
    let mut triangles: Vec<[u32; 3]> = cloth([6, 6], [1.0, 1.0]).unwrap().faces.fan_triangles();
    points.extend([[0.5, 0.0, 1.0], [5.0, 5.0, 5.0], [6.0, 5.0, 5.0], [5.0, 6.0, 5.0], [7.0; 3]]);
    let [a, b, c] = triangles[20];
    triangles.extend([[a, b, n], [a, b, n], [a, a, b], [n + 1, n + 2, n + 3], [0, 1, 2]]);
    let mesh = Mesh::from_triangles("odd", points, &triangles);
    let result = solve(&mesh, &[c], &GeodesicSettings::default());
    let report = result.report;
    assert_eq!(report.repaired.len(), 2, "{:?}", report.repaired);
    assert!(
        report.warnings[0].contains("no path") && report.warnings[0].contains("4 vertices"),
        "{:?}",
        report.warnings
    );
    assert!(result.distance[..n as usize].iter().all(|d| d.is_finite() && *d > -0.05));
    assert!(result.distance[n as usize].is_finite() && result.distance[n as usize + 4] == f64::INFINITY);
    // The splitting needs no manifold either.
    let split = solve(&mesh, &[c], &by(GeodesicMethod::AaAdmm, GradientForm::Faces));
    assert!(split.distance[..n as usize].iter().all(|d| d.is_finite()), "{}", split.report.reason);
}

/// Heat of one squared edge is gone after 700 edges; then it flows for longer, and says so.
#[test]
fn a_long_strip() {
    let mesh = cloth([2000, 1], [20.0, 0.01]).unwrap();
    let (mut near, mut far) = (0, 0);
    for v in 0..mesh.n_verts() {
        if mesh.points[v][0] < mesh.points[near][0] {
            near = v;
        }
        if mesh.points[v][0] > mesh.points[far][0] {
            far = v;
        }
    }
    let result = solve(&mesh, &[near as u32], &GeodesicSettings::default());
    assert!(result.report.warnings.iter().any(|w| w.contains("heat flowed")), "{:?}", result.report.warnings);
    assert!((result.distance[far] - 20.0).abs() < 0.1, "{}", result.distance[far]);
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let mesh = sphere(0.1);
    let source = mesh.faces.get(3)[0];
    for method in [GeodesicMethod::Poisson, GeodesicMethod::Admm, GeodesicMethod::AaAdmm] {
        let on = |threads| {
            let settings =
                GeodesicSettings { threads: Some(threads), max_iters: 30, ..by(method, GradientForm::Faces) };
            solve(&mesh, &[source], &settings).distance
        };
        let (one, three) = (on(1), on(3));
        assert!(one.iter().zip(&three).all(|(a, b)| a.to_bits() == b.to_bits()), "{method:?}");
    }
}

#[test]
fn refusals() {
    let mesh = cloth([2, 2], [1.0, 1.0]).unwrap();
    let text = |mesh: &Mesh, sources: &[u32], settings: &GeodesicSettings| {
        geodesic(mesh, sources, settings, &mut Hooks::default()).unwrap_err().to_string()
    };
    let usual = GeodesicSettings::default();
    assert!(text(&mesh, &[99], &usual).contains("source 99 is no vertex; there are 9"));
    assert!(text(&mesh, &[], &usual).contains("name at least one"));
    assert!(text(&Mesh::default(), &[0], &usual).contains("vert"));
    let time = GeodesicSettings { time: -1.0, ..usual.clone() };
    assert!(text(&mesh, &[0], &time).contains("--time is -1"));
    let mut point = mesh.clone();
    point.points.iter_mut().for_each(|p| *p = [1.0; 3]);
    assert!(text(&point, &[0], &usual).contains("bounding box"));
    let mut nan = mesh;
    nan.points[4][1] = f64::NAN;
    assert!(text(&nan, &[0], &usual).contains("vertex 4"));
}
