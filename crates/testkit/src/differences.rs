//! Derivatives by finite differences with an estimate of their error, and checks of derivatives against them.

use std::fmt;

/// A number and how far off it may be.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// An estimate of its error, truncation and rounding together.
    pub error: f64,
}

/// f'(x) by central differences with steps h, h/1.4, h/1.4^2, .. extrapolated to h = 0 (Ridders 1982).
pub fn derivative(f: impl Fn(f64) -> f64, x: f64, h: f64) -> Estimate {
    const STEPS: usize = 12;
    const RATIO: f64 = 1.4;
    let mut best = Estimate { value: f64::NAN, error: f64::INFINITY };
    let mut previous: Vec<f64> = Vec::new();
    let mut h = h;
    for row in 0..STEPS {
        let mut current = vec![(f(x + h) - f(x - h)) / (2.0 * h)];
        let mut factor = RATIO * RATIO;
        for n in 0..row {
            current.push((current[n] * factor - previous[n]) / (factor - 1.0));
            factor *= RATIO * RATIO;
            let error = (current[n + 1] - current[n]).abs().max((current[n + 1] - previous[n]).abs());
            if error <= best.error {
                best = Estimate { value: current[n + 1], error };
            }
        }
        previous = current;
        h /= RATIO;
    }
    best
}

/// All partial derivatives of f at x; the first step is `h`.
pub fn gradient(f: impl Fn(&[f64]) -> f64, x: &[f64], h: f64) -> Vec<Estimate> {
    (0..x.len())
        .map(|i| {
            let along = |t: f64| {
                let mut y = x.to_vec();
                y[i] = t;
                f(&y)
            };
            derivative(along, x[i], h)
        })
        .collect()
}

/// Where a derivative differs from its finite differences.
#[derive(Clone, Debug)]
pub struct Mismatch {
    /// Index of the component (row by row in a matrix).
    pub component: usize,
    /// The derivative that was checked.
    pub given: f64,
    /// What the finite differences say.
    pub found: Estimate,
    /// The difference that was allowed.
    pub allowed: f64,
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Mismatch { component, given, found, allowed } = self;
        write!(
            f,
            "component {component}: {given} given, finite differences say {} +- {:.1e}, they differ by {:.1e}, {allowed:.1e} is allowed",
            found.value,
            found.error,
            (given - found.value).abs()
        )
    }
}

impl std::error::Error for Mismatch {}

fn compare(given: &[f64], found: &[Estimate], tolerance: f64) -> Result<f64, Mismatch> {
    let scale = given.iter().chain(found.iter().map(|e| &e.value)).fold(1e-300_f64, |m, g| m.max(g.abs()));
    let allowed = tolerance * scale;
    let mut worst = 0.0_f64;
    for (component, (&given, &found)) in given.iter().zip(found).enumerate() {
        let difference = (given - found.value).abs();
        // Finite differences that do not converge prove nothing: they count as a mismatch too. NaN is one.
        if !(difference <= allowed && found.error <= allowed) {
            return Err(Mismatch { component, given, found, allowed });
        }
        worst = worst.max(difference / scale);
    }
    Ok(worst)
}

/// Checks the gradient `g` of f at x: the largest difference relative to the largest component, at most `tolerance`.
///
/// # Errors
/// The first component that differs by more, or whose finite differences are less certain than that.
pub fn check_gradient(
    f: impl Fn(&[f64]) -> f64,
    g: &[f64],
    x: &[f64],
    h: f64,
    tolerance: f64,
) -> Result<f64, Mismatch> {
    compare(g, &gradient(f, x, h), tolerance)
}

/// Checks the Hessian `hessian` (row by row) of the function whose gradient is g, as [`check_gradient`].
///
/// # Errors
/// As for [`check_gradient`].
pub fn check_hessian(
    g: impl Fn(&[f64]) -> Vec<f64>,
    hessian: &[f64],
    x: &[f64],
    h: f64,
    tolerance: f64,
) -> Result<f64, Mismatch> {
    let found: Vec<Estimate> = (0..x.len()).flat_map(|i| gradient(|y| g(y)[i], x, h)).collect();
    compare(hessian, &found, tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn f(x: &[f64]) -> f64 {
        (x[0] * x[1]).sin() + x[1].exp()
    }

    fn g(x: &[f64]) -> Vec<f64> {
        let c = (x[0] * x[1]).cos();
        vec![x[1] * c, x[0] * c + x[1].exp()]
    }

    #[test]
    fn true_derivatives_pass_far_below_rounding_of_plain_differences() {
        let x = [0.7, -1.3];
        let worst = check_gradient(f, &g(&x), &x, 0.1, 1e-10).unwrap();
        assert!(worst < 1e-11, "{worst}");
        let (c, s) = ((x[0] * x[1]).cos(), (x[0] * x[1]).sin());
        let h = [-x[1] * x[1] * s, c - x[0] * x[1] * s, c - x[0] * x[1] * s, -x[0] * x[0] * s + x[1].exp()];
        check_hessian(g, &h, &x, 0.1, 1e-10).unwrap();
    }

    #[test]
    fn wrong_derivatives_are_found_and_told() {
        let x = [0.7, -1.3];
        let mut wrong = g(&x);
        wrong[1] *= 1.0 + 1e-7;
        let told = check_gradient(f, &wrong, &x, 0.1, 1e-9).unwrap_err();
        assert_eq!(told.component, 1);
        assert!(told.to_string().starts_with("component 1: "));
        wrong[1] = f64::NAN;
        assert!(check_gradient(f, &wrong, &x, 0.1, 1e-9).is_err());
    }

    #[test]
    fn a_kink_is_uncertain() {
        let e = derivative(f64::abs, 0.01, 0.1);
        assert!((e.value - 1.0).abs() < 1e-9 || e.error > 1e-3, "{e:?}");
        assert!(check_gradient(|x| x[0].abs(), &[1.0], &[1e-9], 0.1, 1e-6).is_err());
    }
}
