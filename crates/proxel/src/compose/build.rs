//! From a composition to a problem.

use super::{ComposeError, Composition, Part};
use crate::deform::OwnTerm;
use crate::settings::Material;
use crate::shape::surface;
use proxel_model::constraint::fairing::{Fairing, laplacian};
use proxel_model::constraint::{Batch, Cells, Hold, MeanCentred, Near, Vertex, Vertices, Whole};
use proxel_model::elements::{self, BatchError, BatchShape, BatchWeights, ElementError, batch};
use proxel_split::{Problem, Quadratic, SystemError, Term};
use std::sync::Arc;

/// A composition as the solver sees it: free points first.
pub(super) struct Built {
    pub problem: Problem,
    pub order: Vec<u32>, // the user's point at each place
    pub has_sets: bool,
    pub has_own: bool,
    pub unit: f64, // the extent of the start
    pub warnings: Vec<String>,
}

fn refuse<T>(text: String) -> Result<T, ComposeError> {
    Err(ComposeError(text))
}

impl Built {
    pub fn new(of: &Composition) -> Result<Self, ComposeError> {
        let n = of.start.len();
        check(of)?;
        let mut fixed = vec![None; n];
        of.fixed.iter().for_each(|(v, target)| fixed[*v as usize] = Some(*target));
        let mut used = vec![false; n];
        for part in &of.parts {
            part.nodes().for_each(|v| used[v as usize] = true);
        }
        of.springs.iter().filter(|s| s.2 > 0.0).for_each(|s| used[s.0 as usize] = true);
        let loose: Vec<usize> = (0..n).filter(|v| !used[*v] && fixed[*v].is_none()).collect();
        let mut warnings = Vec::new();
        if let Some(first) = loose.first() {
            warnings.push(format!(
                "{} points belong to no part, the first is {first} (0-based); they stay in place",
                loose.len()
            ));
        }
        loose.iter().for_each(|v| fixed[*v] = Some(of.start[*v]));
        let (free, held): (Vec<u32>, Vec<u32>) = (0..n as u32).partition(|v| fixed[*v as usize].is_none());
        let n_free = free.len();
        let order = [free, held].concat();
        let mut number = vec![0u32; n];
        order.iter().enumerate().for_each(|(place, v)| number[*v as usize] = place as u32);
        let sorted = |of: &[[f64; 3]]| -> Vec<f64> { order.iter().flat_map(|v| of[*v as usize]).collect() };
        let placed: Vec<[f64; 3]> = of.start.iter().zip(&fixed).map(|(x, t)| t.unwrap_or(*x)).collect();
        let x0 = sorted(&placed);
        let extent = proxel_split::vector::extent(&x0, 3);
        let unit = if extent > 0.0 { extent } else { 1.0 };
        let mut quadratic = Quadratic {
            springs: of.springs.iter().map(|(v, t, k)| (number[*v as usize], *k, *t)).collect(),
            ..Quadratic::default()
        };
        if !of.loads.is_empty() {
            quadratic.loads = vec![0.0; 3 * n];
            for (v, b) in &of.loads {
                let at = 3 * number[*v as usize] as usize;
                (0..3).for_each(|d| quadratic.loads[at + d] += b[d]);
            }
        }
        for (faces, weight) in &of.fairing {
            let renumbered: Vec<Vec<u32>> =
                faces.iter().map(|f| f.iter().map(|v| number[*v as usize]).collect()).collect();
            let stencils = laplacian(n, renumbered.iter().map(Vec::as_slice));
            Fairing { smooth: 0.0, relative: *weight }.add_to(&stencils, &sorted(&of.start), &mut quadratic);
        }
        let (mut terms, mut barrier): (Vec<Box<dyn Term>>, bool) = (Vec::new(), false);
        for (p, part) in of.parts.iter().enumerate() {
            let (term, positive) =
                part.term(&number, &sorted, unit).map_err(|e| ComposeError(format!("part {p}: {e}")))?;
            terms.push(term);
            barrier |= positive;
        }
        let has_sets = of.parts.iter().any(|p| matches!(p, Part::Sets { .. } | Part::Near { .. }));
        let has_own = of.parts.iter().any(|p| matches!(p, Part::Own { .. }));
        let problem = Problem { dim: 3, n_free, x0, terms, quadratic, barrier };
        Ok(Built { problem, order, has_sets, has_own, unit, warnings })
    }

    /// Points in the user's order; held ones are where `fixed` has them.
    pub fn positions(&self, x: &[f64], fixed: &[(u32, [f64; 3])]) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; self.order.len()];
        for (v, x) in self.order.iter().zip(x.as_chunks::<3>().0) {
            out[*v as usize] = *x;
        }
        fixed.iter().for_each(|(v, target)| out[*v as usize] = *target);
        out
    }

    /// An error of the system, in the user's numbering.
    pub fn explain(order: &[u32], e: &SystemError) -> ComposeError {
        ComposeError(match e {
            SystemError::Singular { node } => {
                let v = order.get(*node).map_or(*node, |v| *v as usize);
                format!(
                    "the system is singular at point {v} (0-based): nothing says where its part is; hold one of its \
                     points (fix), or give it springs"
                )
            }
            other => other.to_string(),
        })
    }
}

/// Indices, numbers and lengths.
fn check(of: &Composition) -> Result<(), ComposeError> {
    let n = of.start.len();
    if n == 0 {
        return refuse("there are no points; give some".to_string());
    }
    let finite = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
    if let Some(v) = of.start.iter().position(|p| !finite(p)) {
        return refuse(format!("point {v} (0-based) is {:?}; give finite numbers", of.start[v]));
    }
    let named = of.fixed.iter().map(|(v, p)| ("a held point", v, p));
    let named = named.chain(of.springs.iter().map(|(v, p, _)| ("a spring", v, p)));
    for (what, v, p) in named.chain(of.loads.iter().map(|(v, p)| ("a force", v, p))) {
        if *v as usize >= n {
            return refuse(format!("{what} names point {v}; there are {n} (0-based)"));
        }
        if !finite(p) {
            return refuse(format!("{what} of point {v} (0-based) is {p:?}; give finite numbers"));
        }
    }
    if let Some((v, _, k)) = of.springs.iter().find(|(_, _, k)| !(*k >= 0.0 && k.is_finite())) {
        return refuse(format!(
            "the spring of point {v} (0-based) has the stiffness {k}; give a number that is not negative"
        ));
    }
    for (faces, weight) in &of.fairing {
        if let Some(v) = faces.indices().iter().find(|v| **v as usize >= n) {
            return refuse(format!("fairing: a face names point {v}; there are {n} (0-based)"));
        }
        if !(*weight >= 0.0 && weight.is_finite()) {
            return refuse(format!("fairing: its weight is {weight}; give a number that is not negative"));
        }
    }
    for (p, part) in of.parts.iter().enumerate() {
        if let Some(v) = part.nodes().find(|v| *v as usize >= n) {
            return refuse(format!("part {p}: an element names point {v}; there are {n} (0-based)"));
        }
        part.check(n).map_err(|text| ComposeError(format!("part {p}: {text}")))?;
    }
    Ok(())
}

impl Part {
    /// The points of its elements.
    fn nodes(&self) -> Box<dyn Iterator<Item = u32> + '_> {
        match self {
            Part::Elastic { elements, .. } | Part::Sets { elements, .. } => Box::new(elements.iter().copied()),
            Part::Own { tets, .. } => Box::new(tets.as_flattened().iter().copied()),
            Part::Near { points, .. } => Box::new(points.iter().copied()),
        }
    }

    fn check(&self, n: usize) -> Result<(), String> {
        let whole = |elements: &[u32], corners: usize| match corners > 0 && elements.len().is_multiple_of(corners) {
            true => Ok(()),
            false => Err(format!("{} corners are no elements of {corners}", elements.len())),
        };
        let at_rest = |rest: &[[f64; 3]]| match rest.len() == n {
            true => Ok(()),
            false => Err(format!("rest has {} rows for {n} points; give one for each", rest.len())),
        };
        let positive = |w: f64| match w > 0.0 && w.is_finite() {
            true => Ok(()),
            false => Err(format!("its weight is {w}; give a positive number")),
        };
        match self {
            Part::Elastic { rest, elements, corners, .. } => {
                at_rest(rest)?;
                match corners {
                    2..=4 => whole(elements, *corners),
                    _ => Err(format!("elements have {corners} corners; give 4, 3 or 2")),
                }
            }
            Part::Own { rest, .. } => at_rest(rest),
            Part::Sets { elements, corners, weight, .. } => {
                whole(elements, *corners)?;
                positive(*weight)
            }
            Part::Near { weight, .. } => positive(*weight),
        }
    }

    /// Its term, and whether its solution has no inverted element.
    fn term(
        &self,
        number: &[u32],
        sorted: &dyn Fn(&[[f64; 3]]) -> Vec<f64>,
        unit: f64,
    ) -> Result<(Box<dyn Term>, bool), String> {
        let renumbered = |of: &[u32]| -> Vec<u32> { of.iter().map(|v| number[*v as usize]).collect() };
        match self {
            Part::Elastic { rest, elements, corners, material } => {
                elastic(&renumbered(elements), *corners, &sorted(rest), material)
            }
            Part::Own { rest, tets, energy, like } => {
                let (rest, elements) = (sorted(rest), renumbered(tets.as_flattened()));
                let (like, _) = elastic(&elements, 4, &rest, like)?;
                let tets = elements.as_chunks::<4>().0.to_vec();
                Ok((Box::new(OwnTerm::new(like, energy.clone(), tets, &rest)), energy.0.is_barrier()))
            }
            Part::Sets { elements, corners, centred, sets, hard, weight } => {
                let hold = if *hard { Hold::Hard(*weight) } else { Hold::Soft(*weight) };
                let nodes = renumbered(elements);
                let term: Box<dyn Term> = match centred {
                    true => Box::new(
                        Whole::<MeanCentred>::new(nodes, *corners, sets.0.clone(), hold, unit)
                            .map_err(|e| e.to_string())?,
                    ),
                    false => Box::new(
                        Whole::<Vertices>::new(nodes, *corners, sets.0.clone(), hold, unit)
                            .map_err(|e| e.to_string())?,
                    ),
                };
                Ok((term, false))
            }
            Part::Near { points, surface: mesh, weight } => {
                mesh.check_indices().map_err(|e| e.to_string())?;
                let (found, _) = surface(&mesh.points, &mesh.faces.fan_triangles())?;
                let cells = Cells::<Vertex, _>::new(renumbered(points), 1, Near::Shared(Arc::new(found)));
                let cells = cells.map_err(|e| e.to_string())?;
                Ok((Box::new(Batch::new(Arc::new(cells), Hold::Soft(*weight))), false))
            }
        }
    }
}

fn elastic(
    elements: &[u32],
    corners: usize,
    rest: &[f64],
    material: &Material,
) -> Result<(Box<dyn Term>, bool), String> {
    let lame = material.lame().map_err(|e| e.to_string())?;
    let shape = match corners {
        4 => BatchShape::Tetrahedra,
        3 => BatchShape::Triangles,
        _ => BatchShape::Springs,
    };
    batch(&elements::Batch {
        shape,
        positions: rest,
        flattened: None,
        elements,
        fill: None,
        energy: &material.energy,
        lame: &lame,
        limits: None,
        rotation_aware: false,
        singular_values: false,
        weights: &|stiffness| BatchWeights { base: stiffness.largest, softening: 1.0 },
    })
    .map_err(|e| match e {
        BatchError::Element(ElementError::Measure { element, measure }) => {
            format!(
                "element {element} (0-based) has size {measure:e} at rest; move its corners apart, reorder or remove it"
            )
        }
        other => other.to_string(),
    })
}
