//! Restoration: images of which a blurred, noisy or incomplete one is known.
//!
//! ```text
//! min over x   lambda |M (K x - f)|^2 + sum over pixels |grad x|_2        A(31), with lambda = lambda_1 and lambda_2 = 1
//! ```
//!
//! K is the convolution with a point spread function, M leaves out what was not measured; other functions of K x - f may take
//! the place of the square ([`Data`]). [`Model`] says what is known, [`Restoration`] is the problem and the global step made
//! of it.

mod balance;
mod certificate;
mod dual_point;
mod field;
mod model;
mod noise;
mod risk;

pub use certificate::{Certifier, Gap, duality_gap};
pub use field::Field;
pub use model::{MOST_SCALE, Model, natural_penalty};
pub use noise::{count_level, noise_level, psnr};
pub use risk::{Risk, RiskSettings, choose_lambda, estimate_risk};

use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Extrapolation, GlobalStep, History, Method, Problem,
    SystemError,
};

/// What lies beyond the border of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Edges {
    /// Nobody knows: the field is larger than the image by what the blur reaches, and only what was seen is compared.
    #[default]
    Unknown,
    /// The image again.
    Periodic,
    /// Its mirror image; for blurs that are symmetric in both directions. Without a blur nothing beyond the border counts, and
    /// this says so.
    Neumann,
}

/// How what was seen is compared with K x.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Data {
    /// (K x - f)^2: normal noise.
    #[default]
    Squares,
    /// K x - f log(K x): counted light, K x >= 0. See [`crate::Poisson`].
    Poisson,
    /// Squares of small differences, absolute values of large ones: outliers. See [`crate::Huber`].
    Huber {
        /// What is small.
        delta: f64,
    },
}

/// What is asked of the image itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Regulariser {
    /// Total variation: sum |grad x|.
    #[default]
    Tv,
    /// Second-order total generalised variation (Bredies, Kunisch and Pock 2010):
    ///
    /// ```text
    /// min over w   sum |grad x - w| + ratio |E w|
    /// ```
    ///
    /// E the symmetrised derivative: slopes cost nothing where they do not change, so that ramps are no stairs.
    Tgv {
        /// In pixels.
        ratio: f64,
    },
    /// A frame of local cosines, [`crate::LocalCosines`]:
    ///
    /// ```text
    /// sum over pixels and (k, l) other than (0, 0)   |W_kl x| / sqrt(k^2 + l^2)
    /// ```
    ///
    /// Few of them are large where there is fine texture, which total variation makes flat.
    Frame,
}

/// How the data term is split.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// What costs the fewest transforms: held where it can be.
    #[default]
    Auto,
    /// The global step holds it: one transform there and one back an iteration.
    Held,
    /// It is a term of the blurred field: two there and two back. The only one for masks, unknown borders, samples
    /// and data that are no squares.
    Split,
}

/// How it is iterated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Iteration {
    /// ADMM with a relaxation; 1 is plain.
    Admm {
        /// alpha
        relaxation: f64,
    },
    /// Fast ADMM with restart (Goldstein et al. 2014, Algorithm 8): momentum, eta = 0.999.
    Fast {
        /// Whether it is that of (z, u), as published, and not that of v = grad x + u.
        both: bool,
    },
    /// Anderson with so many columns on v = grad x + u, the Douglas-Rachford variable.
    Anderson {
        /// m
        window: usize,
        /// Whether (z, u) is accelerated instead, A, Algorithm 1.
        both: bool,
        /// alpha
        relaxation: f64,
    },
}

/// A problem and the step that solves for x.
pub struct Restoration {
    problem: Problem,
    step: Box<dyn GlobalStep>, // by the transform that the border asks for
    /// What certificates need.
    pub field: Field,
}

impl Restoration {
    /// The problem put under an iteration.
    ///
    /// # Errors
    /// Settings that the splitting refuses.
    pub fn method(self, name: &str, iteration: Iteration) -> Result<Box<dyn Method>, SystemError> {
        let settings = AdmmSettings { name: name.to_string(), global: self.step, reweighting: None, renewed_at: None };
        let admm = Admm::new(self.problem, settings)?;
        let relaxed = |admm: Admm, relaxation: f64| admm.with_cycle(Cycle { relaxation, ..Cycle::PLAIN });
        Ok(match iteration {
            Iteration::Admm { relaxation } => Box::new(relaxed(admm, relaxation)?.with_folding()),
            Iteration::Fast { both } => {
                let algorithm = if both { Algorithm::One } else { Algorithm::DouglasRachford };
                let by = Extrapolation::Momentum { eta: Some(0.999), corrected: false };
                Acceleration { algorithm, by, history: History::AsPublished }.of(admm)?
            }
            Iteration::Anderson { window, both, relaxation } => {
                let algorithm = if both { Algorithm::One } else { Algorithm::DouglasRachford };
                Acceleration::anderson(algorithm, window).of(relaxed(admm, relaxation)?)?
            }
        })
    }
}
