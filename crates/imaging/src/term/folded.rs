//! The local step of total variation on v = z + u alone.

use super::differences::{Differences, rows};
use super::gradient::GradientTerm;
use super::pairs::Row;
use super::pass::{Sums, unfold};
use crate::Pointwise;
use proxel_split::{Folded, Intake, LocalReport};
use rayon::prelude::*;

/// -p or p of a row and of the one above it: what the pull of the row is made of.
struct Forces<'a> {
    of_field: &'a Differences,
    row: usize,
    scale: f64,
    here: &'a [f64],
    above: Option<&'a [f64]>,
}

impl Forces<'_> {
    /// The pull of the row; set where it begins with it, added to where not.
    fn gather(&self, out: &mut [f64], begins: bool) {
        let last = self.row + 1 == self.of_field.grid.height;
        self.of_field.gather(self.scale, self.here, self.above, last, out, begins);
    }
}

impl<P: Pointwise> GradientTerm<P> {
    /// Rows from `first` on; `give` is called with their forces, all but those of the first, which the caller has to find, and
    /// with room for a row.
    fn fold_task(
        &self,
        relaxation: f64,
        field: &[f64],
        first: usize,
        v: &mut [f64],
        scratch: &mut [f64],
        mut give: impl FnMut(Forces<'_>, &mut [f64]),
    ) -> LocalReport {
        let local = self.local_row();
        let (above, rest) = scratch.split_at_mut(local);
        let (here, room) = rest.split_at_mut(local);
        let (mut above, mut here) = (above, here);
        let (force, threshold) = (self.of.force(), self.threshold());
        let (mut report, mut sums) = (LocalReport::default(), Sums::default());
        for (k, v) in v.chunks_mut(local).enumerate() {
            let row = first + k;
            let counted = self.counted(row);
            let of = Row { of_field: &self.of_field, field, row, counted, threshold };
            report.value_after += force * of.fold(relaxation, v, here, &mut sums);
            if k > 0 {
                let scale = self.weight2(); // of -p
                give(Forces { of_field: &self.of_field, row, scale, here, above: Some(above) }, room);
            }
            std::mem::swap(&mut above, &mut here);
        }
        sums.report(self.weight2(), report)
    }

    /// The forces of the first row of a task, which hang on the last row of another.
    fn first_of_task(&self, row: usize, v: &[f64], scratch: &mut [f64], give: impl FnOnce(Forces<'_>, &mut [f64])) {
        let local = self.local_row();
        let (here, rest) = scratch.split_at_mut(local);
        let (above, room) = rest.split_at_mut(local);
        let of = |row: usize, p: &mut [f64]| {
            unfold(&self.of, self.pixels(row), self.weight2(), rows(v, local, row), p, None);
        };
        of(row, here);
        let above = self.of_field.row_above(row).map(|row| {
            of(row, above);
            &*above
        });
        give(Forces { of_field: &self.of_field, row, scale: -self.weight2(), here, above }, room);
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
            let mut rows = pull.chunks_mut(row_len).skip(1);
            *part = this.fold_task(relaxation, field, t * task, v, scratch, |forces, _| {
                rows.next().into_iter().for_each(|pull| forces.gather(pull, begins));
            });
        });
        let v = &*v;
        pull.par_chunks_mut(task * row_len).zip(scratch.par_iter_mut()).enumerate().for_each(|(t, (pull, scratch))| {
            this.first_of_task(t * task, v, scratch, |forces, _| forces.gather(&mut pull[..row_len], begins));
        });
        let report = total(&parts);
        self.give_room(scratch, parts);
        report
    }

    fn feed(&mut self, relaxation: f64, x: &[f64], v: &mut [f64], intake: &mut dyn Intake) -> Option<LocalReport> {
        let (grid, local) = (self.of_field.grid, self.local_row());
        let (task, row_len) = (grid.task_rows(), grid.row_len());
        let mut takers = intake.takers(task * row_len)?;
        let (mut scratch, mut parts) = self.take_room();
        let (this, field) = (&*self, self.field(x));
        let tasks = v.par_chunks_mut(task * local).zip(takers.par_iter_mut());
        let tasks = tasks.zip(scratch.par_iter_mut()).zip(parts.par_iter_mut()).enumerate();
        tasks.for_each(|(t, (((v, taker), scratch), part))| {
            *part = this.fold_task(relaxation, field, t * task, v, scratch, |forces, room| {
                let pull = &mut room[..row_len];
                forces.gather(pull, true);
                taker.take(forces.row - t * task, pull);
            });
        });
        let v = &*v;
        takers.par_iter_mut().zip(scratch.par_iter_mut()).enumerate().for_each(|(t, (taker, scratch))| {
            this.first_of_task(t * task, v, scratch, |forces, room| {
                let pull = &mut room[..row_len];
                forces.gather(pull, true);
                taker.take(0, pull);
            });
        });
        let report = total(&parts);
        self.give_room(scratch, parts);
        Some(report)
    }

    fn unfold(&self, v: &[f64], p: &mut [f64], u: &mut [f64]) {
        let local = self.local_row();
        let rows = v.par_chunks(local).zip(p.par_chunks_mut(local).zip(u.par_chunks_mut(local))).enumerate();
        rows.for_each(|(row, (v, (p, u)))| unfold(&self.of, self.pixels(row), self.weight2(), v, p, Some(u)));
    }
}

fn total(parts: &[LocalReport]) -> LocalReport {
    let mut report = LocalReport::default();
    parts.iter().for_each(|part| report += *part);
    report
}
