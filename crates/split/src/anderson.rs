//! Anderson acceleration of fixed-point iterations q <- G(q).

use crate::vector;

mod least_squares;

use least_squares::LeastSquares;

/// Type-II Anderson acceleration with a window of m columns, A(9) with beta = 1 and A(10):
///
/// ```text
/// q_next = G_k - sum_i theta_i (G_{i+1} - G_i),   theta = argmin |F_k - sum_i theta_i (F_{i+1} - F_i)|,   F_k = G(q_k) - q_k
/// ```
///
/// over the last m_k = min(m, calls since the start or [`Anderson::reset`]) differences. It is told G_k and F_k and knows
/// nothing of what they are made of. F may be given in any linear coordinates, and of any length of its own: what is
/// minimised is its Euclidean norm, so scale it to the metric of the iteration. G may carry more than the state, such as
/// affine functions of it, which are then extrapolated by the same coefficients, exactly.
///
/// The Gram matrix of the columns of F, scaled to unit length, is updated by a row a call (m products), and the normal
/// equations are solved by an eigendecomposition that drops directions below rounding: the least-squares solution of least
/// norm. Sums have a fixed order on any number of threads, and a call allocates nothing once the window is full.
pub struct Anderson {
    window: usize,
    columns: Vec<Column>,
    next: usize, // the column to be written
    used: usize,
    g: Vec<f64>, // of the call before
    f: Vec<f64>,
    primed: bool, // whether there was a call before
    least_squares: LeastSquares,
}

/// A difference of two calls.
struct Column {
    g: Vec<f64>,
    f: Vec<f64>,
    inverse: f64, // 1 / |f|
}

impl Anderson {
    /// Of at most `window` columns; with 0 it changes nothing.
    pub fn new(window: usize) -> Self {
        Anderson {
            window,
            columns: Vec::with_capacity(window),
            next: 0,
            used: 0,
            g: Vec::new(),
            f: Vec::new(),
            primed: false,
            least_squares: LeastSquares::new(window),
        }
    }

    /// Forgets everything: the next call returns its G.
    pub fn reset(&mut self) {
        self.next = 0;
        self.used = 0;
        self.primed = false;
    }

    /// The columns that the next call will use besides its own.
    pub fn columns(&self) -> usize {
        self.used
    }

    /// From G(q) and the residual F = G(q) - q at the current q, the next q in `out`. Lengths are the same in every call.
    ///
    /// Where F or what follows from it is not finite, or where there is no history, `out` is G.
    pub fn next(&mut self, g: &[f64], f: &[f64], out: &mut [f64]) {
        out.copy_from_slice(g);
        if self.window == 0 {
            return;
        }
        if self.primed {
            self.push(g, f);
        }
        self.g.resize(g.len(), 0.0);
        self.f.resize(f.len(), 0.0);
        self.g.copy_from_slice(g);
        self.f.copy_from_slice(f);
        self.primed = true;
        let theta = self.least_squares.solve(self.used);
        if theta.iter().all(|t| t.is_finite()) {
            subtract_combination(out, &self.columns, theta, 0);
        }
    }

    /// Writes the difference to the call before into the oldest column, and its products into the Gram matrix.
    fn push(&mut self, g: &[f64], f: &[f64]) {
        if self.columns.len() == self.next {
            self.columns.push(Column { g: vec![0.0; g.len()], f: vec![0.0; f.len()], inverse: 0.0 });
        }
        let at = self.next;
        let column = &mut self.columns[at];
        vector::subtract(&mut column.f, f, &self.f);
        let length = vector::norm(&column.f);
        if !(length > 0.0 && length.is_finite()) {
            // Nothing was learnt from a step that changed nothing, or from one into nowhere.
            self.reset();
            return;
        }
        vector::subtract(&mut column.g, g, &self.g);
        column.inverse = 1.0 / length;
        self.next = (at + 1) % self.window;
        self.used = (self.used + 1).min(self.window);
        for (i, column) in self.columns[..self.used].iter().enumerate() {
            // Each column is read once for both products.
            let (with_new, with_f) = vector::two_dots(&column.f, &self.columns[at].f, f);
            self.least_squares.set(at, i, with_new * column.inverse / length);
            self.least_squares.set_right(i, with_f * column.inverse);
        }
    }
}

/// out -= sum_i theta_i g_i over the range of entries that starts at `first`, so that `out` is read and written once.
fn subtract_combination(out: &mut [f64], columns: &[Column], theta: &[f64], first: usize) {
    const LEAF: usize = 8192;
    if out.len() > LEAF {
        let middle = (out.len() / 2).next_multiple_of(LEAF);
        let (low, high) = out.split_at_mut(middle);
        rayon::join(
            || subtract_combination(low, columns, theta, first),
            || subtract_combination(high, columns, theta, first + middle),
        );
        return;
    }
    for (column, theta) in columns.iter().zip(theta) {
        vector::add_scaled(out, -theta * column.inverse, &column.g[first..first + out.len()]);
    }
}

#[cfg(test)]
mod tests;
