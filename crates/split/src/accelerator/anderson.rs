//! Anderson acceleration of fixed-point iterations q <- G(q).

use super::{Accelerator, Iterate, Proposal};
use crate::vector;

mod least_squares;
mod square;

use least_squares::LeastSquares;
use square::Square;

/// Which secant equations the coefficients are taken from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// theta = argmin |F - dF theta|: the inverse Jacobian is approximated. A section 3.1.
    #[default]
    Two,
    /// dQ^T (F - dF theta) = 0: the Jacobian is approximated (Fang and Saad 2009; Walker and Ni 2011). Zhang, O'Donoghue and
    /// Boyd 2018 keep its matrix from becoming singular by a regularisation; here the rank-revealing solve does, and the
    /// safeguard of the driver takes the place of theirs.
    One,
}

/// Anderson acceleration with a window of m columns, A(9) and A(10):
///
/// ```text
/// q_next = beta (G_k - sum_i theta_i (G_{i+1} - G_i)) + (1 - beta) (q_k - sum_i theta_i (q_{i+1} - q_i))
/// theta = argmin |F_k - sum_i theta_i (F_{i+1} - F_i)|,   F_k = G(q_k) - q_k
/// ```
///
/// over the last m_k = min(m, calls since the start or [`Anderson::reset`]) differences. It is told G_k and F_k and knows
/// nothing of what they are made of. F may be given in any linear coordinates, and of any length of its own: what is
/// minimised is its Euclidean norm, so scale it to the metric of the iteration. G may carry more than the state, such as
/// affine functions of it, which are then extrapolated by the same coefficients, exactly.
///
/// The Gram matrix of the columns of F, scaled to unit length, is updated by a row a call, each column being read once for
/// all its products, and the normal equations are solved by an eigendecomposition that drops directions below rounding: the
/// least-squares solution of least norm. Sums have a fixed order on any number of threads, and a call allocates nothing once
/// the window is full.
pub struct Anderson {
    window: usize,
    mixing: f64,
    kind: Kind,
    columns: Vec<Column>,
    next: usize, // the column to be written
    used: usize,
    before: Kept, // of the call before
    primed: bool, // whether there was one
    least_squares: LeastSquares,
    square: Square,
    mixed: Vec<f64>, // scratch
    products: Vec<(f64, f64)>,
    row: Vec<f64>,
}

/// What is kept of a call; parts that are not needed are empty.
#[derive(Default)]
struct Kept {
    g: Vec<f64>,
    f: Vec<f64>,
    q: Vec<f64>,      // for a mixing other than 1
    sensed: Vec<f64>, // for type I
}

/// A difference of two calls.
#[derive(Default)]
struct Column {
    d: Kept,
    inverse: f64, // 1 / |f|
}

/// to <- now - before, with the length of `now`, and before <- now; |to|^2.
fn difference(to: &mut Vec<f64>, before: &mut [f64], now: &[f64]) -> f64 {
    to.resize(now.len(), 0.0);
    vector::advance(to, before, now)
}

/// to <- from
fn keep(to: &mut Vec<f64>, from: &[f64]) {
    to.resize(from.len(), 0.0);
    vector::copy(to, from);
}

impl Anderson {
    /// Type II of at most `window` columns, beta = 1; with 0 columns it changes nothing.
    pub fn new(window: usize) -> Self {
        Anderson {
            window,
            mixing: 1.0,
            kind: Kind::Two,
            columns: Vec::with_capacity(window),
            next: 0,
            used: 0,
            before: Kept::default(),
            primed: false,
            least_squares: LeastSquares::new(window),
            square: Square::new(window),
            mixed: Vec::new(),
            products: Vec::with_capacity(window),
            row: Vec::with_capacity(window),
        }
    }

    /// With this mixing parameter beta, in (0, 1].
    #[must_use]
    pub fn with_mixing(mut self, beta: f64) -> Self {
        self.mixing = beta;
        self
    }

    /// Of this kind.
    #[must_use]
    pub fn of_kind(mut self, kind: Kind) -> Self {
        self.kind = kind;
        self
    }

    /// The columns that the next call will use besides its own.
    pub fn columns(&self) -> usize {
        self.used
    }

    /// Type II without mixing, from G(q) and F alone: the next q in `out`.
    ///
    /// Where F or what follows from it is not finite, or where there is no history, `out` is G.
    pub fn extrapolate(&mut self, g: &[f64], f: &[f64], out: &mut [f64]) -> Proposal {
        self.next(&Iterate { q: &[], g, sensed: &[], f }, out)
    }

    /// Writes the differences to the call before into the oldest column, and its products into the small matrix; this call
    /// is the one before from here on.
    fn push(&mut self, at: &Iterate<'_>) {
        if self.columns.len() == self.next {
            self.columns.push(Column::default());
        }
        let place = self.next;
        let Column { d, inverse } = &mut self.columns[place];
        let length = difference(&mut d.f, &mut self.before.f, at.f).sqrt();
        if !(length > 0.0 && length.is_finite()) {
            // Nothing was learnt from a step that changed nothing, or from one into nowhere.
            self.reset();
            return self.remember(at);
        }
        difference(&mut d.g, &mut self.before.g, at.g);
        if self.mixing != 1.0 {
            difference(&mut d.q, &mut self.before.q, at.q);
        }
        if self.kind == Kind::One {
            difference(&mut d.sensed, &mut self.before.sensed, at.sensed);
        }
        *inverse = 1.0 / length;
        self.next = (place + 1) % self.window;
        self.used = (self.used + 1).min(self.window);
        let (columns, new) = (&self.columns[..self.used], &self.columns[place]);
        let scale = |i: usize| columns[i].inverse / length;
        match self.kind {
            Kind::Two => {
                vector::pairs_of_dots(self.used, &|i| columns[i].d.f.as_slice(), &new.d.f, at.f, &mut self.products);
                for (i, (with_new, with_f)) in self.products.iter().enumerate() {
                    self.least_squares.set(place, i, with_new * scale(i));
                    self.least_squares.set_right(i, with_f * columns[i].inverse);
                }
            }
            Kind::One => {
                let sensed = |i: usize| columns[i].d.sensed.as_slice();
                vector::pairs_of_dots(self.used, &sensed, &new.d.f, at.f, &mut self.products);
                for (i, (with_new, with_f)) in self.products.iter().enumerate() {
                    self.square.set(i, place, with_new * scale(i));
                    self.square.set_right(i, with_f * columns[i].inverse);
                }
                vector::dots(self.used, &|i| columns[i].d.f.as_slice(), &new.d.sensed, &mut self.row);
                for (i, product) in self.row.iter().enumerate() {
                    self.square.set(place, i, product * scale(i));
                }
            }
        }
    }

    /// This call is the one before from here on.
    fn remember(&mut self, at: &Iterate<'_>) {
        keep(&mut self.before.g, at.g);
        keep(&mut self.before.f, at.f);
        if self.mixing != 1.0 {
            keep(&mut self.before.q, at.q);
        }
        if self.kind == Kind::One {
            keep(&mut self.before.sensed, at.sensed);
        }
    }
}

impl Accelerator for Anderson {
    fn next(&mut self, at: &Iterate<'_>, out: &mut [f64]) -> Proposal {
        if self.window == 0 {
            vector::copy(out, at.g);
            return Proposal::default();
        }
        match self.primed {
            true => self.push(at),
            false => self.remember(at),
        }
        self.primed = true;
        let (theta, rank) = match self.kind {
            Kind::Two => self.least_squares.solve(self.used),
            Kind::One => self.square.solve(self.used),
        };
        if self.used == 0 || !vector::is_finite(theta) {
            vector::copy(out, at.g);
            return Proposal::default();
        }
        let columns = &self.columns;
        self.row.clear();
        self.row.extend(theta.iter().zip(columns).map(|(theta, column)| theta * column.inverse));
        vector::subtract_combination(out, at.g, &self.row, &|i| columns[i].d.g.as_slice());
        if self.mixing != 1.0 {
            self.mixed.resize(at.q.len(), 0.0);
            vector::subtract_combination(&mut self.mixed, at.q, &self.row, &|i| columns[i].d.q.as_slice());
            out.iter_mut().zip(&self.mixed).for_each(|(out, q)| *out = self.mixing * *out + (1.0 - self.mixing) * q);
        }
        Proposal { columns: self.used, rank }
    }

    fn reset(&mut self) {
        self.next = 0;
        self.used = 0;
        self.primed = false;
    }
}

#[cfg(test)]
mod tests;
