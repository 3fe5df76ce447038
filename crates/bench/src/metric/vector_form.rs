//! A global step whose first Hessian knows the metric: L-BFGS preconditioned by a matrix with 3 x 3 blocks.

use super::elements::{Corners, MetricElements, Shared, pair_sum};
use super::moduli::Moduli;
use proxel::linalg::sparse::{BlockMatrix, Cholesky, SolveScratch};
use proxel::model::elements::{Shape, Simplex};
use proxel::model::energy::Energy;
use proxel::split::{GlobalReport, GlobalStep, NormalMatrix, Objective, SystemError, vector};
use std::collections::VecDeque;
use std::sync::{Arc, PoisonError};

/// What the blocks are, dS being the change of sym(F) by dF and R the rotation where they were made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VectorModel {
    /// d |dF|^2 + (v - d)/3 (R : dF)^2: the Laplacian of scalar weights, and the change of volume. Never softer than
    /// the objective for small steps.
    Laplacian,
    /// d |dS|^2 + (v - d)/3 (tr dS)^2, the Gauss-Newton matrix of the objective.
    GaussNewton,
}

/// Settings of [`VectorForm`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VectorSettings {
    /// What the blocks are.
    pub model: VectorModel,
    /// The matrix is made anew after so many global steps.
    pub refresh: usize,
    /// Pairs kept within a global step.
    pub window: usize,
    /// Stop after a step with g . Hg < kappa |Delta L|.
    pub kappa: f64,
    /// Most inner steps.
    pub max_inner: usize,
}

/// The matrix in vector form and its factor.
struct Factor {
    matrix: BlockMatrix,
    cholesky: Cholesky<f64>,
    scratch: SolveScratch,
}

/// L-BFGS with step halving, preconditioned in vector form.
pub struct VectorForm {
    settings: VectorSettings,
    shared: Shared,
    factor: Option<Factor>,
    age: usize,
    /// Factorisations done.
    pub factorisations: Arc<std::sync::atomic::AtomicUsize>,
}

impl VectorForm {
    /// For one term.
    pub fn new<E: Energy<3>>(term: &MetricElements<E>, settings: VectorSettings) -> Self {
        VectorForm { settings, shared: term.shared(), factor: None, age: 0, factorisations: Arc::default() }
    }

    fn refresh(&mut self, x: &[f64], normal: &NormalMatrix) -> Result<(), SystemError> {
        let (pattern, _) = normal.matrix();
        let factor = match &mut self.factor {
            Some(factor) => factor,
            none => none.insert(Factor {
                matrix: BlockMatrix::new(pattern, 3)?,
                cholesky: Cholesky::new(Arc::new(normal.symbolic().expanded(3)?)),
                scratch: SolveScratch::default(),
            }),
        };
        let values = factor.matrix.values_mut();
        values.fill(0.0);
        let moduli = self.shared.moduli.lock().unwrap_or_else(PoisonError::into_inner);
        for (corners, moduli) in self.shared.corners.iter().zip(moduli.iter()) {
            let block = blocks(corners, *moduli, x, self.settings.model);
            for a in 0..4 {
                for b in 0..4 {
                    let (i, j) = (corners.nodes[a] as usize, corners.nodes[b] as usize);
                    if i < j || i >= pattern.n() {
                        continue;
                    }
                    if let Some(slot) = pattern.slot(i, j) {
                        for r in 0..3 {
                            for c in 0..3 {
                                values[9 * slot + 3 * r + c] += block[3 * a + r][3 * b + c];
                            }
                        }
                    }
                }
            }
        }
        drop(moduli);
        factor.cholesky.refactor(factor.matrix.values())?;
        self.factorisations.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        Ok(())
    }

    fn solve(&mut self, b: &mut [f64]) -> Result<(), SystemError> {
        match &mut self.factor {
            Some(factor) => Ok(factor.cholesky.solve_in_place(b, 1, &mut factor.scratch)?),
            None => Err(SystemError::Factor("the vector form has not been factored".to_string())),
        }
    }
}

/// The 12 x 12 matrix of an element.
fn blocks(corners: &Corners, moduli: Moduli, x: &[f64], model: VectorModel) -> [[f64; 12]; 12] {
    let at = Simplex::svd(corners.deformation_gradient(x));
    // Column 3 a + c: what moving corner a along c does.
    let mut strain = [[0.0; 9]; 12];
    let mut trace = [0.0; 12];
    for (a, g) in corners.gradients.iter().enumerate() {
        for c in 0..3 {
            let k = 3 * a + c;
            let mut h = [[0.0; 3]; 3]; // U^T dF V
            for i in 0..3 {
                for j in 0..3 {
                    h[i][j] = at.u[c][i] * (g[0] * at.v[0][j] + g[1] * at.v[1][j] + g[2] * at.v[2][j]);
                }
            }
            trace[k] = h[0][0] + h[1][1] + h[2][2];
            for i in 0..3 {
                for j in 0..3 {
                    strain[k][3 * i + j] = match model {
                        VectorModel::Laplacian => h[i][j],
                        VectorModel::GaussNewton if i == j => h[i][i],
                        VectorModel::GaussNewton => (at.s[i] * h[i][j] + at.s[j] * h[j][i]) / pair_sum(&at.s, i, j),
                    };
                }
            }
        }
    }
    let mut out = [[0.0; 12]; 12];
    for k in 0..12 {
        for l in 0..12 {
            let product: f64 = strain[k].iter().zip(&strain[l]).map(|(a, b)| a * b).sum();
            let of_trace = moduli.of_trace() * trace[k] * trace[l];
            out[k][l] = corners.volume * (moduli.deviatoric * product + of_trace);
        }
    }
    out
}

impl GlobalStep for VectorForm {
    fn run(
        &mut self,
        objective: &mut Objective<'_>,
        normal: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        if self.factor.is_none() || self.age >= self.settings.refresh {
            self.refresh(x, normal)?;
            self.age = 0;
        }
        self.age += 1;
        let n = grad.len();
        let mut report = GlobalReport::default();
        let mut value = objective.value;
        let enough = self.settings.kappa * objective.local_change.max(1e-15 * value.abs());
        let mut pairs: VecDeque<(Vec<f64>, Vec<f64>, f64)> = VecDeque::new();
        let mut next = vec![0.0; n];
        while report.inner < self.settings.max_inner {
            let mut q = grad.clone();
            let mut alphas = Vec::new();
            for (s, y, sy) in pairs.iter().rev() {
                let alpha = vector::dot(s, &q) / sy;
                vector::add_scaled(&mut q, -alpha, y);
                alphas.push(alpha);
            }
            self.solve(&mut q)?;
            report.solves += 1;
            for ((s, y, sy), alpha) in pairs.iter().zip(alphas.iter().rev()) {
                let beta = vector::dot(y, &q) / sy;
                vector::add_scaled(&mut q, alpha - beta, s);
            }
            let slope = vector::dot(grad, &q);
            if !(slope > 0.0 && slope.is_finite()) {
                break;
            }
            let mut t = 1.0;
            vector::add_scaled(&mut x[..n], -t, &q);
            let mut arrived = objective.at(x, &mut next).value;
            while arrived.is_nan() || arrived > value - 1e-4 * t * slope {
                if t < 1e-10 {
                    break;
                }
                t /= 2.0;
                vector::add_scaled(&mut x[..n], t, &q);
                report.shortened += 1;
                arrived = objective.at(x, &mut next).value;
            }
            value = arrived;
            report.inner += 1;
            let s: Vec<f64> = q.iter().map(|v| -t * v).collect();
            let y: Vec<f64> = next.iter().zip(grad.iter()).map(|(a, b)| a - b).collect();
            let sy = vector::dot(&s, &y);
            if sy > 0.0 {
                pairs.push_back((s, y, sy));
            }
            if pairs.len() > self.settings.window {
                pairs.pop_front();
            }
            std::mem::swap(grad, &mut next);
            if slope < enough {
                break;
            }
        }
        Ok(report)
    }

    fn reset(&mut self) {
        self.age = usize::MAX;
    }
}
