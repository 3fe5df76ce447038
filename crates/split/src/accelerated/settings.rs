//! From a description to a method.

use super::{
    Accelerated, Alternation, BuildError, Carrier, CombinedResidual, CombinedResidualRaw, CombinedResidualZxu,
    DouglasRachford, DualAlone, Envelope, ForwardResidual, ForwardResidualZxu, History, LocalAlone,
};
use crate::accelerator::{Accelerator, Anderson, Kind, Momentum, Unaccelerated};
use crate::{Admm, Cycle, Method, Order};

/// What is accelerated: the carriers by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Algorithm {
    /// A, Algorithm 1: z and u, x-z-u.
    #[default]
    One,
    /// A, Algorithm 2: x and u, z-x-u.
    Two,
    /// The same with x and u as they are: least squares in the Euclidean metric, as A's implementation has them.
    TwoRaw,
    /// A, Algorithm 3: z, x-z-u.
    Three,
    /// A, Algorithm 4: u, z-x-u.
    Four,
    /// z alone, x-z-u, where the dual is affine: A, appendix E.1.
    LocalAlone,
    /// u alone, x-z-u, where the dual is affine: A, appendix E.2.
    DualAlone,
    /// The variable of the Douglas-Rachford iteration, judged by its residual.
    DouglasRachford,
    /// The same, judged by an envelope: Ouyang et al. 2020.
    Envelope,
    /// Nearest points and a solve in turns, without duals: Peng et al. 2018 on Bouaziz et al. 2012.
    Alternation,
}

impl Algorithm {
    /// The order of its steps.
    pub fn order(self) -> Order {
        match self {
            Algorithm::Two | Algorithm::TwoRaw | Algorithm::Four | Algorithm::Alternation => Order::Zxu,
            _ => Order::Xzu,
        }
    }

    /// The one of A that the iteration allows, of those that accelerate the fewest numbers: 3, else 4, else 1 or, with hard
    /// sets, 2.
    pub fn of(admm: &Admm) -> Algorithm {
        let hard = admm.terms().iter().any(|term| term.is_hard());
        let exact = admm.is_exact() && !admm.is_reweighted() && admm.terms().iter().all(|term| term.is_linear());
        let smooth = admm.terms().iter().all(|term| term.dual_map() >= crate::DualMap::Smooth);
        match () {
            () if exact && smooth && !hard => Algorithm::Three,
            () if exact && admm.free_of_inertia().is_none() => Algorithm::Four,
            () if hard => Algorithm::Two,
            () => Algorithm::One,
        }
    }
}

/// What proposes points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extrapolation {
    /// [`Anderson`] of a window, a mixing parameter beta and a kind.
    Anderson {
        /// m
        window: usize,
        /// beta
        mixing: f64,
        /// Type I or II.
        kind: Kind,
    },
    /// [`Momentum`], with Guler's correction or without.
    Momentum {
        /// eta of the restart; none: every point is kept.
        eta: Option<f64>,
        /// Whether it is corrected.
        corrected: bool,
    },
    /// Nothing.
    None,
}

impl Extrapolation {
    /// Type II, beta = 1.
    pub fn anderson(window: usize) -> Self {
        Extrapolation::Anderson { window, mixing: 1.0, kind: Kind::Two }
    }

    /// Columns of its history.
    fn columns(self) -> usize {
        match self {
            Extrapolation::Anderson { window, .. } => window,
            Extrapolation::Momentum { .. } => 1,
            Extrapolation::None => 0,
        }
    }

    fn accelerator(self) -> Result<Box<dyn Accelerator>, BuildError> {
        Ok(match self {
            Extrapolation::Anderson { mixing, .. } if !(mixing > 0.0 && mixing <= 1.0) => {
                return Err(BuildError::Setting(format!("the mixing parameter is {mixing}; it must be in (0, 1]")));
            }
            Extrapolation::Anderson { window, mixing, kind } => {
                Box::new(Anderson::new(window).with_mixing(mixing).of_kind(kind))
            }
            Extrapolation::Momentum { eta: Some(eta), .. } if !(eta > 0.0 && eta < 1.0) => {
                return Err(BuildError::Setting(format!("eta of the restart is {eta}; it must be between 0 and 1")));
            }
            Extrapolation::Momentum { eta, corrected } => {
                let momentum = eta.map_or_else(|| Momentum::new(1.0).without_restart(), Momentum::new);
                Box::new(if corrected { momentum.corrected() } else { momentum })
            }
            Extrapolation::None => Box::new(Unaccelerated),
        })
    }
}

/// How an [`Admm`] is accelerated: a description, of which [`Acceleration::of`] makes a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceleration {
    /// What is accelerated.
    pub algorithm: Algorithm,
    /// By what.
    pub by: Extrapolation,
    /// What a rejection does to the history.
    pub history: History,
}

impl Acceleration {
    /// Anderson of m = `window` columns on what the algorithm accelerates.
    pub fn anderson(algorithm: Algorithm, window: usize) -> Self {
        Acceleration { algorithm, by: Extrapolation::anderson(window), history: History::AsPublished }
    }

    /// A2DM2 (Kadkhodaie et al. 2015): momentum of the dual without restart, z being the one that has it; for terms
    /// whose dual is affine.
    pub fn a2dm2() -> Self {
        let by = Extrapolation::Momentum { eta: None, corrected: false };
        Acceleration { algorithm: Algorithm::DualAlone, by, history: History::AsPublished }
    }

    /// As [`Self::of`], where it pays: see [`super::Account`].
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn where_it_pays(&self, admm: Admm) -> Result<Box<dyn Method>, BuildError> {
        self.build(admm, true)
    }

    /// The iteration, in the order of the algorithm, accelerated.
    ///
    /// # Errors
    /// An algorithm whose conditions the problem does not meet, a number that makes no sense.
    pub fn of(&self, admm: Admm) -> Result<Box<dyn Method>, BuildError> {
        self.build(admm, false)
    }

    fn build(&self, admm: Admm, pays: bool) -> Result<Box<dyn Method>, BuildError> {
        let cycle = Cycle { order: self.algorithm.order(), ..admm.cycle() };
        let admm = admm.with_cycle(cycle)?;
        let columns = pays.then(|| self.by.columns());
        let parts = Parts { admm, by: self.by.accelerator()?, history: self.history, columns };
        match self.algorithm {
            Algorithm::One => parts.assemble::<CombinedResidual>(),
            Algorithm::Two => parts.assemble::<CombinedResidualZxu>(),
            Algorithm::TwoRaw => parts.assemble::<CombinedResidualRaw>(),
            Algorithm::Three => parts.assemble::<ForwardResidual>(),
            Algorithm::Four => parts.assemble::<ForwardResidualZxu>(),
            Algorithm::LocalAlone => parts.assemble::<LocalAlone>(),
            Algorithm::DualAlone => parts.assemble::<DualAlone>(),
            Algorithm::DouglasRachford => parts.assemble::<DouglasRachford>(),
            Algorithm::Envelope => parts.assemble::<Envelope>(),
            Algorithm::Alternation => parts.assemble::<Alternation>(),
        }
    }
}

/// What a method is made of.
struct Parts {
    admm: Admm,
    by: Box<dyn Accelerator>,
    history: History,
    columns: Option<usize>, // of the history, where acceleration has to pay
}

impl Parts {
    fn assemble<C: Carrier + 'static>(self) -> Result<Box<dyn Method>, BuildError> {
        let method = Accelerated::<C>::new(self.admm, self.by, self.history)?;
        Ok(match self.columns {
            Some(columns) => Box::new(method.where_it_pays(columns)),
            None => Box::new(method),
        })
    }
}
