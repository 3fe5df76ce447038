//! What the local steps of all pixel terms have in common.

use proxel_split::{LocalReport, Order};

/// u <- u + (alpha - 1)(c - z) of the over-relaxed cycle, z = p + u staying as it is, and v <- c + u: what the prox is taken
/// of.
pub(super) fn begin(alpha: f64, c: &[f64], p: &mut [f64], u: &mut [f64], v: &mut [f64]) {
    if alpha != 1.0 {
        for ((u, c), p) in u.iter_mut().zip(c).zip(p) {
            let z = *p + *u;
            *u += (alpha - 1.0) * (c - z);
            *p = z - *u;
        }
    }
    for ((v, c), u) in v.iter_mut().zip(c).zip(u.iter()) {
        *v = c + u;
    }
}

/// Squares of a local step, each in four sums, so that a sum does not wait for the one before.
#[derive(Default)]
pub(super) struct Sums {
    moved: [f64; 4],
    gap_before: [f64; 4],
    gap: [f64; 4],
}

impl Sums {
    /// With z = prox(v) in `z` and p and u as [`begin`] has left them: the new p and u, and the squares.
    pub(super) fn end(&mut self, order: Order, c: &[f64], z: &[f64], p: &mut [f64], u: &mut [f64]) {
        let keeps_dual = order == Order::Zxu;
        let mut one = |k: usize, c: f64, z: f64, p: &mut f64, u: &mut f64| {
            let before = *p + *u;
            let (moved, gap_before, gap) = (z - before, c - before, c - z);
            self.moved[k] += moved * moved;
            self.gap_before[k] += gap_before * gap_before;
            self.gap[k] += gap * gap;
            if !keeps_dual {
                *u += gap;
            }
            *p = z - *u;
        };
        let n = z.len();
        let whole = n - n % 4;
        for i in (0..whole).step_by(4) {
            for k in 0..4 {
                one(k, c[i + k], z[i + k], &mut p[i + k], &mut u[i + k]);
            }
        }
        for i in whole..n {
            one(0, c[i], z[i], &mut p[i], &mut u[i]);
        }
    }

    pub(super) fn report(&self, weight2: f64, report: LocalReport) -> LocalReport {
        let total = |s: &[f64; 4]| weight2 * ((s[0] + s[1]) + (s[2] + s[3]));
        LocalReport {
            moved2: total(&self.moved),
            gap2_before: total(&self.gap_before),
            gap2: total(&self.gap),
            ..report
        }
    }
}
