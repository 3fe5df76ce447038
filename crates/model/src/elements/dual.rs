//! The scaled dual as a function of the local variable, A(21).

use super::chunks::BLOCKS;
use super::coupling::Coupling;
use super::kernels::{KEPT, Scratch};
use super::passes::{Nothing, Piece, Shared, groups, over_chunks};
use super::shape::{Decomposed, Shape, Simplex, block, block_mut};
use super::{Elements, shared};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, dispatch};
use std::marker::PhantomData;
use std::ops::Range;

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    /// u <- V/w^2 d psi / d z
    pub(super) fn dual_of(&self, z: &[f64], u: &mut [f64]) {
        let range = self.all_chunks();
        let shared = shared!(self, x: &[], p: z, u: &[]);
        let piece = Piece { u, ..Default::default() };
        let Nothing = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let mut scratch = Scratch::new();
            for group in groups(shared.chunks.blocks_of(c)) {
                let (first, len) = (c * BLOCKS + group.start, group.len());
                let (shared, coupling) = (&shared, PhantomData::<C>);
                dispatch(DualIn { shared, first, len, scratch: &mut scratch, coupling });
                shared.energy.gradient(&mut scratch.stretches[..len * K * LANES]);
                dispatch(DualOut { shared, first, group, u: piece.u, scratch: &scratch, coupling });
            }
            Nothing
        });
    }
}

/// The first half: stretches and frames of z, which is in the place of p.
struct DualIn<'a, C, const D: usize, const K: usize> {
    shared: &'a Shared<'a, K>,
    first: usize, // the first block
    len: usize,
    scratch: &'a mut Scratch,
    coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for DualIn<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for place in 0..self.len {
            let z = C::load::<I>(block(self.shared.p, self.first + place, C::LOCAL));
            let frame: Decomposed<F8<I>, D, K> = C::frame(&z);
            for i in 0..K {
                frame.s[i].store_at(&mut self.scratch.stretches, place * K + i);
            }
            frame.keep(block_mut(&mut self.scratch.frame, place, KEPT));
        }
    }
}

/// The second half: u = V/w^2 d psi / d z from d psi / d s.
struct DualOut<'a, C, const D: usize, const K: usize> {
    shared: &'a Shared<'a, K>,
    first: usize,
    group: Range<usize>, // the blocks in the chunk
    u: &'a mut [f64],
    scratch: &'a Scratch,
    coupling: PhantomData<C>,
}

impl<C: Coupling<D, K>, const D: usize, const K: usize> Kernel for DualOut<'_, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (place, b) in self.group.enumerate() {
            let at = self.first + place;
            let measure = F8::<I>::load_at(self.shared.measure, at);
            let scale = measure / F8::load_at(self.shared.weight2, at);
            let mut frame = Decomposed::<F8<I>, D, K>::kept(block(&self.scratch.frame, place, KEPT));
            for i in 0..K {
                frame.s[i] = F8::load_at(&self.scratch.stretches, place * K + i) * scale;
            }
            C::store(&C::in_frame(&frame), block_mut(self.u, b, C::LOCAL));
        }
    }
}
