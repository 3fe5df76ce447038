//! Anderson acceleration on iterations whose limits are known.

use super::*;

/// A dense matrix with eigenvalues below 1, and a fixed part: G(q) = M q + b.
struct Affine {
    m: Vec<Vec<f64>>,
    b: Vec<f64>,
}

impl Affine {
    fn new(n: usize) -> Self {
        let mut seed = 12345_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let m = (0..n).map(|_| (0..n).map(|_| 0.9 * random() / n as f64 * 2.0).collect()).collect();
        Affine { m, b: (0..n).map(|_| random()).collect() }
    }

    /// Diagonal, with eigenvalues up to 0.98.
    fn slow(n: usize) -> Self {
        let entry = |i: usize, j: usize| if i == j { 0.98 * (i + 1) as f64 / n as f64 } else { 0.0 };
        Affine { m: (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect(), b: vec![1.0; n] }
    }

    fn at(&self, q: &[f64]) -> Vec<f64> {
        let row = |(m, b): (&Vec<f64>, &f64)| m.iter().zip(q).map(|(m, q)| m * q).sum::<f64>() + b;
        self.m.iter().zip(&self.b).map(row).collect()
    }
}

fn residual(g: &[f64], q: &[f64]) -> Vec<f64> {
    g.iter().zip(q).map(|(g, q)| g - q).collect()
}

/// |F| at each iterate.
fn norms(affine: &Affine, window: usize, steps: usize, metric: f64) -> Vec<f64> {
    let n = affine.b.len();
    let mut anderson = Anderson::new(window);
    let mut q = vec![0.0; n];
    (0..steps)
        .map(|_| {
            let g = affine.at(&q);
            let f = residual(&g, &q);
            let scaled: Vec<f64> = f.iter().map(|f| f * metric).collect();
            anderson.extrapolate(&g, &scaled, &mut q);
            vector::norm(&f)
        })
        .collect()
}

#[test]
fn an_affine_iteration_ends_after_dimension_plus_one_steps() {
    for n in [1, 2, 5, 8] {
        let affine = Affine::new(n);
        for window in [n, n + 3] {
            let norms = norms(&affine, window, n + 2, 1.0);
            // Entry k is the residual of the iterate after k steps.
            assert!(norms[n + 1] < 1e-9 * norms[0], "n = {n}, m = {window}: {norms:?}");
            assert!(n == 1 || norms[n - 1] > 1e-9 * norms[0], "n = {n}: too good to be true");
        }
    }
}

#[test]
fn a_smaller_window_still_helps() {
    let affine = Affine::slow(30);
    let (plain, accelerated) = (norms(&affine, 0, 25, 1.0), norms(&affine, 4, 25, 1.0));
    assert!(accelerated[24] < 0.1 * plain[24], "{} against {}", accelerated[24], plain[24]);
    // By numpy, with `lstsq` on the differences themselves.
    assert!((accelerated[24] - 0.049_827_524_971_397_2).abs() < 1e-10, "{}", accelerated[24]);
}

#[test]
fn without_a_window_it_is_the_iteration_itself() {
    let affine = Affine::new(6);
    let mut q = vec![0.0; 6];
    let mut anderson = Anderson::new(0);
    for _ in 0..10 {
        let g = affine.at(&q);
        anderson.extrapolate(&g, &residual(&g, &q), &mut q);
        assert_eq!(q, g);
    }
}

#[test]
fn the_unit_of_the_residual_does_not_matter() {
    let affine = Affine::new(12);
    let (plain, scaled) = (norms(&affine, 5, 12, 1.0), norms(&affine, 5, 12, 2_f64.powi(40)));
    assert_eq!(plain, scaled, "a power of two changes no bit");
}

#[test]
fn what_rides_along_is_extrapolated_alike() {
    // An affine function of the state in G stays that function of the state.
    let affine = Affine::new(7);
    let mut anderson = Anderson::new(4);
    let (mut q, mut carried) = (vec![0.0; 7], vec![0.0; 8]);
    for _ in 0..9 {
        let g = affine.at(&q);
        let f = residual(&g, &q);
        let mut longer = g.clone();
        longer.push(3.0 + g.iter().sum::<f64>());
        anderson.extrapolate(&longer, &f, &mut carried);
        q.copy_from_slice(&carried[..7]);
        assert!((carried[7] - (3.0 + q.iter().sum::<f64>())).abs() < 1e-12);
    }
}

#[test]
fn a_reset_forgets() {
    let affine = Affine::new(5);
    let mut anderson = Anderson::new(5);
    let mut q = vec![0.0; 5];
    for k in 0..6 {
        if k == 3 {
            anderson.reset();
        }
        let g = affine.at(&q);
        let f = residual(&g, &q);
        anderson.extrapolate(&g, &f, &mut q);
        assert_eq!(q == g, k == 0 || k == 3, "step {k}");
        assert_eq!(anderson.columns(), k % 3);
    }
}

#[test]
fn what_is_not_finite_and_what_stands_still_is_let_be() {
    let mut anderson = Anderson::new(3);
    let mut out = vec![0.0; 2];
    anderson.extrapolate(&[1.0, 2.0], &[1.0, 1.0], &mut out);
    anderson.extrapolate(&[1.0, 3.0], &[f64::NAN, 1.0], &mut out);
    assert_eq!(out, [1.0, 3.0]);
    anderson.extrapolate(&[1.0, 4.0], &[1.0, 1.0], &mut out);
    assert_eq!(out, [1.0, 4.0]);
    anderson.extrapolate(&[1.0, 5.0], &[1.0, 1.0], &mut out);
    assert_eq!(out, [1.0, 5.0], "no difference, nothing to learn");
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let n = 40_001;
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of a few threads");
        pool.install(|| {
            let mut anderson = Anderson::new(4);
            let mut q: Vec<f64> = (0..n).map(|i| f64::from(i % 97)).collect();
            for _ in 0..7 {
                let g: Vec<f64> = q.iter().enumerate().map(|(i, q)| (0.5 + (i % 7) as f64 * 0.07) * q.sin()).collect();
                let f = residual(&g, &q);
                anderson.extrapolate(&g, &f, &mut q);
            }
            q.iter().map(|q| q.to_bits()).collect::<Vec<_>>()
        })
    };
    let one = on(1);
    assert!(one == on(2) && one == on(3));
}
