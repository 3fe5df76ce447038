//! Figure 8: the wire mesh of Figure 7 by a penalty under three weights, and by ADMM.

use super::figure7::{self, problem};
use super::most;
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::shape::{Change, ShapeMethod, Shaped};
use std::fmt::Write as _;

/// Weights of edges and angles against closeness 1.
const PENALTIES: [f64; 3] = [1e2, 1e4, 1e6];

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let (problem, source) = problem(context)?;
    let full = most(context, 300);
    let _ = writeln!(
        context.text,
        "{source} {} vertices.\n\nShapeUp under Anderson acceleration (m = 6) with these weights of edges and angles, closeness \
         1, and AA-ADMM with mu = 1000; {full} iterations each, or until the gradient is 1e-9 of the first. E: the sum of \
         squared distances from the reference, in squares of the mean edge.\n",
        problem.input.mesh.n_verts()
    );
    let header = figure7::HEADER.into_iter().chain(["E", "iterations", "seconds"]);
    let (mut table, mut shapes) = (Table::new(header), Vec::new());
    let mut csv =
        "problem,method,edge_error_max,angle_error_max,reference_distance_mean,sum_of_squares,iterations\n".to_string();
    let runs = PENALTIES.map(|weight| (format!("penalty {weight:e}"), ShapeMethod::Shapeup, Some(weight)));
    for (name, method, weight) in runs.into_iter().chain([("aa-admm".to_string(), ShapeMethod::AaAdmm, None)]) {
        let mut task = problem.task.by(method, 6, full);
        let settings = task.settings();
        settings.threads = context.options.threads;
        settings.mu = weight.unwrap_or(settings.mu);
        let shaped = problem.shape(&task, &mut Default::default())?;
        context.tell(&format!("{}: {name}: {}", problem.name, shaped.report.reason));
        let Some(told) = &shaped.report.shape else { continue };
        let squares: f64 = shaped.distance.iter().map(|d| (d / told.mean_edge).powi(2)).sum();
        let figure = |c: Option<Change>| c.map_or(f64::NAN, |c| c.after);
        let cells = [
            told.edge_error_max,
            told.edge_error_mean,
            told.angle_error_max,
            told.angle_error_mean,
            told.reference_distance_max,
            told.reference_distance_mean,
        ];
        let cells = cells.map(|c| format!("{:.3e}", figure(c)));
        let iterations = shaped.report.iterations;
        let rest = [format!("{squares:.2}"), iterations.to_string(), seconds(shaped.report.seconds.solve)];
        table.row([name.clone()].into_iter().chain(cells).chain(rest));
        let _ = writeln!(
            csv,
            "{},{name},{:e},{:e},{:e},{squares:e},{iterations}",
            problem.name,
            figure(told.edge_error_max),
            figure(told.angle_error_max),
            figure(told.reference_distance_mean)
        );
        shapes.push(shaped);
    }
    let off: Vec<(&Shaped, Vec<f64>)> = shapes.iter().map(|s| (s, s.distance.clone())).collect();
    problem.picture(context, "distance", &off)?;
    let file = context.file("distance.png");
    let _ = writeln!(context.text, "{table}\n![distances from the reference, in the order of the table]({file})\n");
    context.csv = Some(csv);
    Ok(())
}
