//! Eigen-decompositions.

use crate::cases::{Random, matrix};
use crate::{determinant, orthonormality};
use proxel_linalg::simd::{F8, Isa, Kernel, Level, dispatch_at};
use proxel_linalg::svd::{Eigen, eig2_sym, eig3_sym, max_eigenvalue3};

/// Eight matrices: their decompositions and largest eigenvalues.
struct Eig3<'a>(&'a [[f64; 6]; 8]);

impl Kernel for Eig3<'_> {
    type Output = [(Eigen<f64, 3>, f64); 8];
    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let a = std::array::from_fn(|k| F8::<I>::load(&std::array::from_fn(|l| self.0[l][k])));
        let Eigen { q, lambda } = eig3_sym(a);
        let (q, lambda) = (q.map(|r| r.map(F8::to_array)), lambda.map(F8::to_array));
        let largest = max_eigenvalue3(a).to_array();
        std::array::from_fn(|l| (Eigen { q: q.map(|r| r.map(|x| x[l])), lambda: lambda.map(|x| x[l]) }, largest[l]))
    }
}

struct Eig2<'a>(&'a [[f64; 3]; 8]);

impl Kernel for Eig2<'_> {
    type Output = [Eigen<f64, 2>; 8];
    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let a = std::array::from_fn(|k| F8::<I>::load(&std::array::from_fn(|l| self.0[l][k])));
        let Eigen { q, lambda } = eig2_sym(a);
        let (q, lambda) = (q.map(|r| r.map(F8::to_array)), lambda.map(F8::to_array));
        std::array::from_fn(|l| Eigen { q: q.map(|r| r.map(|x| x[l])), lambda: lambda.map(|x| x[l]) })
    }
}

/// The symmetric matrix of N (N + 1) / 2 components: diagonal, then upper triangle by rows.
fn full<const N: usize>(a: &[f64]) -> [[f64; N]; N] {
    let mut m = [[0.0; N]; N];
    let mut next = N;
    for r in 0..N {
        m[r][r] = a[r];
        for c in r + 1..N {
            m[r][c] = a[next];
            m[c][r] = a[next];
            next += 1;
        }
    }
    m
}

/// Symmetric matrices of all classes: symmetric parts, and A^T A, with shifts.
fn symmetric<const N: usize, const K: usize>(random: &mut Random) -> [f64; K] {
    let mut a: [[f64; N]; N] = matrix(random);
    let size = a.iter().flatten().fold(0f64, |m, x| m.max(x.abs()));
    if random.below(2) == 0 && size > 1e-140 && size < 1e140 {
        a = std::array::from_fn(|r| std::array::from_fn(|c| (0..N).map(|k| a[k][r] * a[k][c]).sum()));
    }
    if random.below(3) == 0 {
        let shift = random.signed();
        for r in 0..N {
            a[r][r] += shift;
        }
    }
    let mut s = [0.0; K];
    let mut next = N;
    for r in 0..N {
        s[r] = a[r][r];
        for c in r + 1..N {
            s[next] = 0.5 * (a[r][c] + a[c][r]);
            next += 1;
        }
    }
    s
}

fn check<const N: usize>(a: &[f64], d: &Eigen<f64, N>, worst: &mut [f64; 2]) {
    let largest = a.iter().fold(0f64, |m, x| m.max(x.abs()));
    let scale = if largest > 0.0 { 2f64.powi((-largest.log2() as i32).min(1023)) } else { 1.0 };
    let m: [[f64; N]; N] = full(a);
    let lambda = d.lambda.map(|x| x * scale);
    let norm = lambda.iter().fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()));
    for r in 0..N {
        for c in 0..N {
            let sum: f64 = (0..N).map(|k| d.q[r][k] * lambda[k] * d.q[c][k]).sum();
            let error = (m[r][c] * scale - sum).abs() / norm;
            assert!(error <= 1e-14, "residual {error:e} of {a:?}: {d:?}");
            worst[0] = worst[0].max(error);
        }
    }
    let error = orthonormality(&d.q);
    assert!(error <= 1e-14 && determinant(&d.q) > 0.5, "{error:e} of {a:?}: {d:?}");
    worst[1] = worst[1].max(error);
    assert!(d.lambda.is_sorted_by(|x, y| x >= y), "{a:?}: {d:?}");
}

#[test]
fn eigenvectors_and_values_of_all_classes() {
    for level in [None].into_iter().chain(Level::available().into_iter().map(Some)) {
        let mut random = Random(1);
        let (mut three, mut two, mut top) = ([0f64; 2], [0f64; 2], 0f64);
        for _ in 0..super::cases() / 8 {
            let a: [[f64; 6]; 8] = std::array::from_fn(|_| symmetric::<3, 6>(&mut random));
            let all = level
                .map_or_else(|| a.map(|a| (eig3_sym(a), max_eigenvalue3(a))), |level| dispatch_at(level, Eig3(&a)));
            for (a, (d, largest)) in a.iter().zip(&all) {
                check(a, d, &mut three);
                let error = (largest - d.lambda[0]).abs() / d.lambda[0].abs().max(d.lambda[2].abs()).max(1e-300);
                assert!(error <= 2e-15, "{level:?}: {largest:e} of {a:?}: {d:?}");
                top = top.max(error);
            }
            let a: [[f64; 3]; 8] = std::array::from_fn(|_| symmetric::<2, 3>(&mut random));
            let all = level.map_or_else(|| a.map(eig2_sym), |level| dispatch_at(level, Eig2(&a)));
            for (a, d) in a.iter().zip(&all) {
                check(a, d, &mut two);
            }
        }
        let ([r3, q3], [r2, q2]) = (three, two);
        println!("{level:?}: worst residual and Q, 3x3 {r3:.2e} {q3:.2e}, 2x2 {r2:.2e} {q2:.2e}, largest {top:.2e}");
    }
}

#[test]
fn not_a_number_and_infinity_give_not_a_number() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for at in 0..6 {
            let mut a = [1.0, 2.0, 3.0, 0.5, 0.25, -0.5];
            a[at] = bad;
            for level in Level::available() {
                let (d, largest) = dispatch_at(level, Eig3(&[a; 8]))[3];
                assert!(d.q.iter().flatten().chain(&d.lambda).all(|x| x.is_nan()) && largest.is_nan(), "{level:?}");
            }
            if at < 3 {
                let d = eig2_sym([a[0], a[1], a[2]]);
                assert!(d.q.iter().flatten().chain(&d.lambda).all(|x| x.is_nan()));
            }
        }
    }
}

#[test]
fn eigenvalues_known_in_closed_form() {
    // 2 on the diagonal, -1 beside it: 2 - 2 cos(k pi / 4).
    let d = eig3_sym([2.0, 2.0, 2.0, -1.0, 0.0, -1.0]);
    let want = [2.0 + 2f64.sqrt(), 2.0, 2.0 - 2f64.sqrt()];
    for k in 0..3 {
        assert!((d.lambda[k] - want[k]).abs() < 2e-15, "{d:?}");
    }
    assert_eq!(eig3_sym([3.0, 3.0, 3.0, 0.0, 0.0, 0.0]).lambda, [3.0; 3]);
    assert_eq!(eig2_sym([1.0, 4.0, 2.0]).lambda, [5.0, 0.0]);
}
