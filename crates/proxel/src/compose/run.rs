//! The course of a run.

use super::build::Built;
use super::{ComposeError, ComposeMethod, ComposeSettings, Composed, Composition};
use crate::deform::{Hooks, REFUSALS, TimeLimit, Watcher};
use crate::report::{Report, Seconds};
use crate::settings::NewtonSettings;
use crate::threads;
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, BuildError, Cancel, Cycle, Direct, Extrapolation, GradientTolerance,
    History, IterationLimit, Method, Newton, NoProgress, Order, Problem, QuasiNewton, ResidualTolerance, Stop,
    SystemError, vector,
};
use std::time::Instant;

/// Solves a composition. What is returned holds for the positions as returned.
///
/// # Errors
/// A composition that describes no problem, or none that the method takes. A run that does not converge is no error:
/// see [`Composed::status`].
pub fn solve(of: &Composition, settings: &ComposeSettings, hooks: &mut Hooks<'_>) -> Result<Composed, ComposeError> {
    let began = Instant::now();
    settings.check().map_err(ComposeError)?;
    let (pool, threads) = threads::pool(settings.threads).map_err(ComposeError)?;
    pool.install(|| solve_here(of, settings, hooks, threads, began))
}

/// What `auto` stands for.
fn chosen(built: &Built, settings: &ComposeSettings) -> Result<ComposeMethod, ComposeError> {
    let hard = built.problem.has_hard_sets();
    let method = match settings.method {
        ComposeMethod::Auto if hard => ComposeMethod::AaAdmm,
        ComposeMethod::Auto if built.has_own => ComposeMethod::Lbfgs,
        ComposeMethod::Auto if built.has_sets => ComposeMethod::AaAdmm,
        ComposeMethod::Auto => ComposeMethod::Newton,
        method => method,
    };
    let (what, remedy) = match method {
        ComposeMethod::Admm | ComposeMethod::AaAdmm if built.has_own => {
            ("an energy of one's own, of which it needs more than the gradient", "make all sets soft and use lbfgs")
        }
        ComposeMethod::Lbfgs if hard => ("hard sets", "make them soft, or use admm or aa-admm"),
        ComposeMethod::Newton if built.has_sets => ("sets", "use admm, aa-admm or, where all are soft, lbfgs"),
        ComposeMethod::Newton if built.has_own => ("an energy of one's own", "use lbfgs"),
        _ => return Ok(method),
    };
    Err(ComposeError(format!("{} cannot take {what}; {remedy}", method.as_str())))
}

/// Why there is no method.
enum Refused {
    System(SystemError),
    Build(BuildError),
}

fn method(problem: Problem, name: ComposeMethod, settings: &ComposeSettings) -> Result<Box<dyn Method>, Refused> {
    match name {
        ComposeMethod::Lbfgs => {
            let settings = settings.lbfgs.to_method(name.as_str(), false);
            return Ok(Box::new(QuasiNewton::new(problem, settings).map_err(Refused::System)?));
        }
        ComposeMethod::Newton | ComposeMethod::Auto => {
            let settings = NewtonSettings::default().of(crate::settings::MethodName::Newton);
            return Ok(Box::new(Newton::new(problem, settings).map_err(Refused::System)?));
        }
        ComposeMethod::Admm | ComposeMethod::AaAdmm => {}
    }
    let has_dual = problem.terms.iter().any(|term| term.has_dual());
    let text = name.as_str().to_string();
    let parts = AdmmSettings { name: text, global: Box::new(Direct), reweighting: None, renewed_at: None };
    let admm = Admm::new(problem, parts).map_err(Refused::System)?;
    if name == ComposeMethod::Admm {
        let admm = admm.with_cycle(Cycle { order: Order::Zxu, relaxation: 1.0 }).map_err(Refused::Build)?;
        return Ok(Box::new(admm));
    }
    // Where nothing is split off there is nothing to accelerate but nearest points and solves in turns.
    let algorithm = if has_dual { Algorithm::Two } else { Algorithm::Alternation };
    let by = match settings.anderson {
        0 => Extrapolation::None,
        m => Extrapolation::anderson(m),
    };
    Acceleration { algorithm, by, history: History::AsPublished }.of(admm).map_err(Refused::Build)
}

fn solve_here(
    of: &Composition,
    settings: &ComposeSettings,
    hooks: &mut Hooks<'_>,
    threads: usize,
    began: Instant,
) -> Result<Composed, ComposeError> {
    let mut built = Built::new(of)?;
    if built.problem.n_free == 0 {
        return Err(ComposeError("every point is held; there is nothing to move: leave some out of fix".to_string()));
    }
    let name = chosen(&built, settings)?;
    let problem = std::mem::replace(&mut built.problem, Problem::empty());
    let order = built.order.clone();
    let mut method = method(problem, name, settings).map_err(|e| match e {
        Refused::System(e) => Built::explain(&order, &e),
        Refused::Build(e) => ComposeError(e.to_string()),
    })?;
    let setup = began.elapsed().as_secs_f64();
    let splits = matches!(name, ComposeMethod::Admm | ComposeMethod::AaAdmm);
    let has_dual = splits && method.problem().terms.iter().any(|term| term.has_dual());
    let mut tolerance: Box<dyn Stop> = match has_dual {
        true => Box::new(ResidualTolerance::new(settings.tol)),
        false => {
            // Sets have no stiffness of their own: their weights are what a displacement of the size of the body meets.
            let stiffness = built.unit * vector::norm(&method.problem().node_stiffness());
            let characteristic = method.problem().characteristic_gradient().max(stiffness);
            let start = method.evaluate().gradient_norm;
            let reference = if start.is_finite() { start.min(characteristic) } else { characteristic };
            Box::new(GradientTolerance::against(settings.tol, reference, characteristic))
        }
    };
    let (mut limit, mut stuck) = (IterationLimit(settings.max_iters), NoProgress::new(REFUSALS));
    let (mut cancel, mut time) = (Cancel(hooks.cancel.clone()), TimeLimit::new(began, settings.time_limit));
    let mut watcher = Watcher::new(hooks, began, |_: &[f64]| f64::INFINITY);
    let mut stops: [&mut dyn Stop; 5] = [tolerance.as_mut(), &mut cancel, &mut time, &mut limit, &mut stuck];
    let outcome = proxel_split::run(method.as_mut(), &mut stops, &mut watcher);
    let solve = began.elapsed().as_secs_f64() - setup;
    let finite = |v: f64| v.is_finite().then_some(v);
    let residuals = has_dual.then(|| method.residuals());
    let factor_bytes = method.factor_bytes();
    let mut problem = method.into_problem();
    let hard = problem.has_hard_sets();
    let mut grad = vec![0.0; 3 * problem.n_free];
    let energy = problem.energy(&outcome.x, Some(&mut grad));
    let gradient = if hard { None } else { finite(problem.gradient_norm(&mut grad)) };
    let report = Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: "problem".to_string(),
        settings: serde_json::to_value(settings).unwrap_or_default(),
        method: name.as_str().to_string(),
        status: outcome.status.as_str().to_string(),
        reason: outcome.reason.clone(),
        iterations: outcome.iterations,
        inner_iterations: outcome.inner_iterations,
        refactorisations: outcome.refactorisations,
        energy: finite(energy.value),
        gradient_norm: gradient,
        inverted: Some(energy.inverted),
        min_stretch: finite(energy.min_stretch),
        max_stretch: finite(energy.max_stretch),
        primal_residual: residuals.and_then(|r| finite(r.primal)),
        dual_residual: residuals.and_then(|r| finite(r.dual)),
        accepted: outcome.accepted,
        rejected: outcome.rejected,
        warnings: built.warnings.clone(),
        seconds: Seconds { setup, solve, ..Seconds::default() },
        factor_bytes: Some(factor_bytes),
        threads,
        ..Report::default()
    };
    let positions = built.positions(&outcome.x, &of.fixed);
    Ok(Composed { positions, status: outcome.status, violation: energy.violation, report })
}
