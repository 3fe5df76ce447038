//! The slow twin: what a chart is, by sets and searches over its triangles alone.

use std::collections::{BTreeMap, BTreeSet};

use super::*;

/// Whether triangles over `n` vertices are a connected oriented manifold of genus 0 with `loops` as its boundary.
pub fn is_chart(chart: &Chart) -> bool {
    let n = chart.vertices.len();
    let mut directed = BTreeSet::new();
    for t in &chart.triangles {
        for k in 0..3 {
            if !directed.insert((t[k], t[(k + 1) % 3])) {
                return false; // the same direction twice: a third triangle, or a turned one
            }
        }
    }
    let undirected: BTreeSet<(u32, u32)> = directed.iter().map(|&(a, b)| (a.min(b), a.max(b))).collect();
    let boundary: BTreeSet<(u32, u32)> =
        directed.iter().filter(|&&(a, b)| !directed.contains(&(b, a))).copied().collect();
    // The link of a vertex: edges opposite to it in its triangles, one path or one ring.
    for v in 0..n as u32 {
        let link: Vec<(u32, u32)> = chart
            .triangles
            .iter()
            .filter_map(|t| t.iter().position(|&c| c == v).map(|k| (t[(k + 1) % 3], t[(k + 2) % 3])))
            .collect();
        if link.is_empty() || parts(link.iter().copied()) != 1 {
            return false;
        }
    }
    // Triangles that share an edge hang together.
    let mut by_edge: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for (i, t) in chart.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            by_edge.entry((a.min(b), a.max(b))).or_default().push(i as u32);
        }
    }
    let own = (0..chart.triangles.len() as u32).map(|i| (i, i));
    if parts(by_edge.values().filter(|l| l.len() == 2).map(|l| (l[0], l[1])).chain(own)) != 1 {
        return false;
    }
    let listed: BTreeSet<(u32, u32)> =
        chart.loops.iter().flat_map(|l| (0..l.len()).map(|k| (l[k], l[(k + 1) % l.len()]))).collect();
    let n_listed: usize = chart.loops.iter().map(Vec::len).sum();
    let euler = n as i64 - undirected.len() as i64 + chart.triangles.len() as i64;
    !boundary.is_empty()
        && listed == boundary
        && n_listed == boundary.len()
        && parts(boundary.iter().copied()) == chart.loops.len()
        && euler == 2 - chart.loops.len() as i64
}

/// The connected parts of a graph, by relabelling until nothing changes.
fn parts(edges: impl Iterator<Item = (u32, u32)>) -> usize {
    let edges: Vec<_> = edges.collect();
    let mut label: BTreeMap<u32, u32> = edges.iter().flat_map(|&(a, b)| [(a, a), (b, b)]).collect();
    loop {
        let mut changed = false;
        for (a, b) in &edges {
            let least = label[a].min(label[b]);
            for v in [a, b] {
                changed |= label.insert(*v, least) != Some(least);
            }
        }
        if !changed {
            return label.values().collect::<BTreeSet<_>>().len();
        }
    }
}

/// What holds for the charts of every mesh.
pub fn check_all(mesh: &Mesh, out: &Charts) {
    // The twin takes time that grows with the square.
    let small = mesh.faces.len() <= 600;
    for (i, chart) in out.charts.iter().enumerate() {
        assert_eq!(chart.defect(), None, "chart {i}");
        if small {
            assert!(is_chart(chart), "chart {i}");
        }
        assert_eq!(chart.triangles.len(), chart.faces.len());
        assert!(chart.vertices.is_sorted() && chart.faces.is_sorted());
    }
    // Each taken face is in one chart, as its fan, in its direction or against it.
    let mut seen = vec![false; mesh.faces.len()];
    for (c, chart) in out.charts.iter().enumerate() {
        let mut k = 0;
        while k < chart.triangles.len() {
            let f = chart.faces[k] as usize;
            let p = mesh.faces.get(f);
            assert!(!std::mem::replace(&mut seen[f], true), "face {f} is in two charts");
            let start = mesh.faces.offsets()[f] as usize;
            let local: Vec<u32> = (start..start + p.len())
                .map(|i| out.places[i].filter(|place| place.chart as usize == c).unwrap().vertex)
                .collect();
            for (i, &v) in local.iter().enumerate() {
                assert_eq!(chart.vertices[v as usize], p[i]);
            }
            let reversed = out.reversed_faces.binary_search(&(f as u32)).is_ok();
            for j in 2..p.len() {
                let fan = [local[0], local[j - 1], local[j]];
                let expected = if reversed { [fan[0], fan[2], fan[1]] } else { fan };
                assert_eq!(chart.triangles[k], expected);
                k += 1;
            }
        }
    }
    // A face is in a chart, or it names a vertex twice, or another face has its vertices.
    let set = |f: usize| mesh.faces.get(f).iter().copied().collect::<BTreeSet<u32>>();
    let mut taken: BTreeMap<BTreeSet<u32>, usize> = BTreeMap::new();
    let missing: Vec<usize> = (0..seen.len()).filter(|&f| !seen[f]).collect();
    if !missing.is_empty() {
        taken = (0..seen.len()).filter(|&f| seen[f]).map(|f| (set(f), f)).collect();
        assert!(!out.repairs.is_empty());
    }
    for f in missing {
        let p = mesh.faces.get(f);
        let start = mesh.faces.offsets()[f] as usize;
        if set(f).len() < p.len() || p.len() < 3 {
            continue;
        }
        let first = taken[&set(f)];
        for (i, v) in p.iter().enumerate() {
            let k = mesh.faces.get(first).iter().position(|w| w == v).unwrap();
            assert_eq!(out.places[start + i], out.places[mesh.faces.offsets()[first] as usize + k]);
        }
    }
    for (place, v) in out.places.iter().zip(mesh.faces.indices()) {
        if let Some(p) = place {
            assert_eq!(out.charts[p.chart as usize].vertices[p.vertex as usize], *v);
        }
    }
    // Majority: a chart has no more reversed faces than others.
    for chart in &out.charts {
        let mut faces = chart.faces.clone();
        faces.dedup();
        let against = faces.iter().filter(|f| out.reversed_faces.binary_search(f).is_ok()).count();
        assert!(2 * against <= faces.len());
    }
    assert!(out.seams.is_sorted() && out.seams.iter().all(|e| e[0] < e[1]));
}
