//! One linearised problem A(32), and the methods that solve it.

use super::consistency::{Consistency, Smoothness};
use super::cosine::CosineLaplacian;
use super::{Gmres, Pcg};
use crate::{Boundary, GradientTerm, Grid};
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, BuildError, Cycle, Extrapolation, GlobalReport, GlobalStep, History,
    Method, NormalMatrix, Objective, Order, Precision, Problem, Pull, Quadratic, SystemError,
};
use std::sync::Arc;

/// min over phi: |G M grad phi + g_t|^2 + beta |grad phi|^2, A(32), on a grid with forward differences that are 0 across the
/// border.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearised {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// G, M and g_t.
    pub data: Consistency,
    /// beta
    pub beta: f64,
    /// mu, the penalty of grad phi = z.
    pub mu: f64,
}

/// How it is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solver {
    /// ADMM with this over-relaxation; 1 is plain.
    Admm {
        /// In (0, 2).
        relaxation: f64,
    },
    /// A, Algorithm 1: Anderson on (z, u).
    AlgorithmOne {
        /// m
        window: usize,
    },
    /// Anderson on z alone, u and phi mixed by the same coefficients: A, appendix E.1.
    LocalAlone {
        /// m
        window: usize,
    },
    /// Fast ADMM with restart (Goldstein et al. 2014).
    Fast,
    /// ADMM as the preconditioner of GMRES (Zhang and White 2018), begun anew every so many iterations.
    Gmres {
        /// Iterations of a cycle.
        restart: usize,
    },
    /// Conjugate gradients on phi, preconditioned by cosine transforms.
    Pcg,
}

/// eta of the restart of fast ADMM.
const ETA: f64 = 0.999;

/// phi <- argmin beta |D phi|^2 + mu/2 |D phi - p|^2 by cosine transforms: (mu + 2 beta) D^T D phi = mu D^T p.
pub(super) struct Cosine {
    laplacian: CosineLaplacian,
    beta: f64,
    mu: f64,
    pull: Vec<f64>,
}

impl Cosine {
    pub fn new(of: &Linearised) -> Self {
        let laplacian = CosineLaplacian::new(of.width, of.height);
        Cosine { laplacian, beta: of.beta, mu: of.mu, pull: vec![0.0; of.width * of.height] }
    }

    /// The same from mu D^T p; returns beta |D phi|^2.
    pub fn solve(&mut self, b: &[f64], phi: &mut [f64]) -> f64 {
        self.beta * self.laplacian.solve(self.mu + 2.0 * self.beta, b, phi)
    }

    /// x <- (scale D^T D)^-1 b.
    pub fn precondition(&mut self, scale: f64, b: &[f64], x: &mut [f64]) {
        self.laplacian.solve(scale, b, x);
    }
}

/// What a transform costs, in nanoseconds a pixel and binary digit of the number of pixels: measured.
const TRANSFORM: f64 = 1.0;

impl GlobalStep for Cosine {
    fn run(
        &mut self,
        _objective: &mut Objective<'_>,
        _normal: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        let mut pull = std::mem::take(&mut self.pull);
        pull.iter_mut().zip(grad.iter()).for_each(|(b, g)| *b = -g);
        let f = self.solve(&pull, x);
        self.pull = pull;
        Ok(GlobalReport { inner: 1, quadratic: Some(f), ..GlobalReport::default() })
    }

    fn precision(&self) -> Option<Precision> {
        None
    }

    fn pull(&self) -> Pull {
        Pull::AtOrigin
    }

    fn work(&self) -> f64 {
        let n = self.pull.len() as f64;
        TRANSFORM * n * n.max(2.0).log2()
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn reset(&mut self) {}

    fn weigh(&mut self, problem: &Problem) -> Result<(), SystemError> {
        if let Some(term) = problem.terms.first() {
            let mut weights = vec![0.0; term.local_len()];
            term.local_weights2(&mut weights);
            self.mu = weights.first().copied().unwrap_or(self.mu);
        }
        Ok(())
    }
}

impl Linearised {
    /// As a problem of the splitting, begun at 0.
    ///
    /// # Errors
    /// Planes of another size, numbers that are not finite, mu or beta that are not positive.
    pub fn problem(&self) -> Result<Problem, BuildError> {
        let n = self.width * self.height;
        let planes = [&self.data.gx, &self.data.gy, &self.data.gt];
        if n == 0 || planes.iter().any(|p| p.len() != n || p.iter().any(|v| !v.is_finite())) {
            let size = format!("{} x {}", self.width, self.height);
            return Err(BuildError::Setting(format!("the data do not have {size} finite numbers")));
        }
        if !(self.mu > 0.0 && self.mu.is_finite() && self.beta >= 0.0 && self.beta.is_finite()) {
            let (mu, beta) = (self.mu, self.beta);
            return Err(BuildError::Setting(format!("mu is {mu} and beta {beta}; give mu > 0 and beta >= 0")));
        }
        let grid = Grid::new(self.width, self.height);
        let term = GradientTerm::new(grid, Boundary::Neumann, 0, self.data.clone(), self.mu);
        let smoothness = Smoothness { width: self.width, height: self.height, beta: self.beta };
        Ok(Problem {
            dim: 1,
            n_free: n,
            x0: vec![0.0; n],
            terms: vec![Box::new(term)],
            quadratic: Quadratic { potentials: vec![Arc::new(smoothness)], ..Quadratic::default() },
            barrier: false,
        })
    }

    /// A method that solves it from 0.
    ///
    /// # Errors
    /// As [`Self::problem`]; settings of the solver out of range.
    pub fn method(&self, solver: Solver) -> Result<Box<dyn Method>, BuildError> {
        let admm = |name: &str| -> Result<Admm, BuildError> {
            let global = Box::new(Cosine::new(self));
            let settings = AdmmSettings { name: name.to_string(), global, reweighting: None, renewed_at: None };
            Admm::new(self.problem()?, settings).map_err(|e| BuildError::Setting(e.to_string()))
        };
        match solver {
            Solver::Admm { relaxation } => {
                let name = if relaxation == 1.0 { "admm" } else { "relaxed" };
                Ok(Box::new(admm(name)?.with_cycle(Cycle { order: Order::Xzu, relaxation })?))
            }
            Solver::AlgorithmOne { window } => Acceleration::anderson(Algorithm::One, window).of(admm("algorithm-1")?),
            Solver::LocalAlone { window } => Acceleration::anderson(Algorithm::LocalAlone, window).of(admm("z-alone")?),
            Solver::Fast => {
                let by = Extrapolation::Momentum { eta: Some(ETA), corrected: false };
                Acceleration { algorithm: Algorithm::One, by, history: History::AsPublished }.of(admm("fast")?)
            }
            Solver::Gmres { restart } => Ok(Box::new(Gmres::new(self, restart)?)),
            Solver::Pcg => Ok(Box::new(Pcg::new(self)?)),
        }
    }
}
