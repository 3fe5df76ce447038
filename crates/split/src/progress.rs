//! A stop for methods that descend.

use crate::{Method, Status, StepReport, Stop, Verdict};

/// Stops where a method has refused this many steps of its own in a row: no way down is left that it could find.
#[derive(Clone, Copy, Debug)]
pub struct NoProgress {
    most: usize,
    refused: usize,
}

impl NoProgress {
    /// After `most` refused steps.
    pub fn new(most: usize) -> Self {
        NoProgress { most, refused: 0 }
    }
}

impl Stop for NoProgress {
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        self.refused = if report.accepted { 0 } else { self.refused + 1 };
        (self.refused >= self.most).then(|| {
            let evaluation = method.evaluate();
            let inverted = evaluation.energy.inverted;
            let (gradient, most) = (evaluation.gradient_norm, self.most);
            Verdict {
                status: Status::Stopped,
                reason: format!(
                    "{most} steps in a row lowered the energy no more, with gradient {gradient:e} and {inverted} inverted \
                     elements; give a larger --tol, or --method auto or wrapd"
                ),
            }
        })
    }
}
