//! Reproductions of the WRAPD paper's parameterizations.

mod curves;
pub mod figures;
pub mod robustness;
pub mod table2;
pub mod table3;

use super::context::{Context, Reached};
use crate::BenchError;
use crate::maps::{self, MapRun, Phase};
use crate::table::seconds;
use proxel::mesh::Mesh;
use proxel::settings::{UnwrapMethod, UnwrapSettings};

/// A run that takes longer is ended, seconds.
const PATIENCE: f64 = 60.0;
const PATIENCE_QUICK: f64 = 10.0;

/// Most iterations of a run, where no number is asked for.
const ITERATIONS: usize = 2000;

/// Two methods that find the least energy have to agree to this part of it.
const AGREEMENT: f64 = 1e-8;

/// A surface with the least energy of its maps.
struct Target {
    mesh: Mesh,
    least: f64,
    about: String, // how the energy was found
}

impl Target {
    /// Reads a surface, and minimises its energy by two methods.
    fn load(context: &mut Context<'_>, name: &str) -> Result<Self, BenchError> {
        let mesh = maps::load(name)?;
        context.tell(&format!("{name}: {} faces: the least energy", mesh.faces.len()));
        let energy = |method| {
            let settings = UnwrapSettings { method, tol: 1e-12, max_iters: 500, ..settings(context, method) };
            let run = maps::run(&mesh, method.as_str(), &settings, 0.0, 1)?;
            Ok::<f64, BenchError>(
                run.rows.iter().filter(|r| r.flips == 0).map(|r| r.energy).fold(f64::INFINITY, f64::min),
            )
        };
        let (first, second) = (energy(UnwrapMethod::Auto)?, energy(UnwrapMethod::ProjectedNewton)?);
        let least = first.min(second);
        let apart = (first - second).abs() / least;
        let mut about = format!(
            "Least energy {least:.10}, by `auto` and `projected-newton`, which are {apart:.0e} of it apart{}.",
            if apart > AGREEMENT { ": **they do not agree**" } else { "" }
        );
        if let Some(row) = crate::published::maps::of(name) {
            about += &format!(" The authors' codes: {} ({:+.0e} of it).", row.energy, row.energy / least - 1.0);
        }
        Ok(Target { mesh, least, about })
    }

    /// Maps the surface until the late phase, or to a smaller error, and keeps what was reached for the CSV.
    fn run(
        &self,
        context: &mut Context<'_>,
        method: &str,
        settings: &UnwrapSettings,
        error: f64,
    ) -> Result<MapRun, BenchError> {
        let run = maps::run(&self.mesh, method, settings, (1.0 + error) * self.least, context.options.repeats)?;
        for phase in Phase::ALL {
            context.reached.push(Reached {
                problem: run.problem.clone(),
                method: run.method.clone(),
                level: phase.to_string(),
                at: run.reached(phase, self.least).map(|row| (row.iteration, row.seconds)),
            });
        }
        let cells = Phase::ALL.map(|phase| format!("{phase} {}", cost(&run, phase, self.least)));
        context.tell(&format!("{}: {method}: {} ({})", run.problem, cells.join(", "), run.reason));
        Ok(run)
    }
}

/// Settings of a method with the common options filled in.
fn settings(context: &Context<'_>, method: UnwrapMethod) -> UnwrapSettings {
    let options = context.options;
    UnwrapSettings {
        method,
        tol: 1e-13,
        max_iters: options.max_iters.unwrap_or(if options.quick { 300 } else { ITERATIONS }),
        time_limit: Some(if options.quick { PATIENCE_QUICK } else { PATIENCE }),
        threads: options.threads,
        pack: false,
        ..UnwrapSettings::default()
    }
}

/// "iterations (seconds)" of a phase.
fn cost(run: &MapRun, phase: Phase, least: f64) -> String {
    run.reached(phase, least).map_or("-".to_string(), |row| format!("{} ({})", row.iteration, seconds(row.seconds)))
}
