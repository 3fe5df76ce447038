//! The same step by the methods of `simulate`.

use super::{DT, GRAVITY, Moving, Walls};
use crate::BenchError;
use proxel::mesh::{Fields, write_mesh};
use proxel::model::elements::BatchShape;
use proxel::report::TraceRow;
use proxel::simulate::{BodyState, FrameRecord, Hooks, SceneFile, Simulation};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The scene of a body in motion, wind aside: a step begins with velocities that have it already.
pub struct Scene {
    text: String,
    folder: PathBuf,
}

/// How a step ended.
pub struct Ended {
    /// Of the frame.
    pub record: FrameRecord,
    /// A row an iteration.
    pub trace: Vec<TraceRow>,
    /// Positions, in the solver's order of [`Moving`].
    pub x: Vec<f64>,
}

impl Scene {
    /// The body at rest is written into the folder, so that rounding of its vertices is the same.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn new(moving: &Moving, folder: &Path, name: &str) -> Result<Self, BenchError> {
        let body = &moving.body;
        let file = format!("{name}-body.vtu");
        write_mesh(&folder.join(&file), &body.mesh, &Fields::none()).map_err(BenchError::from_display)?;
        let (young, poisson) = body.moduli;
        let mut text = format!(
            "[time]\ndt = {DT:?}\nframes = 1000000\n[forces]\ngravity = [0, {GRAVITY:?}, 0]\n\
             [[body]]\nname = \"body\"\nmesh = {file:?}\ndensity = {:?}\n\
             material = {{ energy = \"corotated\", young = {young:?}, poisson = {poisson:?} }}\n",
            body.density
        );
        if body.shape == BatchShape::Triangles {
            text.push_str("model = \"shell\"\n");
        }
        if let Some((low, high)) = body.limits {
            let _ = writeln!(text, "strain_limit = [{low:?}, {high:?}]");
        }
        if !body.pins.is_empty() {
            let _ = writeln!(text, "[[body.pin]]\nindices = {:?}", body.pins);
        }
        let mut obstacle = |shape: &str| {
            let _ = writeln!(text, "[[obstacle]]\nshape = {{ {shape} }}");
        };
        match &body.walls {
            Some(Walls::Pit { floor, radius }) => {
                obstacle(&format!("pit = {{ center = [0, {floor:?}, 0], normal = [0, 1, 0], radius = {radius:?} }}"))
            }
            Some(Walls::Cylinders { centers, radius, slope: (point, normal) }) => {
                for [x, y] in centers {
                    obstacle(&format!(
                        "cylinder = {{ center = [{x:?}, {y:?}, 0], axis = [0, 0, 1], radius = {radius:?} }}"
                    ));
                }
                obstacle(&format!("half-space = {{ point = {point:?}, normal = {normal:?} }}"));
            }
            None => {}
        }
        Ok(Scene { text, folder: folder.to_path_buf() })
    }

    /// The scene, solved by a method.
    ///
    /// # Errors
    /// A scene that cannot be simulated.
    pub fn simulation(
        &self,
        method: &str,
        max_iters: usize,
        tol: f64,
        threads: Option<usize>,
    ) -> Result<Simulation, BenchError> {
        let solver = format!("[solver]\nmethod = {method:?}\nmax_iters = {max_iters}\ntol = {tol:e}\n");
        let text = format!("{solver}{}", self.text);
        let file = SceneFile::parse("the scene".to_string(), text, false, self.folder.clone())
            .map_err(BenchError::from_display)?;
        Simulation::new(&file, threads).map_err(BenchError::from_display)
    }

    /// The step that comes next in a motion.
    ///
    /// # Errors
    /// A scene that cannot be simulated.
    pub fn step(
        &self,
        moving: &Moving,
        method: &str,
        (max_iters, tol): (usize, f64),
        threads: Option<usize>,
    ) -> Result<Ended, BenchError> {
        let mut simulation = self.simulation(method, max_iters, tol, threads)?;
        let (positions, velocities) = moving.state();
        let state = BodyState { positions, velocities };
        simulation.place(moving.frames(), &[state]).map_err(BenchError::from_display)?;
        let mut trace = Vec::new();
        let mut keep = |_: usize, _: usize, row: &TraceRow| {
            if row.iteration > 0 {
                trace.push(*row);
            }
        };
        let mut hooks = Hooks { trace: Some(&mut keep), ..Hooks::default() };
        let record = simulation.advance(&mut hooks).map_err(BenchError::from_display)?;
        let frame = simulation.frame(record.clone()).map_err(BenchError::from_display)?;
        let x = match frame.bodies.first() {
            Some((_, mesh, _)) => moving.flat(&mesh.points),
            None => Vec::new(),
        };
        Ok(Ended { record, trace, x })
    }
}
