//! The geometry of a pass, compiled for each instruction set: gathering, decompositions, forces. No energy appears here.

use super::coupling::{Coupling, load_rows, store_rows};
use super::matrix::compose;
use super::passes::{Chunk, GROUP, Shared};
use super::shape::{Decomposed, Shape, Simplex, block, block_mut};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real};
use proxel_split::{EnergyReport, LocalReport, Order, PenaltyReport, Residual};
use std::marker::PhantomData;
use std::ops::Range;

/// Room for one kept decomposition an element, whatever its shape.
pub(super) const KEPT: usize = 21;

/// Scratch of a group.
pub(super) struct Scratch {
    pub stretches: [f64; GROUP * LANES * 3],
    signs: [f64; GROUP * LANES * 3],
    pub at: [f64; GROUP * LANES * KEPT],    // what is known of F
    pub frame: [f64; GROUP * LANES * KEPT], // of v = c(Dx) + u
    inverse: [f64; GROUP * LANES * 9],      // inverse rest edges
}

impl Scratch {
    pub fn new() -> Self {
        Scratch {
            stretches: [0.0; GROUP * LANES * 3],
            signs: [1.0; GROUP * LANES * 3],
            at: [0.0; GROUP * LANES * KEPT],
            frame: [0.0; GROUP * LANES * KEPT],
            inverse: [0.0; GROUP * LANES * 9],
        }
    }
}

/// The positions of a corner of a block.
#[inline(always)]
pub(super) fn corner<I: Isa, const D: usize>(near: &[f64], local: &[u16], k: usize) -> [F8<I>; D] {
    let index = &local[k * LANES..(k + 1) * LANES];
    let mut lanes = [[0.0; LANES]; D];
    for l in 0..LANES {
        let from = &near[index[l] as usize * D..][..D];
        for d in 0..D {
            lanes[d][l] = from[d];
        }
    }
    let mut out = [F8::zero(); D];
    for d in 0..D {
        out[d] = F8::of(lanes[d]);
    }
    out
}

/// a x b of vectors of space.
#[inline(always)]
fn cross<I: Isa, const D: usize>(a: &[F8<I>; D], b: &[F8<I>; D]) -> [F8<I>; 3] {
    [a[1].mul_add(b[2], -(a[2] * b[1])), a[2].mul_add(b[0], -(a[0] * b[2])), a[0].mul_add(b[1], -(a[1] * b[0]))]
}

/// The rows g_k of the inverse rest edges of block b of a chunk. Those of tetrahedra are worked out from the rest
/// positions, since their nine numbers cost more to read than to compute; others are kept.
#[inline(always)]
pub(super) fn inverse_edges<I: Isa, const D: usize, const K: usize>(
    shared: &Shared<'_, K>,
    chunk: &Chunk<'_>,
    b: usize,
) -> [[F8<I>; K]; K] {
    let mut rows = [[F8::zero(); K]; K];
    if K == 3 && D == 3 {
        let (rest, local) = (chunk.rest(shared.rest, D), chunk.local(b));
        let origin = corner::<I, D>(rest, local, 0);
        let mut edges = [[F8::<I>::zero(); D]; K];
        for k in 0..K {
            let at = corner::<I, D>(rest, local, k + 1);
            for d in 0..D {
                edges[k][d] = at[d] - origin[d];
            }
        }
        let normals = [cross(&edges[1], &edges[2]), cross(&edges[2], &edges[0]), cross(&edges[0], &edges[1])];
        let volume =
            edges[0][0].mul_add(normals[0][0], edges[0][1].mul_add(normals[0][1], edges[0][2] * normals[0][2]));
        let scale = volume.recip();
        for k in 0..K {
            for c in 0..K {
                rows[k][c] = normals[k][c] * scale;
            }
        }
        return rows;
    }
    let kept = block(shared.inverse, chunk.global(b), K * K);
    for k in 0..K {
        for c in 0..K {
            rows[k][c] = F8::load_at(kept, k * K + c);
        }
    }
    rows
}

/// F = sum_k (x_k - x_0) g_k^T with g_k the rows of the inverse rest edges.
#[inline(always)]
pub(super) fn deformation_gradient<I: Isa, const D: usize, const K: usize>(
    near: &[f64],
    local: &[u16],
    inverse: &[[F8<I>; K]; K],
) -> [[F8<I>; K]; D] {
    let origin = corner::<I, D>(near, local, 0);
    let mut f = [[F8::zero(); K]; D];
    for k in 0..K {
        let at = corner::<I, D>(near, local, k + 1);
        for d in 0..D {
            let edge = at[d] - origin[d];
            for c in 0..K {
                f[d][c] = edge.mul_add(inverse[k][c], f[d][c]);
            }
        }
    }
    f
}

/// Adds scale P g_k^T to the partial sum of corner k of each lane, and the opposite of their sum to corner 0.
#[inline(always)]
pub(super) fn add_forces<I: Isa, const D: usize, const K: usize>(
    p: &[[F8<I>; K]; D],
    scale: F8<I>,
    inverse: &[[F8<I>; K]; K],
    local: &[u16],
    partials: &mut [f64],
) {
    let mut origin = [F8::<I>::zero(); D];
    for k in 0..=K {
        let corner = (k + 1) % (K + 1); // corner 0 last
        let mut force = [[0.0; LANES]; D];
        for d in 0..D {
            let f = if corner == 0 {
                origin[d]
            } else {
                let mut f = p[d][0] * inverse[k][0];
                for c in 1..K {
                    f = p[d][c].mul_add(inverse[k][c], f);
                }
                let f = f * scale;
                origin[d] -= f;
                f
            };
            f.store(&mut force[d]);
        }
        let index = &local[corner * LANES..(corner + 1) * LANES];
        for l in 0..LANES {
            let to = &mut partials[index[l] as usize * D..][..D];
            for d in 0..D {
                to[d] += force[d][l];
            }
        }
    }
}

/// What is known of F where an element is visited, and its inverse rest edges.
type Visited<I, C, const D: usize, const K: usize> = (<C as Coupling<D, K>>::At<F8<I>>, [[F8<I>; K]; K]);

/// What is known of F at block b of a chunk, and the inverse rest edges.
#[inline(always)]
pub(super) fn visit<I: Isa, C: Coupling<D, K>, const D: usize, const K: usize>(
    shared: &Shared<'_, K>,
    chunk: &Chunk<'_>,
    b: usize,
) -> Visited<I, C, D, K> {
    let inverse = inverse_edges::<I, D, K>(shared, chunk, b);
    (C::visit(deformation_gradient(chunk.near(), chunk.local(b), &inverse)), inverse)
}

/// out <- c(Dx) over the blocks of a group.
pub(super) struct Couple<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub out: &'a mut [f64],
    pub coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for Couple<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for b in self.group {
            let (at, _) = visit::<I, C, D, K>(self.shared, self.chunk, b);
            C::store(&C::couple(&at), block_mut(self.out, b, C::LOCAL));
        }
    }
}

/// The first half of the local step: v = c(Dx) + u, left in u; z before the step, left in p; the stretches and frames of v.
pub(super) struct LocalIn<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
    pub scratch: &'a mut Scratch,
    pub coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for LocalIn<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = LocalReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> LocalReport {
        let s = self.shared;
        let (mut penalty, mut gap) = (F8::<I>::zero(), F8::<I>::zero());
        let relaxation = s.cycle.relaxation;
        for (place, b) in self.group.enumerate() {
            let (at, inverse) = visit::<I, C, D, K>(s, self.chunk, b);
            C::keep(&at, block_mut(&mut self.scratch.at, place, KEPT));
            store_rows(&inverse, block_mut(&mut self.scratch.inverse, place, 9), 0);
            let (p_at, u_at) = (block_mut(self.p, b, C::LOCAL), block_mut(self.u, b, C::LOCAL));
            let (p, u) = (C::load::<I>(p_at), C::load::<I>(u_at));
            let c = C::couple(&at);
            let z = C::add(&p, &u);
            let apart = C::subtract(&c, &z);
            let v = C::add(&c, &u);
            // alpha c + (1 - alpha) z + u, which is v where alpha is 1: nothing is computed then that could round.
            let v = if relaxation == 1.0 { v } else { C::add(&v, &C::times(&apart, relaxation - 1.0)) };
            C::store(&v, u_at);
            C::store(&z, p_at);
            let weight2 = F8::load_at(s.weight2, self.chunk.global(b));
            // c + u - z = c - p
            penalty = C::norm2(&C::subtract(&c, &p)).mul_add(weight2 * 0.5, penalty);
            gap = C::norm2(&apart).mul_add(weight2, gap);
            let mut frame: Decomposed<F8<I>, D, K> = C::frame(&v);
            if s.singular_values {
                let signs = singular_signs(&frame.s);
                for i in 0..K {
                    frame.s[i] = frame.s[i] * signs[i];
                    signs[i].store_at(&mut self.scratch.signs, place * K + i);
                }
            }
            for i in 0..K {
                frame.s[i].store_at(&mut self.scratch.stretches, place * K + i);
            }
            frame.keep(block_mut(&mut self.scratch.frame, place, KEPT));
        }
        LocalReport { penalty_before: penalty.sum(), gap2_before: gap.sum(), ..Default::default() }
    }
}

/// The signs that turn eigenvalues of a symmetric matrix into its signed singular values: all positive but the smallest,
/// which carries the sign of the determinant.
#[inline(always)]
fn singular_signs<T: Real, const K: usize>(l: &[T; K]) -> [T; K] {
    let one = T::one();
    let (mut determinant, mut least) = (one, l[0].abs());
    for i in 0..K {
        determinant = determinant * one.copysign(l[i]);
        least = least.min(l[i].abs());
    }
    let mut open = one; // 1 until the smallest has been met
    let mut signs = [one; K];
    for i in 0..K {
        let smallest = l[i].abs().le(least) & T::zero().lt(open);
        signs[i] = one.copysign(l[i]) * T::select(smallest, determinant, one);
        open = T::select(smallest, T::zero(), open);
    }
    signs
}

/// The second half of the local step: z from its stretches and the frames of v, u = v - z, p = z - u, and the gradient of
/// the penalty.
pub(super) struct LocalOut<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub p: &'a mut [f64], // z before the step comes in
    pub u: &'a mut [f64], // v comes in
    pub partials: &'a mut [f64],
    pub scratch: &'a Scratch,
    pub coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for LocalOut<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = LocalReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> LocalReport {
        let s = self.shared;
        let zero = F8::<I>::zero();
        let (mut penalty, mut objective, mut moved2, mut gap) = (zero, zero, zero, zero);
        let dual_follows = s.cycle.order == Order::Zxu;
        for (place, b) in self.group.enumerate() {
            let global = self.chunk.global(b);
            let weight2 = F8::<I>::load_at(s.weight2, global);
            let mut frame = Decomposed::<F8<I>, D, K>::kept(block(&self.scratch.frame, place, KEPT));
            for i in 0..K {
                frame.s[i] = F8::load_at(&self.scratch.stretches, place * K + i);
                frame.s[i] = frame.s[i] * F8::load_at(&self.scratch.signs, place * K + i);
            }
            let z = C::in_frame(&frame);
            let (p_at, u_at) = (block_mut(self.p, b, C::LOCAL), block_mut(self.u, b, C::LOCAL));
            let at = C::kept::<I>(block(&self.scratch.at, place, KEPT));
            let (c, v) = (C::couple(&at), C::load::<I>(u_at));
            let left = C::subtract(&v, &z);
            let u = if dual_follows { C::subtract(&v, &c) } else { left };
            let p = C::subtract(&z, &u);
            moved2 = C::norm2(&C::subtract(&z, &C::load::<I>(p_at))).mul_add(weight2, moved2);
            gap = C::norm2(&C::subtract(&c, &z)).mul_add(weight2, gap);
            penalty = C::norm2(&left).mul_add(weight2 * 0.5, penalty);
            C::store(&p, p_at);
            C::store(&u, u_at);
            objective = C::norm2(&C::subtract(&c, &p)).mul_add(weight2 * 0.5, objective);
            let inverse: [[F8<I>; K]; K] = load_rows(block(&self.scratch.inverse, place, 9), 0);
            add_forces(&C::penalty_gradient(&at, &p), weight2, &inverse, self.chunk.local(b), self.partials);
        }
        LocalReport {
            penalty_after: penalty.sum(),
            objective: objective.sum(),
            moved2: moved2.sum(),
            gap2: gap.sum(),
            ..Default::default()
        }
    }
}

/// 1/2 sum w^2 |c(Dx) - p|^2 and its gradient, W(12)-(16); the stretches where the coupling knows them.
pub(super) struct Penalty<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub partials: &'a mut [f64],
    pub scratch: &'a mut Scratch,
    pub coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for Penalty<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = PenaltyReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> PenaltyReport {
        let s = self.shared;
        let mut value = F8::<I>::zero();
        let mut range = Stretches::<I, D, K>::new();
        for (place, b) in self.group.enumerate() {
            let global = self.chunk.global(b);
            let weight2 = F8::<I>::load_at(s.weight2, global);
            let (at, inverse) = visit::<I, C, D, K>(s, self.chunk, b);
            let p = C::load::<I>(block(s.p, global, C::LOCAL));
            value = C::norm2(&C::subtract(&C::couple(&at), &p)).mul_add(weight2 * 0.5, value);
            add_forces(&C::penalty_gradient(&at, &p), weight2, &inverse, self.chunk.local(b), self.partials);
            if C::DECOMPOSES {
                let d: Decomposed<F8<I>, D, K> = C::decomposed(&at);
                range.add(&d.s, global, s.chunks.n_elems());
                for i in 0..K {
                    d.s[i].store_at(&mut self.scratch.stretches, place * K + i);
                }
            }
        }
        PenaltyReport { value: value.sum(), energy: C::DECOMPOSES.then(|| range.report()) }
    }
}

/// The extent of the stretches seen so far.
struct Stretches<I: Isa, const D: usize, const K: usize> {
    low: F8<I>,
    high: F8<I>,
    inverted: u64,
}

impl<I: Isa, const D: usize, const K: usize> Stretches<I, D, K> {
    #[inline(always)]
    fn new() -> Self {
        Stretches { low: F8::splat(f64::INFINITY), high: F8::splat(f64::NEG_INFINITY), inverted: 0 }
    }

    /// Of block `global` of `n_elems` elements; padding lanes repeat an element and are not counted.
    #[inline(always)]
    fn add(&mut self, s: &[F8<I>; K], global: usize, n_elems: usize) {
        self.low = self.low.min(s[K - 1]);
        self.high = self.high.max(s[0]);
        if D == K {
            let used = (n_elems - global * LANES).min(LANES) as u32;
            self.inverted += u64::from((s[K - 1].le(F8::zero()).bits() & ((1u16 << used) - 1) as u8).count_ones());
        }
    }

    #[inline(always)]
    fn report(&self) -> EnergyReport {
        EnergyReport {
            value: 0.0,
            inverted: self.inverted,
            min_stretch: self.low.min_lane(),
            max_stretch: self.high.max_lane(),
            violation: 0.0,
        }
    }
}

/// The first half of the energy: stretches, and decompositions where forces are wanted.
pub(super) struct EnergyIn<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub frames: bool,
    pub scratch: &'a mut Scratch,
    pub coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for EnergyIn<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = EnergyReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> EnergyReport {
        let mut range = Stretches::<I, D, K>::new();
        for (place, b) in self.group.enumerate() {
            let (at, inverse) = visit::<I, C, D, K>(self.shared, self.chunk, b);
            let d: Decomposed<F8<I>, D, K> = C::decomposed(&at);
            range.add(&d.s, self.chunk.global(b), self.shared.chunks.n_elems());
            for i in 0..K {
                d.s[i].store_at(&mut self.scratch.stretches, place * K + i);
            }
            if self.frames {
                d.keep(block_mut(&mut self.scratch.at, place, KEPT));
                store_rows(&inverse, block_mut(&mut self.scratch.inverse, place, 9), 0);
            }
        }
        range.report()
    }
}

/// The second half: forces from d psi / d s.
pub(super) struct EnergyOut<'a, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub partials: &'a mut [f64],
    pub scratch: &'a Scratch,
}

impl<const D: usize, const K: usize> Kernel for EnergyOut<'_, D, K> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (place, b) in self.group.enumerate() {
            let global = self.chunk.global(b);
            let mut d = Decomposed::<F8<I>, D, K>::kept(block(&self.scratch.at, place, KEPT));
            for i in 0..K {
                d.s[i] = F8::load_at(&self.scratch.stretches, place * K + i);
            }
            let stress = compose(&d.u, &d.s, &d.v);
            let inverse: [[F8<I>; K]; K] = load_rows(block(&self.scratch.inverse, place, 9), 0);
            add_forces(&stress, F8::load_at(self.shared.measure, global), &inverse, self.chunk.local(b), self.partials);
        }
    }
}

/// sum w^2 |c(Dx) - z|^2 and sum w^2 |z|^2; the former element by element where there is room for it.
pub(super) struct Gap<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub out: &'a mut [f64],
    pub coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for Gap<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = Residual;
    #[inline(always)]
    fn run<I: Isa>(self) -> Residual {
        let s = self.shared;
        let (mut gap2, mut size2) = (F8::<I>::zero(), F8::<I>::zero());
        for b in self.group {
            let global = self.chunk.global(b);
            let weight2 = F8::<I>::load_at(s.weight2, global);
            let c = C::couple(&visit::<I, C, D, K>(s, self.chunk, b).0);
            let z = C::add(&C::load::<I>(block(s.p, global, C::LOCAL)), &C::load::<I>(block(s.u, global, C::LOCAL)));
            let own = C::norm2(&C::subtract(&c, &z)) * weight2;
            if !self.out.is_empty() {
                own.store_at(self.out, b);
            }
            gap2 += own;
            size2 = C::norm2(&z).mul_add(weight2, size2);
        }
        Residual { gap2: gap2.sum(), size2: size2.sum() }
    }
}
