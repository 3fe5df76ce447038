//! A body in its present pose, and what is kept from one pose to the next.

use super::super::start::Harmonic;
use super::super::watch::Watcher;
use super::super::{
    Body, DeformError, DeformInput, Hooks, REFUSALS, check_method, constraints, method as method_of, splitting,
};
use super::Frame;
use super::stops::{Budget, Iterations, spent};
use crate::settings::{DeformSettings, MethodName, PenaltyName};
use proxel_split::{
    Admm, Auto, AutoSettings, Cancel, EnergyReport, GradientTolerance, Method, NoProgress, Outcome, Parts, PointSpring,
    Problem, ResidualTolerance, Status, Stop, respond,
};
use std::time::{Duration, Instant};

/// A method at work, or what it has left.
enum Running {
    /// Second derivatives and a factor from before.
    Auto(Box<Auto>),
    /// The splitting, with its weights and duals from before.
    Splitting(Box<Admm>),
    /// Any other method, from the pose of before.
    Other(Box<dyn Method>),
    /// Nothing is free.
    Fixed(Box<Problem>),
    /// Only after an error.
    Nothing,
}

impl Running {
    fn method(&mut self) -> Option<&mut dyn Method> {
        match self {
            Running::Auto(method) => Some(method.as_mut()),
            Running::Splitting(method) => Some(method.as_mut()),
            Running::Other(method) => Some(method.as_mut()),
            Running::Fixed(_) | Running::Nothing => None,
        }
    }
}

/// What a minimum is sought for.
pub(super) struct Posed {
    input: DeformInput, // with the targets of now
    settings: DeformSettings,
    body: Body,
    number: Vec<u32>,
    harmonic: Option<Harmonic>,
    running: Running,
    pose: Vec<f64>,      // the solver's positions, with the targets of the last run
    wanted: Vec<f64>,    // the same with the targets of now
    before: DeformInput, // soft targets and ties of the last run
    retargeted: bool,
    reference: f64,
    characteristic: f64,
}

impl Posed {
    /// Builds the method; nothing is solved yet.
    pub fn new(input: DeformInput, settings: &DeformSettings) -> Result<Self, DeformError> {
        let mut body = Body::new(&input, settings)?;
        let problem = body.take_problem();
        let number = body.numbers();
        let pose = problem.x0.clone();
        let mut posed = Posed {
            before: targets_only(&input),
            input,
            settings: settings.clone(),
            number,
            harmonic: None,
            running: Running::Nothing,
            wanted: pose.clone(),
            pose,
            retargeted: false,
            reference: 0.0,
            characteristic: problem.characteristic_gradient(),
            body,
        };
        posed.running = posed.cold(problem)?;
        posed.reference = posed.start_gradient();
        Ok(posed)
    }

    /// What the user should know.
    pub fn body(&self) -> &Body {
        &self.body
    }

    fn explain(&self, e: &proxel_split::SystemError) -> DeformError {
        DeformError(self.body.explain(e))
    }

    fn auto(&self) -> AutoSettings {
        self.settings.newton.auto()
    }

    /// The method for a problem of which nothing is known.
    fn cold(&self, problem: Problem) -> Result<Running, DeformError> {
        if problem.n_free == 0 {
            return Ok(Running::Fixed(Box::new(problem)));
        }
        check_method(&problem, &self.settings)?;
        let name = self.settings.method;
        let accelerated = self.settings.anderson.others > 0;
        // It belongs to a start, and is worked out anew at each.
        let safe = self.settings.admm.penalty == PenaltyName::Safe;
        let kind = match name {
            MethodName::Auto => true,
            MethodName::Wrapd | MethodName::RAdmm | MethodName::WAdmm | MethodName::AdmmPd => !accelerated && !safe,
            _ => false,
        };
        if !kind {
            let method = method_of(problem, &self.settings).map_err(|e| self.explain(&e))?;
            return Ok(Running::Other(method));
        }
        let mut admm = splitting(problem, &self.settings).map_err(|e| self.explain(&e))?;
        if name == MethodName::Auto && admm.has_curvature() {
            let name = name.as_str().to_string();
            let auto = Auto::new(name.clone(), admm, self.auto());
            return Ok(Running::Auto(Box::new(auto)));
        }
        Ok(Running::Splitting(Box::new(admm)))
    }

    /// min(|g|, characteristic gradient) where the method is.
    fn start_gradient(&mut self) -> f64 {
        let characteristic = self.characteristic;
        self.running.method().map_or(0.0, |method| {
            let norm = method.evaluate().gradient_norm;
            if norm.is_finite() { norm.min(characteristic) } else { characteristic }
        })
    }

    /// Takes the targets of an input that is otherwise the same as before.
    pub fn retarget(&mut self, input: &DeformInput) {
        self.body.send(&input.fixed, &self.number, &mut self.wanted);
        self.input.fixed.clone_from(&input.fixed);
        self.input.soft.clone_from(&input.soft);
        self.input.ties.clone_from(&input.ties);
        // In a lattice, rows hold the targets of pinned vertices.
        self.input.equalities.clone_from(&input.equalities);
        self.retargeted = true;
    }

    /// Whether an input differs from this one in targets only.
    pub fn is_same_but_for_targets(&self, other: &DeformInput) -> bool {
        let a = &self.input;
        a.fixed.len() == other.fixed.len()
            && a.soft.len() == other.soft.len()
            && a.ties.len() == other.ties.len()
            && a.fixed.iter().zip(&other.fixed).all(|(a, b)| a.0 == b.0)
            && a.soft.iter().zip(&other.soft).all(|(a, b)| (a.0, a.2) == (b.0, b.2))
            && a.ties
                .iter()
                .zip(&other.ties)
                .all(|(a, b)| a.nodes == b.nodes && a.weights == b.weights && a.stiffness == b.stiffness)
    }

    /// The present positions, in the user's order.
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.body.positions(&self.pose)
    }

    /// The problem with the targets of now; equalities are those of its x0.
    fn change(&self, problem: &mut Problem) -> Result<(), DeformError> {
        let center = self.body.center();
        let local = |t: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| t[d] - center[d]) };
        for (spring, (_, target, _)) in problem.quadratic.springs.iter_mut().zip(&self.input.soft) {
            spring.2 = local(*target);
        }
        for (point, tie) in problem.quadratic.points.iter_mut().zip(&self.input.ties) {
            point.target = local(tie.target);
        }
        problem.x0.copy_from_slice(&self.wanted);
        let around = constraints::Around {
            name: self.body.name(),
            input: &self.input,
            number: &self.number,
            center,
            kinds: &[],
        };
        around.check_held(problem)?;
        if !problem.quadratic.equalities.is_empty() {
            problem.quadratic.equalities = around.equalities(problem)?;
        }
        Ok(())
    }

    /// The present pose, carried along smoothly by what has moved.
    fn smooth(&mut self) -> Result<Vec<f64>, DeformError> {
        let mut to = self.pose.clone();
        let from = &self.pose;
        let dim = self.settings_dim();
        let free = self.n_free() * dim;
        to[free..].copy_from_slice(&self.wanted[free..]);
        let (old, new) = (draws(&self.before), draws(&self.input));
        if (to == *from && old == new) || free == 0 {
            return Ok(to);
        }
        if self.harmonic.is_none() {
            // A component that nothing holds but an obstacle has no smooth way: what is free stays where it is.
            let Ok(harmonic) = self.body.harmonic(&self.input, &self.settings, &new) else { return Ok(to) };
            self.harmonic = Some(harmonic);
        }
        // A point is drawn on from where it is by what its target has moved.
        let mut targets = Vec::with_capacity(new.len());
        for (old, new) in old.iter().zip(&new) {
            let nodes = new.nodes.map(|v| self.number[v as usize]);
            let here = PointSpring { nodes, target: [0.0; 3], ..*new }.gap(from, dim);
            targets.push([0, 1, 2].map(|d| here[d] + (new.target[d] - old.target[d])));
        }
        match &mut self.harmonic {
            Some(harmonic) => harmonic.follow(from, to, &targets),
            None => Ok(to),
        }
    }

    fn settings_dim(&self) -> usize {
        if self.settings.planar { 2 } else { 3 }
    }

    fn n_free(&self) -> usize {
        self.body.n_free()
    }

    /// From the last pose to a start for the targets of now, and a method that goes on from it.
    fn begin(&mut self) -> Result<(), DeformError> {
        let lost = || DeformError("the deformer ended with an error before; build it anew".to_string());
        let smooth = self.smooth()?;
        match std::mem::replace(&mut self.running, Running::Nothing) {
            Running::Auto(auto) => {
                let mut parts = auto.into_parts().ok_or_else(lost)?;
                let changed = self.change(&mut parts.problem);
                self.running = Running::Auto(Box::new(self.warm(parts, smooth)?));
                changed?;
            }
            Running::Splitting(mut admm) => {
                let mut changed = Ok(());
                admm.restart(&smooth, |problem| changed = self.change(problem));
                self.running = Running::Splitting(admm);
                changed?;
                let start = self.start_gradient();
                self.reference = self.reference.max(start);
            }
            Running::Other(method) => {
                let mut problem = method.into_problem();
                let changed = self.change(&mut problem);
                problem.x0 = smooth;
                self.running = self.cold(problem)?;
                changed?;
                let start = self.start_gradient();
                self.reference = self.reference.max(start);
            }
            Running::Fixed(mut problem) => {
                let changed = self.change(&mut problem);
                self.running = Running::Fixed(problem);
                changed?;
            }
            Running::Nothing => return Err(lost()),
        }
        self.before = targets_only(&self.input);
        self.retargeted = false;
        Ok(())
    }

    /// The linear response of the last pose where that is better than the smooth start, and a method from there on; the
    /// splitting from the smooth start, which is safe for motions of any size, where it is not.
    fn warm(&mut self, mut parts: Parts, smooth: Vec<f64>) -> Result<Auto, DeformError> {
        let name = self.settings.method.as_str().to_string();
        let responded = match &mut parts.hessian {
            Some(hessian) => {
                let mut moved: Vec<f64> = self.wanted.iter().zip(&self.pose).map(|(a, b)| a - b).collect();
                moved[..self.body.n_free() * parts.problem.dim].fill(0.0);
                respond(&mut parts.problem, &mut parts.normal, hessian, &self.pose, &moved)
                    .map_err(|e| self.explain(&e))?
                    .map(|response| (response, moved))
            }
            None => None,
        };
        if let Some((response, mut x)) = responded {
            self.reference = self.reference.max(response.force.min(self.characteristic));
            x[..response.d.len()].copy_from_slice(&response.d);
            x.iter_mut().zip(&self.pose).for_each(|(x, pose)| *x += pose);
            let free = response.d.len();
            x[free..].copy_from_slice(&self.wanted[free..]);
            let (there, fallback) = (parts.problem.energy(&x, None), parts.problem.energy(&smooth, None));
            let barred = parts.problem.barrier && there.inverted > 0;
            if !barred && is_better(&there, &fallback, parts.problem.barrier) {
                parts.x = x;
                return Auto::resume(name, parts, self.auto(), 0).map_err(|e| self.explain(&e));
            }
        }
        let Parts { problem, normal, admm, .. } = parts;
        let admm = Admm::resume(problem, normal, smooth, admm, 0);
        let mut auto = Auto::new(name, admm, self.auto());
        let norm = auto.evaluate().gradient_norm;
        self.reference = self.reference.max(norm.min(self.characteristic));
        Ok(auto)
    }

    /// Goes on towards the minimum for the targets of now.
    pub fn step(&mut self, budget: Option<Duration>, hooks: &mut Hooks<'_>) -> Result<Frame, DeformError> {
        let began = Instant::now();
        if budget.is_some_and(|b| b.is_zero()) && self.retargeted {
            return self.smooth_frame(budget.unwrap_or_default());
        }
        if self.retargeted {
            self.begin()?;
        }
        let (tol, patch_tol) = (self.settings.tol, self.settings.patch_tol);
        let Some(method) = self.running.method() else {
            self.pose.copy_from_slice(&self.wanted);
            return self.fixed_frame();
        };
        let mut tolerance = GradientTolerance::against(tol, self.reference, self.characteristic);
        let mut residuals = ResidualTolerance::new(tol);
        let mut patch = patch_tol.map(|eps| proxel_split::PatchGradient::new(eps, method.problem()));
        let hard = method.problem().has_hard_sets();
        let mut cancel = Cancel(hooks.cancel.clone());
        let mut time = Budget { began, budget };
        let mut limit = Iterations { most: self.settings.max_iters, done: 0 };
        let mut stuck = NoProgress::new(REFUSALS);
        let mut stops: Vec<&mut dyn Stop> = vec![if hard { &mut residuals } else { &mut tolerance }];
        if let Some(patch) = &mut patch {
            stops.push(patch);
        }
        stops.extend([&mut cancel as &mut dyn Stop, &mut time, &mut limit, &mut stuck]);
        let start = method.x().to_vec();
        let mut watcher =
            Watcher::new(hooks, began, |x: &[f64]| self.body.reference_error(x, &start).unwrap_or(f64::INFINITY));
        let outcome = proxel_split::run(method, &mut stops, &mut watcher);
        // At the border of a hard set the gradient says nothing, and of a point that was left it is not known.
        let known = outcome.is_last && !hard;
        let gradient = known.then(|| method.evaluate().gradient_norm);
        self.pose.copy_from_slice(&outcome.x);
        Ok(self.frame(outcome, gradient))
    }

    fn frame(&self, outcome: Outcome, gradient_norm: Option<f64>) -> Frame {
        let reference = self.reference;
        let ratio = |g: f64| if reference > 0.0 { g / reference } else { 0.0 };
        Frame {
            positions: self.positions(),
            status: outcome.status,
            reason: outcome.reason,
            iterations: outcome.accepted + outcome.rejected,
            inner_iterations: outcome.inner_iterations,
            refactorisations: outcome.refactorisations,
            energy: outcome.energy.value,
            gradient_norm,
            gradient_ratio: gradient_norm.map(ratio),
            inverted: outcome.energy.inverted,
            min_stretch: outcome.energy.min_stretch,
            max_stretch: outcome.energy.max_stretch,
            warnings: Vec::new(),
        }
    }

    /// No time but for the start. The targets are still to be looked at.
    fn smooth_frame(&mut self, budget: Duration) -> Result<Frame, DeformError> {
        let smooth = self.smooth()?;
        let positions = self.body.positions(&smooth);
        Ok(Frame {
            positions,
            status: Status::Stopped,
            reason: spent(budget),
            iterations: 0,
            inner_iterations: 0,
            refactorisations: 0,
            energy: f64::NAN,
            gradient_norm: None,
            gradient_ratio: None,
            inverted: 0,
            min_stretch: f64::NAN,
            max_stretch: f64::NAN,
            warnings: Vec::new(),
        })
    }

    fn fixed_frame(&mut self) -> Result<Frame, DeformError> {
        let energy = match &mut self.running {
            Running::Fixed(problem) => problem.energy(&self.pose, None),
            _ => return Err(DeformError("the deformer ended with an error before; build it anew".to_string())),
        };
        Ok(Frame {
            positions: self.positions(),
            status: Status::Converged,
            reason: "every vertex is fixed; there is nothing to move".to_string(),
            iterations: 0,
            inner_iterations: 0,
            refactorisations: 0,
            energy: energy.value,
            gradient_norm: Some(0.0),
            gradient_ratio: Some(0.0),
            inverted: energy.inverted,
            min_stretch: energy.min_stretch,
            max_stretch: energy.max_stretch,
            warnings: Vec::new(),
        })
    }
}

/// What of an input moves without being fixed.
fn targets_only(input: &DeformInput) -> DeformInput {
    DeformInput { soft: input.soft.clone(), ties: input.ties.clone(), ..DeformInput::default() }
}

/// All that draws, as springs from points of the user's vertices.
fn draws(input: &DeformInput) -> Vec<PointSpring> {
    let at =
        |v: u32, target, stiffness| PointSpring { nodes: [v; 4], weights: [1.0, 0.0, 0.0, 0.0], target, stiffness };
    let soft = input.soft.iter().map(|(v, target, k)| at(*v, *target, *k));
    input.ties.iter().copied().chain(soft).collect()
}

/// Fewer inverted elements where they must not be, then lower energy; NaN is never better.
fn is_better(a: &EnergyReport, b: &EnergyReport, barrier: bool) -> bool {
    let (a_bad, b_bad) = if barrier { (a.inverted, b.inverted) } else { (0, 0) };
    a.value.is_finite() && (a_bad < b_bad || (a_bad == b_bad && (a.value < b.value || !b.value.is_finite())))
}
