//! The history of L-BFGS: curvature pairs, and the inverse Hessian that they stand for.

use crate::{NormalMatrix, SystemError, vector};
use std::collections::VecDeque;

/// A curvature pair.
struct Pair {
    s: Vec<f64>,       // change of x
    y: Vec<f64>,       // change of the gradient, or what stands for it
    s_dot_y: Vec<f64>, // s_i . y of the pairs i up to this one, oldest first
}

/// The newest pairs (s, y) of a quasi-Newton method whose first Hessian is the normal matrix, W(5a).
///
/// Only pairs with s . y > 0 are kept, so that the inverse Hessian they stand for is positive definite. The two loops of
/// Nocedal and Wright, Algorithm 7.4, are two triangular systems with the products s_i . y_j (Byrd, Nocedal and Schnabel
/// 1994): so the vectors are read in four passes, not in four for each pair.
pub struct Pairs {
    window: usize,
    pairs: VecDeque<Pair>, // newest last
    spare: Vec<Pair>,      // storage of dropped pairs
    products: Vec<f64>,
    alpha: Vec<f64>,
}

impl Pairs {
    /// An empty history of at most `window` pairs.
    pub fn new(window: usize) -> Self {
        Pairs {
            window,
            pairs: VecDeque::with_capacity(window + 1),
            spare: Vec::with_capacity(window + 1),
            products: Vec::with_capacity(window + 1),
            alpha: Vec::with_capacity(window + 1),
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

    /// q <- H g; returns g . q.
    ///
    /// With H0 = A^-1, R_ij = s_i . y_j for i <= j and D its diagonal: R alpha = S^T g, q = H0 (g - Y alpha),
    /// R^T c = D alpha - Y^T q, q += S c.
    ///
    /// # Errors
    /// A vector of another length than the matrix has.
    pub fn direction(&mut self, g: &[f64], q: &mut [f64], normal: &mut NormalMatrix) -> Result<f64, SystemError> {
        let Pairs { pairs, products, alpha, .. } = self;
        let pairs = &*pairs;
        let (s, y) = (|i: usize| pairs[i].s.as_slice(), |i: usize| pairs[i].y.as_slice());
        let m = pairs.len();
        vector::dots(m, &s, g, alpha);
        for i in (0..m).rev() {
            for j in i + 1..m {
                alpha[i] -= pairs[j].s_dot_y[i] * alpha[j];
            }
            alpha[i] /= pairs[i].s_dot_y[i];
        }
        vector::subtract_combination(q, g, alpha, &y);
        normal.solve(q)?;
        vector::dots(m, &y, q, products);
        for i in 0..m {
            let mut c = pairs[i].s_dot_y[i] * alpha[i] - products[i];
            for j in 0..i {
                c -= pairs[i].s_dot_y[j] * alpha[j];
            }
            alpha[i] = c / pairs[i].s_dot_y[i]; // c_i in the place of alpha_i, which is used up
        }
        Ok(vector::add_combination_then_dot(q, alpha, &s, g))
    }

    /// Keeps the pair that `fill` writes into (s, y) of length n, in the place of the oldest where the window is full;
    /// skips it where s . y is not positive.
    pub fn remember(&mut self, n: usize, fill: impl FnOnce(&mut [f64], &mut [f64])) {
        if self.window == 0 {
            return;
        }
        let mut pair = if self.pairs.len() == self.window {
            self.pairs.iter_mut().for_each(|pair| {
                pair.s_dot_y.remove(0);
            });
            self.pairs.pop_front()
        } else {
            self.spare.pop()
        }
        .unwrap_or_else(|| Pair { s: vec![0.0; n], y: vec![0.0; n], s_dot_y: Vec::with_capacity(self.window) });
        fill(&mut pair.s, &mut pair.y);
        let s_y = vector::dot(&pair.s, &pair.y);
        if s_y > 0.0 && s_y.is_finite() {
            let pairs = &self.pairs;
            vector::dots(pairs.len(), &|i| pairs[i].s.as_slice(), &pair.y, &mut self.products);
            pair.s_dot_y.clear();
            pair.s_dot_y.extend_from_slice(&self.products);
            pair.s_dot_y.push(s_y);
            self.pairs.push_back(pair);
        } else {
            self.spare.push(pair);
        }
    }
}
