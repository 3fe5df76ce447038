//! A start where none is given, or none that is of use.

use super::DeformError;
use super::elements::Cells;
use proxel_model::elements::{Batch, BatchWeights, batch};
use proxel_model::energy::Lame;
use proxel_split::{NormalMatrix, PointSpring, Problem, Quadratic, Term, vector};

/// The free vertices follow the fixed ones harmonically: the displacement of least Dirichlet energy, which is the one step
/// of a linear coupling whose local variables are all at rest. They also follow what draws at `points`, whose stiffness is
/// here that of springs in a material of modulus 1.
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
    let lame = Lame::new(1.0, 0.0).map_err(|e| DeformError(e.to_string()))?;
    let mut terms: Vec<Box<dyn Term>> = Vec::new();
    for cells in kinds {
        let corners = cells.renumbered(number);
        let of = Batch {
            shape: cells.shape(dim == 2),
            positions: rest,
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
    let mut problem =
        Problem { dim, n_free, x0, terms, quadratic: Quadratic { points, ..Quadratic::default() }, barrier: false };
    let refuse = |e: proxel_split::SystemError| DeformError(e.to_string());
    let mut normal = NormalMatrix::new(&problem).map_err(refuse)?;
    let mut x = problem.x0.clone();
    // p = c(D rest): what the rest positions, and no others, match exactly.
    let mut p = Vec::new();
    for term in &mut problem.terms {
        let mut part = vec![0.0; term.local_len()];
        term.couple(rest, &mut part);
        p.push(part);
    }
    let mut g = vec![0.0; n_free * dim];
    problem.penalty(&x, &p, &mut g);
    normal.solve(&mut g).map_err(refuse)?;
    vector::add_scaled(&mut x[..n_free * dim], -1.0, &g);
    Ok(x)
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
