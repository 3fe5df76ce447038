//! Tables: Markdown to read, CSV to compute with.

use crate::BenchError;
use crate::runs::{Level, Run};
use proxel::mesh::atomic_write;
use std::fmt::Write as _;
use std::path::Path;

/// A Markdown table.
#[derive(Clone, Debug, Default)]
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new<S: Into<String>>(header: impl IntoIterator<Item = S>) -> Self {
        Table { header: header.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Whether it has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let cell = |s: &String| s.replace('|', "\\|");
        let line = |cells: &[String]| format!("| {} |", cells.iter().map(cell).collect::<Vec<_>>().join(" | "));
        writeln!(f, "{}", line(&self.header))?;
        writeln!(f, "|{}", "---|".repeat(self.header.len()))?;
        for row in &self.rows {
            writeln!(f, "{}", line(row))?;
        }
        Ok(())
    }
}

/// Seconds to three digits.
pub fn seconds(s: f64) -> String {
    match s {
        s if !s.is_finite() => "-".to_string(),
        s if s >= 100.0 => format!("{s:.0}"),
        s if s >= 10.0 => format!("{s:.1}"),
        s if s >= 1.0 => format!("{s:.2}"),
        s => format!("{s:.3}"),
    }
}

/// "iterations (seconds)" of a level, or how far the run came.
pub fn cost(run: &Run, level: Level) -> String {
    match run.reached(level) {
        Some(p) => format!("{} ({} s)", p.iteration, seconds(p.seconds)),
        None => {
            let last = run.last();
            format!("not in {} ({:.1e})", last.iteration, last.position_error)
        }
    }
}

/// The CSV of all reproductions: a row a level, empty cells where it was not reached.
pub fn csv<'a>(runs: impl IntoIterator<Item = &'a Run>, levels: &[Level]) -> String {
    let mut text = "problem,method,level,iterations,seconds\n".to_string();
    for run in runs {
        for level in levels {
            let (iterations, seconds) = match run.reached(*level) {
                Some(p) => (p.iteration.to_string(), p.seconds.to_string()),
                None => Default::default(),
            };
            let _ = writeln!(text, "{},{},{level},{iterations},{seconds}", run.problem, run.method);
        }
    }
    text
}

/// Geometric mean; NaN of nothing.
pub fn geometric_mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0), |(sum, count), v: f64| (sum + v.ln(), count + 1));
    (sum / f64::from(count)).exp()
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// A path that cannot be written.
pub fn write(path: &Path, text: &str) -> Result<(), BenchError> {
    atomic_write(path, |w| w.write_all(text.as_bytes())).map_err(BenchError::from_display)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::Point;

    fn run() -> Run {
        let point = |iteration: usize, error: f64| Point {
            iteration,
            inner: iteration,
            seconds: 0.5 * iteration as f64,
            position_error: error,
            energy_error: error * error,
        };
        Run {
            problem: "p".into(),
            method: "m".into(),
            points: vec![point(0, 1.0), point(1, 0.05), point(2, 0.02)],
            reweighted: vec![],
            reason: String::new(),
        }
    }

    #[test]
    fn csv_has_a_row_a_level_and_empty_cells_where_it_was_not_reached() {
        let levels = [Level::Position(1e-1), Level::Position(1e-2), Level::Energy(1e-3)];
        assert_eq!(
            csv([&run()], &levels),
            "problem,method,level,iterations,seconds\np,m,1e-1,1,0.5\np,m,1e-2,,\np,m,energy 1e-3,2,1\n"
        );
    }

    #[test]
    fn tables_are_markdown() {
        let mut table = Table::new(["a", "b|c"]);
        table.row(["1", "2"]);
        assert_eq!(table.to_string(), "| a | b\\|c |\n|---|---|\n| 1 | 2 |\n");
    }

    #[test]
    fn the_geometric_mean_of_2_and_8_is_4() {
        assert!((geometric_mean([2.0, 8.0]) - 4.0).abs() < 1e-15);
        assert!(geometric_mean([]).is_nan());
    }
}
