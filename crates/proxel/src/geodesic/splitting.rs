//! The nearest integrable field by ADMM, in the z-x-u order (Tao et al. 2019): z are copies that fit together, x the field.

use super::GeodesicError;
use super::surface::Surface;
use crate::settings::{GeodesicMethod, GeodesicSettings, GradientForm};
use proxel_model::gradient_field::{FaceField, TooManyFaces, field_on_edges};
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Direct, Method, Order, Problem, Quadratic, SystemError, Term,
};
use std::collections::VecDeque;

/// The problem, with the directions of the heat method as targets and as the start.
///
/// Faces: min sum_f A_f |G_f - g_f|^2, squared weights mu A_f. Edges: min sum_f A_f sum_e ((x_e - g_f . e) / l_e)^2, squared
/// weights mu A_f / l_e^2. Areas are in units of their mean.
///
/// # Errors
/// For edges: one with more faces than there is room for.
pub fn problem(
    surface: &Surface,
    directions: &[[f64; 2]],
    form: GradientForm,
    mu: f64,
) -> Result<Problem, GeodesicError> {
    let faces = surface.triangles.len();
    let mean = surface.area.iter().sum::<f64>() / faces as f64;
    let area: Vec<f64> = surface.area.iter().map(|a| a / mean).collect();
    Ok(match form {
        GradientForm::Faces => {
            let frames: Vec<[[f64; 2]; 3]> = (0..faces).map(|f| [0, 1, 2].map(|k| surface.direction(f, k).0)).collect();
            let term = FaceField::on_faces(surface.edges.len(), &surface.face_edges, &frames, &area, mu);
            let springs = directions.iter().zip(&area).enumerate();
            let springs = springs.map(|(f, (g, a))| (f as u32, 2.0 * a, [g[0], g[1], 0.0])).collect();
            assembled(2, directions.as_flattened().to_vec(), Box::new(term), springs)
        }
        GradientForm::Edges => {
            let edges = surface.edges.len();
            let (mut signs, mut weights2) = (vec![[0.0; 3]; faces], vec![[0.0; 3]; faces]);
            let mut targets = vec![(0.0, 0.0); edges]; // weight, weighted sum
            for f in 0..faces {
                for k in 0..3 {
                    let e = surface.face_edges[f][k] as usize;
                    let (d, forward) = surface.direction(f, k);
                    let l = surface.lengths[e];
                    signs[f][k] = if forward { 1.0 } else { -1.0 };
                    let w = area[f] / (l * l);
                    weights2[f][k] = mu * w;
                    targets[e].0 += w;
                    targets[e].1 += w * l * (d[0] * directions[f][0] + d[1] * directions[f][1]);
                }
            }
            let start: Vec<f64> = targets.iter().map(|(w, sum)| sum / w).collect();
            let springs = targets.iter().zip(&start).enumerate();
            let springs = springs.map(|(e, ((w, _), x))| (e as u32, 2.0 * w, [*x, 0.0, 0.0])).collect();
            let term = field_on_edges(edges, &surface.face_edges, &signs, &weights2, &surface.lengths);
            let term = term.map_err(|e| crowded(surface, e))?;
            assembled(1, start, term, springs)
        }
    })
}

fn crowded(surface: &Surface, e: TooManyFaces) -> GeodesicError {
    let ends = surface.edges.get(e.edge as usize).copied().unwrap_or_default();
    GeodesicError(format!(
        "{}: the edge between vertices {} and {} has {} faces, and unknowns on edges are for {} at most; take --form faces",
        surface.name, ends[0], ends[1], e.faces, e.most
    ))
}

fn assembled(dim: usize, x0: Vec<f64>, term: Box<dyn Term>, springs: Vec<(u32, f64, [f64; 3])>) -> Problem {
    let quadratic = Quadratic { springs, ..Quadratic::default() };
    Problem { dim, n_free: x0.len() / dim, x0, terms: vec![term], quadratic, barrier: false }
}

/// ADMM on it, plain or accelerated.
///
/// # Errors
/// A system that cannot be factored.
pub fn method(problem: Problem, settings: &GeodesicSettings) -> Result<Box<dyn Method>, SystemError> {
    let parts = AdmmSettings {
        name: settings.method.as_str().to_string(),
        global: Box::new(Direct),
        reweighting: None,
        renewed_at: None,
    };
    let admm = Admm::new(problem, parts)?.with_cycle(Cycle { order: Order::Zxu, ..Cycle::PLAIN })?;
    Ok(match settings.method {
        GeodesicMethod::AaAdmm => Acceleration::anderson(Algorithm::Two, settings.anderson).of(admm)?,
        _ => Box::new(admm),
    })
}

/// The difference along each edge from its lower vertex: the mean over its faces, or the variable itself.
pub fn differences(surface: &Surface, form: GradientForm, x: &[f64]) -> Vec<f64> {
    if form == GradientForm::Edges {
        return x.to_vec();
    }
    let mut sums = vec![(0.0, 0); surface.edges.len()];
    for (f, edges) in surface.face_edges.iter().enumerate() {
        for k in 0..3 {
            let (e, d) = (edges[k] as usize, surface.direction(f, k).0);
            sums[e].0 += surface.lengths[e] * (d[0] * x[2 * f] + d[1] * x[2 * f + 1]);
            sums[e].1 += 1;
        }
    }
    sums.iter().map(|(sum, n)| sum / f64::from(*n)).collect()
}

/// The sums of differences along a tree of edges that is grown from the roots, breadth first; 0 at the roots, and where
/// they do not reach.
pub fn sums(surface: &Surface, differences: &[f64], roots: &[u32]) -> Vec<f64> {
    let mut offsets = vec![0u32; surface.n + 1];
    for v in surface.edges.as_flattened() {
        offsets[*v as usize + 1] += 1;
    }
    for v in 0..surface.n {
        offsets[v + 1] += offsets[v];
    }
    let (mut next, mut at) = (offsets.clone(), vec![0u32; 2 * surface.edges.len()]);
    for (e, ends) in surface.edges.iter().enumerate() {
        for v in ends {
            at[next[*v as usize] as usize] = e as u32;
            next[*v as usize] += 1;
        }
    }
    let (mut phi, mut seen) = (vec![0.0; surface.n], vec![false; surface.n]);
    let mut queue = VecDeque::new();
    for v in roots {
        if !std::mem::replace(&mut seen[*v as usize], true) {
            queue.push_back(*v);
        }
    }
    while let Some(v) = queue.pop_front() {
        for e in &at[offsets[v as usize] as usize..offsets[v as usize + 1] as usize] {
            let [a, b] = surface.edges[*e as usize];
            let (w, step) = if a == v { (b, differences[*e as usize]) } else { (a, -differences[*e as usize]) };
            if !std::mem::replace(&mut seen[w as usize], true) {
                phi[w as usize] = phi[v as usize] + step;
                queue.push_back(w);
            }
        }
    }
    phi
}
