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
                if !(E::NAME == "neo-hookean") && (!E::PROX_POSITIVE || warm.iter().all(|w| *w > 0.0)) {
                    assert!(best <= objective(energy, warm, v, k) * (1.0 + 1e-12), "{name} {v:?}");
                }
            }
        }
    }
    on_all(&Optimal);
}

#[test]
fn brute_force_report() {
    struct Force;
    impl Check for Force {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let (mut worse, mut better, mut example, mut gap) = (0, 0, String::new(), 0.0);
            let problems = problems(energy, 60);
            for (v, k, warm) in &problems {
                let low = if E::PROX_POSITIVE { 0.0 } else { -4.0 };
                let cells = [0, 400, 60, 22][K];
                let value = |s: &[f64]| energy.value::<f64>(s.try_into().unwrap());
                let force = prox_by_force(&value, v, *k, low, 5.0, cells);
                let p = energy.prox(*v, *k, *warm);
                let found = objective(energy, p.s, *v, *k);
                if found > force.value + 1e-9 * force.value.abs() {
                    worse += 1;
                    let g = found / force.value - 1.0;
                    if g > gap {
                        gap = g;
                        example = format!("v {v:.3?} k {k:.3e} warm {warm:.3?} found {:.3?} force {:.3?} {found:.4e} {:.4e}", p.s, force.x, force.value);
                    }
                } else if found < force.value - 1e-9 * force.value.abs() {
                    better += 1;
                }
            }
            println!("{name}: {worse} of {} worse (up to {gap:.2}), {better} better {example}", problems.len());
        }
    }
    on_all(&Force);
}
