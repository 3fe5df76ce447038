//! How forces answer to everything that they depend on: what an adjoint is made of.

use super::rest::{ElementError, Rest};
use super::stretch_hessian::KINK;
use super::{BatchShape, Shape, Simplex};
use crate::energy::{Energy, EnergyVisitor, Lame, UnknownEnergy, visit_1d, visit_2d, visit_3d};
use rayon::prelude::*;

/// Elements at positions x, and a step w from there.
///
/// With F = Ds B and W = Dw B, where Ds and Dw are the edges of x and of w and B is the inverse of the rest edges, the
/// power of the forces along w is
///
/// ```text
/// phi = d/dt E(x + t w) = sum_e V_e (P(F_e) : W_e + c_e),    P = d psi / dF
/// ```
///
/// [`Step::sensitivity`] is the gradient of phi in x, in the rest shapes and in the moduli. Where H w = dL/dx and the
/// forces vanish, dL/d(anything else) = -d phi/d(that): the implicit function theorem.
#[derive(Clone, Copy)]
pub struct Step<'a> {
    /// What the elements are.
    pub shape: BatchShape,
    /// Rest positions, flat, as many numbers a node as the shape has dimensions.
    pub positions: &'a [f64],
    /// Rest shapes of planar triangles (edges from corner 0 as columns) in the place of `positions`.
    pub shapes: Option<&'a [[[f64; 2]; 2]]>,
    /// Nodes, flat.
    pub elements: &'a [u32],
    /// A factor of V for each element, such as [`super::Batch::fill`]; 1 without it.
    pub fill: Option<&'a [f64]>,
    /// c, what moves with the measure of each element besides, such as its weight along w; 0 without it.
    pub per_measure: Option<&'a [f64]>,
    /// Name of the energy.
    pub energy: &'a str,
    /// Its moduli.
    pub lame: &'a Lame,
    /// Positions, flat.
    pub x: &'a [f64],
    /// The step, of the length of x.
    pub w: &'a [f64],
}

/// The gradient of phi, see [`Step`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensitivity {
    /// d phi / dx = H w, of the length of x.
    pub x: Vec<f64>,
    /// d phi / d(rest positions), of the length of x; empty where rest shapes were given.
    pub rest: Vec<f64>,
    /// d phi / d(rest shape) of each element where rest shapes were given, else empty.
    pub shapes: Vec<[[f64; 2]; 2]>,
    /// d phi / d mu at constant lambda.
    pub mu: f64,
    /// d phi / d lambda at constant mu.
    pub lambda: f64,
}

/// Why there is no sensitivity.
#[derive(Clone, Debug, PartialEq)]
pub enum SensitivityError {
    /// An element that cannot be used.
    Element(ElementError),
    /// An energy that is not known for the shape.
    Energy(UnknownEnergy),
    /// An element, counted from 0, at which the energy has no second derivative.
    Kink(usize),
}

impl std::fmt::Display for SensitivityError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            SensitivityError::Element(e) => e.fmt(f),
            SensitivityError::Energy(e) => e.fmt(f),
            SensitivityError::Kink(e) => {
                write!(f, "the energy of element {e} (0-based) has no second derivative where it is; forces jump there")
            }
        }
    }
}

impl std::error::Error for SensitivityError {}

impl From<ElementError> for SensitivityError {
    fn from(e: ElementError) -> Self {
        SensitivityError::Element(e)
    }
}

impl Step<'_> {
    /// The gradient of phi. The same bits on any number of threads.
    ///
    /// # Errors
    /// An element that cannot be used or has no second derivative, an energy that is not known.
    pub fn sensitivity(&self) -> Result<Sensitivity, SensitivityError> {
        match (self.shape, self.shapes) {
            (BatchShape::Tetrahedra, _) => self.of(Rest::<3, 3>::new(self.positions, self.elements)?, visit_3d),
            (BatchShape::Triangles, _) => self.of(Rest::<3, 2>::new(self.positions, self.elements)?, visit_2d),
            (BatchShape::PlanarTriangles, None) => self.of(Rest::<2, 2>::new(self.positions, self.elements)?, visit_2d),
            (BatchShape::PlanarTriangles, Some(shapes)) => {
                // Where elements are says nothing here.
                let centers = vec![[0.0; 3]; shapes.len()];
                let rest = Rest::<2, 2>::of_shapes(shapes, &centers, self.elements, self.x.len() / 2)?;
                let mut out = self.of(rest, visit_2d)?;
                out.rest = Vec::new();
                Ok(out)
            }
            (BatchShape::Springs, _) => self.of(Rest::<3, 1>::new(self.positions, self.elements)?, visit_1d),
            (BatchShape::PlanarSprings, _) => self.of(Rest::<2, 1>::new(self.positions, self.elements)?, visit_1d),
        }
    }

    fn of<'s, const D: usize, const K: usize>(
        &'s self,
        rest: Rest<D, K>,
        visit: impl FnOnce(&str, &Lame, Visit<'s, D, K>) -> Result<Parts<D, K>, UnknownEnergy>,
    ) -> Result<Sensitivity, SensitivityError>
    where
        Simplex: Shape<D, K>,
    {
        let rest = match self.fill {
            Some(fill) => rest.filled(|e| fill.get(e).copied().unwrap_or(1.0))?,
            None => rest,
        };
        let parts = visit(self.energy, self.lame, Visit { of: self, rest }).map_err(SensitivityError::Energy)?;
        let mut out = Sensitivity { x: vec![0.0; self.x.len()], rest: vec![0.0; self.x.len()], ..Default::default() };
        let mut power = 0.0;
        for (e, (part, nodes)) in parts.into_iter().zip(self.elements.chunks_exact(K + 1)).enumerate() {
            let part = part.ok_or(SensitivityError::Kink(e))?;
            power += part.power;
            out.lambda += part.lambda;
            for (gradient, to) in [(part.x, &mut out.x), (part.rest, &mut out.rest)] {
                for d in 0..D {
                    for k in 0..K {
                        // An edge leads from corner 0 to corner k + 1.
                        to[nodes[k + 1] as usize * D + d] += gradient[d][k];
                        to[nodes[0] as usize * D + d] -= gradient[d][k];
                    }
                }
            }
            if self.shapes.is_some() {
                out.shapes.push([0, 1].map(|r| [0, 1].map(|c| part.shape[r.min(K - 1)][c.min(K - 1)])));
            }
        }
        // Energies are homogeneous in their moduli: mu phi_mu + lambda phi_lambda = phi, the part of c left out.
        out.mu = (power - self.lame.lambda() * out.lambda) / self.lame.mu();
        Ok(out)
    }
}

/// What an element contributes; none at a kink.
type Parts<const D: usize, const K: usize> = Vec<Option<Part<D, K>>>;

struct Part<const D: usize, const K: usize> {
    power: f64,           // V P : W
    lambda: f64,          // its derivative
    x: [[f64; K]; D],     // d phi / d(edges of x), as columns
    rest: [[f64; K]; D],  // d phi / d(edges at rest)
    shape: [[f64; K]; K], // d phi / d(rest shape)
}

/// The elements, once the energy's type is known.
struct Visit<'a, const D: usize, const K: usize> {
    of: &'a Step<'a>,
    rest: Rest<D, K>,
}

impl<const D: usize, const K: usize> EnergyVisitor<K> for Visit<'_, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = Parts<D, K>;
    fn visit<E: Energy<K>>(self, energy: E) -> Parts<D, K> {
        let near = Moduli::around(self.of.lame);
        let elements = 0..self.rest.elements().len() / (K + 1);
        elements.into_par_iter().with_min_len(CHUNK).map(|e| self.element(e, &energy, &near)).collect()
    }
}

/// Elements that a task handles.
const CHUNK: usize = 256;

/// lambda is moved by this part of the bulk modulus, of which there is no more to lose. Energies are linear in their
/// moduli or nearly so, and the error of the stencil is of the fourth order.
const NEARBY: f64 = 1e-3;

/// The moduli of a stencil in lambda, each with its weight: (f(-2h) - 8 f(-h) + 8 f(h) - f(2h)) / 12h.
struct Moduli(Vec<(Lame, f64)>);

impl Moduli {
    fn around(lame: &Lame) -> Self {
        let h = NEARBY * lame.bulk();
        let at = |(k, weight): (f64, f64)| {
            let lame = Lame::new(lame.mu(), lame.lambda() + k * h).ok()?;
            Some((lame, weight / (12.0 * h)))
        };
        Moduli([(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)].into_iter().filter_map(at).collect())
    }
}

impl<const D: usize, const K: usize> Visit<'_, D, K>
where
    Simplex: Shape<D, K>,
{
    /// With F = U S V^T, W = U h V^T + N V^T, N normal to U, and P = U diag(psi_i) V^T:
    ///
    /// ```text
    /// dP = U m V^T + N diag(psi_i / s_i) V^T,    m_ii = sum_j psi_ij h_jj,
    /// m_ij = (minus_ij (h_ij + h_ji) + plus_ij (h_ij - h_ji)) / 2
    /// ```
    ///
    /// is the derivative of P along W (Smith, de Goes and Kim 2019), and with A the rest edges in a frame of the
    /// element,
    ///
    /// ```text
    /// d phi / d Ds = V dP B^T,    d phi / dA = V ((P : W + c) I - F^T dP - W^T P) B^T
    /// ```
    ///
    /// since dV = V tr(B dA) and dB = -B dA B. In space that is Q d phi / dA, Q = (rest edges) B being the frame.
    fn element<E: Energy<K>>(&self, e: usize, energy: &E, near: &Moduli) -> Option<Part<D, K>> {
        let nodes = &self.rest.elements()[e * (K + 1)..(e + 1) * (K + 1)];
        let edges = |of: &[f64]| -> [[f64; K]; D] {
            let at = |k: usize, d: usize| of[nodes[k] as usize * D + d];
            std::array::from_fn(|d| std::array::from_fn(|k| at(k + 1, d) - at(0, d)))
        };
        let (b, v) = (self.rest.inverse(e), self.rest.measure(e));
        let (f, w) = (product(&edges(self.of.x), b), product(&edges(self.of.w), b));
        let svd = <Simplex as Shape<D, K>>::svd(f);
        let wv = product(&w, &svd.v);
        let h: [[f64; K]; K] = transposed_product(&svd.u, &wv);
        let psi = energy.gradient(svd.s);
        let (hessian, quotients) = (energy.hessian(svd.s), energy.divided_differences(svd.s));
        let bound = KINK * hessian.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        let mut m = [[0.0; K]; K];
        for i in 0..K {
            m[i][i] = (0..K).map(|j| hessian[i][j] * h[j][j]).sum();
            for j in (0..K).filter(|j| *j != i) {
                let (minus, plus) = (quotients.minus[i][j], quotients.plus[i][j]);
                let smooth = minus.abs() <= bound && plus.abs() <= bound;
                if !smooth {
                    return None;
                }
                m[i][j] = 0.5 * (minus * (h[i][j] + h[j][i]) + plus * (h[i][j] - h[j][i]));
            }
        }
        let mut dp = product(&svd.u, &m);
        if D > K {
            for j in 0..K {
                let slope = psi[j] / svd.s[j];
                let smooth = slope.abs() <= bound;
                if !smooth {
                    return None;
                }
                for d in 0..D {
                    let along: f64 = (0..K).map(|i| svd.u[d][i] * h[i][j]).sum();
                    dp[d][j] += (wv[d][j] - along) * slope;
                }
            }
        }
        let turned = transpose(&svd.v);
        let dp = product(&dp, &turned);
        let p: [[f64; K]; D] = std::array::from_fn(|d| std::array::from_fn(|i| svd.u[d][i] * psi[i]));
        let p = product(&p, &turned);
        let strain = |psi: &[f64; K]| (0..K).map(|i| psi[i] * h[i][i]).sum::<f64>();
        let power = strain(&psi);
        let lambda =
            near.0.iter().map(|(lame, weight)| weight * strain(&E::from_lame(lame).gradient(svd.s))).sum::<f64>();
        let outer = transpose(b);
        let (fdp, wp) = (transposed_product(&f, &dp), transposed_product(&w, &p));
        let c = self.of.per_measure.and_then(|c| c.get(e)).copied().unwrap_or(0.0);
        let inner: [[f64; K]; K] = std::array::from_fn(|i| {
            std::array::from_fn(|j| v * (if i == j { power + c } else { 0.0 } - fdp[i][j] - wp[i][j]))
        });
        let shape = product(&inner, &outer);
        let rest = match self.of.shapes {
            Some(_) => [[0.0; K]; D],
            None => product(&product(&edges(self.of.positions), b), &shape),
        };
        let x = product(&dp, &outer).map(|row| row.map(|g| v * g));
        Some(Part { power: v * power, lambda: v * lambda, x, rest, shape })
    }
}

/// a b
fn product<const R: usize, const K: usize>(a: &[[f64; K]; R], b: &[[f64; K]; K]) -> [[f64; K]; R] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..K).map(|k| a[i][k] * b[k][j]).sum()))
}

/// a^T b
fn transposed_product<const R: usize, const K: usize>(a: &[[f64; K]; R], b: &[[f64; K]; R]) -> [[f64; K]; K] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..R).map(|r| a[r][i] * b[r][j]).sum()))
}

fn transpose<const K: usize>(a: &[[f64; K]; K]) -> [[f64; K]; K] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}
