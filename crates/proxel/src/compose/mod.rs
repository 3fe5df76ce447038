//! Problems put together by the user: points, what holds them, and parts that energies and sets are, the user's own
//! too.
//!
//! ```text
//! min over x   sum of energies + sum_soft w/2 dist(D x, C)^2 + f(x)
//! subject to   D x in C for hard sets, x = t at pins
//! ```
//!
//! A [`Composition`] is the description, [`solve`] its solution. Units are those of the user throughout.

mod build;
mod run;

pub use proxel_model::constraint::Projection;
pub use run::solve;

use crate::deform::OwnEnergy;
use crate::report::Report;
use crate::settings::{Material, QuasiNewton};
use proxel_mesh::{Mesh, Polygons};
use proxel_split::Status;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is to be solved.
#[derive(Clone, Debug, Default)]
pub struct Composition {
    /// Where points begin.
    pub start: Vec<[f64; 3]>,
    /// Points that are held, and where.
    pub fixed: Vec<(u32, [f64; 3])>,
    /// Soft springs: point, target t, stiffness k of k/2 |x - t|^2.
    pub springs: Vec<(u32, [f64; 3], f64)>,
    /// Forces b on points, of -b . x.
    pub loads: Vec<(u32, [f64; 3])>,
    /// Fairing of polygons: w/2 |L (x - x~)|^2, x~ being the start, of
    /// [`laplacian`](proxel_model::constraint::fairing::laplacian).
    pub fairing: Vec<(Polygons, f64)>,
    /// Energies and sets.
    pub parts: Vec<Part>,
}

/// Elements of like kind.
#[derive(Clone, Debug)]
pub enum Part {
    /// Elastic tetrahedra, triangles or edges of a material.
    Elastic {
        /// Rest positions, as many as there are points.
        rest: Vec<[f64; 3]>,
        /// Corners, flat.
        elements: Vec<u32>,
        /// Corners an element: 4, 3 or 2.
        corners: usize,
        /// The material.
        material: Material,
    },
    /// Tetrahedra of an energy of one's own; what the material is like at rest preconditions it.
    Own {
        /// Rest positions, as many as there are points.
        rest: Vec<[f64; 3]>,
        /// Corners.
        tets: Vec<[u32; 4]>,
        /// The energy.
        energy: OwnEnergy,
        /// What it is like.
        like: Material,
    },
    /// Elements in, or near to, sets of one's own.
    Sets {
        /// Corners, flat.
        elements: Vec<u32>,
        /// Corners an element.
        corners: usize,
        /// Whether sets see corners from their mean (and so wherever the element is), or as they are.
        centred: bool,
        /// The sets.
        sets: OwnSets,
        /// Whether they hold, or count by w/2 dist^2.
        hard: bool,
        /// w of a soft set; mu = w^2 of the splitting of a hard one, which steers the iteration and not its end.
        weight: f64,
    },
    /// Points near to a surface, by w/2 dist^2.
    Near {
        /// The points.
        points: Vec<u32>,
        /// The surface.
        surface: Mesh,
        /// w
        weight: f64,
    },
}

/// A [`Projection`] that compositions share.
#[derive(Clone)]
pub struct OwnSets(pub Arc<dyn Projection>);

impl std::fmt::Debug for OwnSets {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("OwnSets")
    }
}

/// A method for a [`Composition`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ComposeMethod {
    /// `aa-admm` where there are sets, `lbfgs` where there is an energy of one's own, `newton` for elastic elements
    /// alone.
    #[default]
    Auto,
    /// Algorithm 2 of Zhang et al. 2019, Anderson acceleration.
    AaAdmm,
    /// The z-x-u iteration as it is.
    Admm,
    /// L-BFGS over the normal matrix: everything but hard sets.
    Lbfgs,
    /// Newton's method: elastic elements, springs, loads and fairing.
    Newton,
}

impl ComposeMethod {
    /// All of them.
    pub const ALL: [ComposeMethod; 5] =
        [ComposeMethod::Auto, ComposeMethod::AaAdmm, ComposeMethod::Admm, ComposeMethod::Lbfgs, ComposeMethod::Newton];

    /// Its name in settings.
    pub fn as_str(self) -> &'static str {
        match self {
            ComposeMethod::Auto => "auto",
            ComposeMethod::AaAdmm => "aa-admm",
            ComposeMethod::Admm => "admm",
            ComposeMethod::Lbfgs => "lbfgs",
            ComposeMethod::Newton => "newton",
        }
    }
}

/// How a [`Composition`] is solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ComposeSettings {
    /// The method.
    pub method: ComposeMethod,
    /// Columns of Anderson acceleration.
    pub anderson: usize,
    /// Settings of `lbfgs`.
    pub lbfgs: QuasiNewton,
    /// Tolerance: of primal and dual residuals, A(27), where there is a dual; of the gradient elsewhere, over that of
    /// the start.
    pub tol: f64,
    /// Most iterations.
    pub max_iters: usize,
    /// Seconds after which a run stops.
    pub time_limit: Option<f64>,
    /// Threads; all processors without it.
    pub threads: Option<usize>,
}

impl Default for ComposeSettings {
    fn default() -> Self {
        ComposeSettings {
            method: ComposeMethod::Auto,
            anderson: 6,
            lbfgs: QuasiNewton::liu(),
            tol: 1e-9,
            max_iters: 5000,
            time_limit: None,
            threads: None,
        }
    }
}

impl ComposeSettings {
    /// Checks numbers that would make no sense.
    ///
    /// # Errors
    /// Names the setting, its value and what to give.
    pub fn check(&self) -> Result<(), String> {
        if !(self.tol > 0.0 && self.tol.is_finite()) {
            return Err(format!("tol is {}; give a positive number", self.tol));
        }
        if let Some(limit) = self.time_limit.filter(|t| !(*t > 0.0 && t.is_finite())) {
            return Err(format!("time_limit is {limit}; give a positive number of seconds"));
        }
        match self.threads {
            Some(0) => Err("threads is 0; give at least 1".to_string()),
            _ => Ok(()),
        }
    }
}

/// Why a composition cannot be solved: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ComposeError(pub String);

impl std::fmt::Display for ComposeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ComposeError {}

/// A solution.
#[derive(Clone, Debug)]
pub struct Composed {
    /// Points, those that are held bit for bit where they are held.
    pub positions: Vec<[f64; 3]>,
    /// How the run ended.
    pub status: Status,
    /// The largest distance of an element from its hard set, over the extent of the start; 0 without hard sets.
    pub violation: f64,
    /// All figures.
    pub report: Report,
}
