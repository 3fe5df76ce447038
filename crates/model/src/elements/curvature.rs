//! Second derivatives of a batch.

use super::chunks::BLOCKS;
use super::coupling::Coupling;
use super::pairs::{Pairs, corner_pairs, over_pairs};
use super::passes::{Chunk, Nothing, Piece, Shared, over_chunks};
use super::second::{AddBlocks, AddWarped, Decompose, Second};
use super::shape::{Shape, Simplex};
use super::stretch_hessian::curvatures;
use super::{Elements, shared};
use proxel_linalg::simd::{LANES, dispatch};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{Curvature, Projection};
use std::ops::Range;

/// Decompositions of a group, and the curvature of its energy there where one is asked for.
fn decompose<const D: usize, const K: usize>(
    shared: &Shared<'_, K>,
    chunk: &Chunk<'_>,
    group: Range<usize>,
    projection: Option<Projection>,
    scratch: &mut Second,
) where
    Simplex: Shape<D, K>,
{
    let blocks = group.len();
    dispatch(Decompose::<D, K> { shared, chunk, group, scratch });
    if let Some(projection) = projection {
        let s = &scratch.stretches[..blocks * K * LANES];
        shared.energy.hessian(s, projection, &mut scratch.curvature[..blocks * curvatures(K) * LANES]);
    }
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    /// Copies the step of the chunks' nodes; fixed nodes, which it does not cover, stay.
    fn spread(&mut self, step: &[f64]) {
        let slots = self.chunks.n_slots();
        self.far.resize(slots * D, 0.0);
        for c in self.all_chunks() {
            let range = self.chunks.slots_of(c);
            for (to, node) in self.far[range.start * D..range.end * D].chunks_exact_mut(D).zip(self.chunks.nodes_of(c))
            {
                match step.get(*node as usize * D..(*node as usize + 1) * D) {
                    Some(from) => to.copy_from_slice(from),
                    None => to.fill(0.0),
                }
            }
        }
    }
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Curvature for Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    fn prepare(&mut self, pattern: &SymPattern) {
        self.pairs = Some(Pairs::new(&self.chunks, pattern, D));
    }

    fn add_hessian(&mut self, x: &[f64], projection: Projection, values: &mut [f64]) {
        let range = self.all_chunks();
        let Some(pairs) = &mut self.pairs else { return };
        if values.len() != pairs.nnz() * D * D {
            return;
        }
        let shared = shared!(self, x: x, p: &[], u: &[]);
        let (table, starts, partials) = pairs.parts();
        let of_block = corner_pairs(K + 1) * LANES;
        over_pairs(&self.chunks, starts, (&mut self.near, D), partials, range, &|c, near, partials| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, near);
            partials.fill(0.0);
            let mut scratch = Second::new();
            for group in chunk.groups() {
                decompose::<D, K>(&shared, &chunk, group.clone(), Some(projection), &mut scratch);
                dispatch(AddBlocks::<D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group,
                    table: &table[c * BLOCKS * of_block..],
                    partials,
                    scratch: &scratch,
                });
            }
        });
        pairs.add_partials::<D>(values);
    }

    fn add_warped_gradient(&mut self, x: &[f64], step: &[f64], grad: &mut [f64]) {
        self.spread(step);
        let range = self.all_chunks();
        let shared = shared!(self, x: x, p: &[], u: &[]);
        let far = &self.far;
        let piece = Piece { near: &mut self.near, partials: &mut self.partials, ..Default::default() };
        let Nothing = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            let step = chunk.rest(far, D);
            piece.partials.fill(0.0);
            let mut scratch = Second::new();
            for group in chunk.groups() {
                decompose::<D, K>(&shared, &chunk, group.clone(), None, &mut scratch);
                dispatch(AddWarped::<D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group,
                    step,
                    partials: piece.partials,
                    scratch: &scratch,
                });
            }
            Nothing
        });
        self.chunks.add_partials::<D>(&self.partials, grad);
    }
}
