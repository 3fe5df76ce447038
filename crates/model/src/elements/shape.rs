//! What differs between elements of different dimension: the decomposition of F (d x k), and how it is kept.

use proxel_linalg::simd::{F8, Isa, LANES, Real};
use proxel_linalg::svd;

/// F = U diag(s) V^T with U (d x k) of orthonormal columns and V a proper rotation.
#[derive(Clone, Copy)]
pub struct Decomposed<T, const D: usize, const K: usize> {
    /// Left vectors, as columns.
    pub u: [[T; K]; D],
    /// Stretches, descending; where d = k the last carries the sign of det F.
    pub s: [T; K],
    /// Right vectors, as columns.
    pub v: [[T; K]; K],
}

/// An element whose deformation gradient is D x K.
pub trait Shape<const D: usize, const K: usize>: Send + Sync + 'static {
    /// Numbers a lane that [`Shape::save`] writes.
    const SAVED: usize;

    /// F = U diag(s) V^T.
    fn svd<T: Real>(f: [[T; K]; D]) -> Decomposed<T, D, K>;

    /// A = Q diag(l) Q^T of a symmetric matrix, l descending.
    fn eigen<T: Real>(a: [[T; K]; K]) -> ([[T; K]; K], [T; K]);

    /// Keeps a decomposition in a block of `SAVED * 8` numbers.
    fn save<I: Isa>(d: &Decomposed<F8<I>, D, K>, to: &mut [f64]);

    /// Takes it back.
    fn load<I: Isa>(from: &[f64]) -> Decomposed<F8<I>, D, K>;
}

/// The stretches, which every block begins with.
#[inline(always)]
fn load_stretches<I: Isa, const K: usize>(from: &[f64]) -> [F8<I>; K] {
    std::array::from_fn(|i| F8::load_at(from, i))
}

/// Names the shapes.
pub struct Simplex;

#[inline(always)]
fn save_rotation<I: Isa>(q: [F8<I>; 4], to: &mut [f64], at: usize) {
    for (i, q) in q.into_iter().enumerate() {
        q.store_at(to, at + i);
    }
}

#[inline(always)]
fn load_rotation<I: Isa>(from: &[f64], at: usize) -> [[F8<I>; 3]; 3] {
    svd::rotation_from_quaternion(std::array::from_fn(|i| F8::load_at(from, at + i)))
}

/// Tetrahedra.
impl Shape<3, 3> for Simplex {
    const SAVED: usize = 11; // stretches, two unit quaternions
    #[inline(always)]
    fn svd<T: Real>(f: [[T; 3]; 3]) -> Decomposed<T, 3, 3> {
        let d = svd::svd3(f);
        Decomposed { u: d.u, s: d.s, v: d.v }
    }
    #[inline(always)]
    fn eigen<T: Real>(a: [[T; 3]; 3]) -> ([[T; 3]; 3], [T; 3]) {
        let e = svd::eig3_sym([a[0][0], a[1][1], a[2][2], a[0][1], a[0][2], a[1][2]]);
        (e.q, e.lambda)
    }
    #[inline(always)]
    fn save<I: Isa>(d: &Decomposed<F8<I>, 3, 3>, to: &mut [f64]) {
        for i in 0..3 {
            d.s[i].store_at(to, i);
        }
        save_rotation(svd::quaternion_from_rotation(d.u), to, 3);
        save_rotation(svd::quaternion_from_rotation(d.v), to, 7);
    }
    #[inline(always)]
    fn load<I: Isa>(from: &[f64]) -> Decomposed<F8<I>, 3, 3> {
        Decomposed { u: load_rotation(from, 3), s: load_stretches(from), v: load_rotation(from, 7) }
    }
}

/// Triangles in space.
impl Shape<3, 2> for Simplex {
    const SAVED: usize = 10; // stretches, six numbers of U, one column of V
    #[inline(always)]
    fn svd<T: Real>(f: [[T; 2]; 3]) -> Decomposed<T, 3, 2> {
        let d = svd::svd32(f);
        Decomposed { u: std::array::from_fn(|r| [d.u[r][0], d.u[r][1]]), s: d.s, v: d.v }
    }
    #[inline(always)]
    fn eigen<T: Real>(a: [[T; 2]; 2]) -> ([[T; 2]; 2], [T; 2]) {
        let e = svd::eig2_sym([a[0][0], a[1][1], a[0][1]]);
        (e.q, e.lambda)
    }
    #[inline(always)]
    fn save<I: Isa>(d: &Decomposed<F8<I>, 3, 2>, to: &mut [f64]) {
        for i in 0..2 {
            d.s[i].store_at(to, i);
            d.v[i][0].store_at(to, 2 + i);
            for r in 0..3 {
                d.u[r][i].store_at(to, 4 + 3 * i + r);
            }
        }
    }
    #[inline(always)]
    fn load<I: Isa>(from: &[f64]) -> Decomposed<F8<I>, 3, 2> {
        let at = |i| F8::load_at(from, i);
        let (c, s) = (at(2), at(3));
        Decomposed { u: [[at(4), at(7)], [at(5), at(8)], [at(6), at(9)]], s: load_stretches(from), v: [[c, -s], [s, c]] }
    }
}

/// Triangles in the plane.
impl Shape<2, 2> for Simplex {
    const SAVED: usize = 6; // stretches, first columns of U and V
    #[inline(always)]
    fn svd<T: Real>(f: [[T; 2]; 2]) -> Decomposed<T, 2, 2> {
        let d = svd::svd2(f);
        Decomposed { u: d.u, s: d.s, v: d.v }
    }
    #[inline(always)]
    fn eigen<T: Real>(a: [[T; 2]; 2]) -> ([[T; 2]; 2], [T; 2]) {
        let e = svd::eig2_sym([a[0][0], a[1][1], a[0][1]]);
        (e.q, e.lambda)
    }
    #[inline(always)]
    fn save<I: Isa>(d: &Decomposed<F8<I>, 2, 2>, to: &mut [f64]) {
        for i in 0..2 {
            d.s[i].store_at(to, i);
            d.u[i][0].store_at(to, 2 + i);
            d.v[i][0].store_at(to, 4 + i);
        }
    }
    #[inline(always)]
    fn load<I: Isa>(from: &[f64]) -> Decomposed<F8<I>, 2, 2> {
        let rotation = |at| {
            let (c, s) = (F8::load_at(from, at), F8::load_at(from, at + 1));
            [[c, -s], [s, c]]
        };
        Decomposed { u: rotation(2), s: load_stretches(from), v: rotation(4) }
    }
}

/// Springs: F is a column, its one stretch a length.
macro_rules! spring {
    ($d:literal, $svd:ident) => {
        impl Shape<$d, 1> for Simplex {
            const SAVED: usize = 1 + $d;
            #[inline(always)]
            fn svd<T: Real>(f: [[T; 1]; $d]) -> Decomposed<T, $d, 1> {
                let d = svd::$svd(f);
                Decomposed { u: std::array::from_fn(|r| [d.u[r][0]]), s: d.s, v: d.v }
            }
            #[inline(always)]
            fn eigen<T: Real>(a: [[T; 1]; 1]) -> ([[T; 1]; 1], [T; 1]) {
                ([[T::one()]], [a[0][0]])
            }
            #[inline(always)]
            fn save<I: Isa>(d: &Decomposed<F8<I>, $d, 1>, to: &mut [f64]) {
                d.s[0].store_at(to, 0);
                for r in 0..$d {
                    d.u[r][0].store_at(to, 1 + r);
                }
            }
            #[inline(always)]
            fn load<I: Isa>(from: &[f64]) -> Decomposed<F8<I>, $d, 1> {
                Decomposed { u: std::array::from_fn(|r| [F8::load_at(from, 1 + r)]), s: [F8::load_at(from, 0)], v: [[F8::one()]] }
            }
        }
    };
}
spring!(3, svd31);
spring!(2, svd21);

/// Rows of blocks: component c of block b of a flat vector with `comps` components.
#[inline(always)]
pub(super) fn block(from: &[f64], b: usize, comps: usize) -> &[f64] {
    &from[b * comps * LANES..(b + 1) * comps * LANES]
}

/// The same, to write.
#[inline(always)]
pub(super) fn block_mut(from: &mut [f64], b: usize, comps: usize) -> &mut [f64] {
    &mut from[b * comps * LANES..(b + 1) * comps * LANES]
}
