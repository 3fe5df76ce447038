//! Obstacles, equalities, pressure and reaction forces against what statics says.

use proxel::deform::{DeformInput, Deformation, Hooks, deform};
use proxel::model::energy::{Energy, Lame, NeoHookean};
use proxel::pins::HalfSpace;
use proxel::settings::{DeformSettings, Material, MethodName};
use proxel::split::{Equality, Status};
use proxel_mesh::generate::{CellSplit, beam, cube};

fn run(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    deform(input, settings, &mut Hooks::default()).expect("good input")
}

fn distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn soft() -> DeformSettings {
    DeformSettings {
        material: Material { energy: "stable-neo-hookean".into(), young: 1e5, poisson: 0.3, ..Material::default() },
        ..DeformSettings::default()
    }
}

#[test]
fn a_block_rests_on_the_ground_with_its_whole_weight() {
    let rest = cube(3).unwrap();
    let ground = HalfSpace { point: [0.0, -0.51, 0.0], normal: [0.0, 2.0, 0.0] };
    let input = DeformInput { rest, obstacles: vec![ground], ..DeformInput::default() };
    let weight = 1000.0 * 9.81;
    for method in MethodName::ALL.into_iter().filter(|m| m.takes_hard_sets()) {
        let settings = DeformSettings {
            method,
            density: 1000.0,
            gravity: [0.0, -9.81, 0.0],
            tol: 1e-8,
            max_iters: 20_000,
            ..soft()
        };
        let end = run(&input, &settings);
        assert_eq!(end.status, Status::Converged, "{method:?}: {}", end.report.reason);
        let lowest = end.positions.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        assert!((lowest + 0.51).abs() < 1e-6, "{method:?}: it lies on the ground: {lowest}");
        let force = end.report.reactions["obstacle 0"];
        assert!((force[1] + weight).abs() < 1e-4 * weight, "{method:?}: {force:?}");
        assert!(force[0].abs() < 1e-9 * weight && force[2].abs() < 1e-9 * weight, "no friction: {force:?}");
    }
}

#[test]
fn equalities_hold_exactly_and_all_methods_agree() {
    let rest = beam([8, 2, 2], [4.0, 1.0, 1.0], CellSplit::Five).unwrap();
    let at = |x: f64, y: f64, z: f64| {
        rest.points.iter().position(|p| distance(&[*p], &[[x, y, z]]) < 1e-9).expect("a vertex") as u32
    };
    let fixed: Vec<(u32, [f64; 3])> =
        (0..).zip(&rest.points).filter(|(_, p)| p[0] <= -2.0).map(|(v, p)| (v, *p)).collect();
    let (a, b, c) = (at(2.0, -0.5, -0.5), at(2.0, 0.5, 0.5), at(1.0, 0.5, 0.5));
    let row = |nodes: &[(u32, f64)], value| Equality { nodes: nodes.to_vec(), value };
    let rows = vec![
        // The middle of two corners of the free end goes to a place; a vertex keeps its offset from another.
        row(&[(a, 0.5), (b, 0.5)], [1.8, 1.2, 0.3]),
        row(&[(b, 1.0), (c, -1.0)], [0.9, 0.1, 0.2]),
    ];
    let input = DeformInput { rest, fixed: fixed.clone(), equalities: rows.clone(), ..DeformInput::default() };
    let with = |method| DeformSettings { method, tol: 1e-8, max_iters: 30_000, ..soft() };
    let first = run(&input, &with(MethodName::Wrapd));
    for method in MethodName::ALL.into_iter().filter(|m| m.takes_hard_sets()) {
        let end = run(&input, &with(method));
        assert_eq!(end.status, Status::Converged, "{method:?}: {}", end.report.reason);
        for Equality { nodes, value } in &rows {
            for d in 0..3 {
                let sum: f64 = nodes.iter().map(|(v, a)| a * end.positions[*v as usize][d]).sum();
                assert!((sum - value[d]).abs() < 1e-9 * 4.0, "{method:?}: {sum} is not {}", value[d]);
            }
        }
        let apart = distance(&end.positions, &first.positions) / distance(&first.start, &first.positions);
        assert!(apart < 1e-5, "{method:?}: {apart}");
    }
    // What the wall holds is what the rows pull: their forces have no other partner.
    let pulled = first.reaction.iter().fold([0.0; 3], |s, f| [s[0] + f[0], s[1] + f[1], s[2] + f[2]]);
    assert!(pulled[1] > 1.0, "lifted: {pulled:?}");

    let refused = |rows: Vec<Equality>| {
        let input = DeformInput { equalities: rows, ..input.clone() };
        deform(&input, &soft(), &mut Hooks::default()).expect_err("refused").to_string()
    };
    let twice = [rows.clone(), vec![row(&[(a, 1.0), (b, 1.0)], [3.6, 2.4, 0.6])]].concat();
    let told = refused(twice);
    assert!(told.contains("equality 2") && told.contains("follows from") && told.contains("remove"), "{told}");
    let against = [rows.clone(), vec![row(&[(a, 1.0), (b, 1.0)], [3.6, 2.5, 0.6])]].concat();
    assert!(refused(against).contains("equality 2 (0-based) contradicts"));
    let on_pins = vec![row(&[(fixed[0].0, 1.0)], [9.0; 3])];
    assert!(refused(on_pins).contains("equality 0 (0-based) contradicts"));
}

#[test]
fn a_block_under_pressure_swells_as_its_material_says() {
    let rest = cube(2).unwrap();
    let all: Vec<u32> = (0..rest.n_verts() as u32).collect();
    let lame = Lame::from_young_poisson(1e5, 0.3).unwrap();
    let psi: NeoHookean = <NeoHookean as Energy<3>>::from_lame(&lame);
    for pressure in [2e4, -2e4] {
        let input =
            DeformInput { rest: rest.clone(), pressures: vec![(all.clone(), pressure)], ..DeformInput::default() };
        let settings = DeformSettings {
            material: Material { energy: "neo-hookean".into(), young: 1e5, poisson: 0.3, ..Material::default() },
            tol: 1e-9,
            ..DeformSettings::default()
        };
        let end = run(&input, &settings);
        assert_eq!(end.status, Status::Converged, "{}", end.report.reason);
        assert!(end.report.iterations <= 40, "Newton ends it: {} iterations", end.report.iterations);
        let (low, high) = (end.report.min_stretch.unwrap(), end.report.max_stretch.unwrap());
        assert!(high - low < 1e-7, "uniform: {low} {high}");
        // The force on a face, p s^2 per area at rest, is the stress psi_i.
        let stress = psi.gradient([low; 3])[0];
        assert!((stress - pressure * low * low).abs() < 1e-6 * pressure.abs(), "{stress} {pressure} {low}");
        assert!((low - 1.0) * pressure > 0.0, "positive pressure swells");
    }
}

#[test]
fn an_open_patch_needs_something_that_holds_it() {
    let rest = cube(2).unwrap();
    let top: Vec<u32> = (0..).zip(&rest.points).filter(|(_, p)| p[1] >= 0.5).map(|(v, _)| v).collect();
    let bottom: Vec<(u32, [f64; 3])> =
        (0..).zip(&rest.points).filter(|(_, p)| p[1] <= -0.5).map(|(v, p)| (v, *p)).collect();
    let pushed = DeformInput { rest, pressures: vec![(top, -1e3)], ..DeformInput::default() };
    let told = deform(&pushed, &soft(), &mut Hooks::default()).expect_err("refused").to_string();
    assert!(told.contains("loaded but nothing holds it"), "{told}");
    let names: Vec<u32> = bottom.iter().map(|f| f.0).collect();
    let held = DeformInput { fixed: bottom, groups: vec![("wall".into(), names)], ..pushed };
    let end = run(&held, &soft());
    assert_eq!(end.status, Status::Converged, "{}", end.report.reason);
    assert!(end.report.warnings.iter().any(|w| w.contains("open")), "{:?}", end.report.warnings);
    // The pressure of 1e3 on the unit square presses on the wall.
    let wall = end.report.reactions["wall"];
    assert!(wall[1] < -0.8e3 && wall[1] > -1.2e3, "{wall:?}");
}

#[test]
fn obstacles_that_make_no_sense_are_refused() {
    let rest = cube(1).unwrap();
    let pin = vec![(0, rest.points[0])];
    let with = |obstacle: HalfSpace| {
        let input =
            DeformInput { rest: rest.clone(), fixed: pin.clone(), obstacles: vec![obstacle], ..DeformInput::default() };
        deform(&input, &soft(), &mut Hooks::default()).expect_err("refused").to_string()
    };
    let behind = with(HalfSpace { point: [0.0, 3.0, 0.0], normal: [0.0, 1.0, 0.0] });
    assert!(behind.contains("vertex 0 (0-based) is held") && behind.contains("obstacle 0"), "{behind}");
    let none = with(HalfSpace { point: [0.0; 3], normal: [0.0; 3] });
    assert!(none.contains("obstacle 0 (0-based)") && none.contains("direction"), "{none}");
}
