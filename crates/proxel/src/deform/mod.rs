//! Quasi-static deformation: positions of least energy under pins and loads.
//!
//! [`deform`] does it in one call; [`Body`] is the problem behind it, built once. Positions come and go in the user's
//! units and vertex order; inside, the mesh is moved to the origin and vertices are sorted, free ones first.

mod adjoint;
mod body;
pub(crate) mod check;
pub(crate) mod constraints;
pub(crate) mod elements;
pub(crate) mod embedded;
mod extras;
mod live;
mod own;
mod picture;
mod planar;
pub(crate) mod sheet;
mod skin;
mod start;
mod watch;

pub use adjoint::{Adjoint, Moduli, adjoint};
pub use body::Body;
pub use embedded::{Carried, Carrier};
pub use extras::{Extras, extras};
pub use live::{Deformer, Frame};
pub(crate) use own::OwnTerm;
pub use own::{ElementEnergy, Matrix, OwnEnergy};
pub use picture::draw_deformation;
pub use skin::Skin;
pub use watch::{Hooks, Progress};
pub(crate) use watch::{TimeLimit, Watcher, row};

use crate::pins::HalfSpace;
use crate::report::{Report, Seconds};
use crate::settings::{DeformSettings, MethodName, PenaltyName};
use crate::threads;
use embedded::Carrying;
use proxel_mesh::Mesh;
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Auto, Cancel, Direct, Equality, GlobalStep, GradientTolerance,
    IterationLimit, Lbfgs, Method, Newton, NoProgress, Outcome, PatchGradient, PointSpring, Problem, QuasiNewton,
    ResidualTolerance, Residuals, Status, Stop, SystemError,
};
use std::collections::BTreeMap;
use std::time::Instant;

/// What is to be deformed, and how it is held.
#[derive(Clone, Debug, Default)]
pub struct DeformInput {
    /// The mesh at rest: tetrahedra, or triangles, or edges.
    pub rest: Mesh,
    /// Start positions; without them, fixed vertices are moved to their targets and the others follow smoothly.
    pub start: Option<Vec<[f64; 3]>>,
    /// Fixed vertices and where they are held.
    pub fixed: Vec<(u32, [f64; 3])>,
    /// Soft springs: vertex, target, stiffness (force over length).
    pub soft: Vec<(u32, [f64; 3], f64)>,
    /// Forces on vertices.
    pub loads: Vec<(u32, [f64; 3])>,
    /// Pressures on the faces whose corners are all among these vertices, force over area along the outward normal: of the
    /// boundary of tetrahedra, or of triangles as they are oriented.
    pub pressures: Vec<(Vec<u32>, f64)>,
    /// Rows sum a_i x_i = b over vertices, which hold exactly.
    pub equalities: Vec<Equality>,
    /// Planes that vertices stay on the side of, to which the normal points; without friction.
    pub obstacles: Vec<HalfSpace>,
    /// Named groups of vertices, whose reaction forces are reported.
    pub groups: Vec<(String, Vec<u32>)>,
    /// Springs from points that vertices carry, such as those of a surface in a lattice; weights add up to 1.
    pub ties: Vec<PointSpring>,
    /// A surface that the mesh carries: what pressures and obstacles act on, and whose vertices they name.
    pub skin: Option<Skin>,
    /// The part of each tetrahedron that is material, above 0 and at most 1; everything without it.
    pub fill: Option<Vec<f64>>,
    /// Positions to measure the position error against; they change nothing.
    pub reference: Option<Vec<[f64; 3]>>,
    /// What is minimised in the place of the material's energy, whose stiffness at rest then preconditions.
    pub energy: Option<OwnEnergy>,
}

/// Why a deformation cannot be computed: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeformError(pub String);

impl std::fmt::Display for DeformError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for DeformError {}

impl From<proxel_mesh::MeshError> for DeformError {
    fn from(e: proxel_mesh::MeshError) -> Self {
        DeformError(e.to_string())
    }
}

/// A deformed body.
#[derive(Clone, Debug)]
pub struct Deformation {
    /// Positions, in the order of the rest mesh; fixed vertices bit for bit where they were to be held.
    pub positions: Vec<[f64; 3]>,
    /// Where the iteration began.
    pub start: Vec<[f64; 3]>,
    /// How it ended.
    pub status: Status,
    /// All figures; `seconds.read`, `seconds.write` and `peak_bytes` are the caller's to fill.
    pub report: Report,
    /// The tetrahedra that were used, where orientations were repaired.
    pub repaired_tets: Option<Vec<[u32; 4]>>,
    /// At fixed vertices, the force that the body exerts on what holds it, loads and hard limits included; 0 elsewhere.
    pub reaction: Vec<[f64; 3]>,
    /// The lattice that carried it, where the input was the skin of a body.
    pub carried: Option<Box<Carried>>,
}

/// Minimises the deformation energy of `input` and says how it went. What it returns holds for the positions as returned.
/// A surface that bounds a body is carried by a lattice of tetrahedra, see [`Carrier`]; energy and stretches are then
/// those of the lattice.
///
/// # Errors
/// Input that describes no problem. A run that does not converge is no error: see [`Deformation::status`].
pub fn deform(
    input: &DeformInput,
    settings: &DeformSettings,
    hooks: &mut Hooks<'_>,
) -> Result<Deformation, DeformError> {
    let began = Instant::now();
    settings.check().map_err(DeformError)?;
    let pool = pool(settings)?;
    let threads = pool.current_num_threads();
    // The hooks stay on this thread's side of the pool: they are moved in and run there one at a time.
    pool.install(|| match Carrier::of(input, settings)? {
        Carrying::Body(carrier) => carrier.deform(input, settings, hooks, threads, began),
        Carrying::No { warning } => {
            let mut result = deform_here(input, settings, hooks, threads, began)?;
            result.report.warnings.extend(warning);
            Ok(result)
        }
    })
}

/// The threads that settings ask for.
pub(crate) fn pool(settings: &DeformSettings) -> Result<rayon::ThreadPool, DeformError> {
    Ok(threads::pool(settings.threads).map_err(DeformError)?.0)
}

fn deform_here(
    input: &DeformInput,
    settings: &DeformSettings,
    hooks: &mut Hooks<'_>,
    threads: usize,
    began: Instant,
) -> Result<Deformation, DeformError> {
    let mut body = Body::new(input, settings)?;
    let problem = body.take_problem();
    let start = body.positions(&problem.x0);
    let mut run = if problem.n_free == 0 {
        Finished::without_unknowns(problem)
    } else {
        solve(&body, problem, settings, hooks, began)?
    };

    // What is reported is what a reader of the written positions finds.
    let positions = body.positions(&run.outcome.x);
    let x = body.centred(&positions);
    let hard = run.problem.has_hard_sets();
    let mut grad = vec![0.0; x.len()];
    let energy = run.problem.energy(&x, Some(&mut grad));
    let reaction = reactions(&body, run.forces.as_deref().unwrap_or(&grad));
    let gradient_norm = run.problem.gradient_norm(&mut grad[..run.problem.n_free * run.problem.dim]);
    let outcome = &run.outcome;
    let report = Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: "deform".to_string(),
        settings: serde_json::to_value(settings).unwrap_or_default(),
        method: settings.method.as_str().to_string(),
        status: outcome.status.as_str().to_string(),
        reason: outcome.reason.clone(),
        iterations: outcome.iterations,
        inner_iterations: outcome.inner_iterations,
        refactorisations: outcome.refactorisations,
        energy: finite(energy.value),
        // At the border of a hard set the gradient does not vanish: it says nothing there.
        gradient_norm: finite(gradient_norm).filter(|_| !hard),
        gradient_ratio: finite(if run.reference_gradient > 0.0 { gradient_norm / run.reference_gradient } else { 0.0 })
            .filter(|_| !hard),
        inverted: Some(energy.inverted),
        min_stretch: finite(energy.min_stretch),
        max_stretch: finite(energy.max_stretch),
        position_error: body.reference_error(&x, &body.centred(&start)).and_then(finite),
        primal_residual: finite(run.residuals.primal),
        dual_residual: finite(run.residuals.dual),
        accepted: outcome.accepted,
        rejected: outcome.rejected,
        warnings: body.warnings().to_vec(),
        repaired: body.repaired().to_vec(),
        seconds: Seconds { read: 0.0, setup: run.setup, solve: run.solve, write: 0.0 },
        factor_bytes: Some(run.factor_bytes),
        threads,
        reactions: sums(input, &body, &reaction, &run.contacts),
        ..Report::default()
    };
    let (status, repaired_tets) = (outcome.status, body.repaired_tets());
    Ok(Deformation { positions, start, status, report, repaired_tets, reaction, carried: None })
}

/// Minus the gradient at the fixed vertices.
fn reactions(body: &Body, grad: &[f64]) -> Vec<[f64; 3]> {
    let mut out = body.vectors(grad);
    for (v, g) in out.iter_mut().enumerate() {
        *g = if body.is_fixed(v as u32) { g.map(|g| 0.0 - g) } else { [0.0; 3] };
    }
    out
}

/// The sum over the fixed vertices of each group that has some, and over those that touch each obstacle.
fn sums(input: &DeformInput, body: &Body, reaction: &[[f64; 3]], contacts: &[Vec<f64>]) -> BTreeMap<String, [f64; 3]> {
    let mut sums = BTreeMap::new();
    for (k, forces) in contacts.iter().enumerate() {
        sums.insert(format!("obstacle {k}"), total(body.vectors(forces)));
    }
    sums.extend(group_sums(&input.groups, &|v| body.is_fixed(v), reaction));
    sums
}

/// The sum over the held vertices of each group that has some.
fn group_sums<'a>(
    groups: &'a [(String, Vec<u32>)],
    is_held: &'a dyn Fn(u32) -> bool,
    reaction: &'a [[f64; 3]],
) -> impl Iterator<Item = (String, [f64; 3])> + 'a {
    groups.iter().filter(|(_, vertices)| vertices.iter().any(|v| is_held(*v))).map(move |(name, vertices)| {
        (name.clone(), total(vertices.iter().filter(|v| is_held(**v)).map(|v| reaction[*v as usize])))
    })
}

fn total(forces: impl IntoIterator<Item = [f64; 3]>) -> [f64; 3] {
    forces.into_iter().fold([0.0; 3], |sum, f| [0, 1, 2].map(|d| sum[d] + f[d]))
}

fn finite(v: f64) -> Option<f64> {
    v.is_finite().then_some(v)
}

/// A run that is over.
struct Finished {
    outcome: Outcome,
    problem: Problem,
    reference_gradient: f64,
    forces: Option<Vec<f64>>, // gradient over all nodes with the forces of hard sets, where there are some
    contacts: Vec<Vec<f64>>,  // what the body exerts on each obstacle, over all nodes
    residuals: Residuals,
    factor_bytes: u64,
    setup: f64,
    solve: f64,
}

impl Finished {
    /// Every vertex is fixed: there is nothing to solve.
    fn without_unknowns(problem: Problem) -> Self {
        let outcome = Outcome {
            status: Status::Converged,
            reason: "every vertex is fixed; there is nothing to move".to_string(),
            iterations: 0,
            inner_iterations: 0,
            refactorisations: 0,
            accepted: 0,
            rejected: 0,
            missed: 0,
            x: problem.x0.clone(),
            energy: Default::default(),
            is_last: true,
            last: Default::default(),
        };
        Finished {
            outcome,
            problem,
            reference_gradient: 0.0,
            forces: None,
            contacts: Vec::new(),
            residuals: Residuals { primal: 0.0, dual: 0.0 },
            factor_bytes: 0,
            setup: 0.0,
            solve: 0.0,
        }
    }
}

/// Steps that a method may refuse in a row.
pub(crate) const REFUSALS: usize = 5;

/// Puts the method together: parts, no special cases.
pub(crate) fn method(problem: Problem, settings: &DeformSettings) -> Result<Box<dyn Method>, SystemError> {
    let name = settings.method;
    Ok(match name {
        MethodName::Newton | MethodName::NewtonCg | MethodName::ProjectedNewton => {
            Box::new(Newton::new(problem, settings.newton.of(name))?)
        }
        MethodName::Auto => {
            let admm = splitting(problem, settings)?;
            Box::new(Auto::new(name.as_str().to_string(), admm, settings.newton.auto()))
        }
        MethodName::Lbfgs => Box::new(QuasiNewton::new(problem, settings.lbfgs.to_method(name.as_str(), false))?),
        MethodName::Bcqn => Box::new(QuasiNewton::new(problem, settings.bcqn.to_method(name.as_str(), true))?),
        _ => {
            let hard = problem.has_hard_sets();
            let admm = splitting(problem, settings)?;
            let windows = &settings.anderson;
            // Under a hard set only the variable that is updated second may be accelerated: Remark 3.1 of A.
            let both = if hard { Algorithm::Two } else { Algorithm::One };
            match (name, windows.others) {
                (MethodName::AaAdmm, _) => Acceleration::anderson(both, windows.aa_admm).of(admm)?,
                (MethodName::Aadr, _) => Acceleration::anderson(Algorithm::Envelope, windows.aadr).of(admm)?,
                (_, 0) => Box::new(admm),
                (_, window) => Acceleration::anderson(both, window).of(admm)?,
            }
        }
    })
}

/// The splitting methods differ in coupling, global step and weights.
pub(crate) fn splitting(problem: Problem, settings: &DeformSettings) -> Result<Admm, SystemError> {
    let admm = Admm::new(problem, admm_settings(settings))?;
    match settings.admm.penalty {
        PenaltyName::Weights => Ok(admm),
        PenaltyName::Safe => admm.with_safe_penalty(),
    }
}

/// The parts of a splitting method.
pub(crate) fn admm_settings(settings: &DeformSettings) -> AdmmSettings {
    let name = settings.method;
    let global: Box<dyn GlobalStep> = match name.is_rotation_aware() {
        true => Box::new(Lbfgs::new(settings.admm.lbfgs())),
        false => Box::new(Direct),
    };
    let reweighting = name.is_reweighted().then(|| settings.admm.reweighting(name.is_rotation_aware()));
    AdmmSettings { name: name.as_str().to_string(), global, reweighting, renewed_at: None }
}

/// Whether the method can hold what the problem asks to be held.
fn check_method(problem: &Problem, settings: &DeformSettings) -> Result<(), DeformError> {
    let (what, hard) = match () {
        () if settings.method.takes_hard_sets() => return Ok(()),
        () if problem.has_hard_sets() => ("needs derivatives and cannot hold hard limits", true),
        () => ("cannot hold equalities", !problem.quadratic.equalities.is_empty()),
    };
    match hard {
        true => Err(DeformError(format!(
            "{} {what}; use --method auto, wrapd, r-admm, w-admm or admm-pd",
            settings.method.as_str()
        ))),
        false => Ok(()),
    }
}

fn solve(
    body: &Body,
    problem: Problem,
    settings: &DeformSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Finished, DeformError> {
    check_method(&problem, settings)?;
    let mut method = method(problem, settings).map_err(|e| DeformError(body.explain(&e)))?;
    let setup = began.elapsed().as_secs_f64();
    let mut tolerance = GradientTolerance::new(settings.tol, method.as_mut());
    let reference_gradient = tolerance.reference();
    let mut patch = settings.patch_tol.map(|eps| PatchGradient::new(eps, method.problem()));
    let mut residual_tolerance = ResidualTolerance::new(settings.tol);
    let hard = method.problem().has_hard_sets();
    let mut limit = IterationLimit(settings.max_iters);
    let mut stuck = NoProgress::new(REFUSALS);
    let mut cancel = Cancel(hooks.cancel.clone());
    let mut time = watch::TimeLimit::new(began, settings.time_limit);
    let start = method.x().to_vec();
    let mut watcher =
        watch::Watcher::new(hooks, began, |x: &[f64]| body.reference_error(x, &start).unwrap_or(f64::INFINITY));
    let mut stops: Vec<&mut dyn Stop> = vec![if hard { &mut residual_tolerance } else { &mut tolerance }];
    if let Some(patch) = &mut patch {
        stops.push(patch);
    }
    stops.extend([&mut cancel as &mut dyn Stop, &mut time, &mut limit, &mut stuck]);
    let outcome = proxel_split::run(method.as_mut(), &mut stops, &mut watcher);
    let factor_bytes = method.factor_bytes();
    let solve = began.elapsed().as_secs_f64() - setup;
    let residuals = method.residuals();
    let forces = if hard { method.forces() } else { None };
    let contacts = body.obstacles().map(|term| method.forces_of_term(term).unwrap_or_default()).collect();
    let problem = method.into_problem();
    Ok(Finished { outcome, problem, reference_gradient, forces, contacts, residuals, factor_bytes, setup, solve })
}
