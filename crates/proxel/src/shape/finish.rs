//! The finish of a constrained shape: a few steps along the hard sets, then Gauss-Newton steps to them.

use proxel_linalg::sparse::{BlockMatrix, Cholesky, Ordering, SolveScratch, SparseError, SymPattern, Symbolic};
use proxel_model::constraint::{Relation, RowKey, Rows, RowsOf};
use proxel_split::{
    EnergyReport, Evaluation, LocalReport, Method, Problem, Residuals, StepReport, SystemError, Trial, vector,
};
use std::sync::Arc;

/// Hard sets of a problem as equations, which its splitting does not know.
pub(super) type Constraints = Vec<Arc<dyn RowsOf>>;

/// Steps d of sequential quadratic programming:
///
/// ```text
/// min over d   g . d + 1/2 d^T (H + tau I) d   subject to   c + J d = 0
/// ```
///
/// H is the Hessian of the soft objective with the nearest points held. In the first steps g is the gradient of the
/// soft objective, in which the splitting is slow along the sets, and a step is taken if f + nu sum |c| falls; then g
/// is 0, which are the least steps to where the linearised sets hold, and one is taken if sum c^2 falls. tau,
/// Levenberg and Marquardt's, is raised until that is so and no vertex moves far.
///
/// The program is solved by the method of multipliers on one factor of H + tau I + rho J^T J, which takes equations
/// that depend on each other as they come; an inequality is part of it where it would be violated.
pub(super) struct Finish {
    problem: Problem,
    constraints: Constraints,
    stiffness: f64, // the mean of H's diagonal, what damping and penalty are measured against
    x: Vec<f64>,
    rows: Rows,
    multipliers: Vec<f64>,
    pushed: Vec<RowKey>, // inequalities that were active in the last step, ascending
    pattern: SymPattern,
    matrix: BlockMatrix,
    factor: Cholesky<f64>,
    scratch: SolveScratch,
    hessian: Vec<f64>, // H, slot by slot
    damping: f64,      // tau
    violation: f64,    // at x
    dual: f64,         // the dual residual that the splitting has ended with
    descents: usize,   // steps with g that are left
    iteration: usize,
}

/// rho over the stiffness of the soft terms: an iteration of multipliers gains so many digits, and a factor has ten
/// left.
const PENALTY: f64 = 1e6;
/// Iterations of multipliers a step, at most.
const MULTIPLIERS: usize = 12;
/// Steps with g.
const DESCENTS: usize = 4;
/// The farthest that a vertex moves in such a step, over the mean edge or so.
const FAR: f64 = 0.25;
/// Trials of a step, tau growing by [`RAISE`] each time.
const TRIALS: usize = 8;
/// See [`TRIALS`].
const RAISE: f64 = 10.0;
/// tau below this part of the stiffness is none.
const LEAST: f64 = 1e-2;
/// Inequalities that are violated by no more than this hold.
const NEAR: f64 = 1e-12;
/// Those that hold by more than this, over the mean edge or in radians, are no part of a step.
const AWAY: f64 = 0.2;
/// An inequality that a step would break by less than this part of the present violation is left to the next step.
const SLIGHT: f64 = 1e-2;
/// Factors a step for which inequalities are active, at most; what is left is the next step's.
const PASSES: usize = 3;

fn broken(e: SparseError) -> SystemError {
    SystemError::Factor(e.to_string())
}

impl Finish {
    /// Goes on from x, where a splitting has got to in some iterations, to a dual residual.
    ///
    /// # Errors
    /// A pattern that is too large.
    pub fn new(
        problem: Problem,
        constraints: Constraints,
        x: Vec<f64>,
        (iteration, dual): (usize, f64),
    ) -> Result<Self, SystemError> {
        let (mut flat, mut ends) = (Vec::new(), vec![0]);
        let n = problem.n_free as u32;
        for term in &problem.terms {
            term.for_each_element(&mut |nodes| {
                flat.extend(nodes.iter().filter(|node| **node < n));
                ends.push(flat.len());
            });
        }
        problem.quadratic.form.for_each_pair(&mut |i, j| {
            flat.extend([i, j]);
            ends.push(flat.len());
        });
        let cliques: Vec<&[u32]> = ends.windows(2).map(|w| &flat[w[0]..w[1]]).collect();
        let pattern = SymPattern::from_cliques(problem.n_free, &cliques).map_err(broken)?;
        let symbolic = Symbolic::analyze(&pattern, Ordering::Auto).and_then(|s| s.expanded(3)).map_err(broken)?;
        let mut hessian = vec![0.0; pattern.nnz()];
        problem.quadratic.form.add_to(&pattern, &mut hessian);
        problem.terms.iter().filter(|term| !term.is_hard()).for_each(|term| term.add_normal(&pattern, &mut hessian));
        for (node, k, _) in &problem.quadratic.springs {
            if let Some(slot) = pattern.slot(*node as usize, *node as usize) {
                hessian[slot] += k;
            }
        }
        let diagonal = (0..problem.n_free).filter_map(|i| pattern.slot(i, i)).map(|slot| hessian[slot]);
        let stiffness = diagonal.sum::<f64>() / problem.n_free.max(1) as f64;
        let mut finish = Finish {
            matrix: BlockMatrix::new(&pattern, 3).map_err(broken)?,
            factor: Cholesky::new(Arc::new(symbolic)),
            scratch: SolveScratch::default(),
            problem,
            constraints,
            stiffness,
            x,
            rows: Rows::default(),
            multipliers: Vec::new(),
            pushed: Vec::new(),
            pattern,
            hessian,
            damping: 0.0,
            violation: f64::INFINITY,
            dual,
            descents: DESCENTS,
            iteration,
        };
        finish.violation = finish.violation_at(&finish.x);
        Ok(finish)
    }

    fn violation_at(&self, x: &[f64]) -> f64 {
        let x = x.as_chunks::<3>().0;
        self.constraints.iter().map(|c| c.violation(x)).fold(0.0, f64::max)
    }

    /// sum |c| and sum c^2, inequalities where they are violated.
    fn broken(&self, x: &[f64]) -> [f64; 2] {
        let mut rows = Rows::default();
        self.constraints.iter().for_each(|c| c.add_rows(x.as_chunks::<3>().0, 0.0, &mut rows));
        let size = |(c, relation): (&f64, &Relation)| if *relation == Relation::Zero { c.abs() } else { c.max(0.0) };
        let sizes = rows.values().iter().zip(rows.relations()).map(size);
        sizes.fold([0.0; 2], |[one, two], c| [one + c, two + c * c])
    }

    /// H + tau I + rho J^T J, and its factor.
    fn refactor(&mut self, active: &[bool], rho: f64) -> Result<(), SystemError> {
        self.matrix.values_mut().fill(0.0);
        self.matrix.add_identities(&self.hessian).map_err(broken)?;
        for i in 0..self.problem.n_free {
            self.matrix.add_to_diagonal(i, self.damping);
        }
        let (pattern, values) = (&self.pattern, self.matrix.values_mut());
        for r in (0..self.rows.len()).filter(|r| active[*r]) {
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
        Ok(self.factor.refactor(self.matrix.values())?)
    }

    /// d and lambda of the quadratic program with these rows as equations.
    fn solve(&mut self, g: &[f64], active: &[bool], rho: f64) -> Result<Vec<f64>, SystemError> {
        self.multipliers.clear();
        self.multipliers.resize(self.rows.len(), 0.0);
        let size = self.rows.values().iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        let mut d = vec![0.0; 3 * self.problem.n_free];
        let mut before = f64::INFINITY;
        for _ in 0..MULTIPLIERS {
            // The gradient of the augmented Lagrangian at d = 0, so that d is solved for anew.
            let mut b: Vec<f64> = g.iter().map(|g| -g).collect();
            for r in (0..self.rows.len()).filter(|r| active[*r]) {
                self.rows.add_gradient(r, -(self.multipliers[r] + rho * self.rows.values()[r]), &mut b);
            }
            self.factor.solve_in_place(&mut b, 1, &mut self.scratch)?;
            d = b;
            let mut left = 0.0_f64;
            for r in (0..self.rows.len()).filter(|r| active[*r]) {
                let c = self.rows.values()[r] + self.rows.along(r, &d);
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

    /// d with the active rows found: equations, inequalities that are violated or would be by d, less those that would
    /// pull.
    fn direction(&mut self, g: &[f64]) -> Result<Vec<f64>, SystemError> {
        let rho = PENALTY * self.stiffness;
        let n = self.rows.len();
        let may_rest = |rows: &Rows, r: usize| rows.relations()[r] == Relation::NotAbove && rows.values()[r] <= NEAR;
        // Of those at their bound to rounding a step shows whether they are in its way. Taken for equations at once they may
        // ask for what cannot be: opposite angles of a rhombus at both ends of 45 to 135 degrees hold only if it is flat.
        // Those that were in the way of the step before come first.
        let known = |r: usize| self.pushed.binary_search(&self.rows.keys()[r]).is_ok();
        let mut active: Vec<bool> = (0..n).map(|r| !may_rest(&self.rows, r) || known(r)).collect();
        let breaking = NEAR.max(SLIGHT * self.violation);
        let mut pass = 0;
        loop {
            pass += 1;
            self.refactor(&active, rho)?;
            let d = self.solve(g, &active, rho)?;
            let mut changed = 0;
            for r in (0..n).filter(|r| may_rest(&self.rows, *r)) {
                let (pulls, breaks) = match active[r] {
                    true => (self.multipliers[r] < 0.0, false),
                    false => (false, self.rows.values()[r] + self.rows.along(r, &d) > breaking),
                };
                if pulls || breaks {
                    (active[r], self.multipliers[r]) = (breaks, 0.0);
                    changed += 1;
                }
            }
            if changed == 0 || pass >= PASSES {
                let inequality = |r: &usize| active[*r] && self.rows.relations()[*r] == Relation::NotAbove;
                self.pushed = (0..n).filter(inequality).map(|r| self.rows.keys()[r]).collect();
                return Ok(d);
            }
        }
    }
}

impl Method for Finish {
    fn name(&self) -> &str {
        "auto"
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        for c in &self.constraints {
            c.add_rows(self.x.as_chunks::<3>().0, AWAY, &mut rows);
            rows.next_group();
        }
        self.rows = rows;
        let (descends, mut rejected) = (self.descents > 0, 0);
        let mut g = vec![0.0; 3 * self.problem.n_free];
        let before = self.problem.energy(&self.x, descends.then_some(g.as_mut_slice())).value;
        loop {
            let d = match self.direction(&g) {
                Ok(d) => d,
                // Rows that depend on each other, in a matrix of few digits: damping gives it some.
                Err(SystemError::Singular { .. } | SystemError::Factor(_)) if rejected < TRIALS => {
                    rejected += 1;
                    self.damping = (RAISE * self.damping).max(0.1 * self.stiffness);
                    continue;
                }
                Err(e) => return Err(e),
            };
            let mut x = self.x.clone();
            x.iter_mut().zip(&d).for_each(|(x, d)| *x += d);
            let violation = self.violation_at(&x);
            let good = match descends {
                true => {
                    let farthest = d.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
                    // Above the largest multiplier the penalty is exact.
                    let nu = 2.0 * self.multipliers.iter().fold(0.0_f64, |m, l| m.max(l.abs()));
                    let merit = |value: f64, broken: f64| value + nu * broken;
                    let after = self.problem.energy(&x, None).value;
                    let ([old, _], [new, _]) = (self.broken(&self.x), self.broken(&x));
                    farthest <= FAR && merit(after, new) < merit(before, old)
                }
                // By what Gauss-Newton steps make less of; a few elements that resist do not hold up the others.
                false => self.broken(&x)[1] < self.broken(&self.x)[1],
            };
            if good && vector::is_finite(&x) {
                (self.x, self.violation) = (x, violation);
                self.damping = if self.damping > LEAST * self.stiffness { self.damping / RAISE } else { 0.0 };
                self.descents = self.descents.saturating_sub(1);
                break;
            }
            rejected += 1;
            if rejected > TRIALS && descends {
                // To the sets from where it is.
                (self.descents, self.damping) = (0, 0.0);
                return self.step();
            }
            if rejected > TRIALS {
                return Err(SystemError::Stalled(format!(
                    "no step makes the constraints hold better than to {:.1e} of the mean edge: they may \
                     contradict each other; see `violated` of the report",
                    self.violation
                )));
            }
            self.damping = (RAISE * self.damping).max(0.1 * self.stiffness);
        }
        self.iteration += 1;
        Ok(StepReport {
            iteration: self.iteration,
            inner: rejected + 1,
            refactorised: true,
            accepted: true,
            energy_z: f64::INFINITY,
            merit: Some(self.violation),
            trial: Trial::default(),
            local: LocalReport::default(),
        })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        &self.problem
    }

    fn energy(&mut self) -> EnergyReport {
        self.problem.energy(&self.x, None)
    }

    fn evaluate(&mut self) -> Evaluation {
        Evaluation { energy: self.energy(), gradient_norm: f64::INFINITY }
    }

    fn factor_bytes(&self) -> u64 {
        let (factor, workspace) = self.factor.bytes();
        (factor + workspace) as u64
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }

    /// The largest violation, and the dual residual of the splitting.
    fn residuals(&mut self) -> Residuals {
        Residuals { primal: self.violation, dual: self.dual }
    }
}
