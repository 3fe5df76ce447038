//! The first weights: which they are by default, and what they are worth near incompressibility.

use proxel::deform::{DeformInput, Hooks, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::report::Report;
use proxel::settings::{BaseWeight, DeformSettings, Material, MethodName};

/// A beam held at both ends, one of which is turned by a third of a turn and pulled by a tenth.
fn twisted() -> DeformInput {
    let rest = beam([6, 2, 2], [1.0, 1.0 / 3.0, 1.0 / 3.0], CellSplit::Six).expect("a beam");
    let (sin, cos) = (std::f64::consts::TAU / 3.0).sin_cos();
    let mut start = rest.points.clone();
    let mut fixed = Vec::new();
    for (v, p) in start.iter_mut().enumerate().filter(|(_, p)| p[0].abs() > 0.499) {
        if p[0] > 0.0 {
            *p = [p[0] + 0.1, cos * p[1] - sin * p[2], sin * p[1] + cos * p[2]];
        }
        fixed.push((v as u32, *p));
    }
    DeformInput { rest, start: Some(start), fixed, ..DeformInput::default() }
}

fn solve(input: &DeformInput, poisson: f64, base: BaseWeight) -> Report {
    let mut settings = DeformSettings {
        method: MethodName::Wrapd,
        material: Material { poisson, ..Material::default() },
        max_iters: 2000,
        ..DeformSettings::default()
    };
    settings.admm.base_weight = base;
    deform(input, &settings, &mut Hooks::default()).expect("a problem").report
}

#[test]
fn nearly_incompressible_materials_start_from_the_geometric_mean() {
    let input = twisted();
    for (poisson, like, other) in
        [(0.45, BaseWeight::Slope, BaseWeight::GeometricMean), (0.49, BaseWeight::GeometricMean, BaseWeight::Slope)]
    {
        let [auto, like, other] = [BaseWeight::Auto, like, other].map(|base| solve(&input, poisson, base));
        assert_eq!((auto.iterations, auto.energy), (like.iterations, like.energy), "{poisson}");
        assert_ne!(like.energy, other.energy, "{poisson}: the same bits by other weights");
        for report in [&auto, &other] {
            assert_eq!(report.status, "converged", "{poisson}: {}", report.reason);
        }
        let (a, b) = (auto.energy.expect("finite"), other.energy.expect("finite"));
        assert!((a - b).abs() < 1e-9 * a, "{poisson}: {a} {b}");
        if poisson == 0.49 {
            assert!(3 * auto.iterations < 2 * other.iterations, "{} of {}", auto.iterations, other.iterations);
        }
    }
}
