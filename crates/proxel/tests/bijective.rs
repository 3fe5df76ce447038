//! Maps without overlaps, on strips that wind over themselves and on the meshes of the papers.

use proxel::mesh::uv::{Certificate, CertificateOptions, certify};
use proxel::mesh::{Mesh, read_mesh_lenient};
use proxel::settings::UnwrapSettings;
use proxel::split::Status;
use proxel::unwrap::{Hooks, UnwrapInput, Unwrapped, unwrap};
use std::path::PathBuf;

/// A ramp of so many turns around a pillar of radius 1, 0.4 wide: what is flat of it winds over itself after one. With a hole,
/// two squares in the middle are left out.
fn ramp(turns: f64, hole: bool) -> Mesh {
    let (along, across) = ((40.0 * turns) as u32, 4);
    let mut points = Vec::new();
    for i in 0..=along {
        for j in 0..=across {
            let angle = turns * 2.0 * std::f64::consts::PI * f64::from(i) / f64::from(along);
            let radius = 1.0 + 0.1 * f64::from(j);
            points.push([radius * angle.cos(), radius * angle.sin(), 0.1 * angle]);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..along {
        for j in (0..across).filter(|j| !(hole && i == along / 2 && (1..3).contains(j))) {
            let [a, b] = [i * (across + 1) + j, (i + 1) * (across + 1) + j];
            triangles.extend([[a, a + 1, b], [b, a + 1, b + 1]]);
        }
    }
    Mesh::from_triangles("ramp", points, &triangles)
}

fn bijective() -> UnwrapSettings {
    UnwrapSettings { bijective: true, ..UnwrapSettings::default() }
}

fn run(mesh: &Mesh, settings: &UnwrapSettings) -> Unwrapped {
    let input = UnwrapInput { mesh: mesh.clone(), ..UnwrapInput::default() };
    unwrap(&input, settings, &mut Hooks { traced: true, ..Hooks::default() }).expect("a surface")
}

fn certificate(mesh: &Mesh, map: &Unwrapped) -> Certificate {
    let options = CertificateOptions { reversed_faces: map.charts.reversed_faces.clone() };
    certify(&mesh.points, &mesh.faces, &map.uv, &options).expect("a map of this mesh")
}

fn assert_bijective(name: &str, c: &Certificate) {
    assert_eq!((c.flips, c.zero_area), (0, 0), "{name}");
    assert!(c.overlaps.is_injective(), "{name}: {:?}", c.overlaps);
}

/// The free map overlaps, the other does not, at an energy at most so many times the free one.
fn compare(name: &str, mesh: &Mesh, most: f64) {
    let free = certificate(mesh, &run(mesh, &UnwrapSettings::default()));
    assert!(free.overlaps.triangle_pairs > 0, "{name}: the free map is to overlap");
    let map = run(mesh, &bijective());
    let c = certificate(mesh, &map);
    assert_bijective(name, &c);
    assert_eq!(map.status, Status::Converged, "{name}: {}", map.report.reason);
    let ratio = c.distortion.energy / free.distortion.energy;
    assert!((1.0 - 1e-9..=most).contains(&ratio), "{name}: {ratio}");
    // The gradient of chart and scaffold, by the report's own measure.
    assert!(map.report.gradient_ratio.is_some_and(|g| g <= UnwrapSettings::default().tol), "{name}");
    // Rows go on where those of the free map ended.
    assert!(map.rows.iter().enumerate().all(|(k, row)| row.iteration == k), "{name}");
    assert!(map.rows.windows(2).all(|w| w[0].seconds <= w[1].seconds), "{name}");
    assert_eq!(map.report.iterations, map.rows.len() - 1, "{name}");
    // The largest number of a chart, and the sum over all.
    assert!(map.report.accepted + map.report.rejected >= map.report.iterations, "{name}");
}

#[test]
fn a_ramp_is_laid_out_beside_itself() {
    compare("ramp", &ramp(1.25, false), 1.05);
    compare("ramp with a hole", &ramp(1.25, true), 1.05);
}

#[test]
fn the_reason_names_the_scaffold() {
    let map = run(&ramp(1.25, false), &bijective());
    assert!(map.report.reason.contains("chart and scaffold"), "{}", map.report.reason);
}

#[test]
fn a_map_without_overlaps_is_left_alone() {
    let mesh = ramp(0.8, true);
    let (free, map) = (run(&mesh, &UnwrapSettings::default()), run(&mesh, &bijective()));
    assert_bijective("short ramp", &certificate(&mesh, &free));
    assert_eq!(free.uv, map.uv);
    assert_eq!((free.report.iterations, &free.report.reason), (map.report.iterations, &map.report.reason));
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let mesh = ramp(1.25, false);
    let of = |threads| run(&mesh, &UnwrapSettings { threads: Some(threads), ..bijective() }).uv;
    let one = of(1);
    assert!(one == of(2) && one == of(3));
}

#[test]
fn a_run_cut_short_has_no_overlaps_either() {
    let mesh = ramp(1.25, false);
    let whole = run(&mesh, &UnwrapSettings::default()).report.iterations;
    for more in [0, 5] {
        let map = run(&mesh, &UnwrapSettings { max_iters: whole + more, ..bijective() });
        assert_bijective("cut short", &certificate(&mesh, &map));
        assert_eq!((map.status, map.report.iterations), (Status::Stopped, whole + more));
        assert!(map.report.reason.contains("--max-iters"), "{}", map.report.reason);
    }
}

#[test]
fn pins_are_refused() {
    let input = UnwrapInput { mesh: ramp(0.5, false), pins: vec![(0, [0.0, 0.0])], ..UnwrapInput::default() };
    let error = unwrap(&input, &bijective(), &mut Hooks::default()).expect_err("pins");
    assert!(error.0.contains("--bijective"), "{error}");
}

/// A mesh of the data; none where it is missing, which is said.
fn data(path: &str) -> Option<Mesh> {
    let found = std::env::var_os("PROXEL_DATA").map(|dir| PathBuf::from(dir).join(path));
    match found.filter(|path| path.exists()) {
        Some(path) => Some(read_mesh_lenient(&path).expect("a mesh")),
        None => {
            eprintln!("skipped: PROXEL_DATA names no folder with {path}");
            None
        }
    }
}

#[test]
fn real_meshes_end_within_a_twentieth_of_the_free_energy() {
    // Energies with and without overlaps: 1.02359 and 1.02232, 2.3128 and 2.2826.
    for (path, most) in [("parameterization/horse.obj", 1.002), ("surfaces/spot.obj", 1.02)] {
        if let Some(mesh) = data(path) {
            compare(path, &mesh, most);
        }
    }
}
