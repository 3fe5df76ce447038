//! Theorem 3.5 of A under `--penalty safe`: descent and summable steps, whatever the time step.

use super::constants::{Bar, Constants};
use super::linear_rate::xzu;
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::Table;
use proxel::split::SafePenalty;
use std::fmt::Write as _;

/// Time steps, in units of the one for which a linear rate is proven.
const STEPS: [f64; 4] = [1.0, 4.0, 16.0, 64.0];
/// Changes down to this part of the first one are looked at: the Lagrangian's last descents are differences of equal numbers.
const SOUND: f64 = 1e-5;
/// Part of the steps, from the end, that tells what is still to come.
const TAIL: usize = 2;

/// Runs the iteration with the penalty that [`SafePenalty`] gives and writes what it did.
///
/// # Errors
/// A step that descends by less than A(59) promises; changes that do not fall, so that their sum says nothing.
pub(super) fn descend(context: &mut Context<'_>, bar: &Bar, most: usize) -> Result<(), BenchError> {
    let mut table = Table::new([
        "dt, s",
        "rho(K) over its bound",
        "mu",
        "L / mu",
        "promised, A(59)",
        "steps",
        "least descent over it",
        "sum of steps over the first",
        "still to come",
    ]);
    for factor in STEPS {
        let bar = bar.slower(factor);
        let mut problem = bar.problem(1.0)?;
        let x0 = problem.x0.clone();
        let safe = SafePenalty::of(&mut problem, &x0).map_err(BenchError::from_display)?;
        let constants = Constants::of(&bar)?;
        let run = xzu(&bar, safe.descent(), safe.mu, most)?;
        let first = run.changes.first().copied().unwrap_or(0.0);
        let sound = run.changes.iter().take_while(|c| **c > SOUND * first).count();
        let least = run.descents[..sound].iter().copied().fold(f64::INFINITY, f64::min);
        if !(sound > TAIL && (1.0..f64::INFINITY).contains(&least)) {
            return Err(BenchError(format!(
                "dt = {:e}: the Lagrangian fell by {least} of what A(59) promises",
                bar.dt()
            )));
        }
        // What the last changes' mean ratio makes of those that follow: a geometric series.
        let tail = sound / TAIL;
        let ratio = (run.changes[sound - 1] / run.changes[sound - 1 - tail]).powf(1.0 / tail as f64);
        if ratio.is_nan() || ratio >= 1.0 {
            return Err(BenchError(format!("dt = {:e}: steps no longer fall, by {ratio} each", bar.dt())));
        }
        let sum: f64 = run.changes[..sound].iter().sum();
        let rest = run.changes[sound - 1] * ratio / (1.0 - ratio);
        context.tell(&format!("safe, dt = {:e}: {sound} steps, least descent {least:.3}", bar.dt()));
        table.row([
            format!("{:.4e}", bar.dt()),
            format!("{:.4}", 2.0 * constants.lipschitz_xzu * constants.rho),
            format!("{:.4e}", safe.mu),
            format!("{:.4}", safe.lipschitz),
            format!("{:.4}", safe.descent()),
            sound.to_string(),
            format!("{least:.3}"),
            format!("{:.4}", sum / first),
            format!("{:.1e}", rest / first),
        ]);
    }
    let _ = writeln!(
        context.text,
        "## Descent under a safe penalty\n\nTheorem 3.5 asks nothing of rho(K), so that the time step may be as long as it likes. mu is \
         that of `--penalty safe`, the bound 1/(2 L) that of Theorem 3.3, which only the first of these steps keeps. Steps are \
         |B (z^(k+1) - z^k)| until they are {SOUND:e} of the first one or the run ends; what is still to come is the geometric \
         series of the last half.\n\n{table}"
    );
    Ok(())
}
