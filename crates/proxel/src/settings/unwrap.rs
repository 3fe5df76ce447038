//! Settings of `unwrap`.

use super::{NewtonSettings, QuasiNewton};
use proxel_split::{
    AutoSettings, InnerStop, LbfgsSettings, LinearSolver, Precision, Projection, ProjectionRule, Range, Reweighting,
};
use serde::{Deserialize, Serialize};

/// A method of `unwrap`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum UnwrapMethod {
    /// WRAPD until no triangle is flipped, then Newton.
    #[default]
    #[serde(rename = "auto")]
    Auto,
    /// Rotation-aware, dynamic weights: Brown and Narain 2021.
    #[serde(rename = "wrapd")]
    Wrapd,
    /// Rotation-aware, static weights.
    #[serde(rename = "r-admm")]
    RAdmm,
    /// Linear coupling, dynamic weights.
    #[serde(rename = "w-admm")]
    WAdmm,
    /// Linear coupling, static weights.
    #[serde(rename = "admm-pd")]
    AdmmPd,
    /// WRAPD until no triangle is flipped, then composite majorization: W, section 6.2.1.
    #[serde(rename = "wrapd+cm")]
    WrapdCm,
    /// Composite majorization: Shtengel et al. 2017.
    #[serde(rename = "cm")]
    Cm,
    /// Scalable locally injective mappings: Rabinovich et al. 2017.
    #[serde(rename = "slim")]
    Slim,
    /// Approximate Killing vector fields: Claici et al. 2017.
    #[serde(rename = "akvf")]
    Akvf,
    /// Blended cured quasi-Newton: Zhu, Bridson and Kaufman 2018.
    #[serde(rename = "bcqn")]
    Bcqn,
    /// Newton on a Hessian that is clamped everywhere.
    #[serde(rename = "projected-newton")]
    ProjectedNewton,
    /// Newton on the true Hessian, clamped on demand.
    #[serde(rename = "newton")]
    Newton,
}

impl UnwrapMethod {
    /// All of them.
    pub const ALL: [UnwrapMethod; 12] = [
        UnwrapMethod::Auto,
        UnwrapMethod::Wrapd,
        UnwrapMethod::RAdmm,
        UnwrapMethod::WAdmm,
        UnwrapMethod::AdmmPd,
        UnwrapMethod::WrapdCm,
        UnwrapMethod::Cm,
        UnwrapMethod::Slim,
        UnwrapMethod::Akvf,
        UnwrapMethod::Bcqn,
        UnwrapMethod::ProjectedNewton,
        UnwrapMethod::Newton,
    ];

    /// Its name on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            UnwrapMethod::Auto => "auto",
            UnwrapMethod::Wrapd => "wrapd",
            UnwrapMethod::RAdmm => "r-admm",
            UnwrapMethod::WAdmm => "w-admm",
            UnwrapMethod::AdmmPd => "admm-pd",
            UnwrapMethod::WrapdCm => "wrapd+cm",
            UnwrapMethod::Cm => "cm",
            UnwrapMethod::Slim => "slim",
            UnwrapMethod::Akvf => "akvf",
            UnwrapMethod::Bcqn => "bcqn",
            UnwrapMethod::ProjectedNewton => "projected-newton",
            UnwrapMethod::Newton => "newton",
        }
    }

    /// From its name on the command line.
    pub fn from_name(name: &str) -> Option<Self> {
        UnwrapMethod::ALL.into_iter().find(|m| m.as_str() == name)
    }

    /// Whether the local variable is the stretch of the polar decomposition.
    pub fn is_rotation_aware(self) -> bool {
        !matches!(self, UnwrapMethod::AdmmPd | UnwrapMethod::WAdmm)
    }

    /// Whether it can begin with flipped triangles: the methods that split.
    pub fn takes_flips(self) -> bool {
        use UnwrapMethod::{AdmmPd, Auto, RAdmm, WAdmm, Wrapd, WrapdCm};
        matches!(self, Auto | Wrapd | RAdmm | WAdmm | AdmmPd | WrapdCm)
    }

    /// Whether weights follow the stiffness.
    pub fn is_reweighted(self) -> bool {
        use UnwrapMethod::{Auto, WAdmm, Wrapd, WrapdCm};
        matches!(self, Auto | WAdmm | Wrapd | WrapdCm)
    }
}

/// Settings of the splitting methods for maps: W, section 6.2, and what its authors' code does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MapSplitting {
    /// Factor of the squared weights, which are the stiffness at rest.
    pub weight_scale: f64,
    /// gamma of W(23).
    pub reweight_trigger: f64,
    /// First iteration, counted from 0, that may change weights.
    pub reweight_from: usize,
    /// beta_max of W(24b) in that iteration.
    pub weight_max: f64,
    /// Its growth an iteration. Slightly above gamma, as in the authors' code: while the bound binds, weights change in every
    /// iteration.
    pub weight_growth: f64,
    /// Its cap.
    pub weight_cap: f64,
    /// Pairs that L-BFGS keeps.
    pub window: usize,
    /// kappa of W(17).
    pub kappa: f64,
    /// Most inner steps of a global step.
    pub max_inner: usize,
    /// Whether inner steps are shortened until they descend.
    pub line_search: bool,
    /// Whether the local variable is taken from signed singular values instead of eigenvalues, as in the authors' code.
    pub singular_values: bool,
    /// Before this iteration, counted from 0, duals are forgotten, as in the authors' code.
    pub renewed_at: Option<usize>,
}

impl Default for MapSplitting {
    fn default() -> Self {
        MapSplitting {
            weight_scale: 1.0,
            reweight_trigger: 1.5,
            reweight_from: 2,
            weight_max: 22.5,
            weight_growth: 1.500_000_1,
            weight_cap: 1e9,
            window: 6,
            kappa: 2.0,
            max_inner: 100,
            line_search: true,
            singular_values: true,
            renewed_at: Some(1),
        }
    }
}

impl MapSplitting {
    /// For the global step.
    pub fn lbfgs(&self) -> LbfgsSettings {
        LbfgsSettings {
            window: self.window,
            kappa: self.kappa,
            max_inner: self.max_inner,
            stop: InnerStop::StepTaken,
            precision: Precision::Double,
            line_search: self.line_search,
        }
    }

    /// For the weights.
    pub fn reweighting(&self) -> Reweighting {
        Reweighting {
            range: Range::Growing {
                from: self.reweight_from,
                first: self.weight_max,
                growth: self.weight_growth,
                cap: self.weight_cap,
            },
            trigger: self.reweight_trigger,
            hardening: None,
        }
    }
}

/// All settings of `unwrap`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct UnwrapSettings {
    /// The method.
    pub method: UnwrapMethod,
    /// The energy: symmetric-dirichlet, ...
    pub energy: String,
    /// Settings of the splitting methods.
    pub admm: MapSplitting,
    /// Settings of `bcqn`.
    pub bcqn: QuasiNewton,
    /// Settings of the methods of Newton's kind.
    pub newton: NewtonSettings,
    /// Iterations that may bring no fewer flipped triangles before `auto` and `wrapd+cm` turn to a relaxed energy.
    pub patience: usize,
    /// Iterations of the splitting after which `auto` and `wrapd+cm` give up hope that it will turn the last flipped triangle, and
    /// go on from the start where that has none.
    pub longest: usize,
    /// Longest step of `auto` and `newton`, in Newton steps, where one gains much more than the quadratic model foretold: near
    /// flips that model is far too careful.
    pub stride: f64,
    /// Part of the mean diagonal that is added to a Hessian where it is factored: the rotation of a map costs nothing.
    pub shift: f64,
    /// Weight of the proximal term of `slim` and `akvf`, for a chart of area 1.
    pub proximal: f64,
    /// The same of `cm` and `wrapd+cm`: it stands for a pinned vertex only. What the authors' code adds, about a hundred times
    /// as much, keeps flat charts from their minimum.
    pub proximal_cm: f64,
    /// Whether no two triangles of a chart may overlap.
    pub bijective: bool,
    /// Whether the outer border of each chart stays where it begins: on a circle, or where the given map has it.
    pub fixed_boundary: bool,
    /// Most stretch max(s1, 1 / s2) of a triangle, at the scale of least energy: charts with more are cut further.
    pub max_stretch: Option<f64>,
    /// Whether the charts are packed into the unit square.
    pub pack: bool,
    /// Least distance of packed charts, in pixels.
    pub padding: f64,
    /// Pixels along a side of the page.
    pub resolution: u32,
    /// Texels per unit of length on the surface, instead of as many as fit.
    pub density: Option<f64>,
    /// Converged when |g| <= tol min(|g(X0)|, characteristic gradient).
    pub tol: f64,
    /// Most iterations of a chart.
    pub max_iters: usize,
    /// Most seconds.
    pub time_limit: Option<f64>,
    /// Threads; all processors where none is given.
    pub threads: Option<usize>,
}

impl Default for UnwrapSettings {
    fn default() -> Self {
        UnwrapSettings {
            method: UnwrapMethod::default(),
            energy: "symmetric-dirichlet".to_string(),
            admm: MapSplitting::default(),
            bcqn: QuasiNewton { shrink: 0.8, ..QuasiNewton::zhu() },
            newton: NewtonSettings::default(),
            patience: 4,
            longest: 30,
            stride: 1024.0,
            shift: 1e-8,
            proximal: 1e-4,
            proximal_cm: 1e-7,
            bijective: false,
            fixed_boundary: false,
            max_stretch: None,
            pack: true,
            padding: 2.0,
            resolution: 1024,
            density: None,
            tol: 1e-9,
            max_iters: 5000,
            time_limit: None,
            threads: None,
        }
    }
}

impl UnwrapSettings {
    /// For the methods of Newton's kind, and what follows the splitting.
    pub fn newton(&self) -> proxel_split::NewtonSettings {
        let always = |p| ProjectionRule::Always(p);
        let on_demand = ProjectionRule::OnDemand { back_off: self.newton.back_off, blended: true };
        let (projection, proximal, warp) = match self.method {
            UnwrapMethod::Cm | UnwrapMethod::WrapdCm => (always(Projection::Clamp), self.proximal_cm, false),
            UnwrapMethod::ProjectedNewton => (always(Projection::Clamp), 0.0, false),
            UnwrapMethod::Slim => (always(Projection::Reweighted), self.proximal, false),
            UnwrapMethod::Akvf => (always(Projection::Killing), self.proximal, false),
            _ => (on_demand, 0.0, self.newton.warp),
        };
        proxel_split::NewtonSettings {
            name: self.method.as_str().to_string(),
            solver: LinearSolver::Factor,
            projection,
            warp,
            max_inner: self.newton.max_inner,
            memory: self.newton.memory,
            proximal,
            shift: self.shift,
            guarded: true,
            longest: if projection == on_demand { self.stride } else { 1.0 },
        }
    }

    /// For the methods that turn to Newton.
    pub fn auto(&self) -> AutoSettings {
        AutoSettings {
            newton: self.newton(),
            eager: true,
            patience: self.patience,
            gain: self.newton.gain,
            window: self.newton.window,
            longest: self.longest,
            retreat: self.newton.retreat,
        }
    }

    /// Checks numbers that would make no sense.
    ///
    /// # Errors
    /// A sentence that names the setting and what it can be.
    pub fn check(&self) -> Result<(), String> {
        let positive = |name: &str, v: f64| match v > 0.0 && v.is_finite() {
            true => Ok(()),
            false => Err(format!("{name} is {v}; it must be a positive number")),
        };
        positive("tol", self.tol)?;
        positive("admm.weight_scale", self.admm.weight_scale)?;
        positive("admm.kappa", self.admm.kappa)?;
        positive("admm.weight_max", self.admm.weight_max)?;
        positive("admm.weight_cap", self.admm.weight_cap)?;
        positive("newton.memory", self.newton.memory)?;
        self.bcqn.check("bcqn")?;
        for (name, v, least) in [
            ("admm.reweight_trigger", self.admm.reweight_trigger, 1.0),
            ("admm.weight_growth", self.admm.weight_growth, 1.0),
            ("shift", self.shift, 0.0),
            ("proximal", self.proximal, 0.0),
            ("proximal_cm", self.proximal_cm, 0.0),
            ("stride", self.stride, 1.0),
        ] {
            if !(v >= least && v.is_finite()) {
                return Err(format!("{name} is {v}; it must be at least {least}"));
            }
        }
        if let Some(bound) = self.max_stretch.filter(|b| !(*b > 1.0 && b.is_finite())) {
            return Err(format!("max_stretch (--max-stretch) is {bound}; it must be above 1, no stretch at all"));
        }
        if self.max_stretch.is_some() && self.fixed_boundary {
            return Err(
                "max_stretch is kept by cuts, which a fixed boundary does not let open; leave out --max-stretch or \
                        --fixed-boundary"
                    .to_string(),
            );
        }
        if let Some(density) = self.density {
            positive("density (--density)", density)?;
        }
        if !(self.padding >= 0.0 && self.padding.is_finite()) || self.resolution == 0 {
            return Err(format!(
                "padding is {} and resolution {}; pixels must not be negative, and the page needs some",
                self.padding, self.resolution
            ));
        }
        if let Some(t) = self.time_limit.filter(|t| *t < 0.0 || t.is_nan()) {
            return Err(format!("time_limit is {t}; it must be a number of seconds"));
        }
        if self.threads == Some(0) {
            return Err("threads is 0; give at least 1, or leave it out for all processors".to_string());
        }
        if self.admm.max_inner == 0 {
            return Err("admm.max_inner is 0; a global step needs at least one inner step".to_string());
        }
        Ok(())
    }
}
