//! Reproductions of *Accelerating ADMM for efficient simulation and optimization* (Zhang et al. 2019).

mod constants;
mod contest;
mod course;
pub mod equal_time;
pub mod falling;
pub mod figure1;
pub mod figure10;
pub mod figure11;
pub mod figure12;
pub mod figure2;
pub mod figure3;
pub mod figure4;
pub mod figure7;
pub mod figure8;
pub mod figure9;
pub mod linear_rate;
mod measured;
mod planar;
mod reference;
mod safe;
mod shapes;
mod step;
mod step_report;
pub mod sweep;
#[cfg(test)]
mod tests;

use super::context::Context;
use crate::plot::{Axis, Line, Panel};
use crate::table::Table;
use course::{Course, Residual};
pub use figure10::chart;
use std::fmt::Write as _;

/// Levels of the normalised residuals that the CSV lists.
const LEVELS: [f64; 9] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];

/// Levels that the tables show.
const SHOWN: [f64; 6] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-10];

fn level(level: f64) -> String {
    format!("{level:e}")
}

/// All rows of the courses: a residual and a level each; cells are empty where it was not reached.
fn csv(courses: &[Course], levels: &[f64]) -> String {
    let mut csv = "problem,method,level,iterations,seconds,rejected,residual\n".to_string();
    for course in courses {
        for residual in [Residual::Forward, Residual::Combined, Residual::Position] {
            if !course.has(residual) {
                continue;
            }
            for of in levels.iter().copied() {
                let (problem, method, name) = (&course.problem, &course.method, residual.as_str());
                let cells = match course.reached(residual, of) {
                    Some(p) => format!("{},{:.6},{}", p.iteration, p.seconds, p.rejected),
                    None => ",,".to_string(),
                };
                let _ = writeln!(csv, "{problem},{method},{},{cells},{name}", level(of));
            }
        }
    }
    csv
}

/// Iterations to each level, ours and those measured with the authors' implementation beside them where there are some;
/// rejections in brackets.
fn table(courses: &[&Course], residual: Residual) -> Table {
    let mut table = Table::new(["method".to_string()].into_iter().chain(SHOWN.map(level)));
    for course in courses {
        let reference = reference::of(&course.problem, &course.method, residual);
        let cell = |(k, of): (usize, &f64)| {
            let ours = course.reached(residual, *of).map_or("-".to_string(), |p| match p.rejected {
                0 => p.iteration.to_string(),
                n => format!("{} (+{n})", p.iteration),
            });
            match reference.and_then(|r| r.get(k).copied().flatten()) {
                Some(theirs) => format!("{ours} / {theirs}"),
                None => ours,
            }
        };
        table.row([course.method.clone()].into_iter().chain(SHOWN.iter().enumerate().map(cell)));
    }
    table
}

/// A residual against iterations or seconds.
fn panel(title: &str, courses: &[&Course], residual: Residual, by_time: bool) -> Panel {
    let points = |course: &Course| {
        let point = |p: &course::Point| (if by_time { p.seconds } else { p.iteration as f64 }, p.value(residual));
        course.points.iter().map(point).filter(|(_, v)| v.is_finite() && *v > 0.0).collect::<Vec<_>>()
    };
    let lines: Vec<Line> = courses
        .iter()
        .enumerate()
        .filter(|(_, course)| course.has(residual))
        .map(|(style, course)| Line { label: course.method.clone(), points: points(course), style, marked: false })
        .collect();
    let all = || lines.iter().flat_map(|line| &line.points);
    let most = all().map(|p| p.0).fold(0.0, f64::max);
    Panel {
        title: title.to_string(),
        x_label: if by_time { "seconds" } else { "iterations" }.to_string(),
        y_label: format!("normalised {} residual", residual.as_str()),
        x: Axis::linear(0.0, most),
        y: Axis::log_around(all().map(|p| p.1)),
        lines,
        map: None,
    }
}

/// What all of them say.
const COUNTING: &str = "Iterations are accepted ones, counted as the authors' implementation counts them: z = prox(Dx), u = Dx - z \
    at x = x~ comes first, and is none. In brackets proposals that were refused until then. After a slash: the authors' \
    implementation, as measured, where it was; it stalls at about 2e-7, the tolerance of its prox. Residuals are those of \
    A(27) with a = the mean edge.";

/// Iterations of a run, unless others are asked for.
fn most(context: &Context<'_>, full: usize) -> usize {
    context.options.max_iters.unwrap_or(if context.options.quick { full.min(150) } else { full })
}
