use super::*;
use proxel_testkit::{check_gradient, check_hessian};

/// Points this close to the seam of the extended logarithm at J = 0.1 have no smooth finite differences.
fn on_seam<const K: usize, E: Energy<K>>(s: &[f64; K]) -> bool {
    E::NAME == "neo-hookean" && (s.iter().product::<f64>() - 0.1).abs() < 0.01
}

#[test]
fn gradients_and_hessians_are_those_of_the_value() {
    struct Derivatives;
    impl Check for Derivatives {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let mut checked = 0;
            for s in points::<K, E>(80) {
                if on_seam::<K, E>(&s) {
                    continue;
                }
                let array = |x: &[f64]| -> [f64; K] { x.try_into().unwrap() };
                let h = 1e-3 * if E::BARRIER { s.iter().fold(1.0, |m: f64, x| m.min(*x)) } else { 1.0 };
                check_gradient(|x| energy.value(array(x)), &energy.gradient(s), &s, h, 1e-8)
                    .unwrap_or_else(|e| panic!("gradient of {name} at {s:?}: {e}"));
                check_hessian(|x| energy.gradient(array(x)).to_vec(), energy.hessian(s).as_flattened(), &s, h, 1e-8)
                    .unwrap_or_else(|e| panic!("Hessian of {name} at {s:?}: {e}"));
                checked += 1;
            }
            assert!(checked > 60, "{name} {checked}");
        }
    }
    on_all(&Derivatives);
}

#[test]
fn rest_has_no_energy_and_no_stress_and_is_stable() {
    struct Rest;
    impl Check for Rest {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let (one, scale) = ([1.0; K], energy.rest_stiffness());
            assert!(energy.value(one).abs() <= 1e-15 * scale, "{name}");
            assert!(energy.gradient(one).iter().all(|g| g.abs() <= 1e-15 * scale), "{name}");
            let negated = energy.hessian(one).map(|row| row.map(|h| -h));
            assert!(-largest_eigenvalue(&negated) > 0.0, "{name}");
            assert!(energy.slope_stiffness() > 0.0, "{name}");
        }
    }
    on_all(&Rest);
}

#[test]
fn elastic_energies_have_the_hessian_of_linear_elasticity_at_rest() {
    struct Linear;
    impl Check for Linear {
        fn run<const K: usize, E: Energy<K>>(&self, _: &E, name: &str) {
            if !["neo-hookean", "stable-neo-hookean", "stvk", "fixed-corotated"].contains(&E::NAME) {
                return;
            }
            let lame = Lame::new(3.0, 11.0).unwrap();
            let h = E::from_lame(&lame).hessian([1.0; K]);
            for i in 0..K {
                for j in 0..K {
                    let expected = 11.0 + if i == j { 6.0 } else { 0.0 };
                    assert!((h[i][j] - expected).abs() < 1e-13, "{name} {i} {j} {}", h[i][j]);
                }
            }
        }
    }
    on_all(&Linear);
}

#[test]
fn divided_differences_are_the_quotients_and_their_limits() {
    struct Quotients;
    impl Check for Quotients {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let mut compared = 0;
            for s in points::<K, E>(80) {
                let (g, d) = (energy.gradient(s), energy.divided_differences(s));
                for i in 0..K {
                    assert_eq!((d.minus[i][i], d.plus[i][i]), (0.0, 0.0));
                    for j in (0..K).filter(|j| *j != i) {
                        let scale = (g[i].abs() + g[j].abs()).max(energy.rest_stiffness());
                        for (sign, found) in [(-1.0, d.minus[i][j]), (1.0, d.plus[i][j])] {
                            let over = s[i] + sign * s[j];
                            if over.abs() > 0.1 {
                                let quotient = (g[i] + sign * g[j]) / over;
                                assert!((found - quotient).abs() < 1e-12 * scale, "{name} {s:?} {found} {quotient}");
                                compared += 1;
                            }
                        }
                    }
                }
            }
            assert!(K == 1 || compared > 100, "{name} {compared}");
            for s in points::<K, E>(80) {
                coinciding(energy, name, s);
            }
        }
    }
    on_all(&Quotients);
}

/// Equal and opposite stretches: the limits, and no jump next to them.
fn coinciding<const K: usize, E: Energy<K>>(energy: &E, name: &str, s: [f64; K]) {
    for (i, j) in [(0, 1), (0, 2), (1, 2)].into_iter().filter(|(_, j)| *j < K) {
        for sign in [1.0, -1.0] {
            if E::BARRIER && sign < 0.0 {
                continue;
            }
            let mut s = s;
            s[j] = sign * s[i];
            let (g, h, d) = (energy.gradient(s), energy.hessian(s), energy.divided_differences(s));
            let found = if sign > 0.0 { d.minus[i][j] } else { d.plus[i][j] };
            let scale = h.as_flattened().iter().fold(energy.rest_stiffness(), |m, x| m.max(x.abs()));
            if (g[i] - sign * g[j]).abs() > 1e-10 * scale {
                assert!(found.is_infinite(), "{name} {s:?} {found}"); // the kink of |F - R|
                continue;
            }
            let limit = h[i][i] - sign * h[i][j];
            assert!((found - limit).abs() < 1e-12 * scale, "{name} {s:?} {found} {limit}");
            s[j] *= 1.0 + 1e-10;
            let near = energy.divided_differences(s);
            let near = if sign > 0.0 { near.minus[i][j] } else { near.plus[i][j] };
            if !on_seam::<K, E>(&s) {
                assert!((near - limit).abs() < 1e-8 * scale, "{name} {s:?} {near} {limit}");
            }
        }
    }
}

#[test]
fn neo_hookean_is_twice_differentiable_at_the_seam() {
    let e = NeoHookean { mu: 1.0, lambda: 9.0 };
    let (below, above) = ([0.1 - 1e-10, 1.0, 1.0], [0.1 + 1e-10, 1.0, 1.0]);
    assert!((e.value(below) - e.value(above)).abs() < 1e-6);
    for i in 0..3 {
        assert!((e.gradient(below)[i] - e.gradient(above)[i]).abs() < 1e-4);
        for j in 0..3 {
            let (a, b) = (e.hessian(below)[i][j], e.hessian(above)[i][j]);
            assert!((a - b).abs() < 1e-6 * b.abs().max(1.0), "{a} {b}");
        }
    }
}

#[test]
fn barriers_are_infinite_outside() {
    struct Outside;
    impl Check for Outside {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            for x in [0.0, -1e-300, -1.0] {
                let mut s = [1.0; K];
                s[K - 1] = x;
                assert_eq!(energy.value(s) == f64::INFINITY, E::BARRIER, "{name} {x}");
            }
        }
    }
    on_all(&Outside);
}

#[test]
fn the_effective_stiffness_is_the_largest_eigenvalue() {
    struct Stiffness;
    impl Check for Stiffness {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            for s in points::<K, E>(40) {
                let (h, found) = (energy.hessian(s), energy.effective_stiffness(s));
                let scale = h.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
                let largest = jacobi(h).into_iter().fold(0.0, f64::max);
                assert!((found - largest).abs() < 1e-7 * scale, "{name} {s:?} {found} {largest}");
            }
        }
    }
    on_all(&Stiffness);
}

#[test]
fn the_mean_stiffness_is_that_of_the_extreme_eigenvalues() {
    struct Mean;
    impl Check for Mean {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let eigenvalues = jacobi(energy.hessian([1.0; K]));
            let least = eigenvalues.into_iter().fold(f64::INFINITY, f64::min);
            let expected = (least * energy.rest_stiffness()).sqrt();
            let found = energy.mean_stiffness();
            assert!(least > 0.0 && (found - expected).abs() < 1e-7 * expected, "{name} {found} {expected}");
        }
    }
    on_all(&Mean);
}

/// The eigenvalues of a symmetric matrix by 20 sweeps of Jacobi rotations.
fn jacobi<const K: usize>(mut a: [[f64; K]; K]) -> [f64; K] {
    for _ in 0..20 {
        for p in 0..K {
            for q in p + 1..K {
                let angle = 0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p]);
                let (s, c) = angle.sin_cos();
                for i in 0..K {
                    (a[i][p], a[i][q]) = (c * a[i][p] - s * a[i][q], s * a[i][p] + c * a[i][q]);
                }
                for i in 0..K {
                    (a[p][i], a[q][i]) = (c * a[p][i] - s * a[q][i], s * a[p][i] + c * a[q][i]);
                }
            }
        }
    }
    std::array::from_fn(|i| a[i][i])
}
