//! Algorithm 2 with its variables as they are.

use super::carrier::{CHUNK, COUPLE, Carrier, Extrapolated, Sense, check_order, coupled, of_sense, packed_weights};
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem, vector};
use rayon::prelude::*;

/// A, Algorithm 2, as its authors' implementation runs it: (x, u) as the fixed point of the z-x-u iteration, and
/// theta = argmin |F - dF theta| over F = (x_next - x, u_next - u) in the Euclidean norm, without weights and without D.
/// Points are judged as those of [`super::CombinedResidualZxu`] are, by A(12).
///
/// What that metric sees of x are also the motions that D maps to nothing, such as those of the whole body, which only the
/// quadratic and terms without a dual hold; the metric of the splitting does not.
pub struct CombinedResidualRaw {
    sense: Sense,           // of (x, u) of free nodes and of terms that have a dual
    weights: Vec<f64>,      // w, an entry for each of z
    before: Vec<Vec<f64>>,  // c(Dx) before the cycle
    coupled: Vec<Vec<f64>>, // c(Dx) after it
}

/// Numbers of x that are sensed.
fn free(problem: &Problem) -> usize {
    problem.n_free * problem.dim
}

fn couple(problem: &mut Problem, x: &[f64], out: &mut [Vec<f64>]) {
    for (term, out) in problem.terms.iter_mut().zip(out) {
        term.couple(x, out);
    }
}

impl Carrier for CombinedResidualRaw {
    const NAME: &'static str = "algorithm 2";
    const ORDER: Order = Order::Zxu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::PositionsAndDual;
    const LATE: bool = true;
    const SENSING: f64 = 2.0 * COUPLE;
    const REFUSAL: (f64, f64) = (1.0 + COUPLE, 1.0);
    const KEEPS_HISTORY: bool = false;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)
    }

    fn new(problem: &Problem) -> Self {
        let duals: usize = problem.terms.iter().filter(|term| term.has_dual()).map(|term| term.local_len()).sum();
        CombinedResidualRaw {
            sense: Sense::unweighted(free(problem) + duals),
            weights: packed_weights(problem),
            before: coupled(problem),
            coupled: coupled(problem),
        }
    }

    of_sense!(sense);

    fn reweigh(&mut self, problem: &Problem) {
        self.weights = packed_weights(problem);
    }

    fn before(&mut self, problem: &mut Problem, x: &[f64], _: &[Vec<f64>], u: &[Vec<f64>]) {
        couple(problem, x, &mut self.before);
        let (positions, mut rest) = self.sense.before.split_at_mut(free(problem));
        vector::copy(positions, &x[..positions.len()]);
        for (_, u) in problem.terms.iter().zip(u).filter(|(term, _)| term.has_dual()) {
            let (head, tail) = rest.split_at_mut(u.len());
            vector::copy(head, u);
            rest = tail;
        }
    }

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        _: &[Vec<f64>],
        u: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        couple(problem, x, &mut self.coupled);
        let Sense { before, residual, .. } = &mut self.sense;
        let (positions, mut rest) = residual.split_at_mut(free(problem));
        let (positions_before, mut rest_before) = before.split_at(positions.len());
        vector::subtract(positions, &x[..positions.len()], positions_before);
        let (mut square, mut weights) = (0.0, self.weights.as_slice());
        let terms = problem.terms.iter().zip(u).zip(self.coupled.iter().zip(&self.before));
        for ((term, u), (now, then)) in terms {
            let (w, w_tail) = weights.split_at(now.len());
            weights = w_tail;
            if !term.has_dual() {
                continue;
            }
            // c(Dx) - z is the change of u.
            let (of_u, tail) = rest.split_at_mut(u.len());
            let (u_before, tail_before) = rest_before.split_at(u.len());
            let numbers = of_u.par_chunks_mut(CHUNK).zip(u.par_chunks(CHUNK)).zip(u_before.par_chunks(CHUNK));
            let sensed = w.par_chunks(CHUNK).zip(now.par_chunks(CHUNK).zip(then.par_chunks(CHUNK)));
            let squares: Vec<f64> = numbers
                .zip(sensed)
                .map(|(((of_u, u), u_before), (w, (now, then)))| {
                    let mut sums = [0.0; 4];
                    for i in 0..of_u.len() {
                        of_u[i] = u[i] - u_before[i];
                        let (dual, moved) = (w[i] * of_u[i], w[i] * (now[i] - then[i]));
                        sums[i % 4] += dual * dual + moved * moved;
                    }
                    (sums[0] + sums[1]) + (sums[2] + sums[3])
                })
                .collect();
            square += squares.iter().sum::<f64>();
            (rest, rest_before) = (tail, tail_before);
        }
        Some(Merit::of_square(square))
    }
}
