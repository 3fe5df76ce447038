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
    next: usize, // the column to be written
    used: usize,
    inverse: Vec<f64>, // 1 over the length of each column of F
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
            g: History::default(),
            f: History::default(),
            q: History::default(),
            sensed: History::default(),
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

    /// Writes the difference of F to the call before into the oldest column, and its products into the small matrix; returns
    /// that column. None, and an empty history, where nothing was learnt: from a step that changed nothing, or one into
    /// nowhere.
    fn push(&mut self, at: &Iterate<'_>) -> Option<usize> {
        let place = self.next;
        let used = (self.used + 1).min(self.window);
        let square = match self.kind {
            Kind::Two => self.f.advance_then_dots(place, used, at.f, &mut self.products),
            Kind::One => self.f.advance(place, at.f),
        };
        let length = square.sqrt();
        if !(length > 0.0 && length.is_finite()) {
            self.reset();
            return None;
        }
        self.inverse[place] = 1.0 / length;
        self.next = (place + 1) % self.window;
        self.used = used;
        let inverse = &self.inverse;
        match self.kind {
            Kind::Two => {
                for (i, (with_new, with_f)) in self.products.iter().enumerate() {
                    self.least_squares.set(place, i, with_new * (inverse[i] / length));
                    self.least_squares.set_right(i, with_f * inverse[i]);
                }
            }
            Kind::One => {
                self.sensed.advance(place, at.sensed);
                let (f, sensed) = (&self.f, &self.sensed);
                vector::pairs_of_dots(used, &|i| sensed.column(i), f.column(place), at.f, &mut self.products);
                for (i, (with_new, with_f)) in self.products.iter().enumerate() {
                    self.square.set(i, place, with_new * (inverse[i] / length));
                    self.square.set_right(i, with_f * inverse[i]);
                }
                vector::dots(used, &|i| f.column(i), sensed.column(place), &mut self.row);
                for (i, product) in self.row.iter().enumerate() {
                    self.square.set(place, i, product * (inverse[i] / length));
                }
            }
        }
        Some(place)
    }

    /// This call is the one before from here on.
    fn remember(&mut self, at: &Iterate<'_>) {
        self.g.remember(at.g);
        self.f.remember(at.f);
        if self.mixing != 1.0 {
            self.q.remember(at.q);
        }
        if self.kind == Kind::One {
            self.sensed.remember(at.sensed);
        }
    }
}

impl Accelerator for Anderson {
    fn next(&mut self, at: &Iterate<'_>, out: &mut [f64]) -> Proposal {
        if self.window == 0 {
            vector::copy(out, at.g);
            return Proposal::default();
        }
        let place = if self.primed { self.push(at) } else { None };
        self.primed = true;
        let Some(place) = place else {
            self.remember(at);
            vector::copy(out, at.g);
            return Proposal::default();
        };
        let (theta, rank) = match self.kind {
            Kind::Two => self.least_squares.solve(self.used),
            Kind::One => self.square.solve(self.used),
        };
        if !vector::is_finite(theta) {
            self.g.advance(place, at.g);
            if self.mixing != 1.0 {
                self.q.advance(place, at.q);
            }
            vector::copy(out, at.g);
            return Proposal::default();
        }
        self.row.clear();
        self.row.extend(theta.iter().zip(&self.inverse).map(|(theta, inverse)| theta * inverse));
        self.g.advance_then_extrapolate(place, at.g, &self.row, out);
        if self.mixing != 1.0 {
            self.mixed.resize(at.q.len(), 0.0);
            self.q.advance_then_extrapolate(place, at.q, &self.row, &mut self.mixed);
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
