//! The default method against WRAPD.

use super::context::Context;
use super::variants::Variant;
use crate::BenchError;
use crate::runs::{CONVERGED, Level, Run};
use crate::table::{Table, seconds};
use proxel::settings::MethodName;
use std::fmt::Write as _;

/// Where an energy can hardly be told from the minimum.
const FINE: Level = Level::Energy(1e-10);

/// What `auto` is to gain over `wrapd`: at every model, and in the median, to a position error of 1e-4; in the median to an
/// energy error of 1e-10; and the most that the second level may cost over the first.
const NEVER_SLOWER: f64 = 1.0;
const TO_POSITION: f64 = 1.8;
const TO_ENERGY: f64 = 2.5;
const BETWEEN: f64 = 1.3;

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    context.set_levels(&[CONVERGED, FINE]);
    let mut table = Table::new([
        "model",
        "auto to 1e-4",
        "wrapd to 1e-4",
        "ratio",
        "auto to energy 1e-10",
        "wrapd to energy 1e-10",
        "ratio",
        "auto: energy over position",
    ]);
    let mut ratios: [Vec<f64>; 3] = Default::default();
    for name in context.models.clone() {
        let problem = context.load(&name)?;
        let mut method = |method: MethodName| {
            let variant = Variant::of(method);
            context.run(&problem, &variant.name, variant.settings)
        };
        let (auto, wrapd) = (method(MethodName::Auto)?, method(MethodName::Wrapd)?);
        // What wrapd does not reach counts nowhere; what auto does not reach counts as 0.
        let time = |run: &Run, level, missed| run.reached(level).map_or(missed, |p| p.seconds);
        let over = |level| time(&wrapd, level, f64::NAN) / time(&auto, level, f64::INFINITY);
        let between = time(&auto, FINE, f64::INFINITY) / time(&auto, CONVERGED, 1.0);
        let row = [over(CONVERGED), over(FINE), between];
        for (all, one) in ratios.iter_mut().zip(row) {
            all.push(one);
        }
        let cell = |run: &Run, level| {
            run.reached(level)
                .map_or("not reached".to_string(), |p| format!("{} ({} s)", p.iteration, seconds(p.seconds)))
        };
        table.row([
            name,
            cell(&auto, CONVERGED),
            cell(&wrapd, CONVERGED),
            format!("{:.2}", row[0]),
            cell(&auto, FINE),
            cell(&wrapd, FINE),
            format!("{:.2}", row[1]),
            format!("{:.2}", row[2]),
        ]);
    }
    let least = ratios[0].iter().copied().fold(f64::INFINITY, f64::min);
    let most = ratios[2].iter().copied().fold(0.0, f64::max);
    let _ = writeln!(
        context.text,
        "Iterations (seconds). A level that wrapd does not reach counts in no median.\n\n{table}"
    );
    let _ = writeln!(
        context.text,
        "To 1e-4 `auto` is at least {least:.2} times as fast (asked: {NEVER_SLOWER}), {:.2} times in the median (asked: \
         {TO_POSITION}); to an energy error of 1e-10 {:.2} times in the median (asked: {TO_ENERGY}), and that takes it at most \
         {most:.2} times its own time to 1e-4 (asked: {BETWEEN}).",
        median(&ratios[0]),
        median(&ratios[1]),
    );
    Ok(())
}

/// The median of those that are numbers.
fn median(values: &[f64]) -> f64 {
    let mut values: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn medians_leave_out_what_is_no_number() {
        assert_eq!(median(&[3.0, f64::NAN, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0]), 2.5);
        assert!(median(&[]).is_nan());
    }
}
