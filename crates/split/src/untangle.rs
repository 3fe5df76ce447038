//! A way out of inverted elements, for energies that are infinite there.

use crate::{EnergyReport, Evaluation, Method, Newton, NewtonSettings, NormalMatrix, Problem, StepReport, SystemError};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A positive number that a method turns while an energy reads it: how far a relaxed energy is from the one it stands for.
#[derive(Clone, Debug)]
pub struct Dial(Arc<AtomicU64>);

impl Dial {
    /// At a value.
    pub fn new(value: f64) -> Self {
        Dial(Arc::new(AtomicU64::new(value.to_bits())))
    }

    /// Its value.
    #[inline(always)]
    pub fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }

    /// Turns it.
    pub fn set(&self, value: f64) {
        self.0.store(value.to_bits(), Ordering::Relaxed);
    }
}

/// Says what to minimise where elements are inverted: the same problem with an energy that is finite everywhere, and tends to
/// the real one where nothing is inverted as the dial goes to 0.
pub trait Relax: Send {
    /// The relaxed problem over the same nodes, and the dial of its energy.
    ///
    /// # Errors
    /// A problem that does not fit together.
    fn relaxed(&self) -> Result<(Problem, Dial), SystemError>;
}

/// The dial begins at this part of the least stretch, within bounds: elements that are turned over far are not to weigh so much
/// that all others give way.
const PART: f64 = 0.5;
const BOUNDS: (f64, f64) = (1e-2, 1.0);

/// The dial is turned down where a step lowers the energy by less than this part,
const SLOW: f64 = 0.3;

/// by this factor.
const TURN: f64 = 0.5;

/// Newton's method on a relaxed energy whose dial is turned down with the progress that it makes (Garanzha et al. 2021,
/// "Foldover-free maps in 50 lines of code", section 4). Energies and gradients that it reports are those of the real problem.
pub struct Untangle {
    newton: Newton,
    dial: Dial,
    real: Problem,
    value: f64, // of the relaxed energy, at this dial
}

impl Untangle {
    /// Begins at x, after some iterations of another method, whose normal matrix it borrows.
    ///
    /// # Errors
    /// A relaxed problem without second derivatives.
    pub fn new(
        mut real: Problem,
        (relaxed, dial): (Problem, Dial),
        normal: NormalMatrix,
        x: Vec<f64>,
        settings: NewtonSettings,
        iteration: usize,
    ) -> Result<Self, SystemError> {
        let least = real.energy(&x, None).min_stretch.abs();
        dial.set((PART * least).clamp(BOUNDS.0, BOUNDS.1));
        let mut newton = Newton::resume(relaxed, normal, x, settings, iteration)?;
        let value = newton.energy().value;
        Ok(Untangle { newton, dial, real, value })
    }

    /// The real problem, the normal matrix and where it has got to.
    pub fn into_parts(self) -> (Problem, NormalMatrix, Vec<f64>) {
        let (_, normal, x) = self.newton.into_parts();
        (self.real, normal, x)
    }
}

impl Method for Untangle {
    fn name(&self) -> &str {
        self.newton.name()
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        let report = self.newton.step()?;
        let after = self.newton.energy();
        let progress = 1.0 - after.value / self.value;
        if progress < SLOW {
            self.dial.set(self.dial.get() * TURN);
        }
        self.newton.forget();
        self.value = self.newton.energy().value;
        Ok(report)
    }

    fn x(&self) -> &[f64] {
        self.newton.x()
    }

    fn problem(&self) -> &Problem {
        &self.real
    }

    fn energy(&mut self) -> EnergyReport {
        self.real.energy(self.newton.x(), None)
    }

    fn evaluate(&mut self) -> Evaluation {
        let mut grad = vec![0.0; self.real.n_free * self.real.dim];
        let energy = self.real.energy(self.newton.x(), Some(&mut grad));
        Evaluation { energy, gradient_norm: self.real.gradient_norm(&mut grad) }
    }

    fn factor_bytes(&self) -> u64 {
        self.newton.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.real
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_of_a_dial_turn_together() {
        let dial = Dial::new(1.0);
        let other = dial.clone();
        dial.set(0.25);
        assert_eq!(other.get(), 0.25);
    }
}
