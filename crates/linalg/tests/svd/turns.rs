//! Polar factors and quaternions.

use crate::cases::{Random, matrix, product};
use crate::{decompose, everywhere, orthonormality};
use proxel_linalg::simd::{F8, Isa, Kernel, Level, dispatch_at};
use proxel_linalg::svd::{
    quaternion_from_rotation, rotation, rotation_from_quaternion, rotation_thin, stretch2, stretch3, svd2, svd3_quat,
    svd32,
};

type Matrix3 = [[f64; 3]; 3];

fn difference<const R: usize, const C: usize>(a: &[[f64; C]; R], b: &[[f64; C]; R]) -> f64 {
    (0..R * C).fold(0f64, |m, k| m.max((a[k / C][k % C] - b[k / C][k % C]).abs()))
}

#[test]
fn polar_factors_multiply_to_the_matrix() {
    let mut random = Random(21);
    for level in everywhere() {
        for _ in 0..2000 {
            let a: Matrix3 = random.matrix();
            let d = decompose(level, &[a])[0];
            let r = rotation(&d);
            let [xx, yy, zz, xy, xz, yz] = stretch3(&d.v, d.s);
            let stretch = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
            assert!(difference(&product(&r, &stretch), &a) < 1e-14 && orthonormality(&r) < 1e-14, "{a:?}");
        }
    }
    for _ in 0..2000 {
        let a: [[f64; 2]; 3] = random.matrix();
        let d = svd32(a);
        let [xx, yy, xy] = stretch2(&d.v, d.s);
        assert!(difference(&product(&rotation_thin(&d), &[[xx, xy], [xy, yy]]), &a) < 1e-14, "{a:?}");
        let a: [[f64; 2]; 2] = random.matrix();
        let d = svd2(a);
        let [xx, yy, xy] = stretch2(&d.v, d.s);
        assert!(difference(&product(&rotation(&d), &[[xx, xy], [xy, yy]]), &a) < 1e-14, "{a:?}");
    }
    // The rotation of a rotation is itself, and that of a positive definite matrix is the identity.
    let q = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    assert!(difference(&rotation(&decompose(None, &[q])[0]), &q) < 1e-15);
}

struct Quaternions<'a>(&'a [Matrix3; 8]);

impl Kernel for Quaternions<'_> {
    /// (quaternion of each, matrix of that again)
    type Output = [([f64; 4], Matrix3); 8];
    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let r =
            std::array::from_fn(|i| std::array::from_fn(|j| F8::<I>::load(&std::array::from_fn(|l| self.0[l][i][j]))));
        let q = quaternion_from_rotation(r);
        let again = rotation_from_quaternion(q).map(|r| r.map(F8::to_array));
        let q = q.map(F8::to_array);
        std::array::from_fn(|l| (q.map(|x| x[l]), again.map(|r| r.map(|x| x[l]))))
    }
}

/// Rotations of all kinds: random, by half a turn, by tiny angles, of the axes.
fn turn(random: &mut Random) -> Matrix3 {
    let mut q: [f64; 4] = std::array::from_fn(|_| random.signed());
    match random.below(5) {
        0 => q[3] = 0.0,
        1 => q[3] *= random.power(-20.0, 0.0),
        2 => q[..3].iter_mut().for_each(|x| *x *= random.power(-20.0, 0.0)),
        3 => q = q.map(|x| x.round() + f64::from(u8::from(x.abs() > 0.9))),
        _ => {}
    }
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if norm > 0.0 { rotation_from_quaternion(q.map(|x| x / norm)) } else { turn(random) }
}

#[test]
fn rotations_survive_as_quaternions() {
    for level in everywhere() {
        let (mut random, mut worst) = (Random(2), 0f64);
        for _ in 0..super::cases() / 16 {
            let r: [Matrix3; 8] = std::array::from_fn(|_| turn(&mut random));
            let results = match level {
                Some(level) => dispatch_at(level, Quaternions(&r)),
                None => r.map(|r| (quaternion_from_rotation(r), rotation_from_quaternion(quaternion_from_rotation(r)))),
            };
            for (r, (q, again)) in r.iter().zip(&results) {
                let error = difference(r, again);
                let norm = q.iter().map(|x| x * x).sum::<f64>();
                assert!(error <= 3e-15 && (norm - 1.0).abs() < 1e-15, "{level:?}: {error:e} of {r:?}: {q:?}");
                worst = worst.max(error);
            }
        }
        println!("{level:?}: worst error of a rotation through a quaternion {worst:.2e}");
    }
    let half_turn = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(quaternion_from_rotation(half_turn).map(f64::abs), [0.0, 0.0, 1.0, 0.0]);
    assert!(dispatch_at(Level::best(), Quaternions(&[[[f64::NAN; 3]; 3]; 8]))[0].0.iter().all(|x| x.is_nan()));
}

#[test]
fn svd_as_quaternions_rebuilds_the_matrix() {
    let mut random = Random(8);
    for _ in 0..20_000 {
        let a: Matrix3 = matrix(&mut random);
        let (u, s, v) = svd3_quat(a);
        let (u, v) = (rotation_from_quaternion(u), rotation_from_quaternion(v));
        let us: Matrix3 = std::array::from_fn(|r| std::array::from_fn(|c| u[r][c] * s[c]));
        let vt: Matrix3 = std::array::from_fn(|r| std::array::from_fn(|c| v[c][r]));
        assert!(difference(&product(&us, &vt), &a) <= 1e-14 * s[0], "{a:?}");
    }
}
