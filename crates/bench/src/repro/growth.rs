//! How the time of the methods grows with refinement, and whether `auto` chooses well at each size.

use super::context::Context;
use crate::BenchError;
use crate::data::{self, BEAM, Model};
use crate::plot::{Axis, Line, Panel};
use crate::table::{Table, seconds};
use proxel::deform::{Deformation, Hooks, deform};
use proxel::settings::{DeformSettings, MethodName};
use proxel::split::Status;
use std::fmt::Write as _;

/// Gradient ratio to which all are solved: an error that no reference is needed for.
const TOLERANCE: f64 = 1e-6;

/// A run that takes longer is given up, seconds.
const PATIENCE: f64 = 300.0;

/// Cells along the beam of about 20,000 tetrahedra; the other sides have a third of that.
const CELLS: usize = 33;

const METHODS: [MethodName; 4] = [MethodName::Auto, MethodName::Wrapd, MethodName::Newton, MethodName::NewtonCg];

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let _ = writeln!(
        context.text,
        "To a gradient ratio of {TOLERANCE:e}, set-up included; a run ends after {PATIENCE} s. Refinement makes 8 tetrahedra of \
         one.\n"
    );
    let mut panels = Vec::new();
    for name in context.models.clone() {
        let sizes = sizes(context, &name)?;
        let mut table =
            Table::new(["tetrahedra".to_string()].into_iter().chain(METHODS.map(|method| method.as_str().to_string())));
        let mut lines: Vec<Line> = METHODS
            .iter()
            .enumerate()
            .map(|(style, method)| Line { label: method.as_str().to_string(), points: Vec::new(), style, marked: true })
            .collect();
        for model in sizes {
            let tets = model.input.rest.tets.len();
            let mut row = vec![tets.to_string()];
            for (method, line) in METHODS.into_iter().zip(&mut lines) {
                let end = match solve(context, &model, method) {
                    Ok(end) => end,
                    Err(refusal) => {
                        context.tell(&format!("{name}: {tets} tetrahedra: {}: {refusal}", method.as_str()));
                        row.push(refusal.to_string());
                        continue;
                    }
                };
                let spent = end.report.seconds.setup + end.report.seconds.solve;
                context.tell(&format!(
                    "{name}: {tets} tetrahedra: {}: {} after {} iterations, {} s",
                    method.as_str(),
                    end.report.status,
                    end.report.iterations,
                    seconds(spent)
                ));
                let converged = end.status == Status::Converged;
                if converged {
                    line.points.push((tets as f64, spent));
                }
                row.push(if converged {
                    format!("{} ({} s)", end.report.iterations, seconds(spent))
                } else {
                    format!("{}: {}", end.report.status, end.report.reason)
                });
            }
            table.row(row);
        }
        let _ = writeln!(context.text, "## {name}\n\nIterations (seconds).\n\n{table}");
        let points = || lines.iter().flat_map(|l| &l.points);
        let (x, y) = (Axis::log_around(points().map(|p| p.0)), Axis::log_around(points().map(|p| p.1)));
        panels.push(Panel {
            title: name,
            x_label: "tetrahedra".to_string(),
            y_label: "seconds".to_string(),
            x,
            y,
            lines,
            map: None,
        });
    }
    context.plot("", "Time against size", &panels)
}

/// The beam at 1, 8 and 64 times its size; another model as it is and refined once.
fn sizes(context: &mut Context<'_>, name: &str) -> Result<Vec<Model>, BenchError> {
    if name == BEAM {
        let (coarse, count) = if context.options.quick { (6, 2) } else { (CELLS, 3) };
        return (0..count).map(|k| data::twisted_beam([coarse << k, (coarse << k) / 3, (coarse << k) / 3])).collect();
    }
    let (model, _) = context.load(name)?;
    let refined = model.refined()?;
    Ok(vec![model, refined])
}

fn solve(context: &Context<'_>, model: &Model, method: MethodName) -> Result<Deformation, BenchError> {
    let mut input = model.input.clone();
    input.reference = None;
    let settings = DeformSettings {
        method,
        tol: TOLERANCE,
        max_iters: context.max_iters(),
        time_limit: Some(PATIENCE),
        threads: context.options.threads,
        ..DeformSettings::default()
    };
    deform(&input, &settings, &mut Hooks::default()).map_err(BenchError::from_display)
}
