//! Copies of nodes that have to lie in a set together.

mod slots;

use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, EnergyReport, LocalReport, Order, PenaltyReport, Residual, Scale, Term, Uncoupled};
use rayon::prelude::*;
use slots::{CHUNK, Part, Slots};
use std::ops::{AddAssign, Range};

/// A set of vectors of copies, D numbers each, known by its projection. Whatever copies have to do with each other goes
/// through one number of each, its image.
pub trait JointSet<const D: usize>: Send + Sync {
    /// Images of all slots, and how many numbers [`Self::join`] puts behind them.
    fn n_images(&self) -> usize;

    /// The image of the copy v in a slot.
    fn image(&self, slot: usize, v: [f64; D]) -> f64;

    /// Fills what follows the images of the slots.
    fn join(&self, images: &mut [f64]);

    /// What the slot, whose copy is v, has in the point of the set that is nearest to the copies with these images, in the norm
    /// of the weights that the set was made with.
    fn nearest(&self, slot: usize, v: [f64; D], images: &[f64]) -> [f64; D];

    /// How far the copies with these images are outside, in units of the set; 0 inside.
    fn violation(&self, images: &[f64]) -> f64;
}

/// The indicator of a [`JointSet`] of copies of nodes, D numbers each: z_h = x_node(h), for each of some slots h, which are
/// in the order of their nodes.
///
/// A slot has a weight w_h^2 of its own; where that is 0 it stands for nothing. Distances are sum_h w_h^2 |.|^2. Weights
/// stay as they are.
pub struct Copies<const D: usize, S> {
    set: S,
    slots: Slots,
    weight2: Vec<f64>,
    images: Vec<f64>,
}

#[inline]
fn load<const D: usize>(x: &[f64], at: usize) -> [f64; D] {
    let mut v = [0.0; D];
    v.copy_from_slice(&x[at * D..(at + 1) * D]);
    v
}

#[inline]
fn store<const D: usize>(x: &mut [f64], at: usize, v: [f64; D]) {
    x[at * D..(at + 1) * D].copy_from_slice(&v);
}

#[inline]
fn each<const D: usize>(f: impl Fn(usize) -> f64) -> [f64; D] {
    std::array::from_fn(f)
}

/// |a - b|^2
#[inline]
fn distance2<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    (0..D).map(|d| (a[d] - b[d]) * (a[d] - b[d])).sum()
}

impl<const D: usize, S: JointSet<D>> Copies<D, S> {
    /// For each node how many slots it has, and for each slot its squared weight; slots without one weigh nothing.
    pub fn new(set: S, counts: impl IntoIterator<Item = u32>, mut weight2: Vec<f64>) -> Self {
        let slots = Slots::new(counts);
        weight2.resize(slots.len(), 0.0);
        let images = vec![0.0; set.n_images().max(slots.len())];
        Copies { set, slots, weight2, images }
    }

    /// The images of the copies that `v` gives for a node and a slot.
    fn take_images(&mut self, v: impl Fn(usize, usize) -> [f64; D] + Sync) {
        let (set, slots) = (&self.set, &self.slots);
        let of_slots = &mut self.images[..self.weight2.len()];
        slots.fill(0..slots.n_nodes(), 1, of_slots, &|nodes, images| {
            let mut images = images.iter_mut();
            for node in nodes {
                slots.of(node).zip(&mut images).for_each(|(h, image)| *image = set.image(h, v(node, h)));
            }
        });
        set.join(&mut self.images);
    }

    /// grad <- grad + sum_h w_h^2 (x - p_h), node by node.
    fn add_gradient(&self, x: &[f64], p: &[f64], grad: &mut [f64]) {
        grad.par_chunks_exact_mut(D).with_min_len(CHUNK).enumerate().for_each(|(node, grad)| {
            let x: [f64; D] = load(x, node);
            for h in self.slots.of(node) {
                let (p, w2): ([f64; D], f64) = (load(p, h), self.weight2[h]);
                (0..D).for_each(|d| grad[d] += w2 * (x[d] - p[d]));
            }
        });
    }

    /// The sum over slots of a function of x, p and slot.
    fn total<R: AddAssign + Default + Send>(&self, f: impl Fn([f64; D], usize, &mut R) + Sync, x: &[f64]) -> R {
        let leaf = |nodes: Range<usize>| {
            let mut sum = R::default();
            for node in nodes {
                let x = load(x, node);
                self.slots.of(node).for_each(|h| f(x, h, &mut sum));
            }
            sum
        };
        let n = self.slots.n_nodes();
        let starts = (0..n).into_par_iter().step_by(CHUNK);
        let parts: Vec<R> = starts.map(|from| leaf(from..(from + CHUNK).min(n))).collect();
        parts.into_iter().fold(R::default(), |mut sum, part| {
            sum += part;
            sum
        })
    }
}

impl<const D: usize, S: JointSet<D>> Term for Copies<D, S> {
    fn n_elems(&self) -> usize {
        self.weight2.len()
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn local_len(&self) -> usize {
        self.weight2.len() * D
    }

    fn local_dim(&self) -> usize {
        D * self.weight2.iter().filter(|w2| **w2 > 0.0).count()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        let slots = &self.slots;
        slots.fill(0..slots.n_nodes(), D, out, &|nodes, out| {
            let first = slots.before(nodes.start);
            for node in nodes {
                slots.of(node).for_each(|h| store::<D>(out, h - first, load(x, node)));
            }
        });
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let over = cycle.relaxation - 1.0;
        let relaxed = |c: [f64; D], p: [f64; D], u: [f64; D]| each(|d| c[d] + u[d] + over * (c[d] - (p[d] + u[d])));
        let (before, dual) = (&*p, &*u);
        self.take_images(|node, h| relaxed(load(x, node), load(before, h), load(dual, h)));
        let (set, slots, weight2, images) = (&self.set, &self.slots, &self.weight2, &self.images);
        slots.sum::<D, LocalReport>(0..slots.n_nodes(), Part { p, u, of_nodes: grad }, &|nodes, part| {
            let (from, first) = (nodes.start, slots.before(nodes.start));
            let mut report = LocalReport::default();
            for node in nodes {
                let c: [f64; D] = load(x, node);
                let mut grad: [f64; D] = load(part.of_nodes, node - from);
                for h in slots.of(node) {
                    let (p, u): ([f64; D], [f64; D]) = (load(part.p, h - first), load(part.u, h - first));
                    let (w2, v, before) = (weight2[h], relaxed(c, p, u), each(|d| p[d] + u[d]));
                    let z = set.nearest(h, v, images);
                    report.penalty_before += 0.5 * w2 * distance2(c, p);
                    report.moved2 += w2 * distance2(z, before);
                    report.gap2_before += w2 * distance2(c, before);
                    report.gap2 += w2 * distance2(c, z);
                    report.penalty_after += 0.5 * w2 * distance2(v, z);
                    let u = if cycle.order == Order::Xzu { each(|d| v[d] - z[d]) } else { u };
                    let p = each(|d| z[d] - u[d]);
                    report.objective += 0.5 * w2 * distance2(c, p);
                    (0..D).for_each(|d| grad[d] += w2 * (c[d] - p[d]));
                    store(part.u, h - first, u);
                    store(part.p, h - first, p);
                }
                store(part.of_nodes, node - from, grad);
            }
            report
        })
    }

    /// Two passes: images first; then, node by node, z, x and u, since nothing else ties nodes to each other.
    fn sweep(&mut self, own: &Uncoupled, x: &mut [f64], p: &mut [f64], u: &mut [f64]) -> bool {
        if own.diagonal.len() != self.slots.n_nodes() || own.target.len() != x.len() {
            return false;
        }
        let (at, dual) = (&*x, &*u);
        self.take_images(|node, h| sum(load(at, node), load(dual, h)));
        let (set, slots, weight2, images) = (&self.set, &self.slots, &self.weight2, &self.images);
        slots.for_each::<D>(0..slots.n_nodes(), Part { p, u, of_nodes: x }, &|nodes, part| {
            let ((mut p, _), (mut u, _)) = (part.p.as_chunks_mut::<D>(), part.u.as_chunks_mut::<D>());
            let own = own.diagonal.iter().zip(&own.stiffness).zip(own.target.as_chunks::<D>().0).skip(nodes.start);
            for ((node, x), ((a, k), target)) in nodes.zip(part.of_nodes.as_chunks_mut::<D>().0).zip(own) {
                let of_node = slots.of(node);
                let (p_here, p_rest) = p.split_at_mut(of_node.len());
                let (u_here, u_rest) = u.split_at_mut(of_node.len());
                let c = *x;
                let mut grad = [0.0; D];
                for (((h, w2), p), u) in of_node.clone().zip(&weight2[of_node]).zip(&mut *p_here).zip(&*u_here) {
                    let z = set.nearest(h, sum(c, *u), images);
                    *p = each(|d| z[d] - u[d]);
                    (0..D).for_each(|d| grad[d] += w2 * (c[d] - p[d]));
                }
                *x = each(|d| c[d] - (grad[d] + k * (c[d] - target[d])) / a);
                for (p, u) in p_here.iter_mut().zip(u_here) {
                    let z: [f64; D] = sum(*p, *u);
                    *u = each(|d| x[d] - p[d]);
                    *p = each(|d| z[d] - u[d]);
                }
                (p, u) = (p_rest, u_rest);
            }
        });
        true
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let weight2 = &self.weight2;
        let value = self.total(|c, h, value: &mut f64| *value += 0.5 * weight2[h] * distance2(c, load(p, h)), x);
        self.add_gradient(x, p, grad);
        PenaltyReport { value, energy: Some(self.energy(x, None)) }
    }

    fn energy(&mut self, x: &[f64], _: Option<&mut [f64]>) -> EnergyReport {
        self.take_images(|node, _| load(x, node));
        EnergyReport { violation: self.set.violation(&self.images), ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let weight2 = &self.weight2;
        let add = |c, h: usize, residual: &mut Residual| {
            let z: [f64; D] = sum(load(p, h), load(u, h));
            residual.gap2 += weight2[h] * distance2(c, z);
            residual.size2 += weight2[h] * distance2(z, [0.0; D]);
        };
        self.total(add, x)
    }

    /// Each node by itself: copies of different nodes meet in the set alone.
    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        for node in 0..self.slots.n_nodes() {
            self.slots.of(node).for_each(|_| visit(&[node as u32]));
        }
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for node in 0..self.slots.n_nodes().min(pattern.n()) {
            values[pattern.diagonal_slot(node)] += self.weight2[self.slots.of(node)].iter().sum::<f64>();
        }
    }

    fn scale(&self) -> Scale {
        Scale { weight2: self.weight2.iter().sum(), ..Scale::default() }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        for (out, w2) in out.chunks_exact_mut(D).zip(&self.weight2) {
            out.fill(*w2);
        }
    }

    fn local_work(&self) -> f64 {
        /// Nanoseconds a number: no prox, but memory.
        const NUMBER: f64 = 2.0;
        NUMBER * self.local_dim() as f64
    }
}

/// a + b
#[inline]
fn sum<const D: usize>(a: [f64; D], b: [f64; D]) -> [f64; D] {
    each(|d| a[d] + b[d])
}
