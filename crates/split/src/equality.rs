//! Linear equality constraints, held exactly by every solve.

use crate::vector;

/// Rows sum_i a_i x_i = b over nodes: numbers a_i, vectors b, so that one row constrains every coordinate alike.
///
/// Global steps never leave the rows: [`crate::NormalMatrix::solve`] returns the solution of the system within them, and
/// gradients are measured along them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Equalities {
    rows: Vec<Equality>,
    gram: Vec<f64>, // Cholesky factor of C C^T over the free nodes, row by row
    n_free: usize,
}

/// One row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Equality {
    /// Nodes, each once, and their coefficients a_i.
    pub nodes: Vec<(u32, f64)>,
    /// b, in its first `dim` entries.
    pub value: [f64; 3],
}

/// Rows that do not go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EqualityError {
    /// A row follows from those before it.
    Redundant {
        /// Its number, from 0.
        row: usize,
    },
    /// A row says something else than those before it.
    Contradictory {
        /// Its number, from 0.
        row: usize,
    },
    /// A row has no node, or a coefficient that is not finite.
    Row {
        /// Its number, from 0.
        row: usize,
    },
}

/// A row is dependent where the rows before leave less than this part of it.
const DEPENDENT: f64 = 1e-10;

impl Equalities {
    /// Rows over nodes of which the first `n_free` are free; `x` are positions, `dim` numbers a node, where fixed nodes are
    /// read.
    ///
    /// # Errors
    /// Rows that depend on each other, each by its number.
    pub fn new(mut rows: Vec<Equality>, n_free: usize, x: &[f64], dim: usize) -> Result<Self, EqualityError> {
        let mut sizes = Vec::with_capacity(rows.len()); // what rounding of the right-hand sides is measured against
        for (row, equality) in rows.iter_mut().enumerate() {
            let finite = equality.nodes.iter().all(|(v, a)| a.is_finite() && (*v as usize) < x.len() / dim)
                && equality.value.iter().all(|b| b.is_finite());
            if equality.nodes.is_empty() || !finite {
                return Err(EqualityError::Row { row });
            }
            scale(equality);
            // Fixed nodes go to the right-hand side.
            let mut size = norm3(&equality.value);
            for (v, a) in equality.nodes.iter().filter(|(v, _)| *v as usize >= n_free) {
                for d in 0..dim {
                    equality.value[d] -= a * x[*v as usize * dim + d];
                    size += (a * x[*v as usize * dim + d]).abs();
                }
            }
            sizes.push(size);
            equality.nodes.retain(|(v, a)| (*v as usize) < n_free && *a != 0.0);
            equality.nodes.sort_unstable_by_key(|(v, _)| *v);
        }
        let size = vector::norm(x).max(f64::MIN_POSITIVE);
        let m = rows.len();
        let mut gram = vec![0.0; m * m];
        // C C^T = L L^T row by row: what is left of a row's square is its part that the rows before do not have.
        let mut reduced: Vec<[f64; 3]> = Vec::with_capacity(m); // L^-1 b
        for i in 0..m {
            let whole = product(&rows[i], &rows[i]);
            let mut left = whole;
            let mut b = rows[i].value;
            for j in 0..i {
                let mut sum = product(&rows[i], &rows[j]);
                for k in 0..j {
                    sum -= gram[i * m + k] * gram[j * m + k];
                }
                let l = sum / gram[j * m + j];
                gram[i * m + j] = l;
                left -= l * l;
                for d in 0..dim {
                    b[d] -= l * reduced[j][d];
                }
            }
            if left <= DEPENDENT * whole || left.is_nan() {
                let slack = 1e-9 * whole.sqrt() * size + f64::MIN_POSITIVE;
                let agrees = b[..dim].iter().all(|b| b.abs() <= slack.max(1e-9 * sizes[i]));
                return Err(if agrees {
                    EqualityError::Redundant { row: i }
                } else {
                    EqualityError::Contradictory { row: i }
                });
            }
            gram[i * m + i] = left.sqrt();
            reduced.push(b.map(|b| b / left.sqrt()));
        }
        Ok(Equalities { rows, gram, n_free })
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// The rows over free nodes, fixed ones being part of the right-hand sides.
    pub fn rows(&self) -> &[Equality] {
        &self.rows
    }

    /// Removes from a vector over the free nodes what is normal to the rows: v - C^T (C C^T)^-1 C v.
    pub fn project(&self, v: &mut [f64], dim: usize) {
        self.correct(v, dim, |_| [0.0; 3]);
    }

    /// Moves x to the nearest positions that meet the rows.
    pub fn enforce(&self, x: &mut [f64], dim: usize) {
        self.correct(&mut x[..self.n_free * dim], dim, |row| row.value);
    }

    /// The largest violation |C x - b| of a row over |a| |x| + |b|.
    pub fn violation(&self, x: &[f64], dim: usize) -> f64 {
        let mut worst = 0.0_f64;
        for row in &self.rows {
            let (mut size, mut left) = (norm3(&row.value), row.value.map(|b| -b));
            for (v, a) in &row.nodes {
                for d in 0..dim {
                    let x = x[*v as usize * dim + d];
                    left[d] += a * x;
                    size += (a * x).abs();
                }
            }
            worst = worst.max(norm3(&left) / size.max(f64::MIN_POSITIVE));
        }
        worst
    }

    /// v += C^T (C C^T)^-1 (b - C v)
    fn correct(&self, v: &mut [f64], dim: usize, b: impl Fn(&Equality) -> [f64; 3]) {
        if self.is_empty() {
            return;
        }
        let mut r: Vec<[f64; 3]> = self.rows.iter().map(|row| residual(row, b(row), v, dim)).collect();
        solve_lower(&self.gram, &mut r);
        solve_upper(&self.gram, &mut r);
        for (row, r) in self.rows.iter().zip(&r) {
            for (node, a) in &row.nodes {
                for d in 0..dim {
                    v[*node as usize * dim + d] += a * r[d];
                }
            }
        }
    }
}

/// Brings the largest coefficient of a row to between 1 and 2, by a power of two, so that squares neither overflow nor
/// vanish, and no bit changes.
fn scale(row: &mut Equality) {
    const EXPONENT: u64 = 0x7ff << 52;
    let largest = row.nodes.iter().fold(0.0, |m: f64, (_, a)| m.max(a.abs()));
    let power = f64::from_bits(largest.to_bits() & EXPONENT);
    if power > 0.0 {
        row.nodes.iter_mut().for_each(|(_, a)| *a /= power);
        row.value.iter_mut().for_each(|b| *b /= power);
    }
}

/// b - a . v
fn residual(row: &Equality, b: [f64; 3], v: &[f64], dim: usize) -> [f64; 3] {
    let mut r = b;
    for (node, a) in &row.nodes {
        for d in 0..dim {
            r[d] -= a * v[*node as usize * dim + d];
        }
    }
    r
}

/// a_i . a_j of rows sorted by node.
fn product(a: &Equality, b: &Equality) -> f64 {
    let (mut i, mut j, mut sum) = (0, 0, 0.0);
    while i < a.nodes.len() && j < b.nodes.len() {
        match a.nodes[i].0.cmp(&b.nodes[j].0) {
            std::cmp::Ordering::Less => i += 1,
            std::cmp::Ordering::Greater => j += 1,
            std::cmp::Ordering::Equal => {
                sum += a.nodes[i].1 * b.nodes[j].1;
                i += 1;
                j += 1;
            }
        }
    }
    sum
}

fn norm3(v: &[f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// r <- L^-1 r
fn solve_lower(l: &[f64], r: &mut [[f64; 3]]) {
    let m = r.len();
    for i in 0..m {
        for j in 0..i {
            for d in 0..3 {
                r[i][d] -= l[i * m + j] * r[j][d];
            }
        }
        r[i] = r[i].map(|v| v / l[i * m + i]);
    }
}

/// r <- L^-T r
fn solve_upper(l: &[f64], r: &mut [[f64; 3]]) {
    let m = r.len();
    for i in (0..m).rev() {
        for j in i + 1..m {
            for d in 0..3 {
                r[i][d] -= l[j * m + i] * r[j][d];
            }
        }
        r[i] = r[i].map(|v| v / l[i * m + i]);
    }
}

/// What a system matrix A needs to solve within the rows: Y = A^-1 C^T and the factor of C Y.
#[derive(Clone, Debug, Default)]
pub(crate) struct Within {
    equalities: Equalities,
    y: Vec<Vec<f64>>, // columns of A^-1 C^T, one a row
    schur: Vec<f64>,  // Cholesky factor of C A^-1 C^T
    r: Vec<[f64; 3]>,
}

impl Within {
    /// For rows over `n` free nodes.
    pub fn new(equalities: &Equalities, n: usize) -> Self {
        let m = equalities.len();
        Within {
            equalities: equalities.clone(),
            y: vec![vec![0.0; n]; m],
            schur: vec![0.0; m * m],
            r: vec![[0.0; 3]; m],
        }
    }

    /// The matrix has changed: `solve` solves with it for one coordinate. False where the rows are lost in it.
    pub fn refresh<E>(&mut self, mut solve: impl FnMut(&mut [f64]) -> Result<(), E>) -> Result<bool, E> {
        let m = self.equalities.len();
        for (row, y) in self.equalities.rows.iter().zip(&mut self.y) {
            y.fill(0.0);
            for (v, a) in &row.nodes {
                y[*v as usize] = *a;
            }
            solve(y)?;
        }
        for i in 0..m {
            for j in 0..=i {
                let mut sum: f64 = self.equalities.rows[i].nodes.iter().map(|(v, a)| a * self.y[j][*v as usize]).sum();
                for k in 0..j {
                    sum -= self.schur[i * m + k] * self.schur[j * m + k];
                }
                if i == j && (sum <= 0.0 || sum.is_nan()) {
                    return Ok(false);
                }
                self.schur[i * m + j] = if i == j { sum.sqrt() } else { sum / self.schur[j * m + j] };
            }
        }
        Ok(true)
    }

    /// b = A^-1 g becomes the solution of the system within the rows: b - Y (C Y)^-1 C b.
    pub fn restrict(&mut self, b: &mut [f64], dim: usize) {
        // Twice: what rounding leaves of C b the second time is rounding of a small number.
        for _ in 0..2 {
            for (row, r) in self.equalities.rows.iter().zip(&mut self.r) {
                *r = residual(row, [0.0; 3], b, dim);
            }
            solve_lower(&self.schur, &mut self.r);
            solve_upper(&self.schur, &mut self.r);
            for (y, r) in self.y.iter().zip(&self.r) {
                for (b, y) in b.chunks_exact_mut(dim).zip(y) {
                    for d in 0..dim {
                        b[d] += y * r[d];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(nodes: &[(u32, f64)], value: [f64; 3]) -> Equality {
        Equality { nodes: nodes.to_vec(), value }
    }

    #[test]
    fn rows_are_met_and_projections_lie_in_their_kernel() {
        let x = [0.3, 1.0, -2.0, 0.5, 1.5, 2.5, 9.0, 9.0];
        // Node 3 is fixed.
        let rows = vec![row(&[(0, 1.0), (1, 1.0)], [1.0, 2.0, 0.0]), row(&[(2, 2.0), (1, -1.0), (3, 1.0)], [0.0; 3])];
        let c = Equalities::new(rows, 3, &x, 2).unwrap();
        let mut y = x.to_vec();
        c.enforce(&mut y, 2);
        for d in 0..2 {
            assert!((y[d] + y[2 + d] - [1.0, 2.0][d]).abs() < 1e-14);
            assert!((2.0 * y[4 + d] - y[2 + d] + 9.0).abs() < 1e-14);
        }
        assert!(c.violation(&y, 2) < 1e-15 && c.violation(&x, 2) > 0.1);
        let mut v = x[..6].to_vec();
        c.project(&mut v, 2);
        let before = v.clone();
        for d in 0..2 {
            assert!((v[d] + v[2 + d]).abs() < 1e-14 && (2.0 * v[4 + d] - v[2 + d]).abs() < 1e-14);
        }
        c.project(&mut v, 2);
        assert!(v.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-14), "once is enough");
    }

    #[test]
    fn dependent_rows_are_named() {
        let x = [0.0; 12];
        let two = |third: [f64; 3]| {
            vec![
                row(&[(0, 1.0), (1, -1.0)], [1.0, 0.0, 0.0]),
                row(&[(1, 1.0), (2, -1.0)], [0.0, 1.0, 0.0]),
                row(&[(0, 2.0), (2, -2.0)], third),
            ]
        };
        assert_eq!(Equalities::new(two([2.0, 2.0, 0.0]), 4, &x, 3), Err(EqualityError::Redundant { row: 2 }));
        assert_eq!(Equalities::new(two([2.0, 1.0, 0.0]), 4, &x, 3), Err(EqualityError::Contradictory { row: 2 }));
        // A row over fixed nodes alone says nothing, or something else.
        let fixed = |b: f64| Equalities::new(vec![row(&[(3, 1.0)], [b, 0.0, 0.0])], 3, &x, 3);
        assert_eq!(fixed(0.0), Err(EqualityError::Redundant { row: 0 }));
        assert_eq!(fixed(1.0), Err(EqualityError::Contradictory { row: 0 }));
        assert_eq!(Equalities::new(vec![row(&[], [0.0; 3])], 3, &x, 3), Err(EqualityError::Row { row: 0 }));
        assert_eq!(Equalities::new(vec![row(&[(9, 1.0)], [0.0; 3])], 3, &x, 3), Err(EqualityError::Row { row: 0 }));
    }

    #[test]
    fn a_system_is_solved_within_the_rows() {
        // A = diag: minimise 1/2 b^T A b - g . b over C b = 0, by hand for one row.
        let a = [1.0, 2.0, 4.0];
        let c = Equalities::new(vec![row(&[(0, 1.0), (1, 1.0), (2, 1.0)], [0.0; 3])], 3, &[0.0; 3], 1).unwrap();
        let mut within = Within::new(&c, 3);
        let done = within.refresh::<()>(|b| {
            b.iter_mut().zip(&a).for_each(|(b, a)| *b /= a);
            Ok(())
        });
        assert_eq!(done, Ok(true));
        let g = [3.0, 1.0, -2.0];
        let mut b: Vec<f64> = g.iter().zip(&a).map(|(g, a)| g / a).collect();
        within.restrict(&mut b, 1);
        assert!(b.iter().sum::<f64>().abs() < 1e-15);
        // The gradient A b - g is the same multiple of the row everywhere.
        let left: Vec<f64> = (0..3).map(|i| a[i] * b[i] - g[i]).collect();
        assert!((left[0] - left[1]).abs() < 1e-14 && (left[1] - left[2]).abs() < 1e-14, "{left:?}");
    }
}
