//! Variants of a method compared over models by geometric means.

use super::context::Context;
use super::variants::Variant;
use crate::BenchError;
use crate::data::Model;
use crate::runs::{CONVERGED, Run};
use crate::table::{geometric_mean, seconds};

/// Runs every variant on every model; `[variant][model]`. Variants with equal settings are run once.
///
/// # Errors
/// A model that is not there.
pub fn compare(context: &mut Context<'_>, variants: &[Variant]) -> Result<Vec<Vec<Run>>, BenchError> {
    let mut runs: Vec<Vec<Run>> = vec![Vec::new(); variants.len()];
    for name in context.models.clone() {
        let problem: (Model, f64) = context.load(&name)?;
        for (k, variant) in variants.iter().enumerate() {
            let known = variants[..k].iter().position(|other| other.settings == variant.settings);
            let run = match known {
                Some(known) => Run { method: variant.name.clone(), ..runs[known][runs[k].len()].clone() },
                None => context.run(&problem, &variant.name, variant.settings.clone())?,
            };
            runs[k].push(run);
        }
    }
    Ok(runs)
}

/// What a variant costs to a position error of 1e-4, geometric means over the models. A run that does not get there counts
/// with all that it did, so that the means are lower bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    /// Iterations
    pub iterations: f64,
    /// Inner steps
    pub inner: f64,
    /// Wall seconds
    pub seconds: f64,
    /// Runs that did not get there.
    pub missed: usize,
}

impl Means {
    /// Over the runs of a variant.
    pub fn of(runs: &[Run]) -> Self {
        let points: Vec<_> = runs.iter().map(|run| run.reached(CONVERGED).copied().unwrap_or(run.last())).collect();
        Means {
            iterations: geometric_mean(points.iter().map(|p| p.iteration.max(1) as f64)),
            inner: geometric_mean(points.iter().map(|p| p.inner.max(1) as f64)),
            seconds: geometric_mean(points.iter().map(|p| p.seconds.max(1e-9))),
            missed: runs.iter().filter(|run| run.reached(CONVERGED).is_none()).count(),
        }
    }

    /// As cells of a table: iterations, inner steps, seconds, missed.
    pub fn cells(&self) -> [String; 4] {
        let bound = if self.missed > 0 { ">= " } else { "" };
        [
            format!("{bound}{:.1}", self.iterations),
            format!("{bound}{:.1}", self.inner),
            format!("{bound}{}", seconds(self.seconds)),
            if self.missed > 0 { self.missed.to_string() } else { String::new() },
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::Point;

    #[test]
    fn a_run_that_does_not_get_there_counts_with_what_it_did() {
        let run = |iteration: usize, error: f64| Run {
            problem: "p".into(),
            method: "m".into(),
            points: vec![Point {
                iteration,
                inner: 2 * iteration,
                seconds: 1.0,
                position_error: error,
                energy_error: 0.0,
            }],
            reweighted: vec![],
            reason: String::new(),
        };
        let means = Means::of(&[run(10, 1e-5), run(1000, 1e-2)]);
        assert!((means.iterations - 100.0).abs() < 1e-9 && (means.inner - 200.0).abs() < 1e-9);
        assert_eq!(means.missed, 1);
        assert_eq!(means.cells()[0], ">= 100.0");
    }
}
