//! `proxel.Unwrapper`.

use crate::arrays::{self, Faces, rows};
use crate::drive::{Cancel, Listener, Progress, drive, pooled};
use crate::error::{InputError, SolveError, refused};
use crate::exclusive::Exclusive;
use crate::gradients::Kept;
use crate::outcome::{Draw, Outcome};
use crate::settings::{given, merged};
use crate::unwrap::{MapInput, Pins, pins};
use numpy::PyReadonlyArray2;
use proxel::mesh::Mesh;
use proxel::mesh::uv::{CertificateOptions, certify};
use proxel::report::{MapReport, Report, Seconds};
use proxel::settings::UnwrapSettings;
use proxel::split::Status;
use proxel::unwrap::{MapPictures, Standing, Unwrapped, Unwrapper as Live};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// A map in the making: [`proxel::unwrap::Unwrapper`].
#[pyclass(frozen, module = "proxel._core")]
pub struct Unwrapper {
    live: Exclusive<Live>,
    mesh: Mesh,
    settings: UnwrapSettings,
}

/// How a run of steps ended.
struct Ended {
    status: Status,
    reason: String,
    standing: Standing,
}

#[pymethods]
impl Unwrapper {
    #[new]
    fn new(
        py: Python<'_>,
        points: PyReadonlyArray2<'_, f64>,
        faces: Faces<'_>,
        input: MapInput<'_>,
        keywords: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let settings: UnwrapSettings = merged(&UnwrapSettings::default(), given(keywords)?)?;
        let input = input.input(&points, &faces)?;
        let mesh = input.mesh.clone();
        let made = drive(py, &Listener::default(), |_| Live::new(input, settings.clone()))?;
        let live = Exclusive::new("Unwrapper", made.map_err(refused)?);
        Ok(Unwrapper { live, mesh, settings })
    }

    /// Holds these vertices, and no others.
    fn update_handles(&self, py: Python<'_>, held: Pins<'_>) -> PyResult<()> {
        let held = pins(&held)?;
        let live = &mut *self.live.take()?;
        py.detach(|| live.set_pins(held)).map_err(refused)
    }

    /// Cuts the surface along these edges, and no others.
    fn update_seams(&self, py: Python<'_>, seams: PyReadonlyArray2<'_, u32>) -> PyResult<()> {
        let seams = rows(&seams)?;
        let live = &mut *self.live.take()?;
        py.detach(|| live.set_seams(seams)).map_err(refused)
    }

    /// One iteration of every chart that has not converged: iteration, energy, flips, charts that are open.
    fn step(&self, py: Python<'_>) -> PyResult<(usize, f64, u64, usize)> {
        let live = &mut *self.live.take()?;
        let Standing { iteration, energy, flips, open } =
            drive(py, &Listener::default(), |_| live.step())?.map_err(|e| SolveError::new_err(e.to_string()))?;
        Ok((iteration, energy, flips, open))
    }

    /// Steps until all charts have converged: coordinates, the coordinate of each corner, and what is known of the run.
    #[pyo3(signature = (time_limit, callback, cancel))]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        time_limit: Option<f64>,
        callback: Option<Bound<'py, PyAny>>,
        cancel: Option<Py<Cancel>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Outcome)> {
        let limit = time_limit.or(self.settings.time_limit);
        if let Some(limit) = limit.filter(|t| t.is_nan() || *t < 0.0) {
            return Err(InputError::new_err(format!("time_limit is {limit}; give seconds from 0")));
        }
        let began = Instant::now();
        let Unwrapper { live, mesh, settings } = self;
        let live = &mut *live.take()?;
        let from = live.standing().iteration;
        let ended = drive(py, &Listener { callback, cancel }, |link| run(live, link, limit, began))?;
        let ended = ended.map_err(|e| SolveError::new_err(e.to_string()))?;
        let (uv, density) = live.placed().map_err(refused)?;
        let mut result = Unwrapped {
            uv,
            status: ended.status,
            report: report(settings, &ended, (from, density), live, began.elapsed().as_secs_f64()),
            rows: Vec::new(),
            charts: live.charts().clone(),
        };
        let options = CertificateOptions { reversed_faces: result.charts.reversed_faces.clone() };
        let uv = &result.uv;
        let certify = || certify(&mesh.points, &mesh.faces, uv, &options).map_err(|e| e.to_string());
        let found = py.detach(|| pooled(settings.threads, certify)).map_err(refused)?;
        result.certified(&found, mesh);
        let (uv, corners, shared) = arrays::map(py, mesh, &result.uv)?;
        let mut report = result.report.clone();
        // As they are now: pins and seams may change.
        let kept = Arc::new((live.input().clone(), settings.clone(), result));
        let drawn = kept.clone();
        let draw: Draw = Box::new(move || Ok(MapPictures::new(&drawn.0.mesh, &drawn.2.uv, density.is_some()).map()));
        let outcome = Outcome::new(&mut report, &PyDict::new(py), Some(draw))?;
        Ok((uv, corners, outcome.keeping(Kept::Map(kept, shared))))
    }

    /// The map as it is.
    fn map<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (uv, corners, _) = arrays::map(py, &self.mesh, &self.live.take()?.map().map_err(refused)?)?;
        Ok((uv, corners))
    }
}

fn run(
    live: &mut Live,
    link: &crate::drive::Link,
    limit: Option<f64>,
    began: Instant,
) -> Result<Ended, proxel::unwrap::UnwrapError> {
    let mut late = false;
    let status = live.run(&mut |s: &Standing| {
        let seconds = began.elapsed().as_secs_f64();
        let progress = Progress { iteration: s.iteration, seconds, energy: s.energy, inverted: s.flips, frame: 0 };
        link.tell(progress);
        late = limit.is_some_and(|limit| seconds >= limit);
        !late && !link.cancel.load(Ordering::Relaxed)
    })?;
    let standing = live.standing();
    let (status, reason) = match status {
        // The last step may have been the one that converged.
        _ if standing.open == 0 => (Status::Converged, "all charts converged".to_string()),
        Status::Cancelled if late => (Status::Stopped, format!("{} seconds are over", limit.unwrap_or_default())),
        Status::Cancelled => (Status::Cancelled, "cancelled by the user".to_string()),
        status => (status, format!("{} charts have not converged", standing.open)),
    };
    Ok(Ended { status, reason, standing })
}

/// Of the steps after those that there were, and with the density of what was packed.
fn report(
    settings: &UnwrapSettings,
    ended: &Ended,
    (from, density): (usize, Option<f64>),
    live: &Live,
    seconds: f64,
) -> Report {
    let charts = live.charts();
    Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: "unwrap".to_string(),
        settings: serde_json::to_value(settings).unwrap_or_default(),
        method: settings.method.as_str().to_string(),
        status: ended.status.as_str().to_string(),
        reason: ended.reason.clone(),
        iterations: ended.standing.iteration.saturating_sub(from),
        warnings: charts.warnings.clone(),
        repaired: charts.repairs.clone(),
        seconds: Seconds { solve: seconds, ..Seconds::default() },
        map: Some(MapReport { reversed_faces: charts.reversed_faces.len(), density, ..MapReport::default() }),
        ..Report::default()
    }
}
