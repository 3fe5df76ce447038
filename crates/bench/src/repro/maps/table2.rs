//! Table 2 of the WRAPD paper: iterations and seconds to the early and the late phase.

use super::{Target, cost, settings};
use crate::BenchError;
use crate::maps::{LATE, MapRun, Phase};
use crate::published::maps::{PAPER_METHODS, PublishedMap, of};
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::settings::UnwrapMethod;
use std::fmt::Write as _;

pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let _ = writeln!(
        context.text,
        "Iterations (seconds). eta: within 1 % of the least energy, by the energy of the local variable while triangles are \
         flipped, as the paper counts; beside it without flips. N_c: at a relative error of 1e-6, without flips. Methods with a \
         published column are followed by it, with its seconds on other hardware. A run ends after {} s.\n",
        super::PATIENCE
    );
    for name in context.models.clone() {
        let target = Target::load(context, &name)?;
        let mut table = Table::new([
            "method",
            "eta (tau) by energy_z",
            "eta (tau)",
            "N_c (t_c)",
            "paper: eta/N_c",
            "paper: tau/t_c",
            "last error",
            "s an iteration",
        ]);
        let mut runs = Vec::new();
        for method in UnwrapMethod::ALL {
            let settings = settings(context, method);
            match target.run(context, method.as_str(), &settings, LATE) {
                Ok(run) => {
                    table.row(row(&run, target.least, of(&name)));
                    runs.push(run);
                }
                Err(refusal) => table.row([method.as_str().to_string(), refusal.to_string()]),
            }
        }
        let size = format!("{} vertices, {} faces", target.mesh.n_verts(), target.mesh.faces.len());
        let _ = writeln!(context.text, "## {name}\n\n{size}. {}\n\n{table}", target.about);
        let _ = writeln!(context.text, "{}\n", fastest(&runs, target.least));
    }
    Ok(())
}

fn row(run: &MapRun, least: f64, published: Option<&PublishedMap>) -> Vec<String> {
    let mut cells = vec![run.method.clone()];
    cells.extend(Phase::ALL.map(|phase| cost(run, phase, least)));
    let column = PAPER_METHODS.iter().position(|name| *name == run.method);
    match (column, published) {
        (Some(column), Some(row)) => {
            let phases = &row.phases[column];
            cells.push(format!("{}/{}", phases.iterations[0], phases.iterations[1]));
            cells.push(format!("{}/{}", phases.seconds[0], phases.seconds[1]));
        }
        _ => cells.extend(["".to_string(), "".to_string()]),
    }
    let last = run.rows.last();
    cells.push(last.map_or("-".to_string(), |r| match r.flips {
        0 => format!("{:.1e}", r.energy / least - 1.0),
        n => format!("{n} flips"),
    }));
    let mean = match (run.rows.first(), last) {
        (Some(first), Some(last)) if last.iteration > 0 => (last.seconds - first.seconds) / last.iteration as f64,
        _ => f64::NAN,
    };
    cells.push(seconds(mean));
    cells
}

/// A sentence that sets `auto` against the fastest of the others.
fn fastest(runs: &[MapRun], least: f64) -> String {
    let time = |run: &MapRun, phase| run.reached(phase, least).map_or(f64::INFINITY, |row| row.seconds);
    let best = |phase: Phase| {
        let others = runs.iter().filter(|run| run.method != "auto");
        let best = others.min_by(|a, b| time(a, phase).total_cmp(&time(b, phase)))?;
        let auto = runs.iter().find(|run| run.method == "auto")?;
        let ratio = time(best, phase) / time(auto, phase);
        Some(format!(
            "{phase}: {} s against {} s of {}, {ratio:.2} times as fast",
            seconds(time(auto, phase)),
            seconds(time(best, phase)),
            best.method
        ))
    };
    let sentences: Vec<String> = [Phase::Early, Phase::Late].into_iter().filter_map(best).collect();
    format!("`auto` against the fastest other method, {}.", sentences.join("; "))
}
