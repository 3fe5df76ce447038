//! A run of a splitting method, by its residuals.

use crate::BenchError;
use proxel::split::{Method, Order, normalized};
use std::time::Instant;

/// Which residual of A(27).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Residual {
    /// A(22) or A(24).
    Forward,
    /// A(11).
    Combined,
    /// The largest distance of a vertex from where the step's solution has it, over a: no residual, but what methods that
    /// split nothing can be compared by.
    Position,
}

impl Residual {
    pub fn as_str(self) -> &'static str {
        match self {
            Residual::Forward => "forward",
            Residual::Combined => "combined",
            Residual::Position => "position",
        }
    }
}

/// After an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub iteration: usize,
    /// Wall time of its steps.
    pub seconds: f64,
    /// Proposals refused until then.
    pub rejected: usize,
    pub forward: f64,
    /// Infinite where it is not known.
    pub combined: f64,
    /// Infinite where it is not known.
    pub position: f64,
    /// How far positions are outside of hard sets; 0 where nobody asks.
    pub violation: f64,
}

impl Point {
    pub fn value(&self, residual: Residual) -> f64 {
        match residual {
            Residual::Forward => self.forward,
            Residual::Combined => self.combined,
            Residual::Position => self.position,
        }
    }
}

/// A method on a problem.
#[derive(Clone, Debug)]
pub struct Course {
    pub problem: String,
    pub method: String,
    pub points: Vec<Point>,
    /// Positions at the end.
    pub x: Vec<f64>,
}

/// What is measured of positions besides residuals: position error and violation, as in [`Point`].
pub type Watch<'a> = dyn FnMut(&[f64]) -> (f64, f64) + 'a;

impl Course {
    /// Steps until both residuals are below `floor`, or `most` iterations are done.
    ///
    /// Each step begins with the local step, whose report has the residuals of the iteration before: of the x-z-u iteration
    /// A(22) before the step and A(11) after it, of the z-x-u iteration A(24).
    pub fn run(
        problem: &str,
        name: &str,
        method: &mut dyn Method,
        order: Order,
        a: f64,
        (most, floor): (usize, f64),
    ) -> Result<Self, BenchError> {
        Self::watched(problem, name, method, order, a, (most, floor), &mut |_| (f64::INFINITY, 0.0))
    }

    /// The same, with an eye on positions; the time that takes does not count.
    pub fn watched(
        problem: &str,
        name: &str,
        method: &mut dyn Method,
        order: Order,
        a: f64,
        (most, floor): (usize, f64),
        watch: &mut Watch<'_>,
    ) -> Result<Self, BenchError> {
        let n = method.problem().local_dim();
        let mut course =
            Course { problem: problem.to_string(), method: name.to_string(), points: Vec::new(), x: Vec::new() };
        let (mut seconds, mut rejected, mut iteration) = (0.0, 0, 0);
        loop {
            let (position, violation) = if iteration > 0 { watch(method.x()) } else { (f64::INFINITY, 0.0) };
            let began = Instant::now();
            let report = method.step().map_err(BenchError::from_display)?;
            let took = began.elapsed().as_secs_f64();
            if iteration > 0 {
                let (forward, combined) = match order {
                    Order::Xzu => (report.local.gap2_before, report.local.combined()),
                    Order::Zxu => (report.local.gap2, f64::INFINITY),
                };
                let (forward, combined) = (normalized(forward, n, a), normalized(combined, n, a));
                course.points.push(Point { iteration, seconds, rejected, forward, combined, position, violation });
                if iteration >= most || (forward <= floor && !(combined > floor && combined.is_finite())) {
                    course.x = method.x().to_vec();
                    return Ok(course);
                }
            }
            iteration += 1;
            seconds += took;
            rejected += report.trial.rejected;
        }
    }

    /// The median of what an iteration takes, in seconds.
    pub fn median(&self) -> f64 {
        let mut taken: Vec<f64> = self.points.windows(2).map(|pair| pair[1].seconds - pair[0].seconds).collect();
        taken.sort_by(f64::total_cmp);
        taken.get(taken.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// Whether this residual is known of it.
    pub fn has(&self, residual: Residual) -> bool {
        self.points.iter().any(|p| p.value(residual).is_finite())
    }

    /// Where a residual first is at a level or below.
    pub fn reached(&self, residual: Residual, level: f64) -> Option<&Point> {
        self.points.iter().find(|p| p.value(residual) <= level)
    }
}
