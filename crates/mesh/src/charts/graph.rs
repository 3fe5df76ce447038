//! The edges of a surface as a weighted graph, and shortest paths in it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::geometry::{Metric, cosine, quantized};
use super::half_edges::{HalfEdges, NONE, by_group};
use crate::topology::Csr;
use crate::vec3::{add, dot, scale, sub};

/// Nodes are vertices of the surface, or whole holes where they are contracted; edges are pairs of glued half-edges.
pub(super) struct Graph {
    pub n: usize,
    pub ends: Vec<[u32; 2]>,
    pub half_edge: Vec<u32>, // the smaller one of each edge
    pub length: Vec<u64>,
    pub cost: Vec<u64>, // of a seam there
    edges: Csr,         // at each node
}

/// A seam at an edge as sharp as this or sharper (cosine of the angle between normals) has the full discount, and one
/// flatter than the second none.
const SHARP: f64 = 0.0;
const FLAT: f64 = 0.94;
/// What a full discount leaves of the length, at convex and at concave edges: a seam in a crease is hidden, and does
/// not cost stretch.
const CONVEX_COST: f64 = 0.6;
const CONCAVE_COST: f64 = 0.4;

impl Graph {
    /// The graph over the nodes that `node` gives for the start of each half-edge.
    pub fn new(surface: &HalfEdges, node: &[u32], n: usize, metric: &Metric<'_>) -> Self {
        let half_edge: Vec<u32> = (0..surface.len() as u32)
            .filter(|&h| surface.mate[h as usize] != NONE && h < surface.mate[h as usize])
            .collect();
        let ends: Vec<[u32; 2]> =
            half_edge.iter().map(|&h| [node[h as usize], node[surface.next(h) as usize]]).collect();
        let polygon = |cell: usize| &surface.vertex[surface.side(cell)];
        let normals: Vec<_> = (0..surface.n_cells()).map(|c| metric.normal(polygon(c))).collect();
        let centre = |cell: usize| {
            let p = polygon(cell);
            scale(1.0 / p.len() as f64, p.iter().map(|&v| metric.at(v)).fold([0.0; 3], add))
        };
        let (mut length, mut cost) = (Vec::with_capacity(ends.len()), Vec::with_capacity(ends.len()));
        for &h in &half_edge {
            let at = |h: u32| surface.cell[h as usize] as usize;
            let (f, g) = (at(h), at(surface.mate[h as usize]));
            let [a, b] = [h, surface.next(h)].map(|h| surface.vertex[h as usize]);
            let l = metric.length(a, b);
            let sharp = ((FLAT - cosine(normals[f], normals[g])) / (FLAT - SHARP)).clamp(0.0, 1.0);
            let concave = sharp > 0.0 && dot(normals[f], sub(centre(g), metric.at(a))) > 0.0;
            let least = if concave { CONCAVE_COST } else { CONVEX_COST };
            length.push(quantized(l));
            cost.push(quantized(l * (1.0 - (1.0 - least) * sharp)));
        }
        let ends_flat: Vec<u32> = ends.as_flattened().to_vec();
        let mut edges = by_group(&ends_flat, n);
        edges.items.iter_mut().for_each(|i| *i /= 2);
        Graph { n, ends, half_edge, length, cost, edges }
    }

    /// The edges at a node.
    pub fn at(&self, node: u32) -> &[u32] {
        self.edges.row(node as usize)
    }

    /// The end of an edge that is not `node`.
    pub fn other(&self, edge: u32, node: u32) -> u32 {
        let [a, b] = self.ends[edge as usize];
        if a == node { b } else { a }
    }
}

/// Distances from a set that grows (Dijkstra 1959). Equal ones are told apart by the numbers of nodes, so that paths
/// do not depend on anything else.
pub(super) struct Growth {
    pub distance: Vec<u64>, // u64::MAX where not reached
    pub via: Vec<u32>,      // the edge towards the set; NONE in it
    heap: BinaryHeap<Reverse<(u64, u32)>>,
}

impl Growth {
    pub fn new(n: usize) -> Self {
        Growth { distance: vec![u64::MAX; n], via: vec![NONE; n], heap: BinaryHeap::new() }
    }

    /// Puts a node into the set.
    pub fn seed(&mut self, node: u32) {
        if self.distance[node as usize] > 0 {
            self.distance[node as usize] = 0;
            self.via[node as usize] = NONE;
            self.heap.push(Reverse((0, node)));
        }
    }

    /// Brings all distances up to date.
    pub fn run(&mut self, graph: &Graph, weight: &[u64]) {
        self.run_until(graph, weight, |_| false);
    }

    /// Brings distances up to date up to the first node that is a target, nearest first, and returns that.
    pub fn run_until(&mut self, graph: &Graph, weight: &[u64], is_target: impl Fn(u32) -> bool) -> Option<u32> {
        while let Some(Reverse((d, v))) = self.heap.pop() {
            if d > self.distance[v as usize] {
                continue;
            }
            if is_target(v) {
                self.heap.push(Reverse((d, v)));
                return Some(v);
            }
            for &e in graph.at(v) {
                let w = graph.other(e, v);
                let through = d.saturating_add(weight[e as usize]);
                if through < self.distance[w as usize] {
                    self.distance[w as usize] = through;
                    self.via[w as usize] = e;
                    self.heap.push(Reverse((through, w)));
                }
            }
        }
        None
    }

    /// The edges from a node to the set, in this order.
    pub fn path<'a>(&'a self, graph: &'a Graph, from: u32) -> impl Iterator<Item = u32> + 'a {
        let mut v = from;
        std::iter::from_fn(move || {
            let e = self.via[v as usize];
            (e != NONE).then(|| {
                v = graph.other(e, v);
                e
            })
        })
    }

    /// The farthest node; the first of several.
    pub fn farthest(&self) -> u32 {
        let reached = (0..self.distance.len() as u32).filter(|&v| self.distance[v as usize] != u64::MAX);
        reached.max_by_key(|&v| (self.distance[v as usize], Reverse(v))).unwrap_or(0)
    }
}
