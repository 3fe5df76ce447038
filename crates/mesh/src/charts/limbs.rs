//! Opening closed surfaces: a short tree of edges that reaches every limb.
//!
//! A limb that no cut reaches has a short rim for much area, and every map stretches it: at the rate of a conformal
//! one, exponentially in its length over its girth. So limbs are told by the isoperimetric ratio
//! rho = 4 pi A / P^2 of the parts {d >= t} of the surface, d the distance from the cut: 1 for a flat disk, 2 for a
//! hemisphere, 1 + 2 L / r for a tube of length L and radius r with a flat end. Where rho of a part of some area passes
//! a bound, its farthest point is taken into the tree, until no part passes it.
//! The tree over these terminals is that of Takahashi and Matsuyama (1980): the nearest terminal is joined by a
//! shortest path, again and again. It is at most twice as long as the shortest.

use super::geometry::Metric;
use super::graph::{Graph, Growth};
use super::half_edges::{HalfEdges, NONE};
use super::handles::Sets;
use crate::topology::{Csr, vertex_elements};

/// What counts as a limb.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limbs {
    /// The bound of rho.
    pub ratio: f64,
    /// The least part of the whole area.
    pub least_area: f64,
}

/// Rounds of looking for limbs; each takes all that do not hold another, so that few are needed.
const MOST_ROUNDS: usize = 12;

/// The edges of a tree, or of `given` (a connected set, of the handles) and branches from it; ascending.
/// `node` is the vertex of each half-edge.
pub(super) fn open(
    surface: &HalfEdges,
    node: &[u32],
    graph: &Graph,
    given: &[u32],
    limbs: Limbs,
    metric: &Metric<'_>,
) -> Vec<u32> {
    let shape = Shape::new(surface, node, graph.n, metric);
    let mut terminals = Vec::new();
    let mut cut = given.to_vec();
    if given.is_empty() {
        let far = |from: u32| {
            let mut g = Growth::new(graph.n);
            g.seed(from);
            g.run(graph, &graph.length);
            g.farthest()
        };
        let first = far(0);
        terminals = vec![first, far(first)];
        cut = tree(graph, &terminals, given);
    }
    let mut distance = Growth::new(graph.n);
    for _ in 0..MOST_ROUNDS {
        cut.iter().flat_map(|&e| graph.ends[e as usize]).for_each(|v| distance.seed(v));
        distance.run(graph, &graph.length);
        let found = shape.limbs(&distance.distance, limbs);
        if found.is_empty() {
            break;
        }
        terminals.extend(found);
        cut = tree(graph, &terminals, given);
    }
    at_least_two(graph, &mut cut);
    cut.sort_unstable();
    cut
}

/// A tree of edges over the terminals, or branches from the given edges to them.
fn tree(graph: &Graph, terminals: &[u32], given: &[u32]) -> Vec<u32> {
    let mut waiting = vec![false; graph.n];
    terminals.iter().for_each(|&t| waiting[t as usize] = true);
    let mut growth = Growth::new(graph.n);
    given.iter().flat_map(|&e| graph.ends[e as usize]).for_each(|v| growth.seed(v));
    if given.is_empty()
        && let Some(&first) = terminals.first()
    {
        growth.seed(first);
        waiting[first as usize] = false;
    }
    let mut cut = given.to_vec();
    while let Some(t) = growth.run_until(graph, &graph.cost, |v| waiting[v as usize]) {
        waiting[t as usize] = false;
        let path: Vec<u32> = growth.path(graph, t).collect();
        path.iter().flat_map(|&e| graph.ends[e as usize]).for_each(|v| growth.seed(v));
        cut.extend(path);
    }
    cut
}

/// A cut along one edge opens nothing; a second one at its end makes room.
fn at_least_two(graph: &Graph, cut: &mut Vec<u32>) {
    if let &mut [only] = &mut cut[..]
        && let Some(&e) = graph.at(graph.ends[only as usize][0]).iter().find(|&&e| e != only)
    {
        cut.push(e);
    }
}

/// Triangles over nodes, and what parts of them measure.
struct Shape {
    triangles: Vec<[u32; 3]>,
    midlines: Vec<[f64; 3]>, // opposite to each corner: where a part ends whose border separates this corner
    at: Csr,                 // the triangles at each node
    area: Vec<f64>,          // of each node, a third of its triangles
    whole: f64,
}

impl Shape {
    fn new(surface: &HalfEdges, node: &[u32], n: usize, metric: &Metric<'_>) -> Self {
        let mut triangles = Vec::new();
        let mut midlines = Vec::new();
        let mut area = vec![0.0; n];
        for c in 0..surface.n_cells() {
            let side = surface.side(c);
            for k in side.start + 2..side.end {
                let h = [side.start, k - 1, k];
                let v = h.map(|h| surface.vertex[h]);
                let t = h.map(|h| node[h]);
                triangles.push(t);
                midlines.push([0, 1, 2].map(|i| 0.5 * metric.length(v[(i + 1) % 3], v[(i + 2) % 3])));
                let third = metric.area(v) / 3.0;
                t.iter().for_each(|&i| area[i as usize] += third);
            }
        }
        let at = vertex_elements(n, triangles.iter().map(|t| &t[..]));
        let whole = area.iter().sum();
        Shape { triangles, midlines, at, area, whole }
    }

    /// The farthest node of each limb that holds no smaller one, ascending.
    fn limbs(&self, distance: &[u64], limbs: Limbs) -> Vec<u32> {
        let n = self.area.len();
        let mut order: Vec<u32> = (0..n as u32).filter(|&v| distance[v as usize] != u64::MAX).collect();
        order.sort_unstable_by_key(|&v| (std::cmp::Reverse(distance[v as usize]), v));
        let mut inside = vec![false; n];
        let mut parts = Sets::new(n);
        let mut part = vec![Part { area: 0.0, border: 0.0, tip: NONE, has_limb: false }; n];
        let mut found = Vec::new();
        for (rank, &v) in order.iter().enumerate() {
            if distance[v as usize] == 0 {
                break; // the cut itself
            }
            part[v as usize] = Part { area: self.area[v as usize], border: 0.0, tip: rank as u32, has_limb: false };
            inside[v as usize] = true;
            let mut root = v;
            let mut border = 0.0;
            for &t in self.at.row(v as usize) {
                let (corners, lines) = (self.triangles[t as usize], self.midlines[t as usize]);
                let Some(k) = corners.iter().position(|&c| c == v) else { continue };
                let [a, b] = [(k + 1) % 3, (k + 2) % 3];
                let [in_a, in_b] = [a, b].map(|i| inside[corners[i] as usize]);
                border += match (in_a, in_b) {
                    (false, false) => lines[k],
                    (true, false) => lines[b] - lines[a],
                    (false, true) => lines[a] - lines[b],
                    (true, true) => -lines[k],
                };
                for i in [a, b] {
                    if inside[corners[i] as usize] {
                        root = unite(&mut parts, &mut part, root, corners[i]);
                    }
                }
            }
            let p = &mut part[root as usize];
            p.border += border;
            let rho = 4.0 * std::f64::consts::PI * p.area / (p.border * p.border);
            if !p.has_limb && p.area >= limbs.least_area * self.whole && rho > limbs.ratio {
                p.has_limb = true;
                found.push(order[p.tip as usize]);
            }
        }
        found.sort_unstable();
        found
    }
}

/// A connected part {d >= t}.
#[derive(Clone, Copy, Debug)]
struct Part {
    area: f64,
    border: f64,
    tip: u32, // the rank of its farthest node
    has_limb: bool,
}

/// Joins the parts of two nodes and returns the root of both.
fn unite(sets: &mut Sets, part: &mut [Part], a: u32, b: u32) -> u32 {
    let (a, b) = (sets.root(a), sets.root(b));
    let (keep, gone) = if part[a as usize].area >= part[b as usize].area { (a, b) } else { (b, a) };
    if sets.join(keep, gone).is_some() {
        let other = part[gone as usize];
        let p = &mut part[keep as usize];
        p.area += other.area;
        p.border += other.border;
        p.has_limb |= other.has_limb;
        p.tip = p.tip.min(other.tip);
    }
    keep
}
