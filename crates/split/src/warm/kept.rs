//! Descent with a factor from before.

use crate::{EnergyReport, Evaluation, Hessian, Method, NormalMatrix, Pairs, Problem, StepReport, SystemError, vector};

/// Pairs that it keeps.
const WINDOW: usize = 8;

/// A step has to leave less than this part of the gradient, or the factor has grown too old: a Newton step costs six to ten
/// of these. Steps that only lower the energy are refused, since they may lead far away along soft directions that have
/// turned since the factor was made.
const SLOW: f64 = 0.5;

/// A relative change of the energy that may be rounding.
const ROUNDING: f64 = 1e-12;

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
    pub fn resume(mut problem: Problem, normal: NormalMatrix, hessian: Hessian, x: Vec<f64>, iteration: usize) -> Self {
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

    /// The whole step along the direction of the pairs; whether it was taken.
    fn attempt(&mut self) -> Result<bool, SystemError> {
        let hessian = &mut self.hessian;
        let slope = self.pairs.direction_from(&self.g, &mut self.q, |b| hessian.solve(b))?;
        if !(slope > 0.0 && slope.is_finite()) {
            return Ok(false);
        }
        self.trial.copy_from_slice(&self.x);
        vector::add_scaled(&mut self.trial[..self.q.len()], -1.0, &self.q);
        let energy = self.problem.energy(&self.trial, Some(&mut self.g_trial));
        let falls = energy.value <= self.energy.value + ROUNDING * self.energy.value.abs();
        let converges = vector::norm(&self.g_trial) < SLOW * vector::norm(&self.g);
        let worse = energy.inverted > self.energy.inverted && self.problem.barrier;
        if !(falls && converges) || worse {
            return Ok(false);
        }
        let (g, g_trial, q) = (&self.g, &self.g_trial, &self.q);
        self.pairs.remember(g.len(), |s, y| {
            vector::subtract(y, g_trial, g);
            vector::scale_to(s, -1.0, q);
        });
        std::mem::swap(&mut self.x, &mut self.trial);
        std::mem::swap(&mut self.g, &mut self.g_trial);
        self.energy = energy;
        Ok(true)
    }
}

impl Method for Kept {
    fn name(&self) -> &str {
        "kept"
    }

    /// A step that does not do what the factor is kept for is not accepted, and x stays.
    fn step(&mut self) -> Result<StepReport, SystemError> {
        let accepted = self.hessian.is_factored() && self.attempt()?;
        self.iteration += 1;
        Ok(StepReport {
            iteration: self.iteration,
            inner: 1,
            accepted,
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
