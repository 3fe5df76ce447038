//! Cells as a term of the splitting.

use super::cells::CHUNK;
use super::gather::{Gather, add_normal};
use super::{Cells, Hint, Reduction, Set, V3, dot, sub};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, EnergyReport, LocalReport, Order, PenaltyReport, Residual, Scale, Term, Weight};
use rayon::prelude::*;
use std::sync::Arc;

/// Whether sets hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// They do: z is in the set, and Dx = z. The number is mu = w^2 of A(29), which steers the iteration, not its end.
    Hard(f64),
    /// As far as the weight w of w/2 dist(Dx, C)^2 makes them. z is the point nearest to Dx; there is no dual. In the
    /// x-step z is held, which bounds the distance from above: Bouaziz et al. 2012.
    Soft(f64),
    /// The same w/2 dist(z, C)^2, split off with a dual: z lies between Dx + u and the point of the set nearest to it,
    /// at w/(w + mu) of the way. What methods need that have no variable besides (z, u): Ouyang et al. 2020.
    Split {
        /// w
        weight: f64,
        /// mu
        mu: f64,
    },
}

/// A [`Term`] over [`Cells`]: one virtual call a batch, static inside. Local vectors are rows of three, element by
/// element.
pub struct Batch<R, S> {
    cells: Arc<Cells<R, S>>,
    hold: Hold,
    value: f64,     // sum g(z) of the last local step, where sets are soft and split off
    weight: Weight, // mu, or that of a soft set
    gather: Gather,
    nearest: Vec<V3>, // where sets are soft: the nearest points to `at`
    at: Vec<V3>,      // Dx that they are nearest to: a pass at the same x does not ask again
    forces: Vec<V3>,  // scratch: a corner each
    hints: Vec<Hint>, // of sets that search, an element each
}

impl<R: Reduction, S: Set> Batch<R, S> {
    /// Of cells that are kept elsewhere too.
    pub fn new(cells: Arc<Cells<R, S>>, hold: Hold) -> Self {
        let weight = match hold {
            Hold::Hard(mu) | Hold::Split { mu, .. } => mu,
            Hold::Soft(w) => w,
        };
        let local = cells.len() * cells.rows;
        let soft = if matches!(hold, Hold::Hard(_)) { 0 } else { local };
        Batch {
            gather: Gather::new(&cells.nodes),
            nearest: vec![[0.0; 3]; soft],
            at: vec![[f64::NAN; 3]; soft],
            forces: vec![[0.0; 3]; cells.nodes.len()],
            hints: if cells.set.takes_hints() { vec![Hint::default(); cells.len()] } else { Vec::new() },
            hold,
            value: 0.0,
            weight: Weight::new(weight),
            cells,
        }
    }

    fn is_soft(&self) -> bool {
        matches!(self.hold, Hold::Soft(_))
    }

    /// w of g(z) = w/2 dist(z, C)^2, where z has a dual: none for a hard set.
    fn split_weight(&self) -> Option<f64> {
        match self.hold {
            Hold::Split { weight, .. } => Some(weight),
            _ => None,
        }
    }

    /// Adds the forces of all corners to their nodes.
    fn gather(&self, grad: &mut [f64]) {
        self.gather.add(&self.forces, grad.as_chunks_mut::<3>().0);
    }

    /// The points nearest to Dx, where that has changed.
    fn follow(&mut self, x: &[f64]) {
        let cells = &*self.cells;
        let rows = cells.rows;
        let x = x.as_chunks::<3>().0;
        let numbers = self.nearest.par_chunks_mut(CHUNK * rows).zip(self.at.par_chunks_mut(CHUNK * rows));
        let hints = hints_by_chunk(&mut self.hints, cells.len());
        numbers.zip(hints).enumerate().for_each(|(chunk, ((z, at), hints))| {
            let mut c = vec![[0.0; 3]; rows];
            for (k, (z, at)) in z.chunks_exact_mut(rows).zip(at.chunks_exact_mut(rows)).enumerate() {
                let e = chunk * CHUNK + k;
                R::reduce(x, cells.element(e), &mut c);
                if c != at {
                    at.copy_from_slice(&c);
                    z.copy_from_slice(&c);
                    nearest(&cells.set, e, z, hints.get_mut(k));
                }
            }
        });
    }

    /// v = Dx + u, z <- P(v); in the x-z-u order u <- v - z; p <- z - u; forces <- w^2 D^T (Dx - p).
    fn split(&mut self, cycle: &Cycle, x: &[f64], p: &mut [V3], u: &mut [V3]) -> LocalReport {
        let (cells, w2) = (&*self.cells, self.weight.squared);
        let (rows, corners) = (cells.rows, cells.corners);
        let x = x.as_chunks::<3>().0;
        let updates_dual = cycle.order == Order::Xzu;
        let weight = self.split_weight();
        // z = v + part (P(v) - v): P(v) is the point nearest to all of the way.
        let part = weight.map_or(1.0, |w| w / (w + w2));
        let state = p.par_chunks_mut(CHUNK * rows).zip(u.par_chunks_mut(CHUNK * rows));
        let forces = self.forces.par_chunks_mut(CHUNK * corners);
        let hints = hints_by_chunk(&mut self.hints, cells.len());
        let chunks = forces.zip(state).zip(hints).enumerate().map(|(chunk, ((forces, (p, u)), hints))| {
            let mut report = LocalReport::default();
            let mut z = vec![[0.0; 3]; rows];
            let state = p.chunks_exact_mut(rows).zip(u.chunks_exact_mut(rows));
            for (k, (f, (p, u))) in forces.chunks_exact_mut(corners).zip(state).enumerate() {
                let e = chunk * CHUNK + k;
                R::reduce(x, cells.element(e), &mut f[..rows]);
                // While z is sought p holds the z of before, and u holds v where it is to become v - z.
                for r in 0..rows {
                    for d in 0..3 {
                        let (c, before) = (f[r][d], p[r][d] + u[r][d]);
                        report.penalty_before += 0.5 * w2 * (c - p[r][d]).powi(2);
                        report.gap2_before += w2 * (c - before).powi(2);
                        z[r][d] = c + u[r][d] + (cycle.relaxation - 1.0) * (c - before);
                        p[r][d] = before;
                        u[r][d] = if updates_dual { z[r][d] } else { u[r][d] };
                    }
                }
                nearest(&cells.set, e, &mut z, hints.get_mut(k));
                for r in 0..rows {
                    for d in 0..3 {
                        let c = f[r][d];
                        let v = if updates_dual { u[r][d] } else { c + u[r][d] };
                        let nearest = z[r][d];
                        let z = if part < 1.0 { v + part * (nearest - v) } else { nearest };
                        report.value_after += weight.map_or(0.0, |w| 0.5 * w * (z - nearest).powi(2));
                        report.moved2 += w2 * (z - p[r][d]).powi(2);
                        report.gap2 += w2 * (c - z).powi(2);
                        report.penalty_after += 0.5 * w2 * (v - z).powi(2);
                        u[r][d] = if updates_dual { v - z } else { u[r][d] };
                        p[r][d] = z - u[r][d];
                        report.objective += 0.5 * w2 * (c - p[r][d]).powi(2);
                        f[r][d] = w2 * (c - p[r][d]);
                    }
                }
                f[rows..].fill([0.0; 3]);
                R::spread(f);
            }
            report
        });
        let reports: Vec<LocalReport> = chunks.collect();
        let mut total = LocalReport::default();
        reports.into_iter().for_each(|report| total += report);
        total
    }

    /// 1/2 w^2 |Dx - p|^2; forces <- w^2 D^T (Dx - p).
    fn aim(&mut self, x: &[f64], p: &[V3]) -> f64 {
        let (cells, w2) = (&*self.cells, self.weight.squared);
        let (rows, corners) = (cells.rows, cells.corners);
        let x = x.as_chunks::<3>().0;
        let numbers = self.forces.par_chunks_mut(CHUNK * corners).zip(p.par_chunks(CHUNK * rows)).enumerate();
        let values: Vec<f64> = numbers
            .map(|(chunk, (forces, p))| {
                let mut value = 0.0;
                for (k, (f, p)) in forces.chunks_exact_mut(corners).zip(p.chunks_exact(rows)).enumerate() {
                    R::reduce(x, cells.element(chunk * CHUNK + k), &mut f[..rows]);
                    for (f, p) in f.iter_mut().zip(p) {
                        let gap = sub(*f, *p);
                        value += 0.5 * w2 * dot(gap, gap);
                        *f = gap.map(|c| w2 * c);
                    }
                    f[rows..].fill([0.0; 3]);
                    R::spread(f);
                }
                value
            })
            .collect();
        values.into_iter().sum()
    }

    /// The same toward the nearest points.
    fn aim_at_nearest(&mut self, x: &[f64]) -> f64 {
        self.follow(x);
        let nearest = std::mem::take(&mut self.nearest);
        let value = self.aim(x, &nearest);
        self.nearest = nearest;
        value
    }
}

/// The hints of the elements of each chunk; none where there are none.
fn hints_by_chunk(hints: &mut [Hint], n: usize) -> impl IndexedParallelIterator<Item = &mut [Hint]> {
    let mut parts: Vec<&mut [Hint]> = hints.chunks_mut(CHUNK).collect();
    parts.resize_with(n.div_ceil(CHUNK), || &mut []);
    parts.into_par_iter()
}

fn nearest(set: &impl Set, e: usize, z: &mut [V3], hint: Option<&mut Hint>) {
    match hint {
        Some(hint) => set.project_from(e, z, hint),
        None => set.project(e, z),
    }
}

impl<R: Reduction, S: Set> Term for Batch<R, S> {
    fn n_elems(&self) -> usize {
        self.cells.len()
    }

    fn is_hard(&self) -> bool {
        matches!(self.hold, Hold::Hard(_))
    }

    fn local_len(&self) -> usize {
        3 * self.cells.len() * self.cells.rows
    }

    fn local_dim(&self) -> usize {
        if self.is_soft() { 0 } else { self.local_len() }
    }

    fn has_dual(&self) -> bool {
        !self.is_soft()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        let cells = &*self.cells;
        let x = x.as_chunks::<3>().0;
        out.as_chunks_mut::<3>().0.par_chunks_mut(CHUNK * cells.rows).enumerate().for_each(|(chunk, out)| {
            for (k, out) in out.chunks_exact_mut(cells.rows).enumerate() {
                R::reduce(x, cells.element(chunk * CHUNK + k), out);
            }
        });
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let report = if self.is_soft() {
            let objective = self.aim_at_nearest(x);
            p.copy_from_slice(self.nearest.as_flattened());
            u.fill(0.0);
            // What it is worth; penalties and residuals are those of split variables.
            LocalReport { value_after: objective, objective, ..LocalReport::default() }
        } else {
            let report = self.split(cycle, x, p.as_chunks_mut::<3>().0, u.as_chunks_mut::<3>().0);
            LocalReport { value_before: self.value, ..report }
        };
        self.value = if self.is_soft() { 0.0 } else { report.value_after };
        self.gather(grad);
        report
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let value = self.aim(x, p.as_chunks::<3>().0);
        self.gather(grad);
        PenaltyReport { value, energy: None }
    }

    /// Soft: sum w/2 dist^2, with its gradient w D^T (Dx - nearest). Hard: 0, and the largest violation.
    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        if matches!(self.hold, Hold::Hard(_)) {
            let violation = self.cells.violation(x.as_chunks::<3>().0);
            return EnergyReport { violation, ..EnergyReport::default() };
        }
        let value = match self.split_weight() {
            Some(weight) => {
                // z is scratch of local steps, and mu no part of the objective.
                self.at.fill([f64::NAN; 3]);
                let mu = std::mem::replace(&mut self.weight.squared, weight);
                let value = self.aim_at_nearest(x);
                self.weight.squared = mu;
                value
            }
            None => self.aim_at_nearest(x),
        };
        if let Some(grad) = grad {
            self.gather(grad);
        }
        EnergyReport { value, ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        if self.is_soft() {
            return Residual::default();
        }
        let (cells, w2, x) = (&*self.cells, self.weight.squared, x.as_chunks::<3>().0);
        let len = 3 * cells.rows;
        let state = p.par_chunks(CHUNK * len).zip(u.par_chunks(CHUNK * len)).enumerate();
        let parts: Vec<Residual> = state
            .map(|(chunk, (p, u))| {
                let (mut part, mut c) = (Residual::default(), vec![[0.0; 3]; cells.rows]);
                for (k, (p, u)) in p.chunks_exact(len).zip(u.chunks_exact(len)).enumerate() {
                    R::reduce(x, cells.element(chunk * CHUNK + k), &mut c);
                    for (c, (p, u)) in c.as_flattened().iter().zip(p.iter().zip(u)) {
                        let z = p + u;
                        part.gap2 += w2 * (c - z).powi(2);
                        part.size2 += w2 * z * z;
                    }
                }
                part
            })
            .collect();
        let mut residual = Residual::default();
        parts.into_iter().for_each(|part| residual += part);
        residual
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.cells.nodes.chunks_exact(self.cells.corners).for_each(visit);
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        add_normal::<R>(&self.cells.nodes, self.cells.corners, self.weight.squared, pattern, values);
    }

    fn scale(&self) -> Scale {
        Scale { weight2: self.weight.squared * self.cells.len() as f64, ..Scale::default() }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        out.fill(if self.is_soft() { 0.0 } else { self.weight.squared });
    }

    /// That of a soft set is part of the objective.
    fn propose_weights(&mut self, range: (f64, f64)) -> f64 {
        if self.is_soft() { 1.0 } else { self.weight.propose(range) }
    }

    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        if !self.is_soft() {
            self.weight.take(p, u);
        }
    }
}
