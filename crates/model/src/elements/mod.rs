//! Batches of like elements: simplices with K + 1 corners in D dimensions, one energy, one coupling.

mod chunks;
mod coupling;
mod passes;
mod rest;
mod shape;
#[cfg(test)]
mod tests;

pub use coupling::{Coupling, Linear, Polar};
pub use chunks::morton;
pub use rest::{ElementError, Rest};
pub use shape::{Decomposed, Shape, Simplex};

use crate::energy::Energy;
use chunks::{BLOCKS, Chunks};
use passes::{CouplePass, EnergyPass, Largest, LocalPass, Nothing, PenaltyPass, Piece, Shared, Sizes, WeightPass, over_chunks};
use proxel_linalg::simd::{LANES, dispatch};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{EnergyReport, LocalReport, PenaltyReport, Term};
use shape::block;
use std::marker::PhantomData;

/// Padding lanes repeat the last element with this part of its measure and weight, a power of two: their ratio, and so the
/// prox, is that of the element, and their contribution vanishes in every sum.
const PADDING: f64 = f64::from_bits((1023 - 600) << 52);

/// sum_e V_e psi(F_e) over simplices with D x K deformation gradients (tetrahedra 3 x 3, triangles in space 3 x 2 or in
/// the plane 2 x 2, springs D x 1), split by the coupling C.
pub struct Elements<const D: usize, const K: usize, E, C> {
    chunks: Chunks,
    energy: E,
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

impl<const D: usize, const K: usize, E: Energy<K>, C: Coupling<D, K>> Elements<D, K, E, C>
where
    Simplex: Shape<D, K>,
{
    /// Elements `rest` with squared weights `base` times measure: W(21) for the largest eigenvalue of the rest Hessian.
    pub fn new(rest: &Rest<D, K>, energy: E, base: f64) -> Self {
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
            energy,
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

/// Borrows a batch for a pass: what all read, and what the pass may write.
macro_rules! over {
    ($self:ident, $pass:ident, x: $x:expr, z: $z:expr, u: $u:expr, piece: $piece:expr, sizes: $sizes:expr) => {{
        let chunks = &$self.chunks;
        let shared = Shared {
            chunks,
            energy: &$self.energy,
            x: $x,
            inverse: &$self.inverse,
            measure: &$self.measure,
            weight2: &$self.weight2,
            z: $z,
            u: $u,
            fresh: $self.fresh && C::SAVED > 0,
            singular_values: $self.singular_values,
        };
        let mut piece: Piece<'_> = $piece;
        if shared.fresh {
            piece.near = &mut [];
        }
        let range = 0..chunks.n_blocks().div_ceil(BLOCKS);
        over_chunks(chunks, piece, range, $sizes, &|c, piece| {
            dispatch($pass::<E, C, D, K> { shared: &shared, c, piece, coupling: PhantomData })
        })
    }};
}

impl<const D: usize, const K: usize, E: Energy<K>, C: Coupling<D, K>> Term for Elements<D, K, E, C>
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
        let piece = Piece { saved: &mut self.saved, near: &mut self.near, z, ..Default::default() };
        let Nothing = over!(self, CouplePass, x: x, z: &[], u: &[], piece: piece, sizes: &Self::SIZES);
        self.fresh = true;
    }

    fn local_step(&mut self, x: &[f64], z: &mut [f64], u: &mut [f64]) -> LocalReport {
        let piece =
            Piece { saved: &mut self.saved, near: &mut self.near, warm: &mut self.warm, z, u, ..Default::default() };
        let report = over!(self, LocalPass, x: x, z: &[], u: &[], piece: piece, sizes: &Self::SIZES);
        self.fresh = true;
        report
    }

    fn penalty(&mut self, x: &[f64], z: &[f64], u: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let piece =
            Piece { saved: &mut self.saved, near: &mut self.near, partials: &mut self.partials, ..Default::default() };
        let report = over!(self, PenaltyPass, x: x, z: z, u: u, piece: piece, sizes: &Self::SIZES);
        self.fresh = true;
        self.chunks.add_partials::<D>(&self.partials, grad);
        report
    }

    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        let mut piece = Piece { saved: &mut self.saved, near: &mut self.near, ..Default::default() };
        if grad.is_some() {
            piece.partials = &mut self.partials;
        }
        let report = over!(self, EnergyPass, x: x, z: &[], u: &[], piece: piece, sizes: &Self::SIZES);
        self.fresh = true;
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
        let piece = Piece { warm: &mut self.warm, z: &mut self.proposed, ..Default::default() };
        let sizes = Sizes { local: 1, ..Self::SIZES };
        let range = [self.base * low, self.base * high];
        let Largest(ratio) = over!(self, WeightPass, x: &range, z: &[], u: &[], piece: piece, sizes: &sizes);
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

impl<const D: usize, const K: usize, E: Energy<K>, C: Coupling<D, K>> Elements<D, K, E, C>
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
