//! The history of L-BFGS: curvature pairs, and the two loops that apply the inverse Hessian they stand for.

use crate::{NormalMatrix, SystemError, vector};
use std::collections::VecDeque;

/// A curvature pair.
struct Pair {
    s: Vec<f64>, // change of x
    y: Vec<f64>, // change of the gradient, or what stands for it
    rho: f64,    // 1 / s . y
}

/// The newest pairs (s, y) of a quasi-Newton method whose first Hessian is the normal matrix, W(5a).
///
/// Only pairs with s . y > 0 are kept, so that the inverse Hessian they stand for is positive definite.
pub struct Pairs {
    window: usize,
    pairs: VecDeque<Pair>, // newest last
    spare: Vec<Pair>,      // storage of dropped pairs
    alpha: Vec<f64>,
}

impl Pairs {
    /// An empty history of at most `window` pairs.
    pub fn new(window: usize) -> Self {
        Pairs {
            window,
            pairs: VecDeque::with_capacity(window + 1),
            spare: Vec::with_capacity(window + 1),
            alpha: Vec::with_capacity(window),
        }
    }

    /// Whether there is no pair: the inverse Hessian is A^-1.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// Forgets all pairs.
    pub fn clear(&mut self) {
        self.spare.extend(self.pairs.drain(..));
    }

    /// q <- H g by the two loops (Nocedal and Wright, Algorithm 7.4); returns g . q.
    ///
    /// # Errors
    /// A vector of another length than the matrix has.
    pub fn direction(&mut self, g: &[f64], q: &mut [f64], normal: &mut NormalMatrix) -> Result<f64, SystemError> {
        q.copy_from_slice(g);
        self.alpha.clear();
        // First loop, newest to oldest: alpha_i = rho_i s_i . q, q -= alpha_i y_i; the update and the next product in one pass.
        let mut newer: Option<(&Pair, f64)> = None;
        for pair in self.pairs.iter().rev() {
            let s_q = match newer {
                None => vector::dot(&pair.s, q),
                Some((newer, alpha)) => vector::add_scaled_then_dot(q, -alpha, &newer.y, &pair.s),
            };
            let alpha = pair.rho * s_q;
            self.alpha.push(alpha);
            newer = Some((pair, alpha));
        }
        if let Some((oldest, alpha)) = newer {
            vector::add_scaled(q, -alpha, &oldest.y);
        }
        normal.solve(q)?;
        // Second loop, oldest to newest: beta = rho_i y_i . q, q += (alpha_i - beta) s_i.
        let mut older: Option<(&Pair, f64)> = None;
        for (pair, alpha) in self.pairs.iter().zip(self.alpha.iter().rev()) {
            let y_q = match older {
                None => vector::dot(&pair.y, q),
                Some((older, c)) => vector::add_scaled_then_dot(q, c, &older.s, &pair.y),
            };
            older = Some((pair, alpha - pair.rho * y_q));
        }
        Ok(match older {
            None => vector::dot(g, q),
            Some((newest, c)) => vector::add_scaled_then_dot(q, c, &newest.s, g),
        })
    }

    /// Keeps the pair that `fill` writes into (s, y) of length n, in the place of the oldest where the window is full;
    /// skips it where s . y is not positive.
    pub fn remember(&mut self, n: usize, fill: impl FnOnce(&mut [f64], &mut [f64])) {
        if self.window == 0 {
            return;
        }
        let mut pair = if self.pairs.len() == self.window { self.pairs.pop_front() } else { self.spare.pop() }
            .unwrap_or_else(|| Pair { s: vec![0.0; n], y: vec![0.0; n], rho: 0.0 });
        fill(&mut pair.s, &mut pair.y);
        let s_y = vector::dot(&pair.s, &pair.y);
        if s_y > 0.0 && s_y.is_finite() {
            pair.rho = 1.0 / s_y;
            self.pairs.push_back(pair);
        } else {
            self.spare.push(pair);
        }
    }
}
