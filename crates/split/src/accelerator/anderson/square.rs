//! The small square system of type-I Anderson acceleration.

/// Pivots below this part of the first are rounding.
const RANK: f64 = 1e-10;

/// M theta = r by Gaussian elimination with complete pivoting, which shows the rank: where pivots are rounding, the
/// coefficients that they would decide on are 0.
pub(super) struct Square {
    window: usize,
    matrix: Vec<f64>, // window x window, row by row
    right: Vec<f64>,
    work: Vec<f64>,
    rest: Vec<f64>,    // right-hand side under elimination
    order: Vec<usize>, // unknown of each column of `work`
    theta: Vec<f64>,
}

impl Square {
    pub fn new(window: usize) -> Self {
        let vector = || vec![0.0; window];
        let matrix = || vec![0.0; window * window];
        Square {
            window,
            matrix: matrix(),
            right: vector(),
            work: matrix(),
            rest: vector(),
            order: vec![0; window],
            theta: vector(),
        }
    }

    /// Entry (i, j).
    pub fn set(&mut self, i: usize, j: usize, entry: f64) {
        self.matrix[i * self.window + j] = entry;
    }

    /// Entry i of the right-hand side.
    pub fn set_right(&mut self, i: usize, entry: f64) {
        self.right[i] = entry;
    }

    /// theta over the first n unknowns, and the rank.
    pub fn solve(&mut self, n: usize) -> (&[f64], usize) {
        let m = self.window;
        self.work.copy_from_slice(&self.matrix);
        self.rest.copy_from_slice(&self.right);
        self.theta[..n].fill(0.0);
        (0..n).for_each(|i| self.order[i] = i);
        let (mut first, mut rank) = (0.0, 0);
        for k in 0..n {
            let (mut row, mut column, mut largest) = (k, k, -1.0);
            for i in k..n {
                for j in k..n {
                    let size = self.work[i * m + j].abs();
                    // A NaN becomes the pivot, and is seen in theta.
                    if size > largest || size.is_nan() {
                        (row, column, largest) = (i, j, size);
                    }
                }
            }
            if k == 0 {
                first = largest;
            }
            if largest <= RANK * first {
                break;
            }
            rank += 1;
            for j in 0..n {
                self.work.swap(k * m + j, row * m + j);
            }
            self.rest.swap(k, row);
            for i in 0..n {
                self.work.swap(i * m + k, i * m + column);
            }
            self.order.swap(k, column);
            for i in k + 1..n {
                let factor = self.work[i * m + k] / self.work[k * m + k];
                for j in k..n {
                    self.work[i * m + j] -= factor * self.work[k * m + j];
                }
                self.rest[i] -= factor * self.rest[k];
            }
        }
        for k in (0..rank).rev() {
            let known: f64 = (k + 1..rank).map(|j| self.work[k * m + j] * self.theta[self.order[j]]).sum();
            self.theta[self.order[k]] = (self.rest[k] - known) / self.work[k * m + k];
        }
        (&self.theta[..n], rank)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_system_is_solved_and_a_singular_one_gets_zeros() {
        let rows = [[1e-3, 2.0, 1.0], [4.0, -1.0, 0.5], [0.0, 3.0, 7.0]];
        let wanted = [1.0, -2.0, 0.25];
        let mut square = Square::new(5);
        for (i, row) in rows.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                square.set(i, j, *entry);
            }
            square.set_right(i, row.iter().zip(&wanted).map(|(a, b)| a * b).sum());
        }
        let (theta, rank) = square.solve(3);
        assert!(rank == 3 && theta.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-14), "{theta:?}");
        // The last row becomes the sum of the others.
        for j in 0..3 {
            square.set(2, j, rows[0][j] + rows[1][j]);
        }
        square.set_right(2, (0..2).map(|i| (0..3).map(|j| rows[i][j] * wanted[j]).sum::<f64>()).sum());
        let (theta, rank) = square.solve(3);
        assert_eq!((rank, theta.iter().filter(|t| **t == 0.0).count()), (2, 1));
        for row in &rows[..2] {
            let gap: f64 = (0..3).map(|j| row[j] * (theta[j] - wanted[j])).sum();
            assert!(gap.abs() < 1e-13, "{gap}");
        }
        square.set(0, 0, f64::NAN);
        assert!(square.solve(3).0.iter().any(|t| t.is_nan()));
    }
}
