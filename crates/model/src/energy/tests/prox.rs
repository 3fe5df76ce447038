use super::*;
use proxel_testkit::prox_by_force;

/// The gradient of the objective, where a stretch lies on the bound only its part that points inwards.
fn residual<const K: usize, E: Energy<K>>(energy: &E, s: [f64; K], v: [f64; K], k: f64) -> f64 {
    let g = energy.gradient(s);
    (0..K)
        .map(|i| {
            let g = g[i] + k * (s[i] - v[i]);
            if E::PROX_POSITIVE && s[i] <= 1e-14 { g.min(0.0).abs() } else { g.abs() }
        })
        .fold(0.0, f64::max)
}

fn objective<const K: usize, E: Energy<K>>(energy: &E, s: [f64; K], v: [f64; K], k: f64) -> f64 {
    energy.value(s) + 0.5 * k * (0..K).map(|i| (s[i] - v[i]).powi(2)).sum::<f64>()
}

fn norm<const K: usize>(v: &[f64; K]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// v, k, warm over the range that splittings meet.
fn problems<const K: usize, E: Energy<K>>(energy: &E, count: usize) -> Vec<([f64; K], f64, [f64; K])> {
    let mut random = SplitMix::new(11);
    let slope = energy.slope_stiffness();
    (0..count)
        .map(|n| {
            let v = if n % 5 == 0 { [random.uniform(-2.0, 4.0); K] } else { random.array(-2.0, 4.0) };
            let k = slope * random.log_uniform(0.1, 10.0);
            let warm = match n % 3 {
                0 => [1.0; K],
                1 => v,
                _ => random.array(0.1, 2.5),
            };
            (v, k, warm)
        })
        .collect()
}

#[test]
fn every_prox_converges_to_a_minimum() {
    struct Optimal;
    impl Check for Optimal {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            for (v, k, warm) in problems(energy, 2000) {
                let p = energy.prox(v, k, warm);
                assert!(p.converged, "{name} {v:?} {k} {warm:?}: {:?}", p.s);
                let tolerance = 1e-10 * k * norm(&v).max(1.0);
                let found = residual(energy, p.s, v, k);
                assert!(found <= tolerance, "{name} {v:?} {k} {warm:?}: {:?} {:e}", p.s, found / tolerance);
                if E::PROX_POSITIVE {
                    assert!(p.s.iter().all(|s| *s >= 0.0), "{name} {v:?} {:?}", p.s);
                }
                // No saddle: the Hessian of the free stretches has no negative eigenvalue.
                let h = energy.hessian(p.s);
                let mut negated = [[0.0; K]; K];
                let free = |i: usize| !(E::PROX_POSITIVE && p.s[i] <= 1e-14);
                for i in (0..K).filter(|i| free(*i)) {
                    for j in (0..K).filter(|j| free(*j)) {
                        negated[i][j] = -h[i][j] - if i == j { k } else { 0.0 };
                    }
                }
                assert!(largest_eigenvalue(&negated) < 1e-6 * k, "{name} {v:?} {k} {warm:?}: {:?}", p.s);
                let best = objective(energy, p.s, v, k);
                if E::NAME != "neo-hookean" && (!E::PROX_POSITIVE || warm.iter().all(|w| *w > 0.0)) {
                    assert!(best <= objective(energy, warm, v, k) * (1.0 + 1e-12), "{name} {v:?}");
                }
            }
        }
    }
    on_all(&Optimal);
}

/// What [`compare_with_force`] counts.
struct Compared {
    worse: usize,
    better: usize,
    example: String,
}

/// The prox against the global minimum over the box [-4, 5]^K, for `count` problems with v in [low, high]^K.
fn compare_with_force<const K: usize, E: Energy<K>>(
    energy: &E,
    low: f64,
    high: f64,
    k_low: f64,
    count: usize,
) -> Compared {
    let mut random = SplitMix::new(13);
    let slope = energy.slope_stiffness();
    let mut compared = Compared { worse: 0, better: 0, example: String::new() };
    for _ in 0..count {
        let v: [f64; K] = random.array(low, high);
        let k = slope * random.log_uniform(k_low, 10.0);
        let bound = if E::PROX_POSITIVE { 0.0 } else { -4.0 };
        let value = |s: &[f64]| energy.value::<f64>(s.try_into().expect("K stretches"));
        let force = prox_by_force(&value, &v, k, bound, 5.0, [0, 200, 60, 22][K]);
        let p = energy.prox(v, k, [1.0; K]);
        let (found, slack) = (objective(energy, p.s, v, k), 1e-9 * force.value.abs() + 1e-13 * k);
        if found > force.value + slack {
            compared.worse += 1;
            compared.example = format!("v {v:?} k {k}: {:?} {found}, by force {:?} {}", p.s, force.x, force.value);
        }
        compared.better += usize::from(found < force.value - slack);
    }
    compared
}

#[test]
fn near_rest_the_prox_is_the_global_minimum() {
    struct Near;
    impl Check for Near {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let c = compare_with_force(energy, 0.4, 2.0, 0.3, 40);
            assert_eq!((c.worse, c.better), (0, 0), "{name}: {}", c.example);
        }
    }
    on_all(&Near);
}

/// Far from rest some energies have several minima, and the prox takes the one that its rule tells. Most of the time it is
/// the global one all the same; for convex energies it always is.
#[test]
fn far_from_rest_the_prox_is_mostly_the_global_minimum() {
    struct Far;
    impl Check for Far {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let c = compare_with_force(energy, -2.0, 4.0, 0.1, 60);
            let convex =
                ["corotated", "arap", "symmetric-dirichlet", "symmetric-gradient", "spring"].contains(&E::NAME);
            let allowed = if convex { 0 } else { 12 };
            assert!(c.worse <= allowed && c.better == 0, "{name} {} {}: {}", c.worse, c.better, c.example);
        }
    }
    on_all(&Far);
}

#[test]
fn far_targets_and_useless_guesses_do_not_harm() {
    struct Stress;
    impl Check for Stress {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let mut random = SplitMix::new(12);
            let slope = energy.slope_stiffness();
            for _ in 0..2000 {
                let size = random.log_uniform(1e-3, 30.0);
                let v = random.array(-size, size);
                let k = slope * random.log_uniform(1e-2, 1e3);
                let warm = match random.below(5) {
                    0 => [0.0; K],
                    1 => [f64::INFINITY; K],
                    2 => [1e200; K],
                    3 => [f64::NAN; K],
                    _ => random.array(-3.0, 3.0),
                };
                let p = energy.prox(v, k, warm);
                let ratio = residual(energy, p.s, v, k) / (1e-10 * k * norm(&v).max(1.0));
                assert!(p.converged && ratio <= 1.0, "{name} {v:?} {k} {warm:?}: {:?} {ratio}", p.s);
            }
        }
    }
    on_all(&Stress);
}

#[test]
fn a_target_that_is_no_number_does_not_converge() {
    struct NotANumber;
    impl Check for NotANumber {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut v = [1.0; K];
                v[K - 1] = bad;
                assert!(!energy.prox(v, energy.slope_stiffness(), [1.0; K]).converged, "{name} {bad}");
            }
            assert!(!energy.prox([1.0; K], f64::NAN, [1.0; K]).converged, "{name} k");
        }
    }
    on_all(&NotANumber);
}

#[test]
fn a_material_that_widens_when_stretched_converges_too() {
    let lame = Lame::from_young_poisson(1e6, -0.3).unwrap();
    assert!(lame.lambda() < 0.0);
    let e = <NeoHookean as Energy<3>>::from_lame(&lame);
    for (v, k, warm) in problems::<3, _>(&e, 500) {
        let p = e.prox(v, k, warm);
        assert!(p.converged && residual(&e, p.s, v, k) <= 1e-10 * k * norm(&v).max(1.0), "{v:?} {k} {:?}", p.s);
    }
}
