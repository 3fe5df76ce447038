//! The first root of a cubic on an interval.

/// Bisections of an interval that holds one root: to the last bit of t.
const BISECTIONS: usize = 60;

/// The first t in (0, reach] at which c0 + c1 t + c2 t^2 + c3 t^3, positive at 0, is not positive any more, or a number
/// slightly below it; infinity where there is none; 0 where it is not positive at 0.
pub(super) fn first_root(c: [f64; 4], reach: f64) -> f64 {
    if c[0].is_nan() || c[0] <= 0.0 {
        return 0.0;
    }
    // Bernstein coefficients on [0, reach]: where all are positive, so is the cubic.
    let (a, b, d) = (c[1] * reach, c[2] * reach * reach, c[3] * reach * reach * reach);
    if c[0] + a / 3.0 > 0.0 && c[0] + (2.0 * a + b) / 3.0 > 0.0 && c[0] + a + b + d > 0.0 {
        return f64::INFINITY;
    }
    let value = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
    // Between the roots of the derivative the cubic is monotone.
    let mut low = 0.0;
    for high in extrema(c).into_iter().filter(|t| *t > 0.0 && *t < reach).chain([reach]) {
        let at_high = value(high);
        if at_high.is_nan() || at_high <= 0.0 {
            let (mut low, mut high) = (low, high);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                if value(middle) > 0.0 { low = middle } else { high = middle }
            }
            return low;
        }
        low = high;
    }
    f64::INFINITY
}

/// The roots of c1 + 2 c2 t + 3 c3 t^2 in ascending order; where there are fewer than two, NaN in their place.
fn extrema(c: [f64; 4]) -> [f64; 2] {
    let (a, b, c) = (3.0 * c[3], c[2], c[1]); // a t^2 + 2 b t + c
    let root = (b * b - a * c).sqrt(); // NaN where there is none
    let q = -(b + root.copysign(b));
    let (r, s) = (q / a, c / q);
    if r <= s { [r, s] } else { [s, r] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first point of a fine grid at which the cubic is not positive.
    fn scanned(c: [f64; 4], reach: f64) -> f64 {
        let n = 200_000;
        (1..=n)
            .map(|i| reach * f64::from(i) / f64::from(n))
            .find(|t| c[0] + t * (c[1] + t * (c[2] + t * c[3])) <= 0.0)
            .unwrap_or(f64::INFINITY)
    }

    #[test]
    fn roots_are_those_of_a_scan() {
        let cases = [
            [1.0, -1.0, 0.0, 0.0],
            [1.0, 0.0, -1.0, 0.0],
            [1.0, 0.0, 0.0, -1.0],
            [1.0, 1.0, 1.0, 1.0],
            [1.0, -2.1, 1.0, 0.0],
            [1.0, -1.9, 1.0, 0.0],
            [6.0, -11.0, 6.0, -1.0], // roots 1, 2, 3
            [0.5, -3.0, 4.0, -1.0],
            [1.0, -0.4, -0.4, 0.1],
            [2.0, 0.0, -3.0, 1.1],
        ];
        for c in cases {
            let (found, wanted) = (first_root(c, 2.0), scanned(c, 2.0));
            let same = found == wanted || (found - wanted).abs() < 2e-5;
            assert!(same, "{c:?}: {found} for {wanted}");
        }
    }

    #[test]
    fn no_volume_leaves_no_step() {
        assert_eq!(first_root([0.0, 1.0, 0.0, 0.0], 2.0), 0.0);
        assert_eq!(first_root([f64::NAN, 1.0, 0.0, 0.0], 2.0), 0.0);
    }
}
