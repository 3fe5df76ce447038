//! Distances on surfaces, by the heat method.
//!
//! Heat that has flowed from the sources for a short time, (M + t L) h = 1 at the sources, falls along shortest paths; g, the unit
//! vectors against its gradient, is nearly the gradient of the distance. What is left is to find the distance phi whose
//! gradient is nearest to g, min sum_f A_f |grad phi - g_f|^2, in one of these ways ([`GeodesicMethod`]):
//!
//! - `poisson`: one sparse system (Crane, Weischedel, Wardetzky 2013, *Geodesics in heat*);
//! - `admm`: the nearest field that is the gradient of a function, with an unknown for each face or edge (Tao, Zhang, Deng,
//!   Peng 2019), and sums of it along a tree of edges; `aa-admm` accelerates that (A, Figure 12).
//!
//! On surfaces without handles both minimise the same. All of it depends on lengths of edges only, which are made longer by
//! next to nothing where a triangle is flat, so that no mesh has to be refused for its triangles.
//!
//! ```
//! use proxel::geodesic::{Hooks, geodesic};
//! use proxel::settings::GeodesicSettings;
//!
//! let cloth = proxel::mesh::generate::cloth([20, 20], [1.0, 1.0])?;
//! let result = geodesic(&cloth, &[0], &GeodesicSettings::default(), &mut Hooks::default())?;
//! let far = result.distance.iter().copied().fold(0.0, f64::max);
//! assert!((far - 2f64.sqrt()).abs() < 0.05);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod heat;
mod splitting;
mod surface;
#[cfg(test)]
mod tests;

use crate::deform::{TimeLimit, row};
use crate::report::{GeodesicReport, Report, Seconds, TraceRow};
use crate::settings::{GeodesicMethod, GeodesicSettings};
use crate::threads;
use heat::{Flow, Laplacian};
use proxel_mesh::{Mesh, MeshError};
use proxel_split::{
    Cancel, IterationLimit, Method, Observer, Outcome, Problem, ResidualTolerance, Status, StepReport, Stop,
    SystemError, run,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use surface::Surface;

/// Why distances cannot be computed: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GeodesicError(pub String);

impl std::fmt::Display for GeodesicError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for GeodesicError {}

impl From<MeshError> for GeodesicError {
    fn from(e: MeshError) -> Self {
        GeodesicError(e.to_string())
    }
}

impl From<SystemError> for GeodesicError {
    fn from(e: SystemError) -> Self {
        GeodesicError(e.to_string())
    }
}

/// What the caller wants to hear and say while a run goes on.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called with every row of the trace of a splitting.
    pub trace: Option<&'a mut (dyn FnMut(&TraceRow) + Send)>,
    /// Set it to end the run with the best so far.
    pub cancel: Arc<AtomicBool>,
}

/// Distances, and how they came about.
#[derive(Clone, Debug)]
pub struct Geodesic {
    /// For each vertex the distance to the nearest source, in the units of the mesh; `inf` where no path leads.
    pub distance: Vec<f64>,
    /// How the run ended.
    pub status: Status,
    /// All figures; `seconds.read`, `seconds.write` and `peak_bytes` are the caller's to fill.
    pub report: Report,
}

/// The distance of every vertex to the nearest of some source vertices.
///
/// # Errors
/// No faces or no source, coordinates that are not finite, indices out of range, settings that make no sense.
pub fn geodesic(
    mesh: &Mesh,
    sources: &[u32],
    settings: &GeodesicSettings,
    hooks: &mut Hooks<'_>,
) -> Result<Geodesic, GeodesicError> {
    let began = Instant::now();
    settings.check().map_err(GeodesicError)?;
    let (pool, threads) = threads::pool(settings.threads).map_err(GeodesicError)?;
    pool.install(|| Run { mesh, settings, threads, began }.solve(sources, hooks))
}

/// The problem of the splitting of [`geodesic`], for who wants to run it by other methods: see
/// [`crate::settings::GradientForm`] for its unknowns.
///
/// # Errors
/// As [`geodesic`].
pub fn gradient_problem(mesh: &Mesh, sources: &[u32], settings: &GeodesicSettings) -> Result<Problem, GeodesicError> {
    settings.check().map_err(GeodesicError)?;
    let surface = Surface::new(mesh)?;
    let start = Start::new(mesh, &surface, sources, settings.time)?;
    splitting::problem(&surface, &start.flow.directions, settings.form, settings.mu)
}

/// What every method begins with.
struct Start {
    sources: Vec<u32>,
    components: Vec<u32>,
    reached: Vec<bool>, // whether the component of a vertex has a source
    laplacian: Laplacian,
    flow: Flow,
}

impl Start {
    fn new(mesh: &Mesh, surface: &Surface, sources: &[u32], time: f64) -> Result<Self, GeodesicError> {
        let mut sources = sources.to_vec();
        sources.sort_unstable();
        sources.dedup();
        if sources.is_empty() {
            return Err(GeodesicError(format!("{}: no source; name at least one vertex", mesh.name)));
        }
        if let Some(v) = sources.iter().find(|v| **v as usize >= surface.n) {
            let text = format!("{}: source {v} is no vertex; there are {} (0-based)", mesh.name, surface.n);
            return Err(GeodesicError(text));
        }
        let components = surface.components();
        let mut has_source = vec![false; surface.n];
        sources.iter().for_each(|v| has_source[components[*v as usize] as usize] = true);
        let reached: Vec<bool> = components.iter().map(|c| has_source[*c as usize]).collect();
        let mut laplacian = Laplacian::new(surface)?;
        let flow = laplacian.flow(surface, &sources, &reached, time)?;
        Ok(Start { sources, components, reached, laplacian, flow })
    }

    /// Shifts each component so that its sources have the mean 0; `inf` where there is no source.
    fn shift(&self, phi: &mut [f64]) {
        let mut sums = vec![(0.0, 0u32); phi.len()];
        for v in &self.sources {
            let sum = &mut sums[self.components[*v as usize] as usize];
            *sum = (sum.0 + phi[*v as usize], sum.1 + 1);
        }
        for (v, phi) in phi.iter_mut().enumerate() {
            let (sum, n) = sums[self.components[v] as usize];
            *phi = if n > 0 { *phi - sum / f64::from(n) } else { f64::INFINITY };
        }
    }
}

struct Run<'a> {
    mesh: &'a Mesh,
    settings: &'a GeodesicSettings,
    threads: usize,
    began: Instant,
}

impl Run<'_> {
    fn solve(&self, sources: &[u32], hooks: &mut Hooks<'_>) -> Result<Geodesic, GeodesicError> {
        let surface = Surface::new(self.mesh)?;
        let mut start = Start::new(self.mesh, &surface, sources, self.settings.time)?;
        let setup = self.began.elapsed().as_secs_f64();
        let method = match self.settings.method {
            GeodesicMethod::Auto => GeodesicMethod::Poisson,
            method => method,
        };
        let (mut phi, end) = match method {
            GeodesicMethod::Admm | GeodesicMethod::AaAdmm => self.split(&surface, &start, hooks)?,
            _ => {
                let phi = start.laplacian.integrate(&surface, &start.flow.directions, &start.components)?;
                (phi, End::of_a_solve(&hooks.cancel))
            }
        };
        start.shift(&mut phi);
        let mut report = self.report(&surface, &start, &phi, end.outcome.as_ref());
        report.method = method.as_str().to_string();
        report.status = end.status.as_str().to_string();
        report.reason = end.reason;
        report.seconds = Seconds { setup, solve: self.began.elapsed().as_secs_f64() - setup, ..Seconds::default() };
        phi.iter_mut().for_each(|phi| *phi *= surface.scale);
        Ok(Geodesic { distance: phi, status: end.status, report })
    }

    fn split(&self, surface: &Surface, start: &Start, hooks: &mut Hooks<'_>) -> Result<(Vec<f64>, End), GeodesicError> {
        let settings = self.settings;
        let problem = splitting::problem(surface, &start.flow.directions, settings.form, settings.mu)?;
        let mut method = splitting::method(problem, settings)?;
        let mut converged = ResidualTolerance::new(settings.tol);
        let mut cancel = Cancel(hooks.cancel.clone());
        let mut time = TimeLimit::new(self.began, settings.time_limit);
        let mut limit = IterationLimit(settings.max_iters);
        let stops: &mut [&mut dyn Stop] = &mut [&mut converged, &mut cancel, &mut time, &mut limit];
        let mut tracer = Tracer { hooks, began: self.began, watching: Duration::ZERO };
        let outcome = run(&mut *method, stops, &mut tracer);
        let differences = splitting::differences(surface, settings.form, &outcome.x);
        let phi = splitting::sums(surface, &differences, &start.sources);
        let (status, reason) = (outcome.status, outcome.reason.clone());
        let residuals = method.residuals();
        Ok((phi, End { status, reason, outcome: Some((outcome, residuals.primal, residuals.dual)) }))
    }

    fn report(&self, surface: &Surface, start: &Start, phi: &[f64], outcome: Option<&(Outcome, f64, f64)>) -> Report {
        let (mut deviation, mut area) = (0.0, 0.0);
        for (f, g) in start.laplacian.gradient(surface, phi).iter().enumerate() {
            let size = g[0].hypot(g[1]);
            if size.is_finite() {
                deviation += surface.area[f] * (size - 1.0).abs();
                area += surface.area[f];
            }
        }
        let finite = || phi.iter().filter(|d| d.is_finite());
        let unreached = start.reached.iter().filter(|r| !**r).count();
        let mut warnings = Vec::new();
        if unreached > 0 {
            let first = start.reached.iter().position(|r| !r).unwrap_or(0);
            warnings.push(format!(
                "{}: no path leads from a source to {unreached} vertices, such as {first}; their distance is inf",
                self.mesh.name
            ));
        }
        if start.flow.time > self.settings.time {
            warnings.push(format!(
                "{}: heat flowed for {} squared mean edges instead of {}, or too little would have come to the far end",
                self.mesh.name, start.flow.time, self.settings.time
            ));
        }
        let residual = |v: f64| Some(v).filter(|v| v.is_finite());
        Report {
            version: env!("CARGO_PKG_VERSION").to_string(),
            command: "geodesic".to_string(),
            settings: serde_json::to_value(self.settings).unwrap_or_default(),
            iterations: outcome.map_or(0, |(o, ..)| o.iterations),
            energy: outcome.map(|(o, ..)| o.energy.value),
            primal_residual: outcome.and_then(|(_, primal, _)| residual(*primal)),
            dual_residual: outcome.and_then(|(.., dual)| residual(*dual)),
            accepted: outcome.map_or(0, |(o, ..)| o.accepted),
            rejected: outcome.map_or(0, |(o, ..)| o.rejected),
            warnings,
            repaired: surface.repaired.clone(),
            factor_bytes: Some(start.laplacian.factor_bytes),
            threads: self.threads,
            geodesic: Some(GeodesicReport {
                sources: start.sources.clone(),
                distance_max: surface.scale * finite().copied().fold(0.0, f64::max),
                gradient_deviation: deviation / area,
                unreached_vertices: unreached,
                heat_time: start.flow.time,
            }),
            ..Report::default()
        }
    }
}

/// How a run ended, with the residuals of a splitting.
struct End {
    status: Status,
    reason: String,
    outcome: Option<(Outcome, f64, f64)>,
}

impl End {
    /// A direct solve cannot be interrupted: its result is kept.
    fn of_a_solve(cancel: &AtomicBool) -> Self {
        let status = if cancel.load(Ordering::Relaxed) { Status::Cancelled } else { Status::Converged };
        let reason = match status {
            Status::Cancelled => "cancelled by the user after the solve",
            _ => "the system of the distance is solved",
        };
        End { status, reason: reason.to_string(), outcome: None }
    }
}

/// Writes rows of the trace.
struct Tracer<'a, 'b> {
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    watching: Duration, // time spent on what only the trace needs
}

impl Observer for Tracer<'_, '_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        let Some(trace) = self.hooks.trace.as_deref_mut() else { return };
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        trace(&row(method, report, seconds, f64::INFINITY));
        self.watching += now.elapsed();
    }
}
