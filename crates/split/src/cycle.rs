//! The order of an iteration's steps, and over-relaxation.

/// Which of the primal variables is updated second. In both orders a cycle here is entered at z, so that its two halves
/// are a local step over all elements and a global step: the x-z-u iteration is run as z-u, x, the z-x-u iteration as z, x-u.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// x, then z, then u: A(5).
    #[default]
    Xzu,
    /// z, then x, then u: A(6).
    Zxu,
}

impl Order {
    /// As in reports: `x-z-u`, `z-x-u`.
    pub fn as_str(self) -> &'static str {
        match self {
            Order::Xzu => "x-z-u",
            Order::Zxu => "z-x-u",
        }
    }
}

/// How a cycle is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// The order of the steps.
    pub order: Order,
    /// alpha: c(Dx) is replaced by alpha c(Dx) + (1 - alpha) z in the updates of z and u (Eckstein and Bertsekas 1992; Boyd
    /// et al. 2011, section 3.4.3). 1 changes nothing; 1.5 to 1.8 are usual.
    pub relaxation: f64,
}

impl Cycle {
    /// The x-z-u iteration as it is.
    pub const PLAIN: Cycle = Cycle { order: Order::Xzu, relaxation: 1.0 };

    /// Whether nothing is replaced.
    pub fn is_plain(&self) -> bool {
        self.order == Order::Xzu && self.relaxation == 1.0
    }
}

impl Default for Cycle {
    fn default() -> Self {
        Cycle::PLAIN
    }
}
