//! Cutting what has no boundary, or handles.

use super::check::euler;
use super::geometry::Metric;
use super::graph::Graph;
use super::half_edges::{HalfEdges, NONE, by_group};
use super::limbs::Limbs;
use super::{ChartOptions, handles, limbs, plural};

/// Opens every connected part that is closed or has handles. Parts of genus 0 with a boundary stay as they are.
pub(super) fn open_parts(
    surface: &mut HalfEdges,
    metric: &Metric<'_>,
    options: &ChartOptions,
    repairs: &mut Vec<String>,
) {
    let (part, n_parts) = surface.components();
    let cells = by_group(&part, n_parts);
    let (mut closed, mut handled) = (0, 0);
    for p in 0..n_parts {
        let (piece, from) = surface.part(cells.row(p));
        let (fan, n_fans) = piece.fans();
        let n_boundary = piece.mate.iter().filter(|&&m| m == NONE).count();
        let loops = piece.boundary_loops();
        let genus = (2 - loops.len() as i64 - euler(&piece, n_fans, n_boundary)) / 2;
        if genus == 0 && !loops.is_empty() {
            continue;
        }
        closed += usize::from(loops.is_empty());
        handled += usize::from(genus > 0);
        let (node, n_nodes) = contract_loops(&piece, fan, n_fans, &loops);
        let graph = Graph::new(&piece, &node, n_nodes, metric);
        let mut cut = if genus > 0 { handles::cut_graph(&piece, &graph) } else { Vec::new() };
        if loops.is_empty() {
            let bound = Limbs { ratio: options.limb_ratio, least_area: options.least_limb };
            cut = limbs::open(&piece, &node, &graph, &cut, bound, metric);
        }
        for e in cut {
            surface.unglue(from[graph.half_edge[e as usize] as usize]);
        }
    }
    if closed > 0 {
        repairs.push(format!(
            "{} no boundary: cut open",
            plural(closed, "part of the surface has", "parts of the surface have")
        ));
    }
    if handled > 0 {
        repairs.push(format!(
            "{} handles: cut along them",
            plural(handled, "part of the surface has", "parts of the surface have")
        ));
    }
}

/// Nodes of half-edges: their fans, with all fans on a loop as one.
fn contract_loops(piece: &HalfEdges, fan: Vec<u32>, n_fans: usize, loops: &crate::topology::Csr) -> (Vec<u32>, usize) {
    if loops.is_empty() {
        return (fan, n_fans);
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
    debug_assert_eq!(fan.len(), piece.len());
    (fan.iter().map(|&f| node[f as usize]).collect(), count as usize)
}
