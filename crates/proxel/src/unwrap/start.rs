//! Where a map begins: harmonic or Tutte's, on a circle.

use super::UnwrapError;
use super::flat::{Flat, flips};
use proxel_linalg::sparse::{Cholesky, Ordering, SolveScratch, SparseError, SymPattern, Symbolic};
use std::sync::Arc;

/// Weights of the edges in sum_ij w_ij |u_i - u_j|^2, which the inner vertices minimise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// w_ij = (cot alpha + cot beta) / 2: the harmonic map.
    Cotangent,
    /// w_ij = 1: without flips in exact arithmetic (Tutte 1963).
    Uniform,
}

/// The start of a map, and which it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// (n, 2), in units in which the chart has area 1.
    pub uv: Vec<[f64; 2]>,
    /// The weights behind it; none where the map was given.
    pub weights: Option<Weights>,
    /// Triangles without positive area.
    pub flips: usize,
}

/// The longest loop goes to a circle by arc length, radius 1 / sqrt(pi), angle 0 at its first vertex; the other vertices follow
/// harmonically or, where that flips a triangle, with uniform weights. Other holes stay free; with uniform weights a vertex in the
/// middle of each stands for what is missing.
///
/// # Errors
/// A system that cannot be solved.
pub fn start(chart: &Flat<'_>) -> Result<Start, UnwrapError> {
    let mut circle = Circle::new(chart);
    let harmonic = circle.solve(chart, Weights::Cotangent)?;
    if harmonic.flips == 0 {
        return Ok(harmonic);
    }
    let tutte = circle.solve(chart, Weights::Uniform)?;
    Ok(if tutte.flips <= harmonic.flips { tutte } else { harmonic })
}

/// What may be a start without overlaps, the likely best first: the given one, the harmonic map, and Tutte's, which in exact
/// arithmetic has none.
///
/// # Errors
/// A system that cannot be solved.
pub(super) fn bijective_starts(
    chart: &Flat<'_>,
    given: Option<&[[f64; 2]]>,
) -> Result<Vec<Vec<[f64; 2]>>, UnwrapError> {
    let mut circle = Circle::new(chart);
    let mut starts: Vec<Vec<[f64; 2]>> = given.map(|uv| uv.to_vec()).into_iter().collect();
    for weights in [Weights::Cotangent, Weights::Uniform] {
        starts.push(circle.solve(chart, weights)?.uv);
    }
    Ok(starts)
}

/// The fixed border, and the unknowns.
struct Circle {
    uv: Vec<[f64; 2]>,                             // of the border, 0 elsewhere
    unknown: Vec<u32>,                             // number among the unknowns, FIXED on the border
    hubs: Vec<Vec<u32>>,                           // loops that a vertex is put into
    inner: usize,                                  // unknown vertices of the chart; hubs come after them
    analysis: Option<(SymPattern, Arc<Symbolic>)>, // of the last system
}

const FIXED: u32 = u32::MAX;

impl Circle {
    fn new(chart: &Flat<'_>) -> Self {
        let n = chart.points.len();
        let mut uv = vec![[0.0; 2]; n];
        let mut unknown = vec![0; n];
        let outer = chart.loops.first().map_or(&[][..], |l| l);
        let length = |k: usize| {
            let (a, b) = (chart.points[outer[k] as usize], chart.points[outer[(k + 1) % outer.len()] as usize]);
            (0..3).map(|d| (a[d] - b[d]) * (a[d] - b[d])).sum::<f64>().sqrt()
        };
        // An edge of no length gets a little, or two vertices would share a point of the circle.
        let total: f64 = (0..outer.len()).map(length).sum();
        let least = 1e-6 * total / outer.len().max(1) as f64;
        let lengths: Vec<f64> = (0..outer.len()).map(|k| length(k).max(least)).collect();
        let total: f64 = lengths.iter().sum();
        let radius = std::f64::consts::PI.sqrt().recip();
        let mut along = 0.0;
        for (v, length) in outer.iter().zip(&lengths) {
            let angle = 2.0 * std::f64::consts::PI * along / total;
            uv[*v as usize] = [radius * angle.cos(), radius * angle.sin()];
            unknown[*v as usize] = FIXED;
            along += length;
        }
        let mut inner = 0;
        for to in unknown.iter_mut().filter(|to| **to != FIXED) {
            *to = inner;
            inner += 1;
        }
        let hubs = chart.loops.iter().skip(1).cloned().collect();
        Circle { uv, unknown, hubs, inner: inner as usize, analysis: None }
    }

    /// Pattern and analysis of a system; the harmonic one and Tutte's share them where no hubs come in.
    fn analyze(&mut self, n: usize, edges: &[[u32; 2]]) -> Result<(SymPattern, Arc<Symbolic>), SparseError> {
        match self.analysis.take() {
            Some(known) if known.0.n() == n => Ok(known),
            _ => {
                let pattern = SymPattern::from_edges(n, edges)?;
                let symbolic = Arc::new(Symbolic::analyze(&pattern, Ordering::Auto)?);
                Ok((pattern, symbolic))
            }
        }
    }

    fn solve(&mut self, chart: &Flat<'_>, weights: Weights) -> Result<Start, UnwrapError> {
        let refuse = |e: SparseError| UnwrapError(format!("the start of the map cannot be solved for: {e}"));
        let hubs = if weights == Weights::Uniform { self.hubs.clone() } else { Vec::new() };
        let n = self.inner + hubs.len();
        let mut uv = self.uv.clone();
        if n > 0 {
            let edges = self.edges(chart, weights, &hubs);
            let inner: Vec<[u32; 2]> =
                edges.iter().filter(|(e, _)| e[0] != FIXED && e[1] != FIXED).map(|(e, _)| *e).collect();
            let (pattern, symbolic) = self.analyze(n, &inner).map_err(refuse)?;
            let mut values = vec![0.0; pattern.nnz()];
            let mut rhs = vec![0.0; 2 * n];
            for ([a, b], w) in &edges {
                for (i, j) in [(*a, *b), (*b, *a)] {
                    if i != FIXED {
                        values[pattern.diagonal_slot(i as usize)] += w.weight;
                        if j == FIXED {
                            for d in 0..2 {
                                rhs[2 * i as usize + d] += w.weight * w.border[d];
                            }
                        }
                    }
                }
                if *a != FIXED
                    && *b != FIXED
                    && let Some(slot) = pattern.slot((*a).max(*b) as usize, (*a).min(*b) as usize)
                {
                    values[slot] -= w.weight;
                }
            }
            let mut factor = Cholesky::<f64>::new(symbolic.clone());
            match factor.refactor(&values) {
                Ok(()) => factor.solve_in_place(&mut rhs, 2, &mut SolveScratch::default()).map_err(refuse)?,
                // Slivers can cost cotangents their definiteness; then all is left at the middle, and counts as flipped.
                Err(SparseError::NotPositiveDefinite { .. }) => rhs.fill(0.0),
                Err(e) => return Err(refuse(e)),
            }
            self.analysis = Some((pattern, symbolic));
            for (uv, i) in uv.iter_mut().zip(&self.unknown).filter(|(_, i)| **i != FIXED) {
                *uv = [rhs[2 * *i as usize], rhs[2 * *i as usize + 1]];
            }
        }
        let flips = flips(chart.triangles, &uv);
        Ok(Start { uv, weights: Some(weights), flips })
    }

    /// Edges between unknowns, or from one to the border; an edge may come twice.
    fn edges(&self, chart: &Flat<'_>, weights: Weights, hubs: &[Vec<u32>]) -> Vec<([u32; 2], Spring)> {
        let mut edges = Vec::with_capacity(3 * chart.triangles.len());
        let mut add = |a: u32, b: u32, weight: f64| {
            let (i, j) = (self.unknown[a as usize], self.unknown[b as usize]);
            if i != FIXED || j != FIXED {
                let border = if i == FIXED { self.uv[a as usize] } else { self.uv[b as usize] };
                edges.push(([i, j], Spring { weight, border }));
            }
        };
        for (t, shape) in chart.triangles.iter().zip(chart.shapes.iter()) {
            // Columns of the shape are edges from corner 0.
            let p = [[0.0, 0.0], [shape[0][0], shape[1][0]], [shape[0][1], shape[1][1]]];
            let area2 = shape[0][0] * shape[1][1] - shape[0][1] * shape[1][0];
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let weight = match weights {
                    // Each inner edge comes twice.
                    Weights::Uniform => 0.5,
                    Weights::Cotangent => {
                        let (a, b) = ([p[i][0] - p[k][0], p[i][1] - p[k][1]], [p[j][0] - p[k][0], p[j][1] - p[k][1]]);
                        0.5 * (a[0] * b[0] + a[1] * b[1]) / area2
                    }
                };
                add(t[i], t[j], weight);
            }
        }
        for (h, hub) in hubs.iter().enumerate() {
            for v in hub {
                let i = self.unknown[*v as usize];
                let border = self.uv[*v as usize];
                edges.push(([(self.inner + h) as u32, i], Spring { weight: 1.0, border }));
            }
        }
        edges
    }
}

struct Spring {
    weight: f64,
    border: [f64; 2], // where the end on the border is, if one is there
}
