//! Algorithm 2 with its variables as they are.

use super::carrier::{CHUNK, COUPLE, Carrier, Extrapolated, Sense, check_order, coupled, of_sense, packed_weights};
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem, vector};

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

/// out <- u - u_before; |w out|^2 + |w (now - then)|^2. Halves by halves, which allocates nothing.
fn departure(out: &mut [f64], of: [&[f64]; 5]) -> f64 {
    let n = out.len();
    if n <= CHUNK {
        let [u, u_before, w, now, then] = of.map(|v| &v[..n]);
        let mut sums = [0.0; 4];
        for i in 0..n {
            out[i] = u[i] - u_before[i];
            let (dual, moved) = (w[i] * out[i], w[i] * (now[i] - then[i]));
            sums[i % 4] += dual * dual + moved * moved;
        }
        return (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }
    let m = (n / 2).next_multiple_of(CHUNK);
    let (o0, o1) = out.split_at_mut(m);
    let halves = of.map(|v| v.split_at(m));
    let (l, r) = rayon::join(|| departure(o0, halves.map(|h| h.0)), || departure(o1, halves.map(|h| h.1)));
    l + r
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
            square += departure(of_u, [u, u_before, w, now, then]);
            (rest, rest_before) = (tail, tail_before);
        }
        Some(Merit::of_square(square))
    }
}
