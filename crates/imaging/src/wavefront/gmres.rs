//! ADMM accelerated by GMRES (Zhang and White 2018).

use super::Linearised;
use super::map::{IterationMap, Measured};
use proxel_split::{BuildError, EnergyReport, Evaluation, Method, Problem, Residuals, SquaredResiduals, StepReport};
use proxel_split::{SystemError, vector};

/// For a quadratic problem the plain iteration is an affine map z -> F(z) = T z + b of z alone (A, appendix E.1), and its fixed
/// point solves (I - T) z = b: GMRES, begun anew from its last point every so many iterations. An iteration applies F once,
/// as one of plain ADMM does; what it proposes in the midst of a cycle is made when it is asked for.
pub struct Gmres {
    map: IterationMap,
    restart: usize,
    z: Vec<f64>,            // where the cycle began
    at_zero: Vec<f64>,      // F(0)
    basis: Vec<Vec<f64>>,   // orthonormal; one more than columns
    columns: Vec<Vec<f64>>, // of the triangular factor of the Hessenberg matrix
    turns: Vec<(f64, f64)>, // Givens rotations: cosine, sine
    rest: Vec<f64>,         // the rotated right-hand side; its last entry is the residual
    x: Vec<f64>,            // phi of the last point that was asked for, or of the begin of the cycle
    image: Vec<f64>,
    measured: Option<Measured>,
    iteration: usize,
}

/// A direction that is left with less than this part of itself has none but rounding.
const EXHAUSTED: f64 = 1e-14;

impl Gmres {
    /// Begun at 0.
    ///
    /// # Errors
    /// As [`Linearised::problem`]; a cycle of no iterations.
    pub fn new(of: &Linearised, restart: usize) -> Result<Self, BuildError> {
        if restart == 0 {
            return Err(BuildError::Setting("cycles of GMRES have at least one iteration".to_string()));
        }
        let mut map = IterationMap::new(of)?;
        let n = map.len();
        let zero = vec![0.0; n];
        let mut at_zero = zero.clone();
        map.apply(&zero, &mut at_zero);
        let x = map.x.clone();
        let (basis, columns, turns, rest) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let image = zero.clone();
        Ok(Gmres {
            map,
            restart,
            z: zero,
            at_zero,
            basis,
            columns,
            turns,
            rest,
            x,
            image,
            measured: None,
            iteration: 0,
        })
    }

    /// z of the least residual over the basis.
    fn point(&self) -> Vec<f64> {
        let k = self.columns.len();
        let mut y = self.rest[..k.min(self.rest.len())].to_vec();
        for i in (0..k).rev() {
            let known: f64 = (i + 1..k).map(|j| self.columns[j][i] * y[j]).sum();
            y[i] = (y[i] - known) / self.columns[i][i];
        }
        let mut z = self.z.clone();
        for (y, v) in y.iter().zip(&self.basis) {
            vector::add_scaled(&mut z, *y, v);
        }
        z
    }

    /// r = F(z) - z begins a basis.
    fn begin(&mut self) {
        let mut image = std::mem::take(&mut self.image);
        self.map.apply(&self.z, &mut image);
        self.x.copy_from_slice(&self.map.x);
        let mut r = vec![0.0; image.len()];
        vector::subtract(&mut r, &image, &self.z);
        let norm = vector::norm(&r);
        self.image = image;
        if norm > 0.0 {
            r.iter_mut().for_each(|r| *r /= norm);
        }
        (self.basis, self.columns, self.turns, self.rest) = (vec![r], Vec::new(), Vec::new(), vec![norm]);
    }

    /// w = (I - T) v, made orthogonal to the basis.
    fn extend(&mut self) -> bool {
        let k = self.columns.len();
        let v = &self.basis[k];
        let mut w = std::mem::take(&mut self.image);
        self.map.apply(v, &mut w);
        w.iter_mut().zip(&self.at_zero).zip(v).for_each(|((w, b), v)| *w = v - (*w - b));
        let before = vector::norm(&w);
        let mut column = vec![0.0; k + 2];
        // Twice is enough for orthogonality to rounding.
        for _ in 0..2 {
            for (h, v) in column.iter_mut().zip(&self.basis) {
                let c = vector::dot(v, &w);
                vector::add_scaled(&mut w, -c, v);
                *h += c;
            }
        }
        let norm = vector::norm(&w);
        column[k + 1] = norm;
        for (i, (c, s)) in self.turns.iter().enumerate() {
            let (a, b) = (column[i], column[i + 1]);
            (column[i], column[i + 1]) = (c * a + s * b, c * b - s * a);
        }
        let size = column[k].hypot(column[k + 1]);
        if !(size > EXHAUSTED * before) {
            self.image = w;
            return false;
        }
        let (c, s) = (column[k] / size, column[k + 1] / size);
        column[k] = size;
        column.truncate(k + 1);
        let last = self.rest[k];
        self.rest[k] = c * last;
        self.rest.push(-s * last);
        self.turns.push((c, s));
        self.columns.push(column);
        let goes_on = norm > EXHAUSTED * before;
        let next = if goes_on { w.iter().map(|w| w / norm).collect() } else { vec![0.0; w.len()] };
        self.basis.push(next);
        self.image = w;
        goes_on
    }

    /// The point is made and measured.
    fn settle(&mut self) -> Measured {
        if let Some(measured) = self.measured {
            return measured;
        }
        let z = self.point();
        let measured = self.map.measure(&z);
        self.x.copy_from_slice(&self.map.x);
        self.measured = Some(measured);
        measured
    }
}

impl Method for Gmres {
    fn name(&self) -> &str {
        "gmres"
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        self.measured = None;
        self.iteration += 1;
        if self.basis.is_empty() {
            self.begin();
        } else if self.rest[0] > 0.0 && (!self.extend() || self.columns.len() == self.restart) {
            self.z = self.point();
            self.basis.clear();
            self.columns.clear();
        }
        let residual = self.rest.last().map(|r| r.abs());
        Ok(StepReport {
            iteration: self.iteration,
            inner: 1,
            accepted: true,
            energy_z: f64::INFINITY,
            merit: residual,
            ..StepReport::default()
        })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        &self.map.problem
    }

    fn energy(&mut self) -> EnergyReport {
        self.settle();
        self.map.energy(&self.x)
    }

    fn evaluate(&mut self) -> Evaluation {
        self.settle();
        self.map.evaluate(&self.x)
    }

    fn factor_bytes(&self) -> u64 {
        0
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.map.problem
    }

    fn residuals(&mut self) -> Residuals {
        self.settle().relative
    }

    fn forward_residual(&mut self) -> Option<f64> {
        Some(self.settle().squared.forward)
    }

    fn squared_residuals(&mut self) -> Option<SquaredResiduals> {
        (self.iteration > 0).then(|| self.settle().squared)
    }
}
