//! A start where none is given.

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
            weights: &|_, _| BatchWeights { base: 1.0, softening: 1.0 },
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
