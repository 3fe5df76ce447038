//! The matrix of the global step, W(5a): assembled, analysed once, factored when the weights change.

use crate::Problem;
use proxel_linalg::sparse::{Cholesky, Ordering, SolveScratch, SparseError, SymPattern, Symbolic};
use std::sync::Arc;

/// A = sum w^2 D^T D + springs over the free nodes, and its factor. One matrix serves every coordinate.
pub struct NormalMatrix {
    dim: usize,
    pattern: SymPattern,
    values: Vec<f64>,
    factor: Cholesky<f64>,
    scratch: SolveScratch,
    refactorisations: usize,
}

/// Why the system cannot be solved.
#[derive(Clone, Debug, PartialEq)]
pub enum SystemError {
    /// The matrix is not positive definite: the named free node hangs on nothing.
    Singular {
        /// The node whose pivot vanished.
        node: usize,
    },
    /// Anything else that the factorisation reports.
    Factor(String),
}

impl std::fmt::Display for SystemError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            SystemError::Singular { node } => {
                write!(
                    f,
                    "the system is singular at node {node}: it is tied to no fixed node; pin a node of its component"
                )
            }
            SystemError::Factor(reason) => write!(f, "the system cannot be factored: {reason}"),
        }
    }
}

impl std::error::Error for SystemError {}

impl From<SparseError> for SystemError {
    fn from(e: SparseError) -> Self {
        match e {
            SparseError::NotPositiveDefinite { column, .. } => SystemError::Singular { node: column },
            other => SystemError::Factor(other.to_string()),
        }
    }
}

impl NormalMatrix {
    /// Analyses the pattern and factors the matrix of the weights as they are.
    ///
    /// # Errors
    /// A singular or non-finite matrix.
    pub fn new(problem: &Problem) -> Result<Self, SystemError> {
        let pattern = pattern_of(problem)?;
        let symbolic = Arc::new(Symbolic::analyze(&pattern, Ordering::Auto)?);
        let mut matrix = NormalMatrix {
            dim: problem.dim,
            values: vec![0.0; pattern.nnz()],
            pattern,
            factor: Cholesky::new(symbolic),
            scratch: SolveScratch::default(),
            refactorisations: 0,
        };
        matrix.fill_and_factor(problem)?;
        Ok(matrix)
    }

    fn fill_and_factor(&mut self, problem: &Problem) -> Result<(), SystemError> {
        self.values.fill(0.0);
        for term in &problem.terms {
            term.add_normal(&self.pattern, &mut self.values);
        }
        for (node, k, _) in &problem.quadratic.springs {
            if let Some(slot) = self.pattern.slot(*node as usize, *node as usize) {
                self.values[slot] += k;
            }
        }
        let (pattern, values) = (&self.pattern, &mut self.values);
        for spring in &problem.quadratic.points {
            spring.for_each_entry(problem.n_free, &mut |i, j, entry| {
                if let Some(slot) = pattern.slot(i, j) {
                    values[slot] += entry;
                }
            });
        }
        Ok(self.factor.refactor(&self.values)?)
    }

    /// Numbers anew, pattern as before.
    ///
    /// # Errors
    /// A singular or non-finite matrix.
    pub fn refactor(&mut self, problem: &Problem) -> Result<(), SystemError> {
        self.refactorisations += 1;
        self.fill_and_factor(problem)
    }

    /// b <- A^-1 b, for all coordinates of the free nodes.
    ///
    /// # Errors
    /// A vector of another length.
    pub fn solve(&mut self, b: &mut [f64]) -> Result<(), SystemError> {
        Ok(self.factor.solve_in_place(b, self.dim, &mut self.scratch)?)
    }

    /// How often the numbers were factored anew after the first time.
    pub fn refactorisations(&self) -> usize {
        self.refactorisations
    }

    /// Bytes that the factor takes, workspace included.
    pub fn factor_bytes(&self) -> u64 {
        let (factor, workspace) = self.factor.bytes();
        (factor + workspace) as u64
    }

    /// The values of the lower triangle, for tests and other methods.
    pub fn matrix(&self) -> (&SymPattern, &[f64]) {
        (&self.pattern, &self.values)
    }
}

/// Every pair of free nodes that share an element or a point.
fn pattern_of(problem: &Problem) -> Result<SymPattern, SystemError> {
    let free = problem.n_free as u32;
    let mut flat: Vec<u32> = Vec::new();
    let mut ends: Vec<usize> = vec![0];
    for term in &problem.terms {
        term.for_each_element(&mut |nodes| {
            flat.extend(nodes.iter().filter(|node| **node < free));
            ends.push(flat.len());
        });
    }
    for spring in &problem.quadratic.points {
        flat.extend(spring.nodes.iter().filter(|node| **node < free));
        ends.push(flat.len());
    }
    let cliques: Vec<&[u32]> = ends.windows(2).map(|w| &flat[w[0]..w[1]]).collect();
    Ok(SymPattern::from_cliques(problem.n_free, &cliques)?)
}
