//! An energy of one's own over tetrahedra: a function of deformation gradients, for methods that ask for energies
//! and gradients only.

use super::DeformError;
use super::elements::Cells;
use crate::settings::{DeformSettings, MethodName};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{EnergyReport, Hardening, LocalReport, PenaltyReport, Residual, Scale, Term};
use std::sync::Arc;

/// A 3 x 3 matrix by rows.
pub type Matrix = [[f64; 3]; 3];

/// A density psi(F) over the rest volume, and its derivative, the first Piola-Kirchhoff stress.
///
/// It is asked for all tetrahedra at once, in the order of the mesh.
pub trait ElementEnergy: Send + Sync {
    /// values <- psi(F), stresses <- d psi / d F. Where psi is infinite or cannot be computed the value is not
    /// finite, and the stress counts for nothing.
    fn evaluate(&self, gradients: &[Matrix], values: &mut [f64], stresses: &mut [Matrix]);

    /// Whether psi is infinite where det F <= 0, so that no solution has an inverted element.
    fn is_barrier(&self) -> bool {
        false
    }
}

/// An [`ElementEnergy`] that inputs share.
#[derive(Clone)]
pub struct OwnEnergy(pub Arc<dyn ElementEnergy>);

impl std::fmt::Debug for OwnEnergy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("OwnEnergy")
    }
}

/// Whether it can be minimised over these elements by this method.
///
/// # Errors
/// A sentence that names what cannot be and the remedy.
pub(super) fn check(name: &str, filled: bool, kinds: &[Cells], settings: &DeformSettings) -> Result<(), DeformError> {
    if !matches!(settings.method, MethodName::Lbfgs | MethodName::Bcqn) {
        let method = settings.method.as_str();
        let text = format!("{name}: {method} needs more of an energy than its gradient; use --method lbfgs or bcqn");
        return Err(DeformError(text));
    }
    if filled || !matches!(kinds, [Cells::Tets(_)]) {
        let text = format!("{name}: an energy of one's own is one of tetrahedra; give a mesh of tetrahedra alone");
        return Err(DeformError(text));
    }
    match settings.strain_limit {
        Some(_) => Err(DeformError(format!(
            "{name}: {} cannot hold hard limits; leave out strain_limit",
            settings.method.as_str()
        ))),
        None => Ok(()),
    }
}

/// A term whose energy is one's own. Its stiffness, and with it the matrix that preconditions, is that of `like`, a
/// batch of the same elements with a material.
pub(crate) struct OwnTerm {
    like: Box<dyn Term>,
    energy: OwnEnergy,
    elements: Vec<[u32; 4]>, // nodes
    inverse: Vec<Matrix>,    // of the rest edges from corner 0, as columns
    volume: Vec<f64>,        // at rest
    first: Vec<u32>,         // where the places of each node begin
    places: Vec<(u32, u8)>,  // of a node: element and corner
    gradients: Vec<Matrix>,  // F
    values: Vec<f64>,        // psi
    stresses: Vec<Matrix>,   // d psi / d F
}

impl OwnTerm {
    /// Of elements over flat rest positions `x`, three numbers a node.
    pub fn new(like: Box<dyn Term>, energy: OwnEnergy, elements: Vec<[u32; 4]>, x: &[f64]) -> Self {
        let edges: Vec<Matrix> = elements.iter().map(|e| edges(e, x)).collect();
        let n = elements.len();
        let mut first = vec![0u32; x.len() / 3 + 1];
        for v in elements.as_flattened() {
            first[*v as usize + 1] += 1;
        }
        for v in 1..first.len() {
            first[v] += first[v - 1];
        }
        let mut next = first.clone();
        let mut places = vec![(0, 0); 4 * n];
        for (e, nodes) in elements.iter().enumerate() {
            for (corner, v) in nodes.iter().enumerate() {
                let at = &mut next[*v as usize];
                places[*at as usize] = (e as u32, corner as u8);
                *at += 1;
            }
        }
        OwnTerm {
            like,
            energy,
            inverse: edges.iter().map(inverse).collect(),
            volume: edges.iter().map(|m| determinant(m) / 6.0).collect(),
            first,
            places,
            gradients: vec![[[0.0; 3]; 3]; n],
            values: vec![0.0; n],
            stresses: vec![[[0.0; 3]; 3]; n],
            elements,
        }
    }

    /// The force on corner i: V P D_i with D_i row i - 1 of the inverse, and minus the sum of the others at corner 0.
    fn force(&self, element: usize, corner: u8) -> [f64; 3] {
        let (d, p) = (&self.inverse[element], &self.stresses[element]);
        let shape: [f64; 3] = match corner {
            0 => [0, 1, 2].map(|j| -(d[0][j] + d[1][j] + d[2][j])),
            i => d[usize::from(i) - 1],
        };
        [0, 1, 2].map(|r| self.volume[element] * (p[r][0] * shape[0] + p[r][1] * shape[1] + p[r][2] * shape[2]))
    }
}

impl Term for OwnTerm {
    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        // Signs and stretches do not depend on the energy.
        let mut report = self.like.energy(x, None);
        for ((f, e), d) in self.gradients.iter_mut().zip(&self.elements).zip(&self.inverse) {
            *f = product(&edges(e, x), d);
        }
        self.energy.0.evaluate(&self.gradients, &mut self.values, &mut self.stresses);
        report.value = self.values.iter().zip(&self.volume).map(|(psi, v)| psi * v).sum();
        let Some(grad) = grad else { return report };
        for (v, g) in grad.chunks_exact_mut(3).enumerate() {
            for k in self.first[v]..self.first[v + 1] {
                let (element, corner) = self.places[k as usize];
                let force = self.force(element as usize, corner);
                for d in 0..3 {
                    g[d] += force[d];
                }
            }
        }
        report
    }

    fn n_elems(&self) -> usize {
        self.like.n_elems()
    }
    fn local_len(&self) -> usize {
        self.like.local_len()
    }
    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        self.like.couple(x, out);
    }
    // Methods that split are refused where the term is made.
    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let report = self.like.local_step(x, p, u, grad);
        LocalReport { missed: self.elements.len() as u64, ..report }
    }
    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        PenaltyReport { energy: None, ..self.like.penalty(x, p, grad) }
    }
    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        self.like.residual(x, p, u)
    }
    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.like.for_each_element(visit);
    }
    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        self.like.add_normal(pattern, values);
    }
    fn add_characteristic_force(&self, size: &mut [f64]) {
        self.like.add_characteristic_force(size);
    }
    fn scale(&self) -> Scale {
        self.like.scale()
    }
    fn local_weights2(&self, out: &mut [f64]) {
        self.like.local_weights2(out);
    }
    fn propose_weights(&mut self, range: (f64, f64)) -> f64 {
        self.like.propose_weights(range)
    }
    fn harden(&mut self, rule: &Hardening, x: &[f64], p: &[f64], u: &[f64]) -> bool {
        self.like.harden(rule, x, p, u)
    }
    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        self.like.take_weights(p, u);
    }
}

/// The edges from corner 0, as columns.
fn edges(e: &[u32; 4], x: &[f64]) -> Matrix {
    let at = |k: usize, d: usize| x[3 * e[k] as usize + d];
    [0, 1, 2].map(|d| [1, 2, 3].map(|k| at(k, d) - at(0, d)))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j]))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn determinant(m: &Matrix) -> f64 {
    let c = cross(m[1], m[2]);
    m[0][0] * c[0] + m[0][1] * c[1] + m[0][2] * c[2]
}

/// By cross products of rows: the columns of the inverse, over the determinant, which checks of the mesh keep above 0.
fn inverse(m: &Matrix) -> Matrix {
    let columns = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    let d = determinant(m);
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| columns[j][i] / d))
}
