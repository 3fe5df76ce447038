//! The heart of Proxel: minimisation by splitting.
//!
//! Every problem has the form
//!
//! ```text
//! min over x, z   f(x) + sum_t g_t(z_t)    subject to   c_t(D_t x) = z_t
//! ```
//!
//! with f a quadratic ([`Quadratic`]) and each t a [`Term`]: a batch of like elements that knows its reduction D_t, its
//! coupling c_t (the identity, or the stretch of the polar decomposition) and the proximal operator of g_t.
//! A [`Problem`] holds the terms; [`Admm`] iterates; a [`GlobalStep`] says how the positions follow the local
//! variables; [`Reweighting`] says when the weights follow the stiffness; [`run`] drives any [`Method`] until a
//! [`Stop`] speaks, and tells [`Observer`]s.
//!
//! This crate knows no mesh, no energy and no application; it neither prints nor reads a clock.

mod accelerated;
mod accelerator;
mod admm;
mod auto;
mod balancing;
mod blend;
mod curvature;
mod cycle;
mod equality;
mod exhausted;
mod form;
mod global;
mod guard;
mod inertia;
mod intake;
mod lbfgs;
mod line_search;
mod method;
mod newton;
mod pairs;
mod penalty;
mod points;
mod potential;
mod problem;
mod progress;
mod quasi_newton;
mod residual_stop;
mod response;
mod reweight;
mod run;
mod sweep;
mod system;
mod tangent;
mod term;
mod untangle;
pub mod vector;
mod weight;

pub use accelerated::{
    Accelerated, Acceleration, Account, Algorithm, Alternation, BuildError, Carrier, CombinedResidual,
    CombinedResidualRaw, CombinedResidualZxu, DouglasRachford, DualAlone, Envelope, Extrapolated, Extrapolation,
    ForwardResidual, ForwardResidualZxu, History, LocalAlone, Merit, Sense,
};
pub use accelerator::{Accelerator, Anderson, Iterate, Kind, Momentum, Proposal, Unaccelerated};
pub use admm::{Admm, AdmmSettings};
pub use auto::{Auto, AutoSettings, Gains, Parts, Price, solver_for};
pub use balancing::Balancing;
pub use blend::Blend;
pub use curvature::{Curvature, Projection};
pub use cycle::{Cycle, Order};
pub use equality::{Equalities, Equality, EqualityError};
pub use exhausted::{Exhausted, RoundingReached};
pub use form::SymmetricForm;
pub use global::{Direct, GlobalReport, GlobalStep, Objective, Pull};
pub use guard::InversionGuard;
pub use inertia::Inertia;
pub use intake::{Intake, Taker};
pub use lbfgs::{InnerStop, Lbfgs, LbfgsSettings};
pub use line_search::{Backtracking, Landing, Ray};
pub use method::{Evaluation, Method, Residuals, Splitting, SquaredResiduals, StepReport, Trial, normalized};
pub use newton::{
    Cg, CgEnd, CgReport, FactorCost, Found, Hessian, LinearSolver, Newton, NewtonSettings, ProjectionRule, Search,
};
pub use pairs::Pairs;
pub use penalty::{LevelBound, SafePenalty};
pub use points::PointSpring;
pub use potential::Potential;
pub use problem::{Problem, ProblemError, Quadratic};
pub use progress::NoProgress;
pub use quasi_newton::{QuasiNewton, QuasiNewtonSettings};
pub use residual_stop::ResidualTolerance;
pub use response::{Response, respond};
pub use reweight::{Hardening, Range, Reweighting};
pub use run::{
    Cancel, GradientTolerance, IterationLimit, NoObserver, Observer, Outcome, PatchGradient, Status, Stop, VIOLATION,
    Verdict, run,
};
pub use sweep::Uncoupled;
pub use system::{NormalMatrix, Precision, SystemError};
pub use tangent::{Tangent, TangentError};
pub use term::{DualMap, EnergyReport, Folded, LocalReport, PenaltyReport, Residual, Scale, Term};
pub use untangle::{Dial, Relax, Untangle};
pub use weight::Weight;
