//! The geometry of a pass, compiled for each instruction set: gathering, decompositions, forces. No energy appears here.

use super::coupling::Coupling;
use super::matrix::compose;
use super::passes::{Chunk, GROUP, Shared};
use super::shape::{Decomposed, Shape, Simplex, block, block_mut};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real};
use proxel_split::{EnergyReport, LocalReport, PenaltyReport};
use std::marker::PhantomData;
use std::ops::Range;

/// Scratch of a group: stretches, their signs, and the frames U and V.
pub(super) struct Scratch {
    pub stretches: [f64; GROUP * LANES * 3],
    pub signs: [f64; GROUP * LANES * 3],
    pub frames: [f64; GROUP * LANES * 18],
}

impl Scratch {
    pub fn new() -> Self {
        Scratch { stretches: [0.0; GROUP * LANES * 3], signs: [1.0; GROUP * LANES * 3], frames: [0.0; GROUP * LANES * 18] }
    }
}

/// The positions of a corner of a block.
#[inline(always)]
fn corner<I: Isa, const D: usize>(near: &[f64], local: &[u16], k: usize) -> [F8<I>; D] {
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
        out[d] = F8::load(&lanes[d]);
    }
    out
}

/// F = sum_k (x_k - x_0) g_k^T with g_k the rows of the inverse rest edges.
#[inline(always)]
fn deformation_gradient<I: Isa, const D: usize, const K: usize>(near: &[f64], local: &[u16], inverse: &[f64]) -> [[F8<I>; K]; D] {
    let origin = corner::<I, D>(near, local, 0);
    let mut f = [[F8::zero(); K]; D];
    for k in 0..K {
        let at = corner::<I, D>(near, local, k + 1);
        for d in 0..D {
            let edge = at[d] - origin[d];
            for c in 0..K {
                f[d][c] = edge.mul_add(F8::load_at(inverse, k * K + c), f[d][c]);
            }
        }
    }
    f
}

/// Adds scale P g_k^T to the partial sum of corner k of each lane, and the opposite of their sum to corner 0.
#[inline(always)]
fn add_forces<I: Isa, const D: usize, const K: usize>(
    p: &[[F8<I>; K]; D],
    scale: F8<I>,
    inverse: &[f64],
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
                let mut f = p[d][0] * F8::load_at(inverse, k * K);
                for c in 1..K {
                    f = p[d][c].mul_add(F8::load_at(inverse, k * K + c), f);
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

/// What is known of F at a block.
#[inline(always)]
fn visit<I: Isa, C: Coupling<D, K>, const D: usize, const K: usize>(
    fresh: bool,
    near: &[f64],
    local: &[u16],
    inverse: &[f64],
    saved: &mut [f64],
) -> C::At<F8<I>> {
    if fresh {
        return C::again([[F8::zero(); K]; D], saved);
    }
    C::arrive(deformation_gradient(near, local, inverse), saved)
}

/// z <- c(Dx) over the blocks of a group.
pub(super) struct Couple<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub saved: &'a mut [f64],
    pub z: &'a mut [f64], // empty: only the decompositions are wanted
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
            let inverse = block(self.shared.inverse, self.chunk.global(b), K * K);
            let saved = block_mut(self.saved, b, C::SAVED);
            let at = visit::<I, C, D, K>(self.shared.fresh, self.chunk.near(), self.chunk.local(b), inverse, saved);
            if !self.z.is_empty() {
                C::store(&C::couple(&at), block_mut(self.z, b, C::LOCAL));
            }
        }
    }
}

/// The first half of the local step: v = c(Dx) + u, left in u, and its stretches and frames.
pub(super) struct LocalIn<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub saved: &'a mut [f64],
    pub z: &'a [f64],
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
        let mut penalty = F8::<I>::zero();
        for (place, b) in self.group.enumerate() {
            let global = self.chunk.global(b);
            let inverse = block(s.inverse, global, K * K);
            let at = if C::SAVED > 0 {
                C::again([[F8::<I>::zero(); K]; D], block(self.saved, b, C::SAVED))
            } else {
                let f = deformation_gradient(self.chunk.near(), self.chunk.local(b), inverse);
                C::arrive(f, &mut [])
            };
            let u_at = block_mut(self.u, b, C::LOCAL);
            let v = C::add(&C::couple(&at), &C::load::<I>(u_at));
            C::store(&v, u_at);
            let gap = C::norm2(&C::subtract(&v, &C::load::<I>(block(self.z, b, C::LOCAL))));
            penalty = gap.mul_add(F8::load_at(s.weight2, global) * 0.5, penalty);
            let mut frame = C::frame(&v);
            if s.singular_values {
                let signs = singular_signs(&frame.s);
                for i in 0..K {
                    frame.s[i] = frame.s[i] * signs[i];
                    signs[i].store_at(&mut self.scratch.signs, place * K + i);
                }
            }
            store_frame::<I, C, D, K>(&frame, self.scratch, place);
        }
        LocalReport { penalty_before: penalty.sum(), ..Default::default() }
    }
}

/// The signs that turn eigenvalues of a symmetric matrix into its signed singular values: all positive but the smallest,
/// which carries the sign of the determinant.
#[inline(always)]
fn singular_signs<T: Real, const K: usize>(l: &[T; K]) -> [T; K] {
    let one = T::one();
    let (mut determinant, mut least) = (one, l[0].abs());
    for l in l {
        determinant = determinant * one.copysign(*l);
        least = least.min(l.abs());
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

#[inline(always)]
fn store_frame<I: Isa, C: Coupling<D, K>, const D: usize, const K: usize>(
    frame: &Decomposed<F8<I>, D, K>,
    scratch: &mut Scratch,
    place: usize,
) {
    for i in 0..K {
        frame.s[i].store_at(&mut scratch.stretches, place * K + i);
    }
    store_rotations(frame, scratch, place, C::SYMMETRIC);
}

#[inline(always)]
fn store_rotations<I: Isa, const D: usize, const K: usize>(
    frame: &Decomposed<F8<I>, D, K>,
    scratch: &mut Scratch,
    place: usize,
    only_v: bool,
) {
    let to = block_mut(&mut scratch.frames, place, (D + K) * K);
    for r in 0..K {
        for c in 0..K {
            frame.v[r][c].store_at(to, r * K + c);
        }
    }
    if !only_v {
        for r in 0..D {
            for c in 0..K {
                frame.u[r][c].store_at(to, (K + r) * K + c);
            }
        }
    }
}

#[inline(always)]
fn load_frame<I: Isa, const D: usize, const K: usize>(scratch: &Scratch, place: usize, only_v: bool) -> Decomposed<F8<I>, D, K> {
    let from = block(&scratch.frames, place, (D + K) * K);
    let mut frame = Decomposed { u: [[F8::zero(); K]; D], s: [F8::zero(); K], v: [[F8::zero(); K]; K] };
    for r in 0..K {
        frame.s[r] = F8::load_at(&scratch.stretches, place * K + r);
        for c in 0..K {
            frame.v[r][c] = F8::load_at(from, r * K + c);
        }
    }
    if !only_v {
        for r in 0..D {
            for c in 0..K {
                frame.u[r][c] = F8::load_at(from, (K + r) * K + c);
            }
        }
    }
    frame
}

/// The second half of the local step: z from its stretches and frames, u = v - z.
pub(super) struct LocalOut<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub z: &'a mut [f64],
    pub u: &'a mut [f64], // v comes in
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
        let (mut penalty, mut moved2) = (F8::<I>::zero(), F8::<I>::zero());
        for (place, b) in self.group.enumerate() {
            let weight2 = F8::<I>::load_at(self.shared.weight2, self.chunk.global(b));
            let mut frame = load_frame::<I, D, K>(self.scratch, place, C::SYMMETRIC);
            for i in 0..K {
                frame.s[i] = frame.s[i] * F8::load_at(&self.scratch.signs, place * K + i);
            }
            let z = C::in_frame(&frame);
            let (z_at, u_at) = (block_mut(self.z, b, C::LOCAL), block_mut(self.u, b, C::LOCAL));
            let u = C::subtract(&C::load::<I>(u_at), &z);
            moved2 = C::norm2(&C::subtract(&z, &C::load::<I>(z_at))).mul_add(weight2, moved2);
            penalty = C::norm2(&u).mul_add(weight2 * 0.5, penalty);
            C::store(&z, z_at);
            C::store(&u, u_at);
        }
        LocalReport { penalty_after: penalty.sum(), moved2: moved2.sum(), ..Default::default() }
    }
}

/// 1/2 sum w^2 |c(Dx) - z + u|^2 and its gradient, W(12)-(16).
pub(super) struct Penalty<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub saved: &'a mut [f64],
    pub partials: &'a mut [f64],
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
        let zero = F8::<I>::zero();
        let (mut value, mut gap2, mut size2) = (zero, zero, zero);
        for b in self.group {
            let global = self.chunk.global(b);
            let inverse = block(s.inverse, global, K * K);
            let weight2 = F8::<I>::load_at(s.weight2, global);
            let local = self.chunk.local(b);
            let saved = block_mut(self.saved, b, C::SAVED);
            let at = visit::<I, C, D, K>(s.fresh, self.chunk.near(), local, inverse, saved);
            let z = C::load::<I>(block(s.z, global, C::LOCAL));
            let p = C::subtract(&z, &C::load::<I>(block(s.u, global, C::LOCAL)));
            let c = C::couple(&at);
            value = C::norm2(&C::subtract(&c, &p)).mul_add(weight2 * 0.5, value);
            gap2 = C::norm2(&C::subtract(&c, &z)).mul_add(weight2, gap2);
            size2 = C::norm2(&z).mul_add(weight2, size2);
            add_forces(&C::penalty_gradient(&at, &p), weight2, inverse, local, self.partials);
        }
        PenaltyReport { value: value.sum(), gap2: gap2.sum(), size2: size2.sum() }
    }
}

/// The first half of the energy: stretches, and frames where forces are wanted.
pub(super) struct EnergyIn<'a, C, const D: usize, const K: usize> {
    pub shared: &'a Shared<'a, K>,
    pub chunk: &'a Chunk<'a>,
    pub group: Range<usize>,
    pub saved: &'a [f64],
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
        let s = self.shared;
        let (mut low, mut high) = (F8::<I>::splat(f64::INFINITY), F8::<I>::splat(f64::NEG_INFINITY));
        let mut inverted = 0;
        for (place, b) in self.group.enumerate() {
            let global = self.chunk.global(b);
            let d: Decomposed<F8<I>, D, K> = if C::SAVED > 0 {
                C::decomposed(&C::again([[F8::zero(); K]; D], block(self.saved, b, C::SAVED)))
            } else {
                let inverse = block(s.inverse, global, K * K);
                Simplex::svd(deformation_gradient(self.chunk.near(), self.chunk.local(b), inverse))
            };
            low = low.min(d.s[K - 1]);
            high = high.max(d.s[0]);
            if D == K {
                let used = (s.chunks.n_elems() - global * LANES).min(LANES) as u32;
                inverted += u64::from((d.s[K - 1].le(F8::zero()).bits() & ((1u16 << used) - 1) as u8).count_ones());
            }
            for i in 0..K {
                d.s[i].store_at(&mut self.scratch.stretches, place * K + i);
            }
            if self.frames {
                store_rotations(&d, self.scratch, place, false);
            }
        }
        EnergyReport { value: 0.0, inverted, min_stretch: low.min_lane(), max_stretch: high.max_lane() }
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
            let frame = load_frame::<I, D, K>(self.scratch, place, false);
            let stress = compose(&frame.u, &frame.s, &frame.v);
            let inverse = block(self.shared.inverse, global, K * K);
            add_forces(&stress, F8::load_at(self.shared.measure, global), inverse, self.chunk.local(b), self.partials);
        }
    }
}
