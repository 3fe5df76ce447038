//! The geometry of second derivatives, compiled for each instruction set.

use super::kernels::{KEPT, add_forces, deformation_gradient, inverse_edges};
use super::matrix::times_frame;
use super::pairs::corner_pairs;
use super::passes::{Chunk, GROUP, Shared};
use super::shape::{Decomposed, Shape, Simplex, block, block_mut};
use super::stretch_hessian::{MOST_CURVATURES, curvatures, place_of_entry, place_of_normal, place_of_pair};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real};
use std::ops::Range;

/// Scratch of a group, beside decompositions.
pub(super) struct Second {
    pub stretches: [f64; GROUP * LANES * 3],
    pub at: [f64; GROUP * LANES * KEPT],
    pub curvature: [f64; GROUP * LANES * MOST_CURVATURES],
}

impl Second {
    pub fn new() -> Self {
        Second {
            stretches: [0.0; GROUP * LANES * 3],
            at: [0.0; GROUP * LANES * KEPT],
            curvature: [0.0; GROUP * LANES * MOST_CURVATURES],
        }
    }
}

/// Decompositions of the F of a group.
pub(super) struct Decompose<'a, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub scratch: &'a mut Second,
}

impl<const D: usize, const K: usize> Kernel for Decompose<'_, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (place, b) in self.group.enumerate() {
            let inverse = inverse_edges::<I, D, K>(self.shared, self.chunk, b);
            let f = deformation_gradient::<I, D, K>(self.chunk.near(), self.chunk.local(b), &inverse);
            let d = <Simplex as Shape<D, K>>::svd(f);
            for i in 0..K {
                d.s[i].store_at(&mut self.scratch.stretches, place * K + i);
            }
            d.keep(block_mut(&mut self.scratch.at, place, KEPT));
        }
    }
}

/// The curvature of an element, as [`super::stretch_hessian`] lays it out, in a form that is ready for products.
struct Modes<I: Isa, const K: usize> {
    entries: [[F8<I>; K]; K], // of h_ii and h_jj
    same: [[F8<I>; K]; K],    // of h_ij and h_ij
    other: [[F8<I>; K]; K],   // of h_ij and h_ji
    normal: [F8<I>; K],       // of h_ni and h_ni
}

impl<I: Isa, const K: usize> Modes<I, K> {
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        let zero = F8::<I>::zero();
        let mut m = Modes { entries: [[zero; K]; K], same: [[zero; K]; K], other: [[zero; K]; K], normal: [zero; K] };
        for i in 0..K {
            m.normal[i] = F8::load_at(from, place_of_normal(K, i));
            for j in i..K {
                m.entries[i][j] = F8::load_at(from, place_of_entry(K, i, j));
                m.entries[j][i] = m.entries[i][j];
            }
            for j in i + 1..K {
                let (at, pairs) = (place_of_pair(K, i, j), K * (K - 1) / 2);
                m.same[i][j] = F8::load_at(from, at);
                m.same[j][i] = F8::load_at(from, at + pairs);
                m.other[i][j] = F8::load_at(from, at + 2 * pairs);
                m.other[j][i] = m.other[i][j];
            }
        }
        m
    }
}

/// Adds the blocks V d^2 psi / dx_a dx_b of a group to the partial sums of its chunk.
pub(super) struct AddBlocks<'a, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub table: &'a [u16], // of the chunk
    pub partials: &'a mut [f64],
    pub scratch: &'a Second,
}

impl<const D: usize, const K: usize> Kernel for AddBlocks<'_, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let zero = F8::<I>::zero();
        for (place, b) in self.group.enumerate() {
            let d = Decomposed::<F8<I>, D, K>::kept(block(&self.scratch.at, place, KEPT));
            let modes = Modes::<I, K>::load(block(&self.scratch.curvature, place, curvatures(K)));
            let inverse = inverse_edges::<I, D, K>(self.shared, self.chunk, b);
            let measure = F8::<I>::load_at(self.shared.measure, self.chunk.global(b));
            // Rows g_k V: dF = sum_k dx_k g_k^T has h = sum_k (U^T dx_k) (g_k V).
            let mut g = [[zero; K]; K];
            for k in 0..K {
                for j in 0..K {
                    let mut sum = zero;
                    for c in 0..K {
                        sum = inverse[k][c].mul_add(d.v[c][j], sum);
                    }
                    g[k][j] = sum;
                }
            }
            let table = &self.table[b * corner_pairs(K + 1) * LANES..];
            let mut first = [[[zero; D]; D]; K]; // blocks of corner k + 1 with corner 0
            let mut origin = [[zero; D]; D];
            for p in 0..K {
                for q in 0..=p {
                    let dense = corner_block::<I, D, K>(&d, &modes, &g[p], &g[q], measure);
                    scatter::<I, D>(&dense, table, pair_place(p + 1, q + 1), self.partials);
                    for r in 0..D {
                        for c in 0..D {
                            // Rows and columns sum to 0: moving all corners changes nothing.
                            first[p][r][c] -= dense[r][c];
                            origin[r][c] += dense[r][c];
                            if p != q {
                                first[q][r][c] -= dense[c][r];
                                origin[r][c] += dense[c][r];
                            }
                        }
                    }
                }
            }
            for p in 0..K {
                scatter::<I, D>(&first[p], table, pair_place(p + 1, 0), self.partials);
            }
            scatter::<I, D>(&origin, table, 0, self.partials);
        }
    }
}

const fn pair_place(a: usize, b: usize) -> usize {
    a * (a + 1) / 2 + b
}

/// V d^2 psi / dx_p dx_q of corners whose gradients in the frame of V are `gp` and `gq`.
#[inline(always)]
fn corner_block<I: Isa, const D: usize, const K: usize>(
    d: &Decomposed<F8<I>, D, K>,
    modes: &Modes<I, K>,
    gp: &[F8<I>; K],
    gq: &[F8<I>; K],
    measure: F8<I>,
) -> [[F8<I>; D]; D] {
    let zero = F8::<I>::zero();
    let mut m = [[zero; K]; K]; // in the frame of U
    let mut normal = zero;
    for i in 0..K {
        for k in 0..K {
            let mut sum = modes.entries[i][k] * gp[i] * gq[k];
            if i == k {
                for j in 0..K {
                    sum = (modes.same[i][j] * gp[j]).mul_add(gq[j], sum);
                }
            } else {
                sum = (modes.other[i][k] * gp[k]).mul_add(gq[i], sum);
            }
            m[i][k] = sum * measure;
        }
        normal = (modes.normal[i] * gp[i]).mul_add(gq[i], normal);
    }
    let normal = normal * measure;
    if D > K {
        // normal (1 - U U^T) + U m U^T
        for i in 0..K {
            m[i][i] -= normal;
        }
    }
    let mut um = [[zero; K]; D];
    for r in 0..D {
        for k in 0..K {
            let mut sum = zero;
            for i in 0..K {
                sum = d.u[r][i].mul_add(m[i][k], sum);
            }
            um[r][k] = sum;
        }
    }
    let mut out = [[zero; D]; D];
    for r in 0..D {
        for c in 0..D {
            let mut sum = if D > K && r == c { normal } else { zero };
            for k in 0..K {
                sum = um[r][k].mul_add(d.u[c][k], sum);
            }
            out[r][c] = sum;
        }
    }
    out
}

/// Adds a block of each lane to its partial sum.
#[inline(always)]
fn scatter<I: Isa, const D: usize>(dense: &[[F8<I>; D]; D], table: &[u16], pair: usize, partials: &mut [f64]) {
    let mut lanes = [[[0.0; LANES]; D]; D];
    for r in 0..D {
        for c in 0..D {
            dense[r][c].store(&mut lanes[r][c]);
        }
    }
    for l in 0..LANES {
        let entry = table[pair * LANES + l] as usize;
        let to = &mut partials[entry / 2 * D * D..][..D * D];
        if entry.is_multiple_of(2) {
            for r in 0..D {
                for c in 0..D {
                    to[r * D + c] += lanes[r][c][l];
                }
            }
        } else {
            for r in 0..D {
                for c in 0..D {
                    to[c * D + r] += lanes[r][c][l];
                }
            }
        }
    }
}

/// A D x K matrix of lanes.
type Matrix<I, const D: usize, const K: usize> = [[F8<I>; K]; D];

/// dF of a step, in the frame of F = U S V^T: h = U^T dF V, and dF V.
#[inline(always)]
fn step_in_frame<I: Isa, const D: usize, const K: usize>(
    d: &Decomposed<F8<I>, D, K>,
    step: &[[F8<I>; K]; D],
) -> (Matrix<I, K, K>, Matrix<I, D, K>) {
    let zero = F8::<I>::zero();
    let mut fv = [[zero; K]; D];
    for r in 0..D {
        for k in 0..K {
            let mut sum = zero;
            for c in 0..K {
                sum = step[r][c].mul_add(d.v[c][k], sum);
            }
            fv[r][k] = sum;
        }
    }
    let mut h = [[zero; K]; K];
    for i in 0..K {
        for k in 0..K {
            let mut sum = zero;
            for r in 0..D {
                sum = d.u[r][i].mul_add(fv[r][k], sum);
            }
            h[i][k] = sum;
        }
    }
    (h, fv)
}

/// Adds the gradient of 1/2 w^2 |F - T|^2, T the target of [`proxel_split::Curvature::add_warped_gradient`].
pub(super) struct AddWarped<'a, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub step: &'a [f64], // chunk-local
    pub partials: &'a mut [f64],
    pub scratch: &'a Second,
}

/// Sums of two stretches below this part of the largest turn nothing: rotations about such axes are not defined.
const TURNABLE: f64 = 1e-3;

impl<const D: usize, const K: usize> Kernel for AddWarped<'_, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (place, b) in self.group.enumerate() {
            let d = Decomposed::<F8<I>, D, K>::kept(block(&self.scratch.at, place, KEPT));
            let inverse = inverse_edges::<I, D, K>(self.shared, self.chunk, b);
            let df = deformation_gradient(self.step, self.chunk.local(b), &inverse);
            let target = warped(&d, &df);
            let f = deformation_gradient::<I, D, K>(self.chunk.near(), self.chunk.local(b), &inverse);
            let mut gap = f;
            for r in 0..D {
                for c in 0..K {
                    gap[r][c] = f[r][c] - target[r][c];
                }
            }
            let weight2 = F8::load_at(self.shared.weight2, self.chunk.global(b));
            add_forces(&gap, weight2, &inverse, self.chunk.local(b), self.partials);
        }
    }
}

/// U exp(omega) (S + h - omega S) V^T; out of the plane of an element of lower dimension, omega turns its normal.
#[inline(always)]
fn warped<I: Isa, const D: usize, const K: usize>(
    d: &Decomposed<F8<I>, D, K>,
    step: &[[F8<I>; K]; D],
) -> [[F8<I>; K]; D] {
    let zero = F8::<I>::zero();
    let (h, fv) = step_in_frame(d, step);
    let floor = d.s[0] * TURNABLE;
    let mut omega = [[zero; K]; K];
    let mut inner = h; // S + h - omega S
    for i in 0..K {
        inner[i][i] += d.s[i];
        for j in 0..K {
            if i != j {
                let sum = d.s[i] + d.s[j];
                omega[i][j] = F8::select(sum.gt(floor), (h[i][j] - h[j][i]) / sum, zero);
                inner[i][j] -= omega[i][j] * d.s[j];
            }
        }
    }
    let mut planar = times_frame(&d.u, &inner, &d.v);
    let mut spin = [[zero; D]; D]; // omega in space
    for i in 0..K {
        for j in 0..K {
            if i != j {
                for r in 0..D {
                    for c in 0..D {
                        spin[r][c] = (d.u[r][i] * omega[i][j]).mul_add(d.u[c][j], spin[r][c]);
                    }
                }
            }
        }
    }
    if D > K {
        for k in 0..K {
            let turns = d.s[k].gt(floor);
            let mut out = [zero; D]; // (1 - U U^T) dF v_k / s_k: where u_k goes out of the plane
            for r in 0..D {
                out[r] = fv[r][k];
                for i in 0..K {
                    out[r] -= d.u[r][i] * h[i][k];
                }
                out[r] = F8::select(turns, out[r] / d.s[k], zero);
            }
            for r in 0..D {
                for c in 0..D {
                    spin[r][c] += out[r] * d.u[c][k] - d.u[r][k] * out[c];
                }
            }
        }
    }
    rotate(&spin, &mut planar);
    planar
}

/// A <- exp(W) A of an antisymmetric W of angle a, up to a^5 and never by more than half a turn: Cayley's map
/// 1 + 2 t / (1 + t^2 a^2) (W + t W^2) turns by 2 atan(t a), which for t = 1/2 + a^2/24 is a + O(a^5).
#[inline(always)]
fn rotate<I: Isa, const D: usize, const K: usize>(spin: &[[F8<I>; D]; D], a: &mut [[F8<I>; K]; D]) {
    let zero = F8::<I>::zero();
    let mut square = zero; // a^2 = |W|^2 / 2
    for r in 0..D {
        for c in 0..D {
            square = (spin[r][c] * 0.5).mul_add(spin[r][c], square);
        }
    }
    let t = square.mul_add(F8::splat(1.0 / 24.0), F8::splat(0.5));
    let scale = t * 2.0 / (t * t).mul_add(square, F8::one());
    for k in 0..K {
        let mut once = [zero; D];
        for r in 0..D {
            for c in 0..D {
                once[r] = spin[r][c].mul_add(a[c][k], once[r]);
            }
        }
        for r in 0..D {
            let mut twice = zero;
            for c in 0..D {
                twice = spin[r][c].mul_add(once[c], twice);
            }
            a[r][k] = scale.mul_add(t.mul_add(twice, once[r]), a[r][k]);
        }
    }
}
