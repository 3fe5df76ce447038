//! The passes over a batch, one chunk at a time: everything static, compiled for each instruction set.

use super::chunks::{BLOCKS, Chunks};
use super::coupling::{Coupling, compose};
use super::shape::{Decomposed, Shape, Simplex, block, block_mut};
use crate::energy::Energy;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real};
use proxel_split::{EnergyReport, LocalReport, PenaltyReport};

/// What all passes read.
pub(super) struct Shared<'a, E> {
    pub chunks: &'a Chunks,
    pub energy: &'a E,
    pub x: &'a [f64],
    pub inverse: &'a [f64], // [block][K][K][lane]: inverse of the rest edges
    pub measure: &'a [f64], // [block][lane]: volume, area or length at rest
    pub weight2: &'a [f64], // [block][lane]: w^2
    pub z: &'a [f64],       // where a pass only reads them
    pub u: &'a [f64],
    pub fresh: bool, // whether `saved` holds the decompositions at x
    pub singular_values: bool, // whether the prox takes signed singular values of a symmetric v
}

/// What a pass may write of a run of chunks; unused parts are empty.
#[derive(Default)]
pub(super) struct Piece<'a> {
    pub saved: &'a mut [f64],
    pub near: &'a mut [f64],
    pub partials: &'a mut [f64],
    pub warm: &'a mut [f64],
    pub z: &'a mut [f64],
    pub u: &'a mut [f64],
}

impl<'a> Piece<'a> {
    /// Cuts before chunk `at` of the chunks from `first` on.
    fn cut(self, chunks: &Chunks, first: usize, at: usize, sizes: &Sizes) -> (Piece<'a>, Piece<'a>) {
        let blocks = (at - first) * BLOCKS * LANES;
        let slots = (chunks.slots_of(at).start - chunks.slots_of(first).start) * sizes.dim;
        fn split(v: &mut [f64], at: usize) -> (&mut [f64], &mut [f64]) {
            let at = at.min(v.len()); // an unused part stays empty
            v.split_at_mut(at)
        }
        let (saved0, saved1) = split(self.saved, blocks * sizes.saved);
        let (near0, near1) = split(self.near, slots);
        let (partials0, partials1) = split(self.partials, slots);
        let (warm0, warm1) = split(self.warm, blocks * sizes.stretches);
        let (z0, z1) = split(self.z, blocks * sizes.local);
        let (u0, u1) = split(self.u, blocks * sizes.local);
        (
            Piece { saved: saved0, near: near0, partials: partials0, warm: warm0, z: z0, u: u0 },
            Piece { saved: saved1, near: near1, partials: partials1, warm: warm1, z: z1, u: u1 },
        )
    }
}

/// Numbers an element in each array.
pub(super) struct Sizes {
    pub dim: usize,
    pub saved: usize,
    pub stretches: usize,
    pub local: usize,
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
struct Chunk<'a> {
    near: &'a [f64],
    local: &'a [u16],
}

impl<'a> Chunk<'a> {
    /// Copies the positions of the chunk's nodes, unless the pass runs on what is saved.
    #[inline(always)]
    fn new<E, const D: usize>(shared: &Shared<'a, E>, c: usize, near: &'a mut [f64]) -> Self {
        if !near.is_empty() {
            for (to, node) in near.chunks_exact_mut(D).zip(shared.chunks.nodes_of(c)) {
                to.copy_from_slice(&shared.x[*node as usize * D..][..D]);
            }
        }
        Chunk { near, local: shared.chunks.local_of(c) }
    }

    #[inline(always)]
    fn n_blocks(&self, corners: usize) -> usize {
        self.local.len() / (corners * LANES)
    }

    #[inline(always)]
    fn corner<I: Isa, const D: usize>(&self, b: usize, corners: usize, k: usize) -> [F8<I>; D] {
        let index: &[u16] = &self.local[(b * corners + k) * LANES..][..LANES];
        std::array::from_fn(|d| {
            let lanes: [f64; LANES] = std::array::from_fn(|l| self.near[index[l] as usize * D + d]);
            F8::load(&lanes)
        })
    }

    /// F = sum_k (x_k - x_0) g_k^T with g_k the rows of the inverse rest edges.
    #[inline(always)]
    fn gradient<I: Isa, const D: usize, const K: usize>(&self, b: usize, inverse: &[f64]) -> [[F8<I>; K]; D] {
        let origin = self.corner::<I, D>(b, K + 1, 0);
        let mut f = [[F8::zero(); K]; D];
        for k in 0..K {
            let at = self.corner::<I, D>(b, K + 1, k + 1);
            for d in 0..D {
                let edge = at[d] - origin[d];
                for c in 0..K {
                    f[d][c] = edge.mul_add(F8::load_at(inverse, k * K + c), f[d][c]);
                }
            }
        }
        f
    }
}

/// Adds scale * P g_k^T to the partial sum of corner k of each lane, and the opposite of their sum to corner 0.
#[inline(always)]
fn add_forces<I: Isa, const D: usize, const K: usize>(p: &[[F8<I>; K]; D], scale: F8<I>, inverse: &[f64], local: &[u16], partials: &mut [f64]) {
    let mut origin = [F8::<I>::zero(); D];
    for k in 0..K {
        let index = &local[(k + 1) * LANES..][..LANES];
        for d in 0..D {
            let mut force = p[d][0] * F8::load_at(inverse, k * K);
            for c in 1..K {
                force = p[d][c].mul_add(F8::load_at(inverse, k * K + c), force);
            }
            let force = force * scale;
            origin[d] -= force;
            for (l, force) in force.to_array().into_iter().enumerate() {
                partials[index[l] as usize * D + d] += force;
            }
        }
    }
    for d in 0..D {
        for (l, force) in origin[d].to_array().into_iter().enumerate() {
            partials[local[l] as usize * D + d] += force;
        }
    }
}

macro_rules! pass {
    ($(#[$doc:meta])* $name:ident -> $out:ty) => {
        $(#[$doc])*
        pub(super) struct $name<'a, 'b, E, C, const D: usize, const K: usize> {
            pub shared: &'a Shared<'b, E>,
            pub c: usize,
            pub piece: Piece<'a>,
            pub coupling: std::marker::PhantomData<C>,
        }
    };
}

pass!(
    /// z <- c(Dx).
    CouplePass -> ()
);

impl<E: Energy<K>, C: Coupling<D, K>, const D: usize, const K: usize> Kernel for CouplePass<'_, '_, E, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = Nothing;
    #[inline(always)]
    fn run<I: Isa>(self) -> Nothing {
        let s = self.shared;
        let chunk = Chunk::new::<E, D>(s, self.c, self.piece.near);
        for b in 0..chunk.n_blocks(K + 1) {
            let inverse = block(s.inverse, self.c * BLOCKS + b, K * K);
            let at = C::arrive::<I>(|| chunk.gradient(b, inverse), block_mut(self.piece.saved, b, C::SAVED), s.fresh);
            C::store(&C::couple(&at), block_mut(self.piece.z, b, C::LOCAL));
        }
        Nothing
    }
}

/// The report of a pass that has nothing to say.
#[derive(Default)]
pub(super) struct Nothing;

impl std::ops::AddAssign for Nothing {
    fn add_assign(&mut self, _: Self) {}
}

pass!(
    /// z <- prox(c(Dx) + u), u <- c(Dx) + u - z, W(10b) and W(10c).
    LocalPass -> LocalReport
);

impl<E: Energy<K>, C: Coupling<D, K>, const D: usize, const K: usize> Kernel for LocalPass<'_, '_, E, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = LocalReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> LocalReport {
        let s = self.shared;
        let piece = self.piece;
        let chunk = Chunk::new::<E, D>(s, self.c, piece.near);
        let zero = F8::<I>::zero();
        let (mut value0, mut value1, mut penalty0, mut penalty1, mut moved2, mut missed) = (zero, zero, zero, zero, zero, 0);
        for b in 0..chunk.n_blocks(K + 1) {
            let global = self.c * BLOCKS + b;
            let inverse = block(s.inverse, global, K * K);
            let measure = F8::<I>::load_at(s.measure, global);
            let weight2 = F8::<I>::load_at(s.weight2, global);
            let at = C::arrive::<I>(|| chunk.gradient(b, inverse), block_mut(piece.saved, b, C::SAVED), s.fresh);
            let (z_at, u_at) = (block_mut(piece.z, b, C::LOCAL), block_mut(piece.u, b, C::LOCAL));
            let z_before = C::load::<I>(z_at);
            let v = C::combine(&C::couple(&at), &C::load::<I>(u_at), |c, u| c + u);
            let warm_at = block_mut(piece.warm, b, K);
            let warm: [F8<I>; K] = std::array::from_fn(|i| F8::load_at(warm_at, i));
            let mut after = warm;
            let mut ok = 0;
            let used = (s.chunks.n_elems() - global * LANES).min(LANES);
            let z = C::prox(&v, |stretches| {
                let signs = if s.singular_values { singular_signs(&stretches) } else { [F8::one(); K] };
                let prox = s.energy.prox(times(stretches, signs), weight2 / measure, warm);
                after = prox.s;
                ok = prox.converged.bits() & (0xff_u16 >> (LANES - used)) as u8;
                times(prox.s, signs)
            });
            for i in 0..K {
                after[i].store_at(warm_at, i);
            }
            let u = C::combine(&v, &z, |v, z| v - z);
            C::store(&z, z_at);
            C::store(&u, u_at);
            let half = weight2 * 0.5;
            value0 = s.energy.value(warm).mul_add(measure, value0);
            value1 = s.energy.value(after).mul_add(measure, value1);
            penalty0 = C::norm2(&C::combine(&v, &z_before, |v, z| v - z)).mul_add(half, penalty0);
            penalty1 = C::norm2(&u).mul_add(half, penalty1);
            moved2 = C::norm2(&C::combine(&z, &z_before, |z, before| z - before)).mul_add(weight2, moved2);
            missed += used as u64 - u64::from(ok.count_ones());
        }
        LocalReport {
            value_before: value0.sum(),
            value_after: value1.sum(),
            penalty_before: penalty0.sum(),
            penalty_after: penalty1.sum(),
            moved2: moved2.sum(),
            missed,
        }
    }
}

#[inline(always)]
fn times<T: Real, const K: usize>(a: [T; K], b: [T; K]) -> [T; K] {
    std::array::from_fn(|i| a[i] * b[i])
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

pass!(
    /// 1/2 sum w^2 |c(Dx) - z + u|^2 and its gradient, W(12)-(16).
    PenaltyPass -> PenaltyReport
);

impl<E: Energy<K>, C: Coupling<D, K>, const D: usize, const K: usize> Kernel for PenaltyPass<'_, '_, E, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = PenaltyReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> PenaltyReport {
        let s = self.shared;
        let piece = self.piece;
        let chunk = Chunk::new::<E, D>(s, self.c, piece.near);
        piece.partials.fill(0.0);
        let zero = F8::<I>::zero();
        let (mut value, mut gap2, mut size2) = (zero, zero, zero);
        for b in 0..chunk.n_blocks(K + 1) {
            let global = self.c * BLOCKS + b;
            let inverse = block(s.inverse, global, K * K);
            let weight2 = F8::<I>::load_at(s.weight2, global);
            let at = C::arrive::<I>(|| chunk.gradient(b, inverse), block_mut(piece.saved, b, C::SAVED), s.fresh);
            let z = C::load::<I>(block(s.z, global, C::LOCAL));
            let u = C::load::<I>(block(s.u, global, C::LOCAL));
            let p = C::combine(&z, &u, |z, u| z - u);
            let c = C::couple(&at);
            value = C::norm2(&C::combine(&c, &p, |c, p| c - p)).mul_add(weight2 * 0.5, value);
            gap2 = C::norm2(&C::combine(&c, &z, |c, z| c - z)).mul_add(weight2, gap2);
            size2 = C::norm2(&z).mul_add(weight2, size2);
            let m = C::penalty_gradient(&at, &p);
            add_forces(&m, weight2, inverse, &chunk.local[b * (K + 1) * LANES..], piece.partials);
        }
        PenaltyReport { value: value.sum(), gap2: gap2.sum(), size2: size2.sum() }
    }
}

pass!(
    /// sum V psi(F), and its gradient where partial sums are given.
    EnergyPass -> EnergyReport
);

impl<E: Energy<K>, C: Coupling<D, K>, const D: usize, const K: usize> Kernel for EnergyPass<'_, '_, E, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = EnergyReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> EnergyReport {
        let s = self.shared;
        let piece = self.piece;
        let chunk = Chunk::new::<E, D>(s, self.c, piece.near);
        piece.partials.fill(0.0);
        let last = s.chunks.n_elems();
        let mut value = F8::<I>::zero();
        let (mut low, mut high) = (F8::<I>::splat(f64::INFINITY), F8::<I>::splat(f64::NEG_INFINITY));
        let mut inverted = 0;
        for b in 0..chunk.n_blocks(K + 1) {
            let global = self.c * BLOCKS + b;
            let inverse = block(s.inverse, global, K * K);
            let measure = F8::<I>::load_at(s.measure, global);
            let at = C::arrive::<I>(|| chunk.gradient(b, inverse), block_mut(piece.saved, b, C::SAVED), s.fresh);
            let d: Decomposed<F8<I>, D, K> = C::decomposed(&at);
            value = s.energy.value(d.s).mul_add(measure, value);
            low = low.min(d.s[K - 1]);
            high = high.max(d.s[0]);
            if D == K {
                let used = (last - global * LANES).min(LANES);
                let bits = d.s[K - 1].le(F8::zero()).bits() & (0xff_u16 >> (LANES - used)) as u8;
                inverted += u64::from(bits.count_ones());
            }
            if !piece.partials.is_empty() {
                let stress = compose(&d.u, &s.energy.gradient(d.s), &d.v);
                add_forces(&stress, measure, inverse, &chunk.local[b * (K + 1) * LANES..], piece.partials);
            }
        }
        EnergyReport { value: value.sum(), inverted, min_stretch: low.min_lane(), max_stretch: high.max_lane() }
    }
}

pass!(
    /// The largest ratio between the weights and those of W(22), which are written where `z` is given.
    WeightPass -> Largest
);

/// A maximum.
#[derive(Default)]
pub(super) struct Largest(pub f64);

impl std::ops::AddAssign for Largest {
    fn add_assign(&mut self, o: Self) {
        self.0 = self.0.max(o.0);
    }
}

impl<E: Energy<K>, C: Coupling<D, K>, const D: usize, const K: usize> Kernel for WeightPass<'_, '_, E, C, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = Largest;
    #[inline(always)]
    fn run<I: Isa>(self) -> Largest {
        let s = self.shared;
        // Least and largest squared weight over measure.
        let (low, high) = (F8::<I>::splat(s.x[0]), F8::<I>::splat(s.x[1]));
        let mut ratio = F8::<I>::one();
        for b in 0..self.piece.z.len() / LANES {
            let global = self.c * BLOCKS + b;
            let weight2 = F8::<I>::load_at(s.weight2, global);
            let stretches = std::array::from_fn(|i| F8::load_at(self.piece.warm, b * K + i));
            let stiffness = s.energy.effective_stiffness(stretches);
            let candidate = stiffness.max(low).min(high) * F8::load_at(s.measure, global);
            candidate.store_at(self.piece.z, b);
            ratio = ratio.max((candidate / weight2).max(weight2 / candidate));
        }
        Largest(ratio.max_lane())
    }
}
