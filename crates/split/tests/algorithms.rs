//! Algorithms 1 to 4 of Zhang et al. 2019 and what stands beside them.

mod common;

use common::{FREE, Law, SMOOTH, admm, problem};
use proxel_split::{
    Acceleration, Admm, Algorithm, Balancing, BuildError, Cycle, Extrapolation, History, Kind, Method, Order, vector,
};

const PAPER: [Algorithm; 5] = [Algorithm::One, Algorithm::Two, Algorithm::TwoRaw, Algorithm::Three, Algorithm::Four];

/// The plain iteration in the order of an algorithm.
fn plain(law: Law, algorithm: Algorithm) -> Admm {
    admm(problem(law, true)).with_cycle(Cycle { order: algorithm.order(), relaxation: 1.0 }).expect("a cycle")
}

fn accelerated(law: Law, how: Acceleration) -> Box<dyn Method> {
    how.of(admm(problem(law, true))).unwrap_or_else(|e| panic!("{how:?}: {e}"))
}

/// |gradient of the objective|
fn gradient(method: &mut dyn Method) -> f64 {
    method.evaluate().gradient_norm
}

fn run(method: &mut dyn Method, steps: usize) -> Vec<f64> {
    (0..steps)
        .map(|_| {
            method.step().expect("a step");
            gradient(method)
        })
        .collect()
}

#[test]
fn without_columns_each_is_the_plain_iteration_bit_for_bit() {
    for algorithm in PAPER {
        for by in [Extrapolation::anderson(0), Extrapolation::None] {
            let mut plain = plain(SMOOTH, algorithm);
            let mut none = accelerated(SMOOTH, Acceleration { algorithm, by, history: History::AsPublished });
            for step in 0..30 {
                let (a, b) = (plain.step().expect("a step"), none.step().expect("a step"));
                assert_eq!(plain.x(), none.x(), "{algorithm:?}, step {step}");
                assert_eq!(a.local, b.local, "{algorithm:?}, step {step}");
                assert_eq!((b.trial.rejected, b.trial.accelerated, b.iteration), (0, false, a.iteration));
            }
        }
    }
}

#[test]
fn all_reach_the_minimum_and_sooner_than_the_plain_iteration() {
    let mut exact = plain(SMOOTH, Algorithm::One);
    run(&mut exact, 3000);
    assert!(gradient(&mut exact) < 1e-11, "{}", gradient(&mut exact));
    let needs = |gradients: &[f64]| gradients.iter().position(|g| *g < 1e-9).expect("it converges");
    for algorithm in PAPER {
        for history in [History::Keep, History::Clear] {
            let slow = needs(&run(&mut plain(SMOOTH, algorithm), 2000));
            let mut method = accelerated(SMOOTH, Acceleration { history, ..Acceleration::anderson(algorithm, 6) });
            let fast = needs(&run(&mut *method, 400));
            assert!(3 * fast < slow, "{algorithm:?} {history:?}: {fast} against {slow}");
            let apart = vector::norm(&method.x().iter().zip(exact.x()).map(|(a, b)| a - b).collect::<Vec<_>>());
            assert!(apart < 1e-8, "{algorithm:?}: {apart}");
        }
    }
}

#[test]
fn every_part_converges_to_the_minimum() {
    let quadratic = Law { k: 30.0, q: 0.0, limits: None };
    let anderson = |window, mixing, kind| Extrapolation::Anderson { window, mixing, kind };
    for (algorithm, by, law) in [
        (Algorithm::Three, anderson(5, 0.7, Kind::Two), SMOOTH),
        (Algorithm::One, anderson(4, 0.9, Kind::Two), SMOOTH),
        (Algorithm::Three, anderson(5, 1.0, Kind::One), SMOOTH),
        (Algorithm::Four, anderson(5, 1.0, Kind::One), SMOOTH),
        (Algorithm::One, Extrapolation::Momentum { eta: Some(0.999), corrected: false }, SMOOTH),
        (Algorithm::Two, Extrapolation::Momentum { eta: Some(0.999), corrected: false }, SMOOTH),
        (Algorithm::One, Extrapolation::Momentum { eta: Some(0.999), corrected: true }, SMOOTH),
        (Algorithm::Envelope, Extrapolation::anderson(6), SMOOTH),
        (Algorithm::DouglasRachford, Extrapolation::anderson(6), SMOOTH),
        (Algorithm::LocalAlone, Extrapolation::anderson(6), quadratic),
        (Algorithm::DualAlone, Extrapolation::anderson(6), quadratic),
    ] {
        let mut method = accelerated(law, Acceleration { algorithm, by, history: History::AsPublished });
        let gradients = run(&mut *method, 1500);
        assert!(gradients[1499] < 1e-10, "{algorithm:?} {by:?}: {}", gradients[1499]);
    }
    for alpha in [0.8, 1.5, 1.8] {
        let cycle = Cycle { relaxation: alpha, ..Cycle::PLAIN };
        let mut relaxed = admm(problem(SMOOTH, true)).with_cycle(cycle).expect("a cycle");
        assert!(run(&mut relaxed, 3000)[2999] < 1e-10, "alpha = {alpha}");
    }
}

#[test]
fn on_a_quadratic_one_variable_alone_ends_after_as_many_steps_as_it_has_dimensions() {
    let law = Law { k: 30.0, q: 0.0, limits: None };
    for algorithm in [Algorithm::LocalAlone, Algorithm::DualAlone, Algorithm::Three, Algorithm::Four] {
        let mut method = accelerated(law, Acceleration::anderson(algorithm, FREE));
        let gradients = run(&mut *method, FREE + 6);
        let last = gradients[FREE + 5];
        assert!(last < 1e-11 * gradients[0], "{algorithm:?}: {gradients:?}");
        let plain = run(&mut plain(law, algorithm), FREE + 6);
        assert!(plain[FREE + 5] > 1e-6 * plain[0], "{algorithm:?}: too easy");
    }
}

#[test]
fn momentum_that_overshoots_is_restarted() {
    for algorithm in [Algorithm::One, Algorithm::Two] {
        let by = Extrapolation::Momentum { eta: Some(0.999), corrected: false };
        let mut method = accelerated(SMOOTH, Acceleration { algorithm, by, history: History::AsPublished });
        let (mut before, mut restarts) = (f64::INFINITY, 0);
        for _ in 0..80 {
            let report = method.step().expect("a step");
            let merit = report.merit.expect("a merit");
            // An accelerated point has to bring the merit down; what is gone on from after a restart need not.
            assert!(!report.trial.accelerated || merit <= 0.999 * before, "{algorithm:?}: {merit} after {before}");
            assert_eq!(report.trial.reset, report.trial.rejected > 0, "{algorithm:?}");
            restarts += report.trial.rejected;
            before = merit;
        }
        assert!(restarts > 0, "{algorithm:?}: no restart to be seen");
    }
}

/// Propositions 3.2 and 3.4: the forward residual vanishes exactly at fixed points.
#[test]
fn the_forward_residual_vanishes_exactly_at_fixed_points() {
    // From a start near the solution, plain iterations: the residual and the change of the variable fall together.
    for algorithm in [Algorithm::Three, Algorithm::Four] {
        let mut plain = plain(SMOOTH, algorithm);
        let (mut before, mut pairs) = (Vec::new(), Vec::new());
        for _ in 0..2500 {
            let report = plain.step().expect("a step");
            // Of the x-z-u iteration z is the variable and A(22) its residual, of the z-x-u iteration u and A(24).
            let (now, residual) = match algorithm {
                Algorithm::Three => (plain.local(), report.local.gap2_before),
                _ => (plain.dual(), report.local.gap2),
            };
            if !before.is_empty() {
                let moved: f64 = now.iter().zip(&before).map(|(a, b): (&f64, &f64)| (a - b).powi(2)).sum();
                pairs.push((moved.sqrt(), residual.sqrt()));
            }
            before = now;
        }
        let first = pairs[0];
        for (moved, residual) in &pairs {
            let far = *moved > 1e-12 * first.0;
            assert!(!far || (*residual > 1e-4 * moved && *residual < 1e4 * moved), "{algorithm:?}: {moved} {residual}");
        }
        let (moved, residual) = pairs[pairs.len() - 1];
        assert!(moved < 1e-13 && residual < 1e-13, "{algorithm:?}: {moved} {residual}");
    }
}

/// u = W^-2 grad g(z) after every z-u step: Proposition 3.1. x follows from u: Proposition 3.3.
#[test]
fn what_is_left_out_follows_from_what_is_accelerated() {
    let mut xzu = plain(SMOOTH, Algorithm::Three);
    let mut zxu = plain(SMOOTH, Algorithm::Four);
    for _ in 0..8 {
        xzu.step().expect("a step");
        for (u, z) in xzu.dual().iter().zip(xzu.local()) {
            assert!((u - SMOOTH.slope(z)).abs() < 1e-12, "{u} {z}");
        }
        zxu.step().expect("a step");
        // grad f(x) + D^T W^2 u = 0, A(23).
        let mut gradient = vec![0.0; FREE];
        zxu.problem().quadratic.value_and_gradient(zxu.x(), 1, Some(&mut gradient));
        let mut forces = vec![0.0; FREE];
        let mut scratch = problem(SMOOTH, true);
        scratch.adjoint(&[zxu.dual()], &mut forces);
        for (g, f) in gradient.iter().zip(&forces) {
            assert!((g + f).abs() < 1e-12, "{g} {f}");
        }
    }
}

#[test]
fn what_does_not_go_together_is_said_with_what_would() {
    let limited = Law { limits: Some((0.9, 1.1)), ..SMOOTH };
    let refused = |law, inertia, algorithm| match Acceleration::anderson(algorithm, 6).of(admm(problem(law, inertia))) {
        Ok(_) => panic!("{algorithm:?} takes what it cannot"),
        Err(e) => e,
    };
    // Remark 3.1.
    for algorithm in [Algorithm::One, Algorithm::Three] {
        let e = refused(limited, true, algorithm);
        assert!(matches!(e, BuildError::HardSet { term: 0, .. }) && e.to_string().contains("z-x-u order"), "{e}");
    }
    assert!(Acceleration::anderson(Algorithm::Two, 6).of(admm(problem(limited, false))).is_ok());
    assert!(Acceleration::anderson(Algorithm::Four, 6).of(admm(problem(limited, true))).is_ok());
    let e = refused(SMOOTH, false, Algorithm::Four);
    assert!(e == BuildError::NoInertia { node: 0 } && e.to_string().contains("algorithm 2"), "{e}");
    let e = refused(SMOOTH, true, Algorithm::DualAlone);
    assert!(e.to_string().contains("affine") && e.to_string().contains("algorithm 1"), "{e}");
    let balanced = admm(problem(SMOOTH, true)).with_balancing(Balancing::default());
    let e = Acceleration::anderson(Algorithm::Three, 6).of(balanced).err().expect("weights may change");
    assert!(e.to_string().contains("static weights"), "{e}");
    for relaxation in [0.0, 2.0, f64::NAN] {
        assert!(admm(problem(SMOOTH, true)).with_cycle(Cycle { relaxation, ..Cycle::PLAIN }).is_err());
    }
    assert!(admm(problem(SMOOTH, true)).with_cycle(Cycle { order: Order::Zxu, relaxation: 1.5 }).is_err());
    for mixing in [0.0, 1.1, f64::NAN] {
        let by = Extrapolation::Anderson { window: 3, mixing, kind: Kind::Two };
        let how = Acceleration { by, ..Acceleration::anderson(Algorithm::One, 3) };
        assert!(how.of(admm(problem(SMOOTH, true))).is_err(), "{mixing}");
    }
}

#[test]
fn what_the_iteration_allows_is_found() {
    let limited = Law { limits: Some((0.9, 1.1)), ..SMOOTH };
    for (law, inertia, wanted) in [
        (SMOOTH, true, Algorithm::Three),
        (SMOOTH, false, Algorithm::Three),
        (limited, true, Algorithm::Four),
        (limited, false, Algorithm::Two),
    ] {
        let admm = admm(problem(law, inertia));
        assert_eq!(Algorithm::of(&admm), wanted);
        assert!(Acceleration::anderson(wanted, 4).of(admm).is_ok());
    }
}

#[test]
fn hard_sets_hold_in_the_order_that_allows_them() {
    let limited = Law { limits: Some((0.95, 1.05)), ..SMOOTH };
    let mut exact = admm(problem(limited, true)).with_cycle(Cycle { order: Order::Zxu, relaxation: 1.0 }).expect("ok");
    run(&mut exact, 4000);
    for algorithm in [Algorithm::Two, Algorithm::TwoRaw, Algorithm::Four] {
        let mut method = accelerated(limited, Acceleration::anderson(algorithm, 6));
        run(&mut *method, 600);
        let apart = method.x().iter().zip(exact.x()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-8, "{algorithm:?}: {apart}");
        let mut stretch = vec![0.0; FREE];
        problem(limited, true).terms[0].couple(method.x(), &mut stretch);
        assert!(stretch.iter().all(|s| *s > 0.95 - 1e-7 && *s < 1.05 + 1e-7), "{stretch:?}");
    }
}

#[test]
fn the_next_step_in_time_begins_as_a_new_method_would() {
    for algorithm in PAPER {
        let mut method = accelerated(SMOOTH, Acceleration::anderson(algorithm, 4));
        run(&mut *method, 9);
        let target: Vec<f64> = method.x()[..FREE].iter().map(|x| x - 0.1).collect();
        let mut start = method.x().to_vec();
        start[..FREE].copy_from_slice(&target);
        let mut moved = problem(SMOOTH, true);
        moved.x0 = start.clone();
        moved.quadratic.inertia.set_target(&target).expect("a target");
        let mut fresh = Acceleration::anderson(algorithm, 4).of(admm(moved)).expect("a method");
        method
            .begin(&start, false, &mut |p| p.quadratic.inertia.set_target(&target).expect("a target"))
            .expect("a new start");
        for step in 0..9 {
            let (a, b) = (method.step().expect("a step"), fresh.step().expect("a step"));
            assert_eq!((method.x(), a.trial), (fresh.x(), b.trial), "{algorithm:?}, step {step}");
        }
    }
}

/// The Douglas-Rachford iteration judged by its residual takes the points of ADMM where nothing is proposed.
#[test]
fn the_douglas_rachford_variable_without_columns_is_the_plain_iteration() {
    let mut plain = plain(SMOOTH, Algorithm::One);
    let by = Extrapolation::None;
    let mut none =
        accelerated(SMOOTH, Acceleration { algorithm: Algorithm::DouglasRachford, by, history: History::Keep });
    for _ in 0..20 {
        let report = (plain.step().expect("a step"), none.step().expect("a step")).1;
        assert_eq!(plain.x(), none.x());
        // |W(Dx - z)|^2 of the new x and the z that it follows.
        let forward = none.forward_residual().expect("there is a z");
        let merit = report.merit.expect("a merit");
        assert!((merit - forward).abs() <= 1e-12 * forward, "{merit} {forward}");
    }
}

/// Several updates of z and x before one of u: one of them is ADMM, all have its minimum.
#[test]
fn the_augmented_lagrangian_method_has_the_minimum_of_admm() {
    let alm = |n: usize| plain(SMOOTH, Algorithm::Two).with_alternations(n).expect("the z-x-u order");
    let (mut admm, mut one) = (plain(SMOOTH, Algorithm::Two), alm(1));
    run(&mut admm, 30);
    run(&mut one, 30);
    assert_eq!(admm.x(), one.x());
    run(&mut admm, 3000);
    for n in [2, 7] {
        let mut several = alm(n);
        let report = several.step().expect("a step");
        assert_eq!(report.inner, n, "a solve each");
        run(&mut several, 2000);
        let apart = several.x().iter().zip(admm.x()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-9, "{n}: {apart}");
    }
    assert!(plain(SMOOTH, Algorithm::Two).with_alternations(0).is_err());
    let e = plain(SMOOTH, Algorithm::One).with_alternations(2).err().expect("x-z-u");
    assert!(e.to_string().contains("z-x-u order"), "{e}");
}

#[test]
fn what_needs_no_duals_or_all_of_them_says_so() {
    let e = Acceleration::anderson(Algorithm::Alternation, 3).of(admm(problem(SMOOTH, true))).err().expect("a dual");
    assert!(matches!(e, BuildError::Dual { term: 0, .. }) && e.to_string().contains("algorithm 2"), "{e}");
}
