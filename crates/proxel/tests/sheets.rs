//! Thin sheets, planar and mixed meshes: what the samples solve, at a size for tests.

use proxel::deform::{DeformInput, Deformation, Hooks, deform};
use proxel::samples::{Sample, cloth, mixed, planar, springs};
use proxel::settings::{DeformSettings, Material, MethodName};
use proxel::split::Status;
use proxel_mesh::Mesh;

fn run(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    deform(input, settings, &mut Hooks::default()).expect("good input")
}

fn distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// |a - b| over |start - b|.
fn apart(a: &Deformation, b: &Deformation) -> f64 {
    distance(&a.positions, &b.positions) / distance(&b.start, &b.positions)
}

/// Singular values of the triangles' deformation gradients, by the eigenvalues of F^T F: independent of the solver's.
fn stretches(rest: &Mesh, x: &[[f64; 3]]) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    for t in rest.faces.fan_triangles() {
        let edges = |p: &[[f64; 3]]| [1, 2].map(|k| [0, 1, 2].map(|d| p[t[k] as usize][d] - p[t[0] as usize][d]));
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
        let gram = |e: [[f64; 3]; 2]| [dot(e[0], e[0]), dot(e[0], e[1]), dot(e[1], e[1])];
        let (g, h) = (gram(edges(&rest.points)), gram(edges(x)));
        // Eigenvalues of G^-1 H: trace and determinant.
        let det = g[0] * g[2] - g[1] * g[1];
        let trace = (g[2] * h[0] - 2.0 * g[1] * h[1] + g[0] * h[2]) / det;
        let product = (h[0] * h[2] - h[1] * h[1]) / det;
        let root = (trace * trace / 4.0 - product).max(0.0).sqrt();
        low = low.min((trace / 2.0 - root).max(0.0).sqrt());
        high = high.max((trace / 2.0 + root).sqrt());
    }
    (low, high)
}

#[test]
fn cloth_relaxes_within_its_limits_by_two_methods() {
    let Sample { input, settings, .. } = cloth(12).unwrap();
    let tight = |method| DeformSettings { method, max_iters: 60_000, tol: 1e-8, ..settings.clone() };
    let wrapd = run(&input, &tight(MethodName::Wrapd));
    let mut admm_pd = tight(MethodName::AdmmPd);
    admm_pd.admm.weight_scale = 0.5;
    let admm_pd = run(&input, &admm_pd);
    for end in [&wrapd, &admm_pd] {
        assert_eq!(end.status, Status::Converged, "{}", end.report.reason);
        let (low, high) = stretches(&input.rest, &end.positions);
        assert!(low >= 0.95 - 1e-6 && high <= 1.05 + 1e-6, "{low} {high}");
        let (min, max) = (end.report.min_stretch.unwrap(), end.report.max_stretch.unwrap());
        assert!((min - low).abs() < 1e-9 && (max - high).abs() < 1e-9, "{min} {max} {low} {high}");
        assert!(end.report.gradient_norm.is_none(), "the gradient says nothing at a border");
        assert!(end.report.primal_residual.unwrap() <= 1e-8 && end.report.dual_residual.unwrap() <= 1e-8);
        // The corners carry the weight: 0.2 kg over 1 m^2.
        let carried: f64 = end.report.reactions.values().map(|f| f[1]).sum();
        assert!((carried + 0.2 * 9.81).abs() < 1e-5, "{carried}");
    }
    let (_, high) = stretches(&input.rest, &wrapd.positions);
    assert!(high > 1.05 - 1e-6, "the limits are at work");
    let (a, b) = (wrapd.report.energy.unwrap(), admm_pd.report.energy.unwrap());
    assert!((a - b).abs() < 1e-6 * b.abs() && apart(&admm_pd, &wrapd) < 1e-3, "{a} {b} {}", apart(&admm_pd, &wrapd));
}

#[test]
fn a_run_outside_its_limits_never_converges() {
    // Corners further apart than the limits allow.
    let Sample { mut input, settings, .. } = cloth(6).unwrap();
    for (_, p) in &mut input.fixed {
        *p = p.map(|c| 1.4 * c);
    }
    let end = run(&input, &DeformSettings { tol: 1e-2, max_iters: 300, ..settings });
    assert_eq!(end.status, Status::Stopped, "{}", end.report.reason);
    assert!(end.report.max_stretch.unwrap() > 1.05 + 1e-6);
}

#[test]
fn limits_hold_for_tetrahedra_and_for_every_energy() {
    let rest = proxel_mesh::generate::beam([8, 2, 2], [4.0, 1.0, 1.0], proxel_mesh::generate::CellSplit::Five).unwrap();
    let fixed: Vec<(u32, [f64; 3])> =
        (0..).zip(&rest.points).filter(|(_, p)| p[0] <= -2.0).map(|(v, p)| (v, *p)).collect();
    let input = DeformInput { rest, fixed, ..DeformInput::default() };
    for energy in proxel::model::energy::names(3) {
        let settings = DeformSettings {
            material: Material { energy: energy.into(), young: 1e5, poisson: 0.3, ..Material::default() },
            density: 1000.0,
            gravity: [0.0, -0.5, 0.0],
            strain_limit: Some([0.9, 1.1]),
            tol: 1e-7,
            max_iters: 20_000,
            ..DeformSettings::default()
        };
        let end = run(&input, &settings);
        assert_eq!(end.status, Status::Converged, "{energy}: {}", end.report.reason);
        let (low, high) = (end.report.min_stretch.unwrap(), end.report.max_stretch.unwrap());
        assert!(low >= 0.9 - 1e-6 && high <= 1.1 + 1e-6, "{energy}: {low} {high}");
        assert!(low < 0.9 + 1e-4 || high > 1.1 - 1e-4, "{energy}: the limits are at work: {low} {high}");
    }
}

#[test]
fn planar_nets_and_mixed_meshes_have_one_minimum_whatever_the_method() {
    for (name, sample, scale) in
        [("planar", planar(12).unwrap(), 2.0), ("springs", springs(8).unwrap(), 1.0), ("mixed", mixed(4).unwrap(), 2.0)]
    {
        let Sample { input, settings, .. } = sample;
        let with = |method| {
            let mut settings = DeformSettings { method, tol: 1e-8, max_iters: 100_000, ..settings.clone() };
            settings.admm.weight_scale = if method == MethodName::AdmmPd { scale } else { 1.0 };
            run(&input, &settings)
        };
        let (wrapd, admm_pd) = (with(MethodName::Wrapd), with(MethodName::AdmmPd));
        assert_eq!(wrapd.status, Status::Converged, "{name}: {}", wrapd.report.reason);
        assert_eq!(admm_pd.status, Status::Converged, "{name}: {}", admm_pd.report.reason);
        assert!(apart(&admm_pd, &wrapd) < 1e-5, "{name}: {}", apart(&admm_pd, &wrapd));
        if name == "planar" {
            assert!(wrapd.positions.iter().all(|p| p[2] == 0.0), "in the plane");
            assert_eq!(wrapd.report.inverted, Some(0));
        }
        if name == "mixed" {
            let weight: f64 = wrapd.report.reactions["hooks"][1];
            // 1000 kg/m^3 times 0.25 m^3, 1 kg/m^2 of membrane, 0.1 kg/m of cables.
            assert!(weight < -0.25 * 9810.0 && weight > -0.26 * 9810.0, "{weight}");
        }
    }
}

#[test]
fn a_planar_problem_under_tension_is_the_one_in_space() {
    let Sample { mut input, settings, .. } = planar(12).unwrap();
    // Pulled along its length: in space it has no reason to buckle. Triangles there have no orientation.
    input.fixed.retain(|(v, _)| input.rest.points[*v as usize][0] <= -1.0);
    for (v, p) in (0u32..).zip(&input.rest.points).filter(|(_, p)| p[0] >= 1.0) {
        input.fixed.push((v, [p[0] + 0.5, p[1] + 0.3, p[2]]));
    }
    let flat = run(&input, &settings);
    let space = run(&input, &DeformSettings { planar: false, ..settings });
    assert_eq!((flat.status, space.status), (Status::Converged, Status::Converged));
    assert!(apart(&flat, &space) < 1e-6, "{}", apart(&flat, &space));
    assert!(flat.report.max_stretch.unwrap() > 1.2, "it is stretched");
}

#[test]
fn what_does_not_fit_is_refused_with_item_and_remedy() {
    let say = |input: &DeformInput, settings: &DeformSettings| {
        deform(input, settings, &mut Hooks::default()).expect_err("refused").to_string()
    };
    let Sample { input, settings, .. } = planar(4).unwrap();
    let mut folded = input.clone();
    let mut triangles = folded.rest.faces.as_triangles().unwrap();
    triangles[3].swap(0, 1);
    folded.rest = Mesh::from_triangles("strip", folded.rest.points, &triangles);
    let told = say(&folded, &settings);
    assert!(
        told.contains("1 of 8 triangles are clockwise, the first is 3") && told.contains("--fix-orientation"),
        "{told}"
    );
    let fixed = run(&folded, &DeformSettings { fix_orientation: true, ..settings.clone() });
    assert_eq!((fixed.status, fixed.report.repaired.len()), (Status::Converged, 1));
    let mut bent = input.clone();
    bent.rest.points[2][2] = 0.1;
    assert!(say(&bent, &settings).contains("vertex 2") && say(&bent, &settings).contains("--planar"));
    let pulled = DeformSettings { gravity: [0.0, 0.0, -1.0], ..settings.clone() };
    assert!(say(&input, &pulled).contains("gravity has the z component -1"));
    let limits = DeformSettings { strain_limit: Some([1.1, 1.2]), ..settings };
    assert!(say(&input, &limits).contains("--strain-limit"));
    let solid = proxel_mesh::generate::cube(2).unwrap();
    let bending = DeformSettings { bending: 1.0, ..DeformSettings::default() };
    let told = say(&DeformInput { rest: solid, ..DeformInput::default() }, &bending);
    assert!(told.contains("no elastic triangles") && told.contains("--mixed"), "{told}");
}
