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
    refactor: Samples,
}

pub(super) fn rows(model: &Model, repeats: usize) -> Result<Vec<Row>, BenchError> {
    let pools = [pool(1)?, pool(2)?];
    let mut times = [Times::default(), Times::default()];
    let mut method = pools[1].install(|| iteration(model))?;
    let mut parts = pools[1].install(|| Parts::new(model))?;
    for round in 0..repeats {
        for (pool, times) in pools.iter().zip(&mut times) {
            times.whole.time(|| pool.install(|| method.step())).map_err(BenchError::from_display)?;
            // Twice each: the second finds its data where a bench of this part alone would find it.
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
            if round < 5 {
                times.refactor.time(|| pool.install(|| parts.refactor()))?;
            }
        }
    }
    let mut rows = Vec::new();
    for (threads, times) in ["1 thread", "2 threads"].iter().zip(&times) {
        let row = |quantity: &str, against: &str, figures: String, ratio, threshold| Row {
            quantity: format!("{}, {threads}: {quantity}", model.name),
            against: against.to_string(),
            figures,
            ratio,
            threshold,
        };
        for (name, samples) in [
            ("one solve, 3 right-hand sides", &times.solve),
            ("SVD sweep (stretches written out)", &times.svd),
            ("SVD sweep and gradient", &times.penalty),
            ("prox sweep (with its decompositions, and the gradient after it)", &times.local),
            ("energy pass", &times.energy),
            ("assembly and refactorisation", &times.refactor),
        ] {
            rows.push(row(name, "", samples.milliseconds(), None, None));
        }
        let sum = times.solve.least() + times.penalty.least() + times.local.least();
        let whole = times.whole.least();
        rows.push(row(
            "a whole iteration, one inner step",
            &format!("solve + SVD sweep and gradient + prox sweep, {:.2} ms", sum * 1e3),
            times.whole.milliseconds(),
            Some(whole / sum),
            Some(Threshold::AtMost(1.5)),
        ));
        let once = sum - times.svd.least();
        rows.push(row(
            "a whole iteration, one inner step",
            &format!("the same less the second SVD sweep, {:.2} ms", once * 1e3),
            times.whole.milliseconds(),
            Some(whole / once),
            Some(Threshold::AtMost(1.5)),
        ));
    }
    let [one, two] = times.map(|t| t.whole);
    rows.push(Row {
        quantity: format!("{}: a whole iteration, 1 thread", model.name),
        against: format!("2 threads, {}", two.milliseconds()),
        figures: one.milliseconds(),
        ratio: Some(one.least() / two.least()),
        threshold: Some(Threshold::AtLeast(1.6)),
    });
    let scaled = two.least() * 1e5 / parts.n_elems() as f64;
    rows.push(Row {
        quantity: "an iteration, 2 threads, scaled to 100,000 tetrahedra".to_string(),
        against: format!(
            "numpy's SVD of 102,389 matrices, {:.0} ms on the development machine (not run here)",
            NUMPY_SVD_SECONDS * 1e3
        ),
        figures: format!("{:.2} ms", scaled * 1e3),
        ratio: Some(scaled / NUMPY_SVD_SECONDS),
        threshold: Some(Threshold::AtMost(0.06)),
    });
    Ok(rows)
}
