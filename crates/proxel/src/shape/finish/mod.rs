//! The finish of a constrained shape: a few steps along the hard sets, then Gauss-Newton steps to them.

mod program;

pub(super) use program::Program;
use proxel_linalg::sparse::SparseError;
use proxel_model::constraint::RowsOf;
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
/// Levenberg and Marquardt's, is raised until that is so and no vertex moves far. As long as the last factor makes
/// sum c^2 fall fast, it is used again.
pub(super) struct Finish {
    problem: Problem,
    program: Program,
    x: Vec<f64>,
    damping: f64,    // tau
    violation: f64,  // at x
    squares: f64,    // sum c^2 at x
    dual: f64,       // the dual residual that the splitting has ended with
    descents: usize, // steps with g that are left
    fresh: bool,     // whether the last factor is one of an undamped step, and fast so far
    iteration: usize,
}

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
/// A factor is used again as long as a step with it leaves less than this part of sum c^2.
const FAST: f64 = 0.1;

fn refused(e: SparseError) -> SystemError {
    SystemError::Factor(e.to_string())
}

impl Finish {
    /// Goes on from x, where a splitting has got to in some iterations, to a dual residual, by the program of the problem
    /// there.
    pub fn new(program: Program, problem: Problem, x: Vec<f64>, (iteration, dual): (usize, f64)) -> Self {
        let (violation, [_, squares]) = (program.violation(&x), program.broken(&x));
        let (damping, descents, fresh) = (0.0, DESCENTS, false);
        Finish { problem, program, x, damping, violation, squares, dual, descents, fresh, iteration }
    }

    fn moved(&self, d: &[f64]) -> Vec<f64> {
        self.x.iter().zip(d).map(|(x, d)| x + d).collect()
    }

    fn take(&mut self, x: Vec<f64>, squares: f64) {
        self.violation = self.program.violation(&x);
        (self.x, self.squares) = (x, squares);
    }

    fn done(&mut self, inner: usize, refactorised: bool) -> StepReport {
        self.iteration += 1;
        StepReport {
            iteration: self.iteration,
            inner,
            refactorised,
            accepted: true,
            energy_z: f64::INFINITY,
            merit: Some(self.violation),
            trial: Trial::default(),
            local: LocalReport::default(),
        }
    }

    /// A step to the sets with the factor that is there, if it goes there; whether another one would be worth it.
    fn chord(&mut self) -> Result<bool, SystemError> {
        let d = self.program.chord(&self.x)?;
        let x = self.moved(&d);
        let [_, squares] = self.program.broken(&x);
        let gain = squares / self.squares;
        if gain < 1.0 && vector::is_finite(&x) {
            self.take(x, squares);
        }
        Ok(gain < FAST)
    }
}

impl Method for Finish {
    fn name(&self) -> &str {
        "auto"
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        if self.descents == 0 && self.fresh {
            if self.chord()? {
                return Ok(self.done(1, false));
            }
            self.fresh = false;
        }
        let (descends, mut rejected) = (self.descents > 0, 0);
        let stiffness = self.program.stiffness();
        let mut g = vec![0.0; 3 * self.problem.n_free];
        let before = self.problem.energy(&self.x, descends.then_some(g.as_mut_slice())).value;
        let [length, _] = self.program.broken(&self.x);
        self.program.linearise(&self.problem, &self.x)?;
        loop {
            let d = match self.program.direction(&g, self.damping, self.violation) {
                Ok(d) => d,
                // Rows that depend on each other, in a matrix of few digits: damping gives it some.
                Err(SystemError::Singular { .. } | SystemError::Factor(_)) if rejected < TRIALS => {
                    rejected += 1;
                    self.damping = (RAISE * self.damping).max(0.1 * stiffness);
                    continue;
                }
                Err(e) => return Err(e),
            };
            let x = self.moved(&d);
            let [sum, squares] = self.program.broken(&x);
            let good = match descends {
                true => {
                    let farthest = d.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
                    // Above the largest multiplier the penalty is exact.
                    let nu = 2.0 * self.program.largest_multiplier();
                    let after = self.problem.energy(&x, None).value;
                    farthest <= FAR && after + nu * sum < before + nu * length
                }
                // By what Gauss-Newton steps make less of; a few elements that resist do not hold up the others.
                false => squares < self.squares,
            };
            if good && vector::is_finite(&x) {
                self.take(x, squares);
                self.fresh = self.damping == 0.0;
                // What had to be raised in this step would have to be in the next one.
                if rejected == 0 {
                    self.damping = if self.damping > LEAST * stiffness { self.damping / RAISE } else { 0.0 };
                }
                if self.descents == 1 {
                    self.damping = 0.0; // that of steps with g
                }
                self.descents = self.descents.saturating_sub(1);
                return Ok(self.done(rejected + 1, true));
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
            self.damping = (RAISE * self.damping).max(0.1 * stiffness);
        }
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
        self.program.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }

    /// The largest violation, and the dual residual of the splitting.
    fn residuals(&mut self) -> Residuals {
        Residuals { primal: self.violation, dual: self.dual }
    }
}
