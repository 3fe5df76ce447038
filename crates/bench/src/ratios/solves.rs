//! Whole solves against the wall time of the authors' code.

use super::{Row, Threshold};
use crate::BenchError;
use crate::data;
use crate::published::CODE_WALL_SECONDS;
use crate::runs::{CONVERGED, Runner};
use crate::table::seconds;
use proxel::settings::{DeformSettings, MethodName};

pub(super) fn rows(tell: &mut dyn FnMut(&str)) -> Result<Vec<Row>, BenchError> {
    let found = data::found();
    let mut rows = Vec::new();
    for (name, theirs) in CODE_WALL_SECONDS {
        if !found.iter().any(|f| f == name) {
            tell(&format!("{name}: not found; its row is left out"));
            continue;
        }
        tell(&format!("{name}: solving to 1e-4"));
        let model = data::load(name)?;
        let least_energy = model.least_energy()?;
        let runner = Runner { model: &model, least_energy, levels: &[CONVERGED], repeats: 3 };
        for method in [MethodName::Wrapd, MethodName::Auto] {
            let settings = DeformSettings { method, threads: Some(2), ..DeformSettings::default() };
            let run = runner.run(method.as_str(), &settings)?;
            let Some(end) = run.reached(CONVERGED) else { return Err(BenchError(format!("{name}: {}", run.reason))) };
            let ours = model.read + end.seconds;
            rows.push(Row {
                quantity: format!(
                    "{name} to 1e-4, wall: the authors' code with MKL, 2 threads, {theirs} s (not run here)"
                ),
                against: format!("{}, 2 threads, reading included: {} iterations", method.as_str(), end.iteration),
                figures: format!("{} s", seconds(ours)),
                ratio: Some(theirs / ours),
                of_medians: None,
                threshold: Some(Threshold::AtLeast(if method == MethodName::Auto { 20.0 } else { 10.0 })),
            });
        }
    }
    Ok(rows)
}
