//! Cutting what has no boundary, handles, or limbs between several boundary loops.

use super::check::euler;
use super::geometry::Metric;
use super::graph::Graph;
use super::half_edges::{HalfEdges, NONE, by_group};
use super::limbs::Limbs;
use super::{ChartOptions, handles, limbs, plural};
use crate::topology::Csr;

/// Opens every connected part that is closed, has handles, or has limbs and several boundary loops. Disks stay as they
/// are, and so does what is flat.
pub(super) fn open_parts(
    surface: &mut HalfEdges,
    metric: &Metric<'_>,
    options: &ChartOptions,
    repairs: &mut Vec<String>,
) {
    let (part, n_parts) = surface.components();
    let cells = by_group(&part, n_parts);
    let (mut closed, mut handled, mut tubular) = (0, 0, 0);
    for p in 0..n_parts {
        let (mut piece, from) = surface.part(cells.row(p));
        let (mut fan, mut n_fans) = piece.fans();
        let n_boundary = piece.mate.iter().filter(|&&m| m == NONE).count();
        let mut loops = piece.boundary_loops();
        let genus = (2 - loops.len() as i64 - euler(&piece, n_fans, n_boundary)) / 2;
        let is_closed = loops.is_empty();
        closed += usize::from(is_closed);
        handled += usize::from(genus > 0);
        if genus > 0 {
            let (node, n_nodes) = contract_loops(&fan, n_fans, &loops);
            let graph = Graph::new(&piece, &node, n_nodes, metric);
            for e in handles::cut_graph(&piece, &graph) {
                let h = graph.half_edge[e as usize];
                piece.unglue(h);
                surface.unglue(from[h as usize]);
            }
            (fan, n_fans) = piece.fans();
            loops = piece.boundary_loops();
        } else if loops.len() == 1 {
            continue;
        }
        let (node, n_nodes) = contract_loops(&fan, n_fans, &loops);
        let graph = Graph::new(&piece, &node, n_nodes, metric);
        let least_need = if is_closed { options.limb_ratio } else { options.least_need };
        let limbs = Limbs { ratio: options.limb_ratio, least_need, least_area: options.least_limb };
        let cut = limbs::open(&piece, &node, &graph, &lengths(&piece, &loops, metric), limbs, metric);
        tubular += usize::from(!is_closed && genus == 0 && !cut.is_empty());
        for e in cut {
            surface.unglue(from[graph.half_edge[e as usize] as usize]);
        }
    }
    for (n, what) in [
        (closed, "no boundary: cut open"),
        (handled, "handles: cut along them"),
        (tubular, "limbs and several boundary loops: cut from the longest loop to the limbs"),
    ] {
        if n > 0 {
            repairs.push(format!("{} {what}", plural(n, "part of the surface has", "parts of the surface have")));
        }
    }
}

/// The lengths of the loops.
fn lengths(piece: &HalfEdges, loops: &Csr, metric: &Metric<'_>) -> Vec<f64> {
    let at = |h: u32| piece.vertex[h as usize];
    let length = |l: usize| loops.row(l).iter().map(|&h| metric.length(at(h), at(piece.next(h)))).sum();
    (0..loops.len()).map(length).collect()
}

/// Nodes of half-edges: their fans, with all fans on a loop as one; those of the loops come first.
fn contract_loops(fan: &[u32], n_fans: usize, loops: &Csr) -> (Vec<u32>, usize) {
    if loops.is_empty() {
        return (fan.to_vec(), n_fans);
    }
    let mut node = vec![NONE; n_fans];
    for l in 0..loops.len() {
        loops.row(l).iter().for_each(|&h| node[fan[h as usize] as usize] = l as u32);
    }
    let mut count = loops.len() as u32;
    for n in node.iter_mut().filter(|n| **n == NONE) {
        *n = count;
        count += 1;
    }
    (fan.iter().map(|&f| node[f as usize]).collect(), count as usize)
}
