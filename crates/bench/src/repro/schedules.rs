//! The comparison behind the default schedule.

use super::comparison::{Means, compare};
use super::context::Context;
use super::variants::Variant;
use crate::BenchError;
use crate::plot::{Axis, Line, Panel};
use crate::runs::CONVERGED;
use crate::table::{Table, cost};
use proxel::settings::{AdmmSettings, BaseWeight, DeformSettings, InnerStopName, LocalFrame, MethodName, Schedule};
use std::fmt::Write as _;

/// One thing that is changed.
type Change = (&'static str, fn(&mut AdmmSettings));

/// What the schedules differ in, and the line search that W leaves out; both values of each.
const CHANGES: [Change; 9] = [
    ("inner stop: step taken", |s| s.inner_stop = InnerStopName::StepTaken),
    ("inner stop: next step", |s| s.inner_stop = InnerStopName::NextStep),
    ("local frame: eigenvalues", |s| s.local_frame = LocalFrame::Eigenvalues),
    ("local frame: singular values", |s| s.local_frame = LocalFrame::SingularValues),
    ("base weight: slope", |s| s.base_weight = BaseWeight::Slope),
    ("base weight: rest Hessian", |s| s.base_weight = BaseWeight::RestHessian),
    ("base weight: geometric mean", |s| s.base_weight = BaseWeight::GeometricMean),
    ("line search: off", |s| s.line_search = false),
    ("line search: on", |s| s.line_search = true),
];

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let of = |name: &str, schedule: Schedule| Variant {
        name: name.to_string(),
        settings: DeformSettings { method: MethodName::Wrapd, ..DeformSettings::of(schedule) },
    };
    let default = of("default", Schedule::Default);
    let mut variants = vec![default.clone(), of("reference", Schedule::Reference), of("paper", Schedule::Paper)];
    let schedules = variants.len();
    for (name, change) in CHANGES {
        let mut variant = default.clone();
        variant.name = name.to_string();
        change(&mut variant.settings.admm);
        if variant.settings != default.settings {
            variant.name = format!("default with {name}");
            variants.push(variant);
        }
    }
    // The schedule is a name for the same settings; it must not hide that they are equal.
    for variant in &mut variants {
        variant.settings.schedule = Schedule::Default;
    }
    let runs = compare(context, &variants)?;
    let means: Vec<Means> = runs.iter().map(|runs| Means::of(runs)).collect();
    let header =
        ["schedule", "iterations", "inner steps", "seconds", "not reached", "seconds over those of the default"];
    let _ = writeln!(
        context.text,
        "WRAPD to a position error of 1e-4, geometric means over the models. A run that does not get there counts with all that it \
         did.\n"
    );
    for (title, range) in [("The schedules", 0..schedules), ("One change at a time", schedules..variants.len())] {
        let mut table = Table::new(header);
        for k in range {
            let over = format!("{:.3}", means[k].seconds / means[0].seconds);
            table.row([variants[k].name.clone()].into_iter().chain(means[k].cells()).chain([over]));
        }
        let _ = writeln!(context.text, "## {title}\n\n{table}");
    }
    let mut table = Table::new(["schedule".to_string()].into_iter().chain(context.models.iter().cloned()));
    for (variant, runs) in variants.iter().zip(&runs) {
        table.row([variant.name.clone()].into_iter().chain(runs.iter().map(|run| cost(run, CONVERGED))));
    }
    let _ = writeln!(context.text, "## Each model\n\nIterations (seconds).\n\n{table}");
    plot(context, &variants, &means)
}

/// Seconds against iterations of every variant, both over those of the default.
fn plot(context: &mut Context<'_>, variants: &[Variant], means: &[Means]) -> Result<(), BenchError> {
    let point = |m: &Means| (m.iterations / means[0].iterations, m.seconds / means[0].seconds);
    let lines: Vec<Line> = variants
        .iter()
        .zip(means)
        .enumerate()
        .map(|(k, (variant, m))| Line { label: variant.name.clone(), points: vec![point(m)], style: k, marked: true })
        .collect();
    let panel = Panel {
        title: "geometric means, relative to the default".to_string(),
        x_label: "iterations".to_string(),
        y_label: "seconds".to_string(),
        x: Axis::log_around(means.iter().map(|m| point(m).0).chain([0.7, 1.5])),
        y: Axis::log_around(means.iter().map(|m| point(m).1).chain([0.7, 1.5])),
        lines,
        map: None,
    };
    context.plot("", "Cost of WRAPD to 1e-4", &[panel])
}
