//! Counts and energies on the real models of the WRAPD paper, where PROXEL_DATA names the folder that holds them.

use proxel::deform::{DeformInput, Hooks, deform};
use proxel::mesh::{read_mesh, read_points};
use proxel::settings::{DeformSettings, MethodName};
use proxel::split::Status;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// A model's folder, or none, saying why.
fn folder(model: &str) -> Option<PathBuf> {
    let Some(data) = std::env::var_os("PROXEL_DATA") else {
        eprintln!("{model}: skipped, PROXEL_DATA is not set");
        return None;
    };
    let folder = PathBuf::from(data).join("quasistatic").join(model);
    let found = folder.join("rest.node").is_file();
    if !found {
        eprintln!("{model}: skipped, {} has no rest.node", folder.display());
    }
    found.then_some(folder)
}

fn input(folder: &std::path::Path) -> DeformInput {
    let rest = read_mesh(&folder.join("rest.node")).expect("a mesh");
    let start = read_points(&folder.join("init.node")).expect("positions");
    let reference = Some(read_points(&folder.join("minimum.npy")).expect("positions"));
    let pins = std::fs::read_to_string(folder.join("handles.txt")).expect("pins");
    let pins = pins.split_whitespace().map(|t| t.parse::<u32>().expect("an index"));
    let fixed = pins.map(|v| (v, start[v as usize])).collect();
    DeformInput { rest, start: Some(start), fixed, reference, ..Default::default() }
}

/// Iterations of `wrapd` to a position error of 1e-4, at most the larger of the paper's and its authors' code's.
fn assert_iterations(model: &str, most: usize) {
    let Some(folder) = folder(model) else { return };
    let mut hooks = Hooks::default();
    let cancel = hooks.cancel.clone();
    let mut reached = None;
    let mut on_row = |row: &proxel::report::TraceRow| {
        if row.position_error <= 1e-4 {
            reached = Some(row.iteration);
            cancel.store(true, Ordering::Relaxed);
        }
    };
    hooks.trace = Some(&mut on_row);
    let settings = DeformSettings { method: MethodName::Wrapd, max_iters: most, ..Default::default() };
    deform(&input(&folder), &settings, &mut hooks).expect("good input");
    assert!(reached.is_some_and(|k| k <= most), "{model}: 1e-4 is not reached in {most} iterations");
}

#[test]
fn iterations_to_1e_4_are_at_most_the_published_ones() {
    for (model, most) in [
        ("stretch", 307),
        ("shear", 159),
        ("untwist", 134),
        ("dancer", 163),
        ("dino", 430),
        ("homer", 92),
        ("cat", 257),
        ("dinoskel", 239),
        ("centaur", 251),
    ] {
        assert_iterations(model, most);
    }
}

#[test]
fn the_default_method_ends_at_the_known_minimum() {
    for (model, energy) in [("shear", 1375065.960462792), ("stretch", 12851085.85449005), ("homer", 1858.72171386806)] {
        let Some(folder) = folder(model) else { continue };
        let result = deform(&input(&folder), &DeformSettings::default(), &mut Hooks::default()).expect("good input");
        let report = &result.report;
        assert_eq!(result.status, Status::Converged, "{model}: {}", report.reason);
        let found = report.energy.expect("an energy");
        assert!((found - energy).abs() <= 1e-11 * energy, "{model}: {found}, not {energy}");
        assert!(report.gradient_ratio.expect("a ratio") <= 1e-9, "{model}");
        assert!(report.position_error.expect("a reference") <= 1e-7, "{model}");
        assert_eq!(report.inverted, Some(0), "{model}");
    }
}
