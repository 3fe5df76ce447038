//! Hard limits of stretches as a potential: derivatives, invariance, multipliers.

use proxel_model::strain_limit::{LimitedElements, StrainLimits};
use proxel_split::Potential;

/// A triangle, a tetrahedron and a spring, whose corners they share.
fn limits() -> StrainLimits {
    let rest = [0.0, 0.0, 0.0, 1.0, 0.0, 0.1, 0.2, 0.9, 0.0, 0.1, 0.2, 1.1];
    let mut of = LimitedElements::default();
    of.add::<2>(&rest, &[2, 0, 1], None, [0.9, 1.1]).unwrap();
    of.add::<3>(&rest, &[0, 1, 2, 3], Some(&[0.5]), [0.8, 1.05]).unwrap();
    of.add::<1>(&rest, &[3, 1], None, [0.95, 1.02]).unwrap();
    StrainLimits::new(of, &[3.0, 5.0, 7.0, 2.0], 4.0)
}

/// Stretched along one axis and pushed together along another.
const FAR: [f64; 12] = [0.1, -0.1, 0.0, 1.4, 0.05, 0.2, 0.25, 0.55, -0.1, 0.0, 0.3, 1.3];

fn gradient(of: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let mut grad = vec![0.0; x.len()];
    of.value_and_gradient(x, Some(&mut grad));
    grad
}

#[test]
fn gradient_and_blocks_are_the_derivatives() {
    // Multipliers of before, at another place.
    let mut before = FAR;
    before[3] = 1.2;
    before[7] = 0.7;
    let limits = limits().renewed(&before).0.stiffer(3.0);
    let (n, h) = (FAR.len(), 1e-6);
    let mut hessian = vec![vec![0.0; n]; n];
    let buckling = limits.buckling();
    for of in [&limits as &dyn Potential, &buckling] {
        of.for_each_block(&FAR, &mut |i, j, block| {
            assert!(i >= j && i < of.n());
            for r in 0..3 {
                for c in 0..3 {
                    hessian[3 * i + r][3 * j + c] += block[r][c];
                    if i != j {
                        hessian[3 * j + c][3 * i + r] += block[r][c];
                    }
                }
            }
        });
    }
    let grad = gradient(&limits, &FAR);
    assert!(grad.iter().any(|g| g.abs() > 0.1));
    for a in 0..n {
        let at = |t: f64| {
            let mut x = FAR;
            x[a] += t;
            x
        };
        let value = |t: f64| limits.value_and_gradient(&at(t), None);
        let slope = (value(h) - value(-h)) / (2.0 * h);
        assert!((slope - grad[a]).abs() < 1e-6, "{a}: {slope} {}", grad[a]);
        let (more, less) = (gradient(&limits, &at(h)), gradient(&limits, &at(-h)));
        for b in 0..n {
            let second = (more[b] - less[b]) / (2.0 * h);
            assert!((second - hessian[a][b]).abs() < 1e-5, "{a} {b}: {second} {}", hessian[a][b]);
        }
    }
}

#[test]
fn the_convex_part_has_no_negative_curvature() {
    let limits = limits();
    let n = FAR.len();
    let mut hessian = vec![vec![0.0; n]; n];
    limits.for_each_block(&FAR, &mut |i, j, block| {
        for r in 0..3 {
            for c in 0..3 {
                hessian[3 * i + r][3 * j + c] += block[r][c];
                if i != j {
                    hessian[3 * j + c][3 * i + r] += block[r][c];
                }
            }
        }
    });
    for k in 0..200 {
        let d: Vec<f64> = (0..n).map(|i| ((k * n + i) as f64 * 1.7).sin()).collect();
        let form: f64 = (0..n).map(|i| (0..n).map(|j| d[i] * hessian[i][j] * d[j]).sum::<f64>()).sum();
        assert!(form >= -1e-9, "{form}");
    }
}

#[test]
fn what_is_within_its_limits_feels_nothing_and_turns_freely() {
    let limits = limits();
    let rest = [0.0, 0.0, 0.0, 1.0, 0.0, 0.1, 0.2, 0.9, 0.0, 0.1, 0.2, 1.1];
    assert_eq!(limits.value_and_gradient(&rest, None), 0.0);
    let turned = |x: &[f64]| -> Vec<f64> {
        let (c, s) = (0.3_f64.cos(), 0.3_f64.sin());
        x.chunks_exact(3).flat_map(|p| [c * p[0] - s * p[1] + 5.0, s * p[0] + c * p[1] - 2.0, p[2] + 1.0]).collect()
    };
    let (here, there) = (limits.value_and_gradient(&FAR, None), limits.value_and_gradient(&turned(&FAR), None));
    assert!((here - there).abs() < 1e-12 * here && here > 0.0, "{here} {there}");
    // Forces add up to nothing.
    let grad = gradient(&limits, &FAR);
    for d in 0..3 {
        let sum: f64 = grad.iter().skip(d).step_by(3).sum();
        assert!(sum.abs() < 1e-12, "{sum}");
    }
}

#[test]
fn renewed_multipliers_find_the_force_of_a_limit() {
    // A spring of length 1 that may not grow by more than a tenth, held at one end and pulled by 3 N at the other: the
    // limit bears what is pulled.
    let mut of = LimitedElements::default();
    of.add::<1>(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], &[1, 0], None, [0.9, 1.1]).unwrap();
    let mut limits = StrainLimits::new(of, &[2.0], 2.0);
    let mut x = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut moved = f64::INFINITY;
    for _ in 0..40 {
        for _ in 0..200 {
            // Newton on the only coordinate that matters.
            let (mut grad, mut second) = ([0.0; 3], 0.0);
            limits.value_and_gradient(&x, Some(&mut grad));
            limits.for_each_block(&x, &mut |i, j, block| second += if i == 0 && j == 0 { block[0][0] } else { 0.0 });
            x[0] -= ((grad[0] - 3.0) / second.max(1.0)).clamp(-0.1, 0.1);
        }
        (limits, moved) = limits.renewed(&x);
    }
    assert!(moved < 1e-9, "{moved}");
    assert!((x[0] - 1.1).abs() < 1e-9, "{}", x[0]);
    let again = limits.with(&limits.multipliers()).unwrap();
    assert_eq!(again.multipliers(), limits.multipliers());
    // S with F S = 3.
    assert!((limits.multipliers()[0] * 1.1 - 3.0).abs() < 1e-6, "{:?}", limits.multipliers());
    assert_eq!(limits.forgotten().multipliers(), vec![0.0; 12]);
    assert!(limits.with(&[0.0; 11]).is_none() && limits.with(&[0.0; 24]).is_none());
}
