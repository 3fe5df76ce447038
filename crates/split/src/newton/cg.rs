//! Conjugate gradients that notice negative curvature.

use crate::vector;

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CgEnd {
    /// The residual is as small as asked for.
    Solved,
    /// The matrix is not positive definite: it curves downwards along [`Cg::p`].
    NegativeCurvature,
    /// The most steps were taken.
    Limit,
}

/// What a solve did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CgReport {
    /// Steps taken.
    pub steps: usize,
    /// How it ended.
    pub end: CgEnd,
    /// |H d + g| / |g| at the end.
    pub residual: f64,
    /// d . H d
    pub curvature: f64,
}

/// The preconditioned conjugate gradient method for H d = -g, which stops where H has no positive curvature along its
/// direction (Steihaug 1983): d, the sum of the steps before, is then still a direction of descent.
#[derive(Default)]
pub struct Cg {
    /// The solution.
    pub d: Vec<f64>,
    /// The last direction.
    pub p: Vec<f64>,
    r: Vec<f64>, // -g - H d
    z: Vec<f64>, // M^-1 r
    q: Vec<f64>, // H p
}

impl Cg {
    /// Solves until |H d + g| <= tolerance |g| or `limit` steps are taken. At least one step is taken; where its
    /// curvature is negative already, d is the preconditioned gradient itself.
    ///
    /// # Errors
    /// Those of `multiply` (q <- H p) and `precondition` (z <- M^-1 z).
    pub fn solve<E>(
        &mut self,
        g: &[f64],
        tolerance: f64,
        limit: usize,
        mut multiply: impl FnMut(&[f64], &mut [f64]) -> Result<(), E>,
        mut precondition: impl FnMut(&mut [f64]) -> Result<(), E>,
    ) -> Result<CgReport, E> {
        let n = g.len();
        for v in [&mut self.d, &mut self.p, &mut self.r, &mut self.z, &mut self.q] {
            v.resize(n, 0.0);
        }
        self.d.fill(0.0);
        self.r.copy_from_slice(g);
        self.r.iter_mut().for_each(|r| *r = -*r);
        self.z.copy_from_slice(&self.r);
        precondition(&mut self.z)?;
        self.p.copy_from_slice(&self.z);
        let mut rz = vector::dot(&self.r, &self.z);
        let size = vector::norm(g);
        let mut report = CgReport { steps: 0, end: CgEnd::Limit, residual: 1.0, curvature: 0.0 };
        let sound = rz > 0.0 && rz.is_finite();
        if !sound {
            report.end = CgEnd::Solved;
            return Ok(report);
        }
        while report.steps < limit.max(1) {
            multiply(&self.p, &mut self.q)?;
            let curvature = vector::dot(&self.p, &self.q);
            let sound = curvature > 0.0 && curvature.is_finite();
            if !sound {
                if report.steps == 0 {
                    self.d.copy_from_slice(&self.p);
                    report.curvature = curvature;
                }
                report.end = CgEnd::NegativeCurvature;
                return Ok(report);
            }
            let alpha = rz / curvature;
            vector::add_scaled(&mut self.d, alpha, &self.p);
            vector::add_scaled(&mut self.r, -alpha, &self.q);
            report.curvature += alpha * rz; // the directions are conjugate
            report.steps += 1;
            report.residual = vector::norm(&self.r) / size;
            let open = report.residual > tolerance;
            if !open {
                report.end = CgEnd::Solved;
                return Ok(report);
            }
            if report.steps == limit {
                return Ok(report);
            }
            self.z.copy_from_slice(&self.r);
            precondition(&mut self.z)?;
            let next = vector::dot(&self.r, &self.z);
            let sound = next > 0.0;
            if !sound {
                return Ok(report);
            }
            let beta = next / rz;
            rz = next;
            for (p, z) in self.p.iter_mut().zip(&self.z) {
                *p = beta.mul_add(*p, *z);
            }
        }
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// diag(h) d = -g.
    fn solve(h: &[f64], g: &[f64], limit: usize) -> (Cg, CgReport) {
        let mut cg = Cg::default();
        let multiply = |p: &[f64], q: &mut [f64]| {
            for i in 0..p.len() {
                q[i] = h[i] * p[i];
            }
            Ok::<(), ()>(())
        };
        let report = cg.solve(g, 1e-12, limit, multiply, |_| Ok(())).expect("nothing fails");
        (cg, report)
    }

    #[test]
    fn as_many_steps_as_there_are_eigenvalues() {
        let (cg, report) = solve(&[1.0, 2.0, 2.0, 5.0], &[1.0, -2.0, 3.0, 4.0], 10);
        assert_eq!((report.steps, report.end), (3, CgEnd::Solved));
        for (d, want) in cg.d.iter().zip([-1.0, 1.0, -1.5, -0.8]) {
            assert!((d - want).abs() < 1e-12, "{d} {want}");
        }
        assert!((report.curvature - (1.0 + 2.0 + 4.5 + 3.2)).abs() < 1e-12, "{}", report.curvature);
    }

    /// A solve with the factor is most of a step's time: none after the last step.
    #[test]
    fn one_preconditioning_a_step() {
        let (mut cg, mut solves) = (Cg::default(), 0);
        let multiply = |p: &[f64], q: &mut [f64]| {
            q.iter_mut().zip(p).zip([1.0, 2.0, 3.0, 4.0]).for_each(|((q, p), h)| *q = h * p);
            Ok::<(), ()>(())
        };
        let count = |_: &mut [f64]| {
            solves += 1;
            Ok(())
        };
        let report = cg.solve(&[1.0, 1.0, 1.0, 1.0], 1e-12, 3, multiply, count).expect("nothing fails");
        assert_eq!((report.steps, report.end, solves), (3, CgEnd::Limit, 3));
    }

    #[test]
    fn negative_curvature_is_told_and_the_step_descends() {
        let g = [1.0, 1.0, 1.0];
        let (cg, report) = solve(&[1.0, 4.0, -0.5], &g, 10);
        assert_eq!(report.end, CgEnd::NegativeCurvature);
        assert!(cg.d.iter().zip(&g).map(|(d, g)| d * g).sum::<f64>() < 0.0);
        let curvature: f64 = cg.p.iter().zip([1.0, 4.0, -0.5]).map(|(p, h)| h * p * p).sum();
        assert!(curvature <= 0.0);
    }
}
