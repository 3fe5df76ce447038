//! Settings of `deblur`, `denoise` and `inpaint`, with their defaults.

use proxel_imaging::restore::MOST_SCALE;
use serde::{Deserialize, Serialize};

/// How the problem is iterated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestoreMethod {
    /// What was measured to be the fastest: `relaxed`.
    #[default]
    Auto,
    /// Plain ADMM.
    Admm,
    /// ADMM with over-relaxation.
    Relaxed,
    /// Fast ADMM with restart (Goldstein et al. 2014), on v as `aa`.
    Fast,
    /// Anderson on v = grad x + u, the variable of the Douglas-Rachford iteration.
    Aa,
    /// A, Algorithm 1: Anderson on z and u.
    AaZu,
}

impl RestoreMethod {
    /// All of them.
    pub const ALL: [RestoreMethod; 6] = [
        RestoreMethod::Auto,
        RestoreMethod::Admm,
        RestoreMethod::Relaxed,
        RestoreMethod::Fast,
        RestoreMethod::Aa,
        RestoreMethod::AaZu,
    ];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            RestoreMethod::Auto => "auto",
            RestoreMethod::Admm => "admm",
            RestoreMethod::Relaxed => "relaxed",
            RestoreMethod::Fast => "fast",
            RestoreMethod::Aa => "aa",
            RestoreMethod::AaZu => "aa-zu",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// What lies beyond the border of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoundaryName {
    /// `unknown`: what a camera gives.
    #[default]
    Auto,
    /// The image again, as for images that were blurred by a Fourier transform.
    Periodic,
    /// Its mirror image; for blurs that are symmetric in both directions.
    Neumann,
    /// Nobody knows: the field is larger than the image, and only what was seen is compared. Without a blur nothing beyond the
    /// border counts, and this is `neumann`.
    Unknown,
}

impl BoundaryName {
    /// All of them.
    pub const ALL: [BoundaryName; 4] =
        [BoundaryName::Auto, BoundaryName::Periodic, BoundaryName::Neumann, BoundaryName::Unknown];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            BoundaryName::Auto => "auto",
            BoundaryName::Periodic => "periodic",
            BoundaryName::Neumann => "neumann",
            BoundaryName::Unknown => "unknown",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// How what was seen is compared with what the result looks like through the blur.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DataName {
    /// Squares of differences: normal noise.
    #[default]
    Quadratic,
    /// The divergence of Kullback and Leibler: counted light.
    Poisson,
    /// Squares of small differences, absolute values of large ones: outliers.
    Huber,
}

impl DataName {
    /// All of them.
    pub const ALL: [DataName; 3] = [DataName::Quadratic, DataName::Poisson, DataName::Huber];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            DataName::Quadratic => "quadratic",
            DataName::Poisson => "poisson",
            DataName::Huber => "huber",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// What is asked of the image itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RegulariserName {
    /// `tv`, which is A(31); `frame` only where lambda is `auto` too, data are squares under a blur, and its estimated risk is
    /// less.
    #[default]
    Auto,
    /// Total variation: flat pieces.
    Tv,
    /// Second-order total generalised variation: pieces whose slope is constant.
    Tgv,
    /// A frame of local cosines: fine texture.
    Frame,
}

impl RegulariserName {
    /// All of them.
    pub const ALL: [RegulariserName; 4] =
        [RegulariserName::Auto, RegulariserName::Tv, RegulariserName::Tgv, RegulariserName::Frame];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            RegulariserName::Auto => "auto",
            RegulariserName::Tv => "tv",
            RegulariserName::Tgv => "tgv",
            RegulariserName::Frame => "frame",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// Which differences of a pixel count together in the total variation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VariationName {
    /// All, over all channels, so that colours have their edges at one place.
    #[default]
    Vectorial,
    /// Those of each channel.
    Channels,
    /// Each by itself: edges along rows and columns cost least.
    Anisotropic,
}

impl VariationName {
    /// All of them.
    pub const ALL: [VariationName; 3] = [VariationName::Vectorial, VariationName::Channels, VariationName::Anisotropic];

    /// As on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            VariationName::Vectorial => "vectorial",
            VariationName::Channels => "channels",
            VariationName::Anisotropic => "anisotropic",
        }
    }

    /// By that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.as_str() == name)
    }
}

/// All settings of `deblur`, `denoise` and `inpaint`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RestoreSettings {
    /// The method.
    pub method: RestoreMethod,
    /// What lies beyond the border.
    pub boundary: BoundaryName,
    /// How what was seen is compared.
    pub data: DataName,
    /// What `huber` takes for a small difference; 1.345 times the standard deviation of the noise if none.
    pub threshold: Option<f64>,
    /// The result has so many times the rows and columns of what was seen.
    pub scale: usize,
    /// Standard deviation of the noise, under `poisson` that of a pixel of value 1; estimated if none.
    pub noise: Option<f64>,
    /// lambda_1 of A(31), lambda_2 being 1; by an estimate of the risk if none.
    pub lambda: Option<f64>,
    /// What is asked of the image.
    pub regulariser: RegulariserName,
    /// What a change of slope costs in `tgv`, over a step: in pixels.
    pub tgv_ratio: f64,
    /// Which differences count together.
    pub variation: VariationName,
    /// Values that the image may have; any if none.
    pub range: Option<[f64; 2]>,
    /// Penalty of the splitting; by the contrast of the image if none.
    pub penalty: Option<f64>,
    /// Over-relaxation of `relaxed` and of `aa`.
    pub relaxation: f64,
    /// Columns of Anderson's history.
    pub anderson: usize,
    /// Images with more rows or columns than this are solved for in overlapping parts of so many at most; if none, those that
    /// would take more than 4 GiB, in parts that take that.
    pub tile: Option<usize>,
    /// Converged when the duality gap is below this part of the objective; with a range, when primal and dual residual are
    /// below it.
    pub tol: f64,
    /// Iterations, at most.
    pub max_iters: usize,
    /// Seconds, at most.
    pub time_limit: Option<f64>,
    /// Threads; all processors if none.
    pub threads: Option<usize>,
}

impl Default for RestoreSettings {
    fn default() -> Self {
        RestoreSettings {
            method: RestoreMethod::default(),
            boundary: BoundaryName::default(),
            data: DataName::default(),
            threshold: None,
            scale: 1,
            noise: None,
            lambda: None,
            regulariser: RegulariserName::default(),
            tgv_ratio: 2.0,
            variation: VariationName::default(),
            range: None,
            penalty: None,
            relaxation: 1.8,
            anderson: 6,
            tile: None,
            tol: 1e-4,
            max_iters: 5000,
            time_limit: None,
            threads: None,
        }
    }
}

impl RestoreSettings {
    /// # Errors
    /// The first number that makes no sense, and what would.
    pub fn check(&self) -> Result<(), String> {
        let numbers = [
            ("--lambda", self.lambda),
            ("--noise", self.noise),
            ("--penalty", self.penalty),
            ("--threshold", self.threshold),
        ];
        for (name, value) in numbers {
            if let Some(v) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                return Err(format!("{name} is {v}; give auto or a positive number"));
            }
        }
        if !(self.relaxation > 0.0 && self.relaxation < 2.0) {
            return Err(format!("--relaxation is {}; it must be between 0 and 2", self.relaxation));
        }
        if !(self.tol > 0.0 && self.tol < 1.0) {
            return Err(format!("--tol is {}; it must be between 0 and 1", self.tol));
        }
        if !(self.tgv_ratio > 0.0 && self.tgv_ratio.is_finite()) {
            return Err(format!("--tgv-ratio is {}; give a positive number", self.tgv_ratio));
        }
        if !(1..=MOST_SCALE).contains(&self.scale) {
            return Err(format!("--scale is {}; give 1 to {MOST_SCALE}", self.scale));
        }
        if self.threshold.is_some() && self.data != DataName::Huber {
            return Err("--threshold is for --data huber".to_string());
        }
        if self.tile == Some(0) {
            return Err("--tile is 0; give auto or the pixels of a part's side".to_string());
        }
        if let Some([low, high]) = self.range
            && !(low < high && low.is_finite())
        {
            return Err(format!("--range is {low},{high}; give a smaller number first"));
        }
        if let Some(limit) = self.time_limit.filter(|t| !(*t > 0.0 && t.is_finite())) {
            return Err(format!("--time-limit is {limit}; give a positive number of seconds"));
        }
        match self.threads {
            Some(0) => Err("--threads is 0; give at least 1".to_string()),
            _ => Ok(()),
        }
    }
}
