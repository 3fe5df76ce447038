//! Bodies that are posed again and again: [`Deformer`].

mod posed;
mod stops;

use super::check::check_vectors;
use super::embedded::Carrying;
use super::{Carrier, DeformError, DeformInput, Hooks};
use crate::pins::RigidMotion;
use crate::settings::DeformSettings;
use posed::Posed;
use proxel_split::{Status, vector};
use std::collections::BTreeMap;
use std::time::Duration;

/// A pose, and how near to the minimum it is.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Positions, in the order of the rest mesh; fixed vertices bit for bit where they were to be held.
    pub positions: Vec<[f64; 3]>,
    /// Converged, or stopped by the time that it was given, or as [`super::Deformation::status`].
    pub status: Status,
    /// Why, in a sentence.
    pub reason: String,
    /// Iterations of this step.
    pub iterations: usize,
    /// Their inner steps.
    pub inner_iterations: usize,
    /// Factorisations among them.
    pub refactorisations: usize,
    /// Objective; NaN where there was no time to look.
    pub energy: f64,
    /// Norm of its gradient over free vertices, where it is known and means something.
    pub gradient_norm: Option<f64>,
    /// The same over what convergence is measured against: the largest force so far that a motion of the targets has put on
    /// a pose, but no more than the characteristic gradient.
    pub gradient_ratio: Option<f64>,
    /// Elements with a measure of zero or below.
    pub inverted: u64,
    /// Least signed stretch.
    pub min_stretch: f64,
    /// Largest stretch.
    pub max_stretch: f64,
    /// What the user should know about this pose, such as pins of a surface that its lattice cannot reach.
    pub warnings: Vec<String>,
}

/// A body that is built once and then follows its handles.
///
/// ```no_run
/// # use proxel::deform::{Deformer, DeformInput, Hooks};
/// # use proxel::pins::RigidMotion;
/// # use proxel::settings::DeformSettings;
/// # use std::time::Duration;
/// # let (input, settings) = (DeformInput::default(), DeformSettings::default());
/// let mut deformer = Deformer::new(&input, &settings)?;
/// deformer.step(None, &mut Hooks::default())?; // to the first minimum
/// deformer.move_group("hand", &RigidMotion::translation([0.0, 0.1, 0.0]))?;
/// let frame = deformer.step(Some(Duration::from_millis(40)), &mut Hooks::default())?;
/// println!("{:?} {}", frame.status, frame.energy);
/// # Ok::<(), proxel::deform::DeformError>(())
/// ```
///
/// [`Self::step`] moves towards the minimum for the targets as they are and returns where it has got to. With second
/// derivatives, `--method auto` begins with the linear response of the last minimum ([`proxel_split::respond`]) or, where
/// that is worse, with the last pose carried along smoothly; the factor of the last Hessian then preconditions Newton's
/// first steps ([`proxel_split::Newton`]). With hard sets, equalities or pressure on a surface in a lattice the splitting goes on with the weights
/// and duals that it had. Any other method begins anew, from the last pose.
pub struct Deformer {
    input: DeformInput, // as given, with the targets of now
    home: DeformInput,  // the targets as given
    places: Places,
    settings: DeformSettings,
    pool: rayon::ThreadPool,
    carrier: Option<Box<Carrier>>,
    posed: Posed,
    warnings: Vec<String>,
}

impl Deformer {
    /// Builds the problem and its matrices; [`DeformInput::start`], or the smooth start, is the first pose. Nothing is
    /// solved before the first [`Self::step`].
    ///
    /// # Errors
    /// As [`super::deform`].
    pub fn new(input: &DeformInput, settings: &DeformSettings) -> Result<Self, DeformError> {
        settings.check().map_err(DeformError)?;
        let pool = super::pool(settings)?;
        let (carrier, posed, warnings) = pool.install(|| build(input, settings))?;
        let home = DeformInput { fixed: input.fixed.clone(), soft: input.soft.clone(), ..DeformInput::default() };
        Ok(Deformer {
            input: input.clone(),
            home,
            places: Places::of(input),
            settings: settings.clone(),
            pool,
            carrier,
            posed,
            warnings,
        })
    }

    /// Sends fixed vertices, and ends of soft springs, elsewhere. All springs of a vertex go to the same target.
    ///
    /// # Errors
    /// A vertex that is neither fixed nor drawn by a spring, a target that is not finite; nothing is moved then.
    pub fn set_targets(&mut self, targets: &[(u32, [f64; 3])]) -> Result<(), DeformError> {
        let name = &self.input.rest.name;
        let points = &self.input.rest.points;
        let plane = points.first().filter(|_| self.settings.planar).map(|p| p[2]);
        let off = plane.map_or(f64::INFINITY, |_| OFF_PLANE * vector::extent(points.as_flattened(), 3));
        for (v, target) in targets {
            if plane.is_some_and(|z| (target[2] - z).abs() > off) {
                return Err(DeformError(format!(
                    "{name}: the target of vertex {v} (0-based) is {target:?}; --planar needs it in the plane of the mesh"
                )));
            }
            if !target.iter().all(|t| t.is_finite()) {
                return Err(DeformError(format!(
                    "{name}: the target of vertex {v} (0-based) is {target:?}; give finite numbers"
                )));
            }
            if !self.places.has(*v) {
                return Err(DeformError(format!(
                    "{name}: vertex {v} (0-based) is neither fixed nor drawn by a soft spring, so it has no target; name it \
                     among the pins that the deformer is built with"
                )));
            }
        }
        for (v, target) in targets {
            self.places.send(*v, *target, &mut self.input);
        }
        self.retarget()
    }

    /// Moves the targets of a group, as they were when the deformer was built. Its vertices may be fixed or drawn by soft
    /// springs; those that are neither are left alone.
    ///
    /// # Errors
    /// A name that no group has, a group that holds nothing.
    pub fn move_group(&mut self, name: &str, motion: &RigidMotion) -> Result<(), DeformError> {
        let mesh = &self.input.rest.name;
        let Some((_, vertices)) = self.input.groups.iter().find(|(group, _)| group == name) else {
            let known: Vec<String> = self.input.groups.iter().map(|(name, _)| format!("`{name}`")).collect();
            let known = if known.is_empty() { "there are none".to_string() } else { known.join(", ") };
            return Err(DeformError(format!("{mesh}: no group is called `{name}`; give the name of one: {known}")));
        };
        let targets: Vec<(u32, [f64; 3])> =
            vertices.iter().filter_map(|v| Some((*v, motion.apply(self.home_of(*v)?)))).collect();
        if targets.is_empty() {
            return Err(DeformError(format!(
                "{mesh}: group `{name}` holds no vertex, neither fixed nor by springs; move a group that does"
            )));
        }
        self.set_targets(&targets)
    }

    /// Where a vertex was to be when the deformer was built; none where it was free.
    pub fn home_of(&self, v: u32) -> Option<[f64; 3]> {
        self.places.target(v, &self.home)
    }

    fn retarget(&mut self) -> Result<(), DeformError> {
        let Some(carrier) = &self.carrier else {
            self.posed.retarget(&self.input);
            return Ok(());
        };
        let (lattice, settings) = carrier.lattice_problem(&self.input, &self.settings)?;
        if self.posed.is_same_but_for_targets(&lattice) {
            self.posed.retarget(&lattice);
            return Ok(());
        }
        // Pins that were held rigidly are not any more, or are again: it is another problem.
        let start = Some(self.posed.positions());
        self.posed = self.pool.install(|| Posed::new(DeformInput { start, ..lattice }, &settings))?;
        Ok(())
    }

    /// Goes on towards the minimum for the targets as they are, for no longer than `budget` and, where no target has moved,
    /// from where the last step has got to. The time is looked at between iterations, so that one of them may exceed it.
    /// With no time at all the last pose is carried along smoothly; with some, the result has no more energy than that.
    ///
    /// # Errors
    /// Targets that describe no problem, such as a pin behind an obstacle. A step that does not converge is no error: see
    /// [`Frame::status`].
    pub fn step(&mut self, budget: Option<Duration>, hooks: &mut Hooks<'_>) -> Result<Frame, DeformError> {
        let Deformer { pool, posed, .. } = self;
        let mut frame = pool.install(|| posed.step(budget, hooks))?;
        if let Some(carrier) = &self.carrier {
            frame.positions = self.surface(carrier, &frame.positions, &mut frame.warnings);
        }
        Ok(frame)
    }

    /// The pose that the last step with any time ended at; from where the next one goes on.
    pub fn positions(&self) -> Vec<[f64; 3]> {
        let positions = self.posed.positions();
        self.carrier.as_ref().map_or(positions.clone(), |carrier| self.surface(carrier, &positions, &mut Vec::new()))
    }

    fn surface(&self, carrier: &Carrier, lattice: &[[f64; 3]], warnings: &mut Vec<String>) -> Vec<[f64; 3]> {
        let mut positions = carrier.positions(lattice, &self.input.rest.points, &self.input.fixed);
        carrier.hold(&mut positions, &self.input.fixed, warnings);
        positions
    }

    /// The groups that can be moved, with their vertices.
    pub fn groups(&self) -> &[(String, Vec<u32>)] {
        &self.input.groups
    }

    /// What it was built from, with the targets of now.
    pub fn input(&self) -> &DeformInput {
        &self.input
    }

    /// Whether it is a surface that a lattice of tetrahedra carries.
    pub fn is_carried(&self) -> bool {
        self.carrier.is_some()
    }

    /// How it solves.
    pub fn settings(&self) -> &DeformSettings {
        &self.settings
    }

    /// Number of threads that it works with.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// What was repaired in the input.
    pub fn repaired(&self) -> &[String] {
        self.posed.body().repaired()
    }

    /// The tetrahedra as they are used, where orientations were repaired.
    pub fn repaired_tets(&self) -> Option<Vec<[u32; 4]>> {
        self.posed.body().repaired_tets().filter(|_| self.carrier.is_none())
    }

    /// What the user should know about the input.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

/// Where the targets of each vertex stand in an input.
#[derive(Default)]
struct Places {
    fixed: BTreeMap<u32, usize>,
    soft: BTreeMap<u32, Vec<usize>>,
}

impl Places {
    fn of(input: &DeformInput) -> Self {
        let mut places = Places::default();
        for (i, (v, _)) in input.fixed.iter().enumerate() {
            places.fixed.insert(*v, i);
        }
        for (i, (v, ..)) in input.soft.iter().enumerate() {
            places.soft.entry(*v).or_default().push(i);
        }
        places
    }

    fn has(&self, v: u32) -> bool {
        self.fixed.contains_key(&v) || self.soft.contains_key(&v)
    }

    fn target(&self, v: u32, input: &DeformInput) -> Option<[f64; 3]> {
        let fixed = self.fixed.get(&v).and_then(|i| input.fixed.get(*i)).map(|f| f.1);
        fixed.or_else(|| self.soft.get(&v).and_then(|all| input.soft.get(*all.first()?)).map(|s| s.1))
    }

    fn send(&self, v: u32, target: [f64; 3], input: &mut DeformInput) {
        if let Some(fixed) = self.fixed.get(&v).and_then(|i| input.fixed.get_mut(*i)) {
            fixed.1 = target;
        }
        for i in self.soft.get(&v).into_iter().flatten() {
            if let Some(soft) = input.soft.get_mut(*i) {
                soft.1 = target;
            }
        }
    }
}

type Built = (Option<Box<Carrier>>, Posed, Vec<String>);

fn build(input: &DeformInput, settings: &DeformSettings) -> Result<Built, DeformError> {
    match Carrier::of(input, settings)? {
        Carrying::No { warning } => {
            let posed = Posed::new(input.clone(), settings)?;
            let mut warnings = posed.body().warnings().to_vec();
            warnings.extend(warning);
            Ok((None, posed, warnings))
        }
        Carrying::Body(carrier) => {
            check_vectors(carrier.name(), input.rest.n_verts(), input)?;
            let (lattice, settings) = carrier.lattice_problem(input, settings)?;
            let posed = Posed::new(lattice, &settings)?;
            let mut warnings = carrier.warnings().to_vec();
            warnings.extend_from_slice(posed.body().warnings());
            Ok((Some(carrier), posed, warnings))
        }
    }
}

/// A target of a planar body is this part of its size away from its plane, at most; what motions within the plane leave.
const OFF_PLANE: f64 = 1e-9;
