//! Tetrahedra split with a metric: a [`Term`] for the methods of the splitting engine.

use super::moduli::{Matrix, Moduli, trace};
use super::traced::Traced;
use proxel::linalg::sparse::SymPattern;
use proxel::model::elements::{Decomposed, ElementError, Elements, Polar, Rest, Shape, Simplex};
use proxel::model::energy::{Energy, largest_eigenvalue};
use proxel::split::{EnergyReport, Hardening, LocalReport, PenaltyReport, Residual, Scale, Term};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use std::sync::{Arc, Mutex, PoisonError};

/// Numbers of a local value: the diagonal, and sqrt 2 times what is above it.
const LOCAL: usize = 6;
/// Where they are, beyond the diagonal.
const ABOVE: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];
/// s_i + s_j below this part of s_1 is taken as this, as in the engine's polar coupling.
const LEAST_SUM: f64 = 1e-6;
/// Hardening never raises candidates past this factor.
const HARDEST: f64 = 4.0;

/// What candidate moduli are, up to a factor that is 1 for an element at rest whose moduli are the base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidates {
    /// Both base moduli times the ratio of the largest eigenvalue of the Hessian to that at rest: scalar weights follow
    /// the stiffness like this by default.
    Largest,
    /// Each base modulus times the ratio of its curvature, [`Moduli::of_hessian`], to that at rest.
    Each,
    /// Both times the ratio of the geometric means of the largest and the smallest eigenvalue of the Hessian.
    GeometricMean,
}

/// What does not change of an element.
pub(super) struct Corners {
    pub nodes: [u32; 4],
    pub gradients: [[f64; 3]; 4], // of the barycentric coordinates
    pub volume: f64,
}

impl Corners {
    /// F at x.
    pub fn deformation_gradient(&self, x: &[f64]) -> Matrix {
        let mut f = [[0.0; 3]; 3];
        for (node, g) in self.nodes.iter().zip(&self.gradients) {
            let at = &x[3 * *node as usize..][..3];
            for (row, v) in f.iter_mut().zip(at) {
                for (entry, g) in row.iter_mut().zip(g) {
                    *entry += v * g;
                }
            }
        }
        f
    }

    /// Adds V P D to the gradient, P being a derivative in F.
    fn add_forces(&self, p: &Matrix, grad: &mut [f64]) {
        for (node, g) in self.nodes.iter().zip(&self.gradients) {
            if let Some(to) = grad.get_mut(3 * *node as usize..3 * *node as usize + 3) {
                for (to, row) in to.iter_mut().zip(p) {
                    *to += self.volume * (row[0] * g[0] + row[1] * g[1] + row[2] * g[2]);
                }
            }
        }
    }
}

/// What a global step in vector form needs of the elements.
#[derive(Clone)]
pub(super) struct Shared {
    pub corners: Arc<Vec<Corners>>,
    pub moduli: Arc<Mutex<Vec<Moduli>>>,
}

/// sum V psi over tetrahedra, split by the polar coupling in the metric of their moduli.
pub struct MetricElements<E> {
    energy: E,
    plain: Elements<3, 3, Polar>, // for energies and sizes
    corners: Arc<Vec<Corners>>,
    base: Moduli,
    candidates: Candidates,
    mix: f64,
    moduli: Arc<Mutex<Vec<Moduli>>>,
    proposed: Vec<Moduli>,
    hardened: Vec<f64>,
    stretches: Vec<[f64; 3]>, // of z
}

impl<E: Energy<3>> MetricElements<E> {
    /// Tetrahedra at rest with base moduli, their candidates, and the scalar k = d + mix (v - d) that stands for the metric
    /// in the normal matrix.
    ///
    /// # Errors
    /// As [`Rest::new`].
    pub fn new(
        positions: &[f64],
        tets: &[u32],
        energy: E,
        base: Moduli,
        candidates: Candidates,
        mix: f64,
    ) -> Result<Self, ElementError> {
        let rest = Rest::<3, 3>::new(positions, tets)?;
        let corners: Vec<Corners> = tets
            .chunks_exact(4)
            .enumerate()
            .map(|(e, nodes)| {
                let mut gradients = [[0.0; 3]; 4];
                for (k, row) in rest.inverse(e).iter().enumerate() {
                    for (c, v) in row.iter().enumerate() {
                        gradients[k + 1][c] = *v;
                        gradients[0][c] -= v;
                    }
                }
                Corners { nodes: [nodes[0], nodes[1], nodes[2], nodes[3]], gradients, volume: rest.measure(e) }
            })
            .collect();
        let n = corners.len();
        Ok(MetricElements {
            plain: Elements::new(&rest, energy.clone(), energy.rest_stiffness()),
            energy,
            corners: Arc::new(corners),
            base,
            candidates,
            mix,
            moduli: Arc::new(Mutex::new(vec![base; n])),
            proposed: vec![base; n],
            hardened: vec![1.0; n],
            stretches: vec![[1.0; 3]; n],
        })
    }

    /// For [`super::VectorForm`].
    pub(super) fn shared(&self) -> Shared {
        Shared { corners: self.corners.clone(), moduli: self.moduli.clone() }
    }

    fn moduli(&self) -> Vec<Moduli> {
        self.moduli.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The curvatures of psi at s in the units of the candidates.
    fn stiffness(&self, s: [f64; 3]) -> Moduli {
        match self.candidates {
            Candidates::Largest => Moduli::scalar(self.energy.effective_stiffness(s)),
            Candidates::Each => Moduli::of_hessian(&self.energy, s),
            Candidates::GeometricMean => {
                let h = self.energy.hessian(s);
                let least = -largest_eigenvalue(&h.map(|row| row.map(|v| -v)));
                Moduli::scalar((self.energy.effective_stiffness(s) * least.max(0.0)).sqrt())
            }
        }
    }
}

/// The symmetric matrix of a local value.
fn load(from: &[f64]) -> Matrix {
    let mut a = [[from[0], 0.0, 0.0], [0.0, from[1], 0.0], [0.0, 0.0, from[2]]];
    for ((i, j), v) in ABOVE.into_iter().zip(&from[3..]) {
        a[i][j] = v * FRAC_1_SQRT_2;
        a[j][i] = a[i][j];
    }
    a
}

/// Back.
fn store(a: &Matrix, to: &mut [f64]) {
    for i in 0..3 {
        to[i] = a[i][i];
    }
    for ((i, j), to) in ABOVE.into_iter().zip(&mut to[3..]) {
        *to = a[i][j] * SQRT_2;
    }
}

/// a + c b
fn plus(a: &Matrix, c: f64, b: &Matrix) -> Matrix {
    let mut sum = *a;
    for (row, b) in sum.iter_mut().zip(b) {
        for (v, b) in row.iter_mut().zip(b) {
            *v += c * b;
        }
    }
    sum
}

/// A H B^T
fn sandwich(a: &Matrix, h: &Matrix, b: &Matrix) -> Matrix {
    let mut out = [[0.0; 3]; 3];
    for r in 0..3 {
        for c in 0..3 {
            for i in 0..3 {
                for j in 0..3 {
                    out[r][c] += a[r][i] * h[i][j] * b[c][j];
                }
            }
        }
    }
    out
}

fn transposed(a: &Matrix) -> Matrix {
    let mut t = *a;
    for i in 0..3 {
        for j in 0..3 {
            t[i][j] = a[j][i];
        }
    }
    t
}

/// V diag(s) V^T
fn symmetric(v: &Matrix, s: &[f64; 3]) -> Matrix {
    sandwich(v, &[[s[0], 0.0, 0.0], [0.0, s[1], 0.0], [0.0, 0.0, s[2]]], v)
}

/// s_i + s_j, bounded from below.
pub(super) fn pair_sum(s: &[f64; 3], i: usize, j: usize) -> f64 {
    (s[i] + s[j]).max((s[0].abs() * LEAST_SUM).max(f64::MIN_POSITIVE))
}

/// The gradient in F of 1/2 |sym(F) - P|_M^2: U H V^T with H_ij = 2 s_i/(s_i + s_j) v_i^T M(S - P) v_j, W(13)-(16).
fn penalty_gradient(at: &Decomposed<f64, 3, 3>, p: &Matrix, moduli: Moduli) -> Matrix {
    let stretch = symmetric(&at.v, &at.s);
    let gap = plus(&stretch, -1.0, p);
    let mut stress = gap.map(|row| row.map(|v| moduli.deviatoric * v));
    for (i, row) in stress.iter_mut().enumerate() {
        row[i] += moduli.of_trace() * trace(&gap);
    }
    let vt = transposed(&at.v);
    let mut h = sandwich(&vt, &stress, &vt);
    for (i, j) in ABOVE {
        let c = 2.0 * h[i][j] / pair_sum(&at.s, i, j);
        h[i][j] = c * at.s[i];
        h[j][i] = c * at.s[j];
    }
    sandwich(&at.u, &h, &at.v)
}

impl<E: Energy<3>> Term for MetricElements<E> {
    fn n_elems(&self) -> usize {
        self.corners.len()
    }

    fn local_len(&self) -> usize {
        LOCAL * self.corners.len()
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        for (corners, out) in self.corners.iter().zip(out.chunks_exact_mut(LOCAL)) {
            let at = Simplex::svd(corners.deformation_gradient(x));
            store(&symmetric(&at.v, &at.s), out);
        }
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let mut report = LocalReport::default();
        let (corners, moduli) = (self.corners.clone(), self.moduli());
        for (e, (p, u)) in p.chunks_exact_mut(LOCAL).zip(u.chunks_exact_mut(LOCAL)).enumerate() {
            let (volume, metric) = (corners[e].volume, moduli[e]);
            let at = Simplex::svd(corners[e].deformation_gradient(x));
            let stretch = symmetric(&at.v, &at.s);
            let before = plus(&load(p), 1.0, &load(u));
            let v = plus(&stretch, 1.0, &load(u));
            let (_, s_before): (Matrix, [f64; 3]) = Simplex::eigen(before);
            let (frame, s): (Matrix, [f64; 3]) = Simplex::eigen(v);
            let energy = Traced { energy: self.energy.clone(), factor: metric.of_trace(), target: trace(&v) };
            let prox = energy.prox(s, metric.deviatoric, self.stretches[e]);
            self.stretches[e] = prox.s;
            let z = symmetric(&frame, &prox.s);
            let dual = plus(&v, -1.0, &z);
            let aim = plus(&z, -1.0, &dual);
            report.value_before += volume * self.energy.value(s_before);
            report.value_after += volume * self.energy.value(prox.s);
            report.penalty_before += 0.5 * volume * metric.norm2(&plus(&v, -1.0, &before));
            report.penalty_after += 0.5 * volume * metric.norm2(&dual);
            report.objective += 0.5 * volume * metric.norm2(&plus(&stretch, -1.0, &aim));
            report.moved2 += volume * metric.norm2(&plus(&z, -1.0, &before));
            report.gap2_before += volume * metric.norm2(&plus(&stretch, -1.0, &before));
            report.gap2 += volume * metric.norm2(&plus(&stretch, -1.0, &z));
            report.missed += u64::from(!prox.converged);
            corners[e].add_forces(&penalty_gradient(&at, &aim, metric), grad);
            store(&dual, u);
            store(&aim, p);
        }
        report
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let mut value = 0.0;
        let moduli = self.moduli();
        for ((corners, metric), p) in self.corners.iter().zip(moduli).zip(p.chunks_exact(LOCAL)) {
            let at = Simplex::svd(corners.deformation_gradient(x));
            let p = load(p);
            value += 0.5 * corners.volume * metric.norm2(&plus(&symmetric(&at.v, &at.s), -1.0, &p));
            corners.add_forces(&penalty_gradient(&at, &p, metric), grad);
        }
        PenaltyReport { value, energy: None }
    }

    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        self.plain.energy(x, grad)
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let mut residual = Residual::default();
        let locals = p.chunks_exact(LOCAL).zip(u.chunks_exact(LOCAL));
        for ((corners, metric), (p, u)) in self.corners.iter().zip(self.moduli()).zip(locals) {
            let at = Simplex::svd(corners.deformation_gradient(x));
            let z = plus(&load(p), 1.0, &load(u));
            residual.gap2 += corners.volume * metric.norm2(&plus(&symmetric(&at.v, &at.s), -1.0, &z));
            residual.size2 += corners.volume * metric.norm2(&z);
        }
        residual
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.corners.iter().for_each(|corners| visit(&corners.nodes));
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for (corners, metric) in self.corners.iter().zip(self.moduli()) {
            let k = metric.deviatoric + self.mix * (metric.volumetric - metric.deviatoric);
            for a in 0..4 {
                for b in 0..=a {
                    let (i, j) = (corners.nodes[a].max(corners.nodes[b]), corners.nodes[a].min(corners.nodes[b]));
                    if (i as usize) < pattern.n()
                        && let Some(slot) = pattern.slot(i as usize, j as usize)
                    {
                        let (g, h) = (corners.gradients[a], corners.gradients[b]);
                        values[slot] += k * corners.volume * (g[0] * h[0] + g[1] * h[1] + g[2] * h[2]);
                    }
                }
            }
        }
    }

    fn add_characteristic_force(&self, size: &mut [f64]) {
        self.plain.add_characteristic_force(size);
    }

    fn scale(&self) -> Scale {
        self.plain.scale()
    }

    /// The Euclidean part alone: accelerators, which are not used with a metric, would take it for all.
    fn local_weights2(&self, out: &mut [f64]) {
        for ((corners, metric), out) in self.corners.iter().zip(self.moduli()).zip(out.chunks_exact_mut(LOCAL)) {
            out.fill(corners.volume * metric.deviatoric);
        }
    }

    fn propose_weights(&mut self, range: (f64, f64)) -> f64 {
        let rest = self.stiffness([1.0; 3]);
        let moduli = self.moduli();
        let mut ratio = 1.0_f64;
        for e in 0..moduli.len() {
            let now = self.stiffness(self.stretches[e]);
            let candidate = Moduli {
                deviatoric: self.base.deviatoric * now.deviatoric / rest.deviatoric,
                volumetric: self.base.volumetric * now.volumetric / rest.volumetric,
            };
            self.proposed[e] = candidate.scaled(self.hardened[e]).clamped(self.base, range);
            ratio = ratio.max(self.proposed[e].ratio(moduli[e]));
        }
        ratio
    }

    fn harden(&mut self, rule: &Hardening, x: &[f64], p: &[f64], u: &[f64]) -> bool {
        let moduli = self.moduli();
        let locals = p.chunks_exact(LOCAL).zip(u.chunks_exact(LOCAL));
        let gaps: Vec<f64> = self
            .corners
            .iter()
            .zip(moduli)
            .zip(locals)
            .map(|((corners, metric), (p, u))| {
                let at = Simplex::svd(corners.deformation_gradient(x));
                let z = plus(&load(p), 1.0, &load(u));
                corners.volume * metric.norm2(&plus(&symmetric(&at.v, &at.s), -1.0, &z))
            })
            .collect();
        let open = self.hardened.iter().zip(&gaps).filter(|(hardened, _)| **hardened < HARDEST);
        let most = open.map(|(_, gap2)| *gap2).fold(0.0, f64::max);
        let least = (rule.above * gaps.iter().sum::<f64>() / gaps.len() as f64).min(0.5 * most);
        let mut raised = false;
        for (hardened, gap2) in self.hardened.iter_mut().zip(&gaps) {
            if *gap2 >= least && *hardened < HARDEST {
                *hardened = (*hardened * rule.factor).min(HARDEST);
                raised = true;
            }
        }
        raised
    }

    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        let before = self.moduli();
        for (e, (p, u)) in p.chunks_exact_mut(LOCAL).zip(u.chunks_exact_mut(LOCAL)).enumerate() {
            let dual = load(u);
            let z = plus(&load(p), 1.0, &dual);
            let dual = before[e].carried_over(self.proposed[e], &dual);
            store(&dual, u);
            store(&plus(&z, -1.0, &dual), p);
        }
        self.moduli.lock().unwrap_or_else(PoisonError::into_inner).copy_from_slice(&self.proposed);
    }
}
