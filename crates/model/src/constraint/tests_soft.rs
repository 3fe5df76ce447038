//! Soft sets in methods that know no hard ones, and in one that knows no variable without a dual.

use super::tests::Ball;
use super::*;
use proxel_split::{Acceleration, Admm, Algorithm, Cycle, Method, Order, Problem, Term};
use proxel_testkit::random::SplitMix;
use std::sync::Arc;

/// Slow twin: the prox of w/2 dist^2 by search, for a surface that is not flat.
#[test]
fn a_soft_set_with_a_dual_has_the_prox_of_its_distance() {
    let (weight, mu) = (0.7, 2.5);
    let near = Cells::<Vertex, _>::new(vec![0, 1], 1, Near::Shared(Arc::new(Ball))).unwrap();
    let mut term = Batch::new(Arc::new(near), Hold::Split { weight, mu });
    let mut random = SplitMix::new(3);
    let x: Vec<f64> = (0..6).map(|_| random.uniform(-2.0, 2.0)).collect();
    let u0: Vec<f64> = (0..6).map(|_| random.uniform(-0.3, 0.3)).collect();
    let (mut p, mut u, mut grad) = (x.clone(), u0.clone(), vec![0.0; 6]);
    let report = term.cycle_step(&Cycle::PLAIN, &x, &mut p, &mut u, &mut grad);
    let mut sum = 0.0;
    for k in 0..2 {
        let at = |v: &[f64]| [v[3 * k], v[3 * k + 1], v[3 * k + 2]];
        let (v, z) = (add(at(&x), 1.0, at(&u0)), add(at(&p), 1.0, at(&u)));
        let value = |z: V3| {
            let off = norm(sub(z, Ball.closest(z)));
            0.5 * weight * off * off
        };
        let whole = |z: V3| value(z) + 0.5 * mu * dot(sub(z, v), sub(z, v));
        for spread in [1.0, 0.1, 1e-2, 1e-3] {
            for _ in 0..100 {
                let other = add(z, spread, random.array(-1.0, 1.0));
                assert!(whole(other) > whole(z) - 1e-12, "{other:?} is better than {z:?}");
            }
        }
        sum += value(z);
    }
    assert!((report.value_after - sum).abs() < 1e-13 && sum > 0.0, "{} {sum}", report.value_after);
    // The objective of x is that of the soft set without a dual.
    let near = Cells::<Vertex, _>::new(vec![0, 1], 1, Near::Shared(Arc::new(Ball))).unwrap();
    let mut plain = Batch::new(Arc::new(near), Hold::Soft(weight));
    let (mut a, mut b) = (vec![0.0; 6], vec![0.0; 6]);
    let (with, without) = (term.energy(&x, Some(&mut a)), plain.energy(&x, Some(&mut b)));
    assert_eq!((with.value, a), (without.value, b));
}

/// A surface that counts how often it is asked with a hint of its own, and how often without.
struct Counting([std::sync::atomic::AtomicUsize; 2]);

impl Closest for Counting {
    fn closest(&self, x: V3) -> V3 {
        self.0[0].fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        Ball.closest(x)
    }

    fn closest_from(&self, x: V3, _: &mut Hint) -> V3 {
        self.0[1].fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        Ball.closest(x)
    }
}

#[test]
fn every_nearest_point_is_sought_from_where_it_was() {
    // More elements than one task handles.
    let n = 700;
    let counting = Arc::new(Counting(Default::default()));
    let near = Cells::<Vertex, _>::new((0..n).collect(), 1, Near::Shared(counting.clone())).unwrap();
    let mut term = Batch::new(Arc::new(near), Hold::Soft(1.0));
    let x: Vec<f64> = (0..3 * n).map(|i| 1.0 + f64::from(i)).collect();
    let mut grad = vec![0.0; x.len()];
    term.energy(&x, Some(&mut grad));
    term.energy(&x, None);
    let asked = counting.0.each_ref().map(|n| n.load(std::sync::atomic::Ordering::Relaxed));
    assert_eq!(asked, [0, n as usize], "once at the same x, and never without a hint");
}

/// Points that are to be on a ball, at distances of each other and near their places, nothing of it hard.
fn soft_problem() -> Admm {
    let mut random = SplitMix::new(23);
    let x0: Vec<f64> = (0..24).map(|_| random.uniform(-1.0, 1.0)).collect();
    let near = Cells::<Vertex, _>::new((0..8).collect(), 1, Near::Shared(Arc::new(Ball))).unwrap();
    let pairs: Vec<u32> = (0..8).flat_map(|i| [i, (i + 1) % 8, i, (i + 3) % 8]).collect();
    let edges = Cells::<EdgeDifference, _>::new(pairs, 2, Length::equal(0.9)).unwrap();
    let terms: Vec<Box<dyn Term>> = vec![
        Box::new(Batch::new(Arc::new(near), Hold::Soft(1.0))),
        Box::new(Batch::new(Arc::new(edges), Hold::Soft(7.0))),
    ];
    let problem =
        Problem { dim: 3, n_free: 8, x0, terms, quadratic: proxel_split::Quadratic::default(), barrier: false };
    let (name, global) = ("test".to_string(), Box::new(proxel_split::Direct));
    Admm::new(problem, proxel_split::AdmmSettings { name, global, reweighting: None, renewed_at: None }).unwrap()
}

/// ShapeUp: Anderson acceleration never lets the objective rise, needs fewer steps, and ends where the gradient vanishes.
#[test]
fn nearest_points_and_solves_in_turns_are_accelerated() {
    let zxu = Cycle { order: Order::Zxu, relaxation: 1.0 };
    let mut plain = soft_problem().with_cycle(zxu).unwrap();
    let of = |m| Acceleration::anderson(Algorithm::Alternation, m).of(soft_problem()).unwrap();
    let mut none = of(0);
    for _ in 0..20 {
        plain.step().unwrap();
        let report = none.step().unwrap();
        assert_eq!(plain.x(), none.x(), "without columns the plain iteration, bit for bit");
        assert_eq!(report.merit, Some(report.local.objective));
    }
    let start = soft_problem().evaluate().gradient_norm;
    let needs = |mut method: Box<dyn Method>| {
        let mut before = f64::INFINITY;
        for k in 1..=4000 {
            let merit = method.step().unwrap().merit.unwrap_or(f64::NEG_INFINITY);
            assert!(merit <= before * (1.0 + 1e-13), "{k}: {merit} after {before}");
            before = merit.max(f64::MIN_POSITIVE);
            if method.evaluate().gradient_norm <= 1e-9 * start {
                return (k, method.energy().value);
            }
        }
        panic!("no minimum");
    };
    let (slow, fast) = (needs(of(0)), needs(of(5)));
    assert!(2 * fast.0 < slow.0, "{fast:?} {slow:?}");
    assert!((slow.1 - fast.1).abs() < 1e-9 * (1.0 + slow.1), "{fast:?} {slow:?}");
}
