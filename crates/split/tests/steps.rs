//! Steps in time by one method: what changes from step to step, residuals of A, and acceleration where it pays.

mod common;

use common::{FREE, Law, SMOOTH, admm, problem};
use proxel_split::{
    Accelerated, Acceleration, Algorithm, Anderson, Backtracking, Carrier, CombinedResidual, Cycle, ForwardResidual,
    ForwardResidualZxu, History, Inertia, Method, Order, Problem, QuasiNewton, QuasiNewtonSettings,
};

/// Inertia as of a step of another length.
fn stiffer(problem: &mut Problem) {
    let inertia = &problem.quadratic.inertia;
    let (stiffness, target) = (inertia.stiffness().iter().map(|k| 4.0 * k).collect(), inertia.target().to_vec());
    problem.quadratic.inertia = Inertia::new(stiffness, target, 1).expect("inertia");
}

/// The method after some steps on another problem, and a new one, run alike.
fn assert_alike(mut used: Box<dyn Method>, mut fresh: Box<dyn Method>, start: &[f64], name: &str) {
    for _ in 0..7 {
        used.step().expect("a step");
    }
    used.begin(start, false, &mut stiffer).expect("a new start");
    used.refactor().expect("a factor");
    for step in 0..9 {
        let (a, b) = (used.step().expect("a step"), fresh.step().expect("a step"));
        assert_eq!(used.x(), fresh.x(), "{name}, step {step}");
        assert_eq!((a.iteration, a.trial), (b.iteration, b.trial), "{name}, step {step}");
    }
}

#[test]
fn a_step_of_another_length_needs_new_numbers_only() {
    let fresh = || {
        let mut of = problem(SMOOTH, true);
        stiffer(&mut of);
        of
    };
    let start = problem(SMOOTH, true).x0;
    for algorithm in
        [Algorithm::One, Algorithm::Two, Algorithm::TwoRaw, Algorithm::Three, Algorithm::Four, Algorithm::Envelope]
    {
        let of = |problem| Acceleration::anderson(algorithm, 4).of(admm(problem)).expect("a method");
        assert_alike(of(problem(SMOOTH, true)), of(fresh()), &start, &format!("{algorithm:?}"));
    }
    let relaxed = |problem| -> Box<dyn Method> {
        let cycle = Cycle { order: Order::Xzu, relaxation: 1.6 };
        Box::new(admm(problem).with_cycle(cycle).expect("a cycle"))
    };
    assert_alike(relaxed(problem(SMOOTH, true)), relaxed(fresh()), &start, "over-relaxed");
    let lbfgs = |problem| -> Box<dyn Method> {
        let line_search = Backtracking { sufficient: 0.03, shrink: 0.5 };
        let settings =
            QuasiNewtonSettings { name: "lbfgs".to_string(), window: 5, line_search, blended: false, guarded: false };
        Box::new(QuasiNewton::new(problem, settings).expect("a method"))
    };
    assert_alike(lbfgs(problem(SMOOTH, true)), lbfgs(fresh()), &start, "lbfgs");
}

#[test]
fn a_start_of_another_length_is_refused() {
    let mut method = admm(problem(SMOOTH, true));
    let said = method.begin(&[0.0; 3], false, &mut |_| ()).expect_err("3 numbers are no start").to_string();
    assert!(said.contains("3 numbers"), "{said}");
}

/// sum w^2 v^2 with the weights of the only term.
fn square(problem: &Problem, v: impl Iterator<Item = f64>) -> f64 {
    let mut weights = vec![0.0; FREE];
    problem.terms[0].local_weights2(&mut weights);
    weights.iter().zip(v).map(|(w, v)| w * v * v).sum()
}

#[test]
fn squared_residuals_are_those_of_the_paper() {
    for order in [Order::Xzu, Order::Zxu] {
        let mut method = admm(problem(SMOOTH, true)).with_cycle(Cycle { order, relaxation: 1.0 }).expect("a cycle");
        assert_eq!(method.squared_residuals(), None, "nothing is known before the first iteration");
        for step in 0..12 {
            let coupled = |x: &[f64]| {
                let mut out = vec![0.0; FREE];
                problem(SMOOTH, true).terms[0].couple(x, &mut out);
                out
            };
            let (z_before, c_before) = (method.local(), coupled(method.x()));
            method.step().expect("a step");
            let (z, c) = (method.local(), coupled(method.x()));
            let (forward, combined) = match order {
                Order::Xzu => {
                    let gap = c_before.iter().zip(&z).map(|(c, z)| c - z);
                    let moved = z.iter().zip(&z_before).map(|(a, b)| a - b);
                    let forward = square(method.problem(), c.iter().zip(&z).map(|(c, z)| c - z));
                    (forward, square(method.problem(), gap) + square(method.problem(), moved))
                }
                Order::Zxu => {
                    let forward = square(method.problem(), c_before.iter().zip(&z).map(|(c, z)| c - z));
                    let gap = square(method.problem(), c.iter().zip(&z).map(|(c, z)| c - z));
                    let moved = square(method.problem(), c.iter().zip(&c_before).map(|(a, b)| a - b));
                    (forward, gap + moved)
                }
            };
            let got = method.squared_residuals().expect("residuals");
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
            assert!(near(got.forward, forward), "{order:?} {step}: {} {forward}", got.forward);
            assert!(near(got.combined, combined), "{order:?} {step}: {} {combined}", got.combined);
        }
    }
}

/// Cost, in plain iterations, until the gradient is small.
fn cost<C: Carrier>(law: Law, window: usize) -> (f64, f64) {
    let order = Cycle { order: C::ORDER, relaxation: 1.0 };
    let plain = || admm(problem(law, true)).with_cycle(order).expect("a cycle");
    let mut alone = plain();
    let bound = 1e-8 * alone.evaluate().gradient_norm;
    let mut iterations = 0;
    while alone.evaluate().gradient_norm > bound && iterations < 20_000 {
        alone.step().expect("a step");
        iterations += 1;
    }
    let accelerated = Accelerated::<C>::new(plain(), Box::new(Anderson::new(window)), History::AsPublished);
    let mut method = accelerated.expect("a method").where_it_pays(window);
    for _ in 0..40_000 {
        if method.evaluate().gradient_norm <= bound {
            break;
        }
        method.step().expect("a step");
    }
    assert!(method.evaluate().gradient_norm <= bound, "{}", C::NAME);
    (method.account().map_or(f64::NAN, |account| account.cost()), iterations as f64)
}

#[test]
fn where_it_pays_is_never_much_dearer_than_plain() {
    // A stiff chain and a soft one; a window that is far too large for twelve numbers.
    let laws = [SMOOTH, Law { k: 0.02, q: 0.0, limits: None }, Law { k: 30.0, q: 1.0, limits: None }];
    for law in laws {
        for window in [1, 6, 40] {
            let all = [
                cost::<CombinedResidual>(law, window),
                cost::<ForwardResidual>(law, window),
                cost::<ForwardResidualZxu>(law, window),
            ];
            for (k, (cost, plain)) in all.into_iter().enumerate() {
                assert!(cost <= 1.05 * plain + 8.0, "{law:?}, window {window}, carrier {k}: {cost} {plain}");
            }
        }
    }
}

#[test]
fn where_it_pays_begins_plainly_and_forgets_with_each_problem() {
    let how = Acceleration::anderson(Algorithm::One, 4);
    let mut method = how.where_it_pays(admm(problem(SMOOTH, true))).expect("a method");
    let mut plain = admm(problem(SMOOTH, true));
    let start = plain.x().to_vec();
    for round in 0..2 {
        for step in 0..20 {
            method.step().expect("a step");
            plain.step().expect("a step");
            assert_eq!(method.x(), plain.x(), "round {round}, step {step}");
        }
        let mut accelerated = 0;
        for _ in 0..400 {
            accelerated += usize::from(method.step().expect("a step").trial.accelerated);
        }
        assert!(accelerated > 0);
        method.begin(&start, false, &mut |_| ()).expect("a start");
        plain.begin(&start, false, &mut |_| ()).expect("a start");
    }
}
