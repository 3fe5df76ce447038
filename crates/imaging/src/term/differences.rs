//! Forward differences of a field, and their transpose.

use crate::{Boundary, Grid};
use proxel_linalg::simd::{Isa, Kernel, dispatch};
use rayon::prelude::*;

/// D: the forward differences of every pixel,
///
/// ```text
/// (D x)_ij = (x_i,j+1 - x_ij, x_i+1,j - x_ij)
/// ```
///
/// which wrap around for [`Boundary::Periodic`] and are 0 across the border for [`Boundary::Neumann`]. They are laid out row by
/// row; in each row plane by plane, of each channel the differences along the row and then those down the column.
#[derive(Clone, Copy, Debug)]
pub struct Differences {
    /// The pixels.
    pub grid: Grid,
    /// What lies beyond the border.
    pub boundary: Boundary,
}

impl Differences {
    /// Numbers of a row's differences.
    pub(super) fn local_row(&self) -> usize {
        2 * self.grid.row_len()
    }

    /// The differences of one row.
    pub(super) fn row(&self, field: &[f64], row: usize, out: &mut [f64]) {
        let (grid, boundary) = (self.grid, self.boundary);
        let (w, len) = (grid.width, grid.row_len());
        let here = &field[row * len..(row + 1) * len];
        let below = self.below(field, row);
        for c in 0..grid.channels {
            let of = &here[c * w..(c + 1) * w];
            let (along, down) = out[2 * c * w..(2 * c + 2) * w].split_at_mut(w);
            dispatch(Subtract { out: along, b: of.get(1..).unwrap_or_default(), a: of });
            if let (Some(out), [first, ..], [.., last]) = (along.last_mut(), of, of) {
                *out = if boundary == Boundary::Periodic { first - last } else { 0.0 };
            }
            match below {
                Some(below) => {
                    let below = &below[c * w..(c + 1) * w];
                    dispatch(Subtract { out: down, b: below, a: of });
                }
                None => down.fill(0.0),
            }
        }
    }

    /// The row below, which is the first one below the last of a field that wraps around; none below one that mirrors.
    pub(super) fn below<'x>(&self, field: &'x [f64], row: usize) -> Option<&'x [f64]> {
        let len = self.grid.row_len();
        match self.boundary {
            _ if row + 1 < self.grid.height => Some(&field[(row + 1) * len..(row + 2) * len]),
            Boundary::Periodic => Some(&field[..len]),
            Boundary::Neumann => None,
        }
    }

    /// out <- D x
    pub fn apply(&self, field: &[f64], out: &mut [f64]) {
        let rows = out.par_chunks_mut(self.local_row()).enumerate().with_min_len(self.grid.task_rows());
        rows.for_each(|(row, out)| self.row(field, row, out));
    }

    /// out += scale D^T p
    pub fn add_adjoint(&self, scale: f64, p: &[f64], out: &mut [f64]) {
        let (grid, local) = (self.grid, self.local_row());
        out.par_chunks_mut(grid.row_len()).enumerate().with_min_len(grid.task_rows()).for_each(|(row, out)| {
            self.gather(scale, rows(p, local, row), self.above(p, row), row + 1 == grid.height, out, false);
        });
    }

    /// out += scale D^T p in a row, or = if it `begins`, from that row of p and the one above, of which there is none at a
    /// border without another side.
    pub(super) fn gather(
        &self,
        scale: f64,
        here: &[f64],
        above: Option<&[f64]>,
        last: bool,
        out: &mut [f64],
        begins: bool,
    ) {
        let w = self.grid.width;
        let periodic = self.boundary == Boundary::Periodic;
        for c in 0..self.grid.channels {
            let (along, down) = (&here[2 * c * w..(2 * c + 1) * w], &here[(2 * c + 1) * w..(2 * c + 2) * w]);
            let out = &mut out[c * w..(c + 1) * w];
            let Some(end) = w.checked_sub(1) else { continue };
            // Below the last row of a field that mirrors there is no difference.
            let down = (periodic || !last).then_some(down);
            let above = above.map(|above| &above[(2 * c + 1) * w..(2 * c + 2) * w]);
            let first = match (periodic, end) {
                (true, _) => along[end] - along[0],
                (false, 0) => 0.0,
                (false, _) => -along[0],
            };
            dispatch(Gather { scale, first, along, down, above, out: &mut *out, begins });
            if !periodic && end > 0 {
                // At the end of the row there is no difference, so that what stands in p there means nothing.
                out[end] += scale * along[end];
            }
        }
    }

    /// The row above, which is the last one above the first of a field that wraps around.
    pub(super) fn row_above(&self, row: usize) -> Option<usize> {
        match (row, self.boundary) {
            (0, Boundary::Neumann) => None,
            (0, Boundary::Periodic) => Some(self.grid.height - 1),
            _ => Some(row - 1),
        }
    }

    /// The row of p above.
    pub(super) fn above<'p>(&self, p: &'p [f64], row: usize) -> Option<&'p [f64]> {
        self.row_above(row).map(|row| rows(p, self.local_row(), row))
    }

    /// What lies behind the last of a row or column: the first, or itself.
    pub(super) fn other_side(&self, first: usize, last: usize) -> usize {
        if self.boundary == Boundary::Periodic { first } else { last }
    }
}

/// Row `row` of a vector of rows.
pub(super) fn rows(p: &[f64], local: usize, row: usize) -> &[f64] {
    &p[row * local..(row + 1) * local]
}

/// out += scale D^T p in a row of one channel, from the differences along it, those to the row below and those of the row
/// above to it; `first` is that of the first pixel along the row.
struct Gather<'a> {
    scale: f64,
    first: f64,
    along: &'a [f64],
    down: Option<&'a [f64]>,
    above: Option<&'a [f64]>,
    out: &'a mut [f64],
    begins: bool,
}

impl Kernel for Gather<'_> {
    type Output = ();

    // Loops by index, which are compiled for the instruction set.
    #[inline(always)]
    fn run<I: Isa>(self) {
        let (n, scale) = (self.out.len(), self.scale);
        if n == 0 {
            return;
        }
        let out = &mut self.out[..n];
        let (before, along) = (&self.along[..n - 1], &self.along[1..n]);
        if let (Some(down), Some(above), true) = (self.down, self.above, self.begins) {
            let (down, above) = (&down[..n], &above[..n]);
            out[0] = scale * (self.first + (above[0] - down[0]));
            for i in 0..n - 1 {
                out[i + 1] = scale * ((before[i] - along[i]) + (above[i + 1] - down[i + 1]));
            }
            return;
        }
        if self.begins {
            out.fill(0.0);
        }
        out[0] += scale * self.first;
        if let (Some(down), Some(above)) = (self.down, self.above) {
            let (down, above) = (&down[..n], &above[..n]);
            out[0] += scale * (above[0] - down[0]);
            for i in 0..n - 1 {
                out[i + 1] += scale * ((before[i] - along[i]) + (above[i + 1] - down[i + 1]));
            }
            return;
        }
        for i in 0..n - 1 {
            out[i + 1] += scale * (before[i] - along[i]);
        }
        if let Some(down) = self.down {
            let down = &down[..n];
            for i in 0..n {
                out[i] -= scale * down[i];
            }
        }
        if let Some(above) = self.above {
            let above = &above[..n];
            for i in 0..n {
                out[i] += scale * above[i];
            }
        }
    }
}

/// out <- b - a
struct Subtract<'a> {
    out: &'a mut [f64],
    b: &'a [f64],
    a: &'a [f64],
}

impl Kernel for Subtract<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let n = self.out.len().min(self.a.len()).min(self.b.len());
        let (out, b, a) = (&mut self.out[..n], &self.b[..n], &self.a[..n]);
        for i in 0..n {
            out[i] = b[i] - a[i];
        }
    }
}
