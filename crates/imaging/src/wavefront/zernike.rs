//! Zernike polynomials.

use super::Plane;
use crate::ImageError;

/// The most coefficients: radial degree up to 10.
pub const MOST_COEFFICIENTS: usize = 66;

/// Radial degree n and azimuthal frequency m (negative: sine) of number j >= 1 in Noll's order (Noll 1976).
pub fn noll(j: usize) -> (usize, isize) {
    let mut n = 0;
    while (n + 1) * (n + 2) / 2 < j.max(1) {
        n += 1;
    }
    let k = j.max(1) - n * (n + 1) / 2 - 1; // place within the degree
    let m = if n % 2 == 0 { 2 * k.div_ceil(2) } else { 2 * (k / 2) + 1 };
    (n, if j % 2 == 0 { m as isize } else { -(m as isize) })
}

/// A polynomial of the disk, ready to be evaluated: root mean square 1.
struct Polynomial {
    m: isize,
    radial: Vec<f64>, // of rho^|m|, rho^(|m| + 2), ...
}

impl Polynomial {
    /// R(rho) = sum over s of (-1)^s (n - s)! / (s! ((n + m)/2 - s)! ((n - m)/2 - s)!) rho^(n - 2s), by Noll's number.
    fn new(j: usize) -> Self {
        let (n, m) = noll(j);
        let k = m.unsigned_abs();
        let factorial = |k: usize| (1..=k).map(|k| k as f64).product::<f64>();
        let size = ((n + 1) as f64 * if k == 0 { 1.0 } else { 2.0 }).sqrt();
        let term = |s: usize| {
            let sign = if s.is_multiple_of(2) { size } else { -size };
            sign * factorial(n - s) / (factorial(s) * factorial((n + k) / 2 - s) * factorial((n - k) / 2 - s))
        };
        Polynomial { m, radial: (0..=(n - k) / 2).rev().map(term).collect() }
    }

    fn at(&self, rho: f64, angle: f64) -> f64 {
        let k = self.m.unsigned_abs();
        let radial = self.radial.iter().rev().fold(0.0, |sum, c| sum * rho * rho + c) * rho.powi(k as i32);
        radial * if self.m >= 0 { (k as f64 * angle).cos() } else { (k as f64 * angle).sin() }
    }
}

/// Number j of Noll's order on the unit disk, of root mean square 1 there.
pub fn zernike(j: usize, x: f64, y: f64) -> f64 {
    Polynomial::new(j).at(x.hypot(y), y.atan2(x))
}

/// Coefficients 1 to `count` in Noll's order of a wavefront over the largest disk in its middle, by least squares over the
/// pixels of the disk, in the units of the wavefront; x goes along the row, y down.
///
/// # Errors
/// No coefficients, more than [`MOST_COEFFICIENTS`], or more than the disk has pixels for.
pub fn coefficients(phi: &Plane, count: usize) -> Result<Vec<f64>, ImageError> {
    if count == 0 || count > MOST_COEFFICIENTS {
        return Err(ImageError(format!("{count} Zernike coefficients; ask for 1 to {MOST_COEFFICIENTS}")));
    }
    let radius = 0.5 * phi.width.min(phi.height) as f64;
    let centre = [0.5 * (phi.height as f64 - 1.0), 0.5 * (phi.width as f64 - 1.0)];
    let mut normal = vec![vec![0.0; count + 1]; count];
    let polynomials: Vec<Polynomial> = (1..=count).map(Polynomial::new).collect();
    let mut basis = vec![0.0; count];
    for i in 0..phi.height {
        for j in 0..phi.width {
            let (y, x) = ((i as f64 - centre[0]) / radius, (j as f64 - centre[1]) / radius);
            let (rho, angle) = (x.hypot(y), y.atan2(x));
            if rho > 1.0 {
                continue;
            }
            basis.iter_mut().zip(&polynomials).for_each(|(b, p)| *b = p.at(rho, angle));
            for (a, row) in normal.iter_mut().enumerate() {
                (a..count).for_each(|b| row[b] += basis[a] * basis[b]);
                row[count] += basis[a] * phi.values[i * phi.width + j];
            }
        }
    }
    for a in 1..count {
        (0..a).for_each(|b| normal[a][b] = normal[b][a]);
    }
    // Nearly the unit matrix times the number of pixels, so that elimination needs no pivots.
    let pixels = normal[0][0];
    for k in 0..count {
        if !(normal[k][k] > 1e-6 * pixels) {
            return Err(ImageError(format!(
                "a disk of {pixels} pixels does not determine {count} Zernike coefficients"
            )));
        }
        for i in 0..count {
            if i != k {
                let f = normal[i][k] / normal[k][k];
                (k..=count).for_each(|j| normal[i][j] -= f * normal[k][j]);
            }
        }
    }
    Ok((0..count).map(|k| normal[k][count] / normal[k][k]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nolls_order() {
        let want = [(0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (3, -3), (3, 3), (4, 0), (4, 2)];
        for (k, want) in want.iter().enumerate() {
            assert_eq!(noll(k + 1), *want, "{}", k + 1);
        }
        let defocus = zernike(4, 0.3, 0.4);
        assert!((defocus - 3f64.sqrt() * (2.0 * 0.25 - 1.0)).abs() < 1e-14);
        assert!((zernike(8, 0.6, 0.0) - 8f64.sqrt() * (3.0 * 0.216 - 2.0 * 0.6)).abs() < 1e-14);
    }

    #[test]
    fn what_a_wavefront_is_made_of_is_found() {
        let made = [0.5, -1.0, 2.0, 0.25, 0.0, -0.75, 0.1, 0.0, 0.3, -0.2];
        let phi = Plane::from_fn(70, 60, |i, j| {
            let (y, x) = ((i as f64 - 29.5) / 30.0, (j as f64 - 34.5) / 30.0);
            made.iter().enumerate().map(|(k, c)| c * zernike(k + 1, x, y)).sum()
        });
        let found = coefficients(&phi, 15).unwrap();
        for (k, c) in found.iter().enumerate() {
            assert!((c - made.get(k).copied().unwrap_or(0.0)).abs() < 1e-10, "{k}: {c}");
        }
        assert!(coefficients(&phi, 0).is_err() && coefficients(&phi, 500).is_err());
        let tiny = Plane::from_fn(3, 3, |_, _| 1.0);
        assert!(coefficients(&tiny, 30).unwrap_err().0.contains("does not determine"));
    }
}
