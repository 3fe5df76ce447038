//! The problem: terms, a quadratic, a start.

use crate::{
    Cycle, EnergyReport, Equalities, Inertia, LocalReport, PenaltyReport, PointSpring, Potential, SymmetricForm, Term,
    vector,
};
use proxel_linalg::sparse::SymPattern;
use std::sync::Arc;

/// What is not split: f(x), smooth potentials, and linear equalities, which hold exactly.
///
/// ```text
/// f(x) = sum_j k_j/2 |x_j - t_j|^2 + sum_p k_p/2 |sum_i w_pi x_i - t_p|^2 - sum_i b_i . x_i
///        + 1/2 sum_c x_c^T K x_c + sum_i m_i/(2 dt^2) |x_i - y_i|^2 + constant
/// ```
///
/// Soft springs from nodes and from points that nodes carry, loads, a quadratic form in each coordinate c, and inertia.
#[derive(Clone, Debug, Default)]
pub struct Quadratic {
    /// Soft springs: node, stiffness k_j, and the target t_j in the first `dim` entries.
    pub springs: Vec<(u32, f64, [f64; 3])>,
    /// Soft springs from points that nodes carry.
    pub points: Vec<PointSpring>,
    /// Loads b, `n * dim` long, or empty.
    pub loads: Vec<f64>,
    /// K over all nodes, such as the bending of thin sheets; or empty.
    pub form: SymmetricForm,
    /// m_i/dt^2 and y_i of a time step; or empty.
    pub inertia: Inertia,
    /// Smooth functions, such as pressure.
    pub potentials: Vec<Arc<dyn Potential>>,
    /// Rows sum a_i x_i = b.
    pub equalities: Equalities,
    /// A constant, so that values do not depend on where the origin was moved to.
    pub constant: f64,
}

impl Quadratic {
    /// f(x); its gradient over the free nodes is added to `grad` where one is wanted.
    pub fn value_and_gradient(&self, x: &[f64], dim: usize, mut grad: Option<&mut [f64]>) -> f64 {
        let mut value = self.constant;
        for spring in &self.points {
            value += spring.value_and_gradient(x, dim, grad.as_deref_mut());
        }
        if !self.loads.is_empty() {
            value -= vector::dot(&self.loads, x);
        }
        for (node, k, target) in &self.springs {
            for c in 0..dim {
                let d = x[*node as usize * dim + c] - target[c];
                value += 0.5 * k * d * d;
            }
        }
        let mut grad = grad;
        value += self.form.value_and_gradient(x, dim, grad.as_deref_mut());
        if !self.inertia.is_empty() {
            value += self.inertia.value_and_gradient(x, grad.as_deref_mut());
        }
        for potential in &self.potentials {
            value += potential.value_and_gradient(x, grad.as_deref_mut());
        }
        if let Some(grad) = grad {
            if !self.loads.is_empty() {
                let free = grad.len();
                vector::add_scaled(grad, -1.0, &self.loads[..free]);
            }
            for (node, k, target) in &self.springs {
                let at = *node as usize * dim;
                if at < grad.len() {
                    for c in 0..dim {
                        grad[at + c] += k * (x[at + c] - target[c]);
                    }
                }
            }
        }
        value
    }
}

/// min f(x) + sum_t g_t(c_t(D_t x)) over the first `n_free` of n nodes.
pub struct Problem {
    /// Numbers a node: 1, 2 or 3.
    pub dim: usize,
    /// Nodes 0..n_free are unknowns; the others stay where they are.
    pub n_free: usize,
    /// The start, n * dim.
    pub x0: Vec<f64>,
    /// Batches of elements.
    pub terms: Vec<Box<dyn Term>>,
    /// f
    pub quadratic: Quadratic,
    /// Whether a point with an inverted element cannot be a solution.
    pub barrier: bool,
}

/// Why a problem cannot be set up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProblemError {
    /// Lengths that do not fit each other.
    Shape(String),
    /// A number that is infinite or NaN.
    NotFinite(String),
    /// An element names a node that does not exist.
    Index(String),
}

impl std::fmt::Display for ProblemError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ProblemError::Shape(s) | ProblemError::NotFinite(s) | ProblemError::Index(s) => f.write_str(s),
        }
    }
}

impl std::error::Error for ProblemError {}

impl Problem {
    /// A problem without nodes, to stand where one was taken away.
    pub fn empty() -> Self {
        Problem {
            dim: 3,
            n_free: 0,
            x0: Vec::new(),
            terms: Vec::new(),
            quadratic: Quadratic::default(),
            barrier: false,
        }
    }

    /// Checks lengths and numbers; what [`crate::Admm::new`] and every other method call first.
    ///
    /// # Errors
    /// Names what does not fit.
    pub fn check(&self) -> Result<(), ProblemError> {
        if !(1..=3).contains(&self.dim) {
            return Err(ProblemError::Shape(format!("dim is {}; it can be 1, 2 or 3", self.dim)));
        }
        if !self.x0.len().is_multiple_of(self.dim) || self.n_free > self.n() {
            let (length, dim, free) = (self.x0.len(), self.dim, self.n_free);
            return Err(ProblemError::Shape(format!(
                "x0 has {length} numbers, which are not {dim} for each of at least {free} nodes"
            )));
        }
        if let Some(i) = self.x0.iter().position(|v| !v.is_finite()) {
            return Err(ProblemError::NotFinite(format!(
                "node {}: a coordinate of the start is {}",
                i / self.dim,
                self.x0[i]
            )));
        }
        if !self.quadratic.loads.is_empty() && self.quadratic.loads.len() != self.x0.len() {
            return Err(ProblemError::Shape(format!(
                "there are {} load numbers for {} coordinates",
                self.quadratic.loads.len(),
                self.x0.len()
            )));
        }
        if let Some(i) = self.quadratic.loads.iter().position(|v| !v.is_finite()) {
            return Err(ProblemError::NotFinite(format!(
                "node {}: a load is {}",
                i / self.dim,
                self.quadratic.loads[i]
            )));
        }
        for (node, k, target) in &self.quadratic.springs {
            if *node as usize >= self.n() {
                return Err(ProblemError::Index(format!("a soft spring names node {node} of {}", self.n())));
            }
            if !(*k >= 0.0 && k.is_finite() && vector::is_finite(&target[..self.dim])) {
                return Err(ProblemError::NotFinite(format!(
                    "the soft spring at node {node} has stiffness {k} and target {target:?}"
                )));
            }
        }
        self.quadratic.inertia.check(self.n(), self.dim)?;
        if !self.quadratic.form.is_empty() && self.quadratic.form.n() != self.n() {
            let (n, nodes) = (self.quadratic.form.n(), self.n());
            return Err(ProblemError::Shape(format!("the quadratic form is one of {n} nodes, there are {nodes}")));
        }
        if let Some(potential) = self.quadratic.potentials.iter().find(|p| p.n() > self.n()) {
            let (n, nodes) = (potential.n(), self.n());
            return Err(ProblemError::Index(format!("a potential names node {}, there are {nodes}", n - 1)));
        }
        if !self.quadratic.form.is_finite() {
            return Err(ProblemError::NotFinite("an entry of the quadratic form is not finite".to_string()));
        }
        for spring in &self.quadratic.points {
            spring.check(self.n(), self.dim).map_err(ProblemError::NotFinite)?;
        }
        let n = self.n() as u32;
        for (t, term) in self.terms.iter().enumerate() {
            let mut bad = None;
            term.for_each_element(&mut |nodes| {
                if let Some(node) = nodes.iter().find(|node| **node >= n) {
                    bad.get_or_insert(*node);
                }
            });
            if let Some(node) = bad {
                return Err(ProblemError::Index(format!("an element of term {t} names node {node} of {n}")));
            }
        }
        Ok(())
    }

    /// Whether a term is infinite outside a set. At such a set's border the gradient of a solution does not vanish, so that
    /// convergence is a matter of residuals: [`crate::ResidualTolerance`].
    pub fn has_hard_sets(&self) -> bool {
        self.terms.iter().any(|term| term.is_hard())
    }

    /// Numbers in z that mean something: N_z of A(27).
    pub fn local_dim(&self) -> usize {
        self.terms.iter().map(|term| term.local_dim()).sum()
    }

    /// out <- -D^T W^2 p over the free nodes, for linear couplings: the gradient of the penalty at x = 0.
    pub fn pull(&mut self, p: &[Vec<f64>], out: &mut [f64]) {
        let origin = vec![0.0; self.x0.len()];
        out.fill(0.0);
        for (term, p) in self.terms.iter_mut().zip(p) {
            term.penalty(&origin, p, out);
        }
    }

    /// out <- D^T W^2 r over the free nodes, for linear couplings: what the transpose of A makes of a vector of the local
    /// space. The dual residual A(7) of the x-z-u iteration is that of z - z_before.
    pub fn adjoint(&mut self, r: &[Vec<f64>], out: &mut [f64]) {
        // At x = 0 the gradient of 1/2 sum w^2 |Dx - p|^2 is -D^T W^2 p, without any rounding from x.
        let origin = vec![0.0; self.x0.len()];
        out.fill(0.0);
        for (term, r) in self.terms.iter_mut().zip(r) {
            let p: Vec<f64> = r.iter().map(|r| -r).collect();
            term.penalty(&origin, &p, out);
        }
    }

    /// Number of nodes.
    pub fn n(&self) -> usize {
        self.x0.len() / self.dim
    }

    /// The objective at x where f(x) is known.
    pub fn energy_beside(&mut self, f: f64, x: &[f64]) -> EnergyReport {
        let mut report = EnergyReport { value: f, ..EnergyReport::default() };
        for term in &mut self.terms {
            report += term.energy(x, None);
        }
        report
    }

    /// The objective at x, and how far the elements are deformed; `grad`, n_free * dim long, is overwritten.
    pub fn energy(&mut self, x: &[f64], mut grad: Option<&mut [f64]>) -> EnergyReport {
        if let Some(grad) = grad.as_deref_mut() {
            grad.fill(0.0);
        }
        let mut report = EnergyReport::default();
        for term in &mut self.terms {
            report += term.energy(x, grad.as_deref_mut());
        }
        report.value += self.quadratic.value_and_gradient(x, self.dim, grad);
        report
    }

    /// f(x) + 1/2 sum w^2 |c(Dx) - p|^2, the objective of the global step W(11); `grad` is overwritten.
    pub fn penalty(&mut self, x: &[f64], p: &[Vec<f64>], grad: &mut [f64]) -> PenaltyReport {
        grad.fill(0.0);
        let mut report = PenaltyReport::default();
        for (term, p) in self.terms.iter_mut().zip(p) {
            report += term.penalty(x, p, grad);
        }
        let f = self.quadratic.value_and_gradient(x, self.dim, Some(grad));
        report.value += f;
        if let Some(energy) = &mut report.energy {
            energy.value += f;
        }
        report
    }

    /// The local step of every term, W(10b) and W(10c); `grad` is overwritten with the gradient of the objective of the
    /// global step where it begins.
    pub fn local_step(&mut self, x: &[f64], p: &mut [Vec<f64>], u: &mut [Vec<f64>], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    /// The same of a cycle, see [`Term::cycle_step`].
    pub fn cycle_step(
        &mut self,
        cycle: &Cycle,
        x: &[f64],
        p: &mut [Vec<f64>],
        u: &mut [Vec<f64>],
        grad: &mut [f64],
    ) -> LocalReport {
        grad.fill(0.0);
        let mut report = LocalReport::default();
        for ((term, p), u) in self.terms.iter_mut().zip(p).zip(u) {
            report += term.cycle_step(cycle, x, p, u, grad);
        }
        report.objective += self.quadratic.value_and_gradient(x, self.dim, Some(grad));
        report
    }

    /// The same where only the pull of p is asked for, see [`Term::pull_step`]: `pull` is overwritten with -D^T W^2 p, and f
    /// is not looked at.
    pub fn pull_step(
        &mut self,
        cycle: &Cycle,
        x: &[f64],
        p: &mut [Vec<f64>],
        u: &mut [Vec<f64>],
        pull: &mut [f64],
    ) -> LocalReport {
        if self.terms.is_empty() {
            pull.fill(0.0);
        }
        let mut report = LocalReport::default();
        for (t, ((term, p), u)) in self.terms.iter_mut().zip(p).zip(u).enumerate() {
            report += term.pull_step(cycle, x, p, u, pull, t == 0);
        }
        report
    }

    /// |l| |H(I)|_F, the characteristic gradient of Zhu, Bridson and Kaufman 2018, section 5: l holds for each free node the
    /// size of the border of its one-ring at rest (faces of tetrahedra that are opposite to it, edges of triangles), H(I) is
    /// the Hessian of the density over principal stretches at rest. Where materials differ, each element counts with its own.
    pub fn patch_gradient(&self) -> f64 {
        let mut size = vec![0.0; self.n_free];
        for term in &self.terms {
            let mut part = vec![0.0; self.n_free];
            term.add_characteristic_force(&mut part);
            let mut dimension = 0;
            term.for_each_element(&mut |nodes| dimension = nodes.len() - 1);
            // The face opposite to node i has the size K V |D_i|.
            vector::add_scaled(&mut size, dimension as f64 * term.scale().hessian, &part);
        }
        vector::norm(&size)
    }

    /// Over the free nodes: sum w^2 |D_i|^2, what the terms add to the diagonal of the normal matrix.
    pub fn node_stiffness(&self) -> Vec<f64> {
        let mut stiffness = vec![0.0; self.n_free];
        let none: [[u32; 0]; 0] = [];
        if let Ok(diagonal) = SymPattern::from_cliques(self.n_free, &none) {
            for term in &self.terms {
                term.add_normal(&diagonal, &mut stiffness);
            }
        }
        stiffness
    }

    /// The norm of a gradient over the free nodes along the equalities: what vanishes at a solution.
    pub fn gradient_norm(&self, grad: &mut [f64]) -> f64 {
        self.quadratic.equalities.project(grad, self.dim);
        vector::norm(grad)
    }

    /// The problem's characteristic gradient: the norm of the forces that a stress of the size of the rest stiffness
    /// would put on the free nodes, element by element. In the manner of Zhu et al. 2018, section 5.
    pub fn characteristic_gradient(&self) -> f64 {
        let mut size = vec![0.0; self.n_free];
        for term in &self.terms {
            term.add_characteristic_force(&mut size);
        }
        vector::norm(&size)
    }
}
