//! Axes with 1-2-5 ticks, linear or logarithmic.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// A linear or logarithmic axis from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    low: f64,
    high: f64,
    log: bool,
}

impl Axis {
    /// A linear axis.
    pub fn linear(low: f64, high: f64) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Axis { low, high, log: false }
    }

    /// A logarithmic axis; bounds that are not positive are moved.
    pub fn log(low: f64, high: f64) -> Self {
        let low = if low > 0.0 && low.is_finite() { low } else { 1e-12 };
        let high = if high > low && high.is_finite() { high } else { 10.0 * low };
        Axis { low, high, log: true }
    }

    /// A logarithmic axis over all positive values, with a little room.
    pub fn log_around(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = values
            .into_iter()
            .filter(|v| *v > 0.0 && v.is_finite())
            .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        if low.is_finite() { Axis::log(low / 1.15, high * 1.15) } else { Axis::log(0.1, 10.0) }
    }

    /// Where a value lies, 0 at `low` and 1 at `high`.
    pub fn place(&self, v: f64) -> f64 {
        let ends = if self.log {
            (self.low.ln(), self.high.ln(), v.max(f64::MIN_POSITIVE).ln())
        } else {
            (self.low, self.high, v)
        };
        (ends.2 - ends.0) / (ends.1 - ends.0)
    }

    /// At most about `count` round values: powers of ten, with 2 and 5 between them where there is room.
    fn ticks(&self, count: usize) -> Vec<f64> {
        let count = count.max(2);
        if !self.log {
            let step = round_up((self.high - self.low) / count as f64);
            let first = (self.low / step - 1e-9).ceil() as i64;
            let last = (self.high / step + 1e-9).floor() as i64;
            return (first..=last).map(|k| k as f64 * step).collect();
        }
        let decades = (self.high / self.low).log10();
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let between: &[f64] = match count as f64 / decades.max(1e-9) {
            room if room >= 9.0 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
            room if room >= 3.0 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let stride = if between.len() == 1 { (decades / count as f64).ceil().max(1.0) as usize } else { 1 };
        let inside = |v: &f64| *v >= self.low * (1.0 - 1e-9) && *v <= self.high * (1.0 + 1e-9);
        let ticks = (first..=last).filter(|k| k.rem_euclid(stride as i32) == 0);
        ticks.flat_map(|k| between.iter().map(move |b| b * 10f64.powi(k))).filter(inside).collect()
    }
}

/// The least of 1, 2, 5 times a power of ten that is no less than v.
fn round_up(v: f64) -> f64 {
    let power = 10f64.powf(v.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|m| m * power).find(|r| *r >= v * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

impl Ranged for Axis {
    type ValueType = f64;
    type FormatOption = NoDefaultFormatting;

    fn map(&self, v: &f64, (from, to): (i32, i32)) -> i32 {
        from + (self.place(*v) * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Light lines are not wanted: only what is labelled is drawn.
        self.ticks(hint.max_num_points().min(9))
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, v: &f64) -> String {
        match v.abs() {
            0.0 => "0".to_string(),
            a if (1e-3..1e5).contains(&a) => format!("{}", (v * 1e6).round() / 1e6),
            _ => format!("{v:.0e}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(Axis::log(0.9e-4, 1.2).ticks(9), [1e-4, 1e-3, 1e-2, 1e-1, 1.0].map(|v| v));
        assert_eq!(Axis::log(0.4, 6.0).ticks(9), [0.5, 1.0, 2.0, 5.0]);
        assert_eq!(Axis::log(1e-12, 1.0).ticks(6).len(), 7);
        let linear = Axis::linear(0.0, 1.0).ticks(5);
        assert_eq!(linear.len(), 6);
        assert!((linear[1] - 0.2).abs() < 1e-15);
    }

    #[test]
    fn labels() {
        let axis = Axis::log(1e-6, 1e6);
        assert_eq!(
            [1e-4, 1e-3, 0.2, 1.0, 1e4, 1e5].map(|v| axis.format_ext(&v)),
            ["1e-4", "0.001", "0.2", "1", "10000", "1e5"]
        );
    }

    #[test]
    fn places() {
        assert!((Axis::log(1e-2, 1e2).place(1.0) - 0.5).abs() < 1e-15);
        assert!((Axis::linear(-1.0, 3.0).place(0.0) - 0.25).abs() < 1e-15);
    }
}
