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

mod admm;
mod global;
mod lbfgs;
mod method;
mod points;
mod problem;
mod reweight;
mod run;
mod system;
mod term;
pub mod vector;

pub use admm::{Admm, AdmmSettings};
pub use global::{Direct, GlobalReport, GlobalStep, Objective};
pub use lbfgs::{InnerStop, Lbfgs, LbfgsSettings};
pub use method::{Evaluation, Method, Residuals, StepReport};
pub use points::PointSpring;
pub use problem::{Problem, ProblemError, Quadratic};
pub use reweight::{Hardening, Range, Reweighting};
pub use run::{Cancel, GradientTolerance, IterationLimit, NoObserver, Observer, Outcome, Status, Stop, Verdict, run};
pub use system::{NormalMatrix, SystemError};
pub use term::{EnergyReport, LocalReport, PenaltyReport, Residual, Term};
