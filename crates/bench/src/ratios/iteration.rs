//! A whole iteration against its parts, and two threads against one.

use super::{Row, Samples, Threshold};
use crate::BenchError;
use crate::data::Model;
use crate::parts::{Parts, iteration, pool};
use crate::published::NUMPY_SVD_SECONDS;
use proxel::split::Method;

/// Times on one number of threads.
#[derive(Default)]
struct Times {
    whole: Samples,
    solve: Samples,
    svd: Samples,
    penalty: Samples,
    local: Samples,
    energy: Samples,
    candidates: Samples,
    refactor: Samples,
}

impl Times {
    /// Solve, penalty and local step together: (of minima, of medians).
    fn sum(&self) -> (f64, f64) {
        let parts = [&self.solve, &self.penalty, &self.local];
        (parts.iter().map(|p| p.least()).sum(), parts.iter().map(|p| p.median()).sum())
    }
}

pub(super) fn rows(model: &Model, repeats: usize) -> Result<Vec<Row>, BenchError> {
    let (times, n_elems) = take(model, repeats)?;
    let mut rows = Vec::new();
    for (threads, times) in ["1 thread", "2 threads"].iter().zip(&times) {
        let name = format!("{}, {threads}", model.name);
        rows.extend(part_rows(&name, times));
        rows.extend(whole_rows(&name, times));
    }
    let [one, two] = times.map(|t| t.whole);
    rows.push(Row {
        quantity: format!("{}: a whole iteration, 1 thread", model.name),
        against: format!("2 threads, {}", two.milliseconds()),
        figures: one.milliseconds(),
        ratio: Some(one.least() / two.least()),
        of_medians: Some(one.median() / two.median()),
        threshold: Some(Threshold::AtLeast(1.6)),
    });
    let scaled = |seconds: f64| seconds * 1e5 / n_elems as f64;
    rows.push(Row {
        quantity: "an iteration, 2 threads, scaled to 100,000 tetrahedra".to_string(),
        against: format!(
            "numpy's SVD of 102,389 matrices, {:.0} ms on the development machine (not run here)",
            NUMPY_SVD_SECONDS * 1e3
        ),
        figures: format!("{:.2}; {:.2} ms", scaled(two.least()) * 1e3, scaled(two.median()) * 1e3),
        ratio: Some(scaled(two.least()) / NUMPY_SVD_SECONDS),
        of_medians: Some(scaled(two.median()) / NUMPY_SVD_SECONDS),
        threshold: Some(Threshold::AtMost(0.06)),
    });
    Ok(rows)
}

/// Times on 1 and 2 threads, and the number of elements.
fn take(model: &Model, repeats: usize) -> Result<([Times; 2], usize), BenchError> {
    let pools = [pool(1)?, pool(2)?];
    let mut times = [Times::default(), Times::default()];
    let mut method = pools[1].install(|| iteration(model))?;
    let mut parts = pools[1].install(|| Parts::new(model))?;
    for round in 0..repeats {
        for (pool, times) in pools.iter().zip(&mut times) {
            // Twice each: the second finds its data where a bench of this part alone would find it.
            for _ in 0..2 {
                times.whole.time(|| pool.install(|| method.step())).map_err(BenchError::from_display)?;
            }
            for _ in 0..2 {
                parts.prepare();
                times.local.time(|| pool.install(|| parts.local_step()));
            }
            for _ in 0..2 {
                parts.prepare();
                times.solve.time(|| pool.install(|| parts.solve()))?;
            }
            for _ in 0..2 {
                times.penalty.time(|| pool.install(|| parts.penalty()));
            }
            for _ in 0..2 {
                times.svd.time(|| pool.install(|| parts.svd_sweep()));
            }
            for _ in 0..2 {
                times.energy.time(|| pool.install(|| parts.energy()));
            }
            for _ in 0..2 {
                times.candidates.time(|| pool.install(|| parts.candidate_weights()));
            }
            if round < 5 {
                times.refactor.time(|| pool.install(|| parts.refactor()))?;
            }
        }
    }
    Ok((times, parts.n_elems()))
}

/// The parts alone.
fn part_rows(name: &str, times: &Times) -> Vec<Row> {
    let parts = [
        ("one solve, 3 right-hand sides", &times.solve),
        ("SVD sweep, stretches written out", &times.svd),
        ("SVD sweep and gradient", &times.penalty),
        ("prox sweep, with the decompositions before it and the gradient after it", &times.local),
        ("candidate weights", &times.candidates),
        ("energy pass", &times.energy),
        ("assembly and refactorisation", &times.refactor),
    ];
    parts
        .into_iter()
        .map(|(part, samples)| Row {
            quantity: format!("{name}: {part}"),
            against: String::new(),
            figures: samples.milliseconds(),
            ratio: None,
            of_medians: None,
            threshold: None,
        })
        .collect()
}

/// The whole against the sum of its parts: as they are, and with one SVD sweep less, since the prox sweep has one of its own.
fn whole_rows(name: &str, times: &Times) -> Vec<Row> {
    let (least, median) = times.sum();
    let svd = (times.svd.least(), times.svd.median());
    [("solve, SVD sweep and gradient, prox sweep", (0.0, 0.0)), ("the same, with one SVD sweep only", svd)]
        .into_iter()
        .map(|(what, less)| Row {
            quantity: format!("{name}: a whole iteration, one inner step"),
            against: format!("{what}: {:.2}; {:.2} ms", (least - less.0) * 1e3, (median - less.1) * 1e3),
            figures: times.whole.milliseconds(),
            ratio: Some(times.whole.least() / (least - less.0)),
            of_medians: Some(times.whole.median() / (median - less.1)),
            threshold: Some(Threshold::AtMost(1.5)),
        })
        .collect()
}
