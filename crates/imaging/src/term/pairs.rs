//! The local step of total variation of pairs of differences, in one pass over memory and one over registers.

use super::differences::Differences;
use super::pass::Sums;
use crate::prox::{minus_shrinkage, shrink_pairs};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use proxel_split::{Cycle, Order};
use std::ops::Range;

/// A row of a field whose pairs of differences shrink where they count.
pub(super) struct Row<'a> {
    pub of_field: &'a Differences,
    pub field: &'a [f64],
    pub row: usize,
    /// Its pixels that count.
    pub counted: Range<usize>,
    /// lambda / w^2
    pub threshold: f64,
}

impl Row<'_> {
    /// What a cycle does to the row's p and u; the sum of |z| over what counts.
    pub(super) fn shrink(&self, cycle: &Cycle, p: &mut [f64], u: &mut [f64], sums: &mut Sums) -> f64 {
        // In the z-x-u order the dual waits for x.
        let (step, dual) = (cycle.relaxation - 1.0, if cycle.order == Order::Zxu { 0.0 } else { 1.0 });
        let mut sizes = 0.0;
        self.for_each_part(&mut |part| {
            let size = dispatch(Pairs {
                step,
                dual,
                threshold: part.threshold,
                here: part.here,
                right: part.right,
                below: part.below,
                p: part.of(p),
                u: part.of(u),
                sums,
            });
            sizes += if part.counts { size } else { 0.0 };
        });
        sizes
    }

    /// [`Folded::step`](proxel_split::Folded) of the row; its -p, and the sum of |z| over what counts.
    pub(super) fn fold(&self, relaxation: f64, v: &mut [f64], minus_p: &mut [f64], sums: &mut Sums) -> f64 {
        let mut sizes = 0.0;
        self.for_each_part(&mut |part| {
            let size = dispatch(FoldedPairs {
                relaxation,
                threshold: part.threshold,
                here: part.here,
                right: part.right,
                below: part.below,
                v: part.of(v),
                minus_p: part.of(minus_p),
                sums,
            });
            sizes += if part.counts { size } else { 0.0 };
        });
        sizes
    }

    /// Visits the row channel by channel, and in each what does not count apart from what does.
    fn for_each_part(&self, visit: &mut dyn FnMut(Part<'_>)) {
        let grid = self.of_field.grid;
        let (w, len) = (grid.width, grid.row_len());
        if w == 0 {
            return;
        }
        let here = &self.field[self.row * len..(self.row + 1) * len];
        // Below the last row of a field that mirrors lies that row again, and behind the last pixel of a row that pixel.
        let below = self.of_field.below(self.field, self.row).unwrap_or(here);
        for c in 0..grid.channels {
            let plane = c * w..(c + 1) * w;
            let (here, below) = (&here[plane.clone()], &below[plane]);
            for (at, counts) in
                [(0..self.counted.start, false), (self.counted.clone(), true), (self.counted.end..w, false)]
            {
                visit(Part {
                    first: 2 * c * w + at.start,
                    width: w,
                    threshold: if counts { self.threshold } else { 0.0 },
                    counts,
                    here: &here[at.clone()],
                    right: here.get(at.end).copied().unwrap_or(here[self.of_field.other_side(0, w - 1)]),
                    below: &below[at],
                });
            }
        }
    }
}

/// A part of a row of one channel.
struct Part<'a> {
    first: usize, // of its differences along the row in those of the row
    width: usize, // of the row
    threshold: f64,
    counts: bool,
    here: &'a [f64],
    right: f64, // of the last pixel
    below: &'a [f64],
}

impl Part<'_> {
    /// Its differences along the row, and down the column.
    fn of<'v>(&self, row: &'v mut [f64]) -> [&'v mut [f64]; 2] {
        let (along, down) = row[self.first..].split_at_mut(self.width);
        let n = self.below.len();
        [&mut along[..n], &mut down[..n]]
    }
}

/// A part of a row of one channel: what a cycle does to it where z shrinks pairs, z = v max(0, 1 - threshold/|v|). The new p
/// and u, and the sum of |z|.
///
/// The same as [`super::pass::begin`], the prox and [`Sums::end`] one after another, without their round trips: differences,
/// v and z are never stored.
struct Pairs<'a> {
    step: f64,      // alpha - 1
    dual: f64,      // 1 where u moves by c - z, 0 where it stays
    threshold: f64, // 0 shrinks nothing
    here: &'a [f64],
    right: f64,            // what the last difference is taken to
    below: &'a [f64],      // the row below
    p: [&'a mut [f64]; 2], // along the row, down the column
    u: [&'a mut [f64]; 2],
    sums: &'a mut Sums,
}

/// Eight pixels: c, p and u become p and u; squares and norms are added to.
struct Lanes<I: Isa> {
    step: F8<I>,
    dual: F8<I>,
    threshold: F8<I>,
    sums: [F8<I>; 4], // z - z before, c - z before, c - z, |z|
}

impl<I: Isa> Lanes<I> {
    #[inline(always)]
    fn advance(&mut self, c: [F8<I>; 2], p: [F8<I>; 2], u: [F8<I>; 2]) -> [[F8<I>; 2]; 2] {
        let before = [p[0] + u[0], p[1] + u[1]];
        let off = [c[0] - before[0], c[1] - before[1]];
        let u = [self.step.mul_add(off[0], u[0]), self.step.mul_add(off[1], u[1])];
        let (z, size) = shrink_pairs([c[0] + u[0], c[1] + u[1]], self.threshold);
        self.sums[3] += size;
        let moved = [z[0] - before[0], z[1] - before[1]];
        let gap = [c[0] - z[0], c[1] - z[1]];
        // By index: closures are not compiled for the instruction set.
        for k in 0..2 {
            self.sums[0] = moved[k].mul_add(moved[k], self.sums[0]);
            self.sums[1] = off[k].mul_add(off[k], self.sums[1]);
            self.sums[2] = gap[k].mul_add(gap[k], self.sums[2]);
        }
        let u = [self.dual.mul_add(gap[0], u[0]), self.dual.mul_add(gap[1], u[1])];
        [[z[0] - u[0], u[0]], [z[1] - u[1], u[1]]]
    }
}

/// The first of eight numbers.
#[inline(always)]
fn put<I: Isa>(lanes: F8<I>, to: &mut [f64]) {
    let mut room = [0.0; LANES];
    lanes.store(&mut room);
    to.copy_from_slice(&room[..to.len()]);
}

/// The right neighbours of the i-th eight pixels of a row, of which the last has `end`; zeros behind it.
#[inline(always)]
fn right_of<I: Isa>(row: &[f64], i: usize, end: f64) -> F8<I> {
    let rest = &row[i * LANES + 1..];
    if let Some(lanes) = rest.first_chunk() {
        return F8::load(lanes);
    }
    let mut lanes = [0.0; LANES];
    lanes[..rest.len()].copy_from_slice(rest);
    lanes[rest.len()] = end;
    F8::load(&lanes)
}

/// Zeros where there are no pixels: they stay, and add nothing.
#[inline(always)]
fn filled<I: Isa>(rest: &[f64]) -> F8<I> {
    let mut lanes = [0.0; LANES];
    lanes[..rest.len()].copy_from_slice(rest);
    F8::load(&lanes)
}

impl Kernel for Pairs<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let ([pa, pb], [ua, ub]) = (self.p, self.u);
        let n = pa.len().min(pb.len()).min(ua.len()).min(ub.len()).min(self.below.len());
        let n = n.min(self.here.len());
        if n == 0 {
            return 0.0;
        }
        let (row, below) = (&self.here[..n], &self.below[..n]);
        let (here, here_rest) = row.as_chunks::<LANES>();
        let (below, below_rest) = below.as_chunks::<LANES>();
        let (pa, pa_rest) = pa[..n].as_chunks_mut::<LANES>();
        let (pb, pb_rest) = pb[..n].as_chunks_mut::<LANES>();
        let (ua, ua_rest) = ua[..n].as_chunks_mut::<LANES>();
        let (ub, ub_rest) = ub[..n].as_chunks_mut::<LANES>();
        let zero = F8::<I>::zero();
        let mut lanes = Lanes::<I> {
            step: F8::splat(self.step),
            dual: F8::splat(self.dual),
            threshold: F8::splat(self.threshold),
            sums: [F8::load(&self.sums.moved), F8::load(&self.sums.gap_before), F8::load(&self.sums.gap), zero],
        };
        for i in 0..here.len() {
            let x = F8::<I>::load(&here[i]);
            let c = [right_of(row, i, self.right) - x, F8::load(&below[i]) - x];
            let [a, b] = lanes.advance(c, [F8::load(&pa[i]), F8::load(&pb[i])], [F8::load(&ua[i]), F8::load(&ub[i])]);
            a[0].store(&mut pa[i]);
            a[1].store(&mut ua[i]);
            b[0].store(&mut pb[i]);
            b[1].store(&mut ub[i]);
        }
        if !here_rest.is_empty() {
            let x = filled(here_rest);
            let c = [right_of(row, here.len(), self.right) - x, filled(below_rest) - x];
            let [a, b] = lanes.advance(c, [filled(pa_rest), filled(pb_rest)], [filled(ua_rest), filled(ub_rest)]);
            put(a[0], pa_rest);
            put(a[1], ua_rest);
            put(b[0], pb_rest);
            put(b[1], ub_rest);
        }
        let [moved, gap_before, gap, sizes] = lanes.sums;
        moved.store(&mut self.sums.moved);
        gap_before.store(&mut self.sums.gap_before);
        gap.store(&mut self.sums.gap);
        sizes.sum()
    }
}

/// A part of a row of one channel, of which v = z + u alone is kept: z = prox(v), v <- v + alpha (c - z), then with the z of
/// the new v -p = v - 2 z; the sum of |z|. The same as [`Pairs`] but for rounding.
struct FoldedPairs<'a> {
    relaxation: f64,
    threshold: f64,
    here: &'a [f64],
    right: f64, // of the last pixel
    below: &'a [f64],
    v: [&'a mut [f64]; 2],
    minus_p: [&'a mut [f64]; 2],
    sums: &'a mut Sums,
}

/// K times eight pixels, side by side: each waits for its own numbers for longer than they take.
struct FoldedLanes<I: Isa> {
    relaxation: F8<I>,
    threshold: F8<I>,
    sums: [F8<I>; 4], // z - z before, c - z before, c - z, -|z|
}

impl<I: Isa> FoldedLanes<I> {
    /// The new v, and -p.
    #[inline(always)]
    fn advance<const K: usize>(&mut self, c: [[F8<I>; 2]; K], v: &mut [[F8<I>; 2]; K], minus_p: &mut [[F8<I>; 2]; K]) {
        // By index: closures are not compiled for the instruction set.
        let mut before = [[F8::zero(); 2]; K]; // -z
        for k in 0..K {
            let [minus, _] = minus_shrinkage(v[k], self.threshold);
            before[k] = [v[k][0] * minus, v[k][1] * minus];
        }
        for k in 0..K {
            for d in 0..2 {
                let off = c[k][d] + before[k][d];
                v[k][d] = self.relaxation.mul_add(off, v[k][d]);
                self.sums[1] = off.mul_add(off, self.sums[1]);
            }
        }
        for k in 0..K {
            let [minus, size] = minus_shrinkage(v[k], self.threshold);
            self.sums[3] = minus.mul_add(size, self.sums[3]);
            for d in 0..2 {
                let z = v[k][d] * minus; // -z
                let (moved, gap) = (z - before[k][d], c[k][d] + z);
                self.sums[0] = moved.mul_add(moved, self.sums[0]);
                self.sums[2] = gap.mul_add(gap, self.sums[2]);
                minus_p[k][d] = F8::splat(2.0).mul_add(z, v[k][d]);
            }
        }
    }
}

impl Kernel for FoldedPairs<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let ([va, vb], [pa, pb]) = (self.v, self.minus_p);
        let n = va.len().min(vb.len()).min(pa.len()).min(pb.len()).min(self.below.len());
        let n = n.min(self.here.len());
        if n == 0 {
            return 0.0;
        }
        let (row, below) = (&self.here[..n], &self.below[..n]);
        let (here, here_rest) = row.as_chunks::<LANES>();
        let (below, below_rest) = below.as_chunks::<LANES>();
        let (va, va_rest) = va[..n].as_chunks_mut::<LANES>();
        let (vb, vb_rest) = vb[..n].as_chunks_mut::<LANES>();
        let (pa, pa_rest) = pa[..n].as_chunks_mut::<LANES>();
        let (pb, pb_rest) = pb[..n].as_chunks_mut::<LANES>();
        let mut lanes = FoldedLanes::<I> {
            relaxation: F8::splat(self.relaxation),
            threshold: F8::splat(self.threshold),
            sums: [F8::load(&self.sums.moved), F8::load(&self.sums.gap_before), F8::load(&self.sums.gap), F8::zero()],
        };
        let mut i = 0;
        while i < here.len() {
            let two = i + 1 < here.len();
            macro_rules! advance {
                ($k:literal) => {{
                    let (mut c, mut v, mut p) =
                        ([[F8::<I>::zero(); 2]; $k], [[F8::zero(); 2]; $k], [[F8::zero(); 2]; $k]);
                    for k in 0..$k {
                        let x = F8::load(&here[i + k]);
                        c[k] = [right_of(row, i + k, self.right) - x, F8::load(&below[i + k]) - x];
                        v[k] = [F8::load(&va[i + k]), F8::load(&vb[i + k])];
                    }
                    lanes.advance(c, &mut v, &mut p);
                    for k in 0..$k {
                        v[k][0].store(&mut va[i + k]);
                        v[k][1].store(&mut vb[i + k]);
                        p[k][0].store(&mut pa[i + k]);
                        p[k][1].store(&mut pb[i + k]);
                    }
                    i += $k;
                }};
            }
            if two { advance!(2) } else { advance!(1) }
        }
        if !here_rest.is_empty() {
            let x = filled(here_rest);
            let c = [right_of(row, here.len(), self.right) - x, filled(below_rest) - x];
            let (mut v, mut p) = ([[filled(va_rest), filled(vb_rest)]], [[F8::zero(); 2]]);
            lanes.advance([c], &mut v, &mut p);
            put(v[0][0], va_rest);
            put(p[0][0], pa_rest);
            put(v[0][1], vb_rest);
            put(p[0][1], pb_rest);
        }
        let [moved, gap_before, gap, sizes] = lanes.sums;
        moved.store(&mut self.sums.moved);
        gap_before.store(&mut self.sums.gap_before);
        gap.store(&mut self.sums.gap);
        -sizes.sum()
    }
}
