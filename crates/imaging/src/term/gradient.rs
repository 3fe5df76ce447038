//! The gradient of an image, and functions of it.

use super::differences::{Differences, rows};
use super::pairs::Row;
use super::pass::{Sums, begin};
use crate::{Boundary, Grid, Pointwise};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{
    Cycle, DualMap, EnergyReport, Folded, LocalReport, PenaltyReport, Residual, Scale, Term, Weight, vector,
};
use rayon::prelude::*;

/// g(grad x): D takes forward differences ([`Differences`]), in planes as [`Pointwise`] takes them. One weight w^2 for all
/// pixels, the penalty mu of A.
///
/// Memory: `pull_step` reads x once, reads and writes p and u once, and writes the pull: 80 bytes a pixel and channel. Where
/// pairs of differences shrink it is [`Folded`]: 48 bytes.
pub struct GradientTerm<P> {
    pub(super) of_field: Differences,
    first: usize, // node of pixel 0
    pub(super) of: P,
    weight: Weight,
    scratch: Vec<Vec<f64>>,  // of each task: c, v; or p of two rows and a row of the pull
    parts: Vec<LocalReport>, // of each task
}

impl<P: Pointwise> GradientTerm<P> {
    /// Of the field whose nodes begin at `first`, with the penalty w^2 = `weight2` > 0.
    pub fn new(grid: Grid, boundary: Boundary, first: usize, of: P, weight2: f64) -> Self {
        let tasks = grid.height.div_ceil(grid.task_rows());
        GradientTerm {
            of_field: Differences { grid, boundary },
            first,
            of,
            weight: Weight::new(weight2),
            scratch: (0..tasks).map(|_| vec![0.0; 5 * grid.row_len()]).collect(),
            parts: vec![LocalReport::default(); tasks],
        }
    }

    /// Its function.
    pub fn of(&self) -> &P {
        &self.of
    }

    /// w^2
    pub fn weight2(&self) -> f64 {
        self.weight.squared
    }

    /// Numbers of a row's part of a local vector.
    pub(super) fn local_row(&self) -> usize {
        self.of_field.local_row()
    }

    pub(super) fn nodes(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.of_field.grid.len()
    }

    pub(super) fn field<'x>(&self, x: &'x [f64]) -> &'x [f64] {
        &x[self.nodes()]
    }

    /// Scratch and reports of tasks, to be given back.
    pub(super) fn take_room(&mut self) -> (Vec<Vec<f64>>, Vec<LocalReport>) {
        (std::mem::take(&mut self.scratch), std::mem::take(&mut self.parts))
    }

    pub(super) fn give_room(&mut self, scratch: Vec<Vec<f64>>, parts: Vec<LocalReport>) {
        (self.scratch, self.parts) = (scratch, parts);
    }

    /// The local step of a cycle; with `pull`, z, u and the pull -D^T W^2 p in one pass, set or added as it is said there.
    fn sweep(
        &mut self,
        cycle: &Cycle,
        x: &[f64],
        p: &mut [f64],
        u: &mut [f64],
        pull: Option<(&mut [f64], bool)>,
    ) -> LocalReport {
        let (grid, local) = (self.of_field.grid, self.local_row());
        let (task, row_len) = (grid.task_rows(), grid.row_len());
        let (mut scratch, mut parts) = self.take_room();
        let field = self.field(x);
        let this = &*self;
        let tasks = p.par_chunks_mut(task * local).zip(u.par_chunks_mut(task * local));
        let tasks = tasks.zip(scratch.par_iter_mut()).zip(parts.par_iter_mut()).enumerate();
        match pull {
            None => tasks.for_each(|(t, (((p, u), scratch), part))| {
                *part = this.rows_of_task(cycle, field, t * task, p, u, scratch, None);
            }),
            Some((pull, begins)) => {
                if begins {
                    pull[..this.first].fill(0.0);
                    pull[this.first + grid.len()..].fill(0.0);
                }
                let pull = &mut pull[this.first..this.first + grid.len()];
                tasks.zip(pull.par_chunks_mut(task * row_len)).for_each(|((t, (((p, u), scratch), part)), pull)| {
                    *part = this.rows_of_task(cycle, field, t * task, p, u, scratch, Some((pull, begins)));
                });
                // The first row of a task hangs on the last one of another.
                let p = &*p;
                pull.par_chunks_mut(task * row_len).enumerate().for_each(|(t, pull)| {
                    let row = t * task;
                    let (here, above) = (rows(p, local, row), this.of_field.above(p, row));
                    this.of_field.gather(
                        -this.weight.squared,
                        here,
                        above,
                        row + 1 == grid.height,
                        &mut pull[..row_len],
                        begins,
                    );
                });
            }
        }
        let mut report = LocalReport::default();
        parts.iter().for_each(|part| report += *part);
        self.give_room(scratch, parts);
        report
    }

    /// Rows from `first` on; the pull of the first of them is left to the caller.
    fn rows_of_task(
        &self,
        cycle: &Cycle,
        field: &[f64],
        first: usize,
        p: &mut [f64],
        u: &mut [f64],
        scratch: &mut [f64],
        mut pull: Option<(&mut [f64], bool)>,
    ) -> LocalReport {
        let (grid, local) = (self.of_field.grid, self.local_row());
        let (c, v) = scratch[..2 * local].split_at_mut(local);
        let (mut report, mut sums) = (LocalReport::default(), Sums::default());
        for k in 0..p.len() / local {
            let row = first + k;
            let at = k * local..(k + 1) * local;
            let (p_row, u_row) = (&mut p[at.clone()], &mut u[at.clone()]);
            report.value_after += match self.of.shrinks_pairs(self.pixels(row), 2 * grid.channels) {
                Some(counted) => {
                    let (force, threshold) = (self.of.force(), self.of.force() / self.weight.squared);
                    let row = Row { of_field: &self.of_field, field, row, counted, threshold };
                    force * row.shrink(cycle, p_row, u_row, &mut sums)
                }
                None => {
                    self.of_field.row(field, row, c);
                    begin(cycle.relaxation, c, p_row, u_row, v);
                    let value = self.of.prox(self.pixels(row), v, self.weight.squared);
                    sums.end(cycle.order, c, v, p_row, u_row);
                    value
                }
            };
            if let (Some((pull, begins)), 1..) = (&mut pull, k) {
                let out = &mut pull[k * grid.row_len()..(k + 1) * grid.row_len()];
                let above = &p[at.start - local..at.start];
                self.of_field.gather(-self.weight.squared, &p[at], Some(above), row + 1 == grid.height, out, *begins);
            }
        }
        sums.report(self.weight.squared, report)
    }

    /// Sums a function over rows, in the order of rows.
    fn sum_rows<R: Send + Default + std::ops::AddAssign>(
        &self,
        x: &[f64],
        of: impl Fn(usize, &mut [f64]) -> R + Sync,
    ) -> R {
        let (grid, field) = (self.of_field.grid, self.field(x));
        let tasks: Vec<R> = (0..self.scratch.len())
            .into_par_iter()
            .map(|t| {
                let mut c = vec![0.0; self.local_row()];
                let mut sum = R::default();
                for row in t * grid.task_rows()..((t + 1) * grid.task_rows()).min(grid.height) {
                    self.of_field.row(field, row, &mut c);
                    sum += of(row, &mut c);
                }
                sum
            })
            .collect();
        tasks.into_iter().fold(R::default(), |mut all, part| {
            all += part;
            all
        })
    }

    pub(super) fn pixels(&self, row: usize) -> std::ops::Range<usize> {
        row * self.of_field.grid.width..(row + 1) * self.of_field.grid.width
    }
}

impl<P: Pointwise> Term for GradientTerm<P> {
    fn n_elems(&self) -> usize {
        self.of_field.grid.n_pixels()
    }

    fn is_hard(&self) -> bool {
        self.of.is_hard()
    }

    fn local_len(&self) -> usize {
        2 * self.of_field.grid.len()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        self.of_field.apply(self.field(x), out);
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let mut c = vec![0.0; p.len()];
        self.couple(x, &mut c);
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
        let z: Vec<f64> = p.iter().zip(u.iter()).map(|(p, u)| p + u).collect();
        let value_before = (0..self.of_field.grid.height)
            .map(|row| self.of.value(self.pixels(row), rows(&z, self.local_row(), row)))
            .sum::<f64>();
        // c + u - z with the u that the prox is taken with: over-relaxed it is u + (alpha - 1)(c - z).
        let alpha = cycle.relaxation;
        let v: Vec<f64> = c.iter().zip(u.iter()).zip(&z).map(|((c, u), z)| c + u + (alpha - 1.0) * (c - z)).collect();
        let penalty_before = 0.5 * self.weight.squared * square(&mut v.iter().zip(&z).map(|(v, z)| v - z));
        let report = self.sweep(cycle, x, p, u, None);
        let after = v.iter().zip(p.iter().zip(u.iter())).map(|(v, (p, u))| v - (p + u));
        let penalty_after = 0.5 * self.weight.squared * square(&mut { after });
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
        self.sweep(cycle, x, p, u, Some((pull, begins)))
    }

    fn folded(&mut self) -> Option<&mut dyn Folded> {
        let shrinks = self.of.shrinks_pairs(self.pixels(0), 2 * self.of_field.grid.channels).is_some();
        shrinks.then_some(self)
    }

    fn local_work(&self) -> f64 {
        /// Nanoseconds a number of the local vector.
        const NUMBER: f64 = 2.0;
        NUMBER * self.local_len() as f64
    }

    fn dual_map(&self) -> DualMap {
        self.of.dual_map()
    }

    fn dual(&mut self, z: &[f64], u: &mut [f64]) {
        if self.of.dual_map() == DualMap::None {
            return;
        }
        let local = self.local_row();
        u.copy_from_slice(z);
        u.par_chunks_mut(local).enumerate().for_each(|(row, u)| {
            self.of.gradient(self.pixels(row), u);
            u.iter_mut().for_each(|u| *u /= self.weight.squared);
        });
    }

    fn local_value(&self, z: &[f64]) -> Option<f64> {
        let values = z.par_chunks(self.local_row()).enumerate().map(|(row, z)| self.of.value(self.pixels(row), z));
        Some(values.collect::<Vec<f64>>().iter().sum())
    }

    fn gauge(&self, forces: &[f64]) -> Option<f64> {
        let rows = forces.par_chunks(self.local_row()).enumerate();
        let gauges: Option<Vec<f64>> = rows.map(|(row, q)| self.of.gauge(self.pixels(row), q)).collect();
        Some(gauges?.into_iter().fold(0.0, f64::max))
    }

    fn conjugate(&self, forces: &[f64]) -> Option<f64> {
        let rows = forces.par_chunks(self.local_row()).enumerate();
        let values: Option<Vec<f64>> = rows.map(|(row, q)| self.of.conjugate(self.pixels(row), q)).collect();
        Some(values?.iter().sum())
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let (grid, local, nodes) = (self.of_field.grid, self.local_row(), self.nodes());
        let (task, row_len) = (grid.task_rows(), grid.row_len());
        let (mut scratch, field) = (std::mem::take(&mut self.scratch), self.field(x));
        let this = &*self;
        // D x - p of a row.
        let gap_of = |row: usize, out: &mut [f64]| {
            this.of_field.row(field, row, out);
            vector::add_scaled(out, -1.0, rows(p, local, row));
        };
        let tasks = grad[nodes].par_chunks_mut(task * row_len).zip(scratch.par_iter_mut()).enumerate();
        let squares: Vec<f64> = tasks
            .map(|(t, (out, scratch))| {
                let (mut above, mut here) = scratch[..2 * local].split_at_mut(local);
                let over = this.of_field.row_above(t * task);
                if let Some(row) = over {
                    gap_of(row, above);
                }
                let mut square = 0.0;
                for (k, out) in out.chunks_mut(row_len).enumerate() {
                    let row = t * task + k;
                    gap_of(row, here);
                    square += vector::dot(here, here);
                    let above_it = (k > 0 || over.is_some()).then_some(&*above);
                    this.of_field.gather(this.weight.squared, here, above_it, row + 1 == grid.height, out, false);
                    std::mem::swap(&mut above, &mut here);
                }
                square
            })
            .collect();
        self.scratch = scratch;
        PenaltyReport { value: 0.5 * self.weight.squared * squares.iter().sum::<f64>(), energy: None }
    }

    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        if let Some(grad) = grad {
            let mut slopes = vec![0.0; self.local_len()];
            self.couple(x, &mut slopes);
            let rows = slopes.par_chunks_mut(self.local_row()).enumerate();
            rows.for_each(|(row, c)| self.of.gradient(self.pixels(row), c));
            let nodes = self.nodes();
            self.of_field.add_adjoint(1.0, &slopes, &mut grad[nodes]);
        }
        self.sum_rows(x, |row, c| EnergyReport {
            value: self.of.value(self.pixels(row), c),
            violation: self.of.violation(self.pixels(row), c),
            ..EnergyReport::default()
        })
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let local = self.local_row();
        self.sum_rows(x, |row, c| {
            let (mut gap2, mut size2) = (0.0, 0.0);
            for ((c, p), u) in c.iter().zip(rows(p, local, row)).zip(rows(u, local, row)) {
                let z = p + u;
                gap2 += (c - z) * (c - z);
                size2 += z * z;
            }
            Residual { gap2: self.weight.squared * gap2, size2: self.weight.squared * size2 }
        })
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        let (w, h, len) = (self.of_field.grid.width, self.of_field.grid.height, self.of_field.grid.row_len());
        for row in 0..h {
            for c in 0..self.of_field.grid.channels {
                for j in 0..w {
                    let at = |row: usize, j: usize| (self.first + row * len + c * w + j) as u32;
                    let right = at(row, if j + 1 < w { j + 1 } else { self.of_field.other_side(0, j) });
                    let below = at(if row + 1 < h { row + 1 } else { self.of_field.other_side(0, row) }, j);
                    visit(&[at(row, j), right, below]);
                }
            }
        }
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        let mut add = |i: u32, j: u32, value: f64| {
            let (i, j) = (i.max(j) as usize, i.min(j) as usize);
            if i < pattern.n()
                && let Some(slot) = pattern.slot(i, j)
            {
                values[slot] += value;
            }
        };
        self.for_each_element(&mut |nodes| {
            for to in &nodes[1..] {
                if *to != nodes[0] {
                    add(nodes[0], nodes[0], self.weight.squared);
                    add(*to, *to, self.weight.squared);
                    add(*to, nodes[0], -self.weight.squared);
                }
            }
        });
    }

    fn add_characteristic_force(&self, size: &mut [f64]) {
        // |D_i|: a pixel is in the differences to four neighbours.
        let field = self.first.min(size.len())..(self.first + self.of_field.grid.len()).min(size.len());
        size[field].iter_mut().for_each(|size| *size += 2.0 * self.of.force());
    }

    fn scale(&self) -> Scale {
        let measure = self.of_field.grid.n_pixels() as f64;
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
