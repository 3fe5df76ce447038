//! Descent with a factor from before.

use crate::{
    Backtracking, EnergyReport, Evaluation, Hessian, Method, NormalMatrix, Pairs, Problem, Ray, StepReport, SystemError,
    vector,
};

/// Pairs that it keeps.
const WINDOW: usize = 8;

const LINE_SEARCH: Backtracking = Backtracking { sufficient: 1e-4, shrink: 0.5 };

/// L-BFGS whose first inverse Hessian is the factor of the Hessian at an earlier point, kept as it was (the chord method,
/// with what was learned on the way): where that point is near, a step costs one solve and one gradient and gains almost
/// what a Newton step gains.
pub struct Kept {
    problem: Problem,
    normal: NormalMatrix,
    hessian: Hessian,
    pairs: Pairs,
    x: Vec<f64>,
    trial: Vec<f64>,
    g: Vec<f64>, // gradient at x
    g_trial: Vec<f64>,
    q: Vec<f64>, // H g; the direction is -q
    energy: EnergyReport,
    iteration: usize,
}

impl Kept {
    /// Goes on from x after some iterations of other methods. Without a factor it refuses every step.
    pub fn resume(
        mut problem: Problem,
        normal: NormalMatrix,
        hessian: Hessian,
        x: Vec<f64>,
        iteration: usize,
    ) -> Self {
        let n = problem.n_free * problem.dim;
        let mut g = vec![0.0; n];
        let energy = problem.energy(&x, Some(&mut g));
        Kept {
            problem,
            normal,
            hessian,
            pairs: Pairs::new(WINDOW),
            trial: x.clone(),
            x,
            g,
            g_trial: vec![0.0; n],
            q: vec![0.0; n],
            energy,
            iteration,
        }
    }

    /// Problem, matrices and positions, for another method to go on.
    pub fn into_parts(self) -> (Problem, NormalMatrix, Vec<f64>, Hessian) {
        (self.problem, self.normal, self.x, self.hessian)
    }

    /// A step along the direction of the pairs; none where that finds nothing better.
    fn attempt(&mut self) -> Result<Option<usize>, SystemError> {
        let hessian = &mut self.hessian;
        let slope = self.pairs.direction_from(&self.g, &mut self.q, |b| hessian.solve(b))?;
        if !(slope > 0.0 && slope.is_finite()) {
            return Ok(None);
        }
        let ray = Ray { x: &self.x, q: &self.q, value: self.energy.value, slope };
        let found = LINE_SEARCH.search(&mut self.problem, ray, 1.0, true, &mut self.trial, &mut self.g_trial);
        let Some(landing) = found else { return Ok(None) };
        let (g, g_trial, q) = (&self.g, &self.g_trial, &self.q);
        self.pairs.remember(g.len(), |s, y| {
            vector::subtract(y, g_trial, g);
            vector::scale_to(s, -landing.t, q);
        });
        std::mem::swap(&mut self.x, &mut self.trial);
        std::mem::swap(&mut self.g, &mut self.g_trial);
        self.energy = landing.energy;
        Ok(Some(landing.trials))
    }
}

impl Method for Kept {
    fn name(&self) -> &str {
        "kept"
    }

    /// A step that finds nothing better is not accepted, and x stays.
    fn step(&mut self) -> Result<StepReport, SystemError> {
        let mut trials = if self.hessian.is_factored() { self.attempt()? } else { None };
        if trials.is_none() && !self.pairs.is_empty() {
            self.pairs.clear();
            trials = self.attempt()?;
        }
        self.iteration += 1;
        Ok(StepReport {
            iteration: self.iteration,
            inner: trials.unwrap_or(0),
            accepted: trials.is_some(),
            energy_z: f64::INFINITY,
            ..StepReport::default()
        })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        &self.problem
    }

    fn energy(&mut self) -> EnergyReport {
        self.energy
    }

    fn evaluate(&mut self) -> Evaluation {
        Evaluation { energy: self.energy, gradient_norm: vector::norm(&self.g) }
    }

    fn is_evaluated(&self) -> bool {
        true
    }

    fn factor_bytes(&self) -> u64 {
        self.normal.factor_bytes() + self.hessian.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }
}
