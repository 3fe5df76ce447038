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
use super::half_edges::HalfEdges;
use super::handles::Sets;
use crate::topology::{Csr, vertex_elements};
use crate::vec3::{V3, lerp, norm, sub};

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
    corners: Vec<[V3; 3]>,
    at: Csr,        // the triangles at each node
    area: Vec<f64>, // of each node, a third of its triangles
    whole: f64,
}

/// Levels of the distance at which parts are measured. Few triangles cross more than one, save on coarse meshes.
const LEVELS: usize = 256;

impl Shape {
    fn new(surface: &HalfEdges, node: &[u32], n: usize, metric: &Metric<'_>) -> Self {
        let (mut triangles, mut corners) = (Vec::new(), Vec::new());
        let mut area = vec![0.0; n];
        for c in 0..surface.n_cells() {
            let side = surface.side(c);
            for k in side.start + 2..side.end {
                let h = [side.start, k - 1, k];
                let v = h.map(|h| surface.vertex[h]);
                let t = h.map(|h| node[h]);
                triangles.push(t);
                corners.push(v.map(|v| metric.at(v)));
                let third = metric.area(v) / 3.0;
                t.iter().for_each(|&i| area[i as usize] += third);
            }
        }
        let at = vertex_elements(n, triangles.iter().map(|t| &t[..]));
        let whole = area.iter().sum();
        Shape { triangles, corners, at, area, whole }
    }

    /// The farthest node of each limb that holds no smaller one, ascending.
    fn limbs(&self, distance: &[u64], limbs: Limbs) -> Vec<u32> {
        let n = self.area.len();
        let mut order: Vec<u32> = (0..n as u32).filter(|&v| distance[v as usize] != u64::MAX).collect();
        order.sort_unstable_by_key(|&v| (std::cmp::Reverse(distance[v as usize]), v));
        let farthest = order.first().map_or(0, |&v| distance[v as usize]).max(1) as f64;
        let d = |v: u32| distance[v as usize] as f64;
        let value = |level: usize| (level as f64 + 0.5) / LEVELS as f64 * farthest;
        let crossing = self.crossing(&d, farthest);

        let mut sets = Sets::new(n);
        let mut part = vec![Part::default(); n];
        let mut inside = vec![false; n];
        let (mut next, mut found, mut touched) = (0, Vec::new(), Vec::new());
        for level in (0..LEVELS).rev() {
            let t = value(level);
            while let Some(&v) = order.get(next).filter(|&&v| d(v) >= t) {
                inside[v as usize] = true;
                part[v as usize] = Part { area: self.area[v as usize], tip: next as u32, ..Part::default() };
                for &i in self.at.row(v as usize) {
                    let around = self.triangles[i as usize].into_iter().filter(|&w| inside[w as usize]);
                    around.for_each(|w| unite(&mut sets, &mut part, v, w));
                }
                next += 1;
            }
            touched.clear();
            for &i in crossing.row(level) {
                let corners = self.triangles[i as usize];
                if let Some(&v) = corners.iter().find(|&&v| inside[v as usize]) {
                    let root = sets.root(v);
                    part[root as usize].rim += contour(self.corners[i as usize], corners.map(d), t);
                    touched.push(root);
                }
            }
            touched.sort_unstable();
            touched.dedup();
            for &root in &touched {
                let p = &mut part[root as usize];
                let rim = std::mem::take(&mut p.rim);
                let ratio = 4.0 * std::f64::consts::PI * p.area / (rim * rim);
                if !p.has_limb && p.area >= limbs.least_area * self.whole && ratio > limbs.ratio {
                    p.has_limb = true;
                    found.push(order[p.tip as usize]);
                }
            }
        }
        found.sort_unstable();
        found
    }

    /// The triangles that each level crosses.
    fn crossing(&self, d: &impl Fn(u32) -> f64, farthest: f64) -> Csr {
        // The first level whose value (level + 1/2) / LEVELS farthest is above x.
        let above = |x: f64| ((x / farthest * LEVELS as f64 + 0.5).floor().max(0.0) as usize).min(LEVELS);
        let range = |t: &[u32; 3]| {
            let [a, b, c] = t.map(d);
            above(a.min(b).min(c))..above(a.max(b).max(c))
        };
        let mut offsets = vec![0u32; LEVELS + 1];
        for t in &self.triangles {
            range(t).for_each(|l| offsets[l + 1] += 1);
        }
        (0..LEVELS).for_each(|l| offsets[l + 1] += offsets[l]);
        let mut next = offsets.clone();
        let mut items = vec![0; offsets[LEVELS] as usize];
        for (i, t) in self.triangles.iter().enumerate() {
            for l in range(t) {
                items[next[l] as usize] = i as u32;
                next[l] += 1;
            }
        }
        Csr { offsets, items }
    }
}

/// The length of the line in a triangle where a linear function of the values `f` at its corners is `t`.
fn contour(x: [V3; 3], f: [f64; 3], t: f64) -> f64 {
    let mut ends = [[0.0; 3]; 2];
    let mut count = 0;
    for k in 0..3 {
        let (a, b) = (k, (k + 1) % 3);
        if (f[a] < t) != (f[b] < t) && count < 2 {
            ends[count] = lerp(x[a], x[b], (t - f[a]) / (f[b] - f[a]));
            count += 1;
        }
    }
    if count == 2 { norm(sub(ends[0], ends[1])) } else { 0.0 }
}

/// A connected part {d >= t}.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    area: f64,
    rim: f64,
    tip: u32, // the rank of its farthest node
    has_limb: bool,
}

/// Joins the parts of two nodes.
fn unite(sets: &mut Sets, part: &mut [Part], a: u32, b: u32) {
    let (a, b) = (sets.root(a), sets.root(b));
    let (keep, gone) = if part[a as usize].area >= part[b as usize].area { (a, b) } else { (b, a) };
    if sets.join(keep, gone).is_some() {
        let other = part[gone as usize];
        let p = &mut part[keep as usize];
        p.area += other.area;
        p.has_limb |= other.has_limb;
        p.tip = p.tip.min(other.tip);
    }
}
