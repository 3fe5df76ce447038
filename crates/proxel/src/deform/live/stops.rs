//! When a step of a [`super::Deformer`] ends.

use proxel_split::{Method, Status, StepReport, Stop, Verdict};
use std::time::{Duration, Instant};

/// Stops when the time of a step is over.
pub(super) struct Budget {
    pub began: Instant,
    pub budget: Option<Duration>,
}

impl Stop for Budget {
    fn check(&mut self, _: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        let budget = self.budget?;
        (self.began.elapsed() >= budget).then(|| Verdict { status: Status::Stopped, reason: spent(budget) })
    }
}

/// What a step says that had no more time.
pub(super) fn spent(budget: Duration) -> String {
    format!("the time of this step, {} s, is over; step again to go on", budget.as_secs_f64())
}

/// Stops after a number of iterations of this run, whatever the method counts from.
pub(super) struct Iterations {
    pub most: usize,
    pub done: usize,
}

impl Stop for Iterations {
    fn check(&mut self, _: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        if self.done >= self.most {
            let reason = format!("{} iterations done (--max-iters)", self.done);
            return Some(Verdict { status: Status::Stopped, reason });
        }
        self.done += 1;
        None
    }
}
