//! How iterations and their time grow when every tetrahedron becomes 8.

use super::memory::peak_bytes;
use crate::BenchError;
use crate::data::{Model, solved};
use crate::parts::centaur_or_beam;
use crate::runs::{Level, Run, Runner};
use crate::table::{Table, seconds};
use proxel::settings::{DeformSettings, MethodName};

/// Gradient of the minima that errors are measured against: their own errors are far below the level.
const TOLERANCE: f64 = 1e-8;

/// Solves a model and its refinement to a position error of 1e-3, each against its own minimum; minutes.
///
/// # Errors
/// A model that cannot be read, refined or solved.
pub fn growth(tell: &mut dyn FnMut(&str)) -> Result<String, BenchError> {
    let level = Level::Position(1e-3);
    let coarse = centaur_or_beam()?;
    let fine = coarse.refined()?;
    let mut table =
        Table::new(["model", "tetrahedra", "iterations to 1e-3", "seconds", "ms an iteration", "peak so far"]);
    for model in [coarse, fine] {
        tell(&format!("{}: its minimum", model.name));
        let model: Model = if model.input.reference.is_some() { model } else { solved(model, TOLERANCE)? };
        let least_energy = model.least_energy()?;
        tell(&format!("{}: to 1e-3", model.name));
        let runner = Runner { model: &model, least_energy, levels: &[level], repeats: 1 };
        let run: Run = runner.run(
            "wrapd",
            &DeformSettings { method: MethodName::Wrapd, threads: Some(2), ..DeformSettings::default() },
        )?;
        let first = run.points.first().map_or(0.0, |p| p.seconds);
        let last = run.last();
        let reached = run.reached(level).map_or("not reached".to_string(), |p| p.iteration.to_string());
        table.row([
            model.name.clone(),
            model.input.rest.tets.len().to_string(),
            reached,
            seconds(last.seconds),
            format!("{:.1}", (last.seconds - first) / last.iteration.max(1) as f64 * 1e3),
            format!("{:.2} GB", peak_bytes()? as f64 / 1e9),
        ]);
    }
    Ok(table.to_string())
}
