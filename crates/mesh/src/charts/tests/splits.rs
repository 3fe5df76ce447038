//! Charts that are cut further.

use super::shapes::*;
use super::*;

/// Splits a chart and holds the result against charts that are made with these seams from the start.
fn split_and_compare(mesh: &Mesh, seams: &[[u32; 2]]) -> Charts {
    let mut out = charted(mesh);
    let old = out.charts[0].clone();
    let local = |v: u32| old.vertices.iter().position(|&w| w == v).unwrap() as u32;
    let edges: Vec<_> = seams.iter().map(|&[a, b]| [local(b), local(a)]).collect();
    let parts = out.split(mesh, 0, &edges).unwrap();
    twin::check_all(mesh, &out);
    let direct = with_seams(mesh, seams);
    assert_eq!(
        (out.charts.clone(), out.places.clone(), out.seams.clone()),
        (direct.charts, direct.places, direct.seams)
    );
    for (i, parent) in parts {
        let before = parent.iter().map(|&v| old.vertices[v as usize]);
        assert!(before.eq(out.charts[i].vertices.iter().copied()));
    }
    out
}

#[test]
fn splitting_is_cutting_from_the_start() {
    for quads in [false, true] {
        let mut strip = annulus(8, 3, quads);
        // Some faces the other way round.
        let mut faces = crate::Polygons::new();
        for (i, p) in strip.faces.iter().enumerate() {
            let mut p = p.to_vec();
            if i % 5 == 3 {
                p[1..].reverse();
            }
            faces.push(&p);
        }
        strip.faces = faces;
        let across: Vec<[u32; 2]> = (0..3).map(|j| [j, j + 1]).collect();
        assert_eq!(loops(&split_and_compare(&strip, &across)), [1]);
        let both: Vec<[u32; 2]> = across.iter().copied().chain(across.iter().map(|e| e.map(|v| v + 16))).collect();
        assert_eq!(loops(&split_and_compare(&strip, &both)), [1, 1]);
        let around: Vec<[u32; 2]> = (0..8).map(|i| [4 * i + 1, 4 * ((i + 1) % 8) + 1]).collect();
        assert_eq!(loops(&split_and_compare(&strip, &around)), [2, 2]);
    }
}

#[test]
fn nonsense_is_refused() {
    let quads = grid(4, 2, [false, false], false, true);
    let out = charted(&quads);
    let chart = &out.charts[0];
    let text = |e: crate::MeshError| e.to_string();
    // A diagonal is no edge.
    assert!(text(split(&quads, chart, &[[0, 4]]).unwrap_err()).contains("vertices 0 and 4"));
    assert!(split(&quads, chart, &[[0, 99]]).is_err());
    let mut broken = chart.clone();
    broken.triangles.swap(0, 3);
    assert!(split(&quads, &broken, &[]).is_err());
    broken.triangles.pop();
    assert!(split(&quads, &broken, &[]).is_err());
    assert!(charted(&quads).split(&quads, 1, &[]).is_err());
}
