//! `proxel.Deformer`.

use crate::arrays::{numbers, rows, table};
use crate::deform::{BodyInput, Targets};
use crate::drive::{Cancel, Listener, drive, hooked};
use crate::error::{InputError, refused};
use crate::exclusive::Exclusive;
use crate::gradients::{Kept, Pose, pinned};
use crate::outcome::Outcome;
use crate::settings::{self, given};
use numpy::PyReadonlyArray2;
use proxel::deform::{DeformInput, Deformation, Deformer as Live, Frame};
use proxel::pins::RigidMotion;
use proxel::report::{Report, Seconds};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A body that is built once and then follows its handles: [`proxel::deform::Deformer`].
#[pyclass(frozen, module = "proxel._core")]
pub struct Deformer {
    live: Exclusive<Live>,
    body: Arc<DeformInput>, // as given
    warnings: Vec<String>,
}

#[pymethods]
impl Deformer {
    #[new]
    fn new(
        py: Python<'_>,
        points: PyReadonlyArray2<'_, f64>,
        input: BodyInput<'_>,
        keywords: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let settings = settings::deform(given(keywords)?)?;
        let (input, warnings) = input.input(&points)?;
        let live = drive(py, &Listener::default(), |_| Live::new(&input, &settings))?.map_err(refused)?;
        Ok(Deformer { live: Exclusive::new("Deformer", live), body: Arc::new(input), warnings })
    }

    /// Sends pinned vertices, and ends of springs, elsewhere.
    fn update_handles(&self, py: Python<'_>, targets: Targets<'_>) -> PyResult<()> {
        let (vertices, places) = (numbers(&targets.0)?, rows(&targets.1)?);
        let targets: Vec<(u32, [f64; 3])> = vertices.into_iter().zip(places).collect();
        let live = &mut *self.live.take()?;
        py.detach(|| live.set_targets(&targets)).map_err(refused)
    }

    /// Turns and then moves a group from where it was when the body was built.
    fn move_group(
        &self,
        name: &str,
        rotation: Option<([f64; 3], f64, [f64; 3])>,
        translation: Option<[f64; 3]>,
    ) -> PyResult<()> {
        let mut motion = RigidMotion::identity();
        if let Some((axis, degrees, center)) = rotation {
            let length = axis.iter().map(|a| a * a).sum::<f64>();
            if !(length > 0.0 && length.is_finite() && degrees.is_finite()) {
                let text = format!("an axis {axis:?} and an angle of {degrees} degrees turn nothing; give finite ones");
                return Err(InputError::new_err(text));
            }
            motion = RigidMotion::rotation(axis, degrees, center);
        }
        if let Some(t) = translation {
            motion = motion.then(RigidMotion::translation(t));
        }
        self.live.take()?.move_group(name, &motion).map_err(refused)
    }

    /// Goes on towards the minimum: positions, and what is known of the step.
    #[pyo3(signature = (time_limit, callback, cancel))]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        time_limit: Option<f64>,
        callback: Option<Bound<'py, PyAny>>,
        cancel: Option<Py<Cancel>>,
    ) -> PyResult<(Bound<'py, PyAny>, Outcome)> {
        let budget = time_limit.map(Duration::try_from_secs_f64).transpose();
        let budget = budget.map_err(|e| InputError::new_err(format!("time_limit: {e}; give seconds from 0")))?;
        let began = Instant::now();
        let live = &mut *self.live.take()?;
        let (frame, _) = hooked(py, &Listener { callback, cancel }, false, |hooks| live.step(budget, hooks))?;
        let frame = frame.map_err(refused)?;
        let mut report = self.report(live, &frame, began.elapsed().as_secs_f64());
        let positions = table(py, frame.positions.clone())?;
        let arrays = PyDict::new(py);
        arrays.set_item("pins", pinned(py, &self.body))?;
        let kept = self.keep(live, frame, &report);
        Ok((positions, Outcome::new(&mut report, &arrays, None)?.keeping(kept)))
    }

    /// The pose that the last step with any time ended at.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        table(py, self.live.take()?.positions())
    }
}

impl Deformer {
    /// What gradients need of a pose.
    fn keep(&self, live: &Live, frame: Frame, report: &Report) -> Kept {
        if live.is_carried() {
            return Kept::Not(
                "a surface that a lattice carries; give its tetrahedra, or deform it as a sheet (surface=\"shell\")",
            );
        }
        let result = Deformation {
            positions: frame.positions,
            start: Vec::new(),
            status: frame.status,
            report: report.clone(),
            repaired_tets: live.repaired_tets(),
            reaction: Vec::new(),
            carried: None,
        };
        let (input, settings) = (live.input(), live.settings().clone());
        let pose = Pose { fixed: input.fixed.clone(), soft: input.soft.clone(), settings, result };
        Kept::Pose(self.body.clone(), Box::new(pose))
    }

    fn report(&self, live: &Live, frame: &Frame, seconds: f64) -> Report {
        let settings = live.settings();
        let finite = |v: f64| Some(v).filter(|v| v.is_finite());
        Report {
            version: env!("CARGO_PKG_VERSION").to_string(),
            command: "deform".to_string(),
            settings: serde_json::to_value(settings).unwrap_or_default(),
            method: settings.method.as_str().to_string(),
            status: frame.status.as_str().to_string(),
            reason: frame.reason.clone(),
            iterations: frame.iterations,
            inner_iterations: frame.inner_iterations,
            refactorisations: frame.refactorisations,
            energy: finite(frame.energy),
            gradient_norm: frame.gradient_norm,
            gradient_ratio: frame.gradient_ratio,
            inverted: Some(frame.inverted),
            min_stretch: finite(frame.min_stretch),
            max_stretch: finite(frame.max_stretch),
            warnings: self.warnings.iter().chain(&frame.warnings).cloned().collect(),
            repaired: live.repaired().to_vec(),
            seconds: Seconds { solve: seconds, ..Seconds::default() },
            threads: live.threads(),
            ..Report::default()
        }
    }
}
