//! Tables and diagrams of steps of a body in motion.

use super::course::{Course, Residual};
use super::measured::{self, Measured};
use super::{level, panel};
use crate::BenchError;
use crate::motion::Moving;
use crate::plot::{Axis, Line, Panel};
use crate::table::{Table, seconds};

/// Levels of residuals in the CSV: those of a horse that has just hit the ground begin above 1.
pub(super) const LEVELS: [f64; 12] = [10.0, 1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];

/// Iterations to levels of the forward residual, and what is left after some: of each run that has residuals, and of those
/// measured with the authors' implementation.
pub(super) fn residuals(courses: &[&Course], levels: &[f64], after: usize) -> Table {
    let head = ["method".to_string(), "first".to_string()].into_iter().chain(levels.iter().map(|l| level(*l)));
    let tail = [format!("after {after}"), "violation then".to_string(), "ms an iteration".to_string()];
    let mut table = Table::new(head.chain(tail));
    for course in courses.iter().filter(|c| c.has(Residual::Forward)) {
        let cell = |of: &f64| match course.reached(Residual::Forward, *of) {
            None => "-".to_string(),
            Some(p) if p.rejected == 0 => p.iteration.to_string(),
            Some(p) => format!("{} (+{})", p.iteration, p.rejected),
        };
        let then = course.points.iter().rfind(|p| p.iteration <= after);
        let tail = [
            then.map_or("-".to_string(), |p| match p.rejected {
                0 => format!("{:.2e}", p.forward),
                n => format!("{:.2e} (+{n})", p.forward),
            }),
            then.map_or("-".to_string(), |p| format!("{:.2e}", p.violation)),
            seconds(1e3 * course.median()),
        ];
        let first = course.points.first().map_or("-".to_string(), |p| format!("{:.3e}", p.forward));
        table.row([course.method.clone(), first].into_iter().chain(levels.iter().map(cell)).chain(tail));
    }
    for m in courses.first().map_or_else(Vec::new, |c| measured::of(&c.problem)) {
        let cell = |of: &f64| match m.points.iter().find(|p| p.1 == *of) {
            Some((iteration, _)) => iteration.to_string(),
            None => "".to_string(),
        };
        let tail = [measured_end(m), m.violation.map_or(String::new(), |v| format!("{v}")), String::new()];
        let first = m.points.iter().find(|p| p.0 == 1).map_or(String::new(), |p| p.1.to_string());
        table
            .row([format!("{}, the authors'", m.method), first].into_iter().chain(levels.iter().map(cell)).chain(tail));
    }
    table
}

fn measured_end(m: &Measured) -> String {
    let Some((n, r)) = m.points.last().filter(|(n, _)| n.is_multiple_of(100)) else { return String::new() };
    match m.rejected {
        Some(rejected) => format!("{r:.2e} (+{rejected}) after {n}"),
        None => format!("{r:.2e} after {n}"),
    }
}

/// Iterations and seconds to position errors, and where runs end.
pub(super) fn positions(moving: &Moving, courses: &[&Course]) -> Result<Table, BenchError> {
    const SHOWN: [f64; 5] = [0.1, 1e-2, 1e-3, 1e-4, 1e-6];
    let head = ["method".to_string()].into_iter().chain(SHOWN.iter().map(|l| level(*l)));
    let mut table = Table::new(head.chain(["at the end", "objective, J", "violation"].map(String::from)));
    for course in courses {
        let cell = |of: &f64| match course.reached(Residual::Position, *of) {
            None => "-".to_string(),
            Some(p) => format!("{} ({} s)", p.iteration, seconds(p.seconds)),
        };
        let objective = format!("{:.6e}", moving.objective(&course.x)?);
        let tail = course.points.last().map_or_else(Default::default, |p| {
            [format!("{:.1e} after {}", p.position, p.iteration), objective, format!("{:.1e}", p.violation)]
        });
        table.row([course.method.clone()].into_iter().chain(SHOWN.iter().map(cell)).chain(tail));
    }
    Ok(table)
}

/// Forward residuals against iterations, with what the authors' implementation was measured to do, and against seconds.
pub(super) fn panels(title: &str, courses: &[&Course]) -> Vec<Panel> {
    let mut by_iteration = panel(title, courses, Residual::Forward, false);
    let known = courses.first().map_or_else(Vec::new, |c| measured::of(&c.problem));
    for m in known {
        let points: Vec<(f64, f64)> = m.points.iter().map(|(n, r)| (*n as f64, *r)).collect();
        let style = courses.iter().position(|c| c.method == m.method).unwrap_or(0);
        // The label of our own run of the method: the marks are theirs.
        by_iteration.lines.push(Line { label: m.method.to_string(), points, style, marked: true });
    }
    by_iteration.y = Axis::log_around(by_iteration.lines.iter().flat_map(|l| &l.points).map(|p| p.1));
    vec![by_iteration, panel(title, courses, Residual::Forward, true)]
}

/// Position errors against seconds.
pub(super) fn position_panel(title: &str, courses: &[&Course]) -> Panel {
    let mut panel = panel(title, courses, Residual::Position, true);
    panel.y_label = "position error, mean edges".to_string();
    let points = || panel.lines.iter().flat_map(|l| &l.points);
    panel.x = Axis::log_around(points().map(|p| p.0).filter(|s| *s > 0.0));
    panel.y = Axis::log_around(points().map(|p| p.1.max(1e-9)));
    panel
}
