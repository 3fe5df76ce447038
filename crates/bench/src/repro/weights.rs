//! Weights beyond one slope fit an element, and Anderson acceleration: what docs/weights.md tells.

use super::context::Context;
use super::variants::Variant;
use crate::BenchError;
use crate::data::{self, Model};
use crate::metric::{Attempt, Candidates, Count, Global, Moduli, Motion, Trial, VectorModel, VectorSettings};
use crate::runs::{CONVERGED, Run};
use crate::table::Table;
use proxel::model::energy::Energy;
use proxel::settings::{BaseWeight, DeformSettings, Material, MethodName};
use proxel::split::{Hardening, LbfgsSettings, Reweighting};
use std::fmt::Write as _;

/// Poisson's ratios of the beams.
const BEAMS: [f64; 2] = [0.45, 0.49];
/// Those of the models; the last is what makes ADMM slow whatever the weights.
const MODELS: [f64; 4] = [0.45, 0.47, 0.49, 0.499];
/// Windows of Anderson acceleration.
const WINDOWS: [usize; 3] = [0, 3, 6];
/// Iterations after which a beam is given up.
const MOST: usize = 400;

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    context.set_levels(&[CONVERGED]);
    base_weights(context)?;
    anderson(context)?;
    metrics(context)
}

/// Iterations and inner steps to 1e-4.
fn counts(run: &Run) -> String {
    run.reached(CONVERGED).map_or_else(
        || format!("- ({:.0e} after {})", run.last().position_error, run.last().iteration),
        |point| format!("{} + {}", point.iteration, point.inner),
    )
}

/// `wrapd` and `auto` from the slope fit and from the geometric mean.
fn base_weights(context: &mut Context<'_>) -> Result<(), BenchError> {
    let variants = [
        (MethodName::Wrapd, BaseWeight::Slope, "`wrapd`, slope fit"),
        (MethodName::Wrapd, BaseWeight::GeometricMean, "`wrapd`, geometric mean"),
        (MethodName::Auto, BaseWeight::Slope, "`auto`, slope fit"),
        (MethodName::Auto, BaseWeight::GeometricMean, "`auto`, geometric mean"),
    ];
    let mut table = Table::new(["model", "nu"].into_iter().chain(variants.map(|(_, _, name)| name)));
    for name in context.models.clone() {
        let (model, least_energy) = context.load(&name)?;
        let values = if context.options.quick { &MODELS[..1] } else { &MODELS };
        for &poisson in values {
            let material = Material { poisson, ..Material::default() };
            let problem = if poisson == Material::default().poisson {
                (model.clone(), least_energy)
            } else {
                let solved = data::solved_of(model.clone(), &material, 1e-9)?;
                let least_energy = solved.least_energy_of(&material)?;
                (Model { name: format!("{name} nu={poisson}"), ..solved }, least_energy)
            };
            let mut row = vec![name.clone(), poisson.to_string()];
            for (method, base, label) in variants {
                let mut settings = DeformSettings { method, material: material.clone(), ..DeformSettings::default() };
                settings.admm.base_weight = base;
                row.push(counts(&context.run(&problem, label, settings)?));
            }
            table.row(row);
        }
    }
    let _ = writeln!(
        context.text,
        "## The first weight\n\nIterations + inner steps to a position error of 1e-4.\n\n{table}"
    );
    Ok(())
}

/// `wrapd` with and without Anderson acceleration.
fn anderson(context: &mut Context<'_>) -> Result<(), BenchError> {
    let mut table = Table::new(["model".to_string()].into_iter().chain(WINDOWS.map(|m| format!("M = {m}"))));
    for name in context.models.clone() {
        let problem = context.load(&name)?;
        let mut row = vec![name.clone()];
        for window in WINDOWS {
            let mut variant = Variant::of(MethodName::Wrapd);
            variant.settings.anderson.others = window;
            row.push(counts(&context.run(&problem, &format!("wrapd M={window}"), variant.settings)?));
        }
        table.row(row);
    }
    let _ = writeln!(
        context.text,
        "## Anderson acceleration of `wrapd`\n\nIterations + inner steps to a position error of 1e-4.\n\n{table}"
    );
    Ok(())
}

/// Metrics of two moduli on beams.
fn metrics(context: &mut Context<'_>) -> Result<(), BenchError> {
    let (cells, most) = if context.options.quick { ([6, 2, 2], 100) } else { ([12, 4, 4], MOST) };
    let mut table: Option<Table> = None;
    for motion in Motion::ALL {
        for poisson in BEAMS {
            let material = Material { poisson, ..Material::default() };
            let name = format!("{}, {poisson}", motion.name());
            context.tell(&format!("beam: {name}"));
            let trial = Trial::new(&data::solved_of(motion.model(cells)?, &material, 1e-10)?, &material)?;
            let attempts = attempts(&trial);
            let mut row = vec![name];
            for (label, attempt) in &attempts {
                let counts = trial.run(attempt, most)?;
                let tell = |count: Option<Count>| {
                    count.map_or("-".to_string(), |count| format!("{} + {}", count.iterations, count.inner))
                };
                context.tell(&format!("  {label}: {}", tell(counts.close)));
                row.push(format!("{}; {}", tell(counts.close), tell(counts.converged)));
            }
            let header = || ["beam, nu"].into_iter().chain(attempts.iter().map(|(label, _)| *label));
            table.get_or_insert_with(|| Table::new(header())).row(row);
        }
    }
    if let Some(table) = table {
        let _ = writeln!(
            context.text,
            "## Metrics\n\nBeams of {} x {} x {} cells of six tetrahedra; g is the geometric mean of d and v at rest. \
             Iterations + inner steps to a position error of 1e-4; to a gradient ratio of 1e-9. A dash: not in {most} \
             iterations.\n\n{table}",
            cells[0], cells[1], cells[2]
        );
    }
    Ok(())
}

/// What is tried on a beam.
fn attempts(trial: &Trial) -> Vec<(&'static str, Attempt)> {
    let slope = Energy::<3>::slope_stiffness(trial.energy());
    let g = Energy::<3>::mean_stiffness(trial.energy());
    let rest = Moduli::of_hessian(trial.energy(), [1.0; 3]);
    let lbfgs = |mix| Global::Scalar { mix, settings: LbfgsSettings { line_search: true, ..LbfgsSettings::default() } };
    let vector = |refresh, kappa, max_inner| {
        let (model, window) = (VectorModel::GaussNewton, 8);
        Global::Vector(VectorSettings { model, refresh, window, kappa, max_inner })
    };
    let schedule = Reweighting { hardening: Some(Hardening::default()), ..Reweighting::quasi_static() };
    let (largest, each) = (Some((Candidates::Largest, schedule)), Some((Candidates::Each, schedule)));
    let mean = Some((Candidates::GeometricMean, schedule));
    let pair = |d: f64, v: f64| Moduli { deviatoric: d * g, volumetric: v * g };
    let of = |base, reweighting, global| Attempt { base, reweighting, global };
    vec![
        ("slope fit", of(Moduli::scalar(slope), largest, lbfgs(1.0))),
        ("g", of(Moduli::scalar(g), largest, lbfgs(1.0))),
        ("g, followed", of(Moduli::scalar(g), mean, lbfgs(1.0))),
        ("g, exact steps", of(Moduli::scalar(g), None, vector(1, 1e-4, 60))),
        ("d = g/2, v = g", of(pair(0.5, 1.0), None, lbfgs(0.5))),
        ("d = g/2, v = 2g", of(pair(0.5, 2.0), None, lbfgs(0.5))),
        ("d = g/2, v = g, exact steps", of(pair(0.5, 1.0), None, vector(1, 1e-4, 60))),
        ("d = g/2, v = g, followed", of(pair(0.5, 1.0), each, lbfgs(0.5))),
        ("d, v at rest", of(rest, None, lbfgs(0.5))),
        ("d, v at rest, vector form", of(rest, None, vector(10, 1.0, 20))),
        ("d, v at rest, exact steps", of(rest, None, vector(1, 1e-4, 60))),
    ]
}
