//! Inertia: what ties each node to where it would go by itself.

use crate::ProblemError;

/// Numbers that one thread handles at a time.
const LEAF: usize = 8192;

/// 1/2 sum_i k_i |x_i - t_i|^2 over the first nodes: the momentum energy A(14) of a time step with G = diag(k), A section
/// 3.3.
///
/// For implicit Euler k_i = m_i / dt^2 and t = x + dt v + dt^2 a, v being velocities and a accelerations; for BDF2
/// k_i = 9 m_i / (4 dt^2). The stiffness goes into the normal matrix and stays; the target, which moves from step to step,
/// does not: [`Inertia::set_target`] within [`crate::Admm::restart`] begins the next step on the same factor. New
/// stiffness, such as that of another dt, needs [`crate::NormalMatrix::refactor`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inertia {
    stiffness: Vec<f64>, // k of each node
    target: Vec<f64>,    // t, `dim` numbers a node
    dim: usize,
}

impl Inertia {
    /// Of the first nodes, one k each; most often the free ones. `target` has `dim` numbers a node.
    ///
    /// # Errors
    /// Lengths that do not fit, a k that is negative, a number that is not finite; each names the node.
    pub fn new(stiffness: Vec<f64>, target: Vec<f64>, dim: usize) -> Result<Self, ProblemError> {
        if let Some(node) = stiffness.iter().position(|k| !(*k >= 0.0 && k.is_finite())) {
            let k = stiffness[node];
            return Err(ProblemError::NotFinite(format!("node {node}: m/dt^2 is {k}; masses cannot be negative")));
        }
        let mut inertia = Inertia { target: vec![0.0; stiffness.len() * dim], stiffness, dim };
        inertia.set_target(&target)?;
        Ok(inertia)
    }

    /// Moves the target: no matrix changes.
    ///
    /// # Errors
    /// Another number of coordinates, or one that is not finite.
    pub fn set_target(&mut self, target: &[f64]) -> Result<(), ProblemError> {
        if target.len() != self.target.len() {
            let (got, want) = (target.len(), self.target.len());
            return Err(ProblemError::Shape(format!("the target of inertia has {got} numbers, not {want}")));
        }
        if let Some(i) = target.iter().position(|t| !t.is_finite()) {
            let node = i / self.dim.max(1);
            return Err(ProblemError::NotFinite(format!("node {node}: the target of its inertia is {}", target[i])));
        }
        self.target.copy_from_slice(target);
        Ok(())
    }

    /// k of each node that has inertia.
    pub fn stiffness(&self) -> &[f64] {
        &self.stiffness
    }

    /// t, `dim` numbers a node.
    pub fn target(&self) -> &[f64] {
        &self.target
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.stiffness.is_empty()
    }

    /// Whether each of the first `n_free` nodes has some: G of A(14) is positive definite, Assumption 3.2 of A.
    pub fn is_positive(&self, n_free: usize) -> bool {
        self.stiffness.len() >= n_free && self.stiffness[..n_free].iter().all(|k| *k > 0.0)
    }

    /// The value; k_i (x_i - t_i) is added to `grad` for the nodes that it covers. Sums are taken over a tree that depends
    /// on the number of nodes alone.
    pub fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64 {
        let grad = grad.unwrap_or(&mut []);
        match self.dim {
            1 => over::<1>(&self.stiffness, &self.target, x, grad),
            2 => over::<2>(&self.stiffness, &self.target, x, grad),
            _ => over::<3>(&self.stiffness, &self.target, x, grad),
        }
    }

    /// Whether it belongs to a problem of `n` nodes with `dim` numbers each.
    pub(crate) fn check(&self, n: usize, dim: usize) -> Result<(), ProblemError> {
        if self.is_empty() || (self.dim == dim && self.stiffness.len() <= n) {
            return Ok(());
        }
        let (nodes, own) = (self.stiffness.len(), self.dim);
        Err(ProblemError::Shape(format!(
            "inertia is of {nodes} nodes with {own} numbers each, the problem has {n} with {dim}"
        )))
    }
}

fn over<const D: usize>(k: &[f64], t: &[f64], x: &[f64], grad: &mut [f64]) -> f64 {
    if k.len() * D > LEAF {
        let m = (k.len() / 2).next_multiple_of(LEAF / 4);
        let ((k0, k1), (t0, t1), (x0, x1)) = (k.split_at(m), t.split_at(m * D), x.split_at(m * D));
        let (g0, g1) = grad.split_at_mut((m * D).min(grad.len()));
        let (a, b) = rayon::join(|| over::<D>(k0, t0, x0, g0), || over::<D>(k1, t1, x1, g1));
        return a + b;
    }
    let mut value = 0.0;
    for (i, k) in k.iter().enumerate() {
        let mut square = 0.0;
        for d in 0..D {
            let gap = x[i * D + d] - t[i * D + d];
            square += gap * gap;
            if let Some(grad) = grad.get_mut(i * D + d) {
                *grad += k * gap;
            }
        }
        value += 0.5 * k * square;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_and_gradient_are_those_of_springs() {
        let n = 7001;
        let k: Vec<f64> = (0..n).map(|i| 1.0 + f64::from(i % 13)).collect();
        let t: Vec<f64> = (0..3 * n).map(|i| (f64::from(i) * 0.7).sin()).collect();
        let x: Vec<f64> = (0..3 * n + 6).map(|i| (f64::from(i) * 0.3).cos()).collect();
        let inertia = Inertia::new(k.clone(), t.clone(), 3).expect("good numbers");
        let mut grad = vec![1.0; 3 * (n as usize - 5)];
        let value = inertia.value_and_gradient(&x, Some(&mut grad));
        let plain: f64 = (0..t.len()).map(|i| 0.5 * k[i / 3] * (x[i] - t[i]).powi(2)).sum();
        assert!((value - plain).abs() < 1e-12 * plain, "{value} {plain}");
        for (i, g) in grad.iter().enumerate() {
            assert_eq!(*g, 1.0 + k[i / 3] * (x[i] - t[i]), "{i}");
        }
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of a few threads");
            pool.install(|| inertia.value_and_gradient(&x, None)).to_bits()
        };
        assert!(on(1) == value.to_bits() && on(2) == value.to_bits());
        assert!(inertia.is_positive(n as usize) && !inertia.is_positive(n as usize + 1));
    }

    #[test]
    fn bad_numbers_name_their_node() {
        let text = |k: f64, t: f64| Inertia::new(vec![1.0, k], vec![0.0, 0.0, 0.0, t], 2).unwrap_err().to_string();
        assert!(text(-1.0, 0.0).contains("node 1") && text(f64::NAN, 0.0).contains("node 1"));
        assert!(text(1.0, f64::INFINITY).contains("node 1"));
        assert!(Inertia::new(vec![1.0], vec![0.0; 3], 2).unwrap_err().to_string().contains("3 numbers, not 2"));
    }
}
