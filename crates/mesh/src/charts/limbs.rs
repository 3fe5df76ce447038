//! Opening surfaces that are closed or have several boundary loops: a short tree of edges that reaches every limb.
//!
//! A limb that no cut reaches has a short rim for much area, and every map stretches it: at the rate of a conformal
//! one, exponentially in its length over its girth. So limbs are told by the isoperimetric ratio
//! rho = 4 pi A / P^2 of the parts {d >= t} of the surface, d the distance from the cut: 1 for a flat disk, 2 for a
//! hemisphere, 1 + 2 L / r for a tube of length L and radius r with a flat end and 2 L / r for one with an open end.
//! Where rho of a part of some area passes a bound, its farthest point is taken into the tree, until no part passes it;
//! where a hole is about as long as the rim, the part is a tube with an open end, and the hole is taken instead.
//! With holes the tree grows from the longest. One that no tube ends at stays as it is: a map goes around it at no cost.
//! The tree over these terminals is that of Takahashi and Matsuyama (1980): the nearest terminal is joined by a
//! shortest path, again and again. It is at most twice as long as the shortest.

use super::geometry::Metric;
use super::graph::{Graph, Growth};
use super::half_edges::{HalfEdges, NONE};
use super::handles::Sets;
use crate::topology::{Csr, vertex_elements};
use crate::vec3::{V3, lerp, norm, sub};

/// What counts as a limb.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limbs {
    /// The bound of rho.
    pub ratio: f64,
    /// The bound of rho that some part must pass before a surface with holes is cut at all.
    pub least_need: f64,
    /// The least part of the whole area.
    pub least_area: f64,
}

/// Rounds of looking for limbs; each takes all that do not hold another, so that few are needed.
const MOST_ROUNDS: usize = 12;

/// A hole that is no shorter than this part of a rim ends the tube beyond it.
const TUBE_END: f64 = 0.5;

/// The edges of a tree, ascending; none where the surface has holes and nothing beyond the longest needs a cut.
/// `node` is the node of each half-edge's start. Holes are the first nodes, and `holes` are their lengths.
pub(super) fn open(
    surface: &HalfEdges,
    node: &[u32],
    graph: &Graph,
    holes: &[f64],
    limbs: Limbs,
    metric: &Metric<'_>,
) -> Vec<u32> {
    let shape = Shape::new(surface, node, graph.n, holes, metric);
    let mut distance = Growth::new(graph.n);
    let longest = (0..holes.len()).rev().max_by(|&a, &b| holes[a].total_cmp(&holes[b]));
    let mut terminals = match longest {
        Some(hole) => vec![hole as u32],
        None => {
            let far = |from: u32| {
                let mut g = Growth::new(graph.n);
                g.seed(from);
                g.run(graph, &graph.length);
                g.farthest()
            };
            let first = far(0);
            vec![first, far(first)]
        }
    };
    terminals.iter().for_each(|&t| distance.seed(t));
    let mut cut = tree(graph, &terminals);
    for _ in 0..MOST_ROUNDS {
        cut.iter().flat_map(|&e| graph.ends[e as usize]).for_each(|v| distance.seed(v));
        distance.run(graph, &graph.length);
        let ratio = if cut.is_empty() { limbs.least_need } else { limbs.ratio };
        let found = shape.limbs(&distance.distance, Limbs { ratio, ..limbs });
        if found.is_empty() {
            break;
        }
        terminals.extend(found);
        cut = tree(graph, &terminals);
    }
    if holes.is_empty() {
        at_least_two(graph, &mut cut);
    }
    cut.sort_unstable();
    cut
}

/// A tree of edges over the terminals.
fn tree(graph: &Graph, terminals: &[u32]) -> Vec<u32> {
    let mut waiting = vec![false; graph.n];
    terminals.iter().for_each(|&t| waiting[t as usize] = true);
    let mut growth = Growth::new(graph.n);
    if let Some(&first) = terminals.first() {
        growth.seed(first);
        waiting[first as usize] = false;
    }
    let mut cut = Vec::new();
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
struct Shape<'a> {
    holes: &'a [f64],
    triangles: Vec<[u32; 3]>,
    corners: Vec<[V3; 3]>,
    at: Csr,        // the triangles at each node
    area: Vec<f64>, // of each triangle
    whole: f64,
}

/// Levels of the distance at which parts are measured. Few triangles cross more than one, save on coarse meshes.
const LEVELS: usize = 256;

impl<'a> Shape<'a> {
    fn new(surface: &HalfEdges, node: &[u32], n: usize, holes: &'a [f64], metric: &Metric<'_>) -> Self {
        let (mut triangles, mut corners) = (Vec::new(), Vec::new());
        let mut area = Vec::new();
        for c in 0..surface.n_cells() {
            let side = surface.side(c);
            for k in side.start + 2..side.end {
                let h = [side.start, k - 1, k];
                let v = h.map(|h| surface.vertex[h]);
                let t = h.map(|h| node[h]);
                triangles.push(t);
                corners.push(v.map(|v| metric.at(v)));
                area.push(metric.area(v));
            }
        }
        let at = vertex_elements(n, triangles.iter().map(|t| &t[..]));
        let whole = area.iter().sum();
        Shape { holes, triangles, corners, at, area, whole }
    }

    /// The end of each limb that holds no smaller one, ascending: its farthest node, or a hole.
    fn limbs(&self, distance: &[u64], limbs: Limbs) -> Vec<u32> {
        let n = self.at.len();
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
                let end = if (v as usize) < self.holes.len() { v } else { NONE };
                part[v as usize] = Part { tip: next as u32, end, ..Part::default() };
                // A triangle that touches a hole with two corners is listed twice.
                for group in self.at.row(v as usize).chunk_by(|a, b| a == b) {
                    let i = group[0] as usize;
                    let around = || self.triangles[i].into_iter().filter(|&w| inside[w as usize]);
                    around().for_each(|w| unite(&mut sets, &mut part, self.holes, v, w));
                    if around().count() == 3 {
                        part[sets.root(v) as usize].area += self.area[i];
                    }
                }
                next += 1;
            }
            touched.clear();
            for &i in crossing.row(level) {
                let corners = self.triangles[i as usize];
                if let Some(&v) = corners.iter().find(|&&v| inside[v as usize]) {
                    let root = sets.root(v);
                    let p = &mut part[root as usize];
                    p.rim += contour(self.corners[i as usize], corners.map(d), t);
                    p.partial += self.area[i as usize] * portion(corners.map(d), t);
                    touched.push(root);
                }
            }
            touched.sort_unstable();
            touched.dedup();
            for &root in &touched {
                let p = &mut part[root as usize];
                let rim = std::mem::take(&mut p.rim);
                let area = p.area + std::mem::take(&mut p.partial);
                let ratio = 4.0 * std::f64::consts::PI * area / (rim * rim);
                if !p.has_limb && area >= limbs.least_area * self.whole && ratio > limbs.ratio {
                    p.has_limb = true;
                    let is_tube = self.holes.get(p.end as usize).is_some_and(|&l| l >= TUBE_END * rim);
                    found.push(if is_tube { p.end } else { order[p.tip as usize] });
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

/// The part of a triangle's area where a linear function of the values `f` at its corners is at least `t`.
fn portion(f: [f64; 3], t: f64) -> f64 {
    let is_in = f.map(|f| f >= t);
    let n_in = is_in.iter().filter(|&&i| i).count();
    // The corner that is alone on its side of the line.
    let Some(k) = is_in.iter().position(|&i| i == (n_in == 1)) else { return 0.0 };
    let (a, b) = (f[(k + 1) % 3], f[(k + 2) % 3]);
    let tip = (f[k] - t) * (f[k] - t) / ((f[k] - a) * (f[k] - b));
    match n_in {
        0 => 0.0,
        1 => tip,
        2 => 1.0 - tip,
        _ => 1.0,
    }
}

/// A connected part {d >= t}.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    area: f64,    // of the triangles that lie in it
    partial: f64, // of those that reach into it, at the level at hand
    rim: f64,
    tip: u32, // the rank of its farthest node
    end: u32, // its longest hole, NONE without
    has_limb: bool,
}

/// Joins the parts of two nodes.
fn unite(sets: &mut Sets, part: &mut [Part], holes: &[f64], a: u32, b: u32) {
    let (a, b) = (sets.root(a), sets.root(b));
    let (keep, gone) = if part[a as usize].area >= part[b as usize].area { (a, b) } else { (b, a) };
    if sets.join(keep, gone).is_some() {
        let other = part[gone as usize];
        let p = &mut part[keep as usize];
        p.area += other.area;
        p.has_limb |= other.has_limb;
        p.tip = p.tip.min(other.tip);
        let length = |hole: u32| holes.get(hole as usize).copied().unwrap_or(-1.0);
        if (length(other.end), p.end) > (length(p.end), other.end) {
            p.end = other.end; // of equally long ones the first
        }
    }
}
