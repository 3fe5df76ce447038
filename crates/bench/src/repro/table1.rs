//! Table 1 and the convergence of Figures 1, 6 and 7.

use super::context::{Context, energy_panel, position_panel};
use super::variants;
use crate::BenchError;
use crate::data::{self, BEAM, Model};
use crate::published::{self, PAPER_METHODS};
use crate::runs::{CONVERGED, LEVELS, Level, Run};
use crate::table::{Table, cost, seconds};
use proxel::settings::{DeformSettings, Material};
use std::fmt::Write as _;

/// Poisson's ratios of the nearly incompressible rows, and the models that they are tried on: the three that solve fast,
/// one of each figure of the paper.
const NEARLY_INCOMPRESSIBLE: [f64; 2] = [0.49, 0.499];
const SQUEEZED: [&str; 4] = ["stretch", "shear", "homer", BEAM];

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    context.set_levels(&LEVELS);
    let multipliers = match (context.options.weight_scales.as_slice(), context.options.quick) {
        ([], false) => vec![1.0, 4.0],
        ([], true) => vec![1.0],
        (given, _) => given.to_vec(),
    };
    let mut results: Vec<(Model, Vec<Run>)> = Vec::new();
    for name in context.models.clone() {
        let problem = context.load(&name)?;
        let mut runs = Vec::new();
        for variant in variants::all(&multipliers) {
            runs.push(context.run(&problem, &variant.name, variant.settings)?);
        }
        results.push((problem.0, runs));
    }
    let _ = writeln!(
        context.text,
        "## Iterations and seconds to a position error of 1e-4\n\nColumns that start with \"paper\" are Table 1 (ten cores); its \
         static weights were tuned by multipliers that it does not list. Ours are tried with the multipliers beta that their \
         columns name.\n"
    );
    summary(context, &results);
    default_against_best(context, &results);
    nearly_incompressible(context, &multipliers)?;
    levels(context, &results);
    reference_code(context, &results);
    let _ = writeln!(context.text, "## Convergence (Figures 1, 6, 7)\n");
    for (model, runs) in &results {
        let styled: Vec<(&Run, usize)> = runs.iter().enumerate().map(|(k, run)| (run, k)).collect();
        let figure = published::of(&model.name).map_or(String::new(), |p| format!(", Figure {}", p.paper.figure));
        let panels = [position_panel("Position error", &styled), energy_panel("Energy error", &styled)];
        context.plot(&model.name, &format!("{}{figure}", model.name), &panels)?;
    }
    Ok(())
}

/// Iterations and seconds to 1e-4, beside the paper's.
fn summary(context: &mut Context<'_>, results: &[(Model, Vec<Run>)]) {
    let Some((_, first)) = results.first() else { return };
    let mut header = vec!["Fig.".to_string(), "model".to_string(), "V/T (10^3)".to_string()];
    header.extend(first.iter().map(|run| run.method.clone()));
    header.extend(PAPER_METHODS.map(|m| format!("paper {m}")));
    let mut table = Table::new(header);
    for (model, runs) in results {
        let published = published::of(&model.name);
        let figure = published.map_or("", |p| p.paper.figure);
        let mut row = vec![figure.to_string(), model.name.clone(), model.size()];
        row.extend(runs.iter().map(|run| cost(run, CONVERGED)));
        row.extend((0..PAPER_METHODS.len()).map(|m| {
            published
                .map_or(String::new(), |p| format!("{} ({} s)", p.paper.costs[m].iterations, p.paper.costs[m].seconds))
        }));
        table.row(row);
    }
    let _ = writeln!(context.text, "{table}");
}

/// What the default loses to the best method on each model, at most.
fn default_against_best(context: &mut Context<'_>, results: &[(Model, Vec<Run>)]) {
    let mut table = Table::new(["model", "auto, s", "best, s", "best method", "auto over best"]);
    for (model, runs) in results {
        let time = |run: &Run| run.reached(CONVERGED).map_or(f64::INFINITY, |p| p.seconds);
        let Some(auto) = runs.iter().find(|run| run.method == "auto").map(time) else { continue };
        let Some(best) = runs.iter().min_by(|a, b| time(a).total_cmp(&time(b))) else { continue };
        table.row([
            model.name.clone(),
            seconds(auto),
            seconds(time(best)),
            best.method.clone(),
            format!("{:.2}", auto / time(best)),
        ]);
    }
    let _ = writeln!(
        context.text,
        "To 1e-4 `auto` is to take at most 1.25 times the seconds of the best method.\n\n{table}"
    );
}

/// The same with Poisson's ratios near 1/2. The minimum is another one: it is solved for first.
fn nearly_incompressible(context: &mut Context<'_>, multipliers: &[f64]) -> Result<(), BenchError> {
    let mut results: Vec<(Model, Vec<Run>)> = Vec::new();
    let names: Vec<String> = context.models.iter().filter(|name| SQUEEZED.contains(&name.as_str())).cloned().collect();
    let _ = writeln!(context.text, "## Nearly incompressible\n\nThe same with other Poisson's ratios nu.\n");
    for name in names {
        let (model, _) = context.load(&name)?;
        for poisson in NEARLY_INCOMPRESSIBLE {
            let material = Material { poisson, ..Material::default() };
            context.tell(&format!("{name}: solving for its minimum with nu = {poisson}"));
            let solved = match data::solved_of(model.clone(), &material, 1e-9) {
                Ok(solved) => solved,
                Err(e) => {
                    let _ = writeln!(context.text, "nu = {poisson} is left out: {e}\n");
                    continue;
                }
            };
            let least_energy = solved.least_energy_of(&material)?;
            let problem = (Model { name: format!("{name} nu={poisson}"), ..solved }, least_energy);
            let mut runs = Vec::new();
            for variant in variants::all(multipliers) {
                let settings = DeformSettings { material: material.clone(), ..variant.settings };
                runs.push(context.run(&problem, &variant.name, settings)?);
            }
            results.push((problem.0, runs));
        }
    }
    summary(context, &results);
    Ok(())
}

/// Every level of every run.
fn levels(context: &mut Context<'_>, results: &[(Model, Vec<Run>)]) {
    let _ = writeln!(context.text, "## All levels\n\nIterations (seconds).\n");
    let mut header = vec!["model".to_string(), "method".to_string()];
    header.extend(LEVELS.map(|level| match level {
        Level::Position(_) => format!("position {level}"),
        Level::Energy(_) => level.to_string(),
    }));
    let mut table = Table::new(header);
    for run in results.iter().flat_map(|(_, runs)| runs) {
        let mut row = vec![run.problem.clone(), run.method.clone()];
        row.extend(LEVELS.map(|level| {
            run.reached(level).map_or("-".to_string(), |p| format!("{} ({})", p.iteration, seconds(p.seconds)))
        }));
        table.row(row);
    }
    let _ = writeln!(context.text, "{table}");
}

/// WRAPD beside the authors' code.
fn reference_code(context: &mut Context<'_>, results: &[(Model, Vec<Run>)]) {
    let mut table = Table::new([
        "model",
        "iterations to 1e-1 1e-2 1e-3 1e-4: ours",
        "authors' code",
        "ms an iteration: ours",
        "authors' code, 1 thread, loaded machine (local + global)",
        "L-BFGS steps: ours",
        "authors' code",
        "reweighted at: ours",
        "authors' code",
    ]);
    for (model, runs) in results {
        let Some(run) = runs.iter().find(|run| run.method == "wrapd") else { continue };
        let Some(code) = published::of(&model.name).map(|p| p.code) else { continue };
        let last = run.last();
        let first = run.points.first().map_or(0.0, |p| p.seconds);
        let ours = LEVELS.iter().filter(|level| matches!(level, Level::Position(_)));
        let ours = ours.map(|level| run.reached(*level).map_or("-".to_string(), |p| p.iteration.to_string()));
        let list = |numbers: &[usize]| numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(" ");
        let iterations = last.iteration.max(1) as f64;
        table.row([
            model.name.clone(),
            ours.collect::<Vec<_>>().join(" "),
            code.iterations.map(|n| n.to_string()).join(" "),
            format!("{:.2}", (last.seconds - first) / iterations * 1e3),
            format!("{} + {}", code.local_global_ms[0], code.local_global_ms[1]),
            format!("{:.2}", last.inner as f64 / iterations),
            code.inner.to_string(),
            list(&run.reweighted),
            code.reweighted.to_string(),
        ]);
    }
    if !table.is_empty() {
        let _ = writeln!(context.text, "## WRAPD beside its authors' code\n\n{table}");
    }
}
