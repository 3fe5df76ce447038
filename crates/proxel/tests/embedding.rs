//! Surfaces that are deformed as bodies: pins hold, motions are carried, what is no body is told.

use proxel::deform::{DeformInput, Deformation, Hooks, deform, extras};
use proxel::mesh::generate::{CellSplit, beam, cloth};
use proxel::mesh::topology::surface;
use proxel::mesh::{Mesh, Polygons};
use proxel::settings::{DeformSettings, SurfaceModel};
use proxel::split::Status;

type V3 = [f64; 3];

/// The skin of a bar of 3 x 0.6 x 0.6 along x.
fn bar() -> Mesh {
    let body = beam([10, 3, 3], [3.0, 0.6, 0.6], CellSplit::Six).expect("a beam");
    Mesh { faces: surface(&body), tets: Vec::new(), name: "bar".into(), ..body }
}

fn turned(p: V3, angle: f64) -> V3 {
    let (sin, cos) = angle.sin_cos();
    [p[0], cos * p[1] - sin * p[2], sin * p[1] + cos * p[2]]
}

/// One end held, the other turned around x and moved.
fn twisted(angle: f64) -> DeformInput {
    let rest = bar();
    let ends = rest.points.iter().enumerate().filter_map(|(v, &p)| match p[0] {
        x if x < -1.49 => Some((v as u32, p)),
        x if x > 1.49 => Some((v as u32, turned([p[0] + 0.1, p[1], p[2]], angle))),
        _ => None,
    });
    let fixed: Vec<(u32, V3)> = ends.collect();
    let faces = rest.faces.clone();
    let used = |v: u32| faces.indices().contains(&v);
    DeformInput { fixed: fixed.into_iter().filter(|f| used(f.0)).collect(), rest, ..DeformInput::default() }
}

fn settings(resolution: usize) -> DeformSettings {
    DeformSettings { resolution, ..DeformSettings::default() }
}

fn run(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    deform(input, settings, &mut Hooks::default()).expect("good input")
}

fn farthest(a: &[V3], b: &[V3]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_twisted_skin_holds_its_pins_and_turns_halfway_in_the_middle() {
    let input = twisted(1.2);
    let result = run(&input, &settings(15));
    assert_eq!(result.status, Status::Converged, "{}", result.report.reason);
    let lattice = result.report.lattice.as_ref().expect("a lattice");
    assert!(lattice.pin_error < 1e-6, "{lattice:?}");
    assert!((lattice.closedness - 0.5).abs() < 1e-2 && lattice.joined_cells == 0, "{lattice:?}");
    assert_eq!(result.report.inverted, Some(0));
    for (v, target) in &input.fixed {
        assert_eq!(result.positions[*v as usize], *target, "vertex {v} bit for bit");
    }
    // An edge of the bar in the middle: turned by half.
    let edge =
        input.rest.points.iter().position(|p| p[0].abs() < 1e-9 && p[1] > 0.29 && p[2] > 0.29).expect("a vertex");
    let p = result.positions[edge];
    let angle = p[2].atan2(p[1]) - std::f64::consts::FRAC_PI_4;
    assert!((angle - 0.6).abs() < 0.05, "{angle}");
    let fields = extras(&input, &settings(15), &result).expect("fields");
    assert_eq!(fields.energy_density.len(), input.rest.faces.len());
    // What holds the two ends is in balance: the body is at rest.
    let sum = fields.reaction.iter().fold([0.0; 3], |s, f| [s[0] + f[0], s[1] + f[1], s[2] + f[2]]);
    let size = fields.reaction.iter().flatten().fold(0.0, |m: f64, f| m.max(f.abs()));
    assert!(sum.iter().all(|f| f.abs() < 1e-4 * size), "{sum:?} against {size}");
    let (mesh, arrays) = result.carried.expect("a lattice").lattice().expect("fields");
    assert!(arrays.cell.iter().any(|f| f.name == "fill" && f.data.len() == mesh.tets.len()));
}

#[test]
fn a_rigid_motion_of_the_pins_moves_everything_rigidly() {
    let mut input = twisted(0.0);
    let rigid = |p: V3| {
        let q = turned(p, 2.0);
        [q[1] + 3.0, q[2], q[0]]
    };
    input.fixed.iter_mut().for_each(|(v, t)| *t = rigid(input.rest.points[*v as usize]));
    let result = run(&input, &settings(12));
    assert_eq!(result.status, Status::Converged);
    let used: Vec<usize> =
        (0..input.rest.n_verts()).filter(|v| input.rest.faces.indices().contains(&(*v as u32))).collect();
    let wanted: Vec<V3> = used.iter().map(|&v| rigid(input.rest.points[v])).collect();
    let found: Vec<V3> = used.iter().map(|&v| result.positions[v]).collect();
    assert!(farthest(&wanted, &found) < 1e-6, "{}", farthest(&wanted, &found));
}

#[test]
fn the_lattice_follows_a_start_of_the_surface() {
    let input = twisted(1.0);
    let bent = |p: &V3| turned([p[0] + 0.1 * (p[0] + 1.5) / 3.0, p[1], p[2]], (p[0] + 1.5) / 3.0);
    let start: Vec<V3> = input.rest.points.iter().map(bent).collect();
    let with_start = DeformInput { start: Some(start.clone()), ..input.clone() };
    let result = run(&with_start, &DeformSettings { max_iters: 0, ..settings(15) });
    let used = |v: &usize| input.rest.faces.indices().contains(&(*v as u32));
    for v in (0..start.len()).filter(used) {
        // A lattice is straight between its nodes and its held cells move rigidly; the start turns by 1/15 in each cell.
        let gap = farthest(&[result.start[v]], &[start[v]]);
        assert!(gap < 0.2 / 15.0 * 2.0, "vertex {v}: {gap}");
    }
    // Both starts lead to the same minimum.
    let (a, b) = (run(&input, &settings(15)), run(&with_start, &settings(15)));
    assert!(farthest(&a.positions, &b.positions) < 1e-6, "{}", farthest(&a.positions, &b.positions));
}

#[test]
fn weight_is_that_of_what_is_inside() {
    // Hung from its left end under gravity, in a lattice that is much larger than the bar where it is coarse.
    let mut input = twisted(0.0);
    input.fixed.retain(|(v, _)| input.rest.points[*v as usize][0] < 0.0);
    let heavy = DeformSettings { density: 1000.0, gravity: [0.0, 0.0, -9.81], ..settings(20) };
    let result = run(&input, &heavy);
    assert_eq!(result.status, Status::Converged);
    let fields = extras(&input, &heavy, &result).expect("fields");
    let held: f64 = fields.reaction.iter().map(|f| f[2]).sum();
    let weight = -1000.0 * 9.81 * 3.0 * 0.6 * 0.6;
    assert!((held / weight - 1.0).abs() < 0.1, "{held} for {weight}");
    assert!(result.report.settings["density"] == 1000.0, "settings are the user's");
}

#[test]
fn springs_and_forces_pull_the_skin() {
    let mut input = twisted(0.0);
    let tip = input.fixed.last().expect("pins").0;
    input.fixed.retain(|(v, _)| input.rest.points[*v as usize][0] < 0.0);
    let rest = input.rest.points[tip as usize];
    let up = [rest[0], rest[1], rest[2] + 0.4];
    let sprung = DeformInput { soft: vec![(tip, up, 1e5)], ..input.clone() };
    let pushed = DeformInput { loads: vec![(tip, [0.0, 0.0, 1e4])], ..input };
    for input in [sprung, pushed] {
        let result = run(&input, &settings(12));
        assert_eq!(result.status, Status::Converged);
        let lift = result.positions[tip as usize][2] - rest[2];
        assert!(lift > 0.01 && lift < 0.4, "{lift}");
    }
}

#[test]
fn what_a_lattice_cannot_follow_is_told() {
    // Pins that fold every other vertex of an end in and out, within a cell.
    let mut input = twisted(0.0);
    for (v, t) in &mut input.fixed {
        let row = ((input.rest.points[*v as usize][2] + 0.3) / 0.2).round();
        t[1] += if row % 2.0 == 0.0 { 0.05 } else { -0.05 };
    }
    let result = run(&input, &settings(3));
    let lattice = result.report.lattice.expect("a lattice");
    assert!(lattice.pin_error > 1e-3, "{}", lattice.pin_error);
    let told = result.report.warnings.iter().any(|w| w.contains("pinned vertices are not where they are to be"));
    assert!(told, "{:?}", result.report.warnings);
}

#[test]
fn sheets_stay_sheets() {
    let rest = Mesh { name: "cloth".into(), ..cloth([4, 4], [1.0, 1.0]).expect("a cloth") };
    let mut fixed: Vec<(u32, V3)> =
        rest.points.iter().enumerate().filter(|p| p.1[0] < -0.49).map(|(v, &p)| (v as u32, p)).collect();
    fixed.extend(
        rest.points.iter().enumerate().filter(|p| p.1[0] > 0.49).map(|(v, &p)| (v as u32, [p[0] + 0.1, p[1], p[2]])),
    );
    let input = DeformInput { rest, fixed, ..DeformInput::default() };
    let auto = run(&input, &DeformSettings::default());
    assert!(auto.carried.is_none());
    assert!(
        auto.report.warnings.iter().any(|w| w.contains("thin sheet") && w.contains("--shell")),
        "{:?}",
        auto.report.warnings
    );
    let shell = DeformSettings { surface: SurfaceModel::Shell, ..DeformSettings::default() };
    let shell = run(&input, &shell);
    assert_eq!(shell.positions, auto.positions);
    assert!(shell.report.warnings.is_empty(), "{:?}", shell.report.warnings);
    // A body is a sheet where it is asked for.
    let skin = DeformSettings { surface: SurfaceModel::Shell, max_iters: 1, ..DeformSettings::default() };
    assert!(run(&twisted(0.1), &skin).carried.is_none());
}

#[test]
fn a_surface_with_no_inside_is_refused() {
    let refused = |rest: Mesh, surface: SurfaceModel, parts: &[&str]| {
        let input = DeformInput { rest, ..DeformInput::default() };
        let settings = DeformSettings { surface, ..DeformSettings::default() };
        let e = deform(&input, &settings, &mut Hooks::default()).expect_err("no body").to_string();
        assert!(parts.iter().all(|p| e.contains(p)) && e.lines().count() == 1, "{e}");
    };
    let plane = Mesh { name: "plane".into(), ..cloth([3, 3], [1.0, 1.0]).expect("a cloth") };
    refused(plane, SurfaceModel::Embed, &["plane: ", "no inside", "--shell"]);
    let body = beam([2, 2, 2], [1.0; 3], CellSplit::Five).expect("a beam");
    refused(body.clone(), SurfaceModel::Embed, &["only faces can be embedded", "tetrahedra"]);
    let flat = Mesh {
        points: vec![[1.0; 3]; 3],
        faces: Polygons::from(&[[0, 1, 2]][..]),
        name: "flat".into(),
        ..Mesh::default()
    };
    refused(flat, SurfaceModel::Embed, &["flat: ", "extent"]);
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let input = twisted(1.5);
    let of = |threads: usize| {
        let result = run(&input, &DeformSettings { threads: Some(threads), max_iters: 20, ..settings(12) });
        result.positions.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    let one = of(1);
    assert_eq!(one, of(2));
    assert_eq!(one, of(5));
}
