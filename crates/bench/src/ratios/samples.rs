//! Times taken in turns, so that what disturbs one disturbs the others.

use std::time::Instant;

/// Seconds of repetitions of one thing.
#[derive(Clone, Debug, Default)]
pub struct Samples(Vec<f64>);

impl Samples {
    /// Times `f` once.
    pub fn time<T>(&mut self, f: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let out = f();
        self.0.push(began.elapsed().as_secs_f64());
        out
    }

    /// Takes those of another.
    pub fn append(&mut self, mut other: Samples) {
        self.0.append(&mut other.0);
    }

    /// The least; infinite of nothing.
    pub fn least(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The middle; infinite of nothing.
    pub fn median(&self) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::INFINITY)
    }

    /// "least; median" in milliseconds.
    pub fn milliseconds(&self) -> String {
        format!("{:.2}; {:.2} ms", self.least() * 1e3, self.median() * 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::Samples;

    #[test]
    fn least_and_median() {
        let samples = Samples(vec![3.0, 1.0, 2.0]);
        assert_eq!((samples.least(), samples.median()), (1.0, 2.0));
        assert_eq!(Samples::default().median(), f64::INFINITY);
    }
}
