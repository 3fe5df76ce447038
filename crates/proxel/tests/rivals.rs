//! The first-order rivals: the same minimum, honest ends, safeguards that are seen to work.

use proxel::deform::{DeformInput, Deformation, Hooks, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::report::TraceRow;
use proxel::settings::{DeformSettings, MethodName};
use proxel::split::Status;

const RIVALS: [MethodName; 4] = [MethodName::Lbfgs, MethodName::Bcqn, MethodName::Aadr, MethodName::AaAdmm];

/// A beam whose ends are held where `place` puts them; between them it starts where `place` has it.
fn held(cells: [usize; 3], place: impl Fn([f64; 3]) -> [f64; 3]) -> DeformInput {
    let rest = beam(cells, [3.0, 0.6, 0.6], CellSplit::Five).expect("a beam");
    let start: Vec<[f64; 3]> = rest.points.iter().map(|p| place(*p)).collect();
    let at_end = |p: &[f64; 3]| p[0].abs() > 1.5 - 1e-9;
    let fixed = (0..rest.n_verts()).filter(|v| at_end(&rest.points[*v])).map(|v| (v as u32, start[v])).collect();
    DeformInput { rest, start: Some(start), fixed, ..Default::default() }
}

fn stretched() -> DeformInput {
    held([8, 2, 2], |p| [1.4 * p[0], p[1], p[2]])
}

fn sheared() -> DeformInput {
    held([8, 2, 2], |p| [p[0], p[1] + 0.3 * p[0], p[2] - 0.1 * p[0]])
}

fn twisted(cells: [usize; 3], angle: f64) -> DeformInput {
    held(cells, move |p| {
        let (sin, cos) = (angle * (p[0] + 1.5) / 3.0).sin_cos();
        [p[0], p[1] * cos - p[2] * sin, p[1] * sin + p[2] * cos]
    })
}

fn settings(method: MethodName) -> DeformSettings {
    DeformSettings { method, max_iters: 20_000, ..Default::default() }
}

fn run(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    deform(input, settings, &mut Hooks::default()).expect("good input")
}

fn traced(input: &DeformInput, settings: &DeformSettings) -> (Deformation, Vec<TraceRow>) {
    let mut rows = Vec::new();
    let mut on_row = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { trace: Some(&mut on_row), ..Hooks::default() };
    let end = deform(input, settings, &mut hooks).expect("good input");
    drop(hooks);
    (end, rows)
}

fn distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn rivals_reach_the_minimum_of_wrapd() {
    for (name, input) in [("stretched", stretched()), ("sheared", sheared()), ("twisted", twisted([8, 2, 2], 1.2))] {
        let wrapd = run(&input, &settings(MethodName::Wrapd));
        assert_eq!(wrapd.status, Status::Converged, "{name}: {}", wrapd.report.reason);
        let size = distance(&wrapd.positions, &vec![[0.0; 3]; wrapd.positions.len()]);
        for method in RIVALS {
            let rival = run(&input, &settings(method));
            assert_eq!(rival.status, Status::Converged, "{name} {method:?}: {}", rival.report.reason);
            let apart = distance(&rival.positions, &wrapd.positions) / size;
            assert!(apart < 1e-6, "{name} {method:?}: {apart}");
            let (a, b) = (rival.report.energy.unwrap(), wrapd.report.energy.unwrap());
            assert!((a - b).abs() <= 1e-10 * b, "{name} {method:?}: {a} and {b}");
            assert_eq!(rival.report.inverted, Some(0));
            assert!(rival.report.gradient_ratio.unwrap() <= 1e-9, "{name} {method:?}");
        }
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let input = twisted([20, 4, 4], 1.5);
    let accelerated_wrapd = {
        let mut settings = settings(MethodName::Wrapd);
        settings.anderson.others = 4;
        settings
    };
    for mut settings in RIVALS.map(settings).into_iter().chain([accelerated_wrapd]) {
        settings.max_iters = 60;
        let mut on = |threads| {
            settings.threads = Some(threads);
            let result = run(&input, &settings);
            let bits: Vec<u64> = result.positions.as_flattened().iter().map(|v| v.to_bits()).collect();
            (bits, result.report.energy.map(f64::to_bits), result.report.rejected)
        };
        let one = on(1);
        assert!(one == on(2) && one == on(3), "{:?}", settings.method);
    }
}

#[test]
fn quasi_newton_steps_never_raise_the_energy() {
    let input = twisted([8, 2, 2], 2.0);
    for method in [MethodName::Lbfgs, MethodName::Bcqn] {
        let (end, rows) = traced(&input, &settings(method));
        assert_eq!(end.status, Status::Converged, "{method:?}: {}", end.report.reason);
        assert!(rows.len() > 10);
        for pair in rows.windows(2) {
            let slack = 2e-14 * pair[0].energy;
            assert!(pair[1].energy <= pair[0].energy + slack, "{method:?}: {pair:?}");
        }
        assert!(rows.iter().all(|row| row.primal_residual.is_infinite() && row.merit.is_infinite()));
    }
}

#[test]
fn rejected_steps_happen_and_are_counted() {
    // One end is pushed in by a third of the length, from one moment to the next.
    let input = held([8, 3, 3], |p| if p[0] > 1.5 - 1e-9 { [p[0] - 1.0, p[1], p[2]] } else { p });
    for method in [MethodName::AaAdmm, MethodName::Aadr] {
        let (end, rows) = traced(&input, &settings(method));
        assert_eq!(end.status, Status::Converged, "{method:?}: {}", end.report.reason);
        let report = &end.report;
        assert!(report.rejected > 0, "{method:?}: the safeguard has nothing to do here");
        assert_eq!(report.accepted + report.rejected, report.iterations, "{method:?}");
        assert_eq!(rows.iter().skip(1).filter(|row| !row.accepted).count(), report.rejected, "{method:?}");
        assert!(report.primal_residual.unwrap() < 1e-6 && report.dual_residual.unwrap() < 1e-6, "{method:?}");
        // From the third iteration on points are accelerated, but for the one after a rejection that has cleared the history:
        // what was taken has brought the merit down.
        for pair in rows[2..].windows(2).filter(|pair| pair[0].accepted && pair[1].accepted) {
            assert!(pair[1].merit <= pair[0].merit * (1.0 + 1e-14), "{method:?}: {pair:?}");
        }
    }
}

#[test]
fn acceleration_takes_fewer_iterations_than_the_plain_iteration() {
    let input = stretched();
    let iterations = |settings: &DeformSettings| {
        let end = run(&input, settings);
        assert_eq!(end.status, Status::Converged, "{:?}: {}", settings.method, end.report.reason);
        end.report.iterations
    };
    let plain = iterations(&settings(MethodName::AdmmPd));
    for method in [MethodName::AaAdmm, MethodName::Aadr] {
        let accelerated = iterations(&settings(method));
        assert!(3 * accelerated < 2 * plain, "{method:?}: {accelerated} against {plain}");
    }
    // Without columns nothing is accelerated: the same iteration as the plain one, to the last bit.
    let mut without = settings(MethodName::AaAdmm);
    without.anderson.aa_admm = 0;
    without.max_iters = 25;
    let plain = run(&input, &DeformSettings { method: MethodName::AdmmPd, ..without.clone() });
    assert_eq!(run(&input, &without).positions, plain.positions);
}

#[test]
fn bcqn_inverts_nothing_where_nothing_was_inverted() {
    let input = held([8, 3, 3], |p| {
        // Free nodes are thrown about: far from inversion nowhere, inverted nowhere.
        let noise = |k: f64| 0.06 * (17.0 * p[0] + 29.0 * p[1] * k + 41.0 * p[2] + k).sin();
        if p[0].abs() > 1.5 - 1e-9 {
            [1.2 * p[0], p[1], p[2]]
        } else {
            [p[0] + noise(1.0), p[1] + noise(2.0), p[2] + noise(3.0)]
        }
    });
    let (guarded, rows) = traced(&input, &settings(MethodName::Bcqn));
    assert_eq!(rows[0].inverted, 0, "the start has to be a legal one");
    assert!(rows.iter().all(|row| row.inverted == 0));
    assert_eq!(guarded.status, Status::Converged, "{}", guarded.report.reason);
}

#[test]
fn bcqn_turns_what_starts_inverted() {
    let mut input = twisted([6, 2, 2], 0.5);
    let good = run(&input, &settings(MethodName::Wrapd));
    let fixed: Vec<u32> = input.fixed.iter().map(|(v, _)| *v).collect();
    let start = input.start.as_mut().expect("a start");
    for (v, p) in start.iter_mut().enumerate().filter(|(v, _)| !fixed.contains(&(*v as u32))) {
        *p = [p[0] + 0.4 * ((v * 7 % 5) as f64 - 2.0) / 2.0, 0.8 * p[1], -p[2]];
    }
    let (end, rows) = traced(&input, &settings(MethodName::Bcqn));
    assert!(rows[0].inverted > 0, "the start has to be inverted");
    assert_eq!(end.report.inverted, Some(0), "{}", end.report.reason);
    let first_clean = rows.iter().position(|row| row.inverted == 0).expect("a point without inverted elements");
    assert!(rows[first_clean..].iter().all(|row| row.inverted == 0), "once clean, it stays so");
    assert!(good.report.energy.is_some());
}

#[test]
fn a_start_of_infinite_energy_is_told_as_such() {
    let mut input = twisted([4, 1, 1], 0.3);
    let fixed: Vec<u32> = input.fixed.iter().map(|(v, _)| *v).collect();
    let start = input.start.as_mut().expect("a start");
    for (_, p) in start.iter_mut().enumerate().filter(|(v, _)| !fixed.contains(&(*v as u32))) {
        p[2] = -p[2];
    }
    for method in [MethodName::Lbfgs, MethodName::Bcqn] {
        let mut settings = settings(method);
        settings.material.energy = "symmetric-dirichlet".to_string();
        let end = run(&input, &settings);
        assert_eq!(end.status, Status::Failed, "{method:?}");
        assert!(end.report.reason.contains("not finite where"), "{}", end.report.reason);
        assert!(end.positions.as_flattened().iter().all(|c| c.is_finite()));
        assert_eq!(end.report.energy, None);
    }
}

#[test]
fn rounding_ends_a_run_with_the_reason() {
    let settings = DeformSettings { tol: 1e-300, ..settings(MethodName::Lbfgs) };
    let end = run(&stretched(), &settings);
    let early = end.report.gradient_norm == Some(0.0) || end.status == Status::Converged;
    assert!(early || end.status == Status::Failed && end.report.reason.contains("rounding"), "{}", end.report.reason);
    assert!(end.report.gradient_ratio.unwrap() < 1e-11, "{}", end.report.gradient_ratio.unwrap());
}

#[test]
fn the_stop_of_bcqn_says_so() {
    let loose = DeformSettings { patch_tol: Some(1e-3), ..settings(MethodName::Bcqn) };
    let end = run(&sheared(), &loose);
    assert_eq!(end.status, Status::Converged);
    assert!(end.report.reason.contains("Zhu"), "{}", end.report.reason);
    assert!(end.report.gradient_ratio.unwrap() > 1e-9);
    let tight = run(&sheared(), &settings(MethodName::Bcqn));
    assert!(!tight.report.reason.contains("Zhu"), "{}", tight.report.reason);
    assert!(end.report.iterations < tight.report.iterations);
}

#[test]
fn anderson_on_the_rotation_aware_iteration_keeps_its_minimum() {
    let input = twisted([8, 2, 2], 1.2);
    let plain = run(&input, &settings(MethodName::Wrapd));
    for method in [MethodName::RAdmm, MethodName::Wrapd, MethodName::WAdmm] {
        let mut accelerated = settings(method);
        accelerated.anderson.others = 5;
        let end = run(&input, &accelerated);
        assert_eq!(end.status, Status::Converged, "{method:?}: {}", end.report.reason);
        let (a, b) = (end.report.energy.unwrap(), plain.report.energy.unwrap());
        assert!((a - b).abs() <= 1e-10 * b, "{method:?}: {a} and {b}");
    }
}
