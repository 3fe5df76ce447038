//! Batches of like elements: simplices with K + 1 corners in D dimensions, one energy, one coupling.

mod chunks;
mod coupling;
mod density;
mod kernels;
mod matrix;
mod passes;
mod rest;
mod shape;
#[cfg(test)]
mod tests;

pub use chunks::morton;
pub use coupling::{Coupling, Linear, Polar};
pub use density::{Density, ProxSums};
pub use rest::{ElementError, Rest};
pub use shape::{Decomposed, Shape, Simplex};

use chunks::{BLOCKS, Chunks};
use kernels::{Couple, EnergyIn, EnergyOut, LocalIn, LocalOut, Penalty, Scratch};
use passes::{Chunk, Largest, Nothing, Piece, Shared, Sizes, over_chunks};
use proxel_linalg::simd::{LANES, dispatch};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{EnergyReport, LocalReport, PenaltyReport, Term};
use shape::block;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

/// Padding lanes repeat the last element with this part of its measure and weight, a power of two: their ratio, and so the
/// prox, is that of the element, and their contribution vanishes in every sum.
const PADDING: f64 = f64::from_bits((1023 - 600) << 52);

/// sum_e V_e psi(F_e) over simplices with D x K deformation gradients (tetrahedra 3 x 3, triangles in space 3 x 2 or in
/// the plane 2 x 2, springs D x 1), split by the coupling C.
pub struct Elements<const D: usize, const K: usize, C> {
    chunks: Chunks,
    energy: Arc<dyn Density<K>>,
    base: f64,         // squared base weight over measure
    inverse: Vec<f64>, // [block][K][K][lane]: inverse of the rest edges
    measure: Vec<f64>, // [block][lane]
    weight2: Vec<f64>, // [block][lane]: w^2
    proposed: Vec<f64>, // [block][lane]: candidate w^2, filled when first asked for
    warm: Vec<f64>,    // [block][K][lane]: stretches of z
    saved: Vec<f64>,   // [block][SAVED][lane]: decompositions of F at x
    fresh: bool,       // whether `saved` belongs to the current x
    near: Vec<f64>,    // chunk-local positions
    partials: Vec<f64>, // chunk-local sums of forces
    singular_values: bool, // see `with_singular_values`
    coupling: PhantomData<C>,
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    /// Elements `rest` with squared weights `base` times measure: W(21) for the largest eigenvalue of the rest Hessian.
    pub fn new(rest: &Rest<D, K>, energy: impl Density<K> + 'static, base: f64) -> Self {
        let chunks = Chunks::new(rest.elements(), K + 1, rest.keys());
        let n_blocks = chunks.n_blocks();
        let mut inverse = vec![0.0; n_blocks * K * K * LANES];
        let mut measure = vec![0.0; n_blocks * LANES];
        for place in 0..n_blocks * LANES {
            let padding = place >= chunks.n_elems();
            let e = chunks.order[place.min(chunks.n_elems() - 1)] as usize;
            let (b, lane) = (place / LANES, place % LANES);
            for (k, row) in rest.inverse(e).iter().enumerate() {
                for (c, v) in row.iter().enumerate() {
                    inverse[((b * K + k) * K + c) * LANES + lane] = *v;
                }
            }
            measure[place] = rest.measure(e) * if padding { PADDING } else { 1.0 };
        }
        let weight2 = measure.iter().map(|v| v * base).collect();
        let slots = chunks.n_slots() * D;
        Elements {
            energy: Arc::new(energy),
            base,
            inverse,
            measure,
            weight2,
            proposed: Vec::new(),
            warm: vec![1.0; n_blocks * K * LANES],
            saved: vec![0.0; n_blocks * C::SAVED * LANES],
            fresh: false,
            near: vec![0.0; slots],
            partials: vec![0.0; slots],
            chunks,
            singular_values: false,
            coupling: PhantomData,
        }
    }

    /// Whether the prox of a polar coupling takes the signed singular values of c(Dx) + u in the place of its eigenvalues,
    /// as the WRAPD authors' code does: with two negative eigenvalues the result is then no stretch of any F.
    #[must_use]
    pub fn with_singular_values(mut self, singular_values: bool) -> Self {
        self.singular_values = singular_values && C::LOCAL < D * K;
        self
    }

    const SIZES: Sizes = Sizes { dim: D, saved: C::SAVED, stretches: K, local: C::LOCAL };
}

/// What the passes of a batch read.
macro_rules! shared {
    ($self:ident, x: $x:expr, z: $z:expr, u: $u:expr) => {
        Shared {
            chunks: &$self.chunks,
            energy: &*$self.energy,
            x: $x,
            inverse: &$self.inverse,
            measure: &$self.measure,
            weight2: &$self.weight2,
            z: $z,
            u: $u,
            fresh: $self.fresh && C::SAVED > 0,
            singular_values: $self.singular_values,
        }
    };
}

/// The numbers of a group of blocks in a chunk's array with `size` numbers an element.
fn of_group(group: &Range<usize>, size: usize) -> Range<usize> {
    group.start * size * LANES..group.end * size * LANES
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    fn all_chunks(&self) -> Range<usize> {
        0..self.chunks.n_blocks().div_ceil(BLOCKS)
    }

    /// Brings the decompositions up to x, where the coupling keeps them, and writes c(Dx) where `z` is not empty.
    fn visit(&mut self, x: &[f64], z: &mut [f64]) {
        let range = self.all_chunks();
        let shared = shared!(self, x: x, z: &[], u: &[]);
        let piece = Piece { saved: &mut self.saved, near: &mut self.near, z, ..Default::default() };
        let Nothing = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            for group in chunk.groups() {
                let (saved, z) = (&mut *piece.saved, &mut *piece.z);
                dispatch(Couple::<C, D, K> { shared: &shared, chunk: &chunk, group, saved, z, coupling: PhantomData });
            }
            Nothing
        });
        self.fresh = true;
    }

    /// As [`Self::visit`], where it is needed.
    fn refresh(&mut self, x: &[f64]) {
        if C::SAVED > 0 && !self.fresh {
            self.visit(x, &mut []);
        }
    }

    /// Room for chunk-local positions, unless the coupling has all that is needed of them.
    fn near(near: &mut [f64]) -> &mut [f64] {
        if C::SAVED > 0 { &mut [] } else { near }
    }
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Term for Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    fn n_elems(&self) -> usize {
        self.chunks.n_elems()
    }

    fn local_len(&self) -> usize {
        self.chunks.n_blocks() * C::LOCAL * LANES
    }

    fn moved(&mut self) {
        self.fresh = false;
    }

    fn couple(&mut self, x: &[f64], z: &mut [f64]) {
        self.visit(x, z);
    }

    fn local_step(&mut self, x: &[f64], z: &mut [f64], u: &mut [f64]) -> LocalReport {
        self.refresh(x);
        let range = self.all_chunks();
        let shared = shared!(self, x: x, z: &[], u: &[]);
        let near = Self::near(&mut self.near);
        let piece = Piece { saved: &mut self.saved, near, warm: &mut self.warm, z, u, ..Default::default() };
        over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            let mut scratch = Scratch::new();
            let mut report = LocalReport::default();
            for group in chunk.groups() {
                let (saved, z, u) = (&mut *piece.saved, &mut *piece.z, &mut *piece.u);
                report += dispatch(LocalIn::<C, D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group: group.clone(),
                    saved,
                    z,
                    u,
                    scratch: &mut scratch,
                    coupling: PhantomData,
                });
                let first = chunk.global(group.start) * LANES;
                let numbers = first..first + group.len() * LANES;
                let sums = shared.energy.prox(
                    &mut scratch.stretches[..group.len() * K * LANES],
                    &mut piece.warm[of_group(&group, K)],
                    &shared.weight2[numbers.clone()],
                    &shared.measure[numbers],
                    shared.chunks.n_elems() - first,
                );
                report.value_before += sums.value_before;
                report.value_after += sums.value_after;
                report.missed += sums.missed;
                let scratch = &scratch;
                report +=
                    dispatch(LocalOut::<C, D, K> { shared: &shared, chunk: &chunk, group, z, u, scratch, coupling: PhantomData });
            }
            report
        })
    }

    fn penalty(&mut self, x: &[f64], z: &[f64], u: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let range = self.all_chunks();
        let shared = shared!(self, x: x, z: z, u: u);
        let near = if shared.fresh { &mut [] } else { self.near.as_mut_slice() };
        let piece = Piece { saved: &mut self.saved, near, partials: &mut self.partials, ..Default::default() };
        let report = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            piece.partials.fill(0.0);
            let mut report = PenaltyReport::default();
            for group in chunk.groups() {
                let (saved, partials) = (&mut *piece.saved, &mut *piece.partials);
                report +=
                    dispatch(Penalty::<C, D, K> { shared: &shared, chunk: &chunk, group, saved, partials, coupling: PhantomData });
            }
            report
        });
        self.fresh = true;
        self.chunks.add_partials::<D>(&self.partials, grad);
        report
    }

    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        self.refresh(x);
        let range = self.all_chunks();
        let shared = shared!(self, x: x, z: &[], u: &[]);
        let near = Self::near(&mut self.near);
        let mut piece = Piece { saved: &mut self.saved, near, ..Default::default() };
        if grad.is_some() {
            piece.partials = &mut self.partials;
        }
        let report = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            let frames = !piece.partials.is_empty();
            piece.partials.fill(0.0);
            let mut scratch = Scratch::new();
            let mut report = EnergyReport::default();
            for group in chunk.groups() {
                report += dispatch(EnergyIn::<C, D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group: group.clone(),
                    saved: piece.saved,
                    frames,
                    scratch: &mut scratch,
                    coupling: PhantomData,
                });
                let first = chunk.global(group.start) * LANES;
                let stretches = &mut scratch.stretches[..group.len() * K * LANES];
                report.value += shared.energy.value(stretches, &shared.measure[first..first + group.len() * LANES]);
                if frames {
                    shared.energy.gradient(stretches);
                    let (partials, scratch) = (&mut *piece.partials, &scratch);
                    dispatch(EnergyOut::<D, K> { shared: &shared, chunk: &chunk, group, partials, scratch });
                }
            }
            report
        });
        if let Some(grad) = grad {
            self.chunks.add_partials::<D>(&self.partials, grad);
        }
        report
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        let mut nodes = [0; 4];
        for place in 0..self.chunks.n_elems() {
            for (to, node) in nodes.iter_mut().zip(self.chunks.element(place)) {
                *to = node;
            }
            visit(&nodes[..K + 1]);
        }
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        let free = pattern.n();
        let mut nodes = [0; 4];
        for place in 0..self.chunks.n_elems() {
            for (to, node) in nodes.iter_mut().zip(self.chunks.element(place)) {
                *to = node as usize;
            }
            let g = self.corner_gradients(place);
            let w2 = self.weight2[place];
            for a in 0..=K {
                for b in 0..=a {
                    let (i, j) = (nodes[a].max(nodes[b]), nodes[a].min(nodes[b]));
                    if i < free {
                        let product: f64 = g[a].iter().zip(&g[b]).map(|(a, b)| a * b).sum();
                        if let Some(slot) = pattern.slot(i, j) {
                            values[slot] += w2 * product;
                        }
                    }
                }
            }
        }
    }

    fn add_characteristic_force(&self, size: &mut [f64]) {
        let stiffness = self.energy.rest_stiffness();
        for place in 0..self.chunks.n_elems() {
            let g = self.corner_gradients(place);
            for (node, g) in self.chunks.element(place).zip(&g) {
                if let Some(size) = size.get_mut(node as usize) {
                    *size += stiffness * self.measure[place] * g.iter().map(|v| v * v).sum::<f64>().sqrt();
                }
            }
        }
    }

    fn propose_weights(&mut self, (low, high): (f64, f64)) -> f64 {
        self.proposed.resize(self.measure.len(), 0.0);
        let (low, high) = (self.base * low, self.base * high);
        let range = self.all_chunks();
        let shared = shared!(self, x: &[], z: &[], u: &[]);
        let piece = Piece { warm: &mut self.warm, z: &mut self.proposed, ..Default::default() };
        let sizes = Sizes { local: 1, ..Self::SIZES };
        let Largest(ratio) = over_chunks(&self.chunks, piece, range, &sizes, &|c, piece| {
            let first = c * BLOCKS * LANES;
            shared.energy.effective_stiffness(piece.warm, piece.z);
            let mut ratio = 1.0_f64;
            for (at, candidate) in piece.z.iter_mut().enumerate() {
                let weight2 = shared.weight2[first + at];
                *candidate = candidate.clamp(low, high) * shared.measure[first + at];
                ratio = ratio.max(*candidate / weight2).max(weight2 / *candidate);
            }
            Largest(ratio)
        });
        ratio
    }

    fn take_weights(&mut self, u: &mut [f64]) {
        for b in 0..self.chunks.n_blocks() {
            for lane in 0..LANES {
                let at = b * LANES + lane;
                let scale = self.weight2[at] / self.proposed[at];
                for c in 0..C::LOCAL {
                    u[(b * C::LOCAL + c) * LANES + lane] *= scale;
                }
            }
        }
        self.weight2.copy_from_slice(&self.proposed);
    }
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    /// The gradients of the K + 1 barycentric coordinates of the element at `place`: rows of D_e.
    fn corner_gradients(&self, place: usize) -> [[f64; K]; 4] {
        let inverse = block(&self.inverse, place / LANES, K * K);
        let lane = place % LANES;
        let mut g = [[0.0; K]; 4];
        for k in 0..K {
            for c in 0..K {
                g[k + 1][c] = inverse[(k * K + c) * LANES + lane];
                g[0][c] -= g[k + 1][c];
            }
        }
        g
    }
}
