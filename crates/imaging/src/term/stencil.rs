//! Functions of linear maps of fields that are given by their stencils.

use super::pass::{Sums, begin};
use crate::{Grid, Pointwise};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{
    Cycle, DualMap, EnergyReport, Folded, LocalReport, PenaltyReport, Residual, Scale, Term, Weight, vector,
};
use rayon::prelude::*;

/// What is told of a local number: its nodes and their factors.
pub type Visit<'a> = dyn FnMut(&[(u32, f64)]) + 'a;

/// A linear map D from nodes to rows of local numbers.
pub trait Stencil: Send + Sync {
    /// Local numbers of a row of pixels: so many planes of its width.
    fn local_row(&self, grid: Grid) -> usize;

    /// out <- the row's part of D x.
    fn row(&self, grid: Grid, x: &[f64], row: usize, out: &mut [f64]);

    /// out += scale D^T p.
    fn add_adjoint(&self, grid: Grid, scale: f64, p: &[f64], out: &mut [f64]);

    /// Rows of p that D^T p of a row hangs on, itself and those above it, around the border; none where they are not these.
    fn reach(&self) -> Option<usize> {
        None
    }

    /// out += scale (D^T p) of a row; `above` are as many rows of p as it [reaches](Self::reach), from its own upwards. `room` is
    /// the caller's to keep.
    fn gather(&self, grid: Grid, scale: f64, above: &[&[f64]], out: &mut [f64], room: &mut Vec<f64>) {
        let _ = (grid, scale, above, out, room);
    }

    /// Visits each local number: its nodes and their factors.
    fn for_each(&self, grid: Grid, visit: &mut Visit<'_>);
}

/// g(D x) for a [`Stencil`] D. One weight w^2 for all numbers. Local vectors are laid out row by row, in each row plane by plane,
/// as [`Pointwise`] takes them.
pub struct StencilTerm<S, P> {
    pub(super) grid: Grid,
    pub(super) stencil: S,
    of: P,
    weight: Weight,
    parts: Vec<LocalReport>, // of each row
}

impl<S: Stencil, P: Pointwise> StencilTerm<S, P> {
    /// With the penalty w^2 = `weight2` > 0.
    pub fn new(grid: Grid, stencil: S, of: P, weight2: f64) -> Self {
        let parts = vec![LocalReport::default(); grid.height];
        StencilTerm { grid, stencil, of, weight: Weight::new(weight2), parts }
    }

    /// Its function.
    pub(super) fn of(&self) -> &P {
        &self.of
    }

    /// w^2
    pub(super) fn weight2(&self) -> f64 {
        self.weight.squared
    }

    /// Reports of rows, to be given back.
    pub(super) fn take_parts(&mut self) -> Vec<LocalReport> {
        std::mem::take(&mut self.parts)
    }

    pub(super) fn give_parts(&mut self, parts: Vec<LocalReport>) {
        self.parts = parts;
    }

    pub(super) fn local_row(&self) -> usize {
        self.stencil.local_row(self.grid)
    }

    pub(super) fn pixels(&self, row: usize) -> std::ops::Range<usize> {
        row * self.grid.width..(row + 1) * self.grid.width
    }

    fn sweep(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64]) -> LocalReport {
        let local = self.local_row();
        let mut parts = self.take_parts();
        let this = &*self;
        let rows = p.par_chunks_mut(local).zip(u.par_chunks_mut(local)).zip(parts.par_iter_mut()).enumerate();
        let scratch = || (vec![0.0; local], vec![0.0; local]);
        rows.with_min_len(this.grid.task_rows()).for_each_init(scratch, |(c, v), (row, ((p, u), part))| {
            this.stencil.row(this.grid, x, row, c);
            begin(cycle.relaxation, c, p, u, v);
            let value_after = this.of.prox(this.pixels(row), v, this.weight.squared);
            let mut sums = Sums::default();
            sums.end(cycle.order, c, v, p, u);
            *part = sums.report(this.weight.squared, LocalReport { value_after, ..LocalReport::default() });
        });
        let mut report = LocalReport::default();
        parts.iter().for_each(|part| report += *part);
        self.give_parts(parts);
        report
    }

    /// A sum over rows of D x, in the order of rows.
    fn sum_rows(&self, x: &[f64], of: impl Fn(usize, &[f64]) -> f64 + Sync) -> f64 {
        let rows = (0..self.grid.height).into_par_iter().with_min_len(self.grid.task_rows());
        let sums: Vec<f64> = rows
            .map_init(
                || vec![0.0; self.local_row()],
                |c, row| {
                    self.stencil.row(self.grid, x, row, c);
                    of(row, c)
                },
            )
            .collect();
        sums.iter().sum()
    }
}

impl<S: Stencil, P: Pointwise> Term for StencilTerm<S, P> {
    fn n_elems(&self) -> usize {
        self.grid.n_pixels()
    }

    fn is_hard(&self) -> bool {
        self.of.is_hard()
    }

    fn local_len(&self) -> usize {
        self.local_row() * self.grid.height
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        let rows = out.par_chunks_mut(self.local_row()).enumerate().with_min_len(self.grid.task_rows());
        rows.for_each(|(row, out)| self.stencil.row(self.grid, x, row, out));
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let mut c = vec![0.0; p.len()];
        self.couple(x, &mut c);
        let half_square =
            |values: &mut dyn Iterator<Item = f64>| 0.5 * self.weight.squared * values.map(|v| v * v).sum::<f64>();
        let z: Vec<f64> = p.iter().zip(u.iter()).map(|(p, u)| p + u).collect();
        let value_before = self.local_value(&z).unwrap_or(0.0);
        // c + u - z with the u that the prox is taken with: over-relaxed it is u + (alpha - 1)(c - z).
        let alpha = cycle.relaxation;
        let v: Vec<f64> = c.iter().zip(u.iter()).zip(&z).map(|((c, u), z)| c + u + (alpha - 1.0) * (c - z)).collect();
        let penalty_before = half_square(&mut v.iter().zip(&z).map(|(v, z)| v - z));
        let report = self.sweep(cycle, x, p, u);
        let penalty_after = 0.5
            * self.weight.squared
            * v.iter().zip(p.iter().zip(u.iter())).map(|(v, (p, u))| (v - (p + u)).powi(2)).sum::<f64>();
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
        let report = self.sweep(cycle, x, p, u);
        self.stencil.add_adjoint(self.grid, -self.weight.squared, p, pull);
        report
    }

    fn folded(&mut self) -> Option<&mut dyn Folded> {
        let planes = self.local_row() / self.grid.width.max(1);
        let folds = self.stencil.reach().is_some() && self.of.shrinks_numbers(self.pixels(0), planes).is_some();
        folds.then_some(self)
    }

    fn local_work(&self) -> f64 {
        /// Nanoseconds a number.
        const NUMBER: f64 = 3.0;
        NUMBER * self.local_len() as f64
    }

    fn dual_map(&self) -> DualMap {
        self.of.dual_map()
    }

    fn dual(&mut self, z: &[f64], u: &mut [f64]) {
        if self.of.dual_map() == DualMap::None {
            return;
        }
        u.copy_from_slice(z);
        u.par_chunks_mut(self.local_row()).enumerate().for_each(|(row, u)| {
            self.of.gradient(self.pixels(row), u);
            u.iter_mut().for_each(|u| *u /= self.weight.squared);
        });
    }

    fn local_value(&self, z: &[f64]) -> Option<f64> {
        let values = z.par_chunks(self.local_row()).enumerate().map(|(row, z)| self.of.value(self.pixels(row), z));
        Some(values.collect::<Vec<f64>>().iter().sum())
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let mut gap = vec![0.0; p.len()];
        self.couple(x, &mut gap);
        gap.par_iter_mut().zip(p).for_each(|(c, p)| *c -= p);
        self.stencil.add_adjoint(self.grid, self.weight.squared, &gap, grad);
        PenaltyReport { value: 0.5 * self.weight.squared * vector::dot(&gap, &gap), energy: None }
    }

    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        if let Some(grad) = grad {
            let mut slopes = vec![0.0; self.local_len()];
            self.couple(x, &mut slopes);
            let rows = slopes.par_chunks_mut(self.local_row()).enumerate();
            rows.for_each(|(row, c)| self.of.gradient(self.pixels(row), c));
            self.stencil.add_adjoint(self.grid, 1.0, &slopes, grad);
        }
        let value = self.sum_rows(x, |row, c| self.of.value(self.pixels(row), c));
        EnergyReport { value, ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let z: Vec<f64> = p.iter().zip(u).map(|(p, u)| p + u).collect();
        let mut gap = vec![0.0; z.len()];
        self.couple(x, &mut gap);
        gap.iter_mut().zip(&z).for_each(|(c, z)| *c -= z);
        Residual {
            gap2: self.weight.squared * vector::dot(&gap, &gap),
            size2: self.weight.squared * vector::dot(&z, &z),
        }
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.stencil.for_each(self.grid, &mut |number| {
            let nodes: Vec<u32> = number.iter().map(|(node, _)| *node).collect();
            visit(&nodes);
        });
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        self.stencil.for_each(self.grid, &mut |number| {
            for (k, (a, fa)) in number.iter().enumerate() {
                for (b, fb) in &number[..=k] {
                    let (i, j) = ((*a).max(*b) as usize, (*a).min(*b) as usize);
                    if i < pattern.n()
                        && let Some(slot) = pattern.slot(i, j)
                    {
                        // A node that stands twice in a number meets itself twice.
                        let twice = if a == b && !std::ptr::eq(fa, fb) { 2.0 } else { 1.0 };
                        values[slot] += twice * self.weight.squared * fa * fb;
                    }
                }
            }
        });
    }

    fn add_characteristic_force(&self, size: &mut [f64]) {
        let force = self.of.force();
        self.stencil.for_each(self.grid, &mut |number| {
            for (node, factor) in number {
                if let Some(size) = size.get_mut(*node as usize) {
                    *size += factor.abs() * force;
                }
            }
        });
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn numbers(n: usize, seed: f64) -> Vec<f64> {
        (0..n).map(|k| ((k * k) as f64 * 0.37 + seed).sin()).collect()
    }

    /// Rows of D x and D^T p on n nodes, against the numbers one by one.
    pub fn assert_is_its_numbers(map: &dyn Stencil, grid: Grid, n: usize) {
        let (x, local) = (numbers(n, 0.1), map.local_row(grid));
        let p = numbers(local * grid.height, 0.7);
        let (mut got, mut k) = (vec![0.0; p.len()], 0);
        got.chunks_mut(local).enumerate().for_each(|(row, out)| map.row(grid, &x, row, out));
        let mut back = numbers(n, 0.3);
        let mut expected = back.clone();
        map.add_adjoint(grid, 1.5, &p, &mut back);
        map.for_each(grid, &mut |number| {
            let value: f64 = number.iter().map(|(node, f)| f * x[*node as usize]).sum();
            assert!((got[k] - value).abs() < 1e-13, "{grid:?}, number {k}: {} and {value}", got[k]);
            number.iter().for_each(|(node, f)| expected[*node as usize] += 1.5 * f * p[k]);
            k += 1;
        });
        assert_eq!(k, p.len());
        assert!(back.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{grid:?}");
    }
}
