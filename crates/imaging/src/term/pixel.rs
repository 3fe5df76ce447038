//! Functions of the pixels of a field.

use super::pass::{Sums, begin};
use crate::{Grid, Pointwise};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, DualMap, EnergyReport, LocalReport, PenaltyReport, Residual, Scale, Term, Weight, vector};
use rayon::prelude::*;

/// g(x) over the nodes of a field: D is the identity on them. Data terms, and sets. Local vectors are laid out as the field
/// is; [`Pointwise`] sees one plane a channel.
pub struct PixelTerm<P> {
    grid: Grid,
    first: usize, // node of pixel 0
    of: P,
    weight: Weight,
    parts: Vec<LocalReport>, // of each task
    scratch: Vec<Vec<f64>>,  // of each task: v
}

impl<P: Pointwise> PixelTerm<P> {
    /// Of the field whose nodes begin at `first`, with the penalty w^2 = `weight2` > 0.
    pub fn new(grid: Grid, first: usize, of: P, weight2: f64) -> Self {
        let tasks = grid.height.div_ceil(grid.task_rows());
        PixelTerm {
            grid,
            first,
            of,
            weight: Weight::new(weight2),
            parts: vec![LocalReport::default(); tasks],
            scratch: (0..tasks).map(|_| vec![0.0; grid.row_len()]).collect(),
        }
    }

    fn nodes(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.grid.len()
    }

    fn pixels(&self, row: usize) -> std::ops::Range<usize> {
        row * self.grid.width..(row + 1) * self.grid.width
    }

    fn sweep(
        &mut self,
        cycle: &Cycle,
        x: &[f64],
        p: &mut [f64],
        u: &mut [f64],
        pull: Option<&mut [f64]>,
    ) -> LocalReport {
        let (row_len, rows) = (self.grid.row_len(), self.grid.task_rows());
        let (mut parts, mut scratch) = (std::mem::take(&mut self.parts), std::mem::take(&mut self.scratch));
        let this = &*self;
        let size = rows * row_len;
        let tasks = p.par_chunks_mut(size).zip(u.par_chunks_mut(size)).zip(x[this.nodes()].par_chunks(size));
        tasks.zip(parts.par_iter_mut()).zip(scratch.par_iter_mut()).enumerate().for_each(
            |(t, ((((p, u), x), part), v))| {
                let (mut report, mut sums) = (LocalReport::default(), Sums::default());
                let all = p.chunks_mut(row_len).zip(u.chunks_mut(row_len)).zip(x.chunks(row_len));
                for (k, ((p, u), c)) in all.enumerate() {
                    begin(cycle.relaxation, c, p, u, v);
                    report.value_after += this.of.prox(this.pixels(t * rows + k), v, this.weight.squared);
                    sums.end(cycle.order, c, v, p, u);
                }
                *part = sums.report(this.weight.squared, report);
            },
        );
        if let Some(pull) = pull {
            let pull = pull[this.nodes()].par_iter_mut().zip(&*p).with_min_len(size);
            pull.for_each(|(pull, p)| *pull -= this.weight.squared * p);
        }
        let mut report = LocalReport::default();
        parts.iter().for_each(|part| report += *part);
        (self.parts, self.scratch) = (parts, scratch);
        report
    }

    fn sum_rows(&self, values: &[f64], of: impl Fn(std::ops::Range<usize>, &[f64]) -> f64 + Sync) -> f64 {
        let rows = values.par_chunks(self.grid.row_len()).enumerate();
        let sums: Vec<f64> = rows.map(|(row, values)| of(self.pixels(row), values)).collect();
        sums.iter().sum()
    }
}

impl<P: Pointwise> Term for PixelTerm<P> {
    fn n_elems(&self) -> usize {
        self.grid.n_pixels()
    }

    fn is_hard(&self) -> bool {
        self.of.is_hard()
    }

    fn local_len(&self) -> usize {
        self.grid.len()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&x[self.nodes()]);
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let c = x[self.nodes()].to_vec();
        let alpha = cycle.relaxation;
        let z: Vec<f64> = p.iter().zip(u.iter()).map(|(p, u)| p + u).collect();
        let v: Vec<f64> = c.iter().zip(u.iter()).zip(&z).map(|((c, u), z)| c + u + (alpha - 1.0) * (c - z)).collect();
        let square = |of: &mut dyn Iterator<Item = f64>| 0.5 * self.weight.squared * of.map(|v| v * v).sum::<f64>();
        let penalty_before = square(&mut v.iter().zip(&z).map(|(v, z)| v - z));
        let value_before = self.sum_rows(&z, |pixels, z| self.of.value(pixels, z));
        let report = self.sweep(cycle, x, p, u, None);
        let mut after = v.iter().zip(p.iter().zip(u.iter())).map(|(v, (p, u))| v - (p + u));
        let penalty_after = 0.5 * self.weight.squared * after.by_ref().map(|v| v * v).sum::<f64>();
        let objective = self.penalty(x, p, grad).value;
        LocalReport { value_before, penalty_before, penalty_after, objective, ..report }
    }

    fn pull_step(
        &mut self,
        cycle: &Cycle,
        x: &[f64],
        p: &mut [f64],
        u: &mut [f64],
        pull: &mut [f64],
        begins: bool,
    ) -> LocalReport {
        if begins {
            pull.fill(0.0);
        }
        self.sweep(cycle, x, p, u, Some(pull))
    }

    fn local_work(&self) -> f64 {
        /// Nanoseconds a number.
        const NUMBER: f64 = 2.0;
        NUMBER * self.local_len() as f64
    }

    fn dual_map(&self) -> DualMap {
        self.of.dual_map()
    }

    fn dual(&mut self, z: &[f64], u: &mut [f64]) {
        if self.of.dual_map() != DualMap::None {
            u.copy_from_slice(z);
            u.par_chunks_mut(self.grid.row_len()).enumerate().for_each(|(row, u)| {
                self.of.gradient(self.pixels(row), u);
                u.iter_mut().for_each(|u| *u /= self.weight.squared);
            });
        }
    }

    fn local_value(&self, z: &[f64]) -> Option<f64> {
        Some(self.sum_rows(z, |pixels, z| self.of.value(pixels, z)))
    }

    fn gauge(&self, forces: &[f64]) -> Option<f64> {
        let rows = forces.par_chunks(self.grid.row_len()).enumerate();
        let gauges: Option<Vec<f64>> = rows.map(|(row, q)| self.of.gauge(self.pixels(row), q)).collect();
        Some(gauges?.into_iter().fold(0.0, f64::max))
    }

    fn conjugate(&self, forces: &[f64]) -> Option<f64> {
        let rows = forces.par_chunks(self.grid.row_len()).enumerate();
        let values: Option<Vec<f64>> = rows.map(|(row, q)| self.of.conjugate(self.pixels(row), q)).collect();
        Some(values?.iter().sum())
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let gap: Vec<f64> = x[self.nodes()].iter().zip(p).map(|(x, p)| x - p).collect();
        vector::add_scaled(&mut grad[self.nodes()], self.weight.squared, &gap);
        PenaltyReport { value: 0.5 * self.weight.squared * vector::dot(&gap, &gap), energy: None }
    }

    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        let values = &x[self.nodes()];
        if let Some(grad) = grad {
            let mut slopes = values.to_vec();
            let rows = slopes.par_chunks_mut(self.grid.row_len()).enumerate();
            rows.for_each(|(row, z)| self.of.gradient(self.pixels(row), z));
            vector::add_scaled(&mut grad[self.nodes()], 1.0, &slopes);
        }
        let rows = values.chunks(self.grid.row_len()).enumerate();
        let violation = rows.map(|(row, z)| self.of.violation(self.pixels(row), z)).fold(0.0, f64::max);
        let value = self.sum_rows(values, |pixels, z| self.of.value(pixels, z));
        EnergyReport { value, violation, ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let z: Vec<f64> = p.iter().zip(u).map(|(p, u)| p + u).collect();
        let gap: Vec<f64> = x[self.nodes()].iter().zip(&z).map(|(x, z)| x - z).collect();
        Residual {
            gap2: self.weight.squared * vector::dot(&gap, &gap),
            size2: self.weight.squared * vector::dot(&z, &z),
        }
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.nodes().for_each(|node| visit(&[node as u32]));
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for node in self.nodes().take_while(|node| *node < pattern.n()) {
            values[pattern.diagonal_slot(node)] += self.weight.squared;
        }
    }

    fn add_characteristic_force(&self, size: &mut [f64]) {
        let nodes = self.first.min(size.len())..(self.first + self.grid.len()).min(size.len());
        size[nodes].iter_mut().for_each(|size| *size += self.of.force());
    }

    fn scale(&self) -> Scale {
        let measure = self.grid.n_pixels() as f64;
        Scale { measure, weight2: self.weight.squared * measure, energy: 0.5 * self.of.force() * measure, hessian: 1.0 }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        out.fill(self.weight.squared);
    }

    fn propose_weights(&mut self, range: (f64, f64)) -> f64 {
        self.weight.propose(range)
    }

    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        self.weight.take(p, u);
    }
}
