//! Which elements keep a splitting from settling, and what becomes of their weights.

use super::coupling::Coupling;
use super::kernels::Gap;
use super::passes::{Chunk, Piece, Shared, Sizes, over_chunks};
use super::shape::{Shape, Simplex};
use super::{Elements, shared};
use proxel_linalg::simd::dispatch;
use proxel_split::{Hardening, Residual};
use std::marker::PhantomData;

/// Candidate weights are never hardened past this part of V K_e.
const HARDEST: f32 = 4.0;

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    /// Raises the candidate weights of the elements that the rule means: [`proxel_split::Term::harden`].
    pub(super) fn raise(&mut self, rule: &Hardening, x: &[f64], p: &[f64], u: &[f64]) -> bool {
        let mut gaps = std::mem::take(&mut self.proposed);
        gaps.resize(self.measure.len(), 0.0);
        let total = self.gaps(x, p, u, &mut gaps).gap2;
        self.hardened.resize(self.measure.len(), self.softening as f32);
        let open = self.hardened.iter().zip(&gaps).filter(|(hardened, _)| **hardened < HARDEST);
        let most = open.map(|(_, gap2)| *gap2).fold(0.0, f64::max);
        let least = (rule.above * total / self.chunks.n_elems() as f64).min(0.5 * most);
        let mut raised = false;
        for (hardened, gap2) in self.hardened.iter_mut().zip(&gaps) {
            if *gap2 >= least && *hardened < HARDEST {
                *hardened = (*hardened * rule.factor as f32).min(HARDEST);
                raised = true;
            }
        }
        self.proposed = gaps;
        raised
    }

    /// How far c(Dx) is from z, and w^2 |c(Dx) - z|^2 of each element, [block][lane], where there is room for it.
    pub(super) fn gaps(&mut self, x: &[f64], p: &[f64], u: &[f64], out: &mut [f64]) -> Residual {
        let range = self.all_chunks();
        let shared = shared!(self, x: x, p: p, u: u);
        let piece = Piece { near: &mut self.near, p: out, ..Default::default() };
        let sizes = Sizes { local: 1, ..Self::SIZES };
        over_chunks(&self.chunks, piece, range, &sizes, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            let out = piece.p;
            let mut residual = Residual::default();
            for group in chunk.groups() {
                let (shared, chunk) = (&shared, &chunk);
                residual += dispatch(Gap::<C, D, K> { shared, chunk, group, out, coupling: PhantomData });
            }
            residual
        })
    }
}
