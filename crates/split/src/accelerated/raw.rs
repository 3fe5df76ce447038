//! Algorithm 2 with its variables as they are.

use super::carrier::{COUPLE, Carrier, Extrapolated, Sense, check_order, of_sense};
use super::pair::CombinedResidualZxu;
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem};

/// A, Algorithm 2, as its authors' implementation runs it: (x, u) as the fixed point of the z-x-u iteration, and
/// theta = argmin |F - dF theta| over F = (x_next - x, u_next - u) in the Euclidean norm, without weights and without D.
/// Points are judged as those of [`CombinedResidualZxu`] are, by A(12).
///
/// What that metric sees of x are also the motions that D maps to nothing, such as those of the whole body, which only the
/// quadratic and terms without a dual hold; the metric of the splitting does not.
pub struct CombinedResidualRaw {
    judge: CombinedResidualZxu,
    sense: Sense, // of (x, u) of free nodes and of terms that have a dual
}

/// The free numbers of x, then u of the terms that have one.
fn parts<'a>(problem: &'a Problem, x: &'a [f64], u: &'a [Vec<f64>]) -> impl Iterator<Item = &'a [f64]> {
    let duals = problem.terms.iter().zip(u).filter(|(term, _)| term.has_dual()).map(|(_, u)| u.as_slice());
    std::iter::once(&x[..problem.n_free * problem.dim]).chain(duals)
}

fn pack<'a>(out: &mut [f64], parts: impl Iterator<Item = &'a [f64]>) {
    let mut out = out;
    for part in parts {
        let (head, tail) = out.split_at_mut(part.len());
        head.copy_from_slice(part);
        out = tail;
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
        let sense = Sense::unweighted(problem.n_free * problem.dim + duals);
        CombinedResidualRaw { judge: CombinedResidualZxu::new(problem), sense }
    }

    of_sense!(sense);

    fn reweigh(&mut self, problem: &Problem) {
        self.judge.reweigh(problem);
    }

    fn before(&mut self, problem: &mut Problem, x: &[f64], p: &[Vec<f64>], u: &[Vec<f64>]) {
        self.judge.before(problem, x, p, u);
        pack(&mut self.sense.before, parts(problem, x, u));
    }

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        p: &[Vec<f64>],
        u: &[Vec<f64>],
        local: &LocalReport,
    ) -> Option<Merit> {
        pack(&mut self.sense.residual, parts(problem, x, u));
        self.sense.subtract();
        self.judge.after_global(problem, x, p, u, local)
    }
}
