//! Copies of the vectors of a field that have to fit together, eight vectors at a time.

mod kernels;

use kernels::{Images, Local, Sweep, Tied};
use proxel_linalg::simd::{LANES, dispatch};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, EnergyReport, LocalReport, PenaltyReport, Residual, Scale, Term, Uncoupled};
use rayon::prelude::*;
use std::marker::PhantomData;

/// Blocks of eight nodes that a task handles.
const CHUNK: usize = 256;

/// The set that the copies of a [`CopiedField`] lie in, as its projection sees it: each copy v has one number, its image d . v;
/// some numbers are joined of the images; and the nearest point takes from v, along d, a share of one image or joined number
/// (which one, its slot knows), or of the difference of its own image from that.
pub trait Ties: Send + Sync {
    /// Whether it is the difference.
    const DIFFERENCES: bool;

    /// How many numbers are joined of the images; they follow them.
    fn n_joined(&self) -> usize;

    /// Joins them.
    fn join(&self, images: &[f64], joined: &mut [f64]);

    /// What violations are counted in.
    fn unit(&self) -> f64;
}

/// A place for a copy.
#[derive(Clone, Copy, Debug)]
pub struct Slot<const D: usize> {
    /// d, of length 1.
    pub direction: [f64; D],
    /// The image or joined number that counts.
    pub other: Option<usize>,
    /// How much of it.
    pub share: f64,
    /// w^2; 0 for a copy that is tied to nothing, and where there is none.
    pub weight2: f64,
}

impl<const D: usize> Default for Slot<D> {
    fn default() -> Self {
        Slot { direction: [0.0; D], other: None, share: 0.0, weight2: 0.0 }
    }
}

/// Vectors of D numbers, the nodes of the problem, with K copies each, z = x: the indicator of a set of all copies that is
/// known by its [`Ties`]. Distances are sum w^2 |.|^2. Weights stay as they are.
///
/// A local vector has blocks of eight nodes, `[copy][coordinate][node]`, the last one filled up.
pub struct CopiedField<const D: usize, const K: usize, T> {
    n: usize,
    ties: T,
    direction: Vec<f64>, // d of each slot; in blocks, as local vectors
    other: Vec<u32>,     // where the number is that counts
    share: Vec<f64>,
    weight2: Vec<f64>, // of each slot
    images: Vec<f64>,  // of the slots, then what is joined
}

impl<const D: usize, const K: usize, T: Ties> CopiedField<D, K, T> {
    /// Numbers of eight nodes: in x, in what slots have one of, and in local vectors.
    const X: usize = D * LANES;
    const SLOTS: usize = K * LANES;
    const LOCAL: usize = D * K * LANES;

    /// Where the k-th copy of a node is among slots.
    pub(super) fn place(node: usize, k: usize) -> usize {
        (node / LANES) * Self::SLOTS + k * LANES + node % LANES
    }

    /// Where a coordinate of it is in a local vector.
    pub(super) fn at(node: usize, k: usize, d: usize) -> usize {
        (node / LANES) * Self::LOCAL + (D * k + d) * LANES + node % LANES
    }

    /// d of each slot, as a local vector.
    #[cfg(test)]
    pub(super) fn direction(&self) -> &[f64] {
        &self.direction
    }

    /// Of the copies of each node.
    pub(super) fn new(nodes: &[[Slot<D>; K]], ties: T) -> Self {
        let n_slots = nodes.len().div_ceil(LANES) * Self::SLOTS;
        let (mut direction, mut share) = (vec![0.0; D * n_slots], vec![0.0; n_slots]);
        let (mut other, mut weight2): (Vec<u32>, _) = ((0..n_slots as u32).collect(), share.clone());
        for (node, slots) in nodes.iter().enumerate() {
            for (k, slot) in slots.iter().enumerate() {
                let h = Self::place(node, k);
                (0..D).for_each(|d| direction[Self::at(node, k, d)] = slot.direction[d]);
                other[h] = slot.other.map_or(h as u32, |other| other as u32);
                (share[h], weight2[h]) = (slot.share, slot.weight2);
            }
        }
        let images = vec![0.0; n_slots + ties.n_joined()];
        CopiedField { n: nodes.len(), ties, direction, other, share, weight2, images }
    }

    /// What a task needs to know of its slots.
    fn tied(&self, task: usize) -> Tied<'_, D, K, T> {
        let slots = task * CHUNK * Self::SLOTS..((task + 1) * CHUNK * Self::SLOTS).min(self.share.len());
        Tied {
            direction: &self.direction[D * slots.start..D * slots.end],
            other: &self.other[slots.clone()],
            share: &self.share[slots.clone()],
            weight2: &self.weight2[slots.clone()],
            before: slots.start,
            images: &self.images,
            ties: PhantomData,
        }
    }

    /// The images of the copies x + u, or of x, and what is joined of them.
    fn take_images(&mut self, x: &[f64], u: Option<&[f64]>) {
        let (images, joined) = self.images.split_at_mut(self.share.len());
        let direction = self.direction.par_chunks(CHUNK * Self::LOCAL);
        let tasks = images.par_chunks_mut(CHUNK * Self::SLOTS).zip(direction).zip(x.par_chunks(CHUNK * Self::X));
        tasks.enumerate().for_each(|(task, ((images, direction), x))| {
            let from = task * CHUNK * Self::LOCAL;
            let u = u.map(|u| &u[from..from + direction.len()]);
            dispatch(Images::<D, K> { x, u, direction, images });
        });
        self.ties.join(images, joined);
    }

    /// The sum over the copies of w^2 a(place in x, place in local vectors), in a fixed order.
    fn weighed(&self, a: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
        let starts = (0..self.n).into_par_iter().step_by(CHUNK * LANES);
        let part = |from: usize| {
            let mut sum = 0.0;
            for node in from..(from + CHUNK * LANES).min(self.n) {
                for k in 0..K {
                    let w2 = self.weight2[Self::place(node, k)];
                    (0..D).for_each(|d| sum += w2 * a(D * node + d, Self::at(node, k, d)));
                }
            }
            sum
        };
        starts.map(part).collect::<Vec<f64>>().into_iter().sum()
    }

    /// Runs on each block of local vectors, with the numbers of its nodes.
    fn for_each_block(local: &mut [f64], x: &[f64], f: impl Fn(&mut [f64], &[f64]) + Sync) {
        let blocks = local.par_chunks_mut(Self::LOCAL).zip(x.par_chunks(Self::X));
        blocks.with_min_len(CHUNK).for_each(|(local, x)| f(local, x));
    }
}

impl<const D: usize, const K: usize, T: Ties> Term for CopiedField<D, K, T> {
    fn n_elems(&self) -> usize {
        K * self.n
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn local_len(&self) -> usize {
        self.direction.len()
    }

    fn local_dim(&self) -> usize {
        D * self.weight2.iter().filter(|w2| **w2 > 0.0).count()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        Self::for_each_block(out, x, |out, x| {
            for (node, x) in x.chunks_exact(D).enumerate() {
                (0..K).for_each(|k| (0..D).for_each(|d| out[Self::at(node, k, d)] = x[d]));
            }
        });
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        if cycle.relaxation != 1.0 {
            let over = cycle.relaxation - 1.0;
            let locals = p.par_chunks(Self::LOCAL).zip(u.par_chunks_mut(Self::LOCAL)).zip(x.par_chunks(Self::X));
            locals.with_min_len(CHUNK).for_each(|((p, u), x)| {
                for (node, x) in x.chunks_exact(D).enumerate() {
                    for (at, x) in (0..K).flat_map(|k| (0..D).map(move |d| (Self::at(node, k, d), x[d]))) {
                        u[at] += over * (x - (p[at] + u[at]));
                    }
                }
            });
        }
        self.take_images(x, Some(u));
        let this = &*self;
        let locals = p.par_chunks_mut(CHUNK * Self::LOCAL).zip(u.par_chunks_mut(CHUNK * Self::LOCAL));
        let nodes = x.par_chunks(CHUNK * Self::X).zip(grad.par_chunks_mut(CHUNK * Self::X));
        let tasks = locals.zip(nodes).enumerate();
        let parts: Vec<LocalReport> = tasks
            .map(|(task, ((p, u), (x, grad)))| {
                dispatch(Local { order: cycle.order, x, p, u, grad, tied: this.tied(task) })
            })
            .collect();
        let mut report = LocalReport::default();
        parts.into_iter().for_each(|part| report += part);
        report
    }

    /// Two passes: images first; then, node by node, z, x and u, since nothing else ties nodes to each other.
    fn sweep(&mut self, own: &Uncoupled, x: &mut [f64], p: &mut [f64], u: &mut [f64]) -> bool {
        if own.diagonal.len() != self.n || own.target.len() != x.len() || x.len() != D * self.n {
            return false;
        }
        self.take_images(x, Some(u));
        let this = &*self;
        let of_nodes = own.diagonal.par_chunks(CHUNK * LANES).zip(own.stiffness.par_chunks(CHUNK * LANES));
        let own = of_nodes.zip(own.target.par_chunks(CHUNK * Self::X));
        let locals = p.par_chunks_mut(CHUNK * Self::LOCAL).zip(u.par_chunks_mut(CHUNK * Self::LOCAL));
        let tasks = locals.zip(x.par_chunks_mut(CHUNK * Self::X)).zip(own).enumerate();
        tasks.for_each(|(task, (((p, u), x), ((diagonal, stiffness), target)))| {
            dispatch(Sweep { x, p, u, diagonal, stiffness, target, tied: this.tied(task) });
        });
        true
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        grad.par_chunks_exact_mut(D).with_min_len(CHUNK * LANES).enumerate().for_each(|(node, grad)| {
            for k in 0..K {
                let w2 = self.weight2[Self::place(node, k)];
                (0..D).for_each(|d| grad[d] = w2.mul_add(x[D * node + d] - p[Self::at(node, k, d)], grad[d]));
            }
        });
        let value = 0.5 * self.weighed(|i, at| (x[i] - p[at]).powi(2));
        PenaltyReport { value, energy: Some(self.energy(x, None)) }
    }

    /// The violation is, over the unit, the largest share of a difference of images, or the largest joined number.
    fn energy(&mut self, x: &[f64], _: Option<&mut [f64]>) -> EnergyReport {
        self.take_images(x, None);
        let excess = |h: usize| {
            let other = self.images[self.other[h] as usize];
            match T::DIFFERENCES {
                true => (self.share[h] * (self.images[h] - other)).abs(),
                false if self.share[h] > 0.0 => other.abs(),
                false => 0.0,
            }
        };
        let worst = |a: f64, b: f64| if b <= a { a } else { b }; // or what is no number
        let slots = (0..self.share.len()).into_par_iter().with_min_len(CHUNK * Self::SLOTS);
        let violation = slots.map(excess).reduce(|| 0.0, worst) / self.ties.unit();
        EnergyReport { violation, ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        Residual {
            gap2: self.weighed(|i, at| (x[i] - (p[at] + u[at])).powi(2)),
            size2: self.weighed(|_, at| (p[at] + u[at]).powi(2)),
        }
    }

    /// Each node by itself: copies of different nodes meet in the set alone.
    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        (0..self.n as u32).for_each(|node| visit(&[node]));
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for node in 0..self.n.min(pattern.n()) {
            values[pattern.diagonal_slot(node)] += (0..K).map(|k| self.weight2[Self::place(node, k)]).sum::<f64>();
        }
    }

    fn scale(&self) -> Scale {
        Scale { weight2: self.weight2.iter().sum(), ..Scale::default() }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        for (out, w2) in out.chunks_exact_mut(Self::X).zip(self.weight2.chunks_exact(LANES)) {
            out.chunks_exact_mut(LANES).for_each(|out| out.copy_from_slice(w2));
        }
    }

    fn local_work(&self) -> f64 {
        /// Nanoseconds a number: no prox, but memory.
        const NUMBER: f64 = 0.7;
        NUMBER * self.local_dim() as f64
    }
}
