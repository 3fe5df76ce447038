//! Why methods cannot be put together.

use crate::{Order, SystemError};

/// Parts that do not go together; the text says what would.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BuildError {
    /// Remark 3.1 of A: a hard set on the variable that is updated second, which an affine combination could leave.
    HardSet {
        /// The term, from 0.
        term: usize,
        /// The algorithm.
        algorithm: &'static str,
    },
    /// A term whose dual is no function of its z: A, appendix E.1, (C3) and (C4).
    NoDualMap {
        /// The term, from 0.
        term: usize,
        /// The algorithm.
        algorithm: &'static str,
        /// Whether a smooth map would not do either.
        affine: bool,
    },
    /// A term whose splitting has no dual.
    NoDual {
        /// The term, from 0.
        term: usize,
        /// The algorithm.
        algorithm: &'static str,
    },
    /// A term whose splitting has a dual.
    Dual {
        /// The term, from 0.
        term: usize,
        /// The algorithm.
        algorithm: &'static str,
    },
    /// A node without inertia: f is not strongly convex, and x no function of u. Assumption 3.2 of A.
    NoInertia {
        /// The node.
        node: usize,
    },
    /// The global step is not the minimiser of its objective: a coupling that is not linear, a global step that is not
    /// exact, a potential.
    Inexact {
        /// The algorithm.
        algorithm: &'static str,
    },
    /// The algorithm belongs to the other order.
    Order {
        /// The algorithm.
        algorithm: &'static str,
        /// Its order.
        needs: Order,
    },
    /// Weights that change while a point is still to be judged.
    Reweighted {
        /// The algorithm.
        algorithm: &'static str,
    },
    /// A number that makes no sense.
    Setting(String),
}

impl std::fmt::Display for BuildError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            BuildError::HardSet { term, algorithm } => write!(
                f,
                "{algorithm}: term {term} is a hard set and z is updated second in the x-z-u order, so that an accelerated z \
                 could leave it; take the z-x-u order, algorithm 4 or 2"
            ),
            BuildError::NoDualMap { term, algorithm, affine } => {
                let kind = if *affine { "an affine" } else { "a smooth" };
                write!(
                    f,
                    "{algorithm}: the dual of term {term} is not {kind} function of its local variable; take algorithm 1, which \
                     accelerates both, or algorithm 4 in the z-x-u order"
                )
            }
            BuildError::NoDual { term, algorithm } => write!(
                f,
                "{algorithm}: the splitting of term {term} has no dual; split it off with one, or take algorithm 2"
            ),
            BuildError::Dual { term, algorithm } => write!(
                f,
                "{algorithm}: the splitting of term {term} has a dual, which positions do not determine; take algorithm 2"
            ),
            BuildError::NoInertia { node } => write!(
                f,
                "algorithm 4: node {node} has no inertia, so that x does not follow from u; take algorithm 2, which \
                 accelerates both"
            ),
            BuildError::Inexact { algorithm } => write!(
                f,
                "{algorithm} needs a global step that ends at its minimum: linear couplings, no potentials, the direct solver; \
                 take algorithm 1"
            ),
            BuildError::Order { algorithm, needs } => {
                write!(f, "{algorithm} is one of the {} order; build the iteration in that order", needs.as_str())
            }
            BuildError::Reweighted { algorithm } => write!(
                f,
                "{algorithm} judges a point when weights may have changed already; take static weights, or algorithm 1"
            ),
            BuildError::Setting(text) => f.write_str(text),
        }
    }
}

impl std::error::Error for BuildError {}

impl From<BuildError> for SystemError {
    fn from(e: BuildError) -> Self {
        SystemError::Stalled(e.to_string())
    }
}
