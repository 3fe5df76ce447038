//! Table 3 and Figure 10 of the WRAPD paper: how the early phase grows with subdivision.

use super::settings;
use crate::BenchError;
use crate::maps::{self, EARLY, MapRun, Phase};
use crate::plot::{Axis, Line, Panel};
use crate::published::maps::TABLE_3;
use crate::repro::context::{Context, Reached};
use crate::table::{Table, seconds};
use proxel::mesh::{Mesh, refine};
use proxel::settings::{UnwrapMethod, UnwrapSettings};
use std::fmt::Write as _;

const METHODS: [UnwrapMethod; 4] = [UnwrapMethod::Auto, UnwrapMethod::Wrapd, UnwrapMethod::WrapdCm, UnwrapMethod::Cm];

/// Subdivisions, each into four; more where `--count` asks.
const TIMES: usize = 2;

/// Steps that `auto` goes on for from a mesh's early phase, to find its least energy: Newton's are few there.
const TOLERANCE: f64 = 1e-5;

pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let times = context.options.count.unwrap_or(if context.options.quick { 1 } else { TIMES });
    let _ = writeln!(
        context.text,
        "Each subdivision splits every triangle into four at the middles of its sides. Iterations (seconds) to within 1 % of the \
         least energy without flips, which is that of `auto` at a gradient ratio of {TOLERANCE:e}; \"late\" goes on to 1e-6. A \
         method is not tried on the next size after {} s.\n",
        4.0 * super::PATIENCE
    );
    let mut panels = Vec::new();
    for name in context.models.clone() {
        let mut mesh = maps::load(&name)?;
        let mut table = Table::new(
            ["triangles".to_string(), "least energy".to_string()]
                .into_iter()
                .chain(METHODS.map(|m| m.as_str().to_string()))
                .chain(["auto, late".to_string()]),
        );
        let mut times_of: Vec<Vec<(f64, f64)>> = vec![Vec::new(); METHODS.len()];
        let mut given_up = [false; METHODS.len()];
        for k in 0..=times {
            if k > 0 {
                mesh = refined(&mesh)?;
            }
            let faces = mesh.faces.len();
            let problem = format!("{name} of {faces} triangles");
            let (auto, least) = minimum(context, &mesh)?;
            let mut row = vec![faces.to_string(), format!("{least:.8}")];
            for (column, method) in METHODS.into_iter().enumerate() {
                if given_up[column] {
                    row.push("not tried".to_string());
                    continue;
                }
                let run = match method {
                    UnwrapMethod::Auto => auto.clone(),
                    _ => {
                        let settings = long(context, method);
                        maps::run(&mesh, method.as_str(), &settings, (1.0 + EARLY) * least, context.options.repeats)?
                    }
                };
                let at = run.reached(Phase::Early, least).map(|r| (r.iteration, r.seconds));
                context.reached.push(Reached {
                    problem: problem.clone(),
                    method: method.as_str().to_string(),
                    level: Phase::Early.to_string(),
                    at,
                });
                match at {
                    Some((iterations, time)) => {
                        times_of[column].push((faces as f64, time));
                        row.push(format!("{iterations} ({})", seconds(time)));
                    }
                    None => {
                        given_up[column] = true;
                        row.push(format!("not in {}", run.rows.last().map_or(0, |r| r.iteration)));
                    }
                }
                context.tell(&format!("{problem}: {}: {}", method.as_str(), row[row.len() - 1]));
            }
            row.push(super::cost(&auto, Phase::Late, least));
            table.row(row);
        }
        let _ = writeln!(context.text, "## {name}\n\n{table}\n{}\n", exponents(&times_of));
        panels.push(panel(&name, &times_of));
    }
    let mut paper = Table::new(["thousands of triangles", "wrapd", "wrapd+cm", "cm"]);
    for (thousands, columns) in TABLE_3 {
        let cells = columns.map(|(iterations, time)| format!("{iterations} ({time})"));
        paper.row([thousands.to_string()].into_iter().chain(cells));
    }
    let _ = writeln!(context.text, "## Table 3 of the paper\n\nLucy, eta (tau) on a ten-core i9-10900K.\n\n{paper}");
    context.plot("", "Seconds of the early phase against size", &panels)
}

fn long(context: &Context<'_>, method: UnwrapMethod) -> UnwrapSettings {
    let settings = settings(context, method);
    UnwrapSettings { time_limit: settings.time_limit.map(|limit| 4.0 * limit), ..settings }
}

/// The run of `auto` to its end, with the least energy.
fn minimum(context: &mut Context<'_>, mesh: &Mesh) -> Result<(MapRun, f64), BenchError> {
    let settings = UnwrapSettings { tol: TOLERANCE, ..long(context, UnwrapMethod::Auto) };
    let run = maps::run(mesh, "auto", &settings, 0.0, context.options.repeats)?;
    let flip_free = run.rows.iter().filter(|r| r.flips == 0);
    let least = flip_free.map(|r| r.energy).fold(f64::INFINITY, f64::min);
    match least.is_finite() {
        true => Ok((run, least)),
        false => Err(BenchError(format!("{}: auto found no map without flips: {}", mesh.name, run.reason))),
    }
}

fn refined(mesh: &Mesh) -> Result<Mesh, BenchError> {
    let fine = refine::refine(mesh).map_err(BenchError::from_display)?;
    Ok(Mesh { name: mesh.name.clone(), ..fine.mesh })
}

/// The least-squares slope of log seconds over log triangles, of each method.
fn exponents(times: &[Vec<(f64, f64)>]) -> String {
    let slope = |points: &[(f64, f64)]| {
        let logs: Vec<(f64, f64)> = points.iter().map(|(n, t)| (n.ln(), t.ln())).collect();
        let n = logs.len() as f64;
        let (x, y) = logs.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
        let (up, down) =
            logs.iter().fold((0.0, 0.0), |s, p| (s.0 + (p.0 - x) * (p.1 - y), s.1 + (p.0 - x) * (p.0 - x)));
        up / down
    };
    let cells: Vec<String> = METHODS
        .iter()
        .zip(times)
        .filter(|(_, points)| points.len() > 1)
        .map(|(method, points)| format!("{} n^{:.2}", method.as_str(), slope(points)))
        .collect();
    format!("Growth of the early phase's time: {} (asked of `auto`: at most n^1.2).", cells.join(", "))
}

fn panel(name: &str, times: &[Vec<(f64, f64)>]) -> Panel {
    let of = |(style, method): (usize, &UnwrapMethod)| Line {
        label: method.as_str().to_string(),
        points: times.get(style).cloned().unwrap_or_default(),
        style,
        marked: true,
    };
    let lines: Vec<Line> = METHODS.iter().enumerate().map(of).collect();
    let points = || lines.iter().flat_map(|l| &l.points);
    Panel {
        title: name.to_string(),
        x_label: "triangles".to_string(),
        y_label: "seconds".to_string(),
        x: Axis::log_around(points().map(|p| p.0)),
        y: Axis::log_around(points().map(|p| p.1)),
        lines,
        map: None,
    }
}
