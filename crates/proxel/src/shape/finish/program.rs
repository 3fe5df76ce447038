//! The program of a step, on one factor.

use super::{Constraints, refused};
use proxel_linalg::sparse::{BlockMatrix, Cholesky, Ordering, SolveScratch, SymPattern, Symbolic};
use proxel_model::constraint::{Relation, RowKey, Rows};
use proxel_split::{Problem, SystemError};
use std::sync::Arc;

/// ```text
/// min over d   g . d + 1/2 d^T (H + tau I) d   subject to   c + J d = 0
/// ```
///
/// by the method of multipliers on one factor of H + tau I + rho J^T J, which takes equations that depend on each other
/// as they come; an inequality is part of it where it would be violated.
pub(in crate::shape) struct Program {
    constraints: Constraints,
    stiffness: f64, // the mean of H's diagonal, what damping and penalty are measured against
    rows: Rows,
    active: Vec<bool>, // the rows that the factor has
    multipliers: Vec<f64>,
    pushed: Vec<RowKey>, // inequalities that were active in the last step, ascending
    layout: Layout,
    scratch: SolveScratch,
}

/// The matrix of a program, as sparse as the rows are that it may have: of inequalities only those near their bounds.
struct Layout {
    pattern: SymPattern,
    matrix: BlockMatrix,
    factor: Cholesky<f64>,
    bytes: f64,        // of the factor and its workspace, once there is one
    hessian: Vec<f64>, // H, slot by slot
}

impl Layout {
    /// For soft terms and rows like these.
    fn new(problem: &Problem, rows: &Rows) -> Result<Self, SystemError> {
        let (mut flat, mut ends) = (Vec::new(), vec![0]);
        let n = problem.n_free as u32;
        let mut add = |nodes: &[u32]| {
            flat.extend(nodes.iter().filter(|node| **node < n));
            ends.push(flat.len());
        };
        let soft = || problem.terms.iter().filter(|term| !term.is_hard());
        soft().for_each(|term| term.for_each_element(&mut add));
        problem.quadratic.form.for_each_pair(&mut |i, j| add(&[i, j]));
        (0..rows.len()).for_each(|r| add(rows.row(r).0));
        let cliques: Vec<&[u32]> = ends.windows(2).map(|w| &flat[w[0]..w[1]]).collect();
        let pattern = SymPattern::from_cliques(problem.n_free, &cliques).map_err(refused)?;
        let symbolic = Symbolic::analyze(&pattern, Ordering::Auto).and_then(|s| s.expanded(3)).map_err(refused)?;
        let mut hessian = vec![0.0; pattern.nnz()];
        problem.quadratic.form.add_to(&pattern, &mut hessian);
        soft().for_each(|term| term.add_normal(&pattern, &mut hessian));
        for (node, k, _) in &problem.quadratic.springs {
            if let Some(slot) = pattern.slot(*node as usize, *node as usize) {
                hessian[slot] += k;
            }
        }
        let matrix = BlockMatrix::new(&pattern, 3).map_err(refused)?;
        let (factor, workspace) = symbolic.factor_bytes::<f64>();
        let bytes = factor as f64 + workspace as f64;
        Ok(Layout { pattern, matrix, factor: Cholesky::new(Arc::new(symbolic)), bytes, hessian })
    }

    /// Whether there is a place for the products of all rows.
    fn holds(&self, rows: &Rows) -> bool {
        let n = self.pattern.n() as u32;
        let has = |i: u32, j: u32| j > i || i >= n || self.pattern.slot(i as usize, j as usize).is_some();
        (0..rows.len()).all(|r| rows.row(r).0.iter().all(|i| rows.row(r).0.iter().all(|j| has(*i, *j))))
    }
}

fn rows_at(constraints: &Constraints, x: &[f64], near: f64, mut rows: Rows) -> Rows {
    rows.clear();
    for c in constraints {
        c.add_rows(x.as_chunks::<3>().0, near, &mut rows);
        rows.next_group();
    }
    rows
}

/// rho over the stiffness of the soft terms: an iteration of multipliers gains so many digits, and a factor has ten
/// left.
const PENALTY: f64 = 1e6;
/// Iterations of multipliers a step, at most.
const MULTIPLIERS: usize = 12;
/// Inequalities that are violated by no more than this hold.
const NEAR: f64 = 1e-12;
/// Those that hold by more than this, over the mean edge or in radians, are no part of a step.
const AWAY: f64 = 0.2;
/// An inequality that a step would break by less than this part of the present violation is left to the next step.
const SLIGHT: f64 = 1e-2;
/// Factors a step for which inequalities are active, at most; what is left is the next step's.
const PASSES: usize = 3;

impl Program {
    /// Of the soft terms of a problem, and of hard sets beside them, at x.
    ///
    /// # Errors
    /// A pattern that is too large.
    pub fn new(problem: &Problem, constraints: Constraints, x: &[f64]) -> Result<Self, SystemError> {
        let rows = rows_at(&constraints, x, 2.0 * AWAY, Rows::default());
        let layout = Layout::new(problem, &rows)?;
        let diagonal = (0..problem.n_free).filter_map(|i| layout.pattern.slot(i, i)).map(|slot| layout.hessian[slot]);
        let stiffness = diagonal.sum::<f64>() / problem.n_free.max(1) as f64;
        Ok(Program {
            constraints,
            layout,
            stiffness,
            rows: Rows::default(),
            active: Vec::new(),
            multipliers: Vec::new(),
            pushed: Vec::new(),
            scratch: SolveScratch::default(),
        })
    }

    /// The mean of H's diagonal.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// Bytes that its factor takes once there is one.
    pub fn needs(&self) -> f64 {
        self.layout.bytes
    }

    /// The largest multiplier of the last step.
    pub fn largest_multiplier(&self) -> f64 {
        self.multipliers.iter().fold(0.0, |m, l| m.max(l.abs()))
    }

    /// Bytes of the factor and of its workspace.
    pub fn factor_bytes(&self) -> u64 {
        let (factor, workspace) = self.layout.factor.bytes();
        (factor + workspace) as u64
    }

    /// The largest violation at x.
    pub fn violation(&self, x: &[f64]) -> f64 {
        let x = x.as_chunks::<3>().0;
        self.constraints.iter().map(|c| c.violation(x)).fold(0.0, f64::max)
    }

    /// sum |c| and sum c^2 at x, inequalities where they are violated.
    pub fn broken(&self, x: &[f64]) -> [f64; 2] {
        let rows = rows_at(&self.constraints, x, 0.0, Rows::default());
        let size = |(c, relation): (&f64, &Relation)| if *relation == Relation::Zero { c.abs() } else { c.max(0.0) };
        let sizes = rows.values().iter().zip(rows.relations()).map(size);
        sizes.fold([0.0; 2], |[one, two], c| [one + c, two + c * c])
    }

    /// c and J are those at x from here on.
    ///
    /// # Errors
    /// A pattern that is too large.
    pub fn linearise(&mut self, problem: &Problem, x: &[f64]) -> Result<(), SystemError> {
        let rows = std::mem::take(&mut self.rows);
        self.rows = rows_at(&self.constraints, x, AWAY, rows);
        if !self.layout.holds(&self.rows) {
            let wide = rows_at(&self.constraints, x, 2.0 * AWAY, Rows::default());
            self.layout = Layout::new(problem, &wide)?;
        }
        Ok(())
    }

    /// H + tau I + rho J^T J, and its factor.
    fn refactor(&mut self, tau: f64, rho: f64) -> Result<(), SystemError> {
        let Layout { pattern, matrix, factor, hessian, .. } = &mut self.layout;
        matrix.values_mut().fill(0.0);
        matrix.add_identities(hessian).map_err(refused)?;
        for i in 0..pattern.n() {
            matrix.add_to_diagonal(i, tau);
        }
        let values = matrix.values_mut();
        for r in (0..self.rows.len()).filter(|r| self.active[*r]) {
            let (nodes, gradients) = self.rows.row(r);
            for (i, a) in nodes.iter().zip(gradients) {
                for (j, b) in nodes.iter().zip(gradients).filter(|(j, _)| *j <= i) {
                    let Some(slot) = pattern.slot(*i as usize, *j as usize) else { continue };
                    let block = &mut values[9 * slot..9 * slot + 9];
                    for (k, entry) in block.iter_mut().enumerate() {
                        *entry += rho * a[k / 3] * b[k % 3];
                    }
                }
            }
        }
        Ok(factor.refactor(matrix.values())?)
    }

    /// d and lambda of the program with the active rows as equations c + J d = 0.
    fn solve(&mut self, g: &[f64], c: &[f64], rho: f64) -> Result<Vec<f64>, SystemError> {
        self.multipliers.clear();
        self.multipliers.resize(self.rows.len(), 0.0);
        let size = c.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        let mut d = vec![0.0; 3 * self.layout.pattern.n()];
        let mut before = f64::INFINITY;
        for _ in 0..MULTIPLIERS {
            // The gradient of the augmented Lagrangian at d = 0, so that d is solved for anew.
            let mut b: Vec<f64> = g.iter().map(|g| -g).collect();
            for r in (0..self.rows.len()).filter(|r| self.active[*r]) {
                self.rows.add_gradient(r, -(self.multipliers[r] + rho * c[r]), &mut b);
            }
            self.layout.factor.solve_in_place(&mut b, 1, &mut self.scratch)?;
            d = b;
            let mut left = 0.0_f64;
            for r in (0..self.rows.len()).filter(|r| self.active[*r]) {
                let c = c[r] + self.rows.along(r, &d);
                self.multipliers[r] += rho * c;
                left = left.max(c.abs());
            }
            let falls = left < 0.5 * before;
            if left <= f64::EPSILON * size || !falls {
                break;
            }
            before = left;
        }
        Ok(d)
    }

    /// d, with the active rows found: equations, inequalities that are violated or would be by d, less those that would
    /// pull. `violation` is the present one.
    ///
    /// # Errors
    /// A matrix that has no factor.
    pub fn direction(&mut self, g: &[f64], tau: f64, violation: f64) -> Result<Vec<f64>, SystemError> {
        let rho = PENALTY * self.stiffness;
        let n = self.rows.len();
        let may_rest = |rows: &Rows, r: usize| rows.relations()[r] == Relation::NotAbove && rows.values()[r] <= NEAR;
        // Of those at their bound to rounding a step shows whether they are in its way. Taken for equations at once they may
        // ask for what cannot be: opposite angles of a rhombus at both ends of 45 to 135 degrees hold only if it is flat.
        // Those that were in the way of the step before come first.
        let known = |r: usize| self.pushed.binary_search(&self.rows.keys()[r]).is_ok();
        self.active = (0..n).map(|r| !may_rest(&self.rows, r) || known(r)).collect();
        let breaking = NEAR.max(SLIGHT * violation);
        let c = self.rows.values().to_vec();
        let mut pass = 0;
        loop {
            pass += 1;
            self.refactor(tau, rho)?;
            let d = self.solve(g, &c, rho)?;
            let mut changed = 0;
            for r in (0..n).filter(|r| may_rest(&self.rows, *r)) {
                let (pulls, breaks) = match self.active[r] {
                    true => (self.multipliers[r] < 0.0, false),
                    false => (false, c[r] + self.rows.along(r, &d) > breaking),
                };
                if pulls || breaks {
                    (self.active[r], self.multipliers[r]) = (breaks, 0.0);
                    changed += 1;
                }
            }
            if changed == 0 || pass >= PASSES {
                let inequality = |r: &usize| self.active[*r] && self.rows.relations()[*r] == Relation::NotAbove;
                self.pushed = (0..n).filter(inequality).map(|r| self.rows.keys()[r]).collect();
                return Ok(d);
            }
        }
    }

    /// The least d with c(x) + J d = 0 for the J and the factor of the last direction: a chord's step, which costs no
    /// factor and gains as many digits as J is right to.
    ///
    /// # Errors
    /// A factor that is not there.
    pub fn chord(&mut self, x: &[f64]) -> Result<Vec<f64>, SystemError> {
        let now = rows_at(&self.constraints, x, AWAY, Rows::default());
        let value = |key: &RowKey| now.keys().binary_search(key).map_or(0.0, |at| now.values()[at]);
        let c: Vec<f64> = self.rows.keys().iter().map(value).collect();
        self.solve(&vec![0.0; x.len()], &c, PENALTY * self.stiffness)
    }
}
