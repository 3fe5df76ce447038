//! The arguments of `proxel deform`, and the settings that they make.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::model::energy::{MaterialError, names};
use proxel::settings::{
    BaseWeight, DeformSettings, Material, MethodName, PenaltyName, ProjectionName, Schedule, SurfaceModel,
};

use crate::args::{SolveArgs, pair, six, vector};
use crate::refusal::Refusal;

/// The arguments of `proxel deform`.
#[derive(Args)]
#[command(after_help = "\
Pins: a text file of 0-based vertex indices, any number a line, # starts a comment; they are held
where the start has them. Or groups, in a .toml or .json file:
  [groups.foot]
  box = { min = [-1, -1, -1], max = [1, -0.9, 1] }   # also indices, sphere, plane; combine = \"any\"
  [groups.hand]
  sphere = { center = [0, 2, 0], radius = 0.3 }
  rotate = { axis = [0, 0, 1], angle = 90 }          # also translate, scale, targets
  [groups.wind]
  indices = [7, 8]
  force = { total = [10, 0, 0] }                     # or each; stiffness = 1e4 makes soft springs
  [groups.lung]
  sphere = { center = [0, 1, 0], radius = 0.5 }
  pressure = 50                                      # on faces with all corners in the group
  [[equality]]                                       # sum of coefficients times positions = value
  vertices = [3, 4]
  coefficients = [1, -1]
  value = [0, 0.1, 0]
  [[obstacle]]                                       # as --obstacle
  point = [0, -1, 0]
  normal = [0, 1, 0]

Examples:
  proxel deform rest.node --init init.node --pins handles.txt --out posed.vtu
  proxel deform body.mesh --pins hands.toml --material stable-neo-hookean --poisson 0.49 \\
      --out posed.ply --preview posed.png --report report.json
  proxel deform bunny.obj --pins ears.toml --resolution 32 --out posed.glb --preview posed.png
  proxel deform body.mesh --pins hands.toml --keyframes wave.toml --out wave.glb
  proxel deform beam.msh --pins wall.toml --density 1000 --gravity 0,-9.81,0 --out sag.vtu
  proxel deform cloth.obj --pins corners.txt --material arap --young 100 --strain-limit 0.95,1.05 --bending 1e-5 \
      --density 0.2 --gravity 0,0,-9.81 --out draped.vtu")]
pub struct DeformArgs {
    /// The body at rest: tetrahedra, or a surface, or edges.
    #[arg(value_name = "REST", required_unless_present = "show_settings")]
    pub rest: Option<PathBuf>,
    /// Where vertices start, in the order of REST. Without it pinned vertices go to their targets
    /// and the others follow.
    #[arg(long, value_name = "FILE")]
    pub init: Option<PathBuf>,
    /// What holds the body: vertex indices, or groups (see below).
    #[arg(long, value_name = "FILE")]
    pub pins: Option<PathBuf>,
    /// Where the groups of pins are at given times, .toml or .json: writes an animation. --out is then an animated .glb or
    /// .gltf, a .pvd with a .vtu for each frame, or a numbered series of any other format.
    #[arg(long, value_name = "FILE", requires = "pins", conflicts_with_all = ["reference", "preview", "lattice_out"])]
    pub keyframes: Option<PathBuf>,
    /// Most seconds for a frame; --time-limit is for all of them.
    #[arg(long, value_name = "S", requires = "keyframes", allow_negative_numbers = true)]
    pub frame_time: Option<f64>,
    /// Positions to measure the position error against; they change nothing.
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// The problem in one file, written before it is solved: `proxel replay` solves it again.
    #[arg(long, value_name = "FILE.json", conflicts_with = "keyframes")]
    pub dump: Option<PathBuf>,
    #[command(flatten)]
    pub surface: SurfaceArgs,
    #[command(flatten)]
    pub solve: SolveArgs,
    #[command(flatten)]
    pub material: MaterialArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    /// Turn tetrahedra of negative volume instead of refusing them.
    #[arg(long)]
    pub fix_orientation: bool,
}

/// What a surface is taken for.
#[derive(Args)]
#[command(next_help_heading = "Surfaces (faces without tetrahedra)")]
pub struct SurfaceArgs {
    /// The surface is the skin of a body: a lattice of tetrahedra around it is deformed and carries it.
    /// The default where it is nearly closed; holes and self-intersections do no harm.
    #[arg(long, conflicts_with = "shell")]
    pub embed: bool,
    /// Cells of that lattice along the longest side of the surface; asks for --embed.
    #[arg(long, value_name = "N", conflicts_with = "shell",
          help = format!("Cells of that lattice along the longest side of the surface; asks for --embed [default: {}]",
                         DeformSettings::default().resolution))]
    pub resolution: Option<usize>,
    /// The surface is a thin sheet: its faces are elements.
    #[arg(long)]
    pub shell: bool,
    /// The deformed lattice with its fields; .vtu carries all of it.
    #[arg(long, value_name = "FILE", conflicts_with = "shell")]
    pub lattice_out: Option<PathBuf>,
}

/// What the body is made of.
#[derive(Args)]
#[command(next_help_heading = "Material and loads")]
pub struct MaterialArgs {
    /// The energy.
    #[arg(long, value_name = "NAME", value_parser = energies(), default_value = DeformSettings::default().material.energy)]
    pub material: String,
    /// Materials of regions: a .toml file such as `[3]` and below `energy = "arap"`, `young = 1e5`.
    #[arg(long, value_name = "FILE.toml")]
    pub materials: Option<PathBuf>,
    /// Young's modulus, force over area.
    #[arg(long, value_name = "E", allow_negative_numbers = true,
          default_value = format!("{:e}", DeformSettings::default().material.young))]
    pub young: f64,
    /// Poisson's ratio, between -1 and 0.5.
    #[arg(long, value_name = "NU", allow_negative_numbers = true,
          default_value_t = DeformSettings::default().material.poisson)]
    pub poisson: f64,
    /// Shear modulus, in the place of Young's modulus and Poisson's ratio.
    #[arg(long, value_name = "MU", allow_negative_numbers = true, conflicts_with_all = ["young", "poisson"])]
    pub mu: Option<f64>,
    /// First Lame parameter, beside --mu.
    #[arg(long, value_name = "LAMBDA", allow_negative_numbers = true, requires = "mu")]
    pub lambda: Option<f64>,
    /// Mass over volume of tetrahedra, over area of triangles, over length of edges; with --gravity the body has weight.
    #[arg(long, value_name = "RHO", allow_negative_numbers = true, default_value_t = DeformSettings::default().density)]
    pub density: f64,
    /// Acceleration, such as 0,-9.81,0.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = vector)]
    pub gravity: Option<[f64; 3]>,
    /// Pressure on all faces, force over area along the outward normal: positive ones inflate. Of the boundary of
    /// tetrahedra, or of triangles as they are oriented.
    #[arg(long, value_name = "P", allow_negative_numbers = true)]
    pub pressure: Option<f64>,
    /// A plane that all vertices stay on one side of, without friction: a point of it, and a normal that points to that
    /// side. May be given several times.
    #[arg(long, value_name = "PX,PY,PZ,NX,NY,NZ", allow_hyphen_values = true, value_parser = six)]
    pub obstacle: Vec<[f64; 6]>,
    /// Quadratic bending of triangles, force times length: the flexural rigidity E h^3 / (12 (1 - nu^2)) of a sheet of
    /// thickness h, whose --young is then E h, force over length.
    #[arg(long, value_name = "K", allow_negative_numbers = true, default_value_t = DeformSettings::default().bending)]
    pub bending: f64,
    /// Hard limits of every stretch, such as 0.95,1.05; only methods of the ADMM family can hold them.
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true, value_parser = pair)]
    pub strain_limit: Option<[f64; 2]>,
    /// Solve in the plane z = const., in two coordinates: triangles keep their orientation.
    #[arg(long)]
    pub planar: bool,
    /// All tetrahedra, triangles and edges of REST are elastic, not only those of the highest dimension; what lower
    /// ones weigh is the density of their region's material.
    #[arg(long)]
    pub mixed: bool,
}

/// How it is solved.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub struct MethodArgs {
    /// auto: wrapd, then Newton; wrapd: rotation-aware, dynamic weights; r-admm: rotation-aware; w-admm: dynamic
    /// weights; admm-pd: neither; aa-admm, aadr: admm-pd with Anderson acceleration; lbfgs, bcqn: quasi-Newton;
    /// newton, newton-cg (without a factor), projected-newton: second-order methods.
    #[arg(long, value_name = "NAME", value_parser = method_names(), default_value = MethodName::default().as_str())]
    pub method: String,
    /// Where the paper and its authors' code differ, which to follow; default is the fastest.
    #[arg(long, value_name = "NAME", value_parser = ["paper", "reference", "default"], default_value = "default")]
    pub schedule: String,
    /// Hessian of the methods of Newton's kind: the true one, clamped on demand; negative eigenvalues
    /// set to 0; made positive; or the better of these two at each step.
    #[arg(long, value_name = "NAME", value_parser = ["on-demand", "clamp", "abs", "trust-region"])]
    pub projection: Option<String>,
    /// Stiffness that the squared weights are at first: the largest eigenvalue of the Hessian at rest, the slope fit of Liu
    /// et al. 2017, the geometric mean of the extreme eigenvalues, the bulk modulus; auto chooses by method and material.
    #[arg(long, value_name = "NAME", value_parser = ["auto", "rest-hessian", "slope", "geometric-mean", "bulk-modulus"])]
    pub base_weight: Option<String>,
    /// Factor of the squared weights.
    #[arg(long, value_name = "BETA", allow_negative_numbers = true)]
    pub weight_scale: Option<f64>,
    /// What squared weights are multiplied by besides: weights, nothing; safe, the least factor for which the plain iteration
    /// is proven to descend (admm-pd and aa-admm, stvk, no loads).
    #[arg(long, value_name = "NAME", value_parser = PenaltyName::NAMES)]
    pub penalty: Option<String>,
    /// First iteration that may change weights.
    #[arg(long, value_name = "K")]
    pub reweight_from: Option<usize>,
    /// Weights change when one is off by more than this factor.
    #[arg(long, value_name = "GAMMA", allow_negative_numbers = true)]
    pub gamma: Option<f64>,
    /// Least weight, in units of the first.
    #[arg(long, value_name = "BETA_MIN", allow_negative_numbers = true)]
    pub weight_min: Option<f64>,
    /// Largest weight, in units of the first.
    #[arg(long, value_name = "BETA_MAX", allow_negative_numbers = true)]
    pub weight_max: Option<f64>,
    /// Pairs that L-BFGS keeps: in the global step, or as a method.
    #[arg(long, value_name = "N")]
    pub window: Option<usize>,
    /// Differences that Anderson acceleration keeps; with a splitting method that has none, 0, it adds it.
    #[arg(long, value_name = "M")]
    pub anderson: Option<usize>,
    /// Converged, too, when the gradient is this part of the characteristic one of Zhu et al. 2018.
    #[arg(long, value_name = "EPS", allow_negative_numbers = true)]
    pub patch_tol: Option<f64>,
    /// How exactly the global step is solved: smaller is more exact.
    #[arg(long, value_name = "KAPPA", allow_negative_numbers = true)]
    pub kappa: Option<f64>,
    /// Most inner steps of a global step.
    #[arg(long, value_name = "N")]
    pub max_inner: Option<usize>,
    /// Shorten inner steps until they descend.
    #[arg(long)]
    pub line_search: bool,
}

fn energies() -> PossibleValuesParser {
    // Those of solids first, then what only surfaces or springs have.
    let mut all = names(3);
    for name in names(2).into_iter().chain(names(1)) {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    PossibleValuesParser::new(all)
}

fn method_names() -> PossibleValuesParser {
    PossibleValuesParser::new(MethodName::ALL.map(MethodName::as_str))
}

impl DeformArgs {
    /// All settings: defaults of the schedule, and what was given.
    pub fn settings(&self) -> Result<DeformSettings, Refusal> {
        let schedule = match self.method.schedule.as_str() {
            "paper" => Schedule::Paper,
            "reference" => Schedule::Reference,
            _ => Schedule::Default,
        };
        let mut s = DeformSettings::of(schedule);
        s.method = MethodName::from_name(&self.method.method).unwrap_or_default(); // clap lets no other through
        self.method.apply(&mut s);
        s.newton.projection = match self.method.projection.as_deref() {
            Some("clamp") => ProjectionName::Clamp,
            Some("abs") => ProjectionName::Abs,
            Some("trust-region") => ProjectionName::TrustRegion,
            _ => s.newton.projection,
        };
        let m = &self.material;
        s.material = Material {
            energy: m.material.clone(),
            young: m.young,
            poisson: m.poisson,
            mu: m.mu,
            lambda: m.lambda,
            density: None,
        };
        if let Err(e) = s.material.lame() {
            let option = match e {
                MaterialError::Young(_) => "--young: ",
                MaterialError::Poisson(_) => "--poisson: ",
                MaterialError::Mu(_) => "--mu: ",
                MaterialError::Lambda { .. } => "--lambda: ",
                _ => "",
            };
            return Err(Refusal::new(format!("{option}{e}")));
        }
        if let Some(path) = &m.materials {
            s.materials = read_materials(path)?;
        }
        s.density = m.density;
        s.gravity = m.gravity.unwrap_or(s.gravity);
        s.bending = m.bending;
        s.strain_limit = m.strain_limit;
        s.planar = m.planar;
        s.mixed = m.mixed;
        s.fix_orientation = self.fix_orientation;
        s.surface = match (self.surface.shell, self.surface.embed || self.surface.resolution.is_some()) {
            (true, _) => SurfaceModel::Shell,
            (_, true) => SurfaceModel::Embed,
            _ => s.surface,
        };
        s.resolution = self.surface.resolution.unwrap_or(s.resolution);
        s.tol = self.solve.tol;
        s.max_iters = self.solve.max_iters;
        s.time_limit = self.solve.run.time_limit;
        s.threads = self.solve.run.threads;
        if let Some(t) = self.frame_time.filter(|t| *t < 0.0 || t.is_nan()) {
            return Err(Refusal::new(format!("--frame-time is {t}; it must be a number of seconds")));
        }
        s.check().map_err(Refusal::new)?;
        Ok(s)
    }
}

impl MethodArgs {
    fn apply(&self, settings: &mut DeformSettings) {
        fn set<T: Copy>(to: &mut T, from: Option<T>) {
            *to = from.unwrap_or(*to);
        }
        let to = match settings.method {
            MethodName::Lbfgs => &mut settings.lbfgs.window,
            MethodName::Bcqn => &mut settings.bcqn.window,
            _ => &mut settings.admm.window,
        };
        set(to, self.window);
        let to = match settings.method {
            MethodName::AaAdmm => &mut settings.anderson.aa_admm,
            MethodName::Aadr => &mut settings.anderson.aadr,
            _ => &mut settings.anderson.others,
        };
        set(to, self.anderson);
        settings.patch_tol = self.patch_tol;
        let admm = &mut settings.admm;
        set(
            &mut admm.base_weight,
            self.base_weight.as_deref().map(|name| match name {
                "rest-hessian" => BaseWeight::RestHessian,
                "slope" => BaseWeight::Slope,
                "geometric-mean" => BaseWeight::GeometricMean,
                "bulk-modulus" => BaseWeight::BulkModulus,
                _ => BaseWeight::Auto, // clap lets no other through
            }),
        );
        set(&mut admm.weight_scale, self.weight_scale);
        set(&mut admm.penalty, self.penalty.as_deref().and_then(PenaltyName::from_name));
        set(&mut admm.reweight_from, self.reweight_from);
        set(&mut admm.reweight_trigger, self.gamma);
        set(&mut admm.weight_min, self.weight_min);
        set(&mut admm.weight_max, self.weight_max);
        set(&mut admm.kappa, self.kappa);
        set(&mut admm.max_inner, self.max_inner);
        admm.line_search |= self.line_search;
    }
}

/// Materials by region: `[3]`, then `energy`, `young`, `poisson`, `mu`, `lambda`; what is left out
/// has its default.
fn read_materials(path: &Path) -> Result<BTreeMap<i32, Material>, Refusal> {
    let file = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|e| Refusal::new(format!("{file}: cannot be read: {e}; check the path")))?;
    let named: BTreeMap<String, Material> = toml::from_str(&text).map_err(|e| {
        let line = e.span().map(|s| text[..s.start.min(text.len())].matches('\n').count() + 1);
        let at = line.map(|l| format!("line {l}: ")).unwrap_or_default();
        let what = e.message().lines().next().unwrap_or_default().trim().to_owned();
        Refusal::new(format!("{file}: {at}{what}; write sections such as [3] with energy, young, poisson, mu, lambda"))
    })?;
    let mut out = BTreeMap::new();
    for (name, material) in named {
        let Ok(region) = name.parse::<i32>() else {
            return Err(Refusal::new(format!(
                "{file}: `{name}` is no region; name sections by the regions of the mesh"
            )));
        };
        let refuse = |what: String| Refusal::new(format!("{file}: region {region}: {what}"));
        material.lame().map_err(|e| refuse(e.to_string()))?;
        if ![1, 2, 3].iter().any(|&k| names(k).contains(&material.energy.as_str())) {
            let known = names(3).join(", ");
            return Err(refuse(format!("no energy is called `{}`; there are {known}", material.energy)));
        }
        out.insert(region, material);
    }
    Ok(out)
}
