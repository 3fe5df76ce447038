//! The bars of Figure 2: counts as published, one solution, and `simulate` on the same step.

use super::contest::Contest;
use super::course::{Course, Residual};
use crate::bars::Scene;
use proxel::split::{Acceleration, Algorithm};

/// Levels of the forward residual, and iterations to them: plain, and Algorithm 3 with m = 6.
const COUNTS: [(f64, usize, usize); 5] =
    [(1e-2, 24, 13), (1e-3, 45, 19), (1e-4, 66, 24), (1e-5, 88, 31), (1e-6, 110, 37)];

fn soft() -> Scene {
    Scene::new(0.399, [12, 3, 3]).expect("bars")
}

fn course(algorithm: Algorithm, most: usize, floor: f64) -> Course {
    let scene = soft();
    let mut method = Acceleration::anderson(algorithm, 6).of(scene.admm().expect("ADMM")).expect("an acceleration");
    let a = scene.bars.mean_edge();
    Course::run("soft-rubber", "aa", &mut *method, algorithm.order(), a, (most, floor)).expect("a run")
}

/// The largest distance of a vertex.
fn apart(x: &[f64], y: &[f64]) -> f64 {
    assert!(!x.is_empty() && x.len() == y.len());
    let far = |(x, y): (&[f64; 3], &[f64; 3])| (0..3).map(|d| (x[d] - y[d]).powi(2)).sum::<f64>().sqrt();
    x.as_chunks::<3>()
        .0
        .iter()
        .zip(y.as_chunks::<3>().0)
        .map(far)
        .fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m })
}

#[test]
fn all_algorithms_and_simulate_end_in_one_solution() {
    let bars = Contest::of_bars(true, 1, 0).expect("bars");
    let exact = bars.auto(1e-11, 200, 1, Some(1)).expect("a step");
    assert_eq!(exact.record.status, "converged", "{}", exact.record.reason);
    assert!(exact.forward < 1e-9, "{}", exact.forward);
    let plain = bars.by_admm(300, &[]).expect("ADMM").0;
    let mut ends = vec![("plain".to_string(), plain.x)];
    for algorithm in [Algorithm::One, Algorithm::Two, Algorithm::Three, Algorithm::Four] {
        ends.push((format!("{algorithm:?}"), course(algorithm, 300, 1e-11).x));
    }
    for (name, x) in ends {
        let far = apart(&x, &exact.x) / bars.a;
        assert!(far < 1e-8, "{name} ends {far:e} of the mean edge from where auto does");
    }
}

#[test]
fn counts_are_those_published() {
    let three = course(Algorithm::Three, 60, 1e-7);
    let plain = Contest::of_bars(true, 1, 0).expect("bars").by_admm(120, &[]).expect("ADMM").0;
    for (level, slow, fast) in COUNTS {
        let of = |course: &Course| course.reached(Residual::Forward, level).expect("reached").iteration;
        assert!(of(&plain).abs_diff(slow) <= 1, "{level:e}: {} plain iterations", of(&plain));
        assert!(of(&three).abs_diff(fast) <= 1, "{level:e}: {} of Algorithm 3", of(&three));
    }
}
