//! The term of fields that have a vector in each face, eight faces at a time.

mod kernels;
#[cfg(test)]
mod tests;

use kernels::{Images, Local, Sweep, Tied};
use proxel_linalg::simd::{LANES, dispatch};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, EnergyReport, LocalReport, PenaltyReport, Residual, Scale, Term, Uncoupled};
use rayon::prelude::*;
use std::ops::AddAssign;

/// Numbers of eight faces: in x, in what slots have one of, and in what they have two of.
const X: usize = 2 * LANES;
const SLOTS: usize = 3 * LANES;
const PAIRS: usize = 6 * LANES;
/// Blocks of eight faces that a task handles.
const CHUNK: usize = 256;

/// Vectors G_f of faces, each in the plane of its face, whose parts along a common edge agree: e . G_f = e . G_f' for the unit
/// vector e of every edge; the indicator of that on copies of G_f for each edge of the face, two numbers each, with squared
/// weights mu A_f. Edges with one face tie nothing, and weigh nothing. An edge may have any number of faces.
///
/// The projection in the norm sum_f A_f |.|^2 takes from each copy along e what it has more than the mean of all copies at
/// that edge, weighted by area. The image of a copy is its part along e.
///
/// A local vector has blocks of eight faces, `[edge of the face][coordinate][face]`, the last one filled up.
pub struct FaceField {
    n: usize,
    direction: Vec<f64>,   // e of each slot, in the frame of its face; in blocks, as local vectors
    other: Vec<u32>,       // where the image is beside which that of a slot counts: that of the other face, or a mean
    foreign: Vec<f64>,     // the share of that image in the mean of the edge
    weight2: Vec<f64>,     // of each slot
    crowded: Vec<Crowded>, // edges with more than two faces, whose means follow the images of the slots
    images: Vec<f64>,
}

/// The slots at an edge, and their shares in its mean.
type Crowded = Vec<(u32, f64)>;

/// The place of the k-th edge of a face among slots.
fn slot(face: usize, k: usize) -> usize {
    (face / LANES) * SLOTS + k * LANES + face % LANES
}

/// The place of a coordinate of its copy in a local vector.
fn place(face: usize, k: usize, d: usize) -> usize {
    (face / LANES) * PAIRS + (2 * k + d) * LANES + face % LANES
}

impl FaceField {
    /// For each face its area, its edges by number, out of `n_edges`, and their unit vectors from the vertex of lower number,
    /// in the frame of the face; and the penalty mu. Edges that do not exist tie nothing.
    pub fn new(n_edges: usize, edges: &[[u32; 3]], directions: &[[[f64; 2]; 3]], area: &[f64], mu: f64) -> Self {
        let n = edges.len().min(directions.len()).min(area.len());
        let blocks = n.div_ceil(LANES);
        let (mut direction, mut foreign) = (vec![0.0; blocks * PAIRS], vec![0.0; blocks * SLOTS]);
        let mut other: Vec<u32> = (0..foreign.len() as u32).collect();
        let mut weight2 = foreign.clone();
        let mut at = vec![Vec::new(); n_edges]; // slots, and areas
        for f in 0..n {
            for k in 0..3 {
                (0..2).for_each(|d| direction[place(f, k, d)] = directions[f][k][d]);
                if let Some(at) = at.get_mut(edges[f][k] as usize) {
                    at.push((slot(f, k) as u32, area[f]));
                }
            }
        }
        let mut crowded = Vec::new();
        for mut slots in at {
            if slots.len() < 2 {
                continue;
            }
            let total: f64 = slots.iter().map(|(_, area)| area).sum();
            slots.iter().for_each(|(h, area)| weight2[*h as usize] = mu * area);
            slots.iter_mut().for_each(|(_, part)| *part /= total);
            if let [(a, of_a), (b, of_b)] = slots[..] {
                (other[a as usize], foreign[a as usize]) = (b, of_b);
                (other[b as usize], foreign[b as usize]) = (a, of_a);
            } else {
                let mean = (foreign.len() + crowded.len()) as u32;
                slots.iter().for_each(|(h, _)| (other[*h as usize], foreign[*h as usize]) = (mean, 1.0));
                crowded.push(slots);
            }
        }
        let images = vec![0.0; foreign.len() + crowded.len()];
        FaceField { n, direction, other, foreign, weight2, crowded, images }
    }

    /// What a task needs to know of its slots.
    fn tied(&self, task: usize) -> Tied<'_> {
        let slots = task * CHUNK * SLOTS..((task + 1) * CHUNK * SLOTS).min(self.foreign.len());
        Tied {
            direction: &self.direction[2 * slots.start..2 * slots.end],
            other: &self.other[slots.clone()],
            foreign: &self.foreign[slots.clone()],
            weight2: &self.weight2[slots.clone()],
            before: slots.start,
            images: &self.images,
        }
    }

    /// The images of the copies x + u, or of x.
    fn take_images(&mut self, x: &[f64], u: Option<&[f64]>) {
        let (images, means) = self.images.split_at_mut(self.foreign.len());
        let direction = self.direction.par_chunks(CHUNK * PAIRS);
        let tasks = images.par_chunks_mut(CHUNK * SLOTS).zip(direction).zip(x.par_chunks(CHUNK * X)).enumerate();
        tasks.for_each(|(task, ((images, direction), x))| {
            let from = task * CHUNK * PAIRS;
            let u = u.map(|u| &u[from..from + direction.len()]);
            dispatch(Images { x, u, direction, images });
        });
        for (mean, slots) in means.iter_mut().zip(&self.crowded) {
            *mean = slots.iter().map(|(h, share)| share * images[*h as usize]).sum();
        }
    }

    /// The sum over the faces of a function of them, in a fixed order.
    fn total<R: AddAssign + Default + Send>(&self, f: impl Fn(usize, &mut R) + Sync) -> R {
        let starts = (0..self.n).into_par_iter().step_by(CHUNK * LANES);
        let parts: Vec<R> = starts
            .map(|from| {
                let mut part = R::default();
                (from..(from + CHUNK * LANES).min(self.n)).for_each(|face| f(face, &mut part));
                part
            })
            .collect();
        let mut sum = R::default();
        parts.into_iter().for_each(|part| sum += part);
        sum
    }

    /// The sum over the copies of w^2 a(face, place), where they weigh anything.
    fn weighed(&self, a: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
        self.total(|face, sum: &mut f64| {
            for k in 0..3 {
                let w2 = self.weight2[slot(face, k)];
                (0..2).for_each(|d| *sum += w2 * a(2 * face + d, place(face, k, d)));
            }
        })
    }
}

impl Term for FaceField {
    fn n_elems(&self) -> usize {
        3 * self.n
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn local_len(&self) -> usize {
        self.direction.len()
    }

    fn local_dim(&self) -> usize {
        2 * self.weight2.iter().filter(|w2| **w2 > 0.0).count()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        out.par_chunks_mut(PAIRS).zip(x.par_chunks(X)).with_min_len(CHUNK).for_each(|(out, x)| {
            for (face, x) in x.chunks_exact(2).enumerate() {
                (0..3).for_each(|k| (0..2).for_each(|d| out[place(face, k, d)] = x[d]));
            }
        });
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        if cycle.relaxation != 1.0 {
            let over = cycle.relaxation - 1.0;
            let locals = p.par_chunks(PAIRS).zip(u.par_chunks_mut(PAIRS)).zip(x.par_chunks(X));
            locals.with_min_len(CHUNK).for_each(|((p, u), x)| {
                for (face, x) in x.chunks_exact(2).enumerate() {
                    for (at, x) in (0..3).flat_map(|k| (0..2).map(move |d| (place(face, k, d), x[d]))) {
                        u[at] += over * (x - (p[at] + u[at]));
                    }
                }
            });
        }
        self.take_images(x, Some(u));
        let this = &*self;
        let locals = p.par_chunks_mut(CHUNK * PAIRS).zip(u.par_chunks_mut(CHUNK * PAIRS));
        let nodes = x.par_chunks(CHUNK * X).zip(grad.par_chunks_mut(CHUNK * X));
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

    /// Two passes: images first; then, face by face, z, x and u, since nothing else ties faces to each other.
    fn sweep(&mut self, own: &Uncoupled, x: &mut [f64], p: &mut [f64], u: &mut [f64]) -> bool {
        if own.diagonal.len() != self.n || own.target.len() != x.len() || x.len() != 2 * self.n {
            return false;
        }
        self.take_images(x, Some(u));
        let this = &*self;
        let of_faces = own.diagonal.par_chunks(CHUNK * LANES).zip(own.stiffness.par_chunks(CHUNK * LANES));
        let own = of_faces.zip(own.target.par_chunks(CHUNK * X));
        let locals = p.par_chunks_mut(CHUNK * PAIRS).zip(u.par_chunks_mut(CHUNK * PAIRS));
        let tasks = locals.zip(x.par_chunks_mut(CHUNK * X)).zip(own).enumerate();
        tasks.for_each(|(task, (((p, u), x), ((diagonal, stiffness), target)))| {
            dispatch(Sweep { x, p, u, diagonal, stiffness, target, tied: this.tied(task) });
        });
        true
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        grad.par_chunks_exact_mut(2).with_min_len(CHUNK * LANES).enumerate().for_each(|(face, grad)| {
            for k in 0..3 {
                let w2 = self.weight2[slot(face, k)];
                (0..2).for_each(|d| grad[d] = w2.mul_add(x[2 * face + d] - p[place(face, k, d)], grad[d]));
            }
        });
        let value = 0.5 * self.weighed(|i, at| (x[i] - p[at]).powi(2));
        PenaltyReport { value, energy: Some(self.energy(x, None)) }
    }

    /// The violation is the largest difference along an edge from its mean.
    fn energy(&mut self, x: &[f64], _: Option<&mut [f64]>) -> EnergyReport {
        self.take_images(x, None);
        let excess = |h: usize| (self.foreign[h] * (self.images[h] - self.images[self.other[h] as usize])).abs();
        let worst = |a: f64, b: f64| if b <= a { a } else { b };
        let slots = (0..self.foreign.len()).into_par_iter().with_min_len(CHUNK * SLOTS);
        EnergyReport { violation: slots.map(excess).reduce(|| 0.0, worst), ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        Residual {
            gap2: self.weighed(|i, at| (x[i] - (p[at] + u[at])).powi(2)),
            size2: self.weighed(|_, at| (p[at] + u[at]).powi(2)),
        }
    }

    /// Each face by itself: copies of different faces meet in the set alone.
    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        (0..self.n as u32).for_each(|face| visit(&[face]));
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for face in 0..self.n.min(pattern.n()) {
            values[pattern.diagonal_slot(face)] += (0..3).map(|k| self.weight2[slot(face, k)]).sum::<f64>();
        }
    }

    fn scale(&self) -> Scale {
        Scale { weight2: self.weight2.iter().sum(), ..Scale::default() }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        for (out, w2) in out.chunks_exact_mut(2 * LANES).zip(self.weight2.chunks_exact(LANES)) {
            let (first, second) = out.split_at_mut(LANES);
            first.copy_from_slice(w2);
            second.copy_from_slice(w2);
        }
    }

    fn local_work(&self) -> f64 {
        /// Nanoseconds a number: no prox, but memory.
        const NUMBER: f64 = 0.7;
        NUMBER * self.local_dim() as f64
    }
}
