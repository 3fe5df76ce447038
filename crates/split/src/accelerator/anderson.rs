//! Anderson acceleration of fixed-point iterations q <- G(q).

use super::{Accelerator, Iterate, Proposal};
use crate::vector;

mod history;
mod least_squares;
mod square;

use history::History;
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
    next: usize, // the place in the small matrix of the next difference
    used: usize,
    inverse: Vec<f64>, // 1 over the length of the difference of F at each place
    g: History,
    f: History,
    q: History,      // for a mixing other than 1
    sensed: History, // for type I
    primed: bool,    // whether there was a call before
    least_squares: LeastSquares,
    square: Square,
    mixed: Vec<f64>, // scratch
    products: Vec<(f64, f64)>,
    row: Vec<f64>,
}

impl Anderson {
    /// Type II of at most `window` columns, beta = 1; with 0 columns it changes nothing.
    pub fn new(window: usize) -> Self {
        Anderson {
            window,
            mixing: 1.0,
            kind: Kind::Two,
            next: 0,
            used: 0,
            inverse: vec![0.0; window],
            g: History::new(window),
            f: History::new(window),
            q: History::new(window),
            sensed: History::new(window),
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

    /// Remembers F, and writes the products of its newest difference into the small matrix; returns whether anything was
    /// learnt. If not, the history is empty: in the first call, and from a step that changed nothing, or one into
    /// nowhere.
    fn push(&mut self, at: &Iterate<'_>) -> bool {
        let used = if self.primed { (self.used + 1).min(self.window) } else { 0 };
        self.f.remember_then_dots(at.f, used, &mut self.products);
        if self.kind == Kind::One {
            self.sensed.remember(at.sensed);
        }
        let length = self.products.first().map_or(0.0, |(square, _)| square.sqrt());
        if !(length > 0.0 && length.is_finite()) {
            self.reset();
            self.primed = true;
            return false;
        }
        let new = self.next;
        self.inverse[new] = 1.0 / length;
        self.next = (new + 1) % self.window;
        self.used = used;
        match self.kind {
            Kind::Two => {
                for (age, (with_new, with_f)) in self.products.iter().enumerate() {
                    let i = place(self.next, self.window, age);
                    self.least_squares.set(new, i, with_new * (self.inverse[i] / length));
                    self.least_squares.set_right(i, with_f * self.inverse[i]);
                }
            }
            Kind::One => {
                let (f, sensed) = (&self.f, &self.sensed);
                let of_f = [f.call(0), f.call(1), f.call(0)];
                vector::difference_dots(used, &|age| sensed.call(age), of_f, &mut self.products);
                for (age, (with_new, with_f)) in self.products.iter().enumerate() {
                    let i = place(self.next, self.window, age);
                    self.square.set(i, new, with_new * (self.inverse[i] / length));
                    self.square.set_right(i, with_f * self.inverse[i]);
                }
                let of_sensed = [sensed.call(0), sensed.call(1), sensed.call(0)];
                vector::difference_dots(used, &|age| f.call(age), of_sensed, &mut self.products);
                for (age, (with_new, _)) in self.products.iter().enumerate() {
                    let i = place(self.next, self.window, age);
                    self.square.set(new, i, with_new * (self.inverse[i] / length));
                }
            }
        }
        true
    }

    /// G and q of this call, where they are not extrapolated.
    fn remember(&mut self, at: &Iterate<'_>) {
        self.g.remember(at.g);
        if self.mixing != 1.0 {
            self.q.remember(at.q);
        }
    }
}

/// Where the difference between the call of this age and the one before it is in the small matrix, `next` being the place that
/// the next one will take.
fn place(next: usize, window: usize, age: usize) -> usize {
    (next + 2 * window - 1 - age) % window
}

impl Accelerator for Anderson {
    fn next(&mut self, at: &Iterate<'_>, out: &mut [f64]) -> Proposal {
        if self.window == 0 {
            vector::copy(out, at.g);
            return Proposal::default();
        }
        if !self.push(at) {
            self.remember(at);
            vector::copy(out, at.g);
            return Proposal::default();
        }
        let (theta, rank) = match self.kind {
            Kind::Two => self.least_squares.solve(self.used),
            Kind::One => self.square.solve(self.used),
        };
        if !vector::is_finite(theta) {
            self.remember(at);
            vector::copy(out, at.g);
            return Proposal::default();
        }
        self.row.clear();
        let places = (0..self.used).map(|age| place(self.next, self.window, age));
        self.row.extend(places.map(|i| theta[i] * self.inverse[i]));
        self.g.remember_then_extrapolate(at.g, &self.row, out);
        if self.mixing != 1.0 {
            self.mixed.resize(at.q.len(), 0.0);
            self.q.remember_then_extrapolate(at.q, &self.row, &mut self.mixed);
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
