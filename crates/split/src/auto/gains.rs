//! When the splitting has done its part.

use super::AutoSettings;

/// Says when the splitting has done its part.
#[derive(Clone, Debug, Default)]
pub struct Gains {
    first: Option<f64>,
    last: Vec<f64>, // energies of the last iterations, oldest first
}

impl Gains {
    /// Takes the energy after an iteration. True where the last `window` iterations gained less, each, than `gain` / `price`
    /// of all that was gained so far, unless gains fall so fast that the splitting will be there before Newton. While the
    /// energy rises nothing is said: the splitting is on its way over a hill.
    pub fn are_small(&mut self, energy: f64, price: f64, settings: &AutoSettings) -> bool {
        let first = *self.first.get_or_insert(energy);
        if self.last.len() > settings.window {
            self.last.remove(0);
        }
        self.last.push(energy);
        let falls = self.last.windows(2).all(|e| e[1] <= e[0]);
        if self.last.len() <= settings.window || !falls || energy > first {
            return false;
        }
        let mean = (self.last[0] - energy) / settings.window as f64;
        mean * price <= settings.gain * (first - energy) && self.remaining(first) > price * NEWTON_STEPS
    }

    /// Iterations that the splitting still needs if its gains go on to shrink by the factor that they shrink by now: so
    /// many until what is left to gain is [`CLOSE`] of all.
    fn remaining(&self, first: f64) -> f64 {
        let gains: Vec<f64> = self.last.windows(2).map(|e| e[0] - e[1]).collect();
        let [earliest, .., latest] = gains[..] else { return f64::INFINITY };
        let rate = (latest / earliest).powf(1.0 / (gains.len() - 1) as f64);
        if rate.is_nan() || rate >= 1.0 {
            return f64::INFINITY;
        }
        let left = latest * rate / (1.0 - rate);
        (CLOSE * (first - self.last[gains.len()]) / left).ln() / rate.ln()
    }
}

/// Iterations of Newton from where it begins to the end, at least.
const NEWTON_STEPS: f64 = 6.0;

/// What may be left to gain, of all, at the end of a run: a position error of about 1e-5.
const CLOSE: f64 = 1e-10;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LinearSolver, NewtonSettings, ProjectionRule};

    fn settings() -> AutoSettings {
        let newton = NewtonSettings {
            name: "newton".to_string(),
            solver: LinearSolver::Factor,
            projection: ProjectionRule::OnDemand { back_off: 2, blended: false },
            warp: true,
            max_inner: 10,
            memory: 1e9,
            proximal: 0.0,
            shift: 0.0,
            guarded: false,
            longest: 1.0,
        };
        AutoSettings { newton, eager: false, patience: 3, gain: 0.1, window: 2, longest: 50, retreat: 4 }
    }

    #[test]
    fn newton_follows_where_the_splitting_gains_little_for_its_price() {
        let energies = [100.0, 50.0, 30.0, 20.0, 15.0, 13.4, 12.0, 11.5];
        let first = |price: f64| {
            let mut gains = Gains::default();
            energies.iter().position(|e| gains.are_small(*e, price, &settings()))
        };
        // (15 - 12)/2 = 1.5 <= 0.1/5 88 = 1.76, and not yet (20 - 13.4)/2 = 3.3.
        assert_eq!(first(5.0), Some(6));
        assert_eq!(first(1.0), Some(4)); // (30 - 15)/2 = 7.5 <= 8.5
        assert_eq!(first(100.0), None);
        // Gains that shrink to a tenth each time need no Newton.
        let mut gains = Gains::default();
        assert!(!(0..12).any(|k| gains.are_small(0.1_f64.powi(k), 2.0, &settings())));
        // A rise says nothing, nor does anything above the start.
        let mut gains = Gains::default();
        assert!(![10.0, 8.0, 9.0, 8.9, 12.0, 11.9, 11.8].iter().any(|e| gains.are_small(*e, 1.0, &settings())));
    }
}
