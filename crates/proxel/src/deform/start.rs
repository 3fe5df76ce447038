//! A start where none is given, or none that is of use.

use super::DeformError;
use super::elements::Cells;
use proxel_model::elements::{Batch, BatchWeights, batch};
use proxel_model::energy::Lame;
use proxel_split::{NormalMatrix, PointSpring, Precision, Problem, Quadratic, SystemError, Term, vector};

/// The free vertices follow the fixed ones harmonically, see [`Harmonic`]. They also follow what draws at `points`, whose
/// stiffness is here that of springs in a material of modulus 1.
pub(super) fn smooth(
    kinds: &[Cells],
    number: &[u32],
    rest: &[f64],
    x0: Vec<f64>,
    n_free: usize,
    dim: usize,
    points: Vec<PointSpring>,
) -> Result<Vec<f64>, DeformError> {
    let moved = rest.iter().zip(&x0).any(|(a, b)| a != b) || !points.is_empty();
    if !moved || n_free == 0 {
        return Ok(x0);
    }
    let targets: Vec<[f64; 3]> = points.iter().map(|p| p.target).collect();
    Harmonic::new(kinds, number, rest, n_free, dim, points, Precision::Double)?.follow(rest, x0, &targets)
}

/// The displacement of least Dirichlet energy, which is the one step of a linear coupling whose local variables are all
/// where they were.
pub(super) struct Harmonic {
    problem: Problem,
    normal: NormalMatrix,
    p: Vec<Vec<f64>>,
}

impl Harmonic {
    /// For these elements, `n_free` free nodes and springs at `points` in a material of modulus 1.
    pub fn new(
        kinds: &[Cells],
        number: &[u32],
        rest: &[f64],
        n_free: usize,
        dim: usize,
        points: Vec<PointSpring>,
        precision: Precision,
    ) -> Result<Self, DeformError> {
        let lame = Lame::new(1.0, 0.0).map_err(|e| DeformError(e.to_string()))?;
        let mut terms: Vec<Box<dyn Term>> = Vec::new();
        for cells in kinds {
            let corners = cells.renumbered(number);
            let of = Batch {
                shape: cells.shape(dim == 2),
                positions: rest,
                flattened: None,
                elements: corners.corners(),
                fill: None,
                energy: "arap",
                lame: &lame,
                limits: None,
                rotation_aware: false,
                singular_values: false,
                weights: &|_| BatchWeights { base: 1.0, softening: 1.0 },
            };
            terms.push(batch(&of).map_err(|e| DeformError(e.to_string()))?.0);
        }
        let quadratic = Quadratic { points, ..Quadratic::default() };
        let problem = Problem { dim, n_free, x0: rest.to_vec(), terms, quadratic, barrier: false };
        let normal = NormalMatrix::with_precision(&problem, precision).map_err(refuse)?;
        let p = problem.terms.iter().map(|term| vec![0.0; term.local_len()]).collect();
        Ok(Harmonic { problem, normal, p })
    }

    /// `to`, whose fixed nodes are where they go and whose free nodes are anywhere, with free nodes such that the
    /// displacement from `from` is the smoothest; points are drawn to `targets`, one for each.
    pub fn follow(&mut self, from: &[f64], to: Vec<f64>, targets: &[[f64; 3]]) -> Result<Vec<f64>, DeformError> {
        for (point, target) in self.problem.quadratic.points.iter_mut().zip(targets) {
            point.target = *target;
        }
        // p = c(D from): what these positions, and no others, match exactly.
        for (term, p) in self.problem.terms.iter_mut().zip(&mut self.p) {
            term.couple(from, p);
        }
        let mut x = to;
        let n = self.problem.n_free * self.problem.dim;
        let mut g = vec![0.0; n];
        self.problem.penalty(&x, &self.p, &mut g);
        self.normal.solve(&mut g).map_err(refuse)?;
        vector::add_scaled(&mut x[..n], -1.0, &g);
        Ok(x)
    }
}

fn refuse(e: SystemError) -> DeformError {
    DeformError(e.to_string())
}

/// A start with more than this part of its elements inverted or collapsed says nothing about the body.
const HOPELESS: f64 = 0.05;

/// Puts the smooth start in the place of a hopeless one, where the energy forbids inversion and the smooth one has
/// less of it; says so. From where most elements are inverted a descent ends in knots, if it ends at all.
pub(super) fn replace_if_hopeless(
    problem: &mut Problem,
    smooth: impl FnOnce() -> Result<Vec<f64>, DeformError>,
) -> Result<Option<String>, DeformError> {
    if !problem.barrier {
        return Ok(None);
    }
    let x0 = std::mem::take(&mut problem.x0);
    let elements: usize = problem.terms.iter().map(|term| term.n_elems()).sum();
    let given = problem.energy(&x0, None);
    problem.x0 = x0;
    if given.inverted as f64 <= HOPELESS * elements as f64 {
        return Ok(None);
    }
    // Without a smooth start, as where a component is held by loads alone, the given one is what there is.
    let Ok(x) = smooth() else { return Ok(None) };
    if problem.energy(&x, None).inverted >= given.inverted {
        return Ok(None);
    }
    problem.x0 = x;
    Ok(Some(format!(
        "{} of the {elements} elements of the start are inverted or collapsed: auto began from a smooth start instead; other \
         methods begin where they are told",
        given.inverted
    )))
}
