//! Nanoseconds per matrix of the small decompositions: the mean time of a sample over 98,304 items.
//!
//! `lanes` decomposes matrices from memory into a buffer that stays in the first-level cache, as a kernel does that
//! uses the factors at once; `batch` writes all factors to memory, and is bound by it.
#![allow(missing_docs)] // divan's macros make public items

use divan::{Bencher, counter::ItemsCount};
use nalgebra::Matrix3;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Level, Real, dispatch_at};
use proxel_linalg::svd::{
    Par, Svd, eig2_sym, eig3_sym, max_eigenvalue3, svd2, svd3, svd3_batch, svd3_quat, svd21, svd31, svd32,
};

const COUNT: usize = 98_304;

fn main() {
    divan::main();
}

#[derive(Clone, Copy, Debug)]
enum Class {
    Random,
    NearIdentity,
}
const CLASSES: [Class; 2] = [Class::Random, Class::NearIdentity];

/// Matrices of N components, in blocks of eight lanes.
fn blocks<const N: usize>(class: Class) -> Vec<[[f64; LANES]; N]> {
    let mut seed = 1u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let columns = if N.is_multiple_of(3) { 3 } else { 2 };
    (0..COUNT / LANES)
        .map(|_| {
            std::array::from_fn(|k| {
                std::array::from_fn(|_| match class {
                    Class::Random => random(),
                    Class::NearIdentity => f64::from(u8::from(k / columns == k % columns)) + 0.01 * random(),
                })
            })
        })
        .collect()
}

/// A lane function of N components to M components.
trait Function<const N: usize, const M: usize> {
    fn of<T: Real>(a: [T; N], out: &mut [T; M]);
}

struct Lanes<'a, F, const N: usize, const M: usize>(&'a [[[f64; LANES]; N]], std::marker::PhantomData<F>);

impl<F: Function<N, M>, const N: usize, const M: usize> Kernel for Lanes<'_, F, N, M> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let mut ring = [[F8::<I>::zero(); M]; 4];
        for (b, a) in self.0.iter().enumerate() {
            // Loops, not closures: those would be compiled without the instruction set.
            let mut lanes = [F8::zero(); N];
            for k in 0..N {
                lanes[k] = F8::load(&a[k]);
            }
            F::of(lanes, &mut ring[b % 4]);
            divan::black_box(&mut ring);
        }
    }
}

struct Scalars<'a, F, const N: usize, const M: usize>(&'a [[[f64; LANES]; N]], std::marker::PhantomData<F>);

impl<F: Function<N, M>, const N: usize, const M: usize> Scalars<'_, F, N, M> {
    fn run(self) {
        for a in self.0 {
            for l in 0..LANES {
                let mut out = [0.0; M];
                F::of::<f64>(std::array::from_fn(|k| a[k][l]), &mut out);
                divan::black_box(&mut out);
            }
        }
    }
}

fn at<F: Function<N, M>, const N: usize, const M: usize>(bencher: Bencher<'_, '_>, level: Level, class: Class) {
    let data = blocks::<N>(class);
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| dispatch_at(level, Lanes::<F, N, M>(&data, std::marker::PhantomData)));
}

macro_rules! function {
    ($module:ident $name:ident $n:literal $m:literal |$a:ident, $out:ident| $body:expr) => {
        struct $name;
        impl Function<$n, $m> for $name {
            #[inline(always)]
            fn of<T: Real>($a: [T; $n], $out: &mut [T; $m]) {
                $body
            }
        }
        mod $module {
            use super::*;
            #[divan::bench(args = CLASSES)]
            fn avx512(bencher: Bencher<'_, '_>, class: Class) {
                at::<$name, $n, $m>(bencher, Level::Avx512, class);
            }
            #[divan::bench(args = CLASSES)]
            fn avx2(bencher: Bencher<'_, '_>, class: Class) {
                at::<$name, $n, $m>(bencher, Level::Avx2, class);
            }
            #[divan::bench(args = CLASSES)]
            fn baseline(bencher: Bencher<'_, '_>, class: Class) {
                at::<$name, $n, $m>(bencher, Level::Baseline, class);
            }
            #[divan::bench]
            fn scalar(bencher: Bencher<'_, '_>) {
                let data = blocks::<$n>(Class::Random);
                bencher
                    .counter(ItemsCount::new(COUNT))
                    .bench_local(|| Scalars::<$name, $n, $m>(&data, std::marker::PhantomData).run());
            }
        }
    };
}

/// Rows of C entries.
#[inline(always)]
fn rows<T: Real, const N: usize, const R: usize, const C: usize>(a: [T; N]) -> [[T; C]; R] {
    let mut m = [[T::zero(); C]; R];
    for r in 0..R {
        for c in 0..C {
            m[r][c] = a[C * r + c];
        }
    }
    m
}

/// All factors after each other.
#[inline(always)]
fn put<T: Real, const R: usize, const C: usize>(d: &Svd<T, R, C>, out: &mut [T]) {
    put_rows(&d.u, &mut out[..R * R]);
    put_rows(&[d.s], &mut out[R * R..R * R + C]);
    put_rows(&d.v, &mut out[R * R + C..]);
}

#[inline(always)]
fn put_rows<T: Real, const R: usize, const C: usize>(m: &[[T; C]; R], out: &mut [T]) {
    for r in 0..R {
        for c in 0..C {
            out[C * r + c] = m[r][c];
        }
    }
}

function!(lanes_svd3 Svd3 9 21 |a, out| put(&svd3(rows::<T, 9, 3, 3>(a)), out));
function!(lanes_svd3_quat Svd3Quat 9 11 |a, out| {
    let (u, s, v) = svd3_quat(rows::<T, 9, 3, 3>(a));
    *out = [u[0], u[1], u[2], u[3], s[0], s[1], s[2], v[0], v[1], v[2], v[3]];
});
function!(lanes_svd32 Svd32 6 15 |a, out| put(&svd32(rows::<T, 6, 3, 2>(a)), out));
function!(lanes_svd2 Svd2 4 10 |a, out| put(&svd2(rows::<T, 4, 2, 2>(a)), out));
function!(lanes_svd31 Svd31 3 11 |a, out| put(&svd31(rows::<T, 3, 3, 1>(a)), out));
function!(lanes_svd21 Svd21 2 6 |a, out| put(&svd21(rows::<T, 2, 2, 1>(a)), out));
function!(lanes_eig3 Eig3 6 12 |a, out| {
    let d = eig3_sym(a);
    put_rows(&d.q, &mut out[..9]);
    put_rows(&[d.lambda], &mut out[9..]);
});
function!(lanes_eig2 Eig2 3 6 |a, out| {
    let d = eig2_sym(a);
    put_rows(&d.q, &mut out[..4]);
    put_rows(&[d.lambda], &mut out[4..]);
});
function!(lanes_max_eigenvalue3 Max3 6 1 |a, out| out[0] = max_eigenvalue3(a));

#[divan::bench(args = CLASSES)]
fn batch_svd3(bencher: Bencher<'_, '_>, class: Class) {
    let a: Vec<f64> = blocks::<9>(class).into_iter().flatten().flatten().collect();
    let (mut u, mut s, mut v) = (vec![0.0; 9 * COUNT], vec![0.0; 3 * COUNT], vec![0.0; 9 * COUNT]);
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| svd3_batch(Par::Seq, &a, &mut u, &mut s, &mut v).expect("sizes fit"));
}

#[divan::bench(args = CLASSES)]
fn nalgebra_svd3(bencher: Bencher<'_, '_>, class: Class) {
    let matrices: Vec<Matrix3<f64>> = blocks::<9>(class)
        .iter()
        .flat_map(|b| (0..LANES).map(|l| Matrix3::from_fn(|r, c| b[3 * r + c][l])).collect::<Vec<_>>())
        .collect();
    bencher.counter(ItemsCount::new(COUNT)).bench_local(|| {
        for m in &matrices {
            divan::black_box(m.svd(true, true));
        }
    });
}

#[divan::bench(args = CLASSES)]
fn nalgebra_symmetric_eigen3(bencher: Bencher<'_, '_>, class: Class) {
    let matrices: Vec<Matrix3<f64>> = blocks::<6>(class)
        .iter()
        .flat_map(|b| {
            (0..LANES)
                .map(|l| {
                    let [xx, yy, zz, xy, xz, yz] = b.map(|k| k[l]);
                    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
                })
                .collect::<Vec<_>>()
        })
        .collect();
    bencher.counter(ItemsCount::new(COUNT)).bench_local(|| {
        for m in &matrices {
            divan::black_box(m.symmetric_eigen());
        }
    });
}
