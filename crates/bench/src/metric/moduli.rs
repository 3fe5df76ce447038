//! The metric of an element, and where its two numbers come from.

use proxel::model::energy::Energy;

/// A symmetric matrix, as rows.
pub(super) type Matrix = [[f64; 3]; 3];

/// Moduli of a metric of symmetric matrices that turns with them: stress over strain of a change of shape, and of one of
/// size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moduli {
    /// d, for the part without trace.
    pub deviatoric: f64,
    /// v, for the multiples of the identity.
    pub volumetric: f64,
}

impl Moduli {
    /// A scalar weight: w^2 over the volume.
    pub fn scalar(k: f64) -> Self {
        Moduli { deviatoric: k, volumetric: k }
    }

    /// The Hessian of psi at stretches s, along (1, 1, 1) and, at most, across it; negative curvatures count as 0.
    pub fn of_hessian(energy: &impl Energy<3>, s: [f64; 3]) -> Self {
        let h = energy.hessian(s);
        let row = |i: usize| h[i][0] + h[i][1] + h[i][2];
        let volumetric = (row(0) + row(1) + row(2)) / 3.0;
        // Across: (1, -1, 0)/sqrt 2 and (1, 1, -2)/sqrt 6.
        let a = 0.5 * (h[0][0] + h[1][1]) - h[0][1];
        let b = (h[0][0] + h[1][1] + 4.0 * h[2][2] + 2.0 * h[0][1] - 4.0 * h[0][2] - 4.0 * h[1][2]) / 6.0;
        let c = (h[0][0] - h[1][1] - 2.0 * h[0][2] + 2.0 * h[1][2]) / 12f64.sqrt();
        let deviatoric = 0.5 * (a + b) + (0.25 * (a - b).powi(2) + c * c).sqrt();
        Moduli { deviatoric: deviatoric.max(0.0), volumetric: volumetric.max(0.0) }
    }

    /// Both numbers times a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Moduli { deviatoric: factor * self.deviatoric, volumetric: factor * self.volumetric }
    }

    /// Each number within [low, high] times that of `base`.
    #[must_use]
    pub fn clamped(self, base: Self, (low, high): (f64, f64)) -> Self {
        let within = |k: f64, base: f64| k.clamp(low * base, high * base);
        Moduli {
            deviatoric: within(self.deviatoric, base.deviatoric),
            volumetric: within(self.volumetric, base.volumetric),
        }
    }

    /// The larger of the ratios of both numbers, either way round.
    pub fn ratio(self, other: Self) -> f64 {
        let ratio = |a: f64, b: f64| (a / b).max(b / a);
        ratio(self.deviatoric, other.deviatoric).max(ratio(self.volumetric, other.volumetric))
    }

    /// (v - d)/3, the factor of (tr A)^2.
    pub fn of_trace(self) -> f64 {
        (self.volumetric - self.deviatoric) / 3.0
    }

    /// |A|_M^2
    pub fn norm2(self, a: &Matrix) -> f64 {
        let trace = trace(a);
        self.deviatoric * a.iter().flatten().map(|v| v * v).sum::<f64>() + self.of_trace() * trace * trace
    }

    /// B with `to` B = `self` A: scaled duals under other moduli, so that the stress stays.
    pub fn carried_over(self, to: Self, a: &Matrix) -> Matrix {
        let (shape, size) = (self.deviatoric / to.deviatoric, self.volumetric / to.volumetric);
        let mean = trace(a) / 3.0;
        let mut b = a.map(|row| row.map(|v| shape * v));
        for (i, row) in b.iter_mut().enumerate() {
            row[i] += (size - shape) * mean;
        }
        b
    }
}

/// tr A
pub(super) fn trace(a: &Matrix) -> f64 {
    a[0][0] + a[1][1] + a[2][2]
}
