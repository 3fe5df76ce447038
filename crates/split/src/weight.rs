//! The penalty of a term whose elements all have the same one.

/// w^2 as it is, as it was built, and as it may become.
#[derive(Clone, Copy, Debug)]
pub struct Weight {
    /// As it is.
    pub squared: f64,
    base: f64,
    candidate: f64,
}

impl Weight {
    /// With this w^2 to begin with.
    pub fn new(squared: f64) -> Self {
        Weight { squared, base: squared, candidate: squared }
    }

    /// As [`crate::Term::propose_weights`]: the weight stays unless the range forbids it.
    pub fn propose(&mut self, range: (f64, f64)) -> f64 {
        self.candidate = self.squared.clamp(range.0 * self.base, range.1 * self.base);
        (self.candidate / self.squared).max(self.squared / self.candidate)
    }

    /// As [`crate::Term::take_weights`]: z and the forces w^2 u stay.
    pub fn take(&mut self, p: &mut [f64], u: &mut [f64]) {
        let ratio = self.squared / self.candidate;
        if ratio == 1.0 {
            return; // to the bit
        }
        for (p, u) in p.iter_mut().zip(u) {
            let z = *p + *u;
            *u *= ratio;
            *p = z - *u;
        }
        self.squared = self.candidate;
    }
}
