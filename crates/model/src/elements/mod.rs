//! Batches of like elements: simplices with K + 1 corners in D dimensions, one energy, one coupling.

mod batch;
mod chunks;
mod coupling;
mod curvature;
#[cfg(test)]
mod curvature_tests;
mod density;
mod dual;
mod hardening;
mod kernels;
mod matrix;
mod normal;
mod pairs;
mod passes;
mod rest;
mod second;
mod sensitivity;
mod shape;
mod stretch_hessian;
#[cfg(test)]
mod tests;

pub use batch::{Batch, BatchError, BatchShape, BatchWeights, Flattened, Stiffness, batch};
pub use chunks::morton;
pub use coupling::{Coupling, Linear, Polar};
pub use density::{Density, ProxSums};
pub use rest::{ElementError, Rest};
pub use sensitivity::{Sensitivity, SensitivityError, Step};
pub use shape::{Decomposed, Shape, Simplex};

use chunks::{BLOCKS, Chunks};
use kernels::{Couple, EnergyIn, EnergyOut, LocalIn, LocalOut, Penalty, Scratch};
use pairs::Pairs;
use passes::{Chunk, Largest, Nothing, Piece, Shared, Sizes, over_chunks};
use proxel_linalg::simd::{LANES, dispatch};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{
    Curvature, Cycle, DualMap, EnergyReport, Hardening, LevelBound, LocalReport, PenaltyReport, Residual, Scale, Term,
};
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
    limits: Option<(f64, f64)>, // see `with_limits`
    base: f64,                  // squared base weight over measure
    inverse: Vec<f64>,          // [block][K][K][lane]: inverse of the rest edges, empty for tetrahedra
    rest: Vec<f64>,             // chunk-local rest positions, for tetrahedra
    measure: Vec<f64>,          // [block][lane]
    weight2: Vec<f64>,          // [block][lane]: w^2
    proposed: Vec<f64>,         // [block][lane]: candidate w^2, filled when first asked for
    warm: Vec<f64>,             // [block][K][lane]: stretches of z
    near: Vec<f64>,             // chunk-local positions
    partials: Vec<f64>,         // chunk-local sums of forces
    pairs: Option<Pairs>,       // where second derivatives go, once asked for
    far: Vec<f64>,              // chunk-local steps, likewise
    singular_values: bool,      // see `with_singular_values`
    softening: f64,             // see `with_softening`
    hardened: Vec<f32>,         // [block][lane]: what hardening made of it, empty until then
    coupling: PhantomData<C>,
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    /// Elements `rest` with squared weights `base` times measure: W(21) for the largest eigenvalue of the rest Hessian.
    pub fn new(rest: &Rest<D, K>, energy: impl Density<K> + 'static, base: f64) -> Self {
        Self::of_density(rest, Arc::new(energy), base)
    }

    /// The same for an energy whose type is not known.
    pub fn of_density(rest: &Rest<D, K>, energy: Arc<dyn Density<K>>, base: f64) -> Self {
        let chunks = Chunks::new(rest.elements(), K + 1, rest.keys());
        let n_blocks = chunks.n_blocks();
        let computed = K == 3 && D == 3; // see `kernels::inverse_edges`
        let mut inverse = vec![0.0; if computed { 0 } else { n_blocks * K * K * LANES }];
        let mut measure = vec![0.0; n_blocks * LANES];
        for place in 0..n_blocks * LANES {
            let padding = place >= chunks.n_elems();
            let e = chunks.order[place.min(chunks.n_elems() - 1)] as usize;
            let (b, lane) = (place / LANES, place % LANES);
            for (k, row) in rest.inverse(e).iter().enumerate().filter(|_| !computed) {
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
            limits: None,
            base,
            inverse,
            rest: if computed { chunks.positions(rest.positions(), D) } else { Vec::new() },
            measure,
            weight2,
            proposed: Vec::new(),
            warm: vec![1.0; n_blocks * K * LANES],
            near: vec![0.0; slots],
            partials: vec![0.0; slots],
            pairs: None,
            far: Vec::new(),
            chunks,
            singular_values: false,
            softening: 1.0,
            hardened: Vec::new(),
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

    /// Candidate weights are this part of V K_e, W(22) having 1. With the ratio of the base weight to the stiffness at rest,
    /// an element at rest keeps its base weight.
    #[must_use]
    pub fn with_softening(mut self, softening: f64) -> Self {
        self.softening = softening;
        self
    }

    /// Limits every stretch to [low, high], a hard set: see [`crate::energy::Limited`].
    #[must_use]
    pub fn with_limits(mut self, limits: Option<(f64, f64)>) -> Self {
        self.limits = limits;
        self
    }

    const SIZES: Sizes = Sizes { dim: D, stretches: K, local: C::LOCAL };
}

/// What the passes of a batch read.
macro_rules! shared {
    ($self:ident, x: $x:expr, p: $p:expr, u: $u:expr) => {
        Shared {
            chunks: &$self.chunks,
            energy: &*$self.energy,
            x: $x,
            inverse: &$self.inverse,
            rest: &$self.rest,
            measure: &$self.measure,
            weight2: &$self.weight2,
            p: $p,
            u: $u,
            singular_values: $self.singular_values,
            cycle: proxel_split::Cycle::PLAIN,
        }
    };
}

use shared;

/// The numbers of a group of blocks in a chunk's array with `size` numbers an element.
fn of_group(group: &Range<usize>, size: usize) -> Range<usize> {
    group.start * size * LANES..group.end * size * LANES
}

impl<const D: usize, const K: usize, C> Elements<D, K, C> {
    fn all_chunks(&self) -> Range<usize> {
        0..self.chunks.n_blocks().div_ceil(BLOCKS)
    }

    /// How far the stretches of a report are beyond the limits of the energy, at most; infinite where they are NaN.
    fn violation(&self, report: &EnergyReport) -> f64 {
        let Some((low, high)) = self.limits.or_else(|| self.energy.limits()) else { return 0.0 };
        let (below, above) = (low - report.min_stretch, report.max_stretch - high);
        if below.is_nan() || above.is_nan() { f64::INFINITY } else { below.max(above).max(0.0) }
    }
}

impl<const D: usize, const K: usize, C: Coupling<D, K>> Term for Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    fn n_elems(&self) -> usize {
        self.chunks.n_elems()
    }

    fn is_hard(&self) -> bool {
        self.limits.is_some() || self.energy.limits().is_some()
    }

    fn local_len(&self) -> usize {
        self.chunks.n_blocks() * C::LOCAL * LANES
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        let range = self.all_chunks();
        let shared = shared!(self, x: x, p: &[], u: &[]);
        let piece = Piece { near: &mut self.near, p: out, ..Default::default() };
        let Nothing = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            for group in chunk.groups() {
                dispatch(Couple::<C, D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group,
                    out: piece.p,
                    coupling: PhantomData,
                });
            }
            Nothing
        });
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let range = self.all_chunks();
        let limits = self.limits;
        let shared = Shared { cycle: *cycle, ..shared!(self, x: x, p: &[], u: &[]) };
        let piece = Piece { near: &mut self.near, partials: &mut self.partials, warm: &mut self.warm, p, u };
        let report = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            let (p, u, partials) = (piece.p, piece.u, piece.partials);
            partials.fill(0.0);
            let mut scratch = Scratch::new();
            let mut report = LocalReport::default();
            for group in chunk.groups() {
                report += dispatch(LocalIn::<C, D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group: group.clone(),
                    p,
                    u,
                    scratch: &mut scratch,
                    coupling: PhantomData,
                });
                let first = chunk.global(group.start) * LANES;
                let numbers = first..first + group.len() * LANES;
                let stretches = &mut scratch.stretches[..group.len() * K * LANES];
                let warm = &mut piece.warm[of_group(&group, K)];
                let (weight2, measure) = (&shared.weight2[numbers.clone()], &shared.measure[numbers]);
                let n_elems = shared.chunks.n_elems() - first;
                let sums = match limits {
                    None => shared.energy.prox(stretches, warm, weight2, measure, n_elems),
                    Some(limits) => shared.energy.prox_within(limits, stretches, warm, weight2, measure, n_elems),
                };
                report.value_before += sums.value_before;
                report.value_after += sums.value_after;
                report.missed += sums.missed;
                report += dispatch(LocalOut::<C, D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group,
                    p,
                    u,
                    partials,
                    scratch: &scratch,
                    coupling: PhantomData,
                });
            }
            report
        });
        self.chunks.add_partials::<D>(&self.partials, grad);
        report
    }

    fn local_dim(&self) -> usize {
        self.chunks.n_elems() * C::LOCAL
    }

    fn is_linear(&self) -> bool {
        !C::SYMMETRIC
    }

    /// Affine where g is a quadratic of what is split off, as that of |S - I|^2 is of S. A barrier's domain is not affine.
    fn dual_map(&self) -> DualMap {
        match () {
            () if self.is_hard() || self.energy.is_barrier() => DualMap::None,
            () if C::SYMMETRIC && self.energy.is_quadratic() => DualMap::Affine,
            () => DualMap::Smooth,
        }
    }

    fn dual(&mut self, z: &[f64], u: &mut [f64]) {
        self.dual_of(z, u);
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let range = self.all_chunks();
        let shared = shared!(self, x: x, p: p, u: &[]);
        let piece = Piece { near: &mut self.near, partials: &mut self.partials, ..Default::default() };
        let mut report = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            let partials = piece.partials;
            partials.fill(0.0);
            let mut scratch = Scratch::new();
            let mut report = PenaltyReport::default();
            for group in chunk.groups() {
                let mut part = dispatch(Penalty::<C, D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group: group.clone(),
                    partials,
                    scratch: &mut scratch,
                    coupling: PhantomData,
                });
                if let Some(energy) = &mut part.energy {
                    energy.value = value_of_group(&shared, &chunk, &group, &scratch);
                }
                report += part;
            }
            report
        });
        self.chunks.add_partials::<D>(&self.partials, grad);
        if let Some(energy) = &mut report.energy {
            energy.violation = self.violation(energy);
        }
        report
    }

    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        let range = self.all_chunks();
        let shared = shared!(self, x: x, p: &[], u: &[]);
        let mut piece = Piece { near: &mut self.near, ..Default::default() };
        if grad.is_some() {
            piece.partials = &mut self.partials;
        }
        let mut report = over_chunks(&self.chunks, piece, range, &Self::SIZES, &|c, piece| {
            let chunk = Chunk::new(shared.chunks, c, shared.x, D, piece.near);
            let frames = !piece.partials.is_empty();
            piece.partials.fill(0.0);
            let mut scratch = Scratch::new();
            let mut report = EnergyReport::default();
            for group in chunk.groups() {
                let mut part = dispatch(EnergyIn::<C, D, K> {
                    shared: &shared,
                    chunk: &chunk,
                    group: group.clone(),
                    frames,
                    scratch: &mut scratch,
                    coupling: PhantomData,
                });
                part.value = value_of_group(&shared, &chunk, &group, &scratch);
                report += part;
                if frames {
                    shared.energy.gradient(&mut scratch.stretches[..group.len() * K * LANES]);
                    let (partials, scratch) = (&mut *piece.partials, &scratch);
                    dispatch(EnergyOut::<D, K> { shared: &shared, chunk: &chunk, group, partials, scratch });
                }
            }
            report
        });
        if let Some(grad) = grad {
            self.chunks.add_partials::<D>(&self.partials, grad);
        }
        report.violation = self.violation(&report);
        report
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        self.gaps(x, p, u, &mut [])
    }

    /// Each element may have all of the level: psi <= level / V. That of its g^ is V/w^2 psi.
    fn level_bound(&self, level: f64) -> Option<LevelBound> {
        if self.is_hard() || !self.is_linear() {
            return None;
        }
        let mut bound = LevelBound { lipschitz: 0.0, force2: 0.0 };
        for (v, w2) in self.measure.iter().zip(&self.weight2).take(self.chunks.n_elems()) {
            let (h, f) = self.energy.level_bound(level / v)?;
            bound.lipschitz = bound.lipschitz.max(v / w2 * h);
            bound.force2 = bound.force2.max(v / w2 * f * level);
        }
        Some(bound)
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
        self.assemble_normal(pattern, values);
    }

    fn add_characteristic_force(&self, size: &mut [f64]) {
        self.assemble_characteristic_force(size);
    }

    fn scale(&self) -> Scale {
        let n = self.chunks.n_elems();
        let measure = self.measure[..n].iter().sum();
        Scale {
            measure,
            weight2: self.weight2[..n].iter().sum(),
            energy: 0.5 * self.energy.rest_stiffness() * measure,
            hessian: self.energy.rest_hessian_norm() / self.energy.rest_stiffness(),
        }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        for (b, block) in out.chunks_exact_mut(C::LOCAL * LANES).enumerate() {
            for component in block.chunks_exact_mut(LANES) {
                component.copy_from_slice(&self.weight2[b * LANES..(b + 1) * LANES]);
            }
        }
    }

    fn propose_weights(&mut self, (low, high): (f64, f64)) -> f64 {
        self.proposed.resize(self.measure.len(), 0.0);
        let (low, high, softening) = (self.base * low, self.base * high, self.softening);
        let hardened = &self.hardened;
        let range = self.all_chunks();
        let shared = shared!(self, x: &[], p: &[], u: &[]);
        let piece = Piece { warm: &mut self.warm, p: &mut self.proposed, ..Default::default() };
        let sizes = Sizes { local: 1, ..Self::SIZES };
        let Largest(ratio) = over_chunks(&self.chunks, piece, range, &sizes, &|c, piece| {
            let first = c * BLOCKS * LANES;
            shared.energy.effective_stiffness(piece.warm, piece.p);
            let mut ratio = 1.0_f64;
            for (at, candidate) in piece.p.iter_mut().enumerate() {
                let weight2 = shared.weight2[first + at];
                let softening = hardened.get(first + at).map_or(softening, |h| f64::from(*h));
                *candidate = (*candidate * softening).clamp(low, high) * shared.measure[first + at];
                ratio = ratio.max(*candidate / weight2).max(weight2 / *candidate);
            }
            Largest(ratio)
        });
        ratio
    }

    fn harden(&mut self, rule: &Hardening, x: &[f64], p: &[f64], u: &[f64]) -> bool {
        self.raise(rule, x, p, u)
    }

    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        for b in 0..self.chunks.n_blocks() {
            for lane in 0..LANES {
                let at = b * LANES + lane;
                let scale = self.weight2[at] / self.proposed[at];
                for c in 0..C::LOCAL {
                    let i = (b * C::LOCAL + c) * LANES + lane;
                    let z = p[i] + u[i];
                    u[i] *= scale;
                    p[i] = z - u[i];
                }
            }
        }
        self.weight2.copy_from_slice(&self.proposed);
    }

    /// None where stretches are limited: a hard set has no derivatives.
    fn curvature(&mut self) -> Option<&mut dyn Curvature> {
        if self.limits.is_some() {
            return None;
        }
        Some(self)
    }
}

/// sum V psi of the stretches in the scratch.
fn value_of_group<const K: usize>(
    shared: &Shared<'_, K>,
    chunk: &Chunk<'_>,
    group: &Range<usize>,
    scratch: &Scratch,
) -> f64 {
    let first = chunk.global(group.start) * LANES;
    shared
        .energy
        .value(&scratch.stretches[..group.len() * K * LANES], &shared.measure[first..first + group.len() * LANES])
}
