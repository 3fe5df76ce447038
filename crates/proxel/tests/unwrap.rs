//! Maps of surfaces: the same minimum by every method, on generated surfaces and on those of the papers.

use proxel::mesh::Mesh;
use proxel::mesh::generate::cloth;
use proxel::mesh::uv::{Certificate, CertificateOptions, certify};
use proxel::settings::{UnwrapMethod, UnwrapSettings};
use proxel::split::Status;
use proxel::unwrap::{Flat, Hooks, MapRow, UnwrapInput, Unwrapped, Unwrapper, Weights, start, uniform, unwrap};
use std::path::PathBuf;

/// The heightfield z = 0.6 sin 2.5 x cos 2 y over [-1, 1]^2.
fn patch(cells: usize) -> Mesh {
    let mut mesh = cloth([cells, cells], [2.0, 2.0]).expect("a sheet");
    let (low, _) = mesh.bounding_box().expect("vertices");
    for p in &mut mesh.points {
        let q = [p[0] - low[0] - 1.0, p[1] + p[2] - low[1] - low[2] - 1.0];
        *p = [q[0], q[1], 0.6 * (2.5 * q[0]).sin() * (2.0 * q[1]).cos()];
    }
    mesh
}

fn settings(method: UnwrapMethod) -> UnwrapSettings {
    UnwrapSettings { method, pack: false, max_iters: 3000, ..UnwrapSettings::default() }
}

fn run(mesh: &Mesh, settings: &UnwrapSettings) -> Unwrapped {
    let input = UnwrapInput { mesh: mesh.clone(), ..UnwrapInput::default() };
    unwrap(&input, settings, &mut Hooks { traced: true, ..Hooks::default() }).expect("a surface")
}

fn certificate(mesh: &Mesh, map: &Unwrapped) -> Certificate {
    let options = CertificateOptions { reversed_faces: map.charts.reversed_faces.clone() };
    certify(&mesh.points, &mesh.faces, &map.uv, &options).expect("a map of this mesh")
}

/// A parameterization mesh of the papers; none where the data is missing, which is said.
fn data(name: &str) -> Option<Mesh> {
    let found = std::env::var_os("PROXEL_DATA").map(|dir| PathBuf::from(dir).join("parameterization").join(name));
    match found.filter(|path| path.exists()) {
        Some(path) => Some(proxel::mesh::read_mesh(&path).expect("a mesh")),
        None => {
            eprintln!("skipped: PROXEL_DATA names no folder with parameterization/{name}");
            None
        }
    }
}

/// Whether a map has moved by a rotation only: distances between vertices are what they were.
fn same_shape(a: &Unwrapped, b: &Unwrapped, tolerance: f64) {
    let (p, q) = (&a.uv.coordinates, &b.uv.coordinates);
    assert_eq!(p.len(), q.len());
    let distance = |p: &[[f64; 2]], i: usize, j: usize| (p[i][0] - p[j][0]).hypot(p[i][1] - p[j][1]);
    let size = (0..p.len()).map(|i| distance(p, 0, i)).fold(0.0, f64::max);
    for i in 0..p.len() {
        let j = (i * 7919 + 13) % p.len();
        let gap = (distance(p, i, j) - distance(q, i, j)).abs();
        assert!(gap <= tolerance * size, "{i} and {j}: {gap} of {size}");
    }
}

#[test]
fn every_method_reaches_the_same_map() {
    let mesh = patch(12);
    let reference = run(&mesh, &settings(UnwrapMethod::Newton));
    assert_eq!(reference.status, Status::Converged, "{}", reference.report.reason);
    let energy = certificate(&mesh, &reference).distortion.energy;
    for method in UnwrapMethod::ALL {
        let map = run(&mesh, &settings(method));
        let c = certificate(&mesh, &map);
        assert_eq!((c.flips, c.zero_area, c.overlaps.triangle_pairs), (0, 0, 0), "{}", method.as_str());
        // First-order methods with static weights or proxies crawl at the end.
        let slow = matches!(method, UnwrapMethod::Slim | UnwrapMethod::Akvf | UnwrapMethod::Bcqn);
        let tolerance = if slow { 1e-6 } else { 1e-9 };
        let gap = c.distortion.energy / energy - 1.0;
        assert!(gap.abs() <= tolerance, "{}: {gap:e}, {}", method.as_str(), map.report.reason);
        if !slow {
            assert_eq!(map.status, Status::Converged, "{}: {}", method.as_str(), map.report.reason);
            same_shape(&map, &reference, 1e-5);
        }
        assert_eq!(map.report.iterations, map.rows.len() - 1);
    }
}

#[test]
fn the_report_agrees_with_the_certificate() {
    let mesh = patch(10);
    let map = run(&mesh, &settings(UnwrapMethod::Auto));
    let c = certificate(&mesh, &map);
    let energy = map.report.energy.expect("finite");
    assert!((energy - c.distortion.energy).abs() <= 1e-12 * energy);
    // In units of the mesh the scale is the best one.
    assert!((c.distortion.scale - 1.0).abs() < 1e-8, "{}", c.distortion.scale);
    let last = map.rows.last().expect("rows");
    assert!((last.energy - energy).abs() <= 1e-12 * energy && last.flips == 0);
    assert!((map.rows[0].energy - 1.0) > 10.0 * (energy - 1.0), "the circle is far from the minimum");
}

#[test]
fn a_flat_sheet_becomes_itself() {
    let mesh = cloth([9, 4], [3.0, 1.0]).expect("a sheet");
    let map = run(&mesh, &settings(UnwrapMethod::Auto));
    let c = certificate(&mesh, &map);
    assert!((c.distortion.energy - 1.0).abs() < 1e-12 && (c.distortion.max_stretch - 1.0).abs() < 1e-6);
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let mesh = patch(40);
    let of = |threads| run(&mesh, &UnwrapSettings { threads: Some(threads), ..UnwrapSettings::default() }).uv;
    let one = of(1);
    assert!(one == of(2) && one == of(3));
}

#[test]
fn units_and_origin_change_nothing() {
    let mesh = patch(16);
    let base = run(&mesh, &settings(UnwrapMethod::Auto));
    let size = base.uv.coordinates.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    let moved = |scale: f64, offset: f64, tolerance: f64| {
        let points = mesh.points.iter().map(|p| p.map(|v| v * scale + offset)).collect();
        let map = run(&mesh.with_points(points).expect("as many"), &settings(UnwrapMethod::Auto));
        for (a, b) in base.uv.coordinates.iter().flatten().zip(map.uv.coordinates.iter().flatten()) {
            assert!((a - b / scale).abs() <= tolerance * size, "{a} {b}");
        }
    };
    moved(1e-6, 0.0, 1e-9);
    moved(1e8, 0.0, 1e-9);
    moved(1.0, 1e6, 1e-7);
}

#[test]
fn pins_hold_and_weights_pull() {
    let mesh = patch(10);
    let free = run(&mesh, &settings(UnwrapMethod::Auto));
    let pins = vec![(0, [0.25, -0.125]), (5, [1.3, 0.1])];
    let input = UnwrapInput { mesh: mesh.clone(), pins: pins.clone(), ..UnwrapInput::default() };
    let held = unwrap(&input, &UnwrapSettings::default(), &mut Hooks::default()).expect("a surface");
    assert_eq!(held.status, Status::Converged, "{}", held.report.reason);
    let chart = &held.charts.charts[0];
    for (v, at) in &pins {
        let local = chart.vertices.iter().position(|u| u == v).expect("mapped");
        assert_eq!(held.uv.coordinates[local], *at);
    }
    let (c, best) = (certificate(&mesh, &held), certificate(&mesh, &free));
    assert!(c.flips == 0 && c.distortion.energy_as_given > best.distortion.energy);
    // Faces that count a hundred times as much are less distorted.
    let half = mesh.faces.len() / 2;
    let weights: Vec<f64> = (0..mesh.faces.len()).map(|f| if f < half { 100.0 } else { 1.0 }).collect();
    let input = UnwrapInput { mesh: mesh.clone(), weights: Some(weights), ..UnwrapInput::default() };
    let pulled = unwrap(&input, &settings(UnwrapMethod::Auto), &mut Hooks::default()).expect("a surface");
    assert_eq!(pulled.status, Status::Converged, "{}", pulled.report.reason);
    let part = |map: &Unwrapped| {
        let faces: Vec<[u32; 3]> = (0..half).map(|f| std::array::from_fn(|k| mesh.faces.get(f)[k])).collect();
        let part = Mesh::from_triangles("part", mesh.points.clone(), &faces);
        let uv = proxel::mesh::uv::UvMap {
            coordinates: map.uv.coordinates.clone(),
            corners: map.uv.corners[..3 * half].to_vec(),
        };
        certify(&part.points, &part.faces, &uv, &CertificateOptions::default())
            .expect("a map")
            .distortion
            .energy_as_given
    };
    assert!(part(&pulled) < part(&free), "{} {}", part(&pulled), part(&free));
}

#[test]
fn an_unwrapper_goes_where_unwrap_goes_and_follows_changes() {
    let mesh = patch(14);
    let input = UnwrapInput { mesh: mesh.clone(), ..UnwrapInput::default() };
    let once = run(&mesh, &settings(UnwrapMethod::Auto));
    let mut live = Unwrapper::new(input, settings(UnwrapMethod::Auto)).expect("a surface");
    let mut seen = Vec::new();
    let end = live.run(&mut |standing| {
        seen.push(*standing);
        true
    });
    assert_eq!(end, Ok(Status::Converged));
    assert_eq!(seen.len(), once.report.iterations);
    assert_eq!(live.map().expect("a map"), once.uv, "the same bits");
    // A pin moves the map as a whole: it is there at once. Two that pull it apart take a few steps, fewer than anew.
    let at = |map: &proxel::mesh::uv::UvMap, charts: &proxel::mesh::charts::Charts, v: u32| {
        map.coordinates[charts.charts[0].vertices.iter().position(|u| *u == v).expect("mapped")]
    };
    let (a, b) = (at(&once.uv, &once.charts, 0), at(&once.uv, &once.charts, 14));
    let apart = [1.1 * (b[0] - a[0]) + a[0], 1.1 * (b[1] - a[1]) + a[1]];
    live.set_pins(vec![(0, a), (14, apart)]).expect("vertices");
    let before = live.standing().iteration;
    assert_eq!(live.run(&mut |_| true), Ok(Status::Converged));
    let held = live.map().expect("a map");
    assert_eq!((at(&held, live.charts(), 0), at(&held, live.charts(), 14)), (a, apart));
    assert!(live.standing().energy > once.report.energy.expect("finite"));
    assert!(live.standing().iteration - before <= once.report.iterations);
    // Cancelled by the caller.
    live.set_pins(Vec::new()).expect("no pins");
    assert_eq!(live.run(&mut |_| false), Ok(Status::Cancelled));
    // A seam from border to border makes two charts.
    let row: Vec<[u32; 2]> = (0..14).map(|k| [7 * 15 + k, 7 * 15 + k + 1]).collect();
    live.set_seams(row).expect("edges");
    assert_eq!(live.charts().charts.len(), 2);
    assert_eq!(live.run(&mut |_| true), Ok(Status::Converged));
    assert!(live.standing().energy < once.report.energy.expect("finite"));
    assert!(live.set_seams(vec![[0, 200]]).is_err() && live.charts().charts.len() == 2);
}

#[test]
fn a_fixed_border_stays_on_the_circle() {
    let mesh = patch(10);
    let held = run(&mesh, &UnwrapSettings { fixed_boundary: true, ..settings(UnwrapMethod::Auto) });
    assert_eq!(held.status, Status::Converged, "{}", held.report.reason);
    let chart = &held.charts.charts[0];
    let radius = |v: &u32| held.uv.coordinates[*v as usize][0].hypot(held.uv.coordinates[*v as usize][1]);
    let first = radius(&chart.loops[0][0]);
    assert!(chart.loops[0].iter().all(|v| (radius(v) - first).abs() < 1e-12 * first));
    let c = certificate(&mesh, &held);
    assert!((std::f64::consts::PI * first * first / c.distortion.rest_area - 1.0).abs() < 1e-12, "the same area");
    assert!(c.flips == 0 && c.overlaps.triangle_pairs == 0);
}

#[test]
fn tutte_stands_in_where_the_harmonic_start_flips() {
    // A needle whose obtuse triangles have negative cotangents beyond what the fan can bear.
    let points =
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.001, 0.0], [0.5, 0.999, 0.0]];
    let triangles = [[0, 1, 4], [1, 2, 5], [2, 3, 5], [3, 0, 4], [4, 1, 5], [3, 4, 5]];
    let loops = [vec![0, 1, 2, 3]];
    let flat = Flat::new(&points, &triangles, &loops).expect("an area");
    let found = start(&flat).expect("a start");
    assert_eq!(found.flips, 0, "{:?}", found.weights);
    assert!(matches!(found.weights, Some(Weights::Cotangent | Weights::Uniform)));
}

/// Iterations to 1 % of the least energy, by the energy of the local variable while triangles are flipped, as the paper
/// counts, and to 1e-6.
fn counts(rows: &[MapRow], least: f64) -> (Option<usize>, Option<usize>) {
    let seen = |r: &MapRow| if r.flips > 0 { r.energy_z } else { r.energy };
    let early = rows.iter().position(|r| seen(r) <= 1.01 * least);
    let late = rows.iter().position(|r| r.flips == 0 && r.energy <= least * (1.0 + 1e-6));
    (early, late)
}

#[test]
fn horse_as_in_the_paper() {
    let Some(mesh) = data("horse.obj") else { return };
    let least = 1.022_320_952_1; // of the reference code, W, Figure 11h
    for (method, early, late) in
        [(UnwrapMethod::Auto, 3, 21), (UnwrapMethod::WrapdCm, 3, 49), (UnwrapMethod::Wrapd, 8, 69)]
    {
        let map = run(&mesh, &UnwrapSettings { max_iters: 80, ..settings(method) });
        let c = certificate(&mesh, &map);
        assert_eq!((c.flips, c.charts, c.seam_length), (0, 1, 0.0));
        let gap = c.distortion.energy / least - 1.0;
        assert!(gap.abs() < 1e-6, "{}: {gap:e}", method.as_str());
        let (found_early, found_late) = counts(&map.rows, least);
        assert!(found_early.is_some_and(|k| k <= early), "{}: {found_early:?}", method.as_str());
        assert!(found_late.is_some_and(|k| k <= late), "{}: {found_late:?}", method.as_str());
    }
}

#[test]
fn dino_whose_harmonic_start_has_flips() {
    let Some(mesh) = data("dino.obj") else { return };
    let map = run(&mesh, &settings(UnwrapMethod::Auto));
    assert_eq!(map.status, Status::Converged, "{}", map.report.reason);
    // Tutte's start has the energy that the reference code reports.
    assert!((map.rows[0].energy / 117.625_295 - 1.0).abs() < 1e-8, "{}", map.rows[0].energy);
    let c = certificate(&mesh, &map);
    assert!(c.flips == 0 && (c.distortion.energy / 1.021_865_882_9 - 1.0).abs() < 1e-9, "{}", c.distortion.energy);
}

#[test]
fn lengths_of_the_map_are_those_of_the_target_metric() {
    let mesh = patch(12);
    // Heights do not count: the surface is its own shadow on the plane, which is flat.
    let shadow = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1e-14]; mesh.faces.len()];
    let input = UnwrapInput { mesh: mesh.clone(), metric: Some(shadow), ..UnwrapInput::default() };
    for method in [UnwrapMethod::Auto, UnwrapMethod::Wrapd] {
        let map = unwrap(&input, &settings(method), &mut Hooks::default()).expect("a surface");
        assert_eq!(map.status, Status::Converged, "{}", map.report.reason);
        let target = map.report.map.as_ref().and_then(|m| m.energy_target).expect("a metric was given");
        assert!((target - 1.0).abs() < 1e-12, "{target}");
        let (chart, uv) = (&map.charts.charts[0], &map.uv.coordinates);
        for t in &chart.triangles {
            for (i, j) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (t[i] as usize, t[j] as usize)) {
                let (p, q) = (mesh.points[chart.vertices[i] as usize], mesh.points[chart.vertices[j] as usize]);
                let (is, asked) = ((uv[i][0] - uv[j][0]).hypot(uv[i][1] - uv[j][1]), (p[0] - q[0]).hypot(p[1] - q[1]));
                assert!((is - asked).abs() < 1e-7 * asked, "{is} {asked}");
            }
        }
    }
    let refused = |metric: Vec<[f64; 6]>| {
        let input = UnwrapInput { mesh: mesh.clone(), metric: Some(metric), ..UnwrapInput::default() };
        unwrap(&input, &UnwrapSettings::default(), &mut Hooks::default()).expect_err("no metric").0
    };
    assert!(refused(vec![uniform(1.0); 3]).contains("3 target metrics for 288 faces"));
    let mut indefinite = vec![uniform(2.0); mesh.faces.len()];
    indefinite[7] = [1.0, 2.0, 0.0, 1.0, 0.0, 1.0];
    assert!(refused(indefinite).contains("face 7"));
}

#[test]
fn newton_strides_away_from_a_flip_that_is_near() {
    let mesh = patch(10);
    let mut near = run(&mesh, &settings(UnwrapMethod::Newton));
    let least = near.report.energy.expect("finite");
    // A vertex inside almost on the opposite edge of one of its triangles.
    let chart = &near.charts.charts[0];
    let is_inside = |v: &u32| chart.loops.iter().all(|l| !l.contains(v));
    let t = chart.triangles.iter().find(|t| t.iter().all(is_inside)).expect("a triangle inside");
    let [v, a, b] = t.map(|v| near.uv.coordinates[v as usize]);
    let v = [0, 1].map(|d| 0.5 * (a[d] + b[d]) + 1e-3 * (v[d] - 0.5 * (a[d] + b[d])));
    near.uv.coordinates[t[0] as usize] = v;
    let iterations = |stride: f64| {
        let input = UnwrapInput { mesh: mesh.clone(), start: Some(near.uv.clone()), ..UnwrapInput::default() };
        let settings = UnwrapSettings { stride, ..settings(UnwrapMethod::Newton) };
        let map = unwrap(&input, &settings, &mut Hooks::default()).expect("a surface");
        assert_eq!(map.status, Status::Converged, "{}", map.report.reason);
        assert!((map.report.energy.expect("finite") - least).abs() < 1e-12 * least);
        map.report.iterations
    };
    let (plain, striding) = (iterations(1.0), iterations(1024.0));
    assert!(striding + 2 <= plain, "{plain} {striding}");
}
