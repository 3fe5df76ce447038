//! Settings of `wavefront`, with their defaults.

use serde::{Deserialize, Serialize};

/// How each linearised problem A(32) is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WavefrontMethod {
    /// What was measured to be the fastest (docs/wavefront.md): `relaxed`.
    #[default]
    Auto,
    /// Plain ADMM.
    Admm,
    /// ADMM with over-relaxation.
    Relaxed,
    /// A, Algorithm 1: Anderson on z and u.
    Aa,
    /// Anderson on z alone, by whose coefficients u and phi are mixed too: A, appendix E.1.
    AaZ,
    /// Fast ADMM with restart (Goldstein et al. 2014).
    Fast,
    /// ADMM accelerated by GMRES (Zhang and White 2018).
    Gmres,
    /// Conjugate gradients, preconditioned by cosine transforms.
    Pcg,
}

impl WavefrontMethod {
    /// All of them.
    pub const ALL: [WavefrontMethod; 8] = [
        WavefrontMethod::Auto,
        WavefrontMethod::Admm,
        WavefrontMethod::Relaxed,
        WavefrontMethod::Aa,
        WavefrontMethod::AaZ,
        WavefrontMethod::Fast,
        WavefrontMethod::Gmres,
        WavefrontMethod::Pcg,
    ];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            WavefrontMethod::Auto => "auto",
            WavefrontMethod::Admm => "admm",
            WavefrontMethod::Relaxed => "relaxed",
            WavefrontMethod::Aa => "aa",
            WavefrontMethod::AaZ => "aa-z",
            WavefrontMethod::Fast => "fast",
            WavefrontMethod::Gmres => "gmres",
            WavefrontMethod::Pcg => "pcg",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// All settings of `wavefront`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WavefrontSettings {
    /// The method.
    pub method: WavefrontMethod,
    /// beta of A(32), how smooth the wavefront is to be, for images with values from 0 to 255.
    pub beta: f64,
    /// Penalty of the splitting.
    pub mu: f64,
    /// L: so many pixels more than the image on each side.
    pub margin: usize,
    /// No side of the coarsest level of the pyramid is shorter, in pixels.
    pub coarsest: usize,
    /// Warps of each level.
    pub warps: usize,
    /// Whether the structure of the images is taken out before (Rudin, Osher, Fatemi).
    pub texture: bool,
    /// Whether a 3 x 3 median of phi ends each warp.
    pub median: bool,
    /// What the result is multiplied by: from square pixels to the units of the sensor.
    pub scale: f64,
    /// Columns of Anderson's history.
    pub anderson: usize,
    /// Over-relaxation of `relaxed`.
    pub relaxation: f64,
    /// Iterations of a cycle of `gmres`.
    pub restart: usize,
    /// Tolerance of the residuals A(27) of each linearised problem.
    pub tol: f64,
    /// Iterations of each linearised problem.
    pub max_iters: usize,
    /// Seconds.
    pub time_limit: Option<f64>,
    /// Threads; all processors if none.
    pub threads: Option<usize>,
}

impl Default for WavefrontSettings {
    fn default() -> Self {
        WavefrontSettings {
            method: WavefrontMethod::default(),
            beta: 30.0,
            mu: 100.0,
            margin: 16,
            coarsest: 64,
            warps: 3,
            texture: true,
            median: true,
            scale: 1.0,
            anderson: 6,
            relaxation: 1.8,
            restart: 10,
            tol: 1e-2,
            max_iters: 500,
            time_limit: None,
            threads: None,
        }
    }
}

/// The widest margin: beyond it there is nothing to see.
const MOST_MARGIN: usize = 1024;

impl WavefrontSettings {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    /// The first that does not, by its option.
    pub fn check(&self) -> Result<(), String> {
        let positive = |name: &str, v: f64| {
            if v > 0.0 && v.is_finite() { Ok(()) } else { Err(format!("{name} is {v}; it must be positive")) }
        };
        positive("--beta", self.beta)?;
        positive("--mu", self.mu)?;
        positive("--tol", self.tol)?;
        if !(self.relaxation > 0.0 && self.relaxation < 2.0) {
            return Err(format!("--relaxation is {}; it must be between 0 and 2", self.relaxation));
        }
        if !(self.scale != 0.0 && self.scale.is_finite()) {
            return Err(format!("--scale is {}; it must be a number other than 0", self.scale));
        }
        if self.margin > MOST_MARGIN {
            return Err(format!("--margin is {}; it can be at most {MOST_MARGIN}", self.margin));
        }
        for (name, v) in [("--warps", self.warps), ("--restart", self.restart), ("--max-iters", self.max_iters)] {
            if v == 0 {
                return Err(format!("{name} is 0; give at least 1"));
            }
        }
        if self.threads == Some(0) {
            return Err("--threads is 0; give at least 1".to_string());
        }
        match self.time_limit {
            Some(t) if !(t > 0.0 && t.is_finite()) => Err(format!("--time-limit is {t}; it must be positive")),
            _ => Ok(()),
        }
    }
}
