//! Bodies that follow their handles: whatever the way, the pose is that of a cold solve.

use proxel::deform::{DeformInput, Deformer, Frame, Hooks, deform};
use proxel::mesh::Mesh;
use proxel::mesh::generate::{CellSplit, beam, cloth};
use proxel::pins::{HalfSpace, RigidMotion};
use proxel::settings::{DeformSettings, Material, MethodName};
use proxel::split::{Equality, Status};
use std::time::Duration;

type V3 = [f64; 3];

/// A beam along x, held at both ends: groups `left` and `right`.
fn held_beam(cells: [usize; 3]) -> DeformInput {
    let rest = beam(cells, [4.0, 1.0, 1.0], CellSplit::Six).unwrap();
    held(rest, 2.0)
}

/// What is at x = -end and x = end is fixed, as groups.
fn held(rest: Mesh, end: f64) -> DeformInput {
    let at = |sign: f64| -> Vec<u32> {
        (0..).zip(&rest.points).filter(|(_, p)| sign * p[0] > end - 1e-9).map(|(v, _)| v).collect()
    };
    let groups = vec![("left".to_string(), at(-1.0)), ("right".to_string(), at(1.0))];
    let mut fixed: Vec<(u32, V3)> = groups.iter().flat_map(|g| &g.1).map(|v| (*v, rest.points[*v as usize])).collect();
    fixed.sort_unstable_by_key(|f| f.0);
    DeformInput { rest, fixed, groups, ..DeformInput::default() }
}

fn settings() -> DeformSettings {
    DeformSettings { threads: Some(2), tol: 1e-10, ..DeformSettings::default() }
}

fn bend() -> RigidMotion {
    RigidMotion::rotation([0.0, 0.2, 1.0], 35.0, [2.0, 0.0, 0.0]).then(RigidMotion::translation([-0.3, 0.5, 0.1]))
}

fn step(deformer: &mut Deformer) -> Frame {
    let frame = deformer.step(None, &mut Hooks::default()).unwrap();
    let method = deformer.settings().method.as_str();
    assert_eq!(frame.status, Status::Converged, "{method}: {}", frame.reason);
    frame
}

/// The minimum from the smooth start, without a past.
fn cold(deformer: &Deformer, settings: &DeformSettings) -> Vec<V3> {
    let end = deform(deformer.input(), settings, &mut Hooks::default()).unwrap();
    assert_eq!(end.status, Status::Converged, "{}", end.report.reason);
    end.positions
}

fn distance(a: &[V3], b: &[V3]) -> f64 {
    a.iter().zip(b).flat_map(|(a, b)| (0..3).map(|d| (a[d] - b[d]).abs())).fold(0.0, f64::max)
}

/// Follows `right` to two places and back; every pose is that of a cold solve to `close`.
fn follows(input: &DeformInput, settings: &DeformSettings, close: f64) {
    let mut deformer = Deformer::new(input, settings).unwrap();
    let first = step(&mut deformer);
    assert!(distance(&first.positions, &cold(&deformer, settings)) < close);
    for motion in [RigidMotion::translation([0.05, 0.1, -0.02]), bend()] {
        deformer.move_group("right", &motion).unwrap();
        let frame = step(&mut deformer);
        let off = distance(&frame.positions, &cold(&deformer, settings));
        assert!(off < close, "{off:e}");
        assert!(distance(&frame.positions, &first.positions) > 0.05);
        assert_eq!(frame.positions, deformer.positions());
        for (v, target) in &deformer.input().fixed {
            assert_eq!(frame.positions[*v as usize], *target);
        }
    }
    deformer.move_group("right", &RigidMotion::identity()).unwrap();
    let back = step(&mut deformer);
    assert!(distance(&back.positions, &first.positions) < close, "back");
}

#[test]
fn warm_poses_are_those_of_cold_solves() {
    follows(&held_beam([8, 3, 3]), &settings(), 1e-7);
}

#[test]
fn a_small_motion_takes_no_factorisation() {
    let mut deformer = Deformer::new(&held_beam([8, 3, 3]), &settings()).unwrap();
    deformer.move_group("right", &bend()).unwrap();
    let first = step(&mut deformer);
    assert!(first.refactorisations > 0, "the first pose has no factor from before");
    deformer.move_group("right", &bend().then(RigidMotion::translation([0.0, 0.03, 0.0]))).unwrap();
    let frame = step(&mut deformer);
    assert_eq!(frame.refactorisations, 0);
    assert!(frame.iterations < 20, "{}", frame.iterations);
    // Nothing has moved since: there is nothing to do.
    assert_eq!(step(&mut deformer).iterations, 0);
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let run = |threads| {
        let settings = DeformSettings { threads: Some(threads), ..settings() };
        let mut deformer = Deformer::new(&held_beam([8, 3, 3]), &settings).unwrap();
        step(&mut deformer);
        deformer.move_group("right", &bend()).unwrap();
        step(&mut deformer).positions
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn without_time_there_is_the_smooth_start_and_it_is_said() {
    let settings = settings();
    let mut deformer = Deformer::new(&held_beam([8, 3, 3]), &settings).unwrap();
    let first = step(&mut deformer);
    deformer.move_group("right", &RigidMotion::translation([0.1, 0.2, 0.0])).unwrap();
    let frame = deformer.step(Some(Duration::ZERO), &mut Hooks::default()).unwrap();
    assert_eq!((frame.status, frame.iterations), (Status::Stopped, 0));
    assert!(frame.reason.contains("time"), "{}", frame.reason);
    // From the rest shape it is the start of a cold solve, and nothing is farther from before than the handle.
    let start = deform(deformer.input(), &DeformSettings { max_iters: 0, ..settings.clone() }, &mut Hooks::default());
    assert!(distance(&frame.positions, &start.unwrap().positions) < 1e-5);
    assert!((distance(&frame.positions, &first.positions) - 0.2).abs() < 1e-12);
    // Energies: some time makes it no worse, and more of it ends at the minimum.
    let moved = deformer.input().clone();
    let energy = |x: &[V3]| {
        let input = DeformInput { start: Some(x.to_vec()), ..moved.clone() };
        let settings = DeformSettings { max_iters: 0, ..settings.clone() };
        deform(&input, &settings, &mut Hooks::default()).unwrap().report.energy.unwrap()
    };
    let smooth = energy(&frame.positions);
    let frame = deformer.step(Some(Duration::from_nanos(1)), &mut Hooks::default()).unwrap();
    assert_eq!(frame.status, Status::Stopped);
    assert!(frame.energy <= smooth && (frame.energy - energy(&frame.positions)).abs() <= 1e-9 * smooth);
    let end = step(&mut deformer);
    assert!(distance(&end.positions, &cold(&deformer, &settings)) < 1e-7);
}

#[test]
fn a_cancelled_step_returns_what_it_has() {
    let mut deformer = Deformer::new(&held_beam([8, 3, 3]), &settings()).unwrap();
    deformer.move_group("right", &bend()).unwrap();
    let hooks = Hooks::default();
    hooks.cancel.store(true, std::sync::atomic::Ordering::SeqCst);
    let mut hooks = hooks;
    let frame = deformer.step(None, &mut hooks).unwrap();
    assert_eq!((frame.status, frame.iterations), (Status::Cancelled, 0));
    step(&mut deformer);
}

#[test]
fn every_method_follows() {
    let input = held_beam([6, 2, 2]);
    for method in [MethodName::Wrapd, MethodName::AdmmPd, MethodName::Newton, MethodName::NewtonCg, MethodName::Lbfgs] {
        // L-BFGS goes by energies alone, which rounding hides sooner.
        let (tol, close) = if method == MethodName::Lbfgs { (1e-6, 1e-4) } else { (1e-9, 1e-6) };
        follows(&input, &DeformSettings { method, tol, max_iters: 50_000, ..settings() }, close);
    }
}

#[test]
fn springs_are_drawn_to_their_new_ends() {
    let mut input = held_beam([8, 3, 3]);
    let right = input.groups[1].1.clone();
    input.fixed.retain(|f| !right.contains(&f.0));
    input.soft = right.iter().map(|v| (*v, input.rest.points[*v as usize], 1e6)).collect();
    let settings = settings();
    let mut deformer = Deformer::new(&input, &settings).unwrap();
    let first = step(&mut deformer);
    deformer.move_group("right", &bend()).unwrap();
    let frame = step(&mut deformer);
    assert!(distance(&frame.positions, &first.positions) > 0.05);
    assert!(distance(&frame.positions, &cold(&deformer, &settings)) < 1e-7);
}

#[test]
fn hard_sets_equalities_and_pressure_follow_by_splitting() {
    let input = held_beam([6, 2, 2]);
    let ground = HalfSpace { point: [0.0, -0.52, 0.0], normal: [0.0, 1.0, 0.0] };
    let middle: Vec<(u32, f64)> =
        (0..).zip(&input.rest.points).filter(|(_, p)| p[0].abs() < 0.4).map(|(v, _)| (v, 0.1)).collect();
    let sum = middle.iter().fold([0.0; 3], |s, (v, a)| [0, 1, 2].map(|d| s[d] + a * input.rest.points[*v as usize][d]));
    let tied = Equality { nodes: middle, value: [sum[0], sum[1] + 0.1, sum[2]] };
    let everything: Vec<u32> = (0..input.rest.n_verts() as u32).collect();
    let push = RigidMotion::translation([0.02, 0.05, 0.0]);
    let cases = [
        DeformInput { obstacles: vec![ground], loads: vec![(20, [0.0, -1e6, 0.0])], ..input.clone() },
        DeformInput { equalities: vec![tied], ..input.clone() },
        DeformInput { pressures: vec![(everything, 2e5)], ..input.clone() },
    ];
    let settings = DeformSettings { tol: 1e-9, max_iters: 50_000, ..settings() };
    for (k, case) in cases.iter().enumerate() {
        let mut deformer = Deformer::new(case, &settings).unwrap();
        let first = step(&mut deformer);
        deformer.move_group("right", &push).unwrap();
        let frame = step(&mut deformer);
        assert!(distance(&frame.positions, &first.positions) > 0.02, "case {k}");
        let off = distance(&frame.positions, &cold(&deformer, &settings));
        assert!(off < 1e-6, "case {k}: {off:e}");
    }
    // What cannot be is told, and what could be before can be again.
    let mut deformer = Deformer::new(&cases[0], &settings).unwrap();
    step(&mut deformer);
    deformer.move_group("right", &RigidMotion::translation([0.0, -0.3, 0.0])).unwrap();
    let error = deformer.step(None, &mut Hooks::default()).unwrap_err().to_string();
    assert!(error.contains("behind obstacle 0") && error.contains("move the pin"), "{error}");
    deformer.move_group("right", &push).unwrap();
    let frame = step(&mut deformer);
    assert!(distance(&frame.positions, &cold(&deformer, &settings)) < 1e-6);
}

#[test]
fn sheets_with_limits_follow() {
    let rest = cloth([8, 8], [1.0, 1.0]).unwrap();
    let settings = DeformSettings {
        material: Material { energy: "arap".into(), young: 100.0, poisson: 0.0, ..Material::default() },
        bending: 1e-3,
        strain_limit: Some([0.9, 1.1]),
        density: 0.2,
        gravity: [0.0, 0.0, -9.81],
        tol: 1e-8,
        max_iters: 50_000,
        ..settings()
    };
    let mut deformer = Deformer::new(&held(rest, 0.5), &settings).unwrap();
    let first = step(&mut deformer);
    deformer.move_group("right", &RigidMotion::translation([-0.05, 0.0, 0.02])).unwrap();
    let frame = step(&mut deformer);
    let moved = distance(&frame.positions, &first.positions);
    assert!(moved > 0.049, "the handle moves by 0.05: {moved}");
    assert!(frame.min_stretch > 0.9 - 1e-5 && frame.max_stretch < 1.1 + 1e-5);
    assert!(distance(&frame.positions, &cold(&deformer, &settings)) < 1e-4);
}

#[test]
fn the_plane_follows_in_the_plane() {
    let rest = cloth([8, 2], [4.0, 1.0]).unwrap();
    let settings = DeformSettings { planar: true, ..settings() };
    let mut deformer = Deformer::new(&held(rest, 2.0), &settings).unwrap();
    step(&mut deformer);
    let turn = RigidMotion::rotation([0.0, 0.0, 1.0], 40.0, [2.0, 0.0, 0.0]);
    deformer.move_group("right", &turn).unwrap();
    let frame = step(&mut deformer);
    assert!(distance(&frame.positions, &cold(&deformer, &settings)) < 1e-7);
}

#[test]
fn what_cannot_be_moved_is_named() {
    let mut deformer = Deformer::new(&held_beam([4, 1, 1]), &settings()).unwrap();
    let error = |e: proxel::deform::DeformError| e.to_string();
    let free = (0..20u32).find(|v| deformer.home_of(*v).is_none()).unwrap();
    let cases = [
        (
            deformer.move_group("middle", &bend()).map_err(error),
            "no group is called `middle`; give the name of one: `left`, `right`",
        ),
        (deformer.set_targets(&[(free, [0.0; 3])]).map_err(error), "is neither fixed nor drawn"),
        (deformer.set_targets(&[(0, [f64::NAN, 0.0, 0.0])]).map_err(error), "give finite numbers"),
    ];
    for (end, message) in cases {
        let text = end.unwrap_err();
        assert!(text.contains(message), "{text}");
    }
    // Nothing of it has moved anything.
    assert_eq!(step(&mut deformer).iterations, 0);
}

#[test]
fn a_body_without_free_vertices_is_where_it_is_put() {
    let mut input = held_beam([1, 1, 1]);
    input.groups.push(("all".into(), (0..input.rest.n_verts() as u32).collect()));
    let mut deformer = Deformer::new(&input, &settings()).unwrap();
    deformer.move_group("all", &bend()).unwrap();
    let frame = step(&mut deformer);
    assert_eq!(frame.positions[3], bend().apply(input.rest.points[3]));
}

#[test]
fn planar_bodies_stay_in_their_plane() {
    let rest = cloth([6, 4], [1.0, 0.6]).unwrap();
    let settings = DeformSettings { planar: true, ..settings() };
    let mut deformer = Deformer::new(&held(rest, 0.5), &settings).unwrap();
    step(&mut deformer);
    let error = deformer.move_group("right", &RigidMotion::translation([0.0, 0.0, 0.1])).unwrap_err().to_string();
    assert!(error.contains("--planar") && error.contains("plane of the mesh"), "{error}");
    deformer.move_group("right", &RigidMotion::translation([0.1, 0.05, 0.0])).unwrap();
    let frame = step(&mut deformer);
    assert!(distance(&frame.positions, &cold(&deformer, &settings)) < 1e-7);
}
