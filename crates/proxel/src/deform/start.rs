//! A start where none is given.

use super::DeformError;
use super::elements::Cells;
use proxel_model::elements::{Coupling, Elements, Linear, Rest, Shape, Simplex};
use proxel_model::energy::Arap;
use proxel_split::{NormalMatrix, PointSpring, Problem, Quadratic, Term, vector};

/// The free vertices follow the fixed ones harmonically: the displacement of least Dirichlet energy, which is the one step
/// of a linear coupling whose local variables are all at rest. They also follow what draws at `points`, whose stiffness is
/// here that of springs in a material of modulus 1.
pub(super) fn smooth(
    cells: &Cells,
    number: &[u32],
    rest: &[f64],
    x0: Vec<f64>,
    n_free: usize,
    points: Vec<PointSpring>,
) -> Result<Vec<f64>, DeformError> {
    let moved = rest.iter().zip(&x0).any(|(a, b)| a != b) || !points.is_empty();
    if !moved || n_free == 0 {
        return Ok(x0);
    }
    let corners = cells.renumbered(number);
    let term: Box<dyn Term> = match &corners {
        Cells::Tets(_) => linear::<3, 3>(corners.corners(), rest)?,
        Cells::Triangles(_) => linear::<3, 2>(corners.corners(), rest)?,
        Cells::Springs(_) => linear::<3, 1>(corners.corners(), rest)?,
    };
    let mut problem = Problem {
        dim: 3,
        n_free,
        x0,
        terms: vec![term],
        quadratic: Quadratic { points, ..Default::default() },
        barrier: false,
    };
    let refuse = |e: proxel_split::SystemError| DeformError(e.to_string());
    let mut normal = NormalMatrix::new(&problem).map_err(refuse)?;
    let mut x = problem.x0.clone();
    // p = c(D rest): what the rest positions, and no others, match exactly.
    let mut p = vec![vec![0.0; problem.terms[0].local_len()]];
    problem.terms[0].couple(rest, &mut p[0]);
    let mut g = vec![0.0; n_free * 3];
    problem.penalty(&x, &p, &mut g);
    normal.solve(&mut g).map_err(refuse)?;
    vector::add_scaled(&mut x[..n_free * 3], -1.0, &g);
    Ok(x)
}

fn linear<const D: usize, const K: usize>(corners: &[u32], rest: &[f64]) -> Result<Box<dyn Term>, DeformError>
where
    Simplex: Shape<D, K>,
    Linear: Coupling<D, K>,
    Arap: proxel_model::energy::Energy<K>,
{
    let rest = Rest::<D, K>::new(rest, corners).map_err(|e| DeformError(e.to_string()))?;
    Ok(Box::new(Elements::<D, K, Linear>::new(&rest, Arap::default(), 1.0)))
}
