//! The Douglas-Rachford variable, judged by residuals.

use super::carrier::{CHUNK, COUPLE, Carrier, Extrapolated, Sense, check_order, coupled, of_sense};
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem};
use rayon::prelude::*;

/// s = c(Dx) + u as the fixed point of the x-z-u iteration, which is that of Douglas and Rachford (Eckstein and Bertsekas 1992):
///
/// ```text
/// z = prox(s),   x = argmin f(x) + 1/2 |W(Dx - (2 z - s))|^2,   G(s) = s + Dx - z
/// ```
///
/// Over-relaxed by alpha, s = alpha c(Dx) + (1 - alpha) z + u, which is why z rides along with x and u.
///
/// It has half the numbers of (z, u), and z follows from it by the prox, so that hard sets are no obstacle. Its merit is the
/// square of the fixed-point residual, |W(G(s) - s)|^2 = |W(Dx - z)|^2, which needs the next x: a rejected point costs a
/// local and a global step. Ouyang et al.'s implementation has it for problems of many hard sets; [`super::Envelope`]
/// judges the same variable by an envelope of the objective.
pub struct DouglasRachford {
    sense: Sense, // of s, by Dx - z
    coupled: Vec<Vec<f64>>,
}

impl Carrier for DouglasRachford {
    const NAME: &'static str = "douglas-rachford";
    const ORDER: Order = Order::Xzu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::All;
    const LATE: bool = true;
    const SENSING: f64 = COUPLE;
    const REFUSAL: (f64, f64) = (1.0 + COUPLE, 1.0);
    const KEEPS_HISTORY: bool = false;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)?;
        // A z without a dual is no part of s, and would be a second variable.
        match admm.terms().iter().position(|term| !term.has_dual()) {
            Some(term) => Err(BuildError::NoDual { term, algorithm: Self::NAME }),
            None => Ok(()),
        }
    }

    fn new(problem: &Problem) -> Self {
        DouglasRachford { sense: Sense::new(problem, 1), coupled: coupled(problem) }
    }

    of_sense!(sense);

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        p: &[Vec<f64>],
        u: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        let (mut residual, mut weights) = (self.sense.residual.as_mut_slice(), self.sense.weights.as_slice());
        for (((term, coupled), p), u) in problem.terms.iter_mut().zip(&mut self.coupled).zip(p).zip(u) {
            term.couple(x, coupled);
            let (r_head, r_tail) = residual.split_at_mut(p.len());
            let (w_head, w_tail) = weights.split_at(p.len());
            let to = r_head.par_iter_mut().zip(w_head);
            to.zip(coupled.par_iter().zip(p).zip(u)).with_min_len(CHUNK).for_each(|((r, w), ((c, p), u))| {
                *r = w * (c - (p + u));
            });
            (residual, weights) = (r_tail, w_tail);
        }
        let merit = self.sense.merit();
        // s = z + u: z is its prox, u what is left.
        self.sense.begin(p, u, |p, u| p + 2.0 * u);
        Some(merit)
    }
}
