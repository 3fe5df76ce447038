//! Iterations in one pass: of problems whose nodes meet in the set of one term alone.

use crate::Problem;

/// What each node has of its own: a spring to a target, and its entry of the normal matrix, which is diagonal.
#[derive(Clone, Debug)]
pub struct Uncoupled {
    /// a_i of the normal matrix.
    pub diagonal: Vec<f64>,
    /// k_i; 0 where there is no spring.
    pub stiffness: Vec<f64>,
    /// t_i, `dim` numbers each.
    pub target: Vec<f64>,
}

impl Uncoupled {
    /// Of a problem whose normal matrix has this diagonal and nothing beside it; none where anything but the one term and
    /// at most one spring at each node has a say.
    pub(crate) fn of(problem: &Problem, diagonal: &[f64]) -> Option<Self> {
        let (n, dim, own) = (problem.n_free, problem.dim, &problem.quadratic);
        let has_springs_alone = own.points.is_empty()
            && own.loads.is_empty()
            && own.form.is_empty()
            && own.inertia.is_empty()
            && own.potentials.is_empty()
            && own.equalities.is_empty();
        if !has_springs_alone || problem.terms.len() != 1 || problem.x0.len() != n * dim || diagonal.len() != n {
            return None;
        }
        let (mut stiffness, mut target) = (vec![0.0; n], vec![0.0; n * dim]);
        for (node, k, t) in &own.springs {
            let node = *node as usize;
            if stiffness[node] != 0.0 {
                return None;
            }
            stiffness[node] = *k;
            target[node * dim..(node + 1) * dim].copy_from_slice(&t[..dim]);
        }
        Some(Uncoupled { diagonal: diagonal.to_vec(), stiffness, target })
    }
}
