//! Figure 7: a wire mesh, edges of one length and angles within a range, near to a reference.

use super::course::{Course, Residual};
use super::shapes::{LEVELS, Problem, Task, at_equal_time, meshes, sheet, table};
use super::{csv, most, panel};
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::Table;
use proxel::shape::{Change, ShapeInput, ShapeMethod, Shaped, WireSettings, edge_lengths, subdivide};
use std::fmt::Write as _;

/// What was measured with the authors' code to 1e-3, 1e-4 and 1e-5; 0 where it was not reached.
const THEIRS: [(&str, &str, [usize; 3]); 2] = [("torso", "admm", [13, 0, 0]), ("torso", "aa-admm m=6", [6, 35, 0])];

/// The problem of Figures 7 and 8, and where its mesh is from.
pub(super) fn problem(context: &Context<'_>) -> Result<(Problem, String), BenchError> {
    let found = meshes(context, ["MaleTorso.obj", "MaleTorso_target.obj"])?;
    let (name, mesh, reference, source) = match found {
        Some([mesh, reference]) => ("torso", mesh, Some(reference), "Data: MaleTorso, subdivided once.".to_string()),
        None => {
            let source = "Data: none; a wavy sheet stands in. Set PROXEL_DATA to the folder that holds `geometry/`.";
            ("sheet", sheet(8), None, source.to_string())
        }
    };
    let (mean, _) = edge_lengths(&mesh.points, &mesh.faces);
    // `--models coarse`: without the subdivision, to see the same in a quarter of the time.
    let coarse = context.models.iter().any(|m| m == "coarse");
    let (name, mesh, length) = match coarse {
        true => (format!("{name}-coarse"), mesh, mean),
        false => (name.to_string(), subdivide(&mesh).map_err(BenchError::from_display)?, 0.5 * mean),
    };
    let settings = WireSettings { edge_length: Some(length), ..WireSettings::default() };
    let input = ShapeInput { mesh, reference };
    Ok((Problem { name, input, task: Task::Wire(settings) }, source))
}

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let (problem, source) = problem(context)?;
    let settings = WireSettings::default();
    let _ = writeln!(
        context.text,
        "{source} {} vertices.\n\n## The problem\n\nA(29): edges of half the mean length of those of the mesh before its \
         subdivision and angles within {} to {} degrees hard, closeness {} soft, no fairing; z-x-u, mu = {}. Residual: \
         sqrt((|Dx - z|^2 + |D dx|^2) / N_z) / a, a the mean edge, without mu; with mu it is {:.1} times that. In brackets \
         proposals that were refused until then; after a slash: the authors' implementation, as measured.\n",
        problem.input.mesh.n_verts(),
        settings.min_angle,
        settings.max_angle,
        settings.shape.closeness,
        settings.shape.mu,
        settings.shape.mu.sqrt()
    );
    let full = most(context, 100);
    let by = |method, m, most| problem.task.by(method, m, most);
    let (fast, after) = problem.course(context, "aa-admm m=6", &by(ShapeMethod::AaAdmm, 6, full))?;
    let ours = WireSettings::by(ShapeMethod::AaAdmm).shape.mu;
    let mut task = by(ShapeMethod::AaAdmm, 6, full);
    task.settings().mu = ours;
    let default = format!("aa-admm m=6, mu = {ours}");
    let (stiff, default_after) = problem.course(context, &default, &task)?;
    let (plain, longest) = problem.course(context, "admm", &by(ShapeMethod::Admm, 0, full))?;
    let equal = at_equal_time(&plain, &fast);
    let before = match equal < plain.points.len() {
        true => problem.shape(&by(ShapeMethod::Admm, 0, equal), &mut Default::default())?,
        false => longest.clone(),
    };
    let mut ends = Table::new(HEADER);
    row(&mut ends, "input", &longest, |c| c.before);
    row(&mut ends, &format!("admm, {} iterations", plain.points.len()), &longest, |c| c.after);
    row(&mut ends, &format!("admm at equal time, {equal} iterations"), &before, |c| c.after);
    row(&mut ends, &format!("aa-admm m=6, {} iterations", fast.points.len()), &after, |c| c.after);
    row(&mut ends, &format!("{default}, our default, {} iterations", stiff.points.len()), &default_after, |c| c.after);
    let courses = [plain, fast, stiff];
    let shown: Vec<&Course> = courses.iter().collect();
    let _ = writeln!(context.text, "## Iterations\n\n{}\n## Results\n\n{ends}", table(&courses, &THEIRS));
    let panels =
        [panel("iterations", &shown, Residual::Combined, false), panel("time", &shown, Residual::Combined, true)];
    context.plot(&problem.name, &problem.name, &panels)?;
    for (k, what) in ["edges", "angles"].into_iter().enumerate() {
        let of = |shaped: &Shaped| problem.at_vertices(shaped, k);
        problem.picture(context, what, &[(&before, of(&before)), (&after, of(&after))])?;
        let file = context.file(&format!("{what}.png"));
        let _ = writeln!(context.text, "![errors of {what}, ADMM and AA-ADMM at equal time]({file})\n");
    }
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

pub(super) const HEADER: [&str; 7] =
    ["method", "edge error max", "mean", "angle error max, degrees", "mean", "distance from the reference max", "mean"];

/// A(30) and distances over the mean edge.
pub(super) fn row(table: &mut Table, name: &str, shaped: &Shaped, of: fn(Change) -> f64) {
    let Some(told) = &shaped.report.shape else { return };
    let figure = |change: Option<Change>| change.map_or(String::new(), |c| format!("{:.3e}", of(c)));
    table.row([
        name.to_string(),
        figure(told.edge_error_max),
        figure(told.edge_error_mean),
        figure(told.angle_error_max),
        figure(told.angle_error_mean),
        figure(told.reference_distance_max),
        figure(told.reference_distance_mean),
    ]);
}
