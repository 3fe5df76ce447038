//! Where the second derivatives of elements go: pairs of nodes local to a chunk, as forces have nodes local to a chunk.
//!
//! A chunk adds the blocks of its elements into partial sums of its own, one for each pair of free nodes that one of its
//! elements has; an entry of the matrix then sums the few partial sums it has, in the order of the chunks.

use super::chunks::{BLOCKS, Chunks};
use proxel_linalg::simd::LANES;
use proxel_linalg::sparse::SymPattern;
use rayon::prelude::*;
use std::ops::Range;

/// Entries that one thread sums at a time.
const GATHER: usize = 1024;

/// No pair yet.
const NONE: u16 = u16::MAX;

/// The pairs of free nodes of a batch of elements.
pub(super) struct Pairs {
    /// [block][pair of corners a >= b][lane]: 2 place of the pair in its chunk, + 1 where the node of b is the larger one.
    /// Pairs with a fixed node have the place after the last, whose sum is thrown away.
    table: Vec<u16>,
    /// Where each chunk's partial sums begin, and where the last one's end; in pairs.
    starts: Vec<usize>,
    /// Partial sums of slot i: partials[gather[i]..gather[i + 1]].
    gather: Vec<u32>,
    places: Vec<u32>,
    /// Blocks, `dim` x `dim` each.
    partials: Vec<f64>,
}

/// Pairs of corners, itself with itself included.
pub(super) const fn corner_pairs(corners: usize) -> usize {
    corners * (corners + 1) / 2
}

/// The pairs of one chunk: its part of the table, and the slot of each.
struct OfChunk {
    table: Vec<u16>,
    slots: Vec<u32>,
}

impl Pairs {
    /// Finds the pairs of nodes below `pattern.n()`. A pair that the pattern lacks is treated as fixed.
    pub fn new(chunks: &Chunks, pattern: &SymPattern, dim: usize) -> Self {
        let n_chunks = chunks.n_blocks().div_ceil(BLOCKS);
        let found: Vec<OfChunk> = (0..n_chunks).into_par_iter().map(|c| of_chunk(chunks, c, pattern)).collect();
        let mut starts = vec![0];
        let mut table = Vec::with_capacity(found.iter().map(|f| f.table.len()).sum());
        let mut gather = vec![0u32; pattern.nnz() + 1];
        for f in &found {
            starts.push(starts[starts.len() - 1] + f.slots.len() + 1);
            table.extend_from_slice(&f.table);
            for slot in &f.slots {
                gather[*slot as usize + 1] += 1;
            }
        }
        for i in 0..pattern.nnz() {
            gather[i + 1] += gather[i];
        }
        let mut next = gather.clone();
        let mut places = vec![0u32; gather[pattern.nnz()] as usize];
        for (f, start) in found.iter().zip(&starts) {
            for (k, slot) in f.slots.iter().enumerate() {
                let at = &mut next[*slot as usize];
                places[*at as usize] = (start + k) as u32;
                *at += 1;
            }
        }
        let partials = vec![0.0; starts[n_chunks] * dim * dim];
        Pairs { table, starts, gather, places, partials }
    }

    /// The entries of the pattern that this was made for.
    pub fn nnz(&self) -> usize {
        self.gather.len() - 1
    }

    /// The table and the chunks' partial sums, to be filled by [`over_pairs`].
    pub fn parts(&mut self) -> (&[u16], &[usize], &mut [f64]) {
        (&self.table, &self.starts, &mut self.partials)
    }

    /// values += the sums of the partial sums, blocks of D x D.
    pub fn add_partials<const D: usize>(&self, values: &mut [f64]) {
        values.par_chunks_mut(GATHER * D * D).enumerate().for_each(|(g, out)| {
            for (j, out) in out.chunks_exact_mut(D * D).enumerate() {
                let i = g * GATHER + j;
                for place in &self.places[self.gather[i] as usize..self.gather[i + 1] as usize] {
                    let from = &self.partials[*place as usize * D * D..][..D * D];
                    for d in 0..D * D {
                        out[d] += from[d];
                    }
                }
            }
        });
    }
}

fn of_chunk(chunks: &Chunks, c: usize, pattern: &SymPattern) -> OfChunk {
    let (nodes, local, corners) = (chunks.nodes_of(c), chunks.local_of(c), chunks.corners());
    let n = pattern.n();
    // Nodes of a chunk ascend, so that the larger of two places is the larger node.
    let mut known = vec![NONE; corner_pairs(nodes.len())];
    let n_blocks = local.len() / (corners * LANES);
    let mut table = vec![NONE; n_blocks * corner_pairs(corners) * LANES];
    let mut slots = Vec::new();
    for b in 0..n_blocks {
        for lane in 0..LANES {
            let at = |k: usize| local[(b * corners + k) * LANES + lane] as usize;
            for i in 0..corners {
                for j in 0..=i {
                    let (high, low) = (at(i).max(at(j)), at(i).min(at(j)));
                    let place = &mut known[high * (high + 1) / 2 + low];
                    if *place == NONE
                        && (nodes[high] as usize) < n
                        && let Some(slot) = pattern.slot(nodes[high] as usize, nodes[low] as usize)
                    {
                        *place = 2 * slots.len() as u16;
                        slots.push(slot as u32);
                    }
                    if *place != NONE {
                        let entry = (b * corner_pairs(corners) + i * (i + 1) / 2 + j) * LANES + lane;
                        table[entry] = *place + u16::from(at(i) < at(j));
                    }
                }
            }
        }
    }
    let rest = 2 * slots.len() as u16;
    for entry in table.iter_mut().filter(|entry| **entry == NONE) {
        *entry = rest;
    }
    OfChunk { table, slots }
}

/// Runs `work` on every chunk of `range` with its part of the partial sums and of `near`.
pub(super) fn over_pairs(
    chunks: &Chunks,
    starts: &[usize],
    (near, dim): (&mut [f64], usize),
    partials: &mut [f64],
    range: Range<usize>,
    work: &(impl Fn(usize, &mut [f64], &mut [f64]) + Sync),
) {
    match range.len() {
        0 => {}
        1 => work(range.start, near, partials),
        n => {
            let at = range.start + n / 2;
            let cut = (chunks.slots_of(at).start - chunks.slots_of(range.start).start) * dim;
            let (near0, near1) = near.split_at_mut(cut);
            let (partials0, partials1) = partials.split_at_mut((starts[at] - starts[range.start]) * dim * dim);
            rayon::join(
                || over_pairs(chunks, starts, (near0, dim), partials0, range.start..at, work),
                || over_pairs(chunks, starts, (near1, dim), partials1, at..range.end, work),
            );
        }
    }
}
