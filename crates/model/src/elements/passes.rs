//! What a pass over a batch shares and may write, and the walk over its chunks.

use super::chunks::{BLOCKS, Chunks};
use super::density::Density;
use proxel_linalg::simd::LANES;
use proxel_split::Cycle;

/// Blocks that a pass handles at a time, on a scratch pad that stays in the first-level cache.
pub(super) const GROUP: usize = 4;

/// What all passes read.
pub(super) struct Shared<'a, const K: usize> {
    pub chunks: &'a Chunks,
    pub energy: &'a dyn Density<K>,
    pub x: &'a [f64],
    pub inverse: &'a [f64], // [block][K][K][lane]: inverse of the rest edges, empty for tetrahedra
    pub rest: &'a [f64],    // chunk-local rest positions, for tetrahedra
    pub measure: &'a [f64], // [block][lane]: volume, area or length at rest
    pub weight2: &'a [f64], // [block][lane]: w^2
    pub p: &'a [f64],       // where a pass only reads them
    pub u: &'a [f64],
    pub singular_values: bool, // whether the prox takes signed singular values of a symmetric v
    pub cycle: Cycle,          // how the local step is taken
}

/// What a pass may write of a run of chunks; unused parts are empty.
#[derive(Default)]
pub(super) struct Piece<'a> {
    pub near: &'a mut [f64],
    pub partials: &'a mut [f64],
    pub warm: &'a mut [f64],
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
}

/// Numbers an element (of `near` and `partials`: a node) in each array.
pub(super) struct Sizes {
    pub dim: usize,
    pub stretches: usize,
    pub local: usize,
}

/// Cuts at `at`; an unused part stays empty.
fn split(v: &mut [f64], at: usize) -> (&mut [f64], &mut [f64]) {
    let at = at.min(v.len());
    v.split_at_mut(at)
}

impl<'a> Piece<'a> {
    /// Cuts before chunk `at` of the chunks from `first` on.
    fn cut(self, chunks: &Chunks, first: usize, at: usize, sizes: &Sizes) -> (Piece<'a>, Piece<'a>) {
        let elements = (at - first) * BLOCKS * LANES;
        let slots = (chunks.slots_of(at).start - chunks.slots_of(first).start) * sizes.dim;
        let (near0, near1) = split(self.near, slots);
        let (partials0, partials1) = split(self.partials, slots);
        let (warm0, warm1) = split(self.warm, elements * sizes.stretches);
        let (p0, p1) = split(self.p, elements * sizes.local);
        let (u0, u1) = split(self.u, elements * sizes.local);
        (
            Piece { near: near0, partials: partials0, warm: warm0, p: p0, u: u0 },
            Piece { near: near1, partials: partials1, warm: warm1, p: p1, u: u1 },
        )
    }
}

/// Runs `work` on every chunk and sums what it returns over a fixed binary tree.
pub(super) fn over_chunks<R>(
    chunks: &Chunks,
    piece: Piece<'_>,
    range: std::ops::Range<usize>,
    sizes: &Sizes,
    work: &(impl Fn(usize, Piece<'_>) -> R + Sync),
) -> R
where
    R: Send + Default + std::ops::AddAssign,
{
    match range.len() {
        0 => R::default(),
        1 => work(range.start, piece),
        n => {
            let at = range.start + n.div_ceil(2);
            let (left, right) = piece.cut(chunks, range.start, at, sizes);
            let (mut l, r) = rayon::join(
                || over_chunks(chunks, left, range.start..at, sizes, work),
                || over_chunks(chunks, right, at..range.end, sizes, work),
            );
            l += r;
            l
        }
    }
}

/// A chunk as a pass sees it.
pub(super) struct Chunk<'a> {
    pub index: usize,
    near: &'a [f64],
    local: &'a [u16],
    corners: usize,
    slots: std::ops::Range<usize>,
}

impl<'a> Chunk<'a> {
    /// Copies the positions of the chunk's nodes, `dim` numbers each.
    pub fn new(chunks: &'a Chunks, index: usize, x: &[f64], dim: usize, near: &'a mut [f64]) -> Self {
        for (to, node) in near.chunks_exact_mut(dim).zip(chunks.nodes_of(index)) {
            to.copy_from_slice(&x[*node as usize * dim..][..dim]);
        }
        Chunk { index, near, local: chunks.local_of(index), corners: chunks.corners(), slots: chunks.slots_of(index) }
    }

    /// Chunk-local positions.
    #[inline(always)]
    pub fn near(&self) -> &[f64] {
        self.near
    }

    /// This chunk's part of rest positions, `dim` numbers a slot.
    #[inline(always)]
    pub fn rest<'r>(&self, rest: &'r [f64], dim: usize) -> &'r [f64] {
        &rest[self.slots.start * dim..self.slots.end * dim]
    }

    /// Chunk-local nodes of a block, [corner][lane].
    #[inline(always)]
    pub fn local(&self, b: usize) -> &[u16] {
        let size = self.corners * LANES;
        &self.local[b * size..(b + 1) * size]
    }

    /// Groups of blocks of this chunk.
    pub fn groups(&self) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        groups(self.local.len() / (self.corners * LANES))
    }

    /// Where a block of this chunk stands among all blocks.
    #[inline(always)]
    pub fn global(&self, b: usize) -> usize {
        self.index * BLOCKS + b
    }
}

/// The groups of a chunk of n blocks.
pub(super) fn groups(n: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    (0..n).step_by(GROUP).map(move |from| from..(from + GROUP).min(n))
}

/// The report of a pass that has nothing to say.
#[derive(Default)]
pub(super) struct Nothing;

impl std::ops::AddAssign for Nothing {
    fn add_assign(&mut self, _: Self) {}
}

/// A maximum.
#[derive(Default)]
pub(super) struct Largest(pub f64);

impl std::ops::AddAssign for Largest {
    fn add_assign(&mut self, o: Self) {
        self.0 = self.0.max(o.0);
    }
}
