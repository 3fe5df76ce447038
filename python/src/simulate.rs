//! `proxel.Simulator`.

use crate::arrays::{column, table};
use crate::drive::{Cancel, Listener, Progress, drive};
use crate::error::{InputError, SolveError, refused};
use crate::exclusive::Exclusive;
use crate::outcome::{Draw, Outcome};
use crate::settings::{Given, given, to_value};
use numpy::{PyArray1, PyArrayMethods};
use proxel::mesh::{Fields, Mesh};
use proxel::report::Seconds;
use proxel::simulate::{FrameRecord, Hooks, Scene, SceneFile, Simulation};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;
use std::path::PathBuf;
use std::time::Instant;

/// Bodies in motion among obstacles: [`proxel::simulate::Simulation`].
#[pyclass(frozen, module = "proxel._core")]
pub struct Simulator {
    moving: Exclusive<Moving>,
    began: Instant,
    setup: f64,
}

/// What changes from frame to frame.
struct Moving {
    simulation: Simulation,
    records: Vec<FrameRecord>,
}

/// The settings of a scene that a caller may give beside it, as on the command line.
fn change(scene: &mut Scene, given: Given) -> PyResult<()> {
    let bad = |name: &str, e: serde_json::Error| InputError::new_err(format!("setting `{name}`: {e}"));
    for (name, value) in given {
        let e = |e| bad(&name, e);
        match name.as_str() {
            "frames" => scene.time.frames = serde_json::from_value(value).map_err(e)?,
            "max_iters" => scene.solver.max_iters = serde_json::from_value(value).map_err(e)?,
            "tol" => scene.solver.tol = serde_json::from_value(value).map_err(e)?,
            "method" => scene.solver.method = serde_json::from_value(value).map_err(e)?,
            other => {
                let known = "frames, max_iters, method, threads, time_limit, tol";
                let text = format!("there is no setting `{other}` beside a scene; known are {known}");
                return Err(InputError::new_err(text));
            }
        }
    }
    Ok(())
}

fn read(scene: &Bound<'_, PyAny>, mut keywords: Given) -> PyResult<(SceneFile, Option<usize>)> {
    let mut file = match scene.extract::<PathBuf>() {
        Ok(path) => SceneFile::read(&path).map_err(refused)?,
        Err(_) => {
            let scene = to_value(scene, "scene")?;
            let Value::Object(_) = &scene else {
                return Err(InputError::new_err(
                    "the scene is no dict; give a dict, or the path of a .toml or .json file",
                ));
            };
            SceneFile::parse("the scene".to_string(), scene.to_string(), true, PathBuf::new()).map_err(refused)?
        }
    };
    let threads = match keywords.remove("threads") {
        None | Some(Value::Null) => None,
        Some(n) => match n.as_u64().and_then(|n| usize::try_from(n).ok()).filter(|n| *n > 0) {
            Some(n) => Some(n),
            None => return Err(InputError::new_err(format!("setting `threads`: it is {n}; give at least 1"))),
        },
    };
    let mut end = Ok(());
    file.change(|scene| end = change(scene, keywords)).map_err(refused)?;
    end.map(|()| (file, threads))
}

#[pymethods]
impl Simulator {
    #[new]
    fn new(py: Python<'_>, scene: &Bound<'_, PyAny>, keywords: &Bound<'_, PyDict>) -> PyResult<Self> {
        let began = Instant::now();
        let (file, threads) = read(scene, given(keywords)?)?;
        let simulation = drive(py, &Listener::default(), |_| Simulation::new(&file, threads))?.map_err(refused)?;
        let moving = Exclusive::new("Simulator", Moving { simulation, records: Vec::new() });
        Ok(Simulator { moving, began, setup: began.elapsed().as_secs_f64() })
    }

    /// Frames done, the start aside.
    #[getter]
    fn frame_count(&self) -> PyResult<usize> {
        Ok(self.moving.take()?.simulation.frame_count())
    }

    /// Frames that the scene asks for.
    #[getter]
    fn frames(&self) -> PyResult<usize> {
        Ok(self.moving.take()?.simulation.scene().time.frames)
    }

    /// The record of the frame as it stands, as JSON.
    fn start_record(&self) -> PyResult<String> {
        text(&self.moving.take()?.simulation.start_record())
    }

    /// The next frame: its record as JSON, whether it was done (one that is cancelled changes nothing), and each body as
    /// it stands then.
    #[pyo3(signature = (time_limit, callback, cancel))]
    fn advance<'py>(
        &self,
        py: Python<'py>,
        time_limit: Option<f64>,
        callback: Option<Bound<'py, PyAny>>,
        cancel: Option<Py<Cancel>>,
    ) -> PyResult<(String, bool, Vec<Bound<'py, PyDict>>)> {
        let Moving { simulation, records } = &mut *self.moving.take()?;
        let before = simulation.frame_count();
        let began = Instant::now();
        let record = drive(py, &Listener { callback, cancel }, |link| {
            let mut on_progress = |p: &proxel::simulate::Progress| {
                let seconds = began.elapsed().as_secs_f64();
                let progress = Progress { frame: p.frame, iteration: p.iterations, seconds, ..Progress::default() };
                link.tell(Progress { energy: f64::NAN, ..progress });
            };
            let mut hooks = Hooks { cancel: link.cancel.clone(), ..Hooks::default() };
            hooks.time_limit = time_limit.map(|limit| (began, limit));
            if link.is_heard() {
                hooks.progress = Some(&mut on_progress);
            }
            simulation.advance(&mut hooks)
        })?;
        // A scene that was read and built: what goes wrong now is the run.
        let record = record.map_err(|e| SolveError::new_err(e.to_string()))?;
        let done = simulation.frame_count() > before;
        let out = text(&record)?;
        if done {
            records.push(record);
        }
        Ok((out, done, bodies(py, simulation)?))
    }

    /// Each body as it stands: name, positions, fields over vertices, fields over elements.
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        bodies(py, &self.moving.take()?.simulation)
    }

    /// The report of the frames so far.
    fn outcome(&self, py: Python<'_>, status: &str, reason: &str) -> PyResult<Outcome> {
        let solve = (self.began.elapsed().as_secs_f64() - self.setup).max(0.0);
        let seconds = Seconds { setup: self.setup, solve, ..Seconds::default() };
        let Moving { simulation, records } = &mut *self.moving.take()?;
        let mut report = simulation.report(records, (status, reason), seconds);
        let image = simulation.preview();
        let draw: Draw = Box::new(move || Ok(image.clone()));
        Outcome::new(&mut report, &PyDict::new(py), Some(draw))
    }
}

fn text(record: &FrameRecord) -> PyResult<String> {
    serde_json::to_string(record).map_err(refused)
}

fn bodies<'py>(py: Python<'py>, simulation: &Simulation) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let frame = simulation.frame(FrameRecord::default()).map_err(refused)?;
    frame.bodies.into_iter().map(|(name, mesh, fields)| body(py, &name, mesh, fields)).collect()
}

fn body<'py>(py: Python<'py>, name: &str, mesh: Mesh, fields: Fields) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("name", name)?;
    out.set_item("positions", table(py, mesh.points)?)?;
    for (key, list) in [("point", fields.point), ("cell", fields.cell)] {
        let of = PyDict::new(py);
        for field in list {
            let rows = field.data.len() / field.components.max(1);
            let array = match field.components {
                1 => column(py, field.data),
                c => PyArray1::from_vec(py, field.data).reshape([rows, c])?.into_any(),
            };
            of.set_item(field.name, array)?;
        }
        out.set_item(key, of)?;
    }
    Ok(out)
}
