//! One variable alone: A, Algorithms 3 and 4, and appendix E.

use super::carrier::{
    COUPLE, Carrier, Extrapolated, Sense, check_duals, check_exact, check_order, check_sets, of_sense,
};
use super::{BuildError, Merit};
use crate::{Admm, DualMap, LocalReport, Order, Problem, Residual};

/// A, Algorithm 3: z as the fixed point of the x-z-u iteration, which it is where u follows from z by A(21) (Proposition
/// 3.1; appendix E.1), and the forward residual |W(c(Dx) - z)|^2 of the next x as its merit, A(22): it vanishes exactly at
/// fixed points (Proposition 3.2). An accelerated z gets the u of A(21) and a solve for its x; a rejected one costs another
/// solve.
pub struct ForwardResidual(Sense);

impl Carrier for ForwardResidual {
    const NAME: &'static str = "algorithm 3";
    const ORDER: Order = Order::Xzu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::Local;
    const LEADS: bool = true;
    const LATE: bool = true;
    const SENSING: f64 = COUPLE;
    // The map A(21) decomposes each z; the gradient of the global step's objective is taken anew.
    const OVERHEAD: f64 = 0.6 + COUPLE;
    const REFUSAL: (f64, f64) = (2.0 * COUPLE, 1.0);
    const KEEPS_HISTORY: bool = true;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)?;
        check_sets(admm, Self::NAME)?;
        check_exact(admm, Self::NAME)?;
        check_duals(admm, Self::NAME, DualMap::Smooth)
    }

    fn new(problem: &Problem) -> Self {
        Self(Sense::new(problem, 1))
    }

    of_sense!(0);

    fn before(&mut self, _: &mut Problem, _: &[f64], p: &[Vec<f64>], u: &[Vec<f64>]) {
        self.0.begin(p, u, |p, u| p + u);
    }

    fn after_local(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], _: &LocalReport) -> Option<Merit> {
        self.0.end(p, u, |p, u| p + u);
        None
    }

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        p: &[Vec<f64>],
        u: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        let mut residual = Residual::default();
        for ((term, p), u) in problem.terms.iter_mut().zip(p).zip(u) {
            residual += term.residual(x, p, u);
        }
        Some(Merit::of_square(residual.gap2))
    }
}

/// A, Algorithm 4: u as the fixed point of the z-x-u iteration, which it is where f is a strongly convex quadratic, so that
/// x follows from u by A(23) (Proposition 3.3), and the forward residual |W(c(Dx) - z)|^2 of the next z as its merit, A(24):
/// it vanishes exactly at fixed points (Proposition 3.4). x rides along by the coefficients of u, which keeps A(23). A
/// rejected point costs another local step.
pub struct ForwardResidualZxu(Sense);

impl Carrier for ForwardResidualZxu {
    const NAME: &'static str = "algorithm 4";
    const ORDER: Order = Order::Zxu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::PositionsAndDual;
    const SETTLES: usize = 1;
    const REFUSAL: (f64, f64) = (1.0, 0.0);
    const KEEPS_HISTORY: bool = false;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)?;
        check_exact(admm, Self::NAME)?;
        match admm.free_of_inertia() {
            Some(node) => Err(BuildError::NoInertia { node }),
            None => Ok(()),
        }
    }

    fn new(problem: &Problem) -> Self {
        Self(Sense::new(problem, 1))
    }

    of_sense!(0);

    fn before(&mut self, _: &mut Problem, _: &[f64], p: &[Vec<f64>], u: &[Vec<f64>]) {
        self.0.begin(p, u, |_, u| u);
    }

    fn after_local(&mut self, _: &[Vec<f64>], _: &[Vec<f64>], local: &LocalReport) -> Option<Merit> {
        Some(Merit::of_square(local.gap2))
    }

    fn after_global(
        &mut self,
        _: &mut Problem,
        _: &[f64],
        p: &[Vec<f64>],
        u: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        self.0.end(p, u, |_, u| u);
        None
    }
}

/// z alone where u is an affine function of it (A, appendix E.1; Figure 11): as Algorithm 3, but u and x ride along by the
/// coefficients of z, so that an accelerated point costs no solve of its own. Its merit is the forward residual A(22),
/// which the local step finds.
pub struct LocalAlone(Sense);

/// u alone where z is an affine function of it (A, appendix E.2): z and x ride along by the coefficients of u.
pub struct DualAlone(Sense);

macro_rules! affine {
    ($carrier:ident, $name:literal, $value:expr) => {
        impl Carrier for $carrier {
            const NAME: &'static str = $name;
            const ORDER: Order = Order::Xzu;
            const EXTRAPOLATED: Extrapolated = Extrapolated::All;
            const SETTLES: usize = 1;
            const REFUSAL: (f64, f64) = (1.0, 0.0);
            const KEEPS_HISTORY: bool = true;

            fn check(admm: &Admm) -> Result<(), BuildError> {
                check_order(admm, Self::NAME, Self::ORDER)?;
                check_sets(admm, Self::NAME)?;
                check_duals(admm, Self::NAME, DualMap::Affine)
            }

            fn new(problem: &Problem) -> Self {
                Self(Sense::new(problem, 1))
            }

            of_sense!(0);

            fn before(&mut self, _: &mut Problem, _: &[f64], p: &[Vec<f64>], u: &[Vec<f64>]) {
                self.0.begin(p, u, $value);
            }

            fn after_local(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], local: &LocalReport) -> Option<Merit> {
                self.0.end(p, u, $value);
                Some(Merit::of_square(local.gap2_before))
            }
        }
    };
}

affine!(LocalAlone, "z alone", |p, u| p + u);
affine!(DualAlone, "u alone", |_, u| u);
