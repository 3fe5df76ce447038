//! Energy, energy error and phases of runs as panels: dashed while triangles are flipped.

use crate::maps::{MapRun, Phase, shown_energy};
use crate::plot::{Axis, Line, Panel};
use proxel::unwrap::MapRow;

/// Styles come in colours; this many further, the same colours are dashed.
const DASHED: usize = 7;

/// log E against log t.
pub fn energy(title: &str, runs: &[MapRun], least: f64) -> Panel {
    let lines = lines(runs, &|row| row.seconds, &|row| shown_energy(row));
    let most = values(&lines).filter(|v| v.is_finite()).fold(2.0 * least, f64::max);
    panel(title, ["seconds", "energy"], lines, Axis::log(0.9 * least, most.min(1e6)))
}

/// log (E - E*) / E* against log t.
pub fn error(title: &str, runs: &[MapRun], least: f64) -> Panel {
    let lines = lines(runs, &|row| row.seconds, &|row| shown_energy(row) / least - 1.0);
    let most = values(&lines).filter(|v| v.is_finite()).fold(1.0, f64::max);
    panel(title, ["seconds", "energy error"], lines, Axis::log(1e-8, most.min(1e6)))
}

/// Total inner steps of the global steps against iterations.
pub fn inner(title: &str, runs: &[MapRun]) -> Panel {
    let of = |(style, run): (usize, &MapRun)| {
        let mut total = 0;
        let points = run.rows.iter().map(|row| {
            total += row.inner;
            (row.iteration as f64, total as f64)
        });
        Line { label: run.method.clone(), points: points.filter(|p| p.0 > 0.0).collect(), style, marked: false }
    };
    let lines: Vec<Line> = runs.iter().enumerate().map(of).collect();
    let y = Axis::log_around(values(&lines));
    panel(title, ["iterations", "inner steps, all together"], lines, y)
}

/// From the end of the early phase to the start of the late one, a bar a run.
pub fn phases(title: &str, runs: &[MapRun], least: f64) -> Panel {
    let bar = |(style, run): (usize, &MapRun)| {
        let at = |phase| run.reached(phase, least).map(|row| (row.seconds, style as f64 + 1.0));
        let points = [at(Phase::EarlyDual), at(Phase::Late)].into_iter().flatten().collect();
        Line { label: run.method.clone(), points, style, marked: true }
    };
    let lines: Vec<Line> = runs.iter().enumerate().map(bar).collect();
    panel(title, ["seconds", "method"], lines, Axis::linear(0.0, runs.len() as f64 + 1.0))
}

/// A line for each run, dashed up to the first state after the last flips, which is marked.
fn lines(runs: &[MapRun], x: &dyn Fn(&MapRow) -> f64, y: &dyn Fn(&MapRow) -> f64) -> Vec<Line> {
    let mut lines = Vec::new();
    for (style, run) in runs.iter().enumerate() {
        let rows = run.rows.get(1..).unwrap_or_default();
        let points: Vec<(f64, f64)> = rows.iter().map(|row| (x(row), y(row))).collect();
        let free = rows.iter().rposition(|row| row.flips > 0).map_or(0, |last| last + 1);
        let line = |points: &[(f64, f64)], label: &str, style: usize, marked: bool| Line {
            label: label.to_string(),
            points: points.to_vec(),
            style,
            marked,
        };
        if free > 0 {
            lines.push(line(&points[..(free + 1).min(points.len())], "", style + DASHED, false));
            lines.push(line(&points[free.min(points.len())..(free + 1).min(points.len())], "", style, true));
        }
        lines.push(line(&points[free.min(points.len())..], &run.method, style, false));
    }
    lines
}

fn values(lines: &[Line]) -> impl Iterator<Item = f64> {
    lines.iter().flat_map(|l| &l.points).map(|p| p.1)
}

fn panel(title: &str, [x_label, y_label]: [&str; 2], lines: Vec<Line>, y: Axis) -> Panel {
    let x = Axis::log_around(lines.iter().flat_map(|l| &l.points).map(|p| p.0));
    Panel {
        title: title.to_string(),
        x_label: x_label.to_string(),
        y_label: y_label.to_string(),
        x,
        y,
        lines,
        map: None,
    }
}
