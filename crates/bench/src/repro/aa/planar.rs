//! Planar faces: Figures 1 and 9.

use super::course::{Course, Residual};
use super::shapes::{LEVELS, Problem, Task, at_equal_time, meshes, sheet, table};
use super::{csv, most, panel};
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::shape::{Change, ShapeInput, ShapeMethod, ShapeSettings, Shaped};
use std::fmt::Write as _;

/// What was measured with the authors' code to 1e-3, 1e-4 and 1e-5; 0 where it was not reached.
const THEIRS: [(&str, &str, [usize; 3]); 7] = [
    ("costa", "admm", [122, 0, 0]),
    ("costa", "aa-admm m=1", [124, 800, 0]),
    ("costa", "aa-admm m=3", [55, 189, 470]),
    ("costa", "aa-admm m=6", [55, 176, 407]),
    ("costa", "aa-admm m=10", [55, 184, 409]),
    ("airport", "admm", [131, 0, 0]),
    ("airport", "aa-admm m=6", [35, 319, 0]),
];

/// Methods beside the two of the figure.
const OTHERS: [ShapeMethod; 4] = [ShapeMethod::Alm, ShapeMethod::Aadr, ShapeMethod::Shapeup, ShapeMethod::Auto];

/// All methods on a mesh of the data.
pub(super) fn compare(context: &mut Context<'_>, file: &str, name: &str) -> Result<(), BenchError> {
    let found = meshes(context, [&format!("{file}_poly.obj"), &format!("{file}_tri.obj")])?;
    let (name, input, source) = match found {
        Some([mesh, reference]) => (name, ShapeInput { mesh, reference: Some(reference) }, format!("Data: {name}.")),
        None => {
            let source = "Data: none; a wavy sheet stands in. Set PROXEL_DATA to the folder that holds `geometry/`.";
            ("sheet", ShapeInput { mesh: sheet(10), reference: None }, source.to_string())
        }
    };
    let task = Task::Planar(ShapeSettings::planarize());
    let problem = Problem { name: name.to_string(), input, task };
    let settings = ShapeSettings::planarize();
    let _ = writeln!(
        context.text,
        "{source}\n\n## The problem\n\nA(29): planarity hard, closeness {} and relative Laplacian fairing {} soft; z-x-u, mu = {}. \
         Residual: sqrt((|Dx - z|^2 + |D dx|^2) / N_z) / a, a the mean edge, without mu; with mu it is {:.1} times that. In \
         brackets proposals that were refused until then; after a slash: the authors' implementation, as measured.\n",
        settings.closeness,
        settings.fairing,
        settings.mu,
        settings.mu.sqrt()
    );
    let (mut courses, mut ends) = (Vec::new(), Table::new(HEADER));
    let full = most(context, 1000);
    ends_row(
        &mut ends,
        "input",
        None,
        &problem.shape(&problem.task.by(ShapeMethod::Admm, 0, 1), &mut Default::default())?,
    );
    for m in [0, 1, 3, 6, 10] {
        let (label, method) = match m {
            0 => ("admm".to_string(), ShapeMethod::Admm),
            _ => (format!("aa-admm m={m}"), ShapeMethod::AaAdmm),
        };
        let (course, shaped) = problem.course(context, &label, &problem.task.by(method, m, full))?;
        ends_row(&mut ends, &label, Some(course.points.len()), &shaped);
        courses.push(course);
    }
    for method in OTHERS {
        let mut settings = ShapeSettings::planarize_by(method);
        // Five solves an iteration.
        settings.max_iters = if method == ShapeMethod::Alm { full.div_ceil(5) } else { full };
        let shaped = problem.shape(&Task::Planar(settings), &mut Default::default())?;
        context.tell(&format!("{name}: {}: {}", method.as_str(), shaped.report.reason));
        ends_row(&mut ends, method.as_str(), Some(shaped.report.iterations), &shaped);
    }
    let _ = writeln!(context.text, "## Iterations\n\n{}", table(&courses, &THEIRS));
    let _ = writeln!(
        context.text,
        "## Results\n\nOver the mean edge. `alm` makes five solves an iteration; `shapeup` has the weights 150, 10 and 10 of the \
         implementation of Peng et al. 2018, and minimises something else; `auto` goes on to where all faces are \
         planar.\n\n{ends}"
    );
    let shown: Vec<&Course> = courses.iter().filter(|c| c.method == "admm" || c.method.ends_with("=6")).collect();
    let panels =
        [panel("iterations", &shown, Residual::Combined, false), panel("time", &shown, Residual::Combined, true)];
    context.plot(name, name, &panels)?;
    pictures(context, &problem, &courses)?;
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

const HEADER: [&str; 8] = [
    "method",
    "iterations",
    "planarity max",
    "mean",
    "distance from the reference max",
    "mean",
    "shortest edge",
    "seconds",
];

fn ends_row(table: &mut Table, name: &str, iterations: Option<usize>, shaped: &Shaped) {
    let Some(told) = &shaped.report.shape else { return };
    // Without iterations: as it came.
    let of = |change: Option<Change>, digits: usize| match (change, iterations) {
        (Some(c), Some(_)) => format!("{:.digits$e}", c.after),
        (Some(c), None) => format!("{:.digits$e}", c.before),
        _ => String::new(),
    };
    let took = iterations.map_or(String::new(), |_| seconds(shaped.report.seconds.solve));
    table.row([
        name.to_string(),
        iterations.map_or(String::new(), |n| n.to_string()),
        of(told.planarity_max, 2),
        of(told.planarity_mean, 2),
        of(told.reference_distance_max, 3),
        of(told.reference_distance_mean, 3),
        of(told.shortest_edge, 2),
        took,
    ]);
}

/// Both at the time that m = 6 takes for 200 iterations.
fn pictures(context: &mut Context<'_>, problem: &Problem, courses: &[Course]) -> Result<(), BenchError> {
    let of = |method: &str| courses.iter().find(|c| c.method == method);
    let (Some(plain), Some(fast)) = (of("admm"), of("aa-admm m=6")) else { return Ok(()) };
    let until = fast.points.len().min(200);
    let fast = Course { points: fast.points[..until].to_vec(), ..fast.clone() };
    let equal = at_equal_time(plain, &fast);
    let quiet = &mut Default::default();
    let before = problem.shape(&problem.task.by(ShapeMethod::Admm, 0, equal), quiet)?;
    let after = problem.shape(&problem.task.by(ShapeMethod::AaAdmm, 6, until), quiet)?;
    let of = |shaped: &Shaped| problem.at_vertices(shaped, 0);
    problem.picture(context, &problem.name, &[(&before, of(&before)), (&after, of(&after))])?;
    let mut table = Table::new(["at equal time", "iterations", "planarity max", "mean"]);
    for (name, iterations, shaped) in [("admm", equal, &before), ("aa-admm m=6", until, &after)] {
        let told = shaped.report.shape.as_ref();
        let figure = |c: Option<Change>| c.map_or(String::new(), |c| format!("{:.2e}", c.after));
        table.row([
            name.to_string(),
            iterations.to_string(),
            figure(told.and_then(|t| t.planarity_max)),
            figure(told.and_then(|t| t.planarity_mean)),
        ]);
    }
    let file = context.file(&format!("{}.png", problem.name));
    let _ = writeln!(context.text, "![planarity, ADMM and AA-ADMM at equal time]({file})\n\n{table}");
    Ok(())
}
