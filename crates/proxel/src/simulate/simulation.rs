//! A scene in motion.

use super::contact::Walls;
use super::engine::{Engine, Solved, Task};
use super::folder::Ledger;
use super::forces::accelerations;
use super::measure::{contact_forces, elastic, measure, pressing};
use super::record::{Frame, FrameRecord};
use super::scene::{Integrator, Scene, SceneFile};
use super::stops::Stops;
use super::world::World;
use super::{BodyState, Hooks, SimulateError, State, picture, place, scenery};
use crate::deform::pool;
use crate::preview::{Image, Model};
use crate::settings::DeformSettings;
use proxel_model::contact::Contacts;
use proxel_split::{SquaredResiduals, Status, VIOLATION, normalized};
use std::time::Instant;

type V3 = [f64; 3];

/// Bodies of a scene on their way, frame by frame.
///
/// ```no_run
/// use proxel::simulate::{Hooks, SceneFile, Simulation};
/// let mut simulation = Simulation::new(&SceneFile::read("scene.toml".as_ref())?, None)?;
/// while simulation.frame_count() < simulation.scene().time.frames {
///     let record = simulation.advance(&mut Hooks::default())?;
///     println!("{} {}", record.time, record.status);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Simulation {
    scene: Scene,
    world: World,
    engine: Engine,
    state: State,
    pool: rayon::ThreadPool,
    last: Option<Last>, // what was found at the end of the last step
}

/// What the end of a step leaves for reports.
struct Last {
    contacts: Contacts,
    reaction: Vec<f64>, // forces of bodies on what holds them, all nodes
}

/// Halvings of a step that does not converge.
const HALVINGS: usize = 4;

/// What the steps of a frame have come to.
#[derive(Default)]
struct Tally {
    steps: usize,
    iterations: usize,
    rejected: usize,
    worst: Option<(Status, String)>,
    residuals: Option<(f64, f64)>, // forward and combined, A(27), of the last step
    gradient: Option<f64>,
    off_contact: Option<f64>,
    bound: f64,
}

impl Tally {
    fn note(&mut self, status: Status, reason: &str) {
        let rank = |s: Status| match s {
            Status::Converged => 0,
            Status::Stopped => 1,
            Status::Cancelled => 2,
            Status::Failed => 3,
        };
        if self.worst.as_ref().is_none_or(|(worst, _)| rank(status) > rank(*worst)) {
            self.worst = Some((status, reason.to_owned()));
        }
    }
}

impl Simulation {
    /// Reads and builds everything that the scene names; frame 0 is the start. All processors where `threads` is none; the
    /// result is the same for any number.
    ///
    /// # Errors
    /// Whatever cannot be simulated, by name.
    pub fn new(file: &SceneFile, threads: Option<usize>) -> Result<Self, SimulateError> {
        let scene = file.scene().clone();
        let pool = pool(&DeformSettings { threads, ..DeformSettings::default() })?;
        let (world, engine) = pool.install(|| -> Result<_, SimulateError> {
            let world = World::new(file)?;
            let settings = world.bodies.first().map(|b| b.settings.clone()).unwrap_or_default();
            let tau = scene.time.dt / scene.time.substeps as f64;
            let inertia = stiffness(tau, scene.damping.mass);
            let damped = scene.damping.stiffness > 0.0;
            let engine = Engine::new(&world, settings, &scene.solver, damped, inertia)?;
            Ok((world, engine))
        })?;
        let state = State { x: world.start.clone(), v: world.velocity.clone(), ..State::default() };
        Ok(Simulation { scene, world, engine, state, pool, last: None })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Frames done, the start aside.
    pub fn frame_count(&self) -> usize {
        self.state.frame
    }

    /// What the next frame begins with.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Goes on from a state of the same scene, as if there had been no break: to the bit.
    ///
    /// # Errors
    /// A state of another scene.
    pub fn resume(&mut self, state: State) -> Result<(), SimulateError> {
        let n = 3 * self.world.n();
        let fits = state.x.len() == n && state.v.len() == n;
        let points = self.world.touching.who.len();
        let walls = self.world.obstacles.len();
        let known = state.known.keys().all(|(p, w)| (*p as usize) < points && (*w as usize) < walls);
        if !fits || !known || state.frame > self.scene.time.frames {
            return Err(SimulateError::new("the state is that of another scene; start anew without --resume".into()));
        }
        self.state = state;
        self.last = None;
        Ok(())
    }

    /// Goes on from bodies as they are elsewhere, as after `frame` frames: what the next frame makes of them can be compared
    /// with what another solver does. They may be inside of obstacles; the step then pushes them out.
    ///
    /// # Errors
    /// Another number of bodies or vertices, a number that is not finite, a body that a lattice carries.
    pub fn place(&mut self, frame: usize, bodies: &[BodyState]) -> Result<(), SimulateError> {
        let state = place::state(&self.world, frame, bodies)?;
        self.resume(state)
    }

    /// What the user should know, and what was repaired.
    pub fn notes(&self) -> (&[String], &[String]) {
        (&self.world.warnings, &self.world.repaired)
    }

    /// Threads that it uses.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Bytes of factors.
    pub fn factor_bytes(&self) -> u64 {
        self.engine.factor_bytes()
    }

    /// What may change its energy and its momenta.
    pub fn ledger(&self) -> Ledger {
        let Scene { forces, damping, obstacles, bodies, .. } = &self.scene;
        let moves = |b: &super::BodySpec| b.pins.iter().any(|p| p.velocity.is_some() || !p.keyframes.is_empty());
        let (windy, undamped) = (forces.wind.is_some(), damping.mass == 0.0 && damping.stiffness == 0.0);
        Ledger {
            free: !windy && undamped && obstacles.is_empty() && self.world.n_free == self.world.n(),
            mass: self.world.mass.iter().sum(),
            driven: windy || bodies.iter().any(moves) || self.world.obstacles.iter().any(|o| !o.is_still()),
        }
    }

    /// The next frame. One that is cancelled, or that the time limit cuts short, changes nothing: its record says so, and
    /// the simulation can go on from where it was.
    ///
    /// # Errors
    /// A system that cannot be factored, pins that cannot be followed; the state is as before.
    pub fn advance(&mut self, hooks: &mut Hooks<'_>) -> Result<FrameRecord, SimulateError> {
        let Simulation { scene, world, engine, state, pool, last } = self;
        pool.install(|| {
            let began = Instant::now();
            let mut stops = Stops::new(hooks, state.frame + 1);
            engine.renew(world)?;
            let mut stepper = Stepper { scene, world, engine, state: state.clone(), last: None };
            let mut tally = Tally::default();
            let (n, from) = (scene.time.substeps, state.frame as f64 * scene.time.dt);
            let h = scene.time.dt / n as f64;
            for i in 0..n {
                stops.step = i;
                let end = if i + 1 == n { (state.frame + 1) as f64 * scene.time.dt } else { from + (i + 1) as f64 * h };
                stepper.step((from + i as f64 * h, end, h), 0, &mut stops, &mut tally)?;
                if stops.is_over() || matches!(tally.worst, Some((Status::Failed, _))) {
                    break;
                }
            }
            if stops.is_cancelled() {
                tally.worst =
                    Some((Status::Cancelled, "cancelled by the user; the frame under way was dropped".into()));
            } else if stops.is_over() {
                let reason = "the time is over (--time-limit); the frame under way was dropped";
                tally.worst = Some((Status::Stopped, reason.into()));
            }
            let is_whole = !stops.is_over();
            let Stepper { state: mut after, last: left, .. } = stepper;
            after.frame += 1;
            let mut record = measure(scene, world, engine, &after);
            let (status, reason) = tally.worst.unwrap_or((Status::Converged, String::new()));
            record.steps = tally.steps;
            record.iterations = tally.iterations;
            record.rejected = tally.rejected;
            let finite = |v: f64| v.is_finite().then_some(v);
            record.forward = tally.residuals.and_then(|(forward, _)| finite(forward));
            record.combined = tally.residuals.and_then(|(_, combined)| finite(combined));
            record.gradient = tally.gradient.and_then(finite);
            record.gradient_off_contact = tally.off_contact.and_then(finite);
            record.gradient_bound = tally.bound;
            record.contacts = left.as_ref().map_or(0, |left| pressing(&left.contacts, &after.x));
            record.status = status.as_str().to_string();
            record.reason = reason;
            record.seconds = began.elapsed().as_secs_f64();
            if is_whole && status != Status::Failed {
                *state = after;
                *last = left;
            }
            Ok(record)
        })
    }

    /// The frame as it stands: frame 0 before the first [`Self::advance`].
    pub fn start_record(&mut self) -> FrameRecord {
        let Simulation { scene, world, engine, state, pool, .. } = self;
        let mut record = pool.install(|| measure(scene, world, engine, state));
        record.status = "start".to_string();
        record
    }

    /// Each body as it stands, with displacement, velocity, stress, contact and reaction forces.
    ///
    /// # Errors
    /// Energies that cannot be evaluated.
    pub fn frame(&self, record: FrameRecord) -> Result<Frame, SimulateError> {
        let time = self.time();
        let (contact, reaction) = match &self.last {
            Some(last) => (contact_forces(&self.world, &last.contacts, &self.state.x), &last.reaction[..]),
            None => (Vec::new(), &[][..]),
        };
        let bodies = (0..self.world.bodies.len())
            .map(|b| {
                let forces = contact.get(b).map_or(&[][..], |c| &c[..]);
                picture::body(&self.world, b, &self.state, time, forces, reaction)
            })
            .collect::<Result<_, _>>()?;
        Ok(Frame { record, bodies })
    }

    /// The surfaces of obstacles as they stand, for pictures; those without an end are cut off around the bodies.
    pub fn scenery(&self) -> Vec<Model> {
        scenery::models(&self.world, self.time())
    }

    /// A picture of bodies and obstacles.
    pub fn preview(&self) -> Image {
        let (world, x, time) = (&self.world, &self.state.x, self.time());
        self.pool.install(|| picture::image(world, x, time))
    }

    fn time(&self) -> f64 {
        self.state.frame as f64 * self.scene.time.dt
    }
}

/// The stiffness of inertia over mass: (1 + a t) / t^2.
fn stiffness(tau: f64, damping: f64) -> f64 {
    (1.0 + damping * tau) / (tau * tau)
}

/// Takes steps of a frame.
struct Stepper<'a> {
    scene: &'a Scene,
    world: &'a World,
    engine: &'a mut Engine,
    state: State,
    last: Option<Last>,
}

impl Stepper<'_> {
    /// A step from time to time, of length h; in halves where it does not converge and that is wanted.
    fn step(
        &mut self,
        (from, to, h): (f64, f64, f64),
        depth: usize,
        stops: &mut Stops<'_>,
        tally: &mut Tally,
    ) -> Result<(), SimulateError> {
        let before = (self.scene.time.adaptive && depth < HALVINGS).then(|| self.state.clone());
        let solved = self.solve((from, to, h), stops)?;
        tally.iterations += solved.iterations;
        tally.rejected += solved.rejected;
        if let Some(before) = before.filter(|_| solved.status != Status::Converged && !stops.is_over()) {
            self.state = before;
            let middle = from + h / 2.0;
            self.step((from, middle, h / 2.0), depth + 1, stops, tally)?;
            return self.step((middle, to, h / 2.0), depth + 1, stops, tally);
        }
        tally.steps += 1;
        let (mut status, mut reason) = (solved.status, solved.reason);
        let walls = Walls::new(self.world, from, to);
        for touching in [&self.world.touching, &self.world.held] {
            let (depth, k, wall) = walls.deepest(touching, &self.state.x);
            let Some((b, v)) = touching.who.get(k) else { continue };
            let body = &self.world.bodies[*b];
            let outside = depth <= VIOLATION * body.size;
            if status == Status::Converged && !outside {
                status = Status::Stopped;
                let (name, wall) = (&body.mesh.name, &self.world.obstacles[wall].name);
                reason = format!("vertex {v} (0-based) of `{name}` is {depth:.3e} m inside of obstacle `{wall}`");
            }
        }
        tally.note(status, &reason);
        tally.residuals = solved.residuals.map(|SquaredResiduals { forward, combined }| {
            let of = |square| normalized(square, solved.local_dim, self.engine.mean_edge());
            (of(forward), of(combined))
        });
        tally.gradient = solved.gradient;
        tally.off_contact = solved.gradient.map(|_| self.engine.gradient_off_contact(&self.state.x, &solved.contacts));
        tally.bound = solved.bound;
        Ok(())
    }

    /// Solves one step and moves the state there.
    fn solve(&mut self, (from, to, h): (f64, f64, f64), stops: &mut Stops<'_>) -> Result<Solved, SimulateError> {
        let (world, scene) = (self.world, self.scene);
        let n = 3 * world.n_free;
        let State { x, v, before, known, stresses, .. } = &self.state;
        // With w the ratio of this step to the last: x' = a x - b x_before + beta h v'; w = 0 is implicit Euler.
        let two_step = before.as_ref().filter(|_| scene.time.integrator == Integrator::Bdf2);
        let w = two_step.map_or(0.0, |(_, _, last)| h / last);
        let (b, beta) = (w * w / (1.0 + 2.0 * w), (1.0 + w) / (1.0 + 2.0 * w));
        let tau = beta * h;
        let back = |now: &[f64], before: Option<&Vec<f64>>| -> Vec<f64> {
            match before {
                // a x - b x_before with a = 1 + b.
                Some(before) => now.iter().zip(before).map(|(x, y)| x + b * (x - y)).collect(),
                None => now.to_vec(),
            }
        };
        let anchor = back(&x[..n], two_step.map(|t| &t.0));
        let drift = back(&v[..n], two_step.map(|t| &t.1));
        let push = accelerations(world, &scene.forces, x, v, tau);
        let damping = scene.damping.mass;
        let target: Vec<f64> = (0..n)
            .map(|i| anchor[i] + (tau * drift[i] + tau * tau * push[i / 3][i % 3]) / (1.0 + damping * tau))
            .collect();
        let mut start = x.clone();
        world.move_held(to, &mut start).map_err(SimulateError::new)?;
        let walls = Walls::new(world, from, to);
        let stiff = match scene.damping.stiffness > 0.0 {
            true => Some(stiffness_damping(world, self.engine, scene.damping.stiffness, (x, &start), &anchor, tau)),
            false => None,
        };
        let task = Task {
            x: &start,
            target: &target,
            inertia: stiffness(tau, damping),
            damping: stiff,
            walls: &walls,
            known,
            stresses,
        };
        let mut solved = self.engine.solve(world, &task, stops)?;
        self.center(&mut solved, &target);
        // Held nodes are where they are, free ones have the velocity of the integrator.
        let mut velocity: Vec<f64> = (0..x.len()).map(|i| (solved.x[i] - x[i]) / h).collect();
        (0..n).for_each(|i| velocity[i] = (solved.x[i] - anchor[i]) / tau);
        let reaction = self.reaction(&solved.x);
        let State { x, v, before, known, stresses, .. } = &mut self.state;
        if scene.time.integrator == Integrator::Bdf2 {
            *before = Some((std::mem::take(x), std::mem::take(v), h));
        }
        *x = std::mem::take(&mut solved.x);
        *v = velocity;
        *known = std::mem::take(&mut solved.known);
        *stresses = std::mem::take(&mut solved.stresses);
        self.last = Some(Last { contacts: solved.contacts.clone(), reaction });
        Ok(solved)
    }

    /// Moves each part that nothing holds or touches to where the objective is least along translations: that of its centre
    /// of mass, since elastic forces add up to zero. What a minimiser leaves undone, or rounding, then changes no momentum.
    fn center(&self, solved: &mut Solved, target: &[f64]) {
        let world = self.world;
        if self.engine.has_wall_term() {
            return;
        }
        let mut touched = vec![false; world.n()];
        for touch in solved.contacts.touches() {
            let nodes = solved.contacts.points().parts(touch.point as usize).0;
            // Friction binds too.
            let bears = touch.grip > 0.0 || solved.contacts.pressure(touch, &solved.x) > 0.0;
            nodes.iter().for_each(|n| touched[*n as usize] |= bears);
        }
        for part in world.floating.iter().filter(|part| part.iter().all(|n| !touched[*n as usize])) {
            let mass: f64 = part.iter().map(|n| world.mass[*n as usize]).sum();
            let gap = |d: usize| {
                let moment = part.iter().map(|n| {
                    let i = 3 * *n as usize + d;
                    world.mass[*n as usize] * (target[i] - solved.x[i])
                });
                moment.sum::<f64>() / mass
            };
            let shift: V3 = [gap(0), gap(1), gap(2)];
            for n in part {
                (0..3).for_each(|d| solved.x[3 * *n as usize + d] += shift[d]);
            }
        }
    }

    /// What bodies exert on what holds them: elastic forces and their weight.
    fn reaction(&mut self, x: &[f64]) -> Vec<f64> {
        let world = self.world;
        let mut grad = elastic(world, self.engine, x).1;
        self.engine.add_forces_of_limits(x, &mut grad);
        grad[..3 * world.n_free].fill(0.0);
        for i in world.n_free..world.n() {
            for d in 0..3 {
                let weight = world.mass[i] * self.scene.forces.gravity[d];
                grad[3 * i + d] = weight - grad[3 * i + d];
            }
        }
        grad
    }
}

/// beta / tau, what velocities are measured from, and -beta K v of held nodes alone, on free ones: the elastic force
/// differentiated along their motion, from x to where they are at the end of the step.
fn stiffness_damping(
    world: &World,
    engine: &mut Engine,
    beta: f64,
    (x, end): (&[f64], &[f64]),
    anchor: &[f64],
    tau: f64,
) -> (f64, Vec<f64>, Vec<f64>) {
    /// Part of the size of the bodies that positions are moved by to differentiate.
    const NEARBY: f64 = 1e-7;
    let n = 3 * world.n_free;
    let mut loads = vec![0.0; x.len()];
    let moved: Vec<f64> = (n..x.len()).map(|i| end[i] - x[i]).collect();
    let farthest = moved.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
    if farthest > 0.0 {
        let t = NEARBY * proxel_split::vector::extent(x, 3) / farthest;
        let mut near = x.to_vec();
        near[n..].iter_mut().zip(&moved).for_each(|(x, d)| *x += t * d);
        let (there, here) = (elastic(world, engine, &near).1, elastic(world, engine, x).1);
        (0..n).for_each(|i| loads[i] = -beta / tau * (there[i] - here[i]) / t);
    }
    (beta / tau, anchor.to_vec(), loads)
}
