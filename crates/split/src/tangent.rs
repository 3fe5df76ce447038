//! The linear system of a minimum: how it answers to forces.

use crate::{Cg, CgEnd, FactorCost, Hessian, NormalMatrix, Precision, Problem, Projection, SystemError, vector};

/// Residual, over the right-hand side, at which a solve ends.
const TOLERANCE: f64 = 1e-13;

/// The largest residual that is still a solution.
const ACCEPTED: f64 = 1e-9;

/// How often a solution is corrected by what is left of the residual.
const CORRECTIONS: usize = 4;

/// Steps of conjugate gradients a correction, with a factor and without one.
const STEPS: [usize; 2] = [20, 20_000];

/// Part of its mean that is added to the diagonal of a matrix that is known to be singular: less than any stiffness
/// that 64 bits tell from none, and it is taken out again by the corrections.
const SHIFT: f64 = 1e-11;

/// H, the Hessian of a problem over its free nodes at a minimum, ready to be solved with: H is positive definite apart
/// from known motions that cost nothing.
pub struct Tangent {
    normal: NormalMatrix,
    hessian: Hessian,
    free: Vec<Vec<f64>>, // orthonormal
    is_factored: bool,
}

/// Why a minimum does not answer.
#[derive(Clone, Debug, PartialEq)]
pub enum TangentError {
    /// The system cannot be set up.
    System(SystemError),
    /// H curves downwards, or not at all: where it is, is no minimum, or not the only one near.
    Indefinite,
    /// H is so near to singular that this residual, over the right-hand side, was left.
    Inexact(f64),
}

impl std::fmt::Display for TangentError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            TangentError::System(e) => e.fmt(f),
            TangentError::Indefinite => {
                f.write_str("the Hessian is not positive definite there: it is a saddle or a point where minima part")
            }
            TangentError::Inexact(r) => {
                write!(f, "the Hessian is nearly singular there: a residual of {r:.1e} is left")
            }
        }
    }
}

impl std::error::Error for TangentError {}

impl From<SystemError> for TangentError {
    fn from(e: SystemError) -> Self {
        TangentError::System(e)
    }
}

impl Tangent {
    /// The true Hessian of `problem` at x, factored in f64 where that takes at most `memory` bytes; otherwise it is
    /// solved with by conjugate gradients. `motions` are those that cost nothing, over the free nodes, such as the
    /// rotation of a map that one vertex holds.
    ///
    /// # Errors
    /// A problem without second derivatives; [`TangentError::Indefinite`] where a factor shows it.
    pub fn new(problem: &mut Problem, x: &[f64], motions: Vec<Vec<f64>>, memory: f64) -> Result<Self, TangentError> {
        let normal = NormalMatrix::with_precision(problem, Precision::Single)?;
        let mut hessian = Hessian::new(problem, &normal)?;
        hessian.assemble(problem, x, Projection::None)?;
        // Twice as many bytes as an f32 factor.
        let is_factored = 2.0 * FactorCost::of(&normal, problem.dim).bytes <= memory;
        let free = orthonormal(motions);
        if is_factored {
            hessian.set_precision(Precision::Double);
            let shift = if free.is_empty() { 0.0 } else { SHIFT };
            if !hessian.factor(&normal, shift)? {
                return Err(TangentError::Indefinite);
            }
        }
        Ok(Tangent { normal, hessian, free, is_factored })
    }

    /// w with H w = b, orthogonal to the motions that cost nothing; the part of b along them, which nothing answers, is
    /// left out.
    ///
    /// # Errors
    /// [`TangentError::Indefinite`] and [`TangentError::Inexact`].
    pub fn solve(&mut self, b: &[f64]) -> Result<Vec<f64>, TangentError> {
        let Tangent { normal, hessian, free, is_factored } = self;
        let (matrix, factor, scratch) = hessian.parts();
        let (mut r, mut w) = (b.to_vec(), vec![0.0; b.len()]);
        project(free, &mut r);
        let size = vector::norm(&r);
        if size == 0.0 {
            return Ok(w);
        }
        let (b, mut product) = (r.clone(), vec![0.0; r.len()]);
        let mut left = 1.0;
        for _ in 0..CORRECTIONS {
            let mut cg = Cg::default();
            let end = cg.solve(
                &r,
                TOLERANCE,
                STEPS[usize::from(!*is_factored)],
                |p, q| {
                    matrix.multiply(p, q).map_err(SystemError::from)?;
                    project(free, q);
                    Ok::<_, SystemError>(())
                },
                |z| {
                    match factor {
                        Some(factor) => factor.solve(z, 1, scratch)?,
                        None => normal.solve(z)?,
                    }
                    project(free, z);
                    Ok(())
                },
            )?;
            // In the noise of a solution that is exact already, curvature has no sign.
            if end.end == CgEnd::NegativeCurvature && left > ACCEPTED {
                return Err(TangentError::Indefinite);
            }
            // It has solved H d = -r.
            vector::add_scaled(&mut w, -1.0, &cg.d);
            matrix.multiply(&w, &mut product).map_err(SystemError::from)?;
            vector::subtract(&mut r, &b, &product);
            project(free, &mut r);
            let before = std::mem::replace(&mut left, vector::norm(&r) / size);
            let gains = left < 0.5 * before;
            if left <= TOLERANCE || !gains {
                break;
            }
        }
        let solved = left <= ACCEPTED && vector::is_finite(&w);
        if solved { Ok(w) } else { Err(TangentError::Inexact(left)) }
    }
}

/// v loses its parts along orthonormal motions.
fn project(motions: &[Vec<f64>], v: &mut [f64]) {
    for motion in motions {
        let along = vector::dot(motion, v);
        vector::add_scaled(v, -along, motion);
    }
}

/// Gram-Schmidt, twice for the digits; motions that others span are left out.
fn orthonormal(motions: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    /// What is left of a motion that others span is rounding.
    const SPANNED: f64 = 1e-10;
    let mut out: Vec<Vec<f64>> = Vec::new();
    for mut motion in motions {
        let before = vector::norm(&motion);
        project(&out, &mut motion);
        project(&out, &mut motion);
        let length = vector::norm(&motion);
        if length > SPANNED * before {
            motion.iter_mut().for_each(|v| *v /= length);
            out.push(motion);
        }
    }
    out
}
