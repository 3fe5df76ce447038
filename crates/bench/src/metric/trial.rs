//! Runs on a body, counted.

use super::elements::{Candidates, MetricElements};
use super::moduli::Moduli;
use super::vector_form::{VectorForm, VectorSettings};
use crate::BenchError;
use crate::data::Model;
use proxel::model::energy::{Energy, NeoHookean};
use proxel::settings::Material;
use proxel::split::{
    Admm, AdmmSettings, GlobalStep, GradientTolerance, IterationLimit, Lbfgs, LbfgsSettings, Method, Observer, Problem,
    Quadratic, Reweighting, Status, StepReport, run,
};
use std::sync::atomic::Ordering;

/// How the positions follow the local variables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Global {
    /// L-BFGS preconditioned by the normal matrix with the scalar k = d + mix (v - d).
    Scalar {
        /// What `mix` is.
        mix: f64,
        /// Its settings.
        settings: LbfgsSettings,
    },
    /// Preconditioned in vector form.
    Vector(VectorSettings),
}

/// What is tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attempt {
    /// Moduli at first.
    pub base: Moduli,
    /// What they follow, and when; static where there is nothing.
    pub reweighting: Option<(Candidates, Reweighting)>,
    /// The global step.
    pub global: Global,
}

/// Iterations and inner steps at some point of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Iterations.
    pub iterations: usize,
    /// Inner steps of all of them.
    pub inner: usize,
}

/// What a run took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counts {
    /// To a position error of 1e-4.
    pub close: Option<Count>,
    /// To a gradient ratio of 1e-9.
    pub converged: Option<Count>,
    /// Factorisations of vector forms, or reweightings where there is none.
    pub factorisations: usize,
    /// The last position error.
    pub error: f64,
    /// The last energy.
    pub energy: f64,
}

/// A body with its minimum.
pub struct Trial {
    energy: NeoHookean,
    rest: Vec<f64>,
    tets: Vec<u32>,
    n_free: usize,
    start: Vec<f64>,
    minimum: Vec<f64>,
}

impl Trial {
    /// A model whose reference is the minimum for this material, which is taken as neo-Hookean.
    ///
    /// # Errors
    /// A model without start or reference, or moduli that describe no material.
    pub fn new(model: &Model, material: &Material) -> Result<Self, BenchError> {
        let (Some(start), Some(reference)) = (&model.input.start, &model.input.reference) else {
            return Err(BenchError(format!("{}: it has no start or no reference", model.name)));
        };
        let n = model.input.rest.n_verts();
        let mut fixed = vec![false; n];
        let mut start = start.clone();
        for (v, at) in &model.input.fixed {
            fixed[*v as usize] = true;
            start[*v as usize] = *at;
        }
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.sort_by_key(|v| fixed[*v as usize]); // stable: free ones first
        let mut number = vec![0; n];
        order.iter().enumerate().for_each(|(at, v)| number[*v as usize] = at as u32);
        let flat = |points: &[[f64; 3]]| -> Vec<f64> { order.iter().flat_map(|v| points[*v as usize]).collect() };
        Ok(Trial {
            energy: <NeoHookean as Energy<3>>::from_lame(&material.lame().map_err(BenchError::from_display)?),
            rest: flat(&model.input.rest.points),
            tets: model.input.rest.tets.as_flattened().iter().map(|v| number[*v as usize]).collect(),
            n_free: fixed.iter().filter(|f| !**f).count(),
            start: flat(&start),
            minimum: flat(reference),
        })
    }

    /// The density.
    pub fn energy(&self) -> &NeoHookean {
        &self.energy
    }

    /// Runs an attempt until it has converged, or `max_iters`.
    ///
    /// # Errors
    /// A problem that cannot be set up.
    pub fn run(&self, attempt: &Attempt, max_iters: usize) -> Result<Counts, BenchError> {
        let mix = match attempt.global {
            Global::Scalar { mix, .. } => mix,
            Global::Vector(_) => 1.0,
        };
        let candidates = attempt.reweighting.map_or(Candidates::Each, |(candidates, _)| candidates);
        let term = MetricElements::new(&self.rest, &self.tets, self.energy, attempt.base, candidates, mix)
            .map_err(BenchError::from_display)?;
        let mut factorisations = None;
        let global: Box<dyn GlobalStep> = match attempt.global {
            Global::Scalar { settings, .. } => Box::new(Lbfgs::new(settings)),
            Global::Vector(settings) => {
                let global = VectorForm::new(&term, settings);
                factorisations = Some(global.factorisations.clone());
                Box::new(global)
            }
        };
        let problem = Problem {
            dim: 3,
            n_free: self.n_free,
            x0: self.start.clone(),
            terms: vec![Box::new(term)],
            quadratic: Quadratic::default(),
            barrier: false,
        };
        let settings = AdmmSettings {
            name: "metric".to_string(),
            global,
            reweighting: attempt.reweighting.map(|(_, reweighting)| reweighting),
            renewed_at: None,
        };
        let mut method = Admm::new(problem, settings).map_err(BenchError::from_display)?;
        let mut counter = Counter { trial: self, now: Count::default(), close: None };
        let mut tolerance = GradientTolerance::new(1e-9, &mut method);
        let end = run(&mut method, &mut [&mut tolerance, &mut IterationLimit(max_iters)], &mut counter);
        let now = Count { iterations: end.iterations, inner: end.inner_iterations };
        Ok(Counts {
            close: counter.close,
            converged: (end.status == Status::Converged).then_some(now),
            factorisations: factorisations.map_or(end.refactorisations, |count| count.load(Ordering::Relaxed)),
            error: self.error(&end.x),
            energy: method.energy().value,
        })
    }

    /// |X - X*| / |X_0 - X*| over the free nodes.
    fn error(&self, x: &[f64]) -> f64 {
        let distance = |x: &[f64]| {
            let pairs = x.iter().zip(&self.minimum).take(3 * self.n_free);
            pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        distance(x) / distance(&self.start)
    }
}

struct Counter<'a> {
    trial: &'a Trial,
    now: Count,
    close: Option<Count>,
}

impl Observer for Counter<'_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        self.now = Count { iterations: report.iteration, inner: self.now.inner + report.inner };
        if self.close.is_none() && self.trial.error(method.x()) <= 1e-4 {
            self.close = Some(self.now);
        }
    }
}
