//! What is known of a run that is over.

use crate::arrays::column;
use crate::drive::pooled;
use crate::error::{InputError, SolveError, refused};
use crate::gradients::Kept;
use numpy::PyReadonlyArray2;
use proxel::preview::Image;
use proxel::report::{Report, TraceRow, peak_bytes};
use proxel::unwrap::MapRow;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Draws the picture of a result.
pub type Draw = Box<dyn Fn() -> Result<Image, String> + Send + Sync>;

/// The report of a run as JSON, its trace, arrays beside the result, and its picture.
#[pyclass(frozen, module = "proxel")]
pub struct Outcome {
    #[pyo3(get)]
    report: String,
    #[pyo3(get)]
    trace: Option<Py<PyDict>>,
    #[pyo3(get)]
    arrays: Py<PyDict>,
    draw: Option<Draw>,
    kept: Option<Kept>,
}

#[pymethods]
impl Outcome {
    /// Writes the picture of the result as PNG.
    fn save_preview(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let Some(draw) = &self.draw else {
            return Err(InputError::new_err("there is no picture of this result"));
        };
        if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
            let text = format!("{}: pictures are PNG files; give a name that ends in .png", path.display());
            return Err(InputError::new_err(text));
        }
        let written = py.detach(|| pooled(None, || draw()?.write_png(&path).map_err(|e| e.to_string())));
        written.map_err(refused)
    }

    /// The gradients of a function of the result from its own there.
    fn adjoint<'py>(&self, py: Python<'py>, slope: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyDict>> {
        match &self.kept {
            Some(kept) => kept.gradients(py, &slope),
            None => Err(InputError::new_err("there are gradients of the results of deform and unwrap only")),
        }
    }
}

impl Outcome {
    /// Of a report, with the largest memory of the process so far.
    pub fn new(report: &mut Report, arrays: &Bound<'_, PyDict>, draw: Option<Draw>) -> PyResult<Self> {
        report.peak_bytes = peak_bytes();
        let arrays = arrays.clone().unbind();
        let report = serde_json::to_string(report).map_err(|e| SolveError::new_err(e.to_string()))?;
        Ok(Outcome { report, trace: None, arrays, draw, kept: None })
    }

    /// With the rows of a trace.
    pub fn traced(mut self, trace: Option<Bound<'_, PyDict>>) -> Self {
        self.trace = trace.map(Bound::unbind);
        self
    }

    /// With the run itself.
    pub fn keeping(mut self, kept: Kept) -> Self {
        self.kept = Some(kept);
        self
    }
}

/// The columns of a trace.
pub fn trace<'py>(py: Python<'py>, rows: &[TraceRow]) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    let real = |name: &str, of: fn(&TraceRow) -> f64| columns.set_item(name, column(py, rows.iter().map(of).collect()));
    let count =
        |name: &str, of: fn(&TraceRow) -> i64| columns.set_item(name, column(py, rows.iter().map(of).collect()));
    let flag =
        |name: &str, of: fn(&TraceRow) -> bool| columns.set_item(name, column(py, rows.iter().map(of).collect()));
    count("iteration", |r| r.iteration as i64)?;
    real("seconds", |r| r.seconds)?;
    real("energy", |r| r.energy)?;
    real("gradient_norm", |r| r.gradient_norm)?;
    real("position_error", |r| r.position_error)?;
    real("primal_residual", |r| r.primal_residual)?;
    real("dual_residual", |r| r.dual_residual)?;
    real("merit", |r| r.merit)?;
    count("inner", |r| r.inner as i64)?;
    flag("refactorised", |r| r.refactorised)?;
    flag("accepted", |r| r.accepted)?;
    count("inverted", |r| r.inverted as i64)?;
    Ok(columns)
}

/// The columns of the trace of a map: those of any, and `flips` and `energy_z`.
pub fn map_trace<'py>(py: Python<'py>, rows: &[MapRow]) -> PyResult<Bound<'py, PyDict>> {
    let plain: Vec<TraceRow> = rows.iter().map(plain).collect();
    let columns = trace(py, &plain)?;
    columns.set_item("flips", column(py, rows.iter().map(|r| r.flips as i64).collect()))?;
    columns.set_item("energy_z", column(py, rows.iter().map(|r| r.energy_z).collect()))?;
    Ok(columns)
}

fn plain(r: &MapRow) -> TraceRow {
    TraceRow {
        iteration: r.iteration,
        seconds: r.seconds,
        energy: r.energy,
        gradient_norm: r.gradient_norm,
        position_error: f64::INFINITY,
        primal_residual: r.primal_residual,
        dual_residual: r.dual_residual,
        merit: f64::INFINITY,
        inner: r.inner,
        refactorised: r.refactorised,
        accepted: r.accepted,
        inverted: r.flips,
    }
}
