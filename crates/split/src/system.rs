//! The matrix of the global step, W(5a): assembled, analysed once, factored when the weights change.

use crate::Problem;
use crate::equality::Within;
use proxel_linalg::sparse::{Cholesky, Ordering, Purpose, SolveScratch, SparseError, SymPattern, Symbolic};
use rayon::prelude::*;
use std::sync::Arc;

/// Nodes that a task handles.
const CHUNK: usize = 4096;

/// Parts of the diagonal that are added to it, one after the other, where rounding makes a matrix indefinite.
const SHIFTS: [f64; 4] = [1e-14, 1e-12, 1e-10, 1e-8];

/// Digits of a factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 64 bits: solves are exact to rounding.
    #[default]
    Double,
    /// 32 bits: six or seven digits for half the bytes, and so half the time. Enough for the first Hessian of a
    /// quasi-Newton method, whose gradients are exact. A matrix that 32 bits cannot factor gets 64.
    Single,
}

/// A factor in either precision.
pub(crate) enum Factor {
    Double(Cholesky<f64>),
    Single(Cholesky<f32>),
}

impl Factor {
    /// One without numbers yet.
    pub(crate) fn new(symbolic: Arc<Symbolic>, precision: Precision, purpose: Purpose) -> Self {
        match precision {
            Precision::Double => Factor::Double(Cholesky::for_purpose(symbolic, purpose)),
            Precision::Single => Factor::Single(Cholesky::for_purpose(symbolic, purpose)),
        }
    }

    /// The numbers of a matrix, or the first pivot that is not positive.
    pub(crate) fn refactor_if_definite(&mut self, values: &[f64]) -> Result<(), SparseError> {
        match self {
            Factor::Double(factor) => factor.refactor_if_definite(values),
            Factor::Single(factor) => factor.refactor_if_definite(values),
        }
    }

    /// Bytes of the factor and of its workspace.
    pub(crate) fn bytes(&self) -> u64 {
        let (factor, workspace) = match self {
            Factor::Double(factor) => factor.bytes(),
            Factor::Single(factor) => factor.bytes(),
        };
        (factor + workspace) as u64
    }

    pub(crate) fn solve(&self, b: &mut [f64], nrhs: usize, scratch: &mut SolveScratch) -> Result<(), SparseError> {
        match self {
            Factor::Double(factor) => factor.solve_in_place(b, nrhs, scratch),
            Factor::Single(factor) => factor.solve_in_place(b, nrhs, scratch),
        }
    }
}

/// A = sum w^2 D^T D + springs + K + M/dt^2 over the free nodes, and its factor. One matrix serves every coordinate.
pub struct NormalMatrix {
    dim: usize,
    pattern: SymPattern,
    values: Vec<f64>,
    symbolic: Arc<Symbolic>,
    factor: Factor,
    scratch: SolveScratch,
    within: Option<Within>, // where there are equalities
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
    /// No fault of the system: the method cannot make progress, for the reason told.
    Stalled(String),
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
            SystemError::Stalled(reason) => f.write_str(reason),
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
        Self::with_precision(problem, Precision::Double)
    }

    /// As [`Self::new`], with a factor of this precision.
    ///
    /// # Errors
    /// A singular or non-finite matrix.
    pub fn with_precision(problem: &Problem, precision: Precision) -> Result<Self, SystemError> {
        // Along equalities a gradient can be the small difference of large forces, of which 32 bits leave nothing.
        let precision = if problem.quadratic.equalities.is_empty() { precision } else { Precision::Double };
        let pattern = pattern_of(problem)?;
        let symbolic = Arc::new(Symbolic::analyze(&pattern, Ordering::Auto)?);
        let mut matrix = NormalMatrix {
            dim: problem.dim,
            values: vec![0.0; pattern.nnz()],
            pattern,
            factor: Factor::new(symbolic.clone(), precision, Purpose::ManySolves),
            symbolic,
            scratch: SolveScratch::default(),
            within: None,
            refactorisations: 0,
        };
        let equalities = &problem.quadratic.equalities;
        if !equalities.is_empty() {
            matrix.within = Some(Within::new(equalities, problem.n_free));
        }
        matrix.fill_and_factor(problem, 0.0)?;
        Ok(matrix)
    }

    /// The matrix of no nodes, in place of one that nobody needs. It solves nothing.
    ///
    /// # Errors
    /// None in practice.
    pub fn none() -> Result<Self, SystemError> {
        Self::new(&Problem::empty())
    }

    fn fill_and_factor(&mut self, problem: &Problem, shift: f64) -> Result<(), SystemError> {
        self.values.fill(0.0);
        for term in &problem.terms {
            term.add_normal(&self.pattern, &mut self.values);
        }
        for (node, k, _) in &problem.quadratic.springs {
            if let Some(slot) = self.pattern.slot(*node as usize, *node as usize) {
                self.values[slot] += k;
            }
        }
        for (node, k) in problem.quadratic.inertia.stiffness().iter().enumerate().take(problem.n_free) {
            self.values[self.pattern.diagonal_slot(node)] += k;
        }
        let (pattern, values) = (&self.pattern, &mut self.values);
        for spring in &problem.quadratic.points {
            spring.for_each_entry(problem.n_free, &mut |i, j, entry| {
                if let Some(slot) = pattern.slot(i, j) {
                    values[slot] += entry;
                }
            });
        }
        problem.quadratic.form.add_to(&self.pattern, &mut self.values);
        if shift > 0.0 {
            for node in 0..problem.n_free {
                self.values[self.pattern.diagonal_slot(node)] *= 1.0 + shift;
            }
        }
        let in_single = match &mut self.factor {
            Factor::Single(factor) => factor.refactor(&self.values).is_ok(),
            Factor::Double(_) => false,
        };
        if !in_single {
            if let Factor::Single(_) = self.factor {
                self.factor = Factor::Double(Cholesky::new(self.symbolic.clone()));
            }
            if let Factor::Double(factor) = &mut self.factor {
                factor.refactor(&self.values)?;
            }
        }
        if let Some(within) = &mut self.within {
            let (factor, scratch) = (&self.factor, &mut self.scratch);
            if !within.refresh(|b| factor.solve(b, 1, scratch))? {
                return Err(SystemError::Factor("the equality constraints depend on each other".to_string()));
            }
        }
        Ok(())
    }

    /// Numbers anew, pattern as before.
    ///
    /// # Errors
    /// A non-finite matrix.
    pub fn refactor(&mut self, problem: &Problem) -> Result<(), SystemError> {
        self.refactorisations += 1;
        let mut end = self.fill_and_factor(problem, 0.0);
        // It has been positive definite with other weights, so it is now; weights that are far apart hide it in rounding.
        for shift in SHIFTS {
            if !matches!(end, Err(SystemError::Singular { .. })) {
                break;
            }
            end = self.fill_and_factor(problem, shift);
        }
        end
    }

    /// b <- A^-1 b, for all coordinates of the free nodes; where the problem has equalities, the minimiser of
    /// 1/2 x^T A x - b . x over displacements x that keep them. As exact as the factor's precision allows.
    ///
    /// # Errors
    /// A vector of another length.
    pub fn solve(&mut self, b: &mut [f64]) -> Result<(), SystemError> {
        match self.diagonal() {
            // A factor would only be a detour.
            Some(diagonal) if b.len() == self.dim * diagonal.len() => {
                let nodes = b.par_chunks_exact_mut(self.dim).zip(diagonal).with_min_len(CHUNK);
                nodes.for_each(|(b, a)| b.iter_mut().for_each(|b| *b /= a));
            }
            _ => self.factor.solve(b, self.dim, &mut self.scratch)?,
        }
        if let Some(within) = &mut self.within {
            within.restrict(b, self.dim);
        }
        Ok(())
    }

    /// The diagonal, where no element ties nodes to each other and there is nothing beside it.
    pub fn diagonal(&self) -> Option<&[f64]> {
        (self.pattern.nnz() == self.pattern.n()).then_some(&self.values)
    }

    /// The precision of the factor as it is.
    pub fn precision(&self) -> Precision {
        match self.factor {
            Factor::Double(_) => Precision::Double,
            Factor::Single(_) => Precision::Single,
        }
    }

    /// y <- A x, for all coordinates of the free nodes.
    ///
    /// # Errors
    /// A vector of another length.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        Ok(self.pattern.multiply(&self.values, x, self.dim, y)?)
    }

    /// How often the numbers were factored anew after the first time.
    pub fn refactorisations(&self) -> usize {
        self.refactorisations
    }

    /// Bytes that the factor takes, workspace included.
    pub fn factor_bytes(&self) -> u64 {
        self.factor.bytes()
    }

    /// The analysis of the pattern.
    pub fn symbolic(&self) -> &Symbolic {
        &self.symbolic
    }

    /// The values of the lower triangle, for tests and other methods.
    pub fn matrix(&self) -> (&SymPattern, &[f64]) {
        (&self.pattern, &self.values)
    }
}

/// Every pair of free nodes that share an element or a point, or have an entry of the quadratic form.
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
    problem.quadratic.form.for_each_pair(&mut |i, j| {
        if i < free {
            flat.extend([i, j]);
            ends.push(flat.len());
        }
    });
    for spring in &problem.quadratic.points {
        flat.extend(spring.nodes.iter().filter(|node| **node < free));
        ends.push(flat.len());
    }
    let cliques: Vec<&[u32]> = ends.windows(2).map(|w| &flat[w[0]..w[1]]).collect();
    Ok(SymPattern::from_cliques(problem.n_free, &cliques)?)
}
