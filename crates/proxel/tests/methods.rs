//! All methods find the same minimum, on any number of threads the same bits, and say truly how they ended.

use proxel::deform::{DeformInput, Deformation, Hooks, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::settings::{DeformSettings, MethodName, Schedule};
use proxel::split::Status;

/// A beam held at one end and turned at the other.
fn twisted(cells: [usize; 3], angle: f64) -> DeformInput {
    let rest = beam(cells, [3.0, 0.6, 0.6], CellSplit::Five).expect("a beam");
    let (low, high) = rest.bounding_box().expect("vertices");
    let mut fixed = Vec::new();
    let start: Vec<[f64; 3]> = rest
        .points
        .iter()
        .map(|p| {
            let (y, z) = (p[1] - (low[1] + high[1]) / 2.0, p[2] - (low[2] + high[2]) / 2.0);
            let (sin, cos) = (angle * (p[0] - low[0]) / (high[0] - low[0])).sin_cos();
            [p[0], y * cos - z * sin, y * sin + z * cos]
        })
        .collect();
    for (v, p) in rest.points.iter().enumerate() {
        if p[0] < low[0] + 1e-9 || p[0] > high[0] - 1e-9 {
            fixed.push((v as u32, start[v]));
        }
    }
    DeformInput { rest, start: Some(start), fixed, ..Default::default() }
}

fn run(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    deform(input, settings, &mut Hooks::default()).expect("good input")
}

fn distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn all_methods_agree() {
    let input = twisted([10, 2, 2], 1.0);
    let tight =
        |method, schedule| DeformSettings { method, tol: 1e-8, max_iters: 20_000, ..DeformSettings::of(schedule) };
    let wrapd = run(&input, &tight(MethodName::Wrapd, Schedule::Default));
    assert_eq!(wrapd.status, Status::Converged, "{}", wrapd.report.reason);
    let size = distance(&wrapd.positions, &vec![[0.0; 3]; wrapd.positions.len()]);
    for method in MethodName::ALL {
        for schedule in [Schedule::Default, Schedule::Reference, Schedule::Paper] {
            let mut settings = tight(method, schedule);
            if method == MethodName::AdmmPd {
                settings.admm.weight_scale = 2.0; // its weights have to be tuned
            }
            let other = run(&input, &settings);
            assert_eq!(other.status, Status::Converged, "{method:?} {schedule:?}: {}", other.report.reason);
            let apart = distance(&other.positions, &wrapd.positions) / size;
            assert!(apart < 1e-6, "{method:?} {schedule:?}: {apart}");
            let (a, b) = (other.report.energy.unwrap(), wrapd.report.energy.unwrap());
            assert!((a - b).abs() <= 1e-8 * b.abs(), "{method:?} {schedule:?}: {a} and {b}");
            assert_eq!(other.report.inverted, Some(0));
        }
    }
}

#[test]
fn every_energy_is_solved() {
    let input = twisted([8, 2, 2], 0.8);
    for energy in proxel::model::energy::names(3).into_iter().chain(["spring"]) {
        let mut settings = DeformSettings { tol: 1e-7, ..Default::default() };
        settings.material.energy = energy.to_string();
        let result = run(&input, &settings);
        assert_eq!(result.status, Status::Converged, "{energy}: {}", result.report.reason);
        let report = &result.report;
        assert!(report.gradient_ratio.unwrap() <= 1e-7 && report.energy.unwrap() > 0.0, "{energy}: {report:?}");
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let input = twisted([20, 4, 4], 1.5);
    let mut settings = DeformSettings { max_iters: 70, ..Default::default() };
    settings.admm.reweight_from = 20;
    for method in MethodName::ALL {
        let mut on = |threads| {
            settings.method = method;
            settings.threads = Some(threads);
            let result = run(&input, &settings);
            let bits: Vec<u64> = result.positions.as_flattened().iter().map(|v| v.to_bits()).collect();
            (bits, result.report.energy.map(f64::to_bits), result.report.gradient_norm.map(f64::to_bits))
        };
        let one = on(1);
        assert!(one == on(2) && one == on(3) && one == on(1), "{method:?}");
    }
}

#[test]
fn units_and_origin_do_not_matter() {
    let input = twisted([8, 2, 2], 0.9);
    let settings = DeformSettings { tol: 1e-10, ..Default::default() };
    let plain = run(&input, &settings);
    let size = distance(&plain.positions, &vec![[0.0; 3]; plain.positions.len()]);
    let mapped = |scale: f64, offset: f64| {
        let map = |p: &[f64; 3]| p.map(|c| c * scale + offset);
        let mut input = input.clone();
        input.rest.points = input.rest.points.iter().map(map).collect();
        input.start = input.start.map(|s| s.iter().map(map).collect());
        input.fixed = input.fixed.iter().map(|(v, p)| (*v, map(p))).collect();
        let result = run(&input, &settings);
        assert_eq!(result.status, Status::Converged, "scale {scale}, offset {offset}: {}", result.report.reason);
        let back: Vec<[f64; 3]> = result.positions.iter().map(|p| p.map(|c| (c - offset) / scale)).collect();
        distance(&back, &plain.positions) / size
    };
    assert!(mapped(1e-6, 0.0) < 1e-9);
    assert!(mapped(1e8, 0.0) < 1e-9);
    let settings_far = mapped(1.0, 1e6);
    assert!(settings_far < 1e-7, "{settings_far}");
}

#[test]
fn limits_and_cancel_tell_the_truth() {
    let input = twisted([8, 2, 2], 1.0);
    let limited = run(&input, &DeformSettings { max_iters: 3, ..Default::default() });
    assert_eq!((limited.status, limited.report.iterations), (Status::Stopped, 3));
    let timed = run(&input, &DeformSettings { time_limit: Some(0.0), ..Default::default() });
    assert_eq!((timed.status, timed.report.iterations), (Status::Stopped, 0));
    let mut hooks = Hooks::default();
    let cancel = hooks.cancel.clone();
    let mut rows = Vec::new();
    let mut on_row = |row: &proxel::report::TraceRow| {
        rows.push(*row);
        cancel.store(row.iteration == 5, std::sync::atomic::Ordering::Relaxed);
    };
    hooks.trace = Some(&mut on_row);
    let cancelled = deform(&input, &DeformSettings::default(), &mut hooks).expect("good input");
    assert_eq!((cancelled.status, cancelled.report.iterations), (Status::Cancelled, 5));
    assert_eq!(rows.iter().map(|r| r.iteration).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
    // The best so far: fewest inverted, then lowest energy.
    let best =
        rows.iter().map(|r| (r.inverted, r.energy)).fold((u64::MAX, f64::INFINITY), |a, b| if b < a { b } else { a });
    assert_eq!(cancelled.report.inverted, Some(best.0));
    let energy = cancelled.report.energy.unwrap();
    assert!((energy - best.1).abs() <= 1e-9 * best.1, "{energy} is not {}", best.1);
}

#[test]
fn hopeless_starts_are_solved() {
    let mut input = twisted([6, 2, 2], 0.5);
    let settings = DeformSettings::default();
    let good = run(&input, &settings);
    let is_fixed: Vec<bool> =
        (0..input.rest.n_verts()).map(|v| input.fixed.iter().any(|(f, _)| *f as usize == v)).collect();
    let mirrored: Vec<[f64; 3]> = input.rest.points.iter().map(|p| [p[0], -p[1], p[2]]).collect();
    for (name, place) in [("collapsed", None), ("mirrored", Some(&mirrored))] {
        let start = input.start.clone().unwrap();
        let broken = start.iter().enumerate().map(|(v, p)| match (is_fixed[v], place) {
            (true, _) => *p,
            (false, None) => [0.1, 0.2, 0.3],
            (false, Some(m)) => m[v],
        });
        let broken: Vec<[f64; 3]> = broken.collect();
        input.start = Some(broken);
        let result = run(&input, &settings);
        assert_eq!(result.status, Status::Converged, "{name}: {}", result.report.reason);
        assert_eq!(result.report.inverted, Some(0), "{name}");
        // From the mirror image the body ends turned inside itself: another minimum, and a true one.
        let (a, b) = (result.report.energy.unwrap(), good.report.energy.unwrap());
        assert!(place.is_some() || (a - b).abs() < 1e-8 * b, "{name}: {a} is not {b}");
        input.start = Some(start);
    }
}
