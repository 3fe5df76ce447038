//! A WRAPD iteration with one inner step, and its parts alone on the same data.
//!
//! An iteration is a local step (decomposition, prox and the gradient where the global step begins), a solve with three
//! right-hand sides, and the penalty at the new positions (decomposition and gradient); what it does besides is the
//! history of L-BFGS and, in reweighted methods, the candidate weights.

use crate::BenchError;
use crate::data::{self, Model};
use proxel::model::elements::{Elements, Polar, Rest, morton};
use proxel::model::energy::{Energy, NeoHookean};
use proxel::settings::{AdmmSettings, Material};
use proxel::split::{self, Admm, Lbfgs, LbfgsSettings, Method, NormalMatrix, Problem, Quadratic};
use std::hint::black_box;

/// Iterations before anything is measured: past the reweighting, still far from the minimum.
pub const WARM_UP: usize = 100;

/// The model of acceptance where its data is there, else a generated beam of about as many tetrahedra.
///
/// # Errors
/// Data that is there but cannot be read.
pub fn centaur_or_beam() -> Result<Model, BenchError> {
    if data::found().iter().any(|name| name == "centaur") {
        return data::load("centaur");
    }
    let beam = data::twisted_beam([64, 16, 16])?;
    Ok(Model { name: format!("generated beam of {} tetrahedra (no data)", beam.input.rest.tets.len()), ..beam })
}

/// The problem of a model of tetrahedra as the facade poses it: centred, free vertices first, each kind along a
/// space-filling curve; neo-Hookean rubber, rotation-aware.
///
/// # Errors
/// An element without volume.
pub fn problem(model: &Model) -> Result<Problem, BenchError> {
    let mesh = &model.input.rest;
    let n = mesh.n_verts();
    let Some((low, high)) = mesh.bounding_box() else { return Err(BenchError(format!("{}: it is empty", model.name))) };
    let center: [f64; 3] = std::array::from_fn(|d| 0.5 * (low[d] + high[d]));
    let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
    let mut is_fixed = vec![false; n];
    model.input.fixed.iter().for_each(|(v, _)| is_fixed[*v as usize] = true);
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.sort_by_key(|v| (is_fixed[*v as usize], morton(mesh.points[*v as usize], low, size), *v));
    let mut number = vec![0; n];
    order.iter().enumerate().for_each(|(place, v)| number[*v as usize] = place as u32);
    let flat = |points: &[[f64; 3]]| -> Vec<f64> {
        order.iter().flat_map(|v| (0..3).map(|d| points[*v as usize][d] - center[d])).collect()
    };
    let corners: Vec<u32> = mesh.tets.as_flattened().iter().map(|v| number[*v as usize]).collect();
    let rest = Rest::<3, 3>::new(&flat(&mesh.points), &corners).map_err(BenchError::from_display)?;
    let energy = <NeoHookean as Energy<3>>::from_lame(&Material::default().lame().map_err(BenchError::from_display)?);
    let base = Energy::<3>::slope_stiffness(&energy);
    let term = Elements::<3, 3, Polar>::new(&rest, energy, base);
    Ok(Problem {
        dim: 3,
        n_free: n - model.input.fixed.len(),
        x0: flat(model.input.start.as_ref().unwrap_or(&mesh.points)),
        terms: vec![Box::new(term)],
        quadratic: Quadratic::default(),
        barrier: true,
    })
}

/// WRAPD with one inner step an iteration, after [`WARM_UP`] of them.
///
/// # Errors
/// A model that is no problem.
pub fn iteration(model: &Model) -> Result<Admm, BenchError> {
    let defaults = AdmmSettings::default();
    let global = Lbfgs::new(LbfgsSettings { max_inner: 1, ..defaults.lbfgs() });
    let settings = split::AdmmSettings {
        name: "wrapd".to_string(),
        global: Box::new(global),
        reweighting: Some(defaults.reweighting(true)),
        renewed_at: None,
    };
    let mut method = Admm::new(problem(model)?, settings).map_err(BenchError::from_display)?;
    for _ in 0..WARM_UP {
        method.step().map_err(BenchError::from_display)?;
    }
    Ok(method)
}

/// What a part starts from.
struct State {
    x: Vec<f64>,
    p: Vec<Vec<f64>>,
    u: Vec<Vec<f64>>,
}

/// The parts of an iteration. Two successive states of a real run are taken in turns, so that a warm start of the prox is
/// as warm as in a run, not warmer.
pub struct Parts {
    problem: Problem,
    normal: NormalMatrix,
    states: [State; 2],
    turn: usize,
    now: State,
    grad: Vec<f64>,
    rhs: Vec<f64>,
    coupled: Vec<f64>,
}

impl Parts {
    /// The parts of the iteration that follows [`iteration`].
    ///
    /// # Errors
    /// A model that is no problem.
    pub fn new(model: &Model) -> Result<Self, BenchError> {
        let mut method = iteration(model)?;
        let take = |m: &mut Admm| State { x: m.x().to_vec(), p: m.p().to_vec(), u: m.u().to_vec() };
        let first = take(&mut method);
        method.step().map_err(BenchError::from_display)?;
        let second = take(&mut method);
        let now = take(&mut method);
        let problem = method.into_parts().0;
        let precision = AdmmSettings::default().lbfgs().precision; // as in the iteration
        let normal = NormalMatrix::with_precision(&problem, precision).map_err(BenchError::from_display)?;
        let grad = vec![0.0; problem.n_free * 3];
        let coupled = vec![0.0; problem.terms[0].local_len()];
        let mut parts =
            Parts { problem, normal, states: [first, second], turn: 0, now, rhs: grad.clone(), grad, coupled };
        parts.penalty();
        parts.rhs.copy_from_slice(&parts.grad);
        Ok(parts)
    }

    /// Brings the next state and right-hand side; no part itself.
    pub fn prepare(&mut self) {
        self.turn = 1 - self.turn;
        let from = &self.states[self.turn];
        self.now.x.copy_from_slice(&from.x);
        for (to, from) in self.now.p.iter_mut().zip(&from.p).chain(self.now.u.iter_mut().zip(&from.u)) {
            to.copy_from_slice(from);
        }
        self.grad.copy_from_slice(&self.rhs);
    }

    /// Prox sweep, with the decompositions it needs and the gradient where the global step begins; uses up the state.
    pub fn local_step(&mut self) {
        let State { x, p, u } = &mut self.now;
        black_box(self.problem.local_step(x, p, u, &mut self.grad));
    }

    /// SVD sweep and gradient: what follows an inner step.
    pub fn penalty(&mut self) {
        black_box(self.problem.penalty(&self.now.x, &self.now.p, &mut self.grad));
    }

    /// SVD sweep alone, stretches written out.
    pub fn svd_sweep(&mut self) {
        self.problem.terms[0].couple(&self.now.x, &mut self.coupled);
        black_box(&mut self.coupled);
    }

    /// One solve with three right-hand sides; uses up the right-hand side.
    ///
    /// # Errors
    /// None on a state that came from a run.
    pub fn solve(&mut self) -> Result<(), BenchError> {
        self.normal.solve(&mut self.grad).map_err(BenchError::from_display)
    }

    /// Energy pass, without its gradient.
    pub fn energy(&mut self) {
        black_box(self.problem.energy(&self.now.x, None));
    }

    /// Candidate weights from the stiffness at the local variables, W(20) and W(22).
    pub fn candidate_weights(&mut self) {
        black_box(self.problem.terms[0].propose_weights((0.1, 10.0)));
    }

    /// Numbers of the matrix and its factor anew.
    ///
    /// # Errors
    /// None on a state that came from a run.
    pub fn refactor(&mut self) -> Result<(), BenchError> {
        self.normal.refactor(&self.problem).map_err(BenchError::from_display)
    }

    /// Number of elements.
    pub fn n_elems(&self) -> usize {
        self.problem.terms[0].n_elems()
    }

    /// Bytes of the factor, workspace included.
    pub fn factor_bytes(&self) -> u64 {
        self.normal.factor_bytes()
    }
}

/// A pool of `threads` threads.
///
/// # Errors
/// Threads that cannot be started.
pub fn pool(threads: usize) -> Result<rayon::ThreadPool, BenchError> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(BenchError::from_display)
}
