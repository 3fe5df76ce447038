//! Conjugate gradients on the wavefront itself.

use super::Linearised;
use super::map::{IterationMap, Measured};
use proxel_split::{BuildError, EnergyReport, Evaluation, Method, Problem, Residuals, SquaredResiduals, StepReport};
use proxel_split::{SystemError, vector};

/// Conjugate gradients on the quadratic function A(32) of phi, begun at 0 and preconditioned by the inverse of
/// (m + 2 beta) D^T D, m the mean of |g|^2: what its Hessian is where |g| is the same everywhere and of all directions.
///
/// An iteration takes one gradient and one cosine transform and its inverse. Its residuals are those of a plain iteration
/// from its phi, worked out when asked for.
pub struct Pcg {
    map: IterationMap,
    scale: f64,
    x: Vec<f64>,
    r: Vec<f64>,        // minus the gradient
    y: Vec<f64>,        // the preconditioner on r
    d: Vec<f64>,        // direction
    constant: Vec<f64>, // the gradient at 0
    product: Vec<f64>,  // the Hessian on d
    slope: f64,         // r . y
    measured: Option<Measured>,
    iteration: usize,
}

impl Pcg {
    /// Begun at 0.
    ///
    /// # Errors
    /// As [`Linearised::problem`].
    pub fn new(of: &Linearised) -> Result<Self, BuildError> {
        let mut map = IterationMap::new(of)?;
        let n = of.width * of.height;
        let x = vec![0.0; n];
        let mut constant = x.clone();
        map.problem.energy(&x, Some(&mut constant));
        let r = constant.iter().map(|g| -g).collect();
        let scale = of.data.mean_square() + 2.0 * of.beta;
        // Where nothing is known of the images all is 0 whatever the scale.
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let (y, d, product) = (x.clone(), x.clone(), x.clone());
        Ok(Pcg { map, scale, x, r, y, d, constant, product, slope: 0.0, measured: None, iteration: 0 })
    }

    fn settle(&mut self) -> Measured {
        if let Some(measured) = self.measured {
            return measured;
        }
        let mut z = vec![0.0; self.map.len()];
        self.map.couple(&self.x, &mut z);
        let measured = self.map.measure(&z);
        self.measured = Some(measured);
        measured
    }
}

impl Method for Pcg {
    fn name(&self) -> &str {
        "pcg"
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        self.measured = None;
        self.iteration += 1;
        self.map.cosine.precondition(self.scale, &self.r, &mut self.y);
        let slope = vector::dot(&self.r, &self.y);
        let turn = if self.slope > 0.0 { slope / self.slope } else { 0.0 };
        self.d.iter_mut().zip(&self.y).for_each(|(d, y)| *d = y + turn * *d);
        self.slope = slope;
        self.map.problem.energy(&self.d, Some(&mut self.product));
        self.product.iter_mut().zip(&self.constant).for_each(|(a, b)| *a -= b);
        let curvature = vector::dot(&self.d, &self.product);
        if curvature > 0.0 && slope > 0.0 {
            let step = slope / curvature;
            vector::add_scaled(&mut self.x, step, &self.d);
            vector::add_scaled(&mut self.r, -step, &self.product);
        }
        let merit = Some(vector::norm(&self.r));
        Ok(StepReport {
            iteration: self.iteration,
            inner: 1,
            accepted: true,
            energy_z: f64::INFINITY,
            merit,
            ..StepReport::default()
        })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        &self.map.problem
    }

    fn energy(&mut self) -> EnergyReport {
        self.map.energy(&self.x)
    }

    fn evaluate(&mut self) -> Evaluation {
        self.map.evaluate(&self.x)
    }

    fn factor_bytes(&self) -> u64 {
        0
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.map.problem
    }

    fn residuals(&mut self) -> Residuals {
        self.settle().relative
    }

    fn forward_residual(&mut self) -> Option<f64> {
        Some(self.settle().squared.forward)
    }

    fn squared_residuals(&mut self) -> Option<SquaredResiduals> {
        (self.iteration > 0).then(|| self.settle().squared)
    }
}
