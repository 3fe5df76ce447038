//! Moduli of isotropic linear elasticity.

use std::fmt;

/// The Lame parameters of a material, checked: finite, mu > 0 and a positive bulk modulus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    mu: f64,
    lambda: f64,
}

/// Why moduli describe no stable material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MaterialError {
    /// Young's modulus is not a positive number.
    Young(f64),
    /// Poisson's ratio does not lie in (-1, 1/2).
    Poisson(f64),
    /// The shear modulus mu is not a positive number.
    Mu(f64),
    /// lambda is not a number above -2/3 mu, where the bulk modulus vanishes.
    Lambda {
        /// The first Lame parameter given.
        lambda: f64,
        /// The shear modulus given.
        mu: f64,
    },
    /// The moduli overflow: the first Lame parameter of these two is not finite.
    Overflow {
        /// Young's modulus given.
        young: f64,
        /// Poisson's ratio given.
        poisson: f64,
    },
}

impl fmt::Display for MaterialError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MaterialError::Young(e) => write!(f, "Young's modulus must be a positive number, not {e}"),
            MaterialError::Poisson(nu) => write!(
                f,
                "Poisson's ratio must lie between -1 and 0.5, both excluded, not {nu}; nearly incompressible materials \
                 have 0.49 to 0.4999"
            ),
            MaterialError::Mu(mu) => write!(f, "the shear modulus mu must be a positive number, not {mu}"),
            MaterialError::Lambda { lambda, mu } => {
                write!(f, "lambda must be a finite number above -2/3 mu = {}, not {lambda}", -2.0 / 3.0 * mu)
            }
            MaterialError::Overflow { young, poisson } => {
                write!(f, "Young's modulus {young} with Poisson's ratio {poisson} exceeds the range of numbers")
            }
        }
    }
}

impl std::error::Error for MaterialError {}

impl Lame {
    /// From lambda and the shear modulus mu.
    ///
    /// # Errors
    /// [`MaterialError::Mu`] unless mu is finite and positive, [`MaterialError::Lambda`] unless lambda is finite and
    /// the bulk modulus lambda + 2/3 mu positive.
    pub fn new(mu: f64, lambda: f64) -> Result<Lame, MaterialError> {
        if !(mu.is_finite() && mu > 0.0) {
            return Err(MaterialError::Mu(mu));
        }
        if !(lambda.is_finite() && lambda + 2.0 / 3.0 * mu > 0.0) {
            return Err(MaterialError::Lambda { lambda, mu });
        }
        Ok(Lame { mu, lambda })
    }

    /// mu = E / (2 (1 + nu)), lambda = E nu / ((1 + nu) (1 - 2 nu)) from Young's modulus E and Poisson's ratio nu.
    ///
    /// # Errors
    /// [`MaterialError::Young`] unless E is finite and positive, [`MaterialError::Poisson`] unless -1 < nu < 1/2,
    /// [`MaterialError::Overflow`] where these formulas leave the range of numbers.
    pub fn from_young_poisson(young: f64, poisson: f64) -> Result<Lame, MaterialError> {
        if !(young.is_finite() && young > 0.0) {
            return Err(MaterialError::Young(young));
        }
        if !(poisson > -1.0 && poisson < 0.5) {
            return Err(MaterialError::Poisson(poisson));
        }
        let mu = young / (2.0 * (1.0 + poisson));
        let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
        Lame::new(mu, lambda).map_err(|_| MaterialError::Overflow { young, poisson })
    }

    /// The shear modulus.
    pub fn mu(&self) -> f64 {
        self.mu
    }

    /// The first Lame parameter.
    pub fn lambda(&self) -> f64 {
        self.lambda
    }

    /// The bulk modulus lambda + 2/3 mu.
    pub fn bulk(&self) -> f64 {
        self.lambda + 2.0 / 3.0 * self.mu
    }

    /// Young's modulus E = mu (3 lambda + 2 mu) / (lambda + mu).
    pub fn young(&self) -> f64 {
        self.mu * (3.0 * self.lambda + 2.0 * self.mu) / (self.lambda + self.mu)
    }

    /// Poisson's ratio nu = lambda / (2 (lambda + mu)).
    pub fn poisson(&self) -> f64 {
        self.lambda / (2.0 * (self.lambda + self.mu))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn young_and_poisson_come_back() {
        for nu in [-0.9, -0.3, 0.0, 0.3, 0.45, 0.499_9] {
            let m = Lame::from_young_poisson(1e7, nu).unwrap();
            assert!((m.young() / 1e7 - 1.0).abs() < 1e-12 && (m.poisson() - nu).abs() < 1e-12, "{nu} {m:?}");
        }
        let rubber = Lame::from_young_poisson(1e7, 0.45).unwrap();
        assert!((rubber.mu() - 3_448_275.862).abs() < 1e-3 && (rubber.lambda() - 31_034_482.76).abs() < 1e-2);
        assert!((rubber.bulk() - 1e7 / (3.0 * 0.1)).abs() < 1e-6);
    }

    #[test]
    fn impossible_moduli_are_told_apart() {
        for e in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(Lame::from_young_poisson(e, 0.3), Err(MaterialError::Young(_))), "{e}");
        }
        for nu in [0.5, 0.7, -1.0, -2.0, f64::NAN] {
            assert!(matches!(Lame::from_young_poisson(1.0, nu), Err(MaterialError::Poisson(_))), "{nu}");
        }
        assert!(matches!(Lame::from_young_poisson(1e308, 0.499_999), Err(MaterialError::Overflow { .. })));
        assert!(matches!(Lame::new(0.0, 1.0), Err(MaterialError::Mu(_))));
        assert!(matches!(Lame::new(3.0, -2.0), Err(MaterialError::Lambda { .. })));
        assert!(matches!(Lame::new(1.0, f64::INFINITY), Err(MaterialError::Lambda { .. })));
        assert!(Lame::new(1.0, 0.0).is_ok());
        let text = Lame::from_young_poisson(1.0, 0.5).unwrap_err().to_string();
        assert!(text.contains("0.5") && text.contains("Poisson"), "{text}");
    }
}
