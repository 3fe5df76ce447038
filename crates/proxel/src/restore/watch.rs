//! What looks at a run.

use super::Hooks;
use crate::report::TraceRow;
use proxel_imaging::Image;
use proxel_imaging::restore::{Certifier, Field, Gap, psnr};
use proxel_split::{Method, Observer, Status, StepReport, Stop, Verdict};
use std::time::{Duration, Instant};

/// Converged when the duality gap is at most `tol` times the objective.
pub(super) struct GapTolerance<'a> {
    tol: f64,
    field: &'a Field,
    certifier: Certifier,
    limit: usize, // the last iteration, which is looked at in any case
    next: usize,
    forecast: Forecast,
    rounding: f64,              // a gap of this size is one
    last: Option<(usize, Gap)>, // of an iteration
}

/// Part of the objective at the start, an image of zeros, below which a gap is rounding: the objective of an image of one
/// value is 0.
const ROUNDING: f64 = 1e-11;

/// The gap is looked at after so many iterations, and then no more often: it costs as much as eight of them.
const EVERY: usize = 8;

/// The iteration of the first look. Gaps of 1e-1, 1e-2, 1e-3, 1e-4 were reached after 4 to 10, 11 to 17, 27 to 35, 93 to 99
/// (camera, noisy, blurred and not), about 4.5 over the cube root: this is half of that.
fn first_look(tol: f64) -> usize {
    ((2.0 / tol.cbrt()) as usize).clamp(EVERY, 100)
}

/// When to look again: at a part of the way to where the gap would be small enough, if it went on falling as a power of the
/// number of iterations.
#[derive(Clone, Copy, Debug)]
struct Forecast {
    last: Option<(usize, f64)>, // iteration, gap
}

impl Forecast {
    /// The next iteration to look at, from the gap of this one and what it should be.
    fn next(&mut self, iteration: usize, gap: f64, wanted: f64) -> usize {
        /// Of the way: near the end it is found in steps of [`EVERY`].
        const PART: f64 = 0.7;
        /// The power before anything is known, that of the figures beside [`first_look`].
        const USUAL: f64 = 3.0;
        let before = self.last.replace((iteration, gap));
        let order = before.map(|(k, g)| (g / gap).ln() / (iteration as f64 / k.max(1) as f64).ln());
        let ahead = |order: f64| PART * iteration as f64 * ((gap / wanted).powf(1.0 / order) - 1.0);
        let far = match order {
            None => ahead(USUAL),
            Some(order) if order > 0.0 => ahead(order),
            // It does not fall.
            Some(_) => 0.0,
        };
        // Never far beyond the iterations so far: what falls slowly may fall faster soon.
        let most = (iteration / 2).max(EVERY);
        iteration + if far >= most as f64 { most } else { (far.max(0.0) as usize).clamp(EVERY, most) }
    }
}

impl<'a> GapTolerance<'a> {
    pub(super) fn new(tol: f64, limit: usize, field: &'a Field) -> Self {
        GapTolerance {
            tol,
            limit,
            field,
            certifier: Certifier::default(),
            next: first_look(tol),
            forecast: Forecast { last: None },
            rounding: 0.0,
            last: None,
        }
    }

    /// The gap after so many iterations, which are the last.
    pub(super) fn at(&mut self, iteration: usize, method: &mut dyn Method) -> Option<Gap> {
        let known = self.last.filter(|(k, _)| *k == iteration).map(|(_, gap)| gap);
        known.or_else(|| self.certifier.gap(method, self.field))
    }
}

impl Stop for GapTolerance<'_> {
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        if report.iteration == 0 {
            // Before the first step forces are no subgradients, and there is no bound.
            self.rounding = ROUNDING * method.energy().value;
            return None;
        }
        if report.iteration < self.next && report.iteration != self.limit {
            return None;
        }
        let Some(gap) = self.certifier.gap(method, self.field) else {
            self.next = report.iteration + EVERY;
            return None;
        };
        self.last = Some((report.iteration, gap));
        self.next = self.forecast.next(report.iteration, gap.relative(), self.tol);
        let images = match gap.range {
            Some([low, high]) => format!("images with values from {low:.3} to {high:.3}"),
            None => "over all images".to_string(),
        };
        let reason = if gap.relative() <= self.tol {
            format!("the duality gap is {:.2e} of the objective, at most {:e} ({images})", gap.relative(), self.tol)
        } else if gap.gap <= self.rounding {
            format!(
                "the duality gap is {:.2e}, which is rounding: at most {ROUNDING:e} of the objective of an image of zeros \
                 ({images})",
                gap.gap
            )
        } else {
            return None;
        };
        Some(Verdict { status: Status::Converged, reason })
    }
}

/// A row of the trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestoreRow {
    /// What every trace has.
    pub row: TraceRow,
    /// Which part of the image it is about, from 0; 0 where it was not cut to parts.
    pub part: usize,
    /// How much lower the objective can be at most; infinite where there is no bound.
    pub duality_gap: f64,
    /// In dB against the truth; infinite where there is none.
    pub psnr: f64,
}

impl RestoreRow {
    /// The header of the CSV file.
    pub fn header() -> String {
        format!("{},part,duality_gap,psnr", TraceRow::HEADER)
    }

    /// A line of it.
    pub fn to_csv(&self) -> String {
        let (gap, psnr) = (TraceRow::number(self.duality_gap), TraceRow::number(self.psnr));
        format!("{},{},{gap},{psnr}", self.row.to_csv(), self.part)
    }
}

/// Of what an image was cut to.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    /// From 0.
    pub(super) index: usize,
    /// What is to be found, to measure against.
    pub(super) truth: Option<&'a Image>,
}

/// Feeds the hooks.
pub(super) struct Watcher<'a, 'b> {
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    watching: Duration, // time spent on what only the hooks need
    field: &'a Field,
    certifier: Certifier,
    part: Part<'a>,
}

impl<'a, 'b> Watcher<'a, 'b> {
    pub(super) fn new(hooks: &'a mut Hooks<'b>, began: Instant, field: &'a Field, part: Part<'a>) -> Self {
        Watcher { hooks, began, watching: Duration::ZERO, field, certifier: Certifier::default(), part }
    }
}

impl Observer for Watcher<'_, '_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        if let Some(progress) = self.hooks.progress.as_deref_mut() {
            progress(report.iteration, method.energy().value);
        }
        if let Some(trace) = self.hooks.trace.as_deref_mut() {
            let (energy, residuals) = (method.energy(), method.residuals());
            let row = TraceRow {
                iteration: report.iteration,
                seconds,
                energy: energy.value,
                // Total variation has no gradient where the image is flat.
                gradient_norm: f64::INFINITY,
                position_error: f64::INFINITY,
                primal_residual: residuals.primal,
                dual_residual: residuals.dual,
                merit: report.merit.unwrap_or(f64::INFINITY),
                inner: report.inner,
                refactorised: report.refactorised,
                accepted: report.took_proposal(),
                inverted: 0,
            };
            // Before the first step forces are no subgradients, and there is no bound.
            let bound = (report.iteration > 0).then(|| self.certifier.gap(method, self.field)).flatten();
            let gap = bound.map_or(f64::INFINITY, |gap| gap.gap);
            let psnr = self.part.truth.map_or(f64::INFINITY, |t| psnr(&self.field.image(method.x()), &t.channels));
            trace(&RestoreRow { row, part: self.part.index, duality_gap: gap, psnr });
        }
        self.watching += now.elapsed();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaps c k^-s are found small enough after few looks, and little later than they are.
    #[test]
    fn a_power_law_is_followed() {
        for (c, s) in [(1.0, 1.0), (30.0, 2.0), (1e4, 3.5), (0.5, 0.5)] {
            let gap = |k: usize| c * (k as f64).powf(-s);
            let wanted = gap(1000);
            let (mut forecast, mut k, mut looks) = (Forecast { last: None }, EVERY, 1);
            while gap(k) > wanted {
                k = forecast.next(k, gap(k), wanted);
                looks += 1;
            }
            assert!((1000..=1010).contains(&k) && looks < 25, "{c} k^-{s}: {k} after {looks}");
        }
    }

    #[test]
    fn what_does_not_fall_is_looked_at_in_small_steps() {
        let mut forecast = Forecast { last: None };
        // Nothing is known: as the cube.
        assert_eq!(forecast.next(10, 1.0, 0.1), 18);
        assert_eq!(forecast.next(15, 1.5, 0.1), 15 + EVERY);
        assert_eq!(forecast.next(20, f64::NAN, 0.1), 20 + EVERY);
        assert_eq!(forecast.next(25, 1.0, 0.1), 25 + EVERY);
    }
}
