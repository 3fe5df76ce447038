//! Anderson acceleration of ADMM under a safeguard.
//!
//! | method | accelerated | judged by | source |
//! |---|---|---|---|
//! | AA-ADMM | (z, u) | combined residual, [`CombinedResidual`] | A, Algorithm 1 |
//! | AADR | s = c(Dx) + u of the Douglas-Rachford iteration | envelope, [`Envelope`] | Ouyang et al. 2020 |
//!
//! The first works with any coupling, so it accelerates R-ADMM and WRAPD too. Positions ride along: where the global step is
//! affine in p they are extrapolated exactly, so that an accelerated point costs no solve of its own.

use crate::{
    Admm, Anderson, EnergyReport, Evaluation, LocalReport, Method, Problem, Residual, Residuals, StepReport,
    SystemError, vector,
};

mod combined;
mod envelope;
mod packed;

pub use combined::CombinedResidual;
pub use envelope::Envelope;

use packed::Packed;

/// AA-ADMM, A, Algorithm 1.
pub type AaAdmm = Accelerated<CombinedResidual>;

/// Anderson-accelerated Douglas-Rachford splitting, Ouyang et al. 2020.
pub type Aadr = Accelerated<Envelope>;

/// Numbers handled by one task.
const CHUNK: usize = 8192;

/// Values of a merit that differ by less than this part of themselves are equal but for rounding.
const ROUNDING: f64 = 1e-14;

/// How good the image G(q) of a point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merit {
    /// What is to fall.
    pub value: f64,
    /// What is to fall where rounding hides the fall of `value`.
    pub residual: f64,
}

impl Merit {
    /// Whether it is less than that of `before`; never so for a NaN.
    fn improves(&self, before: &Merit) -> bool {
        let rounding = ROUNDING * before.value.abs();
        self.value < before.value - rounding
            || (self.value <= before.value + rounding && self.residual < before.residual)
    }
}

/// w for every entry of the local vectors of all terms, one after another.
fn packed_weights(problem: &Problem) -> Vec<f64> {
    let mut weights = vec![0.0; problem.terms.iter().map(|term| term.local_len()).sum()];
    let mut rest = weights.as_mut_slice();
    for term in &problem.terms {
        let (head, tail) = rest.split_at_mut(term.local_len());
        term.local_weights2(head);
        rest = tail;
    }
    weights.iter_mut().for_each(|w| *w = w.sqrt());
    weights
}

/// What is accelerated, and by what an accelerated point is judged.
pub trait Acceleration: Send + Sized {
    /// Whether z = p + u is part of the state; otherwise z is that of the last local step.
    const CARRIES_Z: bool;
    /// Whether the history is kept when a point is rejected.
    const KEEPS_HISTORY: bool;

    /// For the terms of a problem under their weights.
    fn new(problem: &Problem) -> Self;

    /// The weights have changed.
    fn reweighted(&mut self, problem: &Problem);

    /// Takes what it needs of the point before an iteration.
    fn before(&mut self, p: &[Vec<f64>], u: &[Vec<f64>]);

    /// After the local step: a merit, if it is known so early.
    fn after_local(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], local: &LocalReport) -> Option<Merit>;

    /// After the global step to x: the merit.
    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        p: &[Vec<f64>],
        u: &[Vec<f64>],
        local: &LocalReport,
    ) -> Merit;

    /// The residual G(q) - q of the iteration just done, scaled to the metric of the splitting.
    fn residual(&self) -> &[f64];
}

/// ADMM with Anderson acceleration: after each iteration the next point is an extrapolation of the window; a point whose
/// merit is not better than that of the last accepted one is dropped for the image of that one, which is taken whatever
/// its merit.
///
/// Every point tried counts as an iteration: each costs a local step. Positions, energies and residuals are those of the
/// last accepted one.
pub struct Accelerated<A> {
    admm: Admm,
    anderson: Anderson,
    acceleration: A,
    accepted: Packed, // G(q) of the last accepted q
    image: Packed,    // scratch
    x: Vec<f64>,      // of `accepted`, all nodes
    grad: Vec<f64>,
    merit: Option<Merit>, // of the last accepted; none where the next is taken whatever its merit
    moved2: f64,          // sum w^2 |z - z_before|^2 of the last accepted
    extrapolated: bool,   // whether the point at hand is an extrapolation
    energy: Option<EnergyReport>,
    evaluation: Option<Evaluation>,
}

impl<A: Acceleration> Accelerated<A> {
    /// Accelerates `admm` with a window of m = `window` columns.
    pub fn new(mut admm: Admm, window: usize) -> Self {
        let x = admm.x().to_vec();
        let mut accepted = Packed::new(admm.state(), A::CARRIES_Z);
        accepted.pack(&admm.state());
        Accelerated {
            anderson: Anderson::new(window),
            acceleration: A::new(admm.problem()),
            image: accepted.clone(),
            accepted,
            grad: vec![0.0; admm.problem().n_free * admm.problem().dim],
            x,
            admm,
            merit: None,
            moved2: f64::INFINITY,
            extrapolated: false,
            energy: None,
            evaluation: None,
        }
    }

    /// Whether a point of this merit is kept.
    fn keeps(&self, merit: &Merit) -> bool {
        !self.extrapolated || self.merit.is_none_or(|before| merit.improves(&before))
    }

    /// Back to the image of the last accepted point.
    fn reject(&mut self, report: StepReport, merit: Merit) -> StepReport {
        self.accepted.restore(&mut self.admm.state());
        self.extrapolated = false;
        if !A::KEEPS_HISTORY {
            self.anderson.reset();
        }
        StepReport { accepted: false, merit: Some(merit.value), ..report }
    }

    /// On to an extrapolation.
    fn accept(&mut self, report: StepReport, merit: Merit) -> StepReport {
        self.energy = None;
        self.evaluation = None;
        self.x.copy_from_slice(self.admm.x());
        self.accepted.pack(&self.admm.state());
        self.merit = Some(merit);
        self.moved2 = report.local.moved2;
        if report.refactorised {
            // Under other weights u is another variable, and merits measure something else.
            self.acceleration.reweighted(self.admm.problem());
            self.anderson.reset();
            self.merit = None;
            self.extrapolated = false;
        } else {
            self.anderson.next(&self.accepted.values, self.acceleration.residual(), &mut self.image.values);
            self.extrapolated = self.anderson.columns() > 0;
            if self.extrapolated {
                self.image.unpack(&mut self.admm.state());
            }
        }
        StepReport { merit: Some(merit.value), ..report }
    }
}

impl<A: Acceleration> Method for Accelerated<A> {
    fn name(&self) -> &str {
        self.admm.name()
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let state = self.admm.state();
        self.acceleration.before(state.p, state.u);
        let local = self.admm.local_half();
        let state = self.admm.state();
        let early = self.acceleration.after_local(state.p, state.u, &local);
        if let Some(merit) = early.filter(|merit| !self.keeps(merit)) {
            let iteration = self.admm.skip_global_half();
            let report = StepReport { iteration, energy_z: local.value_after, local, ..StepReport::default() };
            return Ok(self.reject(report, merit));
        }
        let report = self.admm.global_half(local)?;
        let merit = match early {
            Some(merit) => merit,
            None => {
                let (problem, x, p, u) = self.admm.parts();
                self.acceleration.after_global(problem, x, p, u, &local)
            }
        };
        Ok(if self.keeps(&merit) { self.accept(report, merit) } else { self.reject(report, merit) })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        self.admm.problem()
    }

    fn energy(&mut self) -> EnergyReport {
        let (x, problem) = (&self.x, self.admm.problem_mut());
        *self.energy.get_or_insert_with(|| problem.energy(x, None))
    }

    fn evaluate(&mut self) -> Evaluation {
        let (x, grad, problem) = (&self.x, &mut self.grad, self.admm.problem_mut());
        let evaluation = *self.evaluation.get_or_insert_with(|| {
            let energy = problem.energy(x, Some(grad));
            Evaluation { energy, gradient_norm: vector::norm(grad) }
        });
        self.energy = Some(evaluation.energy);
        evaluation
    }

    fn residuals(&mut self) -> Residuals {
        let mut residual = Residual::default();
        for (t, term) in self.admm.problem_mut().terms.iter_mut().enumerate() {
            let (p, u) = self.accepted.local(t);
            residual += term.residual(&self.x, p, u);
        }
        let relative = |part2: f64| (part2 / residual.size2.max(f64::MIN_POSITIVE)).sqrt();
        Residuals { primal: relative(residual.gap2), dual: relative(self.moved2) }
    }

    fn factor_bytes(&self) -> u64 {
        self.admm.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        Box::new(self.admm).into_problem()
    }
}
