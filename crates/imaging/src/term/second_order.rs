//! The two maps of second-order total generalised variation, over fields that wrap around.

use super::stencil::{Stencil, Visit};
use crate::Grid;
use rayon::prelude::*;
use std::f64::consts::FRAC_1_SQRT_2;

/// grad x - w: the differences of a field, less a field of slopes. x begins at node 0; w at `slopes`, in each row of pixels and
/// for each channel the slopes along the row and then those along the column.
#[derive(Clone, Copy, Debug)]
pub struct Slopes {
    /// First node of w.
    pub slopes: usize,
}

/// E w: the symmetrised backward differences of a field of slopes w = (a, b), in each row of pixels and for each channel
///
/// ```text
/// a_j - a_(j-1),    b_i - b_(i-1),    (a_i - a_(i-1) + b_j - b_(j-1)) / sqrt(2)
/// ```
///
/// so that the sum of their squares is the squared Frobenius norm of (grad w + grad w^T) / 2.
#[derive(Clone, Copy, Debug)]
pub struct Bends {
    /// First node of w, as in [`Slopes`].
    pub slopes: usize,
}

/// The one before, around the end.
fn before(k: usize, n: usize) -> usize {
    (k + n - 1) % n
}

/// The one after.
fn after(k: usize, n: usize) -> usize {
    (k + 1) % n
}

/// Plane `plane` of row `row` of a vector whose rows have so many planes.
fn plane(of: &[f64], width: usize, planes: usize, row: usize, plane: usize) -> &[f64] {
    &of[(row * planes + plane) * width..][..width]
}

impl Stencil for Slopes {
    fn local_row(&self, grid: Grid) -> usize {
        2 * grid.row_len()
    }

    fn row(&self, grid: Grid, x: &[f64], row: usize, out: &mut [f64]) {
        let (w, channels) = (grid.width, grid.channels);
        let below = after(row, grid.height);
        for (k, out) in out.chunks_mut(w).enumerate() {
            let here = plane(x, w, channels, row, k / 2);
            let slope = plane(&x[self.slopes..], w, 2 * channels, row, k);
            let there = plane(x, w, channels, if k % 2 == 0 { row } else { below }, k / 2);
            let step = usize::from(k % 2 == 0);
            for j in 0..w {
                out[j] = there[(j + step) % w] - here[j] - slope[j];
            }
        }
    }

    fn add_adjoint(&self, grid: Grid, scale: f64, p: &[f64], out: &mut [f64]) {
        let (w, channels) = (grid.width, grid.channels);
        let (x, slopes) = out.split_at_mut(self.slopes);
        let rows = x[..grid.len()].par_chunks_mut(grid.row_len()).enumerate().with_min_len(grid.task_rows());
        rows.for_each(|(row, x)| {
            for (c, x) in x.chunks_mut(w).enumerate() {
                let along = plane(p, w, 2 * channels, row, 2 * c);
                let (down, above) = (
                    plane(p, w, 2 * channels, row, 2 * c + 1),
                    plane(p, w, 2 * channels, before(row, grid.height), 2 * c + 1),
                );
                for j in 0..w {
                    x[j] += scale * (along[before(j, w)] - along[j] + above[j] - down[j]);
                }
            }
        });
        slopes.par_iter_mut().zip(p).with_min_len(grid.row_len()).for_each(|(s, p)| *s -= scale * p);
    }

    fn for_each(&self, grid: Grid, visit: &mut Visit<'_>) {
        let (w, h, channels) = (grid.width, grid.height, grid.channels);
        for i in 0..h {
            for k in 0..2 * channels {
                for j in 0..w {
                    let x = |i: usize, j: usize| ((i * channels + k / 2) * w + j) as u32;
                    let there = if k % 2 == 0 { x(i, after(j, w)) } else { x(after(i, h), j) };
                    let slope = (self.slopes + (i * 2 * channels + k) * w + j) as u32;
                    visit(&[(there, 1.0), (x(i, j), -1.0), (slope, -1.0)]);
                }
            }
        }
    }
}

impl Stencil for Bends {
    fn local_row(&self, grid: Grid) -> usize {
        3 * grid.row_len()
    }

    fn row(&self, grid: Grid, x: &[f64], row: usize, out: &mut [f64]) {
        let (w, planes) = (grid.width, 2 * grid.channels);
        let slopes = &x[self.slopes..];
        let above = before(row, grid.height);
        for (c, out) in out.chunks_mut(3 * w).enumerate() {
            let (a, b) = (plane(slopes, w, planes, row, 2 * c), plane(slopes, w, planes, row, 2 * c + 1));
            let (a_above, b_above) =
                (plane(slopes, w, planes, above, 2 * c), plane(slopes, w, planes, above, 2 * c + 1));
            for j in 0..w {
                out[j] = a[j] - a[before(j, w)];
                out[w + j] = b[j] - b_above[j];
                out[2 * w + j] = FRAC_1_SQRT_2 * (a[j] - a_above[j] + b[j] - b[before(j, w)]);
            }
        }
    }

    fn add_adjoint(&self, grid: Grid, scale: f64, p: &[f64], out: &mut [f64]) {
        let (w, channels) = (grid.width, grid.channels);
        let slopes = &mut out[self.slopes..self.slopes + 2 * grid.len()];
        let rows = slopes.par_chunks_mut(2 * grid.row_len()).enumerate().with_min_len(grid.task_rows());
        rows.for_each(|(row, slopes)| {
            let below = after(row, grid.height);
            let of = |row: usize, k: usize| plane(p, w, 3 * channels, row, k);
            for (c, slopes) in slopes.chunks_mut(2 * w).enumerate() {
                let (a, b) = slopes.split_at_mut(w);
                let (e11, e22, e12) = (of(row, 3 * c), of(row, 3 * c + 1), of(row, 3 * c + 2));
                let (e22_below, e12_below) = (of(below, 3 * c + 1), of(below, 3 * c + 2));
                for j in 0..w {
                    let next = after(j, w);
                    a[j] += scale * (e11[j] - e11[next] + FRAC_1_SQRT_2 * (e12[j] - e12_below[j]));
                    b[j] += scale * (e22[j] - e22_below[j] + FRAC_1_SQRT_2 * (e12[j] - e12[next]));
                }
            }
        });
    }

    fn for_each(&self, grid: Grid, visit: &mut Visit<'_>) {
        let (w, h, channels) = (grid.width, grid.height, grid.channels);
        let r = FRAC_1_SQRT_2;
        for i in 0..h {
            for c in 0..channels {
                let slope =
                    |i: usize, k: usize, j: usize| (self.slopes + (i * 2 * channels + 2 * c + k) * w + j) as u32;
                (0..w).for_each(|j| visit(&[(slope(i, 0, j), 1.0), (slope(i, 0, before(j, w)), -1.0)]));
                (0..w).for_each(|j| visit(&[(slope(i, 1, j), 1.0), (slope(before(i, h), 1, j), -1.0)]));
                (0..w).for_each(|j| {
                    visit(&[
                        (slope(i, 0, j), r),
                        (slope(before(i, h), 0, j), -r),
                        (slope(i, 1, j), r),
                        (slope(i, 1, before(j, w)), -r),
                    ]);
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::stencil::tests::assert_is_its_numbers;
    use super::*;

    /// Rows and transposes against the numbers one by one.
    #[test]
    fn maps_are_those_of_their_numbers() {
        for (width, height, channels) in [(5, 4, 1), (7, 3, 2), (1, 4, 1), (4, 1, 1), (1, 1, 1), (2, 2, 3)] {
            let grid = Grid { width, height, channels };
            // Something between x and w, as a blurred field is.
            let slopes = 2 * grid.len();
            let n = slopes + 2 * grid.len();
            let maps: [Box<dyn Stencil>; 2] = [Box::new(Slopes { slopes }), Box::new(Bends { slopes })];
            maps.iter().for_each(|map| assert_is_its_numbers(map.as_ref(), grid, n));
        }
    }
}
