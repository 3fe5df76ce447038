//! The local step of total variation on v = z + u alone.

use super::differences::rows;
use super::gradient::GradientTerm;
use super::pairs::Row;
use super::pass::{Sums, unfold};
use crate::Pointwise;
use proxel_split::{Folded, LocalReport};
use rayon::prelude::*;

impl<P: Pointwise> GradientTerm<P> {
    /// Rows from `first` on; the pull of the first of them is left to the caller.
    fn fold_task(
        &self,
        relaxation: f64,
        field: &[f64],
        first: usize,
        v: &mut [f64],
        pull: &mut [f64],
        begins: bool,
        scratch: &mut [f64],
    ) -> LocalReport {
        let (grid, local) = (self.of_field.grid, self.local_row());
        let (above, rest) = scratch.split_at_mut(local);
        let (here, longer) = rest.split_at_mut(local);
        let (mut above, mut here) = (above, here);
        let (force, threshold) = (self.of.force(), self.threshold());
        let (mut report, mut sums) = (LocalReport::default(), Sums::default());
        for (k, v) in v.chunks_mut(local).enumerate() {
            let row = first + k;
            let counted = self.counted(row);
            let of = Row { of_field: &self.of_field, field, row, counted, threshold };
            report.value_after += force * of.fold(relaxation, v, here, longer, &mut sums);
            if k > 0 {
                let out = &mut pull[k * grid.row_len()..(k + 1) * grid.row_len()];
                self.of_field.gather(self.weight2(), here, Some(above), row + 1 == grid.height, out, begins);
            }
            std::mem::swap(&mut above, &mut here);
        }
        sums.report(self.weight2(), report)
    }

    /// lambda / w^2
    fn threshold(&self) -> f64 {
        self.of.force() / self.weight2()
    }

    /// The pixels of a row that count.
    fn counted(&self, row: usize) -> std::ops::Range<usize> {
        self.of.shrinks_pairs(self.pixels(row), 2 * self.of_field.grid.channels).unwrap_or(0..0)
    }
}

impl<P: Pointwise> Folded for GradientTerm<P> {
    fn step(&mut self, relaxation: f64, x: &[f64], v: &mut [f64], pull: &mut [f64], begins: bool) -> LocalReport {
        let (grid, local) = (self.of_field.grid, self.local_row());
        let (task, row_len) = (grid.task_rows(), grid.row_len());
        let (mut scratch, mut parts) = self.take_room();
        let (field, nodes) = (self.field(x), self.nodes());
        if begins {
            pull[..nodes.start].fill(0.0);
            pull[nodes.end..].fill(0.0);
        }
        let (this, pull) = (&*self, &mut pull[nodes]);
        let tasks = v.par_chunks_mut(task * local).zip(pull.par_chunks_mut(task * row_len));
        let tasks = tasks.zip(scratch.par_iter_mut()).zip(parts.par_iter_mut()).enumerate();
        tasks.for_each(|(t, (((v, pull), scratch), part))| {
            *part = this.fold_task(relaxation, field, t * task, v, pull, begins, scratch);
        });
        // The first row of a task hangs on the last one of another.
        let v = &*v;
        pull.par_chunks_mut(task * row_len).zip(scratch.par_iter_mut()).enumerate().for_each(|(t, (pull, scratch))| {
            let (row, (here, above)) = (t * task, scratch[..2 * local].split_at_mut(local));
            let pull = &mut pull[..row_len];
            let of = |row: usize, p: &mut [f64]| {
                unfold(&this.of, this.pixels(row), this.weight2(), rows(v, local, row), p, None);
            };
            of(row, here);
            let above = this.of_field.row_above(row).map(|row| {
                of(row, above);
                &*above
            });
            this.of_field.gather(-this.weight2(), here, above, row + 1 == grid.height, pull, begins);
        });
        let mut report = LocalReport::default();
        parts.iter().for_each(|part| report += *part);
        self.give_room(scratch, parts);
        report
    }

    fn unfold(&self, v: &[f64], p: &mut [f64], u: &mut [f64]) {
        let local = self.local_row();
        let rows = v.par_chunks(local).zip(p.par_chunks_mut(local).zip(u.par_chunks_mut(local))).enumerate();
        rows.for_each(|(row, (v, (p, u)))| unfold(&self.of, self.pixels(row), self.weight2(), v, p, Some(u)));
    }
}
