//! The plain iteration as a map of z, on which GMRES stands and by which all methods are measured alike.

use super::Linearised;
use super::problem::Cosine;
use proxel_split::vector;
use proxel_split::{BuildError, Cycle, EnergyReport, Evaluation, LocalReport, Problem, Residuals, SquaredResiduals};

/// z -> z+ by one x-z-u iteration from z with its u of appendix E.1: an affine map.
pub(super) struct IterationMap {
    pub problem: Problem,
    pub cosine: Cosine,
    pub x: Vec<f64>, // phi of the last image
    p: Vec<Vec<f64>>,
    u: Vec<Vec<f64>>,
    pull: Vec<f64>,
}

impl IterationMap {
    pub fn new(of: &Linearised) -> Result<Self, BuildError> {
        let problem = of.problem()?;
        let len: usize = problem.terms.iter().map(|term| term.local_len()).sum();
        let n = problem.x0.len();
        let cosine = Cosine::new(of);
        let zero = vec![vec![0.0; len]];
        Ok(IterationMap { problem, cosine, x: vec![0.0; n], p: zero.clone(), u: zero, pull: vec![0.0; n] })
    }

    /// Numbers in z.
    pub fn len(&self) -> usize {
        self.p[0].len()
    }

    /// image <- the image of z; its phi is `x` after.
    pub fn apply(&mut self, z: &[f64], image: &mut [f64]) -> LocalReport {
        self.problem.terms[0].dual(z, &mut self.u[0]);
        vector::subtract(&mut self.p[0], z, &self.u[0]);
        self.problem.pull(&self.p, &mut self.pull);
        self.pull.iter_mut().for_each(|v| *v = -*v);
        self.cosine.solve(&self.pull, &mut self.x);
        let report = self.problem.pull_step(&Cycle::PLAIN, &self.x, &mut self.p, &mut self.u, &mut self.pull);
        image.iter_mut().zip(&self.p[0]).zip(&self.u[0]).for_each(|((z, p), u)| *z = p + u);
        report
    }

    /// z <- D phi.
    pub fn couple(&mut self, phi: &[f64], z: &mut [f64]) {
        self.problem.terms[0].couple(phi, z);
    }

    /// The residuals of A of the iteration from z: forward A(22), combined A(11), and those of A(27) over |W z|.
    pub fn measure(&mut self, z: &[f64]) -> Measured {
        let mut image = vec![0.0; z.len()];
        let report = self.apply(z, &mut image);
        let size = self.problem.terms[0].residual(&self.x, &self.p[0], &self.u[0]).size2.sqrt();
        let relative = |square: f64| if square > 0.0 { square.sqrt() / size } else { 0.0 };
        Measured {
            squared: SquaredResiduals { forward: report.gap2_before, combined: report.combined() },
            relative: Residuals { primal: relative(report.gap2), dual: relative(report.moved2) },
        }
    }

    /// Objective at phi.
    pub fn energy(&mut self, phi: &[f64]) -> EnergyReport {
        self.problem.energy(phi, None)
    }

    /// The same and its gradient.
    pub fn evaluate(&mut self, phi: &[f64]) -> Evaluation {
        let mut grad = vec![0.0; phi.len()];
        let energy = self.problem.energy(phi, Some(&mut grad));
        Evaluation { energy, gradient_norm: vector::norm(&grad) }
    }
}

/// What [`IterationMap::measure`] finds.
#[derive(Clone, Copy)]
pub(super) struct Measured {
    pub squared: SquaredResiduals,
    pub relative: Residuals,
}
