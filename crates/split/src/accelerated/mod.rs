//! Acceleration of ADMM under a safeguard: one driver, put together from a [`Carrier`], what of the iteration is
//! accelerated, and an [`Accelerator`], what proposes the next point.
//!
//! | carrier | order | accelerated | judged by | source |
//! |---|---|---|---|---|
//! | [`CombinedResidual`] | x-z-u | (z, u) | combined residual A(11) | A, Algorithm 1 |
//! | [`CombinedResidualZxu`] | z-x-u | (x, u) | combined residual A(12) | A, Algorithm 2 |
//! | [`CombinedResidualRaw`] | z-x-u | (x, u), in the Euclidean metric | combined residual A(12) | A's implementation |
//! | [`ForwardResidual`] | x-z-u | z, u by A(21) | forward residual A(22) | A, Algorithm 3 |
//! | [`ForwardResidualZxu`] | z-x-u | u, x by A(23) | forward residual A(24) | A, Algorithm 4 |
//! | [`LocalAlone`], [`DualAlone`] | x-z-u | z or u, the rest rides along | forward residual A(22) | A, appendix E |
//! | [`DouglasRachford`] | x-z-u | s = c(Dx) + u | fixed-point residual of s | Eckstein and Bertsekas 1992; Ouyang et al.'s implementation |
//! | [`Envelope`] | x-z-u | s = c(Dx) + u of the Douglas-Rachford iteration | envelope | Ouyang et al. 2020 |
//! | [`Alternation`] | z-x-u without duals | x | objective | Peng et al. 2018 |
//!
//! Accelerators are [`Anderson`] of both types, [`Momentum`] and [`Unaccelerated`]. The first carrier works with any
//! coupling, so it accelerates R-ADMM and WRAPD too.

use crate::accelerator::{Accelerator, Iterate, Proposal};
use crate::{
    Admm, EnergyReport, Evaluation, LocalReport, Method, Order, Problem, Residuals, Splitting, SquaredResiduals,
    StepReport, SystemError, Trial, vector,
};

mod account;
mod alternation;
mod carrier;
mod douglas_rachford;
mod envelope;
mod error;
mod packed;
mod pair;
mod price;
mod raw;
mod settings;
mod single;

pub use account::Account;
pub use alternation::Alternation;
pub use carrier::{Carrier, Extrapolated, Sense};
pub use douglas_rachford::DouglasRachford;
pub use envelope::Envelope;
pub use error::BuildError;
pub use pair::{CombinedResidual, CombinedResidualZxu};
pub use raw::CombinedResidualRaw;
pub use settings::{Acceleration, Algorithm, Extrapolation};
pub use single::{DualAlone, ForwardResidual, ForwardResidualZxu, LocalAlone};

use packed::Packed;
use price::IterationPrice;

/// Values of a merit that differ by less than this part of themselves are equal but for rounding.
const ROUNDING: f64 = 1e-14;

/// How good a point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merit {
    /// What is to fall.
    pub value: f64,
    /// What is to fall where rounding hides the fall of `value`.
    pub residual: f64,
}

impl Merit {
    /// Of a squared residual.
    fn of_square(value: f64) -> Self {
        Merit { value, residual: value.sqrt() }
    }

    /// Whether it is less than `required` times that of `before`; never so for a NaN.
    fn improves(&self, before: &Merit, required: f64) -> bool {
        let rounding = ROUNDING * before.value.abs();
        let limit = required * before.value;
        self.value < limit - rounding || (self.value <= limit + rounding && self.residual < before.residual)
    }
}

/// What becomes of the history when a point is rejected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum History {
    /// As in the authors' implementation of the algorithm: [`Carrier::KEEPS_HISTORY`].
    #[default]
    AsPublished,
    /// It is kept: only the point is replaced.
    Keep,
    /// It is dropped, and begins with the image that is gone on from.
    Clear,
}

/// ADMM under an accelerator: the next point is a proposal of the accelerator; a point whose merit is not better than that
/// of the last accepted one is dropped for the image of that one, which is taken whatever its merit.
///
/// A step ends with an accepted point: rejections within it are counted in [`StepReport::trial`]. Between steps the state is
/// the image of the last accepted point under the plain iteration, so that positions, energies and residuals are those of
/// plain ADMM from that point.
pub struct Accelerated<C> {
    admm: Admm,
    accelerator: Box<dyn Accelerator>,
    carrier: C,
    keeps_history: bool,
    default: Packed,      // the image of the last accepted point
    point: Vec<f64>,      // q: the proposal, laid out as `default.values`
    proposal: Vec<f64>,   // scratch
    cycles: usize,        // since the history was begun
    extrapolated: bool,   // whether the point at hand is a proposal
    merit: Option<Merit>, // of the last accepted; none where the next is taken whatever its merit
    iteration: usize,
    account: Option<(Account, IterationPrice)>, // where acceleration has to pay
}

impl<C: Carrier> Accelerated<C> {
    /// Puts them together.
    ///
    /// # Errors
    /// A carrier whose conditions the iteration does not meet; the text says what to take.
    pub fn new(mut admm: Admm, accelerator: Box<dyn Accelerator>, history: History) -> Result<Self, BuildError> {
        C::check(&admm)?;
        if C::LATE && admm.is_reweighted() {
            return Err(BuildError::Reweighted { algorithm: C::NAME });
        }
        let default = Packed::new(&admm.state(), C::EXTRAPOLATED);
        Ok(Accelerated {
            carrier: C::new(admm.problem()),
            point: default.values.clone(),
            proposal: default.values.clone(),
            default,
            iteration: admm.iterations(),
            admm,
            accelerator,
            keeps_history: match history {
                History::AsPublished => C::KEEPS_HISTORY,
                History::Keep => true,
                History::Clear => false,
            },
            cycles: 0,
            extrapolated: false,
            merit: None,
            account: None,
        })
    }

    /// Accelerates only where it pays, as an [`Account`] of counted costs finds out; `columns` are those of the accelerator's
    /// history. Otherwise the iteration is run as it is, at no other cost.
    #[must_use]
    pub fn where_it_pays(mut self, columns: usize) -> Self {
        let (sensed, values) = (self.carrier.sense().before.len(), self.point.len());
        let price = IterationPrice::new(&self.admm, sensed, values, columns);
        let full = Trial { columns, ..Trial::default() };
        self.account = Some((Account::new(price.of::<C>(&full)), price));
        self
    }

    /// What it has cost and gained, where that decides.
    pub fn account(&self) -> Option<&Account> {
        self.account.as_ref().map(|(account, _)| account)
    }

    /// An iteration as it is.
    fn plain_step(&mut self) -> Result<StepReport, SystemError> {
        let report = self.admm.step_in_halves()?;
        self.iteration += 1;
        if report.refactorised {
            self.carrier.reweigh(self.admm.problem());
        }
        Ok(report)
    }

    /// The plain iteration inside.
    pub fn admm(&self) -> &Admm {
        &self.admm
    }

    /// Whether a point of this merit is kept.
    fn keeps(&self, merit: &Merit) -> bool {
        let required = self.accelerator.required();
        !self.extrapolated || self.merit.is_none_or(|before| merit.improves(&before, required))
    }

    /// From the image of the last accepted point to a proposal.
    fn propose(&mut self, trial: &mut Trial) {
        self.default.pack(&self.admm.state());
        self.extrapolated = false;
        if self.cycles > C::SETTLES {
            let at = Iterate {
                q: &self.point,
                g: &self.default.values,
                sensed: &self.carrier.sense().before,
                f: &self.carrier.sense().residual,
            };
            let Proposal { columns, rank } = self.accelerator.next(&at, &mut self.proposal);
            (trial.columns, trial.rank) = (columns, rank);
            self.extrapolated = columns > 0;
        }
        if self.extrapolated {
            let (mut state, problem) = self.admm.state_and_problem();
            self.default.unpack(&self.proposal, &mut state, problem);
            std::mem::swap(&mut self.point, &mut self.proposal);
        } else {
            vector::copy(&mut self.point, &self.default.values);
        }
    }

    /// Back to that image.
    fn reject(&mut self, trial: &mut Trial) {
        self.default.restore(&mut self.admm.state());
        self.admm.set_iteration(self.iteration);
        vector::copy(&mut self.point, &self.default.values);
        self.extrapolated = false;
        self.accelerator.refused();
        if !self.keeps_history {
            self.accelerator.reset();
            trial.reset = true;
        }
        trial.rejected += 1;
    }

    /// The first half of a cycle, and what the carrier makes of it.
    fn local_half(&mut self) -> (LocalReport, Option<Merit>) {
        let (problem, x, p, u) = self.admm.parts();
        self.carrier.before(problem, x, p, u);
        let local = self.admm.local_half();
        let (_, _, p, u) = self.admm.parts();
        let merit = self.carrier.after_local(p, u, &local);
        (local, merit)
    }

    /// The second half.
    fn global_half(&mut self, local: LocalReport) -> Result<(StepReport, Option<Merit>), SystemError> {
        let report = self.admm.global_half(local)?;
        let (problem, x, p, u) = self.admm.parts();
        let merit = self.carrier.after_global(problem, x, p, u, &local);
        Ok((report, merit))
    }

    /// A cycle whose point is proposed before it: until one is kept.
    fn cycle(&mut self, trial: &mut Trial) -> Result<(StepReport, Option<Merit>), SystemError> {
        self.propose(trial);
        loop {
            let (local, early) = self.local_half();
            if early.is_some_and(|merit| !self.keeps(&merit)) {
                self.reject(trial);
                continue;
            }
            let (report, late) = self.global_half(local)?;
            let merit = early.or(late);
            if merit.is_none_or(|merit| self.keeps(&merit)) {
                return Ok((report, merit));
            }
            self.reject(trial);
        }
    }

    /// A cycle whose point is proposed between its halves.
    fn led_cycle(&mut self, trial: &mut Trial) -> Result<(StepReport, Option<Merit>), SystemError> {
        let (mut local, _) = self.local_half();
        self.propose(trial);
        if self.extrapolated {
            self.admm.aim(&mut local);
        }
        loop {
            let (report, merit) = self.global_half(local)?;
            if merit.is_none_or(|merit| self.keeps(&merit)) {
                return Ok((report, merit));
            }
            self.reject(trial);
            self.admm.aim(&mut local);
        }
    }
}

impl<C: Carrier> Method for Accelerated<C> {
    fn name(&self) -> &str {
        self.admm.name()
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let accelerates = self.account.as_ref().is_none_or(|(account, _)| account.accelerates());
        let report = if accelerates { self.accelerated_step() } else { self.plain_step() }?;
        if let Some((account, price)) = &mut self.account {
            let cost = if accelerates { price.of::<C>(&report.trial) } else { 1.0 };
            let square = match (C::ORDER, report.merit) {
                // The local step of a carrier that leads is that of the point before.
                (Order::Xzu, Some(merit)) if C::LEADS => merit,
                (Order::Xzu, None) if C::LEADS => report.local.gap2_before,
                (Order::Xzu, _) => report.local.combined(),
                (Order::Zxu, _) => report.local.gap2,
            };
            account.note(cost, square);
            if account.accelerates() && !accelerates {
                self.forget();
            }
        }
        Ok(report)
    }

    fn x(&self) -> &[f64] {
        self.admm.x()
    }

    fn problem(&self) -> &Problem {
        self.admm.problem()
    }

    fn energy(&mut self) -> EnergyReport {
        self.admm.energy()
    }

    fn evaluate(&mut self) -> Evaluation {
        self.admm.evaluate()
    }

    fn residuals(&mut self) -> Residuals {
        self.admm.residuals()
    }

    fn forward_residual(&mut self) -> Option<f64> {
        self.admm.forward_residual()
    }

    fn begin(&mut self, x: &[f64], keeps_duals: bool, change: &mut dyn FnMut(&mut Problem)) -> Result<(), SystemError> {
        self.admm.begin(x, keeps_duals, change)?;
        self.iteration = self.admm.iterations();
        self.forget();
        if let Some((account, _)) = &mut self.account {
            *account = account.renewed();
        }
        Ok(())
    }

    fn refactor(&mut self) -> Result<(), SystemError> {
        self.carrier.reweigh(self.admm.problem());
        self.forget();
        self.admm.refactor()
    }

    fn splitting(&mut self) -> Option<Splitting<'_>> {
        self.admm.splitting()
    }

    fn squared_residuals(&mut self) -> Option<SquaredResiduals> {
        self.admm.squared_residuals()
    }

    fn factor_bytes(&self) -> u64 {
        self.admm.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        Box::new(self.admm).into_problem()
    }

    fn forces(&mut self) -> Option<Vec<f64>> {
        self.admm.forces()
    }

    fn forces_of_term(&mut self, term: usize) -> Option<Vec<f64>> {
        self.admm.forces_of_term(term)
    }
}

impl<C: Carrier> Accelerated<C> {
    fn accelerated_step(&mut self) -> Result<StepReport, SystemError> {
        let mut trial = Trial::default();
        let (report, merit) = if C::LEADS { self.led_cycle(&mut trial) } else { self.cycle(&mut trial) }?;
        self.iteration += 1;
        self.admm.set_iteration(self.iteration);
        self.cycles += 1;
        self.merit = merit;
        trial.accelerated = self.extrapolated;
        if report.refactorised {
            // Under other weights u is another variable, and merits measure something else.
            self.carrier.reweigh(self.admm.problem());
            self.forget();
            trial.reset = true;
        }
        Ok(StepReport { iteration: self.iteration, merit: merit.map(|merit| merit.value), trial, ..report })
    }

    /// The next point is taken whatever its merit, and nothing is known of those before.
    fn forget(&mut self) {
        self.accelerator.reset();
        self.cycles = 0;
        self.extrapolated = false;
        self.merit = None;
    }
}
