//! Where a minimum goes when what is fixed moves a little.

use crate::{Cg, CgEnd, Hessian, NormalMatrix, Problem, SystemError, vector};

/// The gradient is differentiated over this part of the size of the body: its elements, a hundredth of it or more, strain
/// by 1e-5 or less, and rounding is 1e-8 of what they answer.
const NEARBY: f64 = 1e-7;

/// Residual that conjugate gradients leave where there is no factor, and the most steps of theirs.
const TOLERANCE: f64 = 1e-2;
const STEPS: usize = 100;

/// The answer to a motion of fixed nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response {
    /// Displacement of the free nodes.
    pub d: Vec<f64>,
    /// Norm of the force that it balances: the gradient at x, the motion included to first order.
    pub force: f64,
}

/// The linear response of a minimum x to a displacement s of the fixed nodes,
///
/// ```text
/// d = -H^-1 (g(x) + K s),    K s = d/dt g(x + t s) at t = 0,
/// ```
///
/// g the gradient over the free nodes, H their Hessian as it was factored last or, without a factor, assembled last, which
/// should have been near x. `moved`
/// covers all nodes, 0 at free ones. What else has changed, such as targets of springs, is in g(x) already.
///
/// With a factor of H this is one solve in f32; without, conjugate gradients preconditioned by the normal matrix. `None`
/// where neither makes sense: nothing was assembled, or a number is not finite, or H curves downwards.
///
/// # Errors
/// Vectors of another length than the problem has.
pub fn respond(
    problem: &mut Problem,
    normal: &mut NormalMatrix,
    hessian: &mut Hessian,
    x: &[f64],
    moved: &[f64],
) -> Result<Option<Response>, SystemError> {
    let n = problem.n_free * problem.dim;
    if !hessian.is_assembled() || n == 0 {
        return Ok(None);
    }
    let mut r = vec![0.0; n];
    problem.energy(x, Some(&mut r));
    let farthest = moved.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if farthest > 0.0 {
        let t = NEARBY * vector::extent(x, problem.dim) / farthest;
        let mut near = x.to_vec();
        vector::add_scaled(&mut near, t, moved);
        let mut g = vec![0.0; n];
        problem.energy(&near, Some(&mut g));
        let slope = vector_difference(&g, &r, 1.0 / t);
        vector::add_scaled(&mut r, 1.0, &slope);
    }
    let force = vector::norm(&r);
    if !force.is_finite() {
        return Ok(None);
    }
    if hessian.is_factored() {
        hessian.solve(&mut r)?;
        r.iter_mut().for_each(|r| *r = -*r);
        return Ok(vector::is_finite(&r).then_some(Response { d: r, force }));
    }
    let mut cg = Cg::default();
    let matrix = hessian.matrix();
    let report =
        cg.solve(&r, TOLERANCE, STEPS, |p, q| matrix.multiply(p, q).map_err(SystemError::from), |z| normal.solve(z))?;
    let sound = report.end != CgEnd::NegativeCurvature && vector::is_finite(&cg.d);
    Ok(sound.then_some(Response { d: cg.d, force }))
}

/// c (a - b)
fn vector_difference(a: &[f64], b: &[f64], c: f64) -> Vec<f64> {
    let mut out = vec![0.0; a.len()];
    vector::subtract(&mut out, a, b);
    out.iter_mut().for_each(|v| *v *= c);
    out
}
