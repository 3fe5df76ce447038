//! How each method takes a problem: what is split off with a dual, in which order, and what is accelerated.

use super::{ShapeMethod, ShapeSettings};
use proxel_model::constraint::Hold;
use proxel_split::{Acceleration, Admm, Algorithm, BuildError, Cycle, Extrapolation, History, Method, Order};

/// Updates of z and x in turns that `alm` makes before each of u: the text says "multiple". On costa, Figure 1, a thousand
/// solves lead to a residual of 1.8e-4 so, and to one of 2.1e-4 in ADMM.
const ALTERNATIONS: usize = 5;

/// A method and its penalty, as far as the terms of a problem depend on them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Way {
    method: ShapeMethod,
    mu: f64,
}

impl Way {
    /// Of these settings.
    pub fn of(settings: &ShapeSettings) -> Self {
        Way { method: settings.method, mu: settings.mu }
    }

    /// How a constraint is held that is to be held so. ShapeUp knows soft ones alone: the penalty is the weight. In a
    /// Douglas-Rachford iteration every z is split off with a dual.
    pub fn hold(self, hold: Hold) -> Hold {
        match (self.method, hold) {
            (ShapeMethod::Shapeup, Hold::Hard(mu)) => Hold::Soft(mu),
            (ShapeMethod::Aadr, Hold::Soft(weight)) => Hold::Split { weight, mu: self.mu },
            (_, hold) => hold,
        }
    }
}

/// The method on its problem.
pub(super) fn method(admm: Admm, settings: &ShapeSettings) -> Result<Box<dyn Method>, BuildError> {
    let zxu = |admm: Admm| admm.with_cycle(Cycle { order: Order::Zxu, relaxation: 1.0 });
    // Where nothing is split off there is nothing to accelerate but nearest points and solves in turns.
    let split = admm.problem().terms.iter().any(|term| term.has_dual());
    let algorithm = match settings.method {
        ShapeMethod::Auto | ShapeMethod::AaAdmm if !split => Algorithm::Alternation,
        ShapeMethod::Admm => return Ok(Box::new(zxu(admm)?)),
        ShapeMethod::Alm => return Ok(Box::new(zxu(admm)?.with_alternations(ALTERNATIONS)?)),
        // In the metric of the splitting: sooner where `auto` goes on, later where it does not.
        ShapeMethod::Auto => Algorithm::Two,
        ShapeMethod::AaAdmm => Algorithm::TwoRaw,
        ShapeMethod::Aadr => Algorithm::DouglasRachford,
        ShapeMethod::Shapeup => Algorithm::Alternation,
    };
    // Without columns the same iterates as without acceleration, with merits.
    let by = match settings.anderson {
        0 => Extrapolation::None,
        m => Extrapolation::anderson(m),
    };
    Acceleration { algorithm, by, history: History::AsPublished }.of(admm)
}
