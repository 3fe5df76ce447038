//! The Hessian of a problem: assembled, multiplied, factored.

use crate::system::Factor;
use crate::{NormalMatrix, Precision, Problem, Projection, SystemError};
use proxel_linalg::sparse::{BlockMatrix, Purpose, SolveScratch, SparseError, Symbolic};
use std::sync::Arc;

/// d^2 E / dx^2 over the free nodes, and its factor, in f32 unless f64 is asked for.
pub struct Hessian {
    matrix: BlockMatrix,
    potentials: Vec<u32>, // slots of the blocks of potentials, in the order in which they come; NONE for fixed nodes
    form: Vec<f64>,       // of the quadratic form and of springs at points, slot by slot; empty where there is none
    symbolic: Option<Arc<Symbolic>>, // of the factor
    precision: Precision, // of the factor
    factor: Option<Factor>,
    diagonal: Vec<f64>, // as it was before a shift
    assembled: bool,
    factored: bool, // the last attempt to factor was a success
    scratch: SolveScratch,
}

/// The entries of the true Hessian and of the clamped one at the same place.
pub struct Both {
    exact: Vec<f64>,
    clamped: Vec<f64>,
}

/// What factoring the Hessian of a problem would take, known from the analysis of the normal matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorCost {
    /// Bytes of factor and workspace.
    pub bytes: f64,
    /// Multiplications and additions.
    pub flops: f64,
}

/// No slot.
const NONE: u32 = u32::MAX;

impl FactorCost {
    /// The factor of the Hessian has `dim` x `dim` blocks where the normal matrix has numbers.
    pub fn of(normal: &NormalMatrix, dim: usize) -> Self {
        let d = dim as f64;
        let (factor, workspace) = normal.symbolic().factor_bytes::<f32>();
        FactorCost { bytes: (factor + workspace) as f64 * d * d, flops: normal.symbolic().factor_flops() * d * d * d }
    }
}

impl Hessian {
    /// Finds the places of the elements' second derivatives in the pattern of the normal matrix.
    ///
    /// # Errors
    /// A term without second derivatives, or more entries than can be numbered.
    pub fn new(problem: &mut Problem, normal: &NormalMatrix) -> Result<Self, SystemError> {
        let (pattern, _) = normal.matrix();
        for (t, term) in problem.terms.iter_mut().enumerate() {
            match term.curvature() {
                Some(curvature) => curvature.prepare(pattern),
                None => {
                    return Err(SystemError::Factor(format!(
                        "term {t} has no second derivatives; take a method without them"
                    )));
                }
            }
        }
        if problem.quadratic.potentials.iter().any(|p| !p.has_hessian()) {
            return Err(SystemError::Factor(
                "pressure on a surface in a lattice has no second derivatives; take a method without them".to_string(),
            ));
        }
        let matrix = BlockMatrix::new(pattern, problem.dim)?;
        let (mut potentials, mut apart) = (Vec::new(), None);
        for potential in &problem.quadratic.potentials {
            potential.for_each_block(&problem.x0, &mut |i, j, _| {
                let slot = if i.max(j) < problem.n_free { pattern.slot(i, j) } else { None };
                if slot.is_none() && i.max(j) < problem.n_free {
                    apart = Some((i, j));
                }
                potentials.push(slot.map_or(NONE, |slot| slot as u32));
            });
        }
        if let Some((i, j)) = apart {
            return Err(SystemError::Factor(format!("a potential ties nodes {i} and {j}, which share no element")));
        }
        let mut form = Vec::new();
        if !problem.quadratic.form.is_empty() {
            form.resize(pattern.nnz(), 0.0);
            problem.quadratic.form.add_to(pattern, &mut form);
        }
        for spring in &problem.quadratic.points {
            form.resize(pattern.nnz(), 0.0);
            spring.for_each_entry(problem.n_free, &mut |i, j, entry| {
                if let Some(slot) = pattern.slot(i, j) {
                    form[slot] += entry;
                }
            });
        }
        Ok(Hessian {
            matrix,
            potentials,
            form,
            symbolic: None,
            precision: Precision::Single,
            factor: None,
            diagonal: Vec::new(),
            assembled: false,
            factored: false,
            scratch: SolveScratch::default(),
        })
    }

    /// The Hessian at x.
    ///
    /// # Errors
    /// A problem that is not the one it was made for.
    pub fn assemble(&mut self, problem: &mut Problem, x: &[f64], projection: Projection) -> Result<(), SystemError> {
        self.matrix.values_mut().fill(0.0);
        for term in &mut problem.terms {
            if let Some(curvature) = term.curvature() {
                curvature.add_hessian(x, projection, self.matrix.values_mut());
            }
        }
        for (node, k, _) in &problem.quadratic.springs {
            self.matrix.add_to_diagonal(*node as usize, *k);
        }
        for (node, k) in problem.quadratic.inertia.stiffness().iter().enumerate().take(problem.n_free) {
            self.matrix.add_to_diagonal(node, *k);
        }
        if !self.form.is_empty() {
            self.matrix.add_identities(&self.form)?;
        }
        // What is projected is to stay positive semidefinite: a potential that need not be is left out then.
        self.add_potentials(problem, x, projection == Projection::None);
        self.assembled = true;
        Ok(())
    }

    /// The true Hessian at x and the clamped one, for [`Self::blend`].
    ///
    /// # Errors
    /// As [`Self::assemble`].
    pub fn assemble_both(&mut self, problem: &mut Problem, x: &[f64]) -> Result<Both, SystemError> {
        self.assemble(problem, x, Projection::None)?;
        let exact = self.matrix.values().to_vec();
        self.assemble(problem, x, Projection::Clamp)?;
        Ok(Both { exact, clamped: self.matrix.values().to_vec() })
    }

    /// The matrix becomes (1 - part) of the true Hessian plus part of the clamped one.
    pub fn blend(&mut self, both: &Both, part: f64) {
        for ((value, exact), clamped) in self.matrix.values_mut().iter_mut().zip(&both.exact).zip(&both.clamped) {
            *value = part * clamped + (1.0 - part) * exact;
        }
    }

    fn add_potentials(&mut self, problem: &Problem, x: &[f64], all: bool) {
        let size = self.matrix.dim() * self.matrix.dim();
        let (values, mut slots) = (self.matrix.values_mut(), self.potentials.iter());
        for potential in &problem.quadratic.potentials {
            let wanted = all || potential.is_convex();
            potential.for_each_block(x, &mut |_, _, block| {
                if let Some(slot) = slots.next().filter(|slot| wanted && **slot != NONE) {
                    let to = &mut values[*slot as usize * size..][..size];
                    to.iter_mut().zip(block.as_flattened()).for_each(|(to, v)| *to += v);
                }
            });
        }
    }

    /// For the same problem with terms made anew: they find the places of their second derivatives again, and what was
    /// assembled and factored is forgotten. The analysis of the factor stays.
    pub fn renew(&mut self, problem: &mut Problem, normal: &NormalMatrix) {
        for term in &mut problem.terms {
            if let Some(curvature) = term.curvature() {
                curvature.prepare(normal.matrix().0);
            }
        }
        self.assembled = false;
        self.factored = false;
    }

    /// The matrix as it was assembled.
    pub fn matrix(&self) -> &BlockMatrix {
        &self.matrix
    }

    /// Adds `value` to every entry of the diagonal, until it is assembled anew.
    pub fn add_to_diagonal(&mut self, value: f64) {
        if value != 0.0 {
            for i in 0..self.matrix.n() / self.matrix.dim() {
                self.matrix.add_to_diagonal(i, value);
            }
        }
    }

    /// The precision of its factors.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Factors from now on have this precision; the one there is goes, if it has another.
    pub fn set_precision(&mut self, precision: Precision) {
        if self.precision != precision {
            self.precision = precision;
            self.factor = None;
            self.factored = false;
        }
    }

    /// Factors it, with `shift` times its mean diagonal added to the diagonal; false where that is not positive
    /// definite to that precision.
    ///
    /// # Errors
    /// Entries that are not finite.
    pub fn factor(&mut self, normal: &NormalMatrix, shift: f64) -> Result<bool, SystemError> {
        if shift == 0.0 {
            return self.factor_as_it_is(normal);
        }
        self.diagonal.clear();
        self.matrix.for_each_diagonal(|v| self.diagonal.push(*v));
        let shift = shift * self.diagonal.iter().map(|v| v.abs()).sum::<f64>() / self.diagonal.len().max(1) as f64;
        self.matrix.for_each_diagonal(|v| *v += shift);
        self.factor_and_restore(normal)
    }

    /// As [`Self::factor`], with the part `lift` of each entry of the diagonal added to it.
    ///
    /// # Errors
    /// Entries that are not finite.
    pub fn factor_lifted(&mut self, normal: &NormalMatrix, lift: f64) -> Result<bool, SystemError> {
        self.diagonal.clear();
        self.matrix.for_each_diagonal(|v| self.diagonal.push(*v));
        self.matrix.for_each_diagonal(|v| *v += lift * v.abs());
        self.factor_and_restore(normal)
    }

    fn factor_and_restore(&mut self, normal: &NormalMatrix) -> Result<bool, SystemError> {
        let result = self.factor_as_it_is(normal);
        let mut before = self.diagonal.iter();
        self.matrix.for_each_diagonal(|v| *v = before.next().copied().unwrap_or(*v));
        result
    }

    fn factor_as_it_is(&mut self, normal: &NormalMatrix) -> Result<bool, SystemError> {
        let factor = match &mut self.factor {
            Some(factor) => factor,
            none => {
                let symbolic = match &self.symbolic {
                    Some(symbolic) => symbolic.clone(),
                    None => Arc::new(normal.symbolic().expanded(self.matrix.dim())?),
                };
                self.symbolic = Some(symbolic.clone());
                none.insert(Factor::new(symbolic, self.precision, Purpose::FewSolves))
            }
        };
        self.factored = false;
        match factor.refactor_if_definite(self.matrix.values()) {
            Ok(()) => {
                self.factored = true;
                Ok(true)
            }
            Err(SparseError::NotPositiveDefinite { .. }) => Ok(false),
            Err(e) => Err(e.into()),
        }
    }

    /// The product of the matrix with p, and the solution of its factor's system: what [`super::cg::Cg`] asks for.
    pub(crate) fn parts(&mut self) -> (&BlockMatrix, Option<&Factor>, &mut SolveScratch) {
        (&self.matrix, self.factor.as_ref(), &mut self.scratch)
    }

    /// Whether it was assembled, so that [`Self::matrix`] is the Hessian somewhere.
    pub fn is_assembled(&self) -> bool {
        self.assembled
    }

    /// Whether there is a factor to solve with, of this or of an earlier Hessian.
    pub fn is_factored(&self) -> bool {
        self.factored
    }

    /// b <- H^-1 b with the factor as it is: of the matrix that was factored last.
    ///
    /// # Errors
    /// No factor, or a vector of another length.
    pub fn solve(&mut self, b: &mut [f64]) -> Result<(), SystemError> {
        match &self.factor {
            Some(factor) if self.factored => Ok(factor.solve(b, 1, &mut self.scratch)?),
            _ => Err(SystemError::Factor("the Hessian was not factored before".to_string())),
        }
    }

    /// Bytes of the factor and its workspace.
    pub fn factor_bytes(&self) -> u64 {
        self.factor.as_ref().map_or(0, Factor::bytes)
    }
}
