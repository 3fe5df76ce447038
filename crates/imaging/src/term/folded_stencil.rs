//! The local step of absolute values of many numbers a pixel, on v = z + u alone.

use super::differences::rows;
use super::pass::{Sums, unfold};
use super::stencil::{Stencil, StencilTerm};
use crate::Pointwise;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use proxel_split::{Folded, LocalReport};
use rayon::prelude::*;

/// Rows of a task over those that one row hangs on.
const TALL: usize = 8;

/// What a task needs: D x of a row, p of some rows, and what [`Stencil::gather`] keeps.
#[derive(Default)]
struct Room {
    c: Vec<f64>,
    p: Vec<Vec<f64>>,
    gather: Vec<f64>,
}

impl<S: Stencil, P: Pointwise> StencilTerm<S, P> {
    /// Rows from `first` on; the pull of the first `reach` - 1 is left to the caller.
    fn fold_task(
        &self,
        reach: usize,
        relaxation: f64,
        x: &[f64],
        first: usize,
        v: &mut [f64],
        pull: &mut [f64],
        reports: &mut [LocalReport],
        room: &mut Room,
    ) {
        let (grid, local) = (self.grid, self.local_row());
        room.c.resize(local, 0.0);
        room.p.resize_with(2 * reach, Vec::new);
        room.p.iter_mut().for_each(|p| p.resize(local, 0.0));
        let rows = v.chunks_mut(local).zip(pull.chunks_mut(grid.row_len())).zip(reports);
        for (k, ((v, pull), report)) in rows.enumerate() {
            let row = first + k;
            self.stencil.row(grid, x, row, &mut room.c);
            let (mut value_after, mut sums) = (0.0, Sums::default());
            let p = &mut room.p[k % reach];
            self.for_each_part(row, |weight, at| {
                let (threshold, c, v, p) =
                    (weight / self.weight2(), &room.c[at.clone()], &mut v[at.clone()], &mut p[at]);
                value_after += weight * dispatch(FoldedNumbers { relaxation, threshold, c, v, p, sums: &mut sums });
            });
            *report = sums.report(self.weight2(), LocalReport { value_after, ..LocalReport::default() });
            if k + 1 >= reach {
                let above: Vec<&[f64]> = (0..reach).map(|a| &*room.p[(k - a) % reach]).collect();
                self.stencil.gather(grid, -self.weight2(), &above, pull, &mut room.gather);
            }
        }
    }

    /// Parts of a row's numbers that shrink alike, with their weight: what does not count has 0.
    fn for_each_part(&self, row: usize, mut visit: impl FnMut(f64, std::ops::Range<usize>)) {
        let (w, planes) = (self.grid.width, self.local_row() / self.grid.width.max(1));
        let Some((counted, weights)) = self.of().shrinks_numbers(self.pixels(row), planes) else { return };
        for (k, weight) in (0..planes).zip(weights.iter().cycle()) {
            let at = |from: usize, to: usize| k * w + from..k * w + to;
            visit(0.0, at(0, counted.start));
            visit(*weight, at(counted.start, counted.end));
            visit(0.0, at(counted.end, w));
        }
    }
}

impl<S: Stencil, P: Pointwise> Folded for StencilTerm<S, P> {
    fn step(&mut self, relaxation: f64, x: &[f64], v: &mut [f64], pull: &mut [f64], begins: bool) -> LocalReport {
        let (grid, local, row_len) = (self.grid, self.local_row(), self.grid.row_len());
        let reach = self.stencil.reach().unwrap_or(1).max(1);
        let task = grid.task_rows().max(TALL * reach);
        if begins {
            pull.fill(0.0);
        }
        let mut reports = self.take_parts();
        let (this, pull) = (&*self, &mut pull[..grid.len()]);
        let tasks = v.par_chunks_mut(task * local).zip(pull.par_chunks_mut(task * row_len));
        let tasks = tasks.zip(reports.par_chunks_mut(task)).enumerate();
        tasks.for_each_init(Room::default, |room, (t, ((v, pull), reports))| {
            this.fold_task(reach, relaxation, x, t * task, v, pull, reports, room);
        });
        // The first rows of a task hang on the last ones of another.
        let v = &*v;
        pull.par_chunks_mut(task * row_len).enumerate().for_each_init(Room::default, |room, (t, pull)| {
            let first = t * task;
            room.p.resize_with(2 * reach - 1, Vec::new);
            // Rows from `reach` - 1 above, as often around as it takes.
            for (k, p) in room.p.iter_mut().enumerate() {
                let row = (first + k + (reach - 1) * (grid.height - 1)) % grid.height;
                p.resize(local, 0.0);
                unfold(this.of(), this.pixels(row), this.weight2(), rows(v, local, row), p, None);
            }
            for (k, pull) in pull.chunks_mut(row_len).take(reach - 1).enumerate() {
                let above: Vec<&[f64]> = (0..reach).map(|a| &*room.p[k + reach - 1 - a]).collect();
                this.stencil.gather(grid, -this.weight2(), &above, pull, &mut room.gather);
            }
        });
        let mut report = LocalReport::default();
        reports.iter().for_each(|part| report += *part);
        self.give_parts(reports);
        report
    }

    fn unfold(&self, v: &[f64], p: &mut [f64], u: &mut [f64]) {
        let local = self.local_row();
        let rows = v.par_chunks(local).zip(p.par_chunks_mut(local).zip(u.par_chunks_mut(local))).enumerate();
        rows.for_each(|(row, (v, (p, u)))| unfold(self.of(), self.pixels(row), self.weight2(), v, p, Some(u)));
    }
}

/// Numbers that shrink by one threshold t: u = v cut to [-t, t] and z = v - u; v <- v + alpha (c - z), then with z and u of the new
/// v p = z - u; the sum of |z|.
struct FoldedNumbers<'a> {
    relaxation: f64,
    threshold: f64,
    c: &'a [f64],
    v: &'a mut [f64],
    p: &'a mut [f64],
    sums: &'a mut Sums,
}

/// Eight numbers: the new v, and p. Squares and sizes are added to.
struct Lanes<I: Isa> {
    relaxation: F8<I>,
    threshold: F8<I>,
    sums: [F8<I>; 4], // z - z before, c - z before, c - z, |z|
}

impl<I: Isa> Lanes<I> {
    #[inline(always)]
    fn advance(&mut self, c: F8<I>, v: F8<I>) -> [F8<I>; 2] {
        let (t, minus) = (self.threshold, -self.threshold);
        let before = v - v.min(t).max(minus);
        let off = c - before;
        let v = self.relaxation.mul_add(off, v);
        let u = v.min(t).max(minus);
        let z = v - u;
        let (moved, gap) = (z - before, c - z);
        self.sums[0] = moved.mul_add(moved, self.sums[0]);
        self.sums[1] = off.mul_add(off, self.sums[1]);
        self.sums[2] = gap.mul_add(gap, self.sums[2]);
        self.sums[3] += z.abs();
        [v, z - u]
    }
}

impl Kernel for FoldedNumbers<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let (c, c_rest) = self.c.as_chunks::<LANES>();
        let (v, v_rest) = self.v.as_chunks_mut::<LANES>();
        let (p, p_rest) = self.p.as_chunks_mut::<LANES>();
        let mut lanes = Lanes::<I> {
            relaxation: F8::splat(self.relaxation),
            threshold: F8::splat(self.threshold),
            sums: [F8::load(&self.sums.moved), F8::load(&self.sums.gap_before), F8::load(&self.sums.gap), F8::zero()],
        };
        for i in 0..c.len().min(v.len()).min(p.len()) {
            let [new, pull] = lanes.advance(F8::load(&c[i]), F8::load(&v[i]));
            new.store(&mut v[i]);
            pull.store(&mut p[i]);
        }
        if !c_rest.is_empty() {
            // Zeros where there is nothing: they stay, and add nothing.
            let [mut ci, mut vi, mut pi] = [[0.0; LANES]; 3];
            ci[..c_rest.len()].copy_from_slice(c_rest);
            vi[..v_rest.len()].copy_from_slice(v_rest);
            let [new, pull] = lanes.advance(F8::load(&ci), F8::load(&vi));
            new.store(&mut vi);
            pull.store(&mut pi);
            v_rest.copy_from_slice(&vi[..v_rest.len()]);
            p_rest.copy_from_slice(&pi[..p_rest.len()]);
        }
        let [moved, gap_before, gap, sizes] = lanes.sums;
        moved.store(&mut self.sums.moved);
        gap_before.store(&mut self.sums.gap_before);
        gap.store(&mut self.sums.gap);
        sizes.sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::stencil::tests::numbers;
    use crate::{Grid, LocalCosines, Shrinkage, StencilTerm, Window};
    use proxel_split::{Cycle, Term};
    use std::sync::Arc;

    /// Against the step on p and u: rows of whole lanes and a rest, several tasks, fewer rows than a number hangs on, with and
    /// without a window.
    #[test]
    fn folded_steps_are_those_of_both() {
        let window = Window { width: 35, rows: [1, 80], columns: [3, 33] };
        let grids = [(35, 97, 1), (35, 97, 2), (5, 3, 1), (1, 1, 1), (40, 33, 1)];
        for ((width, height, channels), within) in grids.into_iter().flat_map(|g| [(g, None), (g, Some(window))]) {
            let grid = Grid { width, height, channels };
            if within.is_some() && width != window.width {
                continue;
            }
            let weights = Arc::new((0..16).map(|k| 0.1 * f64::from(k % 5)).collect());
            let of = Shrinkage { weights, joint: false, within };
            let mut term = StencilTerm::new(grid, LocalCosines::default(), of, 2.0);
            let cycle = Cycle { relaxation: 1.7, ..Cycle::PLAIN };
            let (mut p, mut u) = (numbers(term.local_len(), 0.5), numbers(term.local_len(), 0.6));
            let x = [0.4, 0.8].map(|seed| numbers(grid.len(), seed));
            term.pull_step(&cycle, &x[0], &mut p, &mut u, &mut vec![0.0; grid.len()], true);
            let mut v: Vec<f64> = p.iter().zip(&u).map(|(p, u)| p + 2.0 * u).collect();
            for begins in [true, false] {
                let [mut both, mut alone] = [(); 2].map(|()| numbers(grid.len(), 0.7));
                let report = term.pull_step(&cycle, &x[1], &mut p, &mut u, &mut both, begins);
                let folded = term.folded().expect("numbers shrink");
                let of_folded = folded.step(cycle.relaxation, &x[1], &mut v, &mut alone, begins);
                let (mut p1, mut u1) = (vec![0.0; p.len()], vec![0.0; p.len()]);
                folded.unfold(&v, &mut p1, &mut u1);
                for (what, a, b) in [("p", &p, &p1), ("u", &u, &u1), ("pull", &both, &alone)] {
                    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{grid:?}: {what}");
                }
                for (a, b) in [
                    (report.moved2, of_folded.moved2),
                    (report.gap2, of_folded.gap2),
                    (report.gap2_before, of_folded.gap2_before),
                    (report.value_after, of_folded.value_after),
                ] {
                    assert!((a - b).abs() <= 1e-12 * a, "{grid:?}: {a} and {b}");
                }
            }
        }
    }
}
