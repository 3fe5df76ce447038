//! Forces that balance nearly, where the border is unknown or pixels were not measured, or where no transform makes them balance.

use super::Field;
use crate::room::Room;
use crate::{Differences, LocalCosines, Pointwise, Shrinkage, Stencil, TotalVariation};
use proxel_split::{Problem, vector};
use rayon::prelude::*;
use std::ops::Range;

/// Parts of all pixels that may have larger forces than the regulariser bears, of which one is taken: their forces are cut.
const CUT: [f64; 4] = [0.0, 1e-3, 4e-3, 1.5e-2];

/// A regulariser g(D x), by what is done to forces on D x. They are laid out as its term has them, row by row of pixels.
pub(super) trait Regular: Sync {
    /// Steps of conjugate gradients.
    const STEPS: usize;

    /// Numbers of a row.
    fn local_row(&self) -> usize;

    /// out <- D x
    fn apply(&self, x: &[f64], out: &mut [f64]);

    /// out += D^T q
    fn add_adjoint(&self, q: &[f64], out: &mut [f64]);

    /// 0 in what does not count of a row.
    fn clear_others(&self, pixels: &Range<usize>, q: &mut [f64]);

    /// Appends the gauges of a row's forces: 1 is what g bears.
    fn gauges(&self, pixels: &Range<usize>, q: &[f64], gauges: &mut Vec<f64>);

    /// v <- argmin g(z) + 1/2 |z - v|^2 in a row.
    fn prox(&self, pixels: Range<usize>, v: &mut [f64]);

    /// out <- about (D^T D + K^T K)^-1 r
    fn precondition(&self, field: &Field, r: &[f64], out: &mut [f64], room: &mut Room);
}

/// Total variation.
pub(super) struct Variation {
    of: TotalVariation,
    differences: Differences,
}

impl Variation {
    pub(super) fn new(of: TotalVariation, field: &Field) -> Self {
        Variation { of, differences: Differences { grid: field.grid, boundary: field.blur.boundary() } }
    }
}

impl Regular for Variation {
    const STEPS: usize = 5;

    fn local_row(&self) -> usize {
        2 * self.differences.grid.row_len()
    }

    fn apply(&self, x: &[f64], out: &mut [f64]) {
        self.differences.apply(x, out);
    }

    fn add_adjoint(&self, q: &[f64], out: &mut [f64]) {
        self.differences.add_adjoint(1.0, q, out);
    }

    fn clear_others(&self, pixels: &Range<usize>, q: &mut [f64]) {
        self.of.clear_others(pixels, q);
    }

    fn gauges(&self, pixels: &Range<usize>, q: &[f64], gauges: &mut Vec<f64>) {
        self.of.sizes(pixels, q, gauges);
    }

    fn prox(&self, pixels: Range<usize>, v: &mut [f64]) {
        self.of.prox(pixels, v, 1.0);
    }

    fn precondition(&self, field: &Field, r: &[f64], out: &mut [f64], room: &mut Room) {
        field.blur.precondition(field.grid, r, out, room);
    }
}

/// Local cosines.
pub(super) struct Frame<'a> {
    of: &'a Shrinkage,
    cosines: LocalCosines,
    field: &'a Field,
}

impl<'a> Frame<'a> {
    pub(super) fn new(of: &'a Shrinkage, field: &'a Field) -> Self {
        Frame { of, cosines: LocalCosines::default(), field }
    }
}

impl Regular for Frame<'_> {
    const STEPS: usize = 6;

    fn local_row(&self) -> usize {
        self.cosines.local_row(self.field.grid)
    }

    fn apply(&self, x: &[f64], out: &mut [f64]) {
        let rows = out.par_chunks_mut(self.local_row()).enumerate();
        rows.for_each(|(row, out)| self.cosines.row(self.field.grid, x, row, out));
    }

    fn add_adjoint(&self, q: &[f64], out: &mut [f64]) {
        self.cosines.add_adjoint(self.field.grid, 1.0, q, out);
    }

    /// The mean does not count either.
    fn clear_others(&self, pixels: &Range<usize>, q: &mut [f64]) {
        self.of.clear_others(pixels, q);
    }

    fn gauges(&self, pixels: &Range<usize>, q: &[f64], gauges: &mut Vec<f64>) {
        self.of.gauges(pixels, q, gauges);
    }

    fn prox(&self, pixels: Range<usize>, v: &mut [f64]) {
        self.of.prox(pixels, v, 1.0);
    }

    /// The identity: D^T D is, and where the mean is missing the blur lets through what is missing with it, so that the sum is
    /// near the identity but for what was not seen.
    fn precondition(&self, _: &Field, r: &[f64], out: &mut [f64], _: &mut Room) {
        vector::copy(out, r);
    }
}

/// A lower bound of the objective over images with values in the range: for forces q that g bears (its conjugate is 0 there),
/// and q_y,
///
/// ```text
/// objective(b) >= <q, D b> + <q_y, K b> - G*(q_y) >= sum over nodes of min(r low, r high) - G*(q_y),  r = D^T q + K^T q_y
/// ```
///
/// Those of the splitting leave an r that vanishes as it converges, but is large about the border for long. It is given back to
/// them in the least way, w to the regulariser and e to the data, D^T w + K^T e = r where they count:
///
/// ```text
/// min 1/2 |w|^2 + 1/2 |e|^2:    w = T D psi,  e = M K psi,   (D^T T D + K^T M K) psi = r
/// ```
///
/// T and M leave out what does not count. That takes few steps of conjugate gradients with about the same sum without T and M
/// before it. q - w is then over what g bears here and there, mostly by little: all forces are divided by what few pixels
/// surpass, and at those q is cut. What that leaves of r counts against the range.
///
/// `q` and `q_y` are the forces on D x and on y = K x, both used up, `r` is over the nodes of x. None where a term does not know
/// its conjugate.
pub(super) fn lower_bound<R: Regular>(
    problem: &Problem,
    [q, q_y]: [&mut [f64]; 2],
    r: &[f64],
    field: &Field,
    regular: &R,
    [low, high]: [f64; 2],
    room: &mut Room,
) -> Option<f64> {
    let (grid, local) = (field.grid, regular.local_row());
    let row = |row: usize| row * grid.width..(row + 1) * grid.width;
    let psi = potential(field, regular, r, room);
    let mut w = room.take(q.len());
    regular.apply(&psi, &mut w);
    vector::add_scaled(q, -1.0, &w);
    let mut e = room.take(grid.len());
    field.blur.apply_in(grid, false, &psi, &mut e, room);
    vector::add_scaled(q_y, -1.0, &e);
    clear_unmeasured(field, q_y);
    // K^T q_y, in the place of e.
    field.blur.apply_in(grid, true, q_y, &mut e, room);
    let gauge = if field.held.is_some() { 0.0 } else { problem.terms.get(1)?.gauge(q_y)? };
    let mut gauges = Vec::with_capacity(grid.n_pixels());
    q.chunks(local).enumerate().for_each(|(i, q)| regular.gauges(&row(i), q, &mut gauges));
    let mut bounds = Vec::new();
    let (mut cut, mut left, mut scaled) = (w, psi, room.take(q_y.len()));
    for part in CUT {
        let surpassed = (part * gauges.len() as f64) as usize;
        let largest = if gauges.is_empty() { 0.0 } else { *nth_largest(&mut gauges, surpassed) };
        let scale = 1.0 / largest.max(gauge).max(1.0);
        if !scale.is_normal() {
            return None;
        }
        // The nearest forces that g bears: v - prox(v), by Moreau's identity; 0 where nothing counts.
        cut.par_chunks_mut(local).zip(q.par_chunks(local)).enumerate().for_each(|(i, (cut, q))| {
            cut.iter_mut().zip(q).for_each(|(cut, q)| *cut = scale * q);
            regular.prox(row(i), cut);
            cut.iter_mut().zip(q).for_each(|(cut, q)| *cut = scale * q - *cut);
        });
        left.iter_mut().zip(&e).for_each(|(left, e)| *left = scale * e);
        regular.add_adjoint(&cut, &mut left);
        scaled.iter_mut().zip(&*q_y).for_each(|(s, q)| *s = scale * q);
        let worst: f64 = left.iter().map(|r| (r * low).min(r * high)).sum();
        let conjugate = match &field.held {
            Some(data) => data.conjugate(&scaled),
            None => problem.terms.get(1)?.conjugate(&scaled)?,
        };
        bounds.push(worst - conjugate);
    }
    room.give([e, cut, left, scaled]);
    bounds.into_iter().filter(|b| b.is_finite()).reduce(f64::max)
}

/// The element that so many others are not smaller than.
fn nth_largest(sizes: &mut [f64], n: usize) -> &f64 {
    let n = n.min(sizes.len() - 1);
    sizes.select_nth_unstable_by(n, |a, b| b.total_cmp(a)).1
}

fn clear_unmeasured(field: &Field, of_y: &mut [f64]) {
    of_y.iter_mut().zip(field.measured.iter()).filter(|(_, measured)| !**measured).for_each(|(v, _)| *v = 0.0);
}

/// psi after some steps of conjugate gradients from 0.
fn potential<R: Regular>(field: &Field, regular: &R, r: &[f64], room: &mut Room) -> Vec<f64> {
    let (grid, n) = (field.grid, r.len());
    let local = regular.local_row();
    let (mut w, mut e) = (room.take(local * grid.height), room.take(n));
    let mut apply = |of: &[f64], out: &mut [f64], room: &mut Room| {
        field.blur.apply_in(grid, false, of, &mut e, room);
        clear_unmeasured(field, &mut e);
        field.blur.apply_in(grid, true, &e, out, room);
        regular.apply(of, &mut w);
        w.par_chunks_mut(local).enumerate().for_each(|(i, w)| {
            regular.clear_others(&(i * grid.width..(i + 1) * grid.width), w);
        });
        regular.add_adjoint(&w, out);
    };
    let (mut psi, mut residual) = (room.zeros(n), room.take(n));
    vector::copy(&mut residual, r);
    let [mut z, mut image, mut direction] = [0; 3].map(|_| room.take(n));
    regular.precondition(field, &residual, &mut z, room);
    vector::copy(&mut direction, &z);
    let mut square = vector::dot(&residual, &z);
    for _ in 0..R::STEPS {
        apply(&direction, &mut image, room);
        let curvature = vector::dot(&direction, &image);
        // Nothing is left, or what is left is rounding.
        if !(curvature > 0.0 && square > 0.0) {
            break;
        }
        let step = square / curvature;
        vector::add_scaled(&mut psi, step, &direction);
        vector::add_scaled(&mut residual, -step, &image);
        regular.precondition(field, &residual, &mut z, room);
        let before = std::mem::replace(&mut square, vector::dot(&residual, &z));
        direction.par_iter_mut().zip(&z).for_each(|(d, z)| *d = z + square / before * *d);
    }
    room.give([w, e, residual, z, image, direction]);
    psi
}
