//! Hard limits of stretches as an augmented Lagrangian: what a Newton method on smooth functions makes of them.

use crate::elements::{ElementError, Rest};
use proxel_linalg::svd::{eig2_sym, eig3_sym};
use proxel_split::Potential;
use rayon::prelude::*;
use std::sync::Arc;

/// A symmetric matrix over an element's rest frame; rows and columns from K on are 0.
type Sym = [[f64; 3]; 3];
type V3 = [f64; 3];

/// An element with limits low <= s_i <= high of its principal stretches.
#[derive(Clone, Debug)]
struct Element {
    nodes: [u32; 4],
    dim: usize,     // K
    inverse: Sym,   // of the rest edges: F = sum_k (x_k - x_0) row_k
    measure: f64,   // V
    ends: [f64; 2], // (high^2 - 1)/2, (low^2 - 1)/2: limits of the eigenvalues of the Green strain
    stiffness: f64, // k
}

/// What is known of the stresses that hold an element within its limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Multipliers {
    upper: Sym,
    lower: Sym,
}

/// Elements with limits, to be given to [`StrainLimits::new`].
#[derive(Clone, Debug, Default)]
pub struct LimitedElements {
    elements: Vec<Element>,
}

impl LimitedElements {
    /// Adds simplices of K + 1 corners in space with limits 0 < low <= 1 <= high of their stretches. `rest` are rest
    /// positions, three numbers a node; `fill` is the part of each that is material.
    ///
    /// # Errors
    /// An element that cannot be used.
    pub fn add<const K: usize>(
        &mut self,
        rest: &[f64],
        elements: &[u32],
        fill: Option<&[f64]>,
        [low, high]: [f64; 2],
    ) -> Result<(), ElementError> {
        let rest = Rest::<3, K>::new(rest, elements)?;
        let ends = [high, low].map(|s| 0.5 * (s - 1.0) * (s + 1.0));
        for (e, corners) in elements.chunks_exact(K + 1).enumerate() {
            let mut nodes = [0; 4];
            nodes[..=K].copy_from_slice(corners);
            let mut inverse = [[0.0; 3]; 3];
            for (to, from) in inverse.iter_mut().zip(rest.inverse(e)) {
                to[..K].copy_from_slice(from);
            }
            let part = fill.and_then(|fill| fill.get(e)).copied().unwrap_or(1.0);
            let measure = rest.measure(e) * part;
            self.elements.push(Element { nodes, dim: K, inverse, measure, ends, stiffness: 0.0 });
        }
        Ok(())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.elements.is_empty()
    }
}

/// The augmented Lagrangian of the constraints low^2 <= C <= high^2 on C = F^T F of each element, matrices being compared
/// by their eigenvalues, written for the Green strain E = (C - 1)/2:
///
/// ```text
/// sum_e V/(2k) ( |[U + k (E - h)]_+|^2 - |U|^2  +  |[L + k (l - E)]_+|^2 - |L|^2 ),   h = (high^2 - 1)/2,  l = (low^2 - 1)/2
/// ```
///
/// with [.]_+ the nearest positive semidefinite matrix, and U and L symmetric multipliers: stresses (second Piola-Kirchhoff)
/// that hold the element. k is a stiffness of each element. It is once continuously differentiable, also where stretches
/// coincide, which an augmented Lagrangian of the stretches themselves is not; where its minimum is, U <- [U + k (E - h)]_+
/// is a better estimate (Shapiro and Sun 2004; Sun, Sun and Zhang 2008). The upper limit is convex in x, the lower one is
/// not: what of its curvature can be negative, the way out of the plane of a sheet that is pushed together, is a potential
/// of its own, [`Buckling`].
///
/// Elements with K < 3 are free to bend; a tetrahedron that is turned inside out has the C of one that is not, so that
/// inversion is for others to see.
#[derive(Clone, Debug)]
pub struct StrainLimits {
    elements: Arc<[Element]>,
    known: Arc<[Multipliers]>,
    growth: f64, // what k is multiplied by
    n: usize,
}

/// The second derivative -V L : dF^T dF of the lower limits, which is negative; its value and gradient are with
/// [`StrainLimits`].
#[derive(Clone, Debug)]
pub struct Buckling(StrainLimits);

/// An element where it is.
struct Place {
    f: [V3; 3], // columns of F
    upper: Half,
    lower: Half,
}

/// [M]_+ of one of its limits.
struct Half {
    q: Sym,        // eigenvectors of M as columns
    lambda: V3,    // eigenvalues
    positive: Sym, // [M]_+
}

impl StrainLimits {
    /// Without multipliers. `stiffness` of each node is what holds it besides, over length squared times measure summed over
    /// its elements: k of an element is `factor` times the mean of that over its free corners.
    pub fn new(limited: LimitedElements, node_stiffness: &[f64], factor: f64) -> Self {
        let mut elements = limited.elements;
        let mut own = vec![0.0; node_stiffness.len()]; // sum V |D_i|^2
        for element in &elements {
            for (node, g) in element.corners() {
                if let Some(own) = own.get_mut(node as usize) {
                    *own += element.measure * dot(&g, &g);
                }
            }
        }
        for element in &mut elements {
            let (mut sum, mut count) = (0.0, 0.0);
            for (node, _) in element.corners() {
                if let (Some(k), Some(own)) = (node_stiffness.get(node as usize), own.get(node as usize)) {
                    sum += k / own;
                    count += 1.0;
                }
            }
            element.stiffness = if count > 0.0 { factor * sum / count } else { 1.0 };
        }
        let n = elements.iter().flat_map(|e| &e.nodes[..=e.dim]).map(|v| *v as usize + 1).max().unwrap_or(0);
        StrainLimits {
            known: vec![Multipliers::default(); elements.len()].into(),
            elements: elements.into(),
            growth: 1.0,
            n,
        }
    }

    /// Whether nothing is limited.
    pub fn is_empty(&self) -> bool {
        self.elements.is_empty()
    }

    /// What its second derivatives lack.
    pub fn buckling(&self) -> Buckling {
        Buckling(self.clone())
    }

    /// With the multipliers that x shows, and how far those of before were from them, in strains: the largest
    /// |[U + k (E - h)]_+ - U| / k, which is 0 where limits hold and multipliers bear on them alone. At a point where the
    /// gradient of an objective with this potential vanishes as well, the conditions of Karush, Kuhn and Tucker hold.
    #[must_use]
    pub fn renewed(&self, x: &[f64]) -> (Self, f64) {
        let all: Vec<(Multipliers, f64)> = self
            .elements
            .par_iter()
            .zip(&self.known[..])
            .map(|(element, known)| {
                let place = element.at(known, self.growth, x);
                let new = Multipliers { upper: place.upper.positive, lower: place.lower.positive };
                let moved = distance(&new.upper, &known.upper).max(distance(&new.lower, &known.lower));
                (new, moved / (self.growth * element.stiffness))
            })
            .collect();
        let farthest = all.iter().fold(0.0, |most: f64, (_, moved)| if *moved <= most { most } else { *moved });
        let known = all.into_iter().map(|(new, _)| new).collect();
        (StrainLimits { known, ..self.clone() }, farthest)
    }

    /// With stiffnesses so many times as large.
    #[must_use]
    pub fn stiffer(self, factor: f64) -> Self {
        StrainLimits { growth: self.growth * factor, ..self }
    }

    /// Without multipliers, and with the stiffnesses of the start.
    #[must_use]
    pub fn forgotten(&self) -> Self {
        StrainLimits { known: vec![Multipliers::default(); self.elements.len()].into(), growth: 1.0, ..self.clone() }
    }

    /// The multipliers, twelve numbers an element: what [`Self::with`] takes.
    pub fn multipliers(&self) -> Vec<f64> {
        self.known.iter().flat_map(|m| [m.upper, m.lower]).flat_map(|m| ENTRIES.map(|(i, j)| m[i][j])).collect()
    }

    /// With these multipliers; none where they are not those of as many elements.
    #[must_use]
    pub fn with(&self, multipliers: &[f64]) -> Option<Self> {
        let (all, []) = multipliers.as_chunks::<12>() else { return None };
        let half = |v: &[f64]| {
            let mut m = [[0.0; 3]; 3];
            ENTRIES.iter().zip(v).for_each(|((i, j), v)| (m[*i][*j], m[*j][*i]) = (*v, *v));
            m
        };
        let known: Vec<Multipliers> =
            all.iter().map(|v| Multipliers { upper: half(&v[..6]), lower: half(&v[6..]) }).collect();
        (known.len() == self.elements.len()).then(|| StrainLimits { known: known.into(), growth: 1.0, ..self.clone() })
    }

    /// The norm of k V |D_i| over all corners of elements, what rounding of positions is multiplied by.
    pub fn penalty(&self) -> f64 {
        let of = |e: &Element| {
            e.corners().map(|(_, g)| (e.measure * self.growth * e.stiffness * dot(&g, &g)).powi(2)).sum::<f64>()
        };
        self.elements.iter().map(of).sum::<f64>().sqrt()
    }
}

/// Of a symmetric matrix.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// |a - b|
fn distance(a: &Sym, b: &Sym) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn dot(a: &V3, b: &V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// sum_ij a_i m_ij b_j
fn form(m: &Sym, a: &V3, b: &V3) -> f64 {
    (0..3).map(|i| a[i] * dot(&m[i], b)).sum()
}

impl Element {
    /// Nodes, and the rows D_i with F = sum_i x_i D_i.
    fn corners(&self) -> impl Iterator<Item = (u32, V3)> {
        let first = [0, 1, 2].map(|c| -(self.inverse[0][c] + self.inverse[1][c] + self.inverse[2][c]));
        let rows = [first, self.inverse[0], self.inverse[1], self.inverse[2]];
        self.nodes.into_iter().zip(rows).take(self.dim + 1)
    }

    fn at(&self, known: &Multipliers, growth: f64, x: &[f64]) -> Place {
        let mut f = [[0.0; 3]; 3];
        let point = |k: usize| -> V3 {
            let at = 3 * self.nodes[k] as usize;
            x.get(at..at + 3).map_or([f64::NAN; 3], |p| [p[0], p[1], p[2]])
        };
        let origin = point(0);
        for k in 0..self.dim {
            let p = point(k + 1);
            for (c, column) in f.iter_mut().enumerate() {
                (0..3).for_each(|d| column[d] += (p[d] - origin[d]) * self.inverse[k][c]);
            }
        }
        let k = growth * self.stiffness;
        let mut upper = known.upper;
        let mut lower = known.lower;
        for i in 0..self.dim {
            for j in 0..self.dim {
                let one = f64::from(u8::from(i == j));
                let strain = 0.5 * (dot(&f[i], &f[j]) - one);
                upper[i][j] += k * (strain - one * self.ends[0]);
                lower[i][j] += k * (one * self.ends[1] - strain);
            }
        }
        Place { f, upper: Half::of(&upper, self.dim), lower: Half::of(&lower, self.dim) }
    }
}

impl Half {
    fn of(m: &Sym, dim: usize) -> Half {
        let (mut q, mut lambda) = ([[0.0; 3]; 3], [0.0; 3]);
        match dim {
            1 => (q[0][0], lambda[0]) = (1.0, m[0][0]),
            2 => {
                let e = eig2_sym([m[0][0], m[1][1], m[0][1]]);
                for i in 0..2 {
                    lambda[i] = e.lambda[i];
                    q[i][..2].copy_from_slice(&e.q[i]);
                }
            }
            _ => {
                let e = eig3_sym([m[0][0], m[1][1], m[2][2], m[0][1], m[0][2], m[1][2]]);
                (q, lambda) = (e.q, e.lambda);
            }
        }
        let mut positive = [[0.0; 3]; 3];
        for (n, lambda) in lambda.iter().enumerate().filter(|(_, lambda)| **lambda > 0.0 || lambda.is_nan()) {
            for i in 0..3 {
                for j in 0..3 {
                    positive[i][j] += lambda * q[i][n] * q[j][n];
                }
            }
        }
        Half { q, lambda, positive }
    }

    /// What the derivative of [.]_+ multiplies entry ij of a change by, in the frame of the eigenvectors.
    fn slope(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (self.lambda[i].max(self.lambda[j]), self.lambda[i].min(self.lambda[j]));
        match () {
            () if b > 0.0 => 1.0,
            () if a > 0.0 => a / (a - b),
            () => 0.0,
        }
    }

    /// Adds k/2 sum_ij slope_ij gp_j f_i (f_i gq_j + f_j gq_i)^T: the change of stress with strain, between two corners.
    fn add_block(&self, dim: usize, k: f64, f: &[V3; 3], (gp, gq): (&V3, &V3), block: &mut Sym) {
        if self.lambda[..dim].iter().all(|l| *l <= 0.0) {
            return;
        }
        let turned = |g: &V3| -> V3 { std::array::from_fn(|n| (0..dim).map(|c| self.q[c][n] * g[c]).sum()) };
        let (gp, gq) = (turned(gp), turned(gq));
        let columns: [V3; 3] =
            std::array::from_fn(|n| std::array::from_fn(|d| (0..dim).map(|c| self.q[c][n] * f[c][d]).sum()));
        for i in 0..dim {
            for j in 0..dim {
                let scale = 0.5 * k * self.slope(i, j) * gp[j];
                let other: V3 = std::array::from_fn(|d| columns[i][d] * gq[j] + columns[j][d] * gq[i]);
                for r in 0..3 {
                    for c in 0..3 {
                        block[r][c] += scale * columns[i][r] * other[c];
                    }
                }
            }
        }
    }
}

/// <[M]_+ - known, [M]_+ + known>, which does not cancel near the solution.
fn gained(half: &Half, known: &Sym) -> f64 {
    let mut sum = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            sum += (half.positive[i][j] - known[i][j]) * (half.positive[i][j] + known[i][j]);
        }
    }
    sum
}

impl Potential for StrainLimits {
    fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64 {
        let wanted = grad.is_some();
        let of = |(element, known): (&Element, &Multipliers)| -> (f64, [V3; 4]) {
            let place = element.at(known, self.growth, x);
            let gain = gained(&place.upper, &known.upper) + gained(&place.lower, &known.lower);
            let value = element.measure * gain / (2.0 * self.growth * element.stiffness);
            let mut forces = [[0.0; 3]; 4];
            if wanted {
                // F S D_i^T, S the stress of both limits.
                let (u, l) = (&place.upper.positive, &place.lower.positive);
                for ((_, g), force) in element.corners().zip(&mut forces) {
                    for c in 0..element.dim {
                        let along: f64 = (0..element.dim).map(|j| (u[c][j] - l[c][j]) * g[j]).sum();
                        (0..3).for_each(|d| force[d] += element.measure * place.f[c][d] * along);
                    }
                }
            }
            (value, forces)
        };
        let all: Vec<(f64, [V3; 4])> = self.elements.par_iter().zip(&self.known[..]).map(of).collect();
        if let Some(grad) = grad {
            for (element, (_, forces)) in self.elements.iter().zip(&all) {
                for (node, force) in element.nodes.iter().zip(forces).take(element.dim + 1) {
                    let at = 3 * *node as usize;
                    if let Some(g) = grad.get_mut(at..at + 3) {
                        g.iter_mut().zip(force).for_each(|(g, f)| *g += f);
                    }
                }
            }
        }
        all.iter().map(|(value, _)| value).sum()
    }

    fn n(&self) -> usize {
        self.n
    }

    fn has_hessian(&self) -> bool {
        true
    }

    fn is_convex(&self) -> bool {
        true
    }

    /// Without what [`Buckling`] has.
    fn for_each_block(&self, x: &[f64], give: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        for (element, known) in self.elements.iter().zip(&self.known[..]) {
            let place = element.at(known, self.growth, x);
            let k = element.measure * self.growth * element.stiffness;
            element.for_each_pair(&mut |i, j, gp, gq| {
                let along = element.measure * form(&place.upper.positive, gp, gq);
                let mut block = [[along, 0.0, 0.0], [0.0, along, 0.0], [0.0, 0.0, along]];
                place.upper.add_block(element.dim, k, &place.f, (gp, gq), &mut block);
                place.lower.add_block(element.dim, k, &place.f, (gp, gq), &mut block);
                give(i, j, block);
            });
        }
    }
}

impl Element {
    /// Pairs of corners, the node with the larger number first.
    fn for_each_pair(&self, visit: &mut dyn FnMut(usize, usize, &V3, &V3)) {
        for (a, (p, gp)) in self.corners().enumerate() {
            for (q, gq) in self.corners().take(a + 1) {
                match p >= q {
                    true => visit(p as usize, q as usize, &gp, &gq),
                    false => visit(q as usize, p as usize, &gq, &gp),
                }
            }
        }
    }
}

impl Potential for Buckling {
    fn value_and_gradient(&self, _: &[f64], _: Option<&mut [f64]>) -> f64 {
        0.0
    }

    fn n(&self) -> usize {
        self.0.n
    }

    fn has_hessian(&self) -> bool {
        true
    }

    fn for_each_block(&self, x: &[f64], give: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        for (element, known) in self.0.elements.iter().zip(&self.0.known[..]) {
            let place = element.at(known, self.0.growth, x);
            element.for_each_pair(&mut |i, j, gp, gq| {
                let along = -element.measure * form(&place.lower.positive, gp, gq);
                give(i, j, [[along, 0.0, 0.0], [0.0, along, 0.0], [0.0, 0.0, along]]);
            });
        }
    }
}
