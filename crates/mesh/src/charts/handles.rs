//! Cutting handles: a short cut graph by tree and cotree.
//!
//! The greedy system of loops of Erickson and Whittlesey ("Greedy optimal homotopy and homology generators", 2005):
//! with T the tree of shortest paths from a base and sigma(e) the length of the loop that edge e closes, the cotree is
//! the spanning tree of the dual of M \ T with the largest sigma. The 2 g edges in neither close the shortest system of
//! loops at the base; their union without dangling ends is the cut graph, and what it leaves is a disk.
//!
//! Holes count as single nodes: a cut that runs into one goes on from anywhere on its rim at no cost.

use std::cmp::Reverse;

use super::graph::{Graph, Growth};
use super::half_edges::{HalfEdges, NONE};

/// Bases are tried as long as the edges that this reads stay below.
const MOST_WORK: usize = 4_000_000;
const MOST_BASES: usize = 8;

/// The edges of a cut graph of the surface, whose holes are nodes of the graph; ascending.
pub(super) fn cut_graph(surface: &HalfEdges, graph: &Graph) -> Vec<u32> {
    let bases = (MOST_WORK / graph.ends.len().max(1)).clamp(1, MOST_BASES);
    // Bases far from each other: each is the farthest from those before.
    let mut spread = Growth::new(graph.n);
    let mut best: Option<(u64, Vec<u32>)> = None;
    let mut base = 0;
    for _ in 0..bases {
        spread.seed(base);
        spread.run(graph, &graph.length);
        base = spread.farthest();
        let cut = from_base(surface, graph, base);
        let cost = cut.iter().map(|&e| graph.cost[e as usize]).sum();
        if best.as_ref().is_none_or(|b| cost < b.0) {
            best = Some((cost, cut));
        }
    }
    best.map(|b| b.1).unwrap_or_default()
}

fn from_base(surface: &HalfEdges, graph: &Graph, base: u32) -> Vec<u32> {
    let mut tree = Growth::new(graph.n);
    tree.seed(base);
    tree.run(graph, &graph.cost);
    let mut in_tree = vec![false; graph.ends.len()];
    tree.via.iter().filter(|&&e| e != NONE).for_each(|&e| in_tree[e as usize] = true);
    let distance = |v: u32| tree.distance[v as usize];
    let sigma = |e: u32| {
        let [a, b] = graph.ends[e as usize];
        distance(a).saturating_add(distance(b)).saturating_add(graph.cost[e as usize])
    };
    let mut rest: Vec<(Reverse<u64>, u32)> =
        (0..graph.ends.len() as u32).filter(|&e| !in_tree[e as usize]).map(|e| (Reverse(sigma(e)), e)).collect();
    rest.sort_unstable();
    let mut cells = Sets::new(surface.n_cells());
    let mut marked = vec![false; graph.ends.len()];
    for (_, e) in rest {
        let h = graph.half_edge[e as usize];
        let cell = |h: u32| surface.cell[h as usize];
        if cells.join(cell(h), cell(surface.mate[h as usize])).is_some() {
            continue;
        }
        marked[e as usize] = true;
        for end in graph.ends[e as usize] {
            for step in tree.path(graph, end) {
                if std::mem::replace(&mut marked[step as usize], true) {
                    break; // the rest of the path is marked too
                }
            }
        }
    }
    prune(graph, &mut marked);
    (0..graph.ends.len() as u32).filter(|&e| marked[e as usize]).collect()
}

/// Removes edges with a free end until there are none.
pub(super) fn prune(graph: &Graph, marked: &mut [bool]) {
    let mut degree = vec![0u32; graph.n];
    for (e, ends) in graph.ends.iter().enumerate().filter(|(e, _)| marked[*e]) {
        debug_assert!(marked[e]);
        ends.iter().for_each(|&v| degree[v as usize] += 1);
    }
    for v in 0..graph.n as u32 {
        let mut v = v;
        while degree[v as usize] == 1 {
            let Some(&e) = graph.at(v).iter().find(|&&e| marked[e as usize]) else { break };
            marked[e as usize] = false;
            degree[v as usize] = 0;
            v = graph.other(e, v);
            degree[v as usize] -= 1;
        }
    }
}

/// Disjoint sets of numbers.
pub(super) struct Sets(Vec<u32>);

impl Sets {
    pub fn new(n: usize) -> Self {
        Sets((0..n as u32).collect())
    }

    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let up = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = up; // halves the path
            i = up;
        }
        i
    }

    /// Joins two sets; the first root stays one. Returns the root that is gone, `None` if they were one set.
    pub fn join(&mut self, a: u32, b: u32) -> Option<u32> {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return None;
        }
        self.0[b as usize] = a;
        Some(b)
    }
}
