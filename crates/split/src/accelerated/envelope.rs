//! The Douglas-Rachford iteration, judged by its envelope.

use super::carrier::{CHUNK, COUPLE, Carrier, Extrapolated, Sense, check_order, coupled, of_sense};
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem, vector};
use rayon::prelude::*;

/// The Douglas-Rachford iteration on s and its envelope (Ouyang et al. 2020; Themelis and Patrinos 2020), for the identity
/// as coupling:
///
/// ```text
/// z = prox(s),   x = argmin f(x) + 1/2 |W(Dx - (2 z - s))|^2,   G(s) = s + Dx - z
/// envelope = f(x) + g(z) + <W^2 (s - z), Dx - z> + 1/2 |W(Dx - z)|^2
/// ```
///
/// s is c(Dx) + u of ADMM as it goes into the local step, so that (x, u) carries it and s - z is the new u. With fixed nodes
/// eliminated f is the quadratic of the problem, or 0.
pub struct Envelope {
    sense: Sense,       // of s, by Dx - z
    scaled_u: Vec<f64>, // W u
    coupled: Vec<Vec<f64>>,
}

impl Carrier for Envelope {
    const NAME: &'static str = "aadr";
    const ORDER: Order = Order::Xzu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::PositionsAndDual;
    const LATE: bool = true;
    const SENSING: f64 = 1.5 * COUPLE;
    const REFUSAL: (f64, f64) = (1.0 + COUPLE, 1.0);
    const KEEPS_HISTORY: bool = true;

    /// Hard sets are no obstacle: z follows from s by the prox.
    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)
    }

    fn new(problem: &Problem) -> Self {
        let sense = Sense::new(problem, 1);
        Envelope { scaled_u: sense.before.clone(), sense, coupled: coupled(problem) }
    }

    of_sense!(sense);

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        p: &[Vec<f64>],
        u: &[Vec<f64>],
        local: &LocalReport,
    ) -> Option<Merit> {
        let (mut residual, mut duals) = (self.sense.residual.as_mut_slice(), self.scaled_u.as_mut_slice());
        let mut weights = self.sense.weights.as_slice();
        for (((term, coupled), p), u) in problem.terms.iter_mut().zip(&mut self.coupled).zip(p).zip(u) {
            term.couple(x, coupled);
            let (r_head, r_tail) = residual.split_at_mut(p.len());
            let (s_head, s_tail) = duals.split_at_mut(p.len());
            let (w_head, w_tail) = weights.split_at(p.len());
            let to = r_head.par_iter_mut().zip(s_head).zip(w_head);
            to.zip(coupled.par_iter().zip(p).zip(u)).with_min_len(CHUNK).for_each(|(((r, s), w), ((c, p), u))| {
                *r = w * (c - (p + u));
                *s = w * u;
            });
            (residual, duals, weights) = (r_tail, s_tail, w_tail);
        }
        let f = problem.quadratic.value_and_gradient(x, problem.dim, None);
        let (square, product) = vector::two_dots(&self.sense.residual, &self.sense.residual, &self.scaled_u);
        // s = z + u: z is its prox, u what is left.
        self.sense.begin(p, u, |p, u| p + 2.0 * u);
        Some(Merit { value: f + local.value_after + product + 0.5 * square, residual: square.sqrt() })
    }
}
