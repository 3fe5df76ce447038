//! Copies of nodes that have to lie in a set together.

use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, EnergyReport, Hardening, LocalReport, Order, PenaltyReport, Residual, Scale, Term};
use rayon::prelude::*;

/// A set of vectors of copies, known by its projection.
pub trait JointSet: Send + Sync {
    /// v <- the nearest point of the set, in the norm of the weights that the set was made with.
    fn project(&mut self, v: &mut [f64]);

    /// How far v is outside, in units of the set; 0 inside.
    fn violation(&mut self, v: &[f64]) -> f64;
}

/// The indicator of a [`JointSet`] of copies of nodes, D numbers each: z_h = x_node(h), for each of some slots h.
///
/// A slot has a weight w_h^2 of its own; where that is 0 it stands for nothing. Distances are sum_h w_h^2 |.|^2. Weights
/// stay as they are.
pub struct Copies<const D: usize, S> {
    set: S,
    nodes: Vec<u32>,   // of each slot
    offsets: Vec<u32>, // slots of node i: slots[offsets[i]..offsets[i + 1]], in ascending order
    slots: Vec<u32>,
    weight2: Vec<f64>,
    v: Vec<f64>,
}

/// Slots that a task handles.
const CHUNK: usize = 4096;

impl<const D: usize, S: JointSet> Copies<D, S> {
    /// Slots by the node that each is a copy of, out of `n`, and by its squared weight. Slots of nodes that do not exist
    /// count for nothing.
    pub fn new(set: S, n: usize, nodes: Vec<u32>, mut weight2: Vec<f64>) -> Self {
        weight2.resize(nodes.len(), 0.0);
        let mut offsets = vec![0u32; n + 1];
        for node in nodes.iter().filter(|node| (**node as usize) < n) {
            offsets[*node as usize + 1] += 1;
        }
        for i in 0..n {
            offsets[i + 1] += offsets[i];
        }
        let mut next = offsets.clone();
        let mut slots = vec![0u32; offsets[n] as usize];
        for (h, node) in nodes.iter().enumerate().filter(|(_, node)| (**node as usize) < n) {
            slots[next[*node as usize] as usize] = h as u32;
            next[*node as usize] += 1;
        }
        let v = vec![0.0; nodes.len() * D];
        Copies { set, nodes, offsets, slots, weight2, v }
    }

    fn of(x: &[f64], node: u32) -> [f64; D] {
        let mut copy = [0.0; D];
        if let Some(x) = x.get(node as usize * D..(node as usize + 1) * D) {
            copy.copy_from_slice(x);
        }
        copy
    }

    /// grad <- grad + sum_h w_h^2 (x - p_h), node by node.
    fn add_gradient(&self, x: &[f64], p: &[f64], grad: &mut [f64]) {
        let (offsets, slots, weight2) = (&self.offsets, &self.slots, &self.weight2);
        grad.par_chunks_exact_mut(D).with_min_len(CHUNK).enumerate().for_each(|(node, grad)| {
            let Some(range) = offsets.get(node).zip(offsets.get(node + 1)) else { return };
            let x: [f64; D] = Self::of(x, node as u32);
            for h in &slots[*range.0 as usize..*range.1 as usize] {
                let (h, w2) = (*h as usize, weight2[*h as usize]);
                for d in 0..D {
                    grad[d] += w2 * (x[d] - p[h * D + d]);
                }
            }
        });
    }

    fn violation(&mut self, x: &[f64]) -> f64 {
        let nodes = &self.nodes;
        self.v.par_chunks_exact_mut(D).zip(nodes).with_min_len(CHUNK).for_each(|(v, node)| {
            v.copy_from_slice(&Self::of(x, *node));
        });
        self.set.violation(&self.v)
    }
}

/// The sum over the slots' chunks, in their order.
fn total<T: std::ops::AddAssign + Default + Send>(parts: impl IndexedParallelIterator<Item = T>) -> T {
    let mut total = T::default();
    parts.collect::<Vec<T>>().into_iter().for_each(|part| total += part);
    total
}

impl<const D: usize, S: JointSet> Term for Copies<D, S> {
    fn n_elems(&self) -> usize {
        self.nodes.len()
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn local_len(&self) -> usize {
        self.nodes.len() * D
    }

    fn local_dim(&self) -> usize {
        D * self.weight2.iter().filter(|w2| **w2 > 0.0).count()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        let nodes = &self.nodes;
        out.par_chunks_exact_mut(D).zip(nodes).with_min_len(CHUNK).for_each(|(out, node)| {
            out.copy_from_slice(&Self::of(x, *node));
        });
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let (nodes, weight2, over) = (&self.nodes, &self.weight2, cycle.relaxation - 1.0);
        let before = self.v.par_chunks_mut(CHUNK * D).zip(p.par_chunks(CHUNK * D)).zip(u.par_chunks(CHUNK * D));
        before.zip(nodes.par_chunks(CHUNK)).for_each(|(((v, p), u), nodes)| {
            for (h, node) in nodes.iter().enumerate() {
                let c: [f64; D] = Self::of(x, *node);
                for d in 0..D {
                    let i = h * D + d;
                    v[i] = c[d] + u[i] + over * (c[d] - (p[i] + u[i]));
                }
            }
        });
        // u + c(Dx) - z needs v again; z is written over it, and v is put together once more.
        self.set.project(&mut self.v);
        let locals = self.v.par_chunks(CHUNK * D).zip(p.par_chunks_mut(CHUNK * D)).zip(u.par_chunks_mut(CHUNK * D));
        let slots = nodes.par_chunks(CHUNK).zip(weight2.par_chunks(CHUNK));
        let report = total(locals.zip(slots).map(|(((z, p), u), (nodes, weight2))| {
            let mut report = LocalReport::default();
            for (h, (node, w2)) in nodes.iter().zip(weight2).enumerate() {
                let c: [f64; D] = Self::of(x, *node);
                for d in 0..D {
                    let i = h * D + d;
                    let (z, before) = (z[i], p[i] + u[i]);
                    let v = c[d] + u[i] + over * (c[d] - before);
                    report.penalty_before += 0.5 * w2 * (c[d] - p[i]).powi(2);
                    report.moved2 += w2 * (z - before).powi(2);
                    report.gap2_before += w2 * (c[d] - before).powi(2);
                    report.gap2 += w2 * (c[d] - z).powi(2);
                    report.penalty_after += 0.5 * w2 * (v - z).powi(2);
                    if cycle.order == Order::Xzu {
                        u[i] = v - z;
                    }
                    p[i] = z - u[i];
                    report.objective += 0.5 * w2 * (c[d] - p[i]).powi(2);
                }
            }
            report
        }));
        self.add_gradient(x, p, grad);
        report
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let slots = self.nodes.par_chunks(CHUNK).zip(self.weight2.par_chunks(CHUNK));
        let value = total(p.par_chunks(CHUNK * D).zip(slots).map(|(p, (nodes, weight2))| {
            let mut value = 0.0;
            for (h, (node, w2)) in nodes.iter().zip(weight2).enumerate() {
                let c: [f64; D] = Self::of(x, *node);
                value += (0..D).map(|d| 0.5 * w2 * (c[d] - p[h * D + d]).powi(2)).sum::<f64>();
            }
            value
        }));
        self.add_gradient(x, p, grad);
        PenaltyReport { value, energy: Some(self.energy(x, None)) }
    }

    fn energy(&mut self, x: &[f64], _: Option<&mut [f64]>) -> EnergyReport {
        EnergyReport { violation: self.violation(x), ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let mut residual = Residual::default();
        for (h, (node, w2)) in self.nodes.iter().zip(&self.weight2).enumerate() {
            let c: [f64; D] = Self::of(x, *node);
            for d in 0..D {
                let z = p[h * D + d] + u[h * D + d];
                residual.gap2 += w2 * (c[d] - z).powi(2);
                residual.size2 += w2 * z * z;
            }
        }
        residual
    }

    /// Each node by itself: copies of different nodes meet in the set alone.
    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.nodes.iter().for_each(|node| visit(&[*node]));
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for (node, w2) in self.nodes.iter().zip(&self.weight2).filter(|(node, _)| (**node as usize) < pattern.n()) {
            values[pattern.diagonal_slot(*node as usize)] += w2;
        }
    }

    fn add_characteristic_force(&self, _: &mut [f64]) {}

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

    fn propose_weights(&mut self, _: (f64, f64)) -> f64 {
        1.0
    }

    fn harden(&mut self, _: &Hardening, _: &[f64], _: &[f64], _: &[f64]) -> bool {
        false
    }

    fn take_weights(&mut self, _: &mut [f64], _: &mut [f64]) {}
}
