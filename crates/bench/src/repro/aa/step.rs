//! A step of a body in motion, by every method.

use super::course::{Course, Point};
use crate::BenchError;
use crate::motion::{Moving, Scene, Splitting};
use crate::repro::context::Context;
use proxel::split::{Acceleration, Algorithm, Cycle, Extrapolation, History, Method, Order};
use std::time::Instant;

/// A splitting method.
#[derive(Clone, Debug)]
pub(super) struct Way {
    pub name: String,
    splitting: Splitting,
    mu: f64,
    relaxation: f64,
    by: Option<Acceleration>,
}

impl Way {
    /// Plain ADMM in the order z-x-u, with this penalty.
    pub fn plain(name: &str, mu: f64) -> Self {
        Way { name: name.to_string(), splitting: Splitting::Linear, mu, relaxation: 1.0, by: None }
    }

    /// An acceleration with this penalty.
    pub fn accelerated(name: &str, mu: f64, by: Acceleration) -> Self {
        Way { by: Some(by), ..Way::plain(name, mu) }
    }

    /// Algorithm 4 with this window.
    pub fn four(window: usize) -> Self {
        Way::accelerated(&format!("aa-admm-4 m={window}"), 1.0, Acceleration::anderson(Algorithm::Four, window))
    }

    /// Splitting of stretches.
    pub fn polar(name: &str, splitting: Splitting) -> Self {
        Way { splitting, ..Way::plain(name, 1.0) }
    }

    /// Those of the figures.
    pub fn all() -> Vec<Way> {
        let momentum = Extrapolation::Momentum { eta: Some(0.999), corrected: false };
        let fast = Acceleration { algorithm: Algorithm::Two, by: momentum, history: History::AsPublished };
        let mut all = vec![Way::plain("admm", 1.0)];
        all.extend([1, 3, 6, 10].map(Way::four));
        all.push(Way::accelerated("aa-admm-2 m=6", 1.0, Acceleration::anderson(Algorithm::Two, 6)));
        all.extend(
            [1.6, 1.8]
                .map(|relaxation| Way { relaxation, ..Way::plain(&format!("over-relaxation {relaxation}"), 1.0) }),
        );
        all.push(Way::accelerated("fast-admm", 1.0, fast));
        all.push(Way::accelerated("aadr m=6", 1.0, Acceleration::anderson(Algorithm::Envelope, 6)));
        all
    }

    /// Whether its residuals are those of the paper's splitting, so that they can be compared.
    fn is_comparable(&self) -> bool {
        self.splitting == Splitting::Linear && self.mu == 1.0
    }

    /// The method at the start of the next step of a motion, and the order of its residuals.
    pub fn method(&self, moving: &Moving) -> Result<(Box<dyn Method>, Order), BenchError> {
        let admm = moving.admm(self.splitting, self.mu)?;
        // Over-relaxation and splittings of stretches are run as x-z-u.
        let plain = self.splitting == Splitting::Linear && self.relaxation == 1.0;
        let order = self.by.map_or(if plain { Order::Zxu } else { Order::Xzu }, |by| by.algorithm.order());
        let method: Box<dyn Method> = match &self.by {
            Some(by) => by.of(admm).map_err(BenchError::from_display)?,
            None => {
                let cycle = Cycle { order, relaxation: self.relaxation };
                Box::new(admm.with_cycle(cycle).map_err(BenchError::from_display)?)
            }
        };
        Ok((method, order))
    }

    /// Positions after so many iterations.
    pub fn after(&self, moving: &Moving, iterations: usize) -> Result<Vec<f64>, BenchError> {
        let (mut method, _) = self.method(moving)?;
        for _ in 0..=iterations {
            method.step().map_err(BenchError::from_display)?;
        }
        Ok(method.x().to_vec())
    }
}

/// A step and what it is measured against.
pub(super) struct Step<'a> {
    /// As in the CSV.
    pub problem: String,
    pub moving: &'a Moving,
    /// The mean edge.
    pub a: f64,
    /// Where it ends, if that is known.
    pub exact: Option<Vec<f64>>,
}

impl Step<'_> {
    /// The largest distance of a vertex from the solution, in mean edges, and the largest violation of a set.
    fn measure(&self, x: &[f64]) -> (f64, f64) {
        let most = |of: Vec<f64>| of.into_iter().fold(0.0, f64::max);
        let violation = most(self.moving.violations(x)).max(most(self.moving.depths(x)));
        let Some(exact) = &self.exact else { return (f64::INFINITY, violation) };
        let far = |(x, y): (&[f64; 3], &[f64; 3])| (0..3).map(|d| (x[d] - y[d]).powi(2)).sum::<f64>().sqrt();
        let apart = x.as_chunks::<3>().0.iter().zip(exact.as_chunks::<3>().0).map(far).fold(0.0, f64::max);
        (apart / self.a, violation)
    }

    /// A splitting method, to a residual of `floor` or `most` iterations.
    pub fn course(&self, context: &mut Context<'_>, way: &Way, most: usize, floor: f64) -> Result<Course, BenchError> {
        let (mut method, order) = way.method(self.moving)?;
        let mut watch = |x: &[f64]| self.measure(x);
        let limits = (most, floor);
        let mut course = Course::watched(&self.problem, &way.name, &mut *method, order, self.a, limits, &mut watch)?;
        if let Some(p) = course.points.last() {
            context.tell(&format!(
                "{}: {}: {} iterations (+{}), forward residual {:.2e}, position error {:.1e}, violation {:.1e}",
                self.problem, way.name, p.iteration, p.rejected, p.forward, p.position, p.violation
            ));
        }
        if !way.is_comparable() {
            for p in &mut course.points {
                (p.forward, p.combined) = (f64::INFINITY, f64::INFINITY);
            }
        }
        Ok(course)
    }

    /// A splitting method until its relative residuals, [`Method::residuals`], are at most `tol` or `most` iterations are
    /// done; with the residuals there.
    pub fn to_the_end(&self, way: &Way, most: usize, tol: f64) -> Result<(Course, f64, f64), BenchError> {
        let (mut method, _) = way.method(self.moving)?;
        let (mut seconds, mut rejected, mut iteration) = (0.0, 0, 0);
        let (mut primal, mut dual) = (f64::INFINITY, f64::INFINITY);
        while iteration < most && !(primal <= tol && dual <= tol) {
            let began = Instant::now();
            rejected += method.step().map_err(BenchError::from_display)?.trial.rejected;
            seconds += began.elapsed().as_secs_f64();
            iteration += 1;
            let residuals = method.residuals();
            (primal, dual) = (residuals.primal, residuals.dual);
        }
        let point = Point { seconds, rejected, ..self.point(iteration, seconds, method.x()) };
        let (problem, method, x) = (self.problem.clone(), way.name.clone(), method.x().to_vec());
        Ok((Course { problem, method, points: vec![point], x }, primal, dual))
    }

    /// A method of `simulate`: what it returns when it is stopped after each number of iterations, at the times that they
    /// took in a run to the end.
    pub fn simulated(
        &self,
        context: &mut Context<'_>,
        scene: &Scene,
        method: &str,
        (most, tol): (usize, f64),
    ) -> Result<Course, BenchError> {
        /// Up to here every number is tried, then each that is a quarter larger.
        const EVERY: usize = 24;
        let threads = context.options.threads;
        let whole = scene.step(self.moving, method, (most, tol), threads)?;
        let last = whole.trace.len();
        let mut stops: Vec<usize> = (1..=last.min(EVERY)).collect();
        while let Some(next) = stops.last().map(|k| k + k / 4).filter(|k| *k < last) {
            if next <= EVERY {
                break;
            }
            stops.push(next);
        }
        let mut points = Vec::new();
        for iteration in stops.into_iter().filter(|k| *k < last) {
            let ended = scene.step(self.moving, method, (iteration, tol), threads)?;
            points.push(self.point(iteration, whole.trace[iteration - 1].seconds, &ended.x));
        }
        points.push(self.point(last, whole.trace.last().map_or(0.0, |row| row.seconds), &whole.x));
        let p = points[points.len() - 1];
        context.tell(&format!(
            "{}: {method}: {} ({}), {} iterations, {:.3} s, position error {:.1e}, violation {:.1e}",
            self.problem, whole.record.status, whole.record.reason, p.iteration, p.seconds, p.position, p.violation
        ));
        Ok(Course { problem: self.problem.clone(), method: method.to_string(), points, x: whole.x })
    }

    fn point(&self, iteration: usize, seconds: f64, x: &[f64]) -> Point {
        let (position, violation) = self.measure(x);
        let (forward, combined) = (f64::INFINITY, f64::INFINITY);
        Point { iteration, seconds, rejected: 0, forward, combined, position, violation }
    }
}
