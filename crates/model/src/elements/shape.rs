//! What differs between elements of different dimension: the decomposition of F (d x k).

use proxel_linalg::simd::{LANES, Real};
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
    /// F = U diag(s) V^T.
    fn svd<T: Real>(f: [[T; K]; D]) -> Decomposed<T, D, K>;

    /// A = Q diag(l) Q^T of a symmetric matrix, l descending: (Q, l).
    fn eigen<T: Real>(a: [[T; K]; K]) -> ([[T; K]; K], [T; K]);
}

/// Names the shapes.
pub struct Simplex;

/// Tetrahedra.
impl Shape<3, 3> for Simplex {
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
}

/// Triangles in space.
impl Shape<3, 2> for Simplex {
    #[inline(always)]
    fn svd<T: Real>(f: [[T; 2]; 3]) -> Decomposed<T, 3, 2> {
        let d = svd::svd32(f);
        let u = [[d.u[0][0], d.u[0][1]], [d.u[1][0], d.u[1][1]], [d.u[2][0], d.u[2][1]]];
        Decomposed { u, s: d.s, v: d.v }
    }
    #[inline(always)]
    fn eigen<T: Real>(a: [[T; 2]; 2]) -> ([[T; 2]; 2], [T; 2]) {
        let e = svd::eig2_sym([a[0][0], a[1][1], a[0][1]]);
        (e.q, e.lambda)
    }
}

/// Triangles in the plane.
impl Shape<2, 2> for Simplex {
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
}

/// Springs: F is a column, its one stretch a length.
macro_rules! spring {
    ($d:literal, $svd:ident) => {
        impl Shape<$d, 1> for Simplex {
            #[inline(always)]
            fn svd<T: Real>(f: [[T; 1]; $d]) -> Decomposed<T, $d, 1> {
                let d = svd::$svd(f);
                let mut u = [[T::zero()]; $d];
                for r in 0..$d {
                    u[r][0] = d.u[r][0];
                }
                Decomposed { u, s: d.s, v: d.v }
            }
            #[inline(always)]
            fn eigen<T: Real>(a: [[T; 1]; 1]) -> ([[T; 1]; 1], [T; 1]) {
                ([[T::one()]], [a[0][0]])
            }
        }
    };
}
spring!(3, svd31);
spring!(2, svd21);

/// Block b of a flat vector with `comps` components.
#[inline(always)]
pub(super) fn block(from: &[f64], b: usize, comps: usize) -> &[f64] {
    &from[b * comps * LANES..(b + 1) * comps * LANES]
}

/// The same, to write.
#[inline(always)]
pub(super) fn block_mut(from: &mut [f64], b: usize, comps: usize) -> &mut [f64] {
    &mut from[b * comps * LANES..(b + 1) * comps * LANES]
}
