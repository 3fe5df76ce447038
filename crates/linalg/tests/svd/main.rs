//! Decompositions of small matrices: accuracy, conventions, and independence of lanes under every instruction set.

mod cases;
mod ends;
mod symmetric;
mod turns;

use cases::{Random, matrix};
use proxel_linalg::simd::{F8, Isa, Kernel, Level, Real, dispatch_at};
use proxel_linalg::svd::{Svd, svd2, svd3, svd21, svd31, svd32};

/// The decomposition of a shape.
pub trait Lanes<const R: usize, const C: usize> {
    /// Of one matrix a lane.
    fn lanes<T: Real>(a: [[T; C]; R]) -> Svd<T, R, C>;
}

/// Implements [`Lanes`] for every shape that has a decomposition.
pub struct Of;

macro_rules! lanes {
    ($($f:ident $r:literal $c:literal;)*) => {$(
        impl Lanes<$r, $c> for Of {
            #[inline(always)]
            fn lanes<T: Real>(a: [[T; $c]; $r]) -> Svd<T, $r, $c> { $f(a) }
        }
    )*};
}
lanes!(svd3 3 3; svd32 3 2; svd2 2 2; svd31 3 1; svd21 2 1;);

/// Matrices in blocks of eight; the last block is filled up with its first matrix.
struct Blocks<'a, const R: usize, const C: usize>(&'a [[[f64; C]; R]]);

impl<const R: usize, const C: usize> Kernel for Blocks<'_, R, C>
where
    Of: Lanes<R, C>,
{
    type Output = Vec<Svd<f64, R, C>>;
    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let mut all = Vec::with_capacity(self.0.len() + 8);
        for block in self.0.chunks(8) {
            let lane = |l: usize| block.get(l).unwrap_or(&block[0]);
            let a = std::array::from_fn(|r| {
                std::array::from_fn(|c| F8::<I>::load(&std::array::from_fn(|l| lane(l)[r][c])))
            });
            let Svd { u, s, v } = Of::lanes(a);
            let (u, s, v) = (u.map(|r| r.map(F8::to_array)), s.map(F8::to_array), v.map(|r| r.map(F8::to_array)));
            for l in 0..block.len() {
                all.push(Svd { u: u.map(|r| r.map(|x| x[l])), s: s.map(|x| x[l]), v: v.map(|r| r.map(|x| x[l])) });
            }
        }
        all
    }
}

/// The decompositions of all matrices at a level.
pub fn at_level<const R: usize, const C: usize>(level: Level, a: &[[[f64; C]; R]]) -> Vec<Svd<f64, R, C>>
where
    Of: Lanes<R, C>,
{
    dispatch_at(level, Blocks(a))
}

/// Scalars (`None`) and every level of this machine.
pub fn everywhere() -> Vec<Option<Level>> {
    std::iter::once(None).chain(Level::available().into_iter().map(Some)).collect()
}

/// The decompositions of all matrices, in scalars or at a level.
pub fn decompose<const R: usize, const C: usize>(level: Option<Level>, a: &[[[f64; C]; R]]) -> Vec<Svd<f64, R, C>>
where
    Of: Lanes<R, C>,
{
    level.map_or_else(|| a.iter().map(|a| Of::lanes(*a)).collect(), |level| at_level(level, a))
}

/// max |Q^T Q - I|
pub fn orthonormality<const N: usize>(q: &[[f64; N]; N]) -> f64 {
    let mut worst = 0f64;
    for i in 0..N {
        for j in 0..N {
            let dot: f64 = (0..N).map(|r| q[r][i] * q[r][j]).sum();
            worst = worst.max((dot - f64::from(u8::from(i == j))).abs());
        }
    }
    worst
}

/// Of N = 1, 2 or 3.
pub fn determinant<const N: usize>(m: &[[f64; N]; N]) -> f64 {
    match N {
        1 => m[0][0],
        2 => m[0][0] * m[1][1] - m[0][1] * m[1][0],
        _ => (0..3)
            .map(|k| m[0][k] * (m[1][(k + 1) % 3] * m[2][(k + 2) % 3] - m[1][(k + 2) % 3] * m[2][(k + 1) % 3]))
            .sum(),
    }
}

/// Errors of one decomposition: |A - U S V^T| / |A|, |U^T U - I|, |V^T V - I|, largest entries.
pub fn errors<const R: usize, const C: usize>(a: &[[f64; C]; R], d: &Svd<f64, R, C>) -> [f64; 3] {
    let largest = a.iter().flatten().fold(0f64, |m, x| m.max(x.abs()));
    let scale = if largest > 0.0 { 2f64.powi((-largest.log2() as i32).min(1023)) } else { 1.0 };
    let s = d.s.map(|s| s * scale);
    let mut worst = 0f64;
    for r in 0..R {
        for c in 0..C {
            let sum: f64 = (0..C).map(|k| d.u[r][k] * s[k] * d.v[c][k]).sum();
            let error = (a[r][c] * scale - sum).abs() / s[0].max(f64::MIN_POSITIVE);
            worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
        }
    }
    [worst, orthonormality(&d.u), orthonormality(&d.v)]
}

/// Conventions: proper rotations, descending stretches, sign of the last one.
pub fn check_conventions<const R: usize, const C: usize>(a: &[[f64; C]; R], d: &Svd<f64, R, C>) {
    assert!(determinant(&d.u) > 0.5 && determinant(&d.v) > 0.5, "{a:?}: no rotations: {d:?}");
    for k in 1..C {
        assert!(d.s[k - 1] >= d.s[k].abs(), "{a:?}: stretches {:?}", d.s);
    }
    if R > C {
        assert!(d.s.iter().all(|s| *s >= 0.0), "{a:?}: stretches {:?}", d.s);
    } else {
        let square: [[f64; C]; C] = std::array::from_fn(|r| a[r].map(|x| x / d.s[0]));
        let det = determinant(&square);
        // Beyond doubt by rounding, also of subnormal stretches.
        if det.abs() > 1e-13 && d.s[0] > 1e-290 {
            assert_eq!(det > 0.0, d.s[C - 1] > 0.0, "{a:?}: det {det:e}, stretches {:?}", d.s);
        }
    }
}

fn sweep<const R: usize, const C: usize>(count: usize, limit: f64)
where
    Of: Lanes<R, C>,
{
    for level in everywhere() {
        let mut random = Random(7);
        let mut worst = [0f64; 3];
        for _ in 0..count / 800 {
            let batch: Vec<[[f64; C]; R]> = (0..800).map(|_| matrix(&mut random)).collect();
            for (a, d) in batch.iter().zip(decompose(level, &batch)) {
                check_conventions(a, &d);
                let e = errors(a, &d);
                assert!(e.iter().all(|e| *e <= limit), "{level:?}: errors {e:?} of {a:?}: {d:?}");
                worst = std::array::from_fn(|k| worst[k].max(e[k]));
            }
        }
        let [residual, u, v] = worst;
        println!("{R}x{C} {level:?}: worst residual {residual:.2e}, U {u:.2e}, V {v:.2e}");
    }
}

/// How many matrices of each shape a sweep takes; PROXEL_SVD_CASES raises it for a long run.
pub fn cases() -> usize {
    std::env::var("PROXEL_SVD_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(400_000)
}

#[test]
fn svd3_is_accurate_for_all_classes() {
    sweep::<3, 3>(3 * cases(), 1e-14);
}

#[test]
fn svd32_is_accurate_for_all_classes() {
    sweep::<3, 2>(cases(), 1e-14);
}

#[test]
fn svd2_is_accurate_for_all_classes() {
    sweep::<2, 2>(cases(), 1e-14);
}

#[test]
fn columns_are_accurate_for_all_classes() {
    sweep::<3, 1>(cases(), 1e-14);
    sweep::<2, 1>(cases(), 1e-14);
}

#[test]
fn stretches_are_known_to_machine_precision_of_the_largest() {
    let mut random = Random(13);
    for s in [[1.0, 1e-5, 1e-10], [1.0, 1e-8, -1e-8], [1.0, 1.0, 1e-12], [1.0, 0.25, 0.0], [1.0, 1.0, -1.0]] {
        for _ in 0..5000 {
            // Two proper rotations, so that the sign of the last stretch stays.
            let [u, v] = [0, 1].map(|_| {
                let mut q: [[f64; 3]; 3] = random.orthonormal();
                if determinant(&q) < 0.0 {
                    q = q.map(|row| row.map(|x| -x));
                }
                q
            });
            let us: [[f64; 3]; 3] = std::array::from_fn(|r| std::array::from_fn(|c| u[r][c] * s[c]));
            let a = cases::product(&us, &v);
            for level in everywhere() {
                let d = decompose(level, &[a])[0];
                for k in 0..3 {
                    assert!((d.s[k] - s[k]).abs() <= 2e-15, "{level:?}: {:?}, not {s:?}", d.s);
                }
            }
        }
    }
}

#[test]
fn third_direction_of_a_triangle_is_its_normal() {
    let mut random = Random(17);
    for _ in 0..20_000 {
        let a: [[f64; 2]; 3] = random.matrix();
        let normal: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            a[i][0] * a[j][1] - a[j][0] * a[i][1]
        });
        let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        let u = svd32(a).u;
        for k in 0..3 {
            assert!((u[k][2] * length - normal[k]).abs() < 1e-14, "{a:?}: {u:?}");
        }
    }
}
