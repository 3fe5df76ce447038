use super::*;
use crate::check::require_volumes;
use crate::generate::{CellSplit, beam, cloth};
use crate::topology::{mesh_components, surface};
use crate::vec3::{add, scale};

/// The skin of a block, moved.
fn block(cells: [usize; 3], size: V3, at: V3) -> Mesh {
    let body = beam(cells, size, CellSplit::Six).unwrap();
    let points = body.points.iter().map(|&p| add(p, at)).collect();
    Mesh { faces: surface(&body), tets: Vec::new(), points, name: "block".into(), ..body }
}

/// Two meshes as one.
fn both(a: &Mesh, b: &Mesh) -> Mesh {
    let mut out = a.clone();
    let n = a.n_verts() as u32;
    out.points.extend(&b.points);
    for f in b.faces.iter() {
        out.faces.push(&f.iter().map(|v| v + n).collect::<Vec<_>>());
    }
    out
}

fn max_error(a: &[V3], b: &[V3]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// What holds for every embedding.
fn check(mesh: &Mesh, e: &Embedding) {
    let volumes = require_volumes(&e.lattice).unwrap();
    let cell = e.cell.powi(3);
    assert!((volumes.volumes.0 * 6.0 / cell - 1.0).abs() < 1e-9 && (volumes.volumes.1 * 6.0 / cell - 1.0).abs() < 1e-9);
    assert_eq!(e.fill.len(), e.lattice.tets.len());
    assert!(e.fill.iter().all(|f| (LEAST_FILL..=1.0).contains(f)));
    let mut is_used = vec![false; mesh.n_verts()];
    mesh.faces.indices().iter().for_each(|&v| is_used[v as usize] = true);
    for v in 0..mesh.n_verts() {
        assert_eq!(e.tet_of[v].is_some(), is_used[v], "vertex {v}");
        let w = e.weights[v];
        assert!(w.iter().all(|&w| w >= 0.0), "vertex {v}: {w:?}");
        assert!(!is_used[v] || (w.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }
    // Rest positions come back, and affine maps are carried over.
    let size = mesh.points.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    assert!(max_error(&e.carry(&e.lattice.points, &mesh.points), &mesh.points) < 1e-12 * size);
    let affine = |p: &V3| [2.0 * p[0] - p[1] + 3.0, 0.5 * p[2] - p[0], p[1] + p[2] - 1.0];
    let moved: Vec<V3> = e.lattice.points.iter().map(affine).collect();
    let wanted: Vec<V3> =
        mesh.points.iter().enumerate().map(|(v, p)| if is_used[v] { affine(p) } else { *p }).collect();
    assert!(max_error(&e.carry(&moved, &mesh.points), &wanted) < 1e-12 * (3.0 * size + 3.0));
}

#[test]
fn a_block_is_filled_and_its_volume_found() {
    let mesh = block([3, 2, 2], [1.0, 0.61, 0.37], [0.1, 0.2, 0.3]);
    for resolution in [1, 2, 5, 16] {
        let e = embed(&mesh, resolution).unwrap();
        check(&mesh, &e);
        assert!((e.closedness - 0.5).abs() < 1e-3, "{}", e.closedness);
        assert!(e.joins.is_empty());
        assert_eq!(mesh_components(&e.lattice).count, 1);
        if resolution == 16 {
            let volume: f64 = e.fill.iter().map(|f| f * e.cell.powi(3) / 6.0).sum();
            assert!((volume / (0.61 * 0.37) - 1.0).abs() < 0.04, "{volume}");
        }
    }
}

#[test]
fn holes_loose_faces_and_turned_bodies_do_no_harm() {
    let mut mesh = block([4, 4, 4], [1.0; 3], [0.0; 3]);
    let whole = embed(&mesh, 9).unwrap();
    // A hole of two faces; a vertex that nothing uses, far away.
    let faces: Vec<[u32; 3]> = mesh.faces.as_triangles().unwrap();
    mesh.faces = crate::Polygons::from(&faces[2..]);
    mesh.points.push([50.0; 3]);
    let open = embed(&mesh, 9).unwrap();
    check(&mesh, &open);
    assert!(open.closedness > NEARLY_CLOSED && open.closedness < whole.closedness);
    assert_eq!(open.lattice.tets.len(), whole.lattice.tets.len());
    // Inside out.
    let turned: Vec<[u32; 3]> = faces.iter().map(|f| [f[0], f[2], f[1]]).collect();
    mesh.faces = crate::Polygons::from(&turned[..]);
    let turned = embed(&mesh, 9).unwrap();
    assert_eq!((turned.lattice, turned.fill), (whole.lattice, whole.fill));
}

#[test]
fn self_intersections_do_no_harm() {
    let mesh = both(&block([3; 3], [1.0; 3], [0.0; 3]), &block([3; 3], [1.0; 3], [0.55, 0.3, 0.2]));
    let e = embed(&mesh, 16).unwrap();
    check(&mesh, &e);
    assert_eq!(mesh_components(&e.lattice).count, 1);
    let volume: f64 = e.fill.iter().map(|f| f * e.cell.powi(3) / 6.0).sum();
    let union = 2.0 - 0.45 * 0.7 * 0.8;
    assert!((volume / union - 1.0).abs() < 0.05, "{volume} for {union}");
}

#[test]
fn a_cell_is_there_once_for_each_part() {
    // Two slabs with a gap of three quarters of a cell, so that some cells hold parts of both.
    let resolution = 10;
    let gap = 0.075;
    let a = block([4, 4, 2], [1.0, 1.0, 0.3], [0.0; 3]);
    let mesh = both(&a, &block([4, 4, 2], [1.0, 1.0, 0.3], [0.0, 0.0, 0.3 + gap]));
    let e = embed(&mesh, resolution).unwrap();
    check(&mesh, &e);
    assert_eq!(mesh_components(&e.lattice).count, 2, "the slabs are apart");
    assert!(e.joins.is_empty(), "{:?}", e.joins.first());
    // The halves move without each other.
    let c = mesh_components(&e.lattice).of_vertex;
    let moved: Vec<V3> = e
        .lattice
        .points
        .iter()
        .zip(&c)
        .map(|(&p, &c)| if c == Some(0) { p } else { add(p, [0.0, 0.0, 1.0]) })
        .collect();
    let carried = e.carry(&moved, &mesh.points);
    let n = a.n_verts();
    assert!(max_error(&carried[..n], &mesh.points[..n]) < 1e-12);
    let used = |v: &usize| e.tet_of[*v].is_some();
    for v in (n..mesh.n_verts()).filter(used) {
        assert!(max_error(&[carried[v]], &[add(mesh.points[v], [0.0, 0.0, 1.0])]) < 1e-12);
    }
}

#[test]
fn what_is_too_close_is_joined_and_told() {
    let a = block([4, 4, 2], [1.0, 1.0, 0.3], [0.0; 3]);
    let mesh = both(&a, &block([4, 4, 2], [1.0, 1.0, 0.3], [0.0, 0.0, 0.3 + 0.005]));
    let e = embed(&mesh, 10).unwrap();
    check(&mesh, &e);
    assert_eq!(mesh_components(&e.lattice).count, 1);
    assert!(e.joins.len() > 50, "{}", e.joins.len());
    let n = a.faces.len() as u32;
    assert!(e.joins.iter().all(|j| (j.a < n) != (j.b < n)), "each joins the two slabs");
}

#[test]
fn thin_walls_are_parts_of_one_body() {
    // A plate of a fifth of a cell: front and back are in one cell and belong together.
    let mesh = block([5, 5, 1], [1.0, 1.0, 0.02], [0.0; 3]);
    let e = embed(&mesh, 10).unwrap();
    check(&mesh, &e);
    assert!(e.joins.is_empty());
    assert_eq!(mesh_components(&e.lattice).count, 1);
    assert!(e.fill.iter().all(|&f| f < 0.5));
}

#[test]
fn surfaces_without_an_inside_are_refused() {
    let refused = |mesh: &Mesh, resolution: usize, kind: ErrorKind, part: &str| {
        let e = embed(mesh, resolution).unwrap_err();
        assert_eq!(e.kind(), kind, "{e}");
        assert!(e.to_string().contains(part), "{e}");
    };
    let plane = cloth([4, 4], [1.0, 1.0]).unwrap();
    refused(&plane, 8, ErrorKind::ZeroVolume, "no inside");
    let one = Mesh::from_triangles("one", plane.points.clone(), &[[0, 1, 6]]);
    refused(&one, 8, ErrorKind::ZeroVolume, "no inside");
    let flat = Mesh::from_triangles("flat", vec![[1.0, 2.0, 3.0]; 3], &[[0, 1, 2]]);
    refused(&flat, 8, ErrorKind::ZeroVolume, "extent");
    let line = Mesh::from_triangles("line", vec![[0.0; 3], [1.0; 3], [2.0; 3]], &[[0, 1, 2]]);
    refused(&line, 8, ErrorKind::ZeroVolume, "no inside");
    let none = Mesh { faces: crate::Polygons::new(), ..plane.clone() };
    refused(&none, 8, ErrorKind::Empty, "no faces");
    let body = block([2; 3], [1.0; 3], [0.0; 3]);
    refused(&body, 0, ErrorKind::InvalidParameter, "resolution");
    refused(&body, MOST_RESOLUTION + 1, ErrorKind::InvalidParameter, "resolution");
    // Two bodies of which one is turned around: nothing says which of them is right.
    let mut turned = block([2; 3], [1.0; 3], [5.0, 0.0, 0.0]);
    let faces: Vec<[u32; 3]> = turned.faces.as_triangles().unwrap().iter().map(|f| [f[0], f[2], f[1]]).collect();
    turned.faces = crate::Polygons::from(&faces[..]);
    refused(&both(&body, &turned), 8, ErrorKind::ZeroVolume, "no inside");
}

#[test]
fn units_and_origin_do_not_matter_nor_the_number_of_threads() {
    let mesh = both(&block([3; 3], [1.0; 3], [0.0; 3]), &block([3; 3], [0.7; 3], [0.55, 0.3, 0.2]));
    let e = embed(&mesh, 12).unwrap();
    // Vertices may change cells by rounding, where they lie between two; what they are carried to must not.
    let warp = |p: &V3| [p[0] + (2.0 * p[1]).sin(), p[1] * (1.0 + p[0]), p[2] + p[0] * p[0]];
    let carried = |e: &Embedding, s: f64, offset: f64| {
        let local = |p: &V3| p.map(|x| x / s - offset);
        let moved: Vec<V3> = e.lattice.points.iter().map(|p| warp(&local(p))).collect();
        e.carry(&moved, &mesh.points)
    };
    for (s, offset, tolerance) in [(1e-3, 0.0, 1e-12), (1e3, 0.0, 1e-12), (1.0, 1e6, 1e-7)] {
        let points = mesh.points.iter().map(|&p| scale(s, add(p, [offset; 3]))).collect();
        let other = embed(&mesh.with_points(points).unwrap(), 12).unwrap();
        assert_eq!(other.lattice.tets.len(), e.lattice.tets.len());
        assert!(max_error(&carried(&other, s, offset), &carried(&e, 1.0, 0.0)) < tolerance, "{s} {offset}");
    }
    for n in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        assert_eq!(pool.install(|| embed(&mesh, 12).unwrap()), e);
    }
}
