//! Cuts that relieve stretch.

use super::shapes::*;
use super::*;

/// A cube without its face x = 1: a disk with four cones.
fn open_box(n: usize) -> Mesh {
    let mut mesh = cube(n);
    let mut faces = crate::Polygons::new();
    mesh.faces.iter().filter(|f| f.iter().any(|&v| mesh.points[v as usize][0] < 1.0)).for_each(|f| faces.push(f));
    mesh.faces = faces;
    mesh
}

#[test]
fn a_cut_goes_to_the_cone_of_a_region() {
    let mesh = open_box(5);
    let out = charted(&mesh);
    let chart = &out.charts[0];
    let region: Vec<u32> = (0..chart.vertices.len() as u32)
        .filter(|&v| mesh.points[chart.vertices[v as usize] as usize].iter().sum::<f64>() < 0.5)
        .collect();
    assert!(region.len() > 4, "the corner and what is around it");
    let cut = relief_cut(&mesh, chart, &region).unwrap();
    let corner = region.iter().copied().find(|&v| mesh.points[chart.vertices[v as usize] as usize] == [0.0; 3]);
    assert_eq!(cut.len(), 5, "along the edge of the cube: {cut:?}");
    assert!(cut.iter().flatten().any(|&v| Some(v) == corner));
    assert_eq!(split(&mesh, chart, &cut).unwrap().len(), 1);
    // Nothing inside, nothing to cut; nonsense is refused.
    assert!(relief_cut(&mesh, chart, &chart.loops[0]).unwrap().is_empty());
    assert!(relief_cut(&mesh, chart, &[]).unwrap().is_empty());
    assert!(relief_cut(&mesh, chart, &[9999]).is_err() && halving_cut(&mesh, chart, 9999).is_err());
}

#[test]
fn a_flat_region_is_cut_to_its_deepest_vertex() {
    let sheet = crate::generate::cloth([10, 10], [1.0, 1.0]).unwrap();
    let out = charted(&sheet);
    // Vertices 13 (two from the border) and 60 (the middle).
    let cut = relief_cut(&sheet, &out.charts[0], &[13, 60]).unwrap();
    assert!(cut.len() == 5 && cut.iter().flatten().any(|&v| v == 60), "{cut:?}");
}

#[test]
fn a_cut_in_two_is_short_and_fair() {
    let sheet = crate::generate::cloth([12, 8], [1.5, 1.0]).unwrap();
    let out = charted(&sheet);
    let (chart, n) = (&out.charts[0], out.charts[0].vertices.len() as u32);
    for through in 0..n {
        let cut = halving_cut(&sheet, chart, through).unwrap();
        assert!(cut.iter().flatten().any(|&v| v == through), "through {through}: {cut:?}");
        let parts = split(&sheet, chart, &cut).unwrap();
        assert_eq!(parts.len(), 2, "through {through}: {cut:?}");
        let lesser = parts.iter().map(|p| p.chart.triangles.len()).min().unwrap();
        assert!(4 * lesser >= chart.triangles.len() / 4, "through {through}: {lesser} triangles");
    }
    // Of one triangle nothing can be made.
    let one = mesh(scattered(3), &[[0, 1, 2]]);
    assert!(halving_cut(&one, &charted(&one).charts[0], 0).unwrap().is_empty());
}

#[test]
fn charts_are_replaced_by_their_parts() {
    let both = together(&[open_box(4), cube(3), open_box(2)]);
    let mut out = charted(&both);
    let parts: Vec<(usize, Vec<Chart>)> = [2, 0]
        .map(|c| {
            let cut = halving_cut(&both, &out.charts[c], 0).unwrap();
            (c, split(&both, &out.charts[c], &cut).unwrap().into_iter().map(|p| p.chart).collect())
        })
        .into();
    let numbers = out.replace(&both, parts).unwrap();
    assert_eq!(numbers, [vec![2, 3], vec![0, 4]]);
    twin::check_all(&both, &out);
    let before = out.clone();
    assert!(out.replace(&both, vec![(0, Vec::new())]).is_err() && out.replace(&both, vec![(9, Vec::new())]).is_err());
    assert_eq!(out, before);
}
