//! A chain of nodes on a line, tied by elements whose prox is a scalar equation: small enough for dense twins.

use proxel_linalg::sparse::SymPattern;
use proxel_split::{
    Admm, AdmmSettings, Direct, DualMap, EnergyReport, Equalities, Inertia, LocalReport, PenaltyReport, Problem,
    Quadratic, Residual, Scale, Term,
};

/// g(z) = w^2 phi(z), phi(z) = k/2 (z - 1)^2 + q/4 (z - 1)^4, within limits where there are some.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    pub k: f64,
    pub q: f64,
    pub limits: Option<(f64, f64)>,
}

impl Law {
    pub fn value(&self, z: f64) -> f64 {
        let e = z - 1.0;
        0.5 * self.k * e * e + 0.25 * self.q * e.powi(4)
    }

    pub fn slope(&self, z: f64) -> f64 {
        let e = z - 1.0;
        self.k * e + self.q * e.powi(3)
    }

    /// argmin phi(z) + 1/2 (z - v)^2
    pub fn prox(&self, v: f64) -> f64 {
        let mut z = v;
        for _ in 0..100 {
            let e = z - 1.0;
            let step = (self.slope(z) + z - v) / (self.k + 3.0 * self.q * e * e + 1.0);
            z -= step;
            if step.abs() <= 1e-16 * z.abs() {
                break;
            }
        }
        self.limits.map_or(z, |(low, high)| z.clamp(low, high))
    }
}

/// Elements between successive nodes: c(Dx) = (x_b - x_a) / length.
pub struct Chain {
    pub law: Law,
    pub pairs: Vec<(u32, u32)>,
    pub lengths: Vec<f64>,
    pub weight2: Vec<f64>,
}

impl Chain {
    fn stretch(&self, e: usize, x: &[f64]) -> f64 {
        let (a, b) = self.pairs[e];
        (x[b as usize] - x[a as usize]) / self.lengths[e]
    }

    fn add_force(&self, e: usize, force: f64, grad: &mut [f64]) {
        let (a, b) = self.pairs[e];
        for (node, f) in [(a, -force), (b, force)] {
            if let Some(g) = grad.get_mut(node as usize) {
                *g += f / self.lengths[e];
            }
        }
    }
}

impl Term for Chain {
    fn n_elems(&self) -> usize {
        self.pairs.len()
    }

    fn is_hard(&self) -> bool {
        self.law.limits.is_some()
    }

    fn local_len(&self) -> usize {
        self.pairs.len()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        (0..out.len()).for_each(|e| out[e] = self.stretch(e, x));
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let mut report = LocalReport::default();
        for e in 0..p.len() {
            let (c, w2, before) = (self.stretch(e, x), self.weight2[e], p[e] + u[e]);
            let v = c + u[e];
            let z = self.law.prox(v);
            report.value_before += w2 * self.law.value(before);
            report.value_after += w2 * self.law.value(z);
            report.penalty_before += 0.5 * w2 * (c - p[e]).powi(2);
            report.moved2 += w2 * (z - before).powi(2);
            report.gap2_before += w2 * (c - before).powi(2);
            report.gap2 += w2 * (c - z).powi(2);
            u[e] = v - z;
            p[e] = z - u[e];
            report.penalty_after += 0.5 * w2 * u[e] * u[e];
            report.objective += 0.5 * w2 * (c - p[e]).powi(2);
            self.add_force(e, w2 * (c - p[e]), grad);
        }
        report
    }

    fn dual_map(&self) -> DualMap {
        match self.law {
            Law { limits: Some(_), .. } => DualMap::None,
            Law { q: 0.0, .. } => DualMap::Affine,
            _ => DualMap::Smooth,
        }
    }

    fn dual(&mut self, z: &[f64], u: &mut [f64]) {
        u.iter_mut().zip(z).for_each(|(u, z)| *u = self.law.slope(*z));
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let mut value = 0.0;
        for (e, p) in p.iter().enumerate() {
            let gap = self.stretch(e, x) - p;
            value += 0.5 * self.weight2[e] * gap * gap;
            self.add_force(e, self.weight2[e] * gap, grad);
        }
        PenaltyReport { value, energy: None }
    }

    fn energy(&mut self, x: &[f64], mut grad: Option<&mut [f64]>) -> EnergyReport {
        let mut value = 0.0;
        for e in 0..self.pairs.len() {
            let c = self.stretch(e, x);
            value += self.weight2[e] * self.law.value(c);
            if let Some(grad) = grad.as_deref_mut() {
                self.add_force(e, self.weight2[e] * self.law.slope(c), grad);
            }
        }
        EnergyReport { value, ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let mut residual = Residual::default();
        for e in 0..p.len() {
            let z = p[e] + u[e];
            residual.gap2 += self.weight2[e] * (self.stretch(e, x) - z).powi(2);
            residual.size2 += self.weight2[e] * z * z;
        }
        residual
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.pairs.iter().for_each(|(a, b)| visit(&[*a, *b]));
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for (e, (a, b)) in self.pairs.iter().enumerate() {
            let k = self.weight2[e] / (self.lengths[e] * self.lengths[e]);
            for (i, j, k) in [(*a, *a, k), (*b, *b, k), (*a.max(b), *a.min(b), -k)] {
                if (i as usize) < pattern.n()
                    && let Some(slot) = pattern.slot(i as usize, j as usize)
                {
                    values[slot] += k;
                }
            }
        }
    }

    fn scale(&self) -> Scale {
        let (measure, weight2) = (self.lengths.iter().sum(), self.weight2.iter().sum());
        Scale { measure, weight2, energy: 0.5 * weight2, hessian: 1.0 }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.weight2);
    }
}

/// Free nodes of the chain; the last node is fixed.
pub const FREE: usize = 12;

/// A chain hung from its last node, with inertia of each free node unless there is to be none.
pub fn problem(law: Law, inertia: bool) -> Problem {
    let lengths: Vec<f64> = (0..FREE).map(|e| 0.6 + 0.1 * (e % 4) as f64).collect();
    let mut x0 = vec![0.0; FREE + 1];
    for e in (0..FREE).rev() {
        x0[e] = x0[e + 1] - lengths[e] * (1.0 + 0.3 * ((e * 7 % 5) as f64 - 2.0));
    }
    let chain = Chain {
        law,
        pairs: (0..FREE as u32).map(|e| (e, e + 1)).collect(),
        weight2: (0..FREE).map(|e| 1.0 + 0.5 * (e % 3) as f64).collect(),
        lengths,
    };
    let inertia = if inertia {
        let stiffness = (0..FREE).map(|i| 0.05 + 0.02 * (i % 5) as f64).collect();
        Inertia::new(stiffness, x0[..FREE].to_vec(), 1).expect("good numbers")
    } else {
        Inertia::default()
    };
    let loads = (0..=FREE).map(|i| if i < FREE { -0.05 } else { 0.0 }).collect();
    let quadratic = Quadratic { loads, inertia, equalities: Equalities::default(), ..Quadratic::default() };
    Problem { dim: 1, n_free: FREE, x0, terms: vec![Box::new(chain)], quadratic, barrier: false }
}

/// A law that is smooth, stiff and no quadratic.
pub const SMOOTH: Law = Law { k: 12.0, q: 30.0, limits: None };

/// The plain iteration.
pub fn admm(problem: Problem) -> Admm {
    let settings =
        AdmmSettings { name: "test".to_string(), global: Box::new(Direct), reweighting: None, renewed_at: None };
    Admm::new(problem, settings).expect("a chain that hangs on something")
}
