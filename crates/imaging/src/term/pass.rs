//! What the local steps of all pixel terms have in common.

use crate::Pointwise;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use proxel_split::{LocalReport, Order};
use std::ops::Range;

/// u <- u + (alpha - 1)(c - z) of the over-relaxed cycle, z = p + u staying as it is, and v <- c + u: what the prox is taken
/// of.
pub(super) fn begin(alpha: f64, c: &[f64], p: &mut [f64], u: &mut [f64], v: &mut [f64]) {
    dispatch(Begin { alpha, c, p, u, v });
}

struct Begin<'a> {
    alpha: f64,
    c: &'a [f64],
    p: &'a mut [f64],
    u: &'a mut [f64],
    v: &'a mut [f64],
}

impl Kernel for Begin<'_> {
    type Output = ();

    // Loops by index, which are compiled for the instruction set.
    #[inline(always)]
    fn run<I: Isa>(self) {
        let n = self.v.len();
        let (c, p, u, v) = (&self.c[..n], &mut self.p[..n], &mut self.u[..n], &mut self.v[..n]);
        let step = self.alpha - 1.0;
        if step != 0.0 {
            for i in 0..n {
                let z = p[i] + u[i];
                u[i] += step * (c[i] - z);
                p[i] = z - u[i];
                v[i] = c[i] + u[i];
            }
        } else {
            for i in 0..n {
                v[i] = c[i] + u[i];
            }
        }
    }
}

/// p = 2 z - v of a row, and u = v - z where it is wanted, z = prox(v): what [`proxel_split::Folded`] keeps v for.
pub(super) fn unfold(
    of: &impl Pointwise,
    pixels: Range<usize>,
    weight2: f64,
    v: &[f64],
    p: &mut [f64],
    u: Option<&mut [f64]>,
) {
    p.copy_from_slice(v);
    of.prox(pixels, p, weight2);
    if let Some(u) = u {
        u.iter_mut().zip(v).zip(&*p).for_each(|((u, v), z)| *u = v - z);
    }
    p.iter_mut().zip(v).for_each(|(p, v)| *p = (*p + *p) - v);
}

/// Squares of a local step, lane by lane, so that a sum does not wait for the one before.
#[derive(Default)]
pub(super) struct Sums {
    pub(super) moved: [f64; LANES],
    pub(super) gap_before: [f64; LANES],
    pub(super) gap: [f64; LANES],
}

impl Sums {
    /// With z = prox(v) in `z` and p and u as [`begin`] has left them: the new p and u, and the squares.
    pub(super) fn end(&mut self, order: Order, c: &[f64], z: &[f64], p: &mut [f64], u: &mut [f64]) {
        // In the z-x-u order the dual waits for x.
        let dual = if order == Order::Zxu { 0.0 } else { 1.0 };
        dispatch(End { sums: self, dual, c, z, p, u });
    }

    pub(super) fn report(&self, weight2: f64, report: LocalReport) -> LocalReport {
        let total = |s: &[f64; LANES]| weight2 * (((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7])));
        LocalReport {
            moved2: total(&self.moved),
            gap2_before: total(&self.gap_before),
            gap2: total(&self.gap),
            ..report
        }
    }
}

struct End<'a> {
    sums: &'a mut Sums,
    dual: f64, // 1 where u moves by c - z, 0 where it stays
    c: &'a [f64],
    z: &'a [f64],
    p: &'a mut [f64],
    u: &'a mut [f64],
}

impl Kernel for End<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let (c, c_rest) = self.c.as_chunks::<LANES>();
        let (z, z_rest) = self.z.as_chunks::<LANES>();
        let (p, p_rest) = self.p.as_chunks_mut::<LANES>();
        let (u, u_rest) = self.u.as_chunks_mut::<LANES>();
        let mut moved = F8::<I>::load(&self.sums.moved);
        let mut gap_before = F8::<I>::load(&self.sums.gap_before);
        let mut gaps = F8::<I>::load(&self.sums.gap);
        for i in 0..p.len().min(u.len()).min(c.len()).min(z.len()) {
            let (ci, zi, ui) = (F8::<I>::load(&c[i]), F8::<I>::load(&z[i]), F8::<I>::load(&u[i]));
            let before = F8::<I>::load(&p[i]) + ui;
            let (dz, db, gap) = (zi - before, ci - before, ci - zi);
            moved = dz.mul_add(dz, moved);
            gap_before = db.mul_add(db, gap_before);
            gaps = gap.mul_add(gap, gaps);
            let ui = ui + gap * self.dual;
            ui.store(&mut u[i]);
            (zi - ui).store(&mut p[i]);
        }
        moved.store(&mut self.sums.moved);
        gap_before.store(&mut self.sums.gap_before);
        gaps.store(&mut self.sums.gap);
        for i in 0..p_rest.len() {
            let before = p_rest[i] + u_rest[i];
            let (dz, db, gap) = (z_rest[i] - before, c_rest[i] - before, c_rest[i] - z_rest[i]);
            self.sums.moved[0] += dz * dz;
            self.sums.gap_before[0] += db * db;
            self.sums.gap[0] += gap * gap;
            u_rest[i] += gap * self.dual;
            p_rest[i] = z_rest[i] - u_rest[i];
        }
    }
}
