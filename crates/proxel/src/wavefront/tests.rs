use super::*;
use proxel_imaging::wavefront::{SimulateSettings, SimulatedPair, simulate};

fn pair(size: usize, max_shift: f64) -> SimulatedPair {
    simulate(&SimulateSettings { size, max_shift, seed: 5 }).unwrap()
}

fn by(method: WavefrontMethod) -> WavefrontSettings {
    WavefrontSettings { method, threads: Some(1), ..WavefrontSettings::default() }
}

fn error(found: &Image, known: &Image) -> f64 {
    let square = |f: &dyn Fn(usize) -> f64| (0..found.n_pixels()).map(|k| f(k).powi(2)).sum::<f64>();
    let (a, b) = (&found.channels[0], &known.channels[0]);
    (square(&|k| a[k] - b[k]) / square(&|k| b[k])).sqrt()
}

/// All methods find the wavefront, and say that they have converged.
#[test]
fn every_method_finds_it() {
    let pair = pair(96, 1.0);
    for method in WavefrontMethod::ALL {
        let found = wavefront(&pair.reference, &pair.captured, &by(method), &mut Hooks::default()).unwrap();
        assert_eq!(found.status, Status::Converged, "{method:?}: {}", found.report.reason);
        let error = error(&found.phi, &pair.phi);
        assert!(error < 0.1, "{method:?}: {error}");
        let of = found.report.wavefront.unwrap();
        assert_eq!((of.levels, of.problems), (1, 3));
        // The largest of all pixels, of which some at the border are off.
        assert!(of.shift_max > 0.8 && of.shift_max < 3.0, "{}", of.shift_max);
    }
}

#[test]
fn limits_keep_what_is_known() {
    let pair = pair(160, 1.0);
    let run = |settings: &WavefrontSettings, cancel: bool| {
        let hooks = &mut Hooks { cancel: Arc::new(AtomicBool::new(cancel)), ..Hooks::default() };
        wavefront(&pair.reference, &pair.captured, settings, hooks).unwrap()
    };
    let few = run(&WavefrontSettings { max_iters: 2, tol: 1e-9, ..by(WavefrontMethod::Admm) }, false);
    assert_eq!((few.status, few.report.iterations), (Status::Stopped, 12), "2 levels, 3 warps, 2 iterations");
    assert_eq!(few.report.warnings.len(), 3);
    let cancelled = run(&by(WavefrontMethod::Auto), true);
    assert_eq!((cancelled.status, cancelled.report.iterations), (Status::Cancelled, 1));
    assert_eq!(cancelled.phi.n_pixels(), 160 * 160);
    let late = run(&WavefrontSettings { time_limit: Some(1e-9), tol: 1e-9, ..by(WavefrontMethod::Auto) }, false);
    assert_eq!(late.status, Status::Stopped);
    assert!(late.report.reason.contains("--time-limit"));
}

#[test]
fn the_trace_counts_through() {
    let pair = pair(160, 0.5);
    let mut rows: Vec<TraceRow> = Vec::new();
    let mut on_row = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { trace: Some(&mut on_row), ..Hooks::default() };
    let settings = WavefrontSettings { scale: -0.05, ..by(WavefrontMethod::AaZ) };
    let found = wavefront(&pair.reference, &pair.captured, &settings, &mut hooks).unwrap();
    assert_eq!(rows.len(), found.report.iterations);
    assert!(rows.iter().enumerate().all(|(k, row)| row.iteration == k + 1 && row.primal_residual.is_finite()));
    let plain = wavefront(&pair.reference, &pair.captured, &by(WavefrontMethod::AaZ), &mut Hooks::default()).unwrap();
    let same = |(a, b): (&f64, &f64)| *a == b * -0.05;
    assert!(found.phi.channels[0].iter().zip(&plain.phi.channels[0]).all(same), "scaled, and the same otherwise");
}

#[test]
fn bad_input() {
    let good = pair(48, 0.5);
    let wrong = |a: &Image, settings: &WavefrontSettings| {
        wavefront(a, &good.captured, settings, &mut Hooks::default()).expect_err("refused").0
    };
    let flat = Image::new(48, 48, vec![vec![0.0; 48 * 48]]).unwrap();
    assert!(wrong(&flat, &by(WavefrontMethod::Auto)).contains("0 everywhere"));
    let other = Image::new(16, 16, vec![(0..256).map(f64::from).collect()]).unwrap();
    assert!(wrong(&other, &by(WavefrontMethod::Auto)).contains("16 x 16 and 48 x 48"));
    let mut nan = good.reference.clone();
    nan.channels[0][7] = f64::NAN;
    assert!(wrong(&nan, &by(WavefrontMethod::Auto)).contains("finite"));
    for settings in [
        WavefrontSettings { beta: 0.0, ..WavefrontSettings::default() },
        WavefrontSettings { mu: f64::NAN, ..WavefrontSettings::default() },
        WavefrontSettings { scale: 0.0, ..WavefrontSettings::default() },
        WavefrontSettings { relaxation: 2.0, ..WavefrontSettings::default() },
        WavefrontSettings { warps: 0, ..WavefrontSettings::default() },
        WavefrontSettings { margin: usize::MAX, ..WavefrontSettings::default() },
        WavefrontSettings { threads: Some(0), ..WavefrontSettings::default() },
    ] {
        assert!(wrong(&good.reference, &settings).contains("--"), "{settings:?}");
    }
}
