//! Figure 2: why the length is a better coordinate than the edge vector.

use super::context::Context;
use super::spring::chain;
use super::variants::Variant;
use crate::BenchError;
use crate::plot::{Axis, Line, Map, Panel};
use crate::runs::{CONVERGED, Run};
use crate::table::{Table, seconds};
use proxel::model::energy::{Energy, Spring};
use proxel::settings::{BaseWeight, Material, MethodName};
use std::fmt::Write as _;

/// Stretch of the chains: under tension, so that the straight line is the only solution.
const STRETCH: f64 = 1.2;

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    energy(context)?;
    let quick = context.options.quick;
    let angles: &[f64] = if quick { &[30.0, 90.0] } else { &[0.0, 15.0, 30.0, 60.0, 90.0, 120.0, 150.0] };
    let lengths: &[usize] = if quick { &[4, 8] } else { &[4, 8, 16, 32, 64] };
    let by_angle = chains(context, angles.iter().map(|degrees| (*degrees, 8, *degrees)))?;
    let by_length = chains(context, lengths.iter().map(|n| (*n as f64, *n, 90.0)))?;
    let _ = writeln!(
        context.text,
        "## Chains that have to turn\n\nA chain of unit springs; its ends are turned about its middle and pulled to {STRETCH} times \
         its length, its inner nodes start at rest. Iterations to a position error of 1e-4, and the solves with the prefactored \
         matrix that they took (inner steps): one an iteration where the coupling is linear. Both methods have the weights \
         of W(21). A rotation-aware splitting of springs that stay close to their length is done as soon as its global \
         step is; one with a linear coupling turns every edge vector a little in each iteration.\n"
    );
    let mut table =
        Table::new(["problem", "admm-pd: iterations", "solves", "seconds", "r-admm: iterations", "solves", "seconds"]);
    let mut rows: Vec<&(f64, [Run; 2])> = by_angle.iter().collect();
    rows.extend(by_length.iter().filter(|(n, _)| *n != 8.0));
    for (_, runs) in rows {
        let mut row = vec![runs[0].problem.clone()];
        for run in runs {
            row.extend(match run.reached(CONVERGED) {
                Some(p) => [p.iteration.to_string(), p.inner.to_string(), seconds(p.seconds)],
                None => [format!("not in {}", run.last().iteration), run.last().inner.to_string(), String::new()],
            });
        }
        table.row(row);
    }
    let _ = writeln!(context.text, "{table}");
    let panels = [
        solves_panel("A chain of 8 springs", "degrees to turn", &by_angle, false),
        solves_panel("A turn by 90 degrees", "springs in the chain", &by_length, true),
    ];
    context.plot("chains", "Solves to a position error of 1e-4", &panels)
}

/// The energy over the edge vector and over its length.
fn energy(context: &mut Context<'_>) -> Result<(), BenchError> {
    let spring = Spring { stiffness: 1.0 };
    let of_length = |length: f64| Energy::<1>::value(&spring, [length]);
    let reach = 2.0;
    let cells = 60;
    let at = |k: usize| -reach + 2.0 * reach * (k as f64 + 0.5) / cells as f64;
    let values = (0..cells * cells).map(|k| of_length(at(k % cells).hypot(at(k / cells))) / 0.5).collect();
    let circle = (0..=72).map(|k| f64::from(k) * std::f64::consts::TAU / 72.0).map(|t| (t.cos(), t.sin())).collect();
    let line = |label: &str, points, style| Line { label: label.to_string(), points, style, marked: false };
    let panels = [
        Panel {
            title: "over the edge vector e".to_string(),
            x_label: "e_x".to_string(),
            y_label: "e_y".to_string(),
            x: Axis::linear(-reach, reach),
            y: Axis::linear(-reach, reach),
            lines: vec![line("minima", circle, 1)],
            map: Some(Map { cells, values }),
        },
        Panel {
            title: "over the length |e|".to_string(),
            x_label: "|e|".to_string(),
            y_label: "energy".to_string(),
            x: Axis::linear(0.0, reach),
            y: Axis::linear(0.0, 0.55),
            lines: vec![line("energy", (0..=80).map(|k| f64::from(k) / 40.0).map(|s| (s, of_length(s))).collect(), 0)],
            map: None,
        },
    ];
    let ridge = of_length(0.0);
    let _ = writeln!(
        context.text,
        "## The energy of a unit spring\n\nOver the edge vector its minima are a circle around a maximum of {ridge} at e = 0 (dark: \
         low); over the length it is strictly convex.\n"
    );
    context.plot("energy", "Energy of a unit spring", &panels)
}

/// A value that is varied, and the runs of both methods at it.
type Pairs = Vec<(f64, [Run; 2])>;

/// Runs both methods on chains of (value that is varied, springs, degrees).
fn chains(context: &mut Context<'_>, problems: impl Iterator<Item = (f64, usize, f64)>) -> Result<Pairs, BenchError> {
    problems
        .map(|(value, n, degrees)| {
            let model = chain(n, degrees.to_radians(), STRETCH);
            let least_energy = model.least_energy_of(&material())?;
            let problem = (model, least_energy);
            let mut one = |method: MethodName| {
                let mut variant = Variant::of(method);
                variant.settings.material = material();
                variant.settings.admm.base_weight = BaseWeight::RestHessian;
                context.run(&problem, &variant.name, variant.settings)
            };
            Ok((value, [one(MethodName::AdmmPd)?, one(MethodName::RAdmm)?]))
        })
        .collect()
}

/// Springs whose energy is 1/2 (length - 1)^2.
fn material() -> Material {
    Material { energy: "spring".to_string(), young: 1.0, poisson: 0.0, ..Material::default() }
}

fn solves_panel(title: &str, x_label: &str, runs: &[(f64, [Run; 2])], log: bool) -> Panel {
    let lines: Vec<Line> = (0..2)
        .map(|m| Line {
            label: runs.first().map_or(String::new(), |(_, r)| r[m].method.clone()),
            points: runs.iter().filter_map(|(x, r)| Some((*x, r[m].reached(CONVERGED)?.inner as f64))).collect(),
            style: m,
            marked: true,
        })
        .collect();
    let xs = || runs.iter().map(|(x, _)| *x);
    let last = xs().fold(0.0, f64::max);
    Panel {
        title: title.to_string(),
        x_label: x_label.to_string(),
        y_label: "solves".to_string(),
        x: if log { Axis::log_around(xs()) } else { Axis::linear(0.0, last) },
        y: Axis::log_around(lines.iter().flat_map(|l| &l.points).map(|p| p.1)),
        lines,
        map: None,
    }
}
