//! The curvature that a quasi-Newton method learns from a step: measured, or blended with that of the Laplacian.

use crate::{NormalMatrix, Problem, SystemError, vector};
use rayon::prelude::*;

/// Numbers handled by one task.
const CHUNK: usize = 8192;

/// Relative change at which the power iteration for |A| ends, and its most steps: the norm only scales a blend.
const NORM_TOLERANCE: f64 = 1e-3;
const NORM_STEPS: usize = 30;

/// Blends the measured curvature of a step s with that of the normal matrix A (Zhu, Bridson and Kaufman 2018):
///
/// ```text
/// y <- beta z + (1 - beta) y,   z = A s,   beta = clamp(y . z |A| / volume^(4/3), 0, 1)
/// ```
///
/// Long steps, taken far from the minimum, teach the Sobolev metric; short ones the true curvature. The formula above is
/// that of the authors' code in 3D, for A and E in units in which the stiffness is 1; here all of it is in units in which
/// the stiffness k = sum w^2 / sum V and the volume are both 1, so that beta depends on no unit:
/// beta = clamp((y . z) |A| / (k^3 volume^((3 K - 4) / K)), 0, 1) for elements of dimension K.
pub struct Blend {
    scale: f64,  // of y . z
    z: Vec<f64>, // A s
}

impl Blend {
    /// Estimates |A| by power iteration from a fixed start.
    ///
    /// # Errors
    /// A vector that does not fit the matrix.
    pub fn new(problem: &Problem, normal: &NormalMatrix) -> Result<Self, SystemError> {
        let (mut measure, mut weight2, mut corners) = (0.0, 0.0, 1);
        for term in &problem.terms {
            let scale = term.scale();
            measure += scale.measure;
            weight2 += scale.weight2;
            term.for_each_element(&mut |nodes| corners = nodes.len().max(corners));
        }
        let k = (corners - 1) as f64;
        let stiffness = weight2 / measure;
        let size = measure.powf((3.0 * k - 4.0) / k);
        let n = problem.n_free * problem.dim;
        Ok(Blend { scale: norm(normal, n)? / (stiffness.powi(3) * size), z: vec![0.0; n] })
    }

    /// Blends y, the change of the gradient over the step s; returns beta.
    ///
    /// # Errors
    /// A vector that does not fit the matrix.
    pub fn apply(&mut self, normal: &NormalMatrix, s: &[f64], y: &mut [f64]) -> Result<f64, SystemError> {
        normal.multiply(s, &mut self.z)?;
        let beta = (self.scale * vector::dot(y, &self.z)).clamp(0.0, 1.0);
        let blended = y.par_iter_mut().zip(&self.z).with_min_len(CHUNK);
        blended.for_each(|(y, z)| *y = beta * z + (1.0 - beta) * *y);
        Ok(beta)
    }
}

/// The largest eigenvalue of A, to about [`NORM_TOLERANCE`].
fn norm(normal: &NormalMatrix, n: usize) -> Result<f64, SystemError> {
    // Any start will do that is no eigenvector: the signs alternate with no period that a mesh would have.
    let mut v: Vec<f64> = (0..n).map(|i| if (i * i / 7) % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let mut image = vec![0.0; n];
    let mut found = 0.0;
    for _ in 0..NORM_STEPS {
        let size = vector::norm(&v);
        v.iter_mut().for_each(|v| *v /= size);
        normal.multiply(&v, &mut image)?;
        let next = vector::norm(&image);
        std::mem::swap(&mut v, &mut image);
        if (next - found).abs() <= NORM_TOLERANCE * next {
            return Ok(next);
        }
        found = next;
    }
    Ok(found)
}
