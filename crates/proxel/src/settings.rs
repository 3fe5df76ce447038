//! Settings of `deform`, with their defaults: the one place that the command line, the library and bindings take them from.

mod geodesic;
mod method;
mod newton;
mod penalty;
mod restore;
mod rivals;
mod unwrap;
mod wavefront;

pub use geodesic::{GeodesicMethod, GeodesicSettings, GradientForm};
pub use method::MethodName;
pub use newton::{NewtonSettings, ProjectionName};
pub use penalty::PenaltyName;
pub use restore::{BoundaryName, DataName, RegulariserName, RestoreMethod, RestoreSettings, VariationName};
pub use rivals::{AndersonWindows, QuasiNewton};
pub use unwrap::{MapSplitting, UnwrapMethod, UnwrapSettings};
pub use wavefront::{WavefrontMethod, WavefrontSettings};

use proxel_model::energy::{Lame, Limited, MaterialError};
use proxel_split::{Hardening, InnerStop, LbfgsSettings, Precision, Range, Reweighting};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where the paper and its authors' code differ: which of them to follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// As printed.
    Paper,
    /// As the authors' code does.
    Reference,
    /// What was measured to be the fastest (docs/schedules.md).
    #[default]
    Default,
}

/// What the weights are before they follow the stiffness, over the measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BaseWeight {
    /// The slope fit, or the geometric mean where the slope fit exceeds that by half, which it does for nearly incompressible materials.
    /// Where a splitting has static weights the rest Hessian, which is larger and safer; where weights are dynamic and
    /// the coupling is linear half the slope fit, since that is slow in rotations, which ask for soft weights.
    Auto,
    /// The largest eigenvalue of the Hessian at rest, W(21).
    RestHessian,
    /// The slope fit of Liu et al. 2017.
    Slope,
    /// The geometric mean of the largest and the smallest eigenvalue of the Hessian at rest (docs/weights.md).
    GeometricMean,
    /// The bulk modulus lambda + 2/3 mu, as the authors of A take it for every energy.
    BulkModulus,
}

/// What candidate weights are taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Candidate {
    /// The largest eigenvalue of the Hessian where the element is, W(20)-(22).
    Hessian,
    /// The base weight times the ratio of that eigenvalue to the one at rest, so that an element at rest keeps its base
    /// weight whatever that is; raised while the method does not settle.
    Relative,
}

/// In what frame the local variable of the rotation-aware methods is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LocalFrame {
    /// Eigenvalues: the local variable is always a possible stretch.
    Eigenvalues,
    /// Signed singular values, as the authors' code takes them.
    SingularValues,
}

/// Which step the stop of the inner iteration looks at, W(17).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InnerStopName {
    /// The step just taken.
    StepTaken,
    /// The step to be taken next.
    NextStep,
}

/// Digits of a factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PrecisionName {
    /// 64 bits.
    Double,
    /// 32 bits.
    Single,
}

/// Settings of the splitting methods.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdmmSettings {
    /// What the weights are at first.
    pub base_weight: BaseWeight,
    /// Factor of the squared weights, the paper's beta.
    pub weight_scale: f64,
    /// What they are multiplied by besides.
    #[serde(default)]
    pub penalty: PenaltyName,
    /// What candidate weights are taken from.
    pub candidate: Candidate,
    /// Frame of the local variable.
    pub local_frame: LocalFrame,
    /// First iteration that may reweight, k_rw.
    pub reweight_from: usize,
    /// gamma of W(23).
    pub reweight_trigger: f64,
    /// beta_min of W(22).
    pub weight_min: f64,
    /// beta_max of W(22).
    pub weight_max: f64,
    /// Pairs that L-BFGS keeps.
    pub window: usize,
    /// kappa of W(17).
    pub kappa: f64,
    /// Most inner steps of a global step.
    pub max_inner: usize,
    /// Which step W(17) looks at.
    pub inner_stop: InnerStopName,
    /// Precision of the factor that preconditions inner steps; linear couplings need it double.
    pub precision: PrecisionName,
    /// Whether inner steps are shortened until they descend.
    pub line_search: bool,
}

impl AdmmSettings {
    /// The settings of a schedule.
    pub fn of(schedule: Schedule) -> Self {
        let paper = AdmmSettings {
            base_weight: BaseWeight::RestHessian,
            weight_scale: 1.0,
            penalty: PenaltyName::Weights,
            candidate: Candidate::Hessian,
            local_frame: LocalFrame::Eigenvalues,
            reweight_from: 50,
            reweight_trigger: 1.5,
            weight_min: 0.1,
            weight_max: 10.0,
            window: 6,
            kappa: 1.0,
            max_inner: 100,
            inner_stop: InnerStopName::NextStep,
            precision: PrecisionName::Double,
            line_search: false,
        };
        match schedule {
            Schedule::Paper => paper,
            Schedule::Reference => AdmmSettings {
                base_weight: BaseWeight::Slope,
                local_frame: LocalFrame::SingularValues,
                // Candidates from the 50th local step on, counted from 1.
                reweight_from: 49,
                inner_stop: InnerStopName::StepTaken,
                ..paper
            },
            Schedule::Default => AdmmSettings {
                base_weight: BaseWeight::Auto,
                candidate: Candidate::Relative,
                inner_stop: InnerStopName::StepTaken,
                precision: PrecisionName::Single,
                line_search: true,
                ..paper
            },
        }
    }

    /// For the global step.
    pub fn lbfgs(&self) -> LbfgsSettings {
        LbfgsSettings {
            window: self.window,
            kappa: self.kappa,
            max_inner: self.max_inner,
            stop: match self.inner_stop {
                InnerStopName::StepTaken => InnerStop::StepTaken,
                InnerStopName::NextStep => InnerStop::NextStep,
            },
            precision: match self.precision {
                PrecisionName::Double => Precision::Double,
                PrecisionName::Single => Precision::Single,
            },
            line_search: self.line_search,
        }
    }

    /// For the weights, with a coupling that is rotation-aware or linear.
    pub fn reweighting(&self, rotation_aware: bool) -> Reweighting {
        Reweighting {
            range: Range::Late { from: self.reweight_from, min: self.weight_min, max: self.weight_max },
            trigger: self.reweight_trigger,
            hardening: match (self.candidate, rotation_aware) {
                (Candidate::Hessian, _) => None,
                (Candidate::Relative, true) => Some(Hardening::default()),
                (Candidate::Relative, false) => Some(Hardening::patient()),
            },
        }
    }
}

impl Default for AdmmSettings {
    fn default() -> Self {
        AdmmSettings::of(Schedule::Default)
    }
}

/// A material: an energy and its moduli. Young and Poisson unless mu and lambda are given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Material {
    /// Name of the energy: neo-hookean, stable-neo-hookean, stvk, corotated, fixed-corotated, arap, spring, ...
    pub energy: String,
    /// Young's modulus, in units of stress.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Shear modulus; with `lambda` in the place of Young and Poisson.
    pub mu: Option<f64>,
    /// First Lame parameter.
    pub lambda: Option<f64>,
    /// Mass over measure, in the place of [`DeformSettings::density`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
}

impl Default for Material {
    fn default() -> Self {
        Material { energy: "neo-hookean".to_string(), young: 1e7, poisson: 0.45, mu: None, lambda: None, density: None }
    }
}

impl Material {
    /// Its moduli.
    ///
    /// # Errors
    /// Moduli that describe no stable material.
    pub fn lame(&self) -> Result<Lame, MaterialError> {
        match (self.mu, self.lambda) {
            (Some(mu), Some(lambda)) => Lame::new(mu, lambda),
            (Some(mu), None) => Lame::new(mu, 0.0),
            (None, Some(lambda)) => Lame::new(Lame::from_young_poisson(self.young, self.poisson)?.mu(), lambda),
            (None, None) => Lame::from_young_poisson(self.young, self.poisson),
        }
    }

    /// Its P-wave modulus lambda + 2 mu, the stiffness against squeezing.
    ///
    /// # Errors
    /// As [`lame`](Self::lame).
    pub fn modulus(&self) -> Result<f64, MaterialError> {
        let lame = self.lame()?;
        Ok(lame.lambda() + 2.0 * lame.mu())
    }
}

/// What a mesh of faces without tetrahedra is taken for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceModel {
    /// The skin of a body where it is nearly closed, else a thin sheet.
    #[default]
    Auto,
    /// The skin of a body, carried by a lattice of tetrahedra.
    Embed,
    /// A thin sheet: its faces are the elements.
    Shell,
}

/// All settings of `deform`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeformSettings {
    /// The method.
    pub method: MethodName,
    /// What `admm` was filled from.
    pub schedule: Schedule,
    /// Settings of the splitting methods.
    pub admm: AdmmSettings,
    /// Settings of `lbfgs`.
    pub lbfgs: QuasiNewton,
    /// Settings of `bcqn`.
    pub bcqn: QuasiNewton,
    /// Windows of Anderson acceleration.
    pub anderson: AndersonWindows,
    /// Settings of the methods of Newton's kind.
    pub newton: NewtonSettings,
    /// The material where no region says otherwise.
    pub material: Material,
    /// Materials of regions.
    pub materials: BTreeMap<i32, Material>,
    /// Mass over measure of the elements of the highest dimension: over volume for tetrahedra, over area for triangles, over
    /// length for edges; with `gravity` it makes a load. Elements of lower dimension beside them weigh what their
    /// material says.
    pub density: f64,
    /// Acceleration.
    pub gravity: [f64; 3],
    /// Quadratic bending of triangles in space, K of [`proxel_model::bending::Bending`], in units of force times length: the
    /// flexural rigidity E h^3 / (12 (1 - nu^2)) of a plate of thickness h. 0: none.
    pub bending: f64,
    /// Hard limits [LO, HI] of the principal stretches of triangles in space and of tetrahedra.
    pub strain_limit: Option<[f64; 2]>,
    /// Whether triangles and edges live in the plane z = const. instead of in space.
    pub planar: bool,
    /// Whether every tetrahedron, triangle and edge of the mesh is elastic; otherwise only those of the highest dimension.
    pub mixed: bool,
    /// Swap two vertices of elements of negative volume (in the plane: area) instead of refusing them.
    pub fix_orientation: bool,
    /// What a surface is taken for.
    pub surface: SurfaceModel,
    /// Cells of the lattice around a surface, along the longest side of its bounding box.
    pub resolution: usize,
    /// Converged when |g| <= tol min(|g(X0)|, characteristic gradient); with hard limits, when primal and dual residual are
    /// at most this.
    pub tol: f64,
    /// Converged, too, when |g| is at most this part of the characteristic gradient of Zhu et al. 2018.
    pub patch_tol: Option<f64>,
    /// Most iterations.
    pub max_iters: usize,
    /// Most seconds.
    pub time_limit: Option<f64>,
    /// Threads; all processors where none is given.
    pub threads: Option<usize>,
}

impl Default for DeformSettings {
    fn default() -> Self {
        DeformSettings::of(Schedule::Default)
    }
}

impl DeformSettings {
    /// The defaults under a schedule.
    pub fn of(schedule: Schedule) -> Self {
        DeformSettings {
            method: MethodName::default(),
            schedule,
            admm: AdmmSettings::of(schedule),
            lbfgs: QuasiNewton::liu(),
            bcqn: QuasiNewton::zhu(),
            anderson: AndersonWindows::default(),
            newton: NewtonSettings::default(),
            material: Material::default(),
            materials: BTreeMap::new(),
            density: 0.0,
            gravity: [0.0; 3],
            bending: 0.0,
            strain_limit: None,
            planar: false,
            mixed: false,
            fix_orientation: false,
            surface: SurfaceModel::default(),
            resolution: 24,
            tol: 1e-9,
            patch_tol: None,
            max_iters: 5000,
            time_limit: None,
            threads: None,
        }
    }

    /// Whether anything has weight.
    pub fn weighs(&self) -> bool {
        let dense = |m: &Material| m.density.unwrap_or(0.0) > 0.0;
        self.gravity != [0.0; 3] && (self.density > 0.0 || dense(&self.material) || self.materials.values().any(dense))
    }

    /// Checks numbers that would make no sense.
    ///
    /// # Errors
    /// A sentence that names the setting and what it can be.
    pub fn check(&self) -> Result<(), String> {
        let a = &self.admm;
        let positive = |name: &str, v: f64| match v > 0.0 && v.is_finite() {
            true => Ok(()),
            false => Err(format!("{name} is {v}; it must be a positive number")),
        };
        positive("tol", self.tol)?;
        if let Some(tol) = self.patch_tol {
            positive("patch_tol (--patch-tol)", tol)?;
        }
        self.lbfgs.check("lbfgs")?;
        self.bcqn.check("bcqn")?;
        positive("weight_scale (--weight-scale)", a.weight_scale)?;
        a.penalty.check(self.method)?;
        positive("kappa", a.kappa)?;
        positive("weight_min", a.weight_min)?;
        if a.weight_max < a.weight_min || !a.weight_max.is_finite() {
            return Err(format!("weight_max is {}; it must be at least weight_min = {}", a.weight_max, a.weight_min));
        }
        if a.reweight_trigger < 1.0 || a.reweight_trigger.is_nan() {
            return Err(format!("reweight_trigger is {}; it must be at least 1", a.reweight_trigger));
        }
        if a.max_inner == 0 {
            return Err("max_inner is 0; a global step needs at least one inner step".to_string());
        }
        let n = &self.newton;
        positive("newton.gain", n.gain)?;
        positive("newton.memory", n.memory)?;
        if n.window == 0 || n.max_inner == 0 {
            return Err("newton.window or newton.max_inner is 0; both must be at least 1".to_string());
        }
        if self.density < 0.0 || !self.density.is_finite() {
            return Err(format!("density is {}; it must not be negative", self.density));
        }
        if let Some(g) = self.gravity.iter().find(|g| !g.is_finite()) {
            return Err(format!("gravity has a component {g}; it must be finite"));
        }
        if self.bending < 0.0 || !self.bending.is_finite() {
            return Err(format!("bending is {} (--bending); it must not be negative", self.bending));
        }
        if let Some([low, high]) = self.strain_limit {
            Limited::new((), low, high).map_err(|e| format!("{e} (--strain-limit)"))?;
        }
        if self.planar && self.bending > 0.0 {
            return Err("what is planar does not bend; leave --bending or --planar out".to_string());
        }
        if !(1..=proxel_mesh::embed::MOST_RESOLUTION).contains(&self.resolution) {
            let most = proxel_mesh::embed::MOST_RESOLUTION;
            return Err(format!("resolution is {}; give a number of cells from 1 to {most}", self.resolution));
        }
        if let Some(t) = self.time_limit.filter(|t| *t < 0.0 || t.is_nan()) {
            return Err(format!("time_limit is {t}; it must be a number of seconds"));
        }
        if self.threads == Some(0) {
            return Err("threads is 0; give at least 1, or leave it out for all processors".to_string());
        }
        Ok(())
    }
}
