use super::*;
use proxel_testkit::prox_by_force;

const LOW: f64 = 0.95;
const HIGH: f64 = 1.05;

fn objective<const K: usize, E: Energy<K>>(energy: &E, s: [f64; K], v: [f64; K], k: f64) -> f64 {
    energy.value(s) + 0.5 * k * (0..K).map(|i| (s[i] - v[i]).powi(2)).sum::<f64>()
}

/// The gradient of the objective without what the bounds hold against.
fn residual<const K: usize, E: Energy<K>>(energy: &E, s: [f64; K], v: [f64; K], k: f64, bounds: (f64, f64)) -> f64 {
    let g = energy.gradient(s);
    (0..K)
        .map(|i| {
            let g = g[i] + k * (s[i] - v[i]);
            if s[i] <= bounds.0 {
                (-g).max(0.0)
            } else if s[i] >= bounds.1 {
                g.max(0.0)
            } else {
                g.abs()
            }
        })
        .fold(0.0, f64::max)
}

#[test]
fn limits_hold_and_the_prox_is_stationary_within_them() {
    struct Optimal;
    impl Check for Optimal {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let mut random = SplitMix::new(21);
            let slope = energy.slope_stiffness();
            for bounds in [(LOW, HIGH), (0.5, 2.0), (0.9, f64::INFINITY)] {
                let limited = Limited::new(energy.clone(), bounds.0, bounds.1).unwrap();
                for n in 0..600 {
                    let v: [f64; K] = if n % 5 == 0 { [random.uniform(-1.0, 3.0); K] } else { random.array(-1.0, 3.0) };
                    let k = slope * random.log_uniform(0.1, 10.0);
                    let warm = if n % 2 == 0 { [1.0; K] } else { random.array(-1.0, 3.0) };
                    let p = limited.prox(v, k, warm);
                    assert!(p.converged, "{name} {bounds:?} {v:?} {k} {warm:?}: {:?}", p.s);
                    assert!(p.s.iter().all(|s| (bounds.0..=bounds.1).contains(s)), "{name} {:?}", p.s);
                    assert!(Energy::<K>::value(&limited, p.s).is_finite());
                    let size = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(1.0);
                    let found = residual(energy, p.s, v, k, bounds) / (1e-10 * k * size);
                    assert!(found <= 1.0, "{name} {bounds:?} {v:?} {k} {warm:?}: {:?} {found}", p.s);
                }
            }
        }
    }
    on_all(&Optimal);
}

#[test]
fn the_prox_is_the_global_minimum_in_narrow_limits() {
    struct Force;
    impl Check for Force {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let limited = Limited::new(energy.clone(), LOW, HIGH).unwrap();
            let mut random = SplitMix::new(22);
            let slope = energy.slope_stiffness();
            let (mut low, mut high, mut free) = (0, 0, 0);
            for n in 0..60 {
                let v: [f64; K] = if n % 2 == 0 { random.array(0.9, 1.1) } else { random.array(-1.0, 3.0) };
                let k = slope * random.log_uniform(0.3, 10.0);
                let value = |s: &[f64]| energy.value::<f64>(s.try_into().expect("K stretches"));
                let force = prox_by_force(&value, &v, k, LOW, HIGH, [0, 100, 24, 10][K]);
                let s = limited.prox(v, k, [1.0; K]).s;
                let found = objective(energy, s, v, k);
                assert!(
                    found <= force.value + 1e-9 * force.value.abs() + 1e-13 * k,
                    "{name} {v:?} {k}: {s:?} {force:?}"
                );
                for s in s {
                    low += usize::from(s == LOW);
                    high += usize::from(s == HIGH);
                    free += usize::from(s > LOW && s < HIGH);
                }
            }
            assert!(low > 5 && high > 5 && free > 5, "{name}: every case is met: {low} {high} {free}");
        }
    }
    on_all(&Force);
}

#[test]
fn outside_the_value_is_infinite_and_bad_limits_are_refused() {
    let psi = Limited::new(Arap { scale: 2.0 }, LOW, HIGH).unwrap();
    let value = |s: [f64; 2]| Energy::<2>::value(&psi, s);
    assert_eq!(value([1.0, 1.05 + 1e-15]), f64::INFINITY);
    assert_eq!(value([1.0, 0.94]), f64::INFINITY);
    assert_eq!(value([f64::NAN, 1.0]), f64::INFINITY);
    assert!((value([1.05, 0.95]) - 2.0 * 2.0 * 0.0025).abs() < 1e-15);
    assert!((Energy::<2>::smooth_value(&psi, [1.1, 1.0]) - 0.02).abs() < 1e-15);
    assert_eq!(Energy::<2>::limits(&psi), Some((LOW, HIGH)));
    assert!(!psi.prox([f64::NAN, 1.0], 1.0, [1.0; 2]).converged);
    for (low, high) in [(0.0, 1.0), (1.01, 1.1), (0.9, 0.99), (1.0, 1.0), (f64::NAN, 2.0), (0.9, f64::NAN), (-1.0, 2.0)]
    {
        let told = Limited::new(Arap::default(), low, high).unwrap_err().to_string();
        assert!(told.contains("LO") && told.contains("0.95,1.05"), "{told}");
    }
}
