//! What Newton costs in iterations of the splitting.

use crate::{FactorCost, LinearSolver, NormalMatrix, Problem};

/// What an iteration of Newton costs in iterations of the splitting, counted, not timed, so that a run is the same on any
/// machine. Measured on nine models of 20,000 to 100,000 tetrahedra: an element costs the splitting 0.28 microseconds of a
/// core an iteration, and Newton 0.6 besides its linear solver; a factorisation runs at 67 billion operations a second
/// and core, and conjugate gradients read 6 billion bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Price {
    /// With a factor.
    pub factor: f64,
    /// With conjugate gradients.
    pub gradients: f64,
}

/// Seconds of a core that an iteration of the splitting spends on an element.
const SPLITTING: f64 = 0.28e-6;
/// And Newton, besides its linear solver.
const ASSEMBLY: f64 = 0.6e-6;
/// Seconds a floating-point operation of a factorisation.
const FLOP: f64 = 1.5e-11;
/// Seconds a byte that conjugate gradients read.
const BYTE: f64 = 1.0 / 6e9;
/// Conjugate-gradient steps of a typical iteration.
const STEPS: f64 = 50.0;

impl Price {
    /// For a problem with that many elements, a Hessian of `blocks` blocks of `dim` x `dim`, and a normal matrix whose
    /// factor has `entries` entries.
    pub fn new(elements: usize, blocks: usize, dim: usize, entries: f64, cost: &FactorCost) -> Self {
        let iteration = SPLITTING * elements.max(1) as f64;
        let assembly = ASSEMBLY / SPLITTING;
        // A step reads the factor twice, and each block for its row and its column.
        let step = BYTE * 16.0 * (entries + (blocks * dim * dim) as f64);
        Price { factor: assembly + FLOP * cost.flops / iteration, gradients: assembly + STEPS * step / iteration }
    }

    /// The price of a problem with this normal matrix, and what factoring its Hessian costs.
    pub fn of(problem: &Problem, normal: &NormalMatrix) -> (Self, FactorCost) {
        let elements = problem.terms.iter().map(|term| term.n_elems()).sum();
        let cost = FactorCost::of(normal, problem.dim);
        let entries = normal.symbolic().factor_nnz() as f64;
        (Price::new(elements, normal.matrix().0.nnz(), problem.dim, entries, &cost), cost)
    }
}

/// How Newton's systems are solved: with a factor where it fits the memory and costs less.
pub fn solver_for(price: &Price, cost: &FactorCost, memory: f64) -> LinearSolver {
    if cost.bytes <= memory && price.factor <= price.gradients {
        LinearSolver::Factor
    } else {
        LinearSolver::ConjugateGradients
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_where_it_fits_and_costs_less() {
        let cost = |flops, bytes| FactorCost { bytes, flops };
        let solver = |flops, bytes| {
            let cost = cost(flops, bytes);
            let price = Price::new(100_000, 200_000, 3, 2e6, &cost);
            solver_for(&price, &cost, 1e9)
        };
        assert_eq!(solver(9e9, 1e8), LinearSolver::Factor);
        assert_eq!(solver(9e9, 2e9), LinearSolver::ConjugateGradients);
        assert_eq!(solver(9e12, 1e8), LinearSolver::ConjugateGradients);
    }
}
