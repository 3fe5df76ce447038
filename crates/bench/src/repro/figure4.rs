//! Figure 4: what rotation awareness and reweighting do, each alone and together.

use super::context::{Context, position_panel};
use super::variants::Variant;
use crate::BenchError;
use crate::runs::{CONVERGED, LEVELS, Level, Run};
use crate::table::{Table, cost};
use proxel::settings::MethodName;
use std::fmt::Write as _;

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let multipliers = match (context.options.weight_scales.as_slice(), context.options.quick) {
        ([], false) => vec![0.25, 0.5, 1.0, 2.0, 4.0, 8.0],
        ([], true) => vec![0.5, 1.0, 4.0],
        (given, _) => given.to_vec(),
    };
    for name in context.models.clone() {
        let problem = context.load(&name)?;
        let mut one = |variant: Variant| context.run(&problem, &variant.name, variant.settings);
        let wrapd = one(Variant::of(MethodName::Wrapd))?;
        let w_admm = one(Variant::of(MethodName::WAdmm))?;
        let mut scaled = |method: MethodName| -> Result<Vec<Run>, BenchError> {
            multipliers.iter().map(|beta| one(Variant::scaled(method, *beta))).collect()
        };
        let r_admm = scaled(MethodName::RAdmm)?;
        let admm_pd = scaled(MethodName::AdmmPd)?;

        let _ = writeln!(
            context.text,
            "## {name}\n\nIterations (seconds) to each position error. Static methods are run with every multiplier beta of their \
             squared weights; left, each is drawn with its best one.\n"
        );
        let positions: Vec<Level> =
            LEVELS.iter().copied().filter(|level| matches!(level, Level::Position(_))).collect();
        let mut table = Table::new(["method".to_string()].into_iter().chain(positions.iter().map(Level::to_string)));
        for run in [&wrapd, &w_admm].into_iter().chain(&r_admm).chain(&admm_pd) {
            table.row([run.method.clone()].into_iter().chain(positions.iter().map(|level| cost(run, *level))));
        }
        let _ = writeln!(context.text, "{table}");

        // Styles: 0 wrapd, 1 w-admm, then r-admm and admm-pd each under its multipliers.
        let r_style = |k: usize| 2 + k;
        let mut left = vec![(&wrapd, 0), (&w_admm, 1)];
        if let Some(k) = best(&r_admm) {
            left.push((&r_admm[k], r_style(k)));
        }
        if let Some(k) = best(&admm_pd) {
            left.push((&admm_pd[k], r_style(multipliers.len())));
        }
        let mut right = vec![(&wrapd, 0)];
        right.extend(r_admm.iter().enumerate().map(|(k, run)| (run, r_style(k))));
        let panels = [
            position_panel("Rotation awareness and reweighting", &left),
            position_panel("R-ADMM under weight multipliers beta", &right),
        ];
        context.plot(&name, &name, &panels)?;
    }
    Ok(())
}

/// The run that reaches the lowest level first in seconds; where none does, the one that comes closest.
fn best(runs: &[Run]) -> Option<usize> {
    let rank = |run: &Run| match run.reached(CONVERGED) {
        Some(p) => (0.0, p.seconds),
        None => (1.0, run.points.iter().map(|p| p.position_error).fold(f64::INFINITY, f64::min)),
    };
    let ranks: Vec<(f64, f64)> = runs.iter().map(rank).collect();
    (0..runs.len()).min_by(|a, b| ranks[*a].0.total_cmp(&ranks[*b].0).then(ranks[*a].1.total_cmp(&ranks[*b].1)))
}
