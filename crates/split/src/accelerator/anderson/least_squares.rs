//! The small least-squares problem of Anderson acceleration, from its normal equations.

/// Eigenvalues of the Gram matrix of unit columns below this part of the largest are rounding: products of long columns
/// carry errors of a few 1e-16 times the root of their length.
const RANK: f64 = 1e-13;

/// Sweeps of Jacobi's method; it converges quadratically, and 6 to 10 are usual.
const SWEEPS: usize = 30;

/// min |f - sum_i theta_i c_i| for unit columns c_i, given by their Gram matrix and the products c_i . f: the solution of
/// least norm of the equations restricted to the eigenvectors that are no rounding.
pub(super) struct LeastSquares {
    window: usize,
    gram: Vec<f64>,  // window x window
    right: Vec<f64>, // c_i . f
    work: Vec<f64>,  // the matrix that is turned into a diagonal
    vectors: Vec<f64>,
    theta: Vec<f64>,
}

impl LeastSquares {
    pub fn new(window: usize) -> Self {
        let matrix = || vec![0.0; window * window];
        let vector = || vec![0.0; window];
        LeastSquares { window, gram: matrix(), right: vector(), work: matrix(), vectors: matrix(), theta: vector() }
    }

    /// c_i . c_j
    pub fn set(&mut self, i: usize, j: usize, product: f64) {
        self.gram[i * self.window + j] = product;
        self.gram[j * self.window + i] = product;
    }

    /// c_i . f
    pub fn set_right(&mut self, i: usize, product: f64) {
        self.right[i] = product;
    }

    /// theta over the first n columns, and their rank.
    pub fn solve(&mut self, n: usize) -> (&[f64], usize) {
        let m = self.window;
        self.work.copy_from_slice(&self.gram);
        self.theta[..n].fill(0.0);
        eigen(&mut self.work, &mut self.vectors, m, n);
        let mut rank = 0;
        let largest = (0..n).map(|k| self.work[k * m + k]).fold(0.0, f64::max);
        for k in 0..n {
            let value = self.work[k * m + k];
            if value > RANK * largest {
                rank += 1;
                let product: f64 = (0..n).map(|i| self.vectors[i * m + k] * self.right[i]).sum();
                for i in 0..n {
                    self.theta[i] += self.vectors[i * m + k] * product / value;
                }
            } else if value.is_nan() {
                self.theta[..n].fill(f64::NAN);
            }
        }
        (&self.theta[..n], rank)
    }
}

/// The eigenvalues of the leading n x n block of the symmetric `a`, left on its diagonal, and its eigenvectors in the
/// columns of `v`: Jacobi's cyclic method (Golub and Van Loan, section 8.5). Rows have m entries.
fn eigen(a: &mut [f64], v: &mut [f64], m: usize, n: usize) {
    for i in 0..n {
        for j in 0..n {
            v[i * m + j] = f64::from(u8::from(i == j));
        }
    }
    for _ in 0..SWEEPS {
        let mut turned = false;
        for p in 0..n {
            for q in p + 1..n {
                let off = a[p * m + q];
                let size = (a[p * m + p] * a[q * m + q]).abs().sqrt();
                // A NaN is left alone, and found on the diagonal.
                if off.is_nan() || off.abs() <= (f64::EPSILON * size).max(f64::MIN_POSITIVE) {
                    continue;
                }
                turned = true;
                // The smaller root t of t^2 + 2 theta t - 1, so that the rotation is by at most 45 degrees.
                let theta = (a[q * m + q] - a[p * m + p]) / (2.0 * off);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a[k * m + p], a[k * m + q]);
                    a[k * m + p] = c * x - s * y;
                    a[k * m + q] = s * x + c * y;
                }
                for k in 0..n {
                    let (x, y) = (a[p * m + k], a[q * m + k]);
                    a[p * m + k] = c * x - s * y;
                    a[q * m + k] = s * x + c * y;
                    let (x, y) = (v[k * m + p], v[k * m + q]);
                    v[k * m + p] = c * x - s * y;
                    v[k * m + q] = s * x + c * y;
                }
            }
        }
        if !turned {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependent_columns_share_the_solution_of_least_norm() {
        // Columns e1, e1, e2 and f = (2, 3): theta = (1, 1, 3).
        let mut problem = LeastSquares::new(4);
        for (i, j, product) in [(0, 0, 1.0), (0, 1, 1.0), (1, 1, 1.0), (0, 2, 0.0), (1, 2, 0.0), (2, 2, 1.0)] {
            problem.set(i, j, product);
        }
        for (i, product) in [2.0, 2.0, 3.0].into_iter().enumerate() {
            problem.set_right(i, product);
        }
        let (theta, rank) = problem.solve(3);
        assert_eq!(rank, 2);
        for (theta, wanted) in theta.iter().zip([1.0, 1.0, 3.0]) {
            assert!((theta - wanted).abs() < 1e-14, "{theta} for {wanted}");
        }
    }

    #[test]
    fn a_number_that_is_none_is_not_hidden() {
        let mut problem = LeastSquares::new(2);
        problem.set(0, 0, f64::NAN);
        problem.set_right(0, 1.0);
        assert!(problem.solve(1).0[0].is_nan());
    }
}
