//! Runs of a method on a model, point by point.

use crate::BenchError;
use crate::data::Model;
use proxel::deform::{Hooks, deform};
use proxel::report::TraceRow;
use proxel::settings::DeformSettings;
use std::sync::atomic::Ordering;

/// How close to the minimum a point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// |X - X*| / |X_0 - X*| over free vertices.
    Position(f64),
    /// (E - E*) / (E_0 - E*).
    Energy(f64),
}

impl std::fmt::Display for Level {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Level::Position(v) => write!(f, "{v:e}"),
            Level::Energy(v) => write!(f, "energy {v:e}"),
        }
    }
}

/// What tables list: position errors as in the paper, and energy errors of about the same points.
pub const LEVELS: [Level; 8] = [
    Level::Position(1e-1),
    Level::Position(1e-2),
    Level::Position(1e-3),
    Level::Position(1e-4),
    Level::Energy(1e-2),
    Level::Energy(1e-4),
    Level::Energy(1e-6),
    Level::Energy(1e-8),
];

/// The paper's mark of convergence.
pub const CONVERGED: Level = Level::Position(1e-4);

/// The state after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Iterations done.
    pub iteration: usize,
    /// Their inner steps together.
    pub inner: usize,
    /// Wall seconds since the end of reading; the least of the repetitions.
    pub seconds: f64,
    /// |X - X*| / |X_0 - X*| over free vertices.
    pub position_error: f64,
    /// (E - E*) / (E_0 - E*).
    pub energy_error: f64,
}

/// A run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name of the model.
    pub problem: String,
    /// Name of the method, with what was changed of its settings.
    pub method: String,
    /// The states, the start first.
    pub points: Vec<Point>,
    /// Iterations that reweighted.
    pub reweighted: Vec<usize>,
    /// Why it ended.
    pub reason: String,
}

impl Run {
    /// The first point at a level.
    pub fn reached(&self, level: Level) -> Option<&Point> {
        self.points.iter().find(|p| match level {
            Level::Position(v) => p.position_error <= v,
            Level::Energy(v) => p.energy_error <= v,
        })
    }

    /// The last point.
    pub fn last(&self) -> Point {
        self.points.last().copied().unwrap_or(Point {
            iteration: 0,
            inner: 0,
            seconds: 0.0,
            position_error: f64::INFINITY,
            energy_error: f64::INFINITY,
        })
    }
}

/// What runs have in common.
#[derive(Clone, Debug)]
pub struct Runner<'a> {
    /// The model.
    pub model: &'a Model,
    /// E*, see [`Model::least_energy`].
    pub least_energy: f64,
    /// A run ends where all of these are reached.
    pub levels: &'a [Level],
    /// Repetitions; seconds are the least of them, everything else is the same each time.
    pub repeats: usize,
}

impl Runner<'_> {
    /// Solves the model.
    ///
    /// # Errors
    /// Settings or a model that make no problem.
    pub fn run(&self, method: impl Into<String>, settings: &DeformSettings) -> Result<Run, BenchError> {
        let mut run = self.once(method.into(), settings)?;
        for _ in 1..self.repeats.max(1) {
            let again = self.once(run.method.clone(), settings)?;
            for (point, again) in run.points.iter_mut().zip(&again.points) {
                point.seconds = point.seconds.min(again.seconds);
            }
        }
        Ok(run)
    }

    fn once(&self, method: String, settings: &DeformSettings) -> Result<Run, BenchError> {
        let mut points: Vec<Point> = Vec::new();
        let mut reweighted = Vec::new();
        let mut hooks = Hooks::default();
        let cancel = hooks.cancel.clone();
        let mut scale = 1.0; // E_0 - E*
        let mut open = self.levels.to_vec();
        let mut row = |row: &TraceRow| {
            let above = (row.energy - self.least_energy).max(0.0);
            if row.iteration == 0 {
                scale = above.max(f64::MIN_POSITIVE);
            }
            let before = points.last().map_or(0, |p| p.inner);
            let inner = before + if row.iteration > 0 { row.inner } else { 0 };
            let point = Point {
                iteration: row.iteration,
                inner,
                seconds: row.seconds,
                position_error: row.position_error,
                energy_error: above / scale,
            };
            if row.refactorised {
                reweighted.push(row.iteration);
            }
            open.retain(|level| match *level {
                Level::Position(v) => point.position_error > v,
                Level::Energy(v) => point.energy_error > v,
            });
            points.push(point);
            if open.is_empty() {
                cancel.store(true, Ordering::Relaxed);
            }
        };
        hooks.trace = Some(&mut row);
        let end = deform(&self.model.input, settings, &mut hooks).map_err(BenchError::from_display)?;
        let reason = if open.is_empty() { "all levels reached".to_string() } else { end.report.reason };
        Ok(Run { problem: self.model.name.clone(), method, points, reweighted, reason })
    }
}
