//! Shapes of every genus, open and closed, one-sided, pinched and branching.

use super::shapes::*;
use super::*;

/// Vertices, loops and seam edges of a single chart.
fn single(out: &Charts) -> (usize, usize, usize) {
    assert_eq!(out.charts.len(), 1, "{:?}", out.repairs);
    (out.charts[0].vertices.len(), out.charts[0].loops.len(), out.seams.len())
}

#[test]
fn disks_and_flat_rings_are_not_cut() {
    let disk = crate::generate::cloth([7, 5], [1.0, 1.0]).unwrap();
    assert_eq!(single(&charted(&disk)), (48, 1, 0));
    assert_eq!(charted(&disk).charts[0].triangles, disk.faces.as_triangles().unwrap());
    assert_eq!(disk_defect(&disk), None);
    let triangle = mesh(scattered(3), &[[2, 0, 1]]);
    let out = charted(&triangle);
    assert_eq!((single(&out), &out.charts[0].loops), ((3, 1, 0), &vec![vec![0, 1, 2]]));
    for quads in [false, true] {
        let annulus = annulus(12, 3, quads);
        assert_eq!(single(&charted(&annulus)), (48, 2, 0));
        assert!(disk_defect(&annulus).unwrap().contains("2 loops"));
    }
    // The longer of two loops comes first, though it has the larger vertices.
    let ring = |radius: f64| {
        (0..8)
            .map(move |k| std::f64::consts::TAU * f64::from(k) / 8.0)
            .map(move |a| [radius * a.cos(), radius * a.sin(), 0.0])
    };
    let points: Vec<_> = ring(1.0).chain(ring(2.0)).collect();
    let strip: Vec<[u32; 3]> =
        (0..8).flat_map(|k| [[k, 8 + k, 8 + (k + 1) % 8], [k, 8 + (k + 1) % 8, (k + 1) % 8]]).collect();
    let out = charted(&mesh(points, &strip));
    assert_eq!(out.charts[0].loops.iter().map(|l| l[0]).collect::<Vec<_>>(), [8, 0]);
}

#[test]
fn closed_surfaces_of_genus_0_become_one_disk() {
    let ball = skin(&crate::generate::ball(1.0, 0.3).unwrap());
    for (name, mesh, loops) in [
        ("tetrahedron", tetrahedron(), 1),
        ("cube of one quad a side", cube(1), 1),
        ("cube", cube(6), 1),
        ("ball", ball, 1),
    ] {
        let out = charted(&mesh);
        let used = crate::check::surface_topology(mesh.n_verts(), &mesh.faces).n_verts;
        let (n, l, seams) = single(&out);
        // A tree of k edges splits its k + 1 vertices into a loop of 2 k.
        assert_eq!((n, l), (used + seams - 1, loops), "{name}");
        assert!(seams >= 2 && out.charts[0].is_disk());
        assert_eq!(out.charts[0].loops[0].len(), 2 * seams);
        assert!(disk_defect(&mesh).unwrap().contains("no boundary"));
    }
}

#[test]
fn limbs_are_reached_by_the_cut() {
    let settings = crate::generate::OctopusSettings { cell: 0.15, ..Default::default() };
    let octopus = crate::generate::octopus(&settings).unwrap();
    let out = charted(&skin(&octopus.mesh));
    assert_eq!(single(&out).1, 1);
    for (i, arm) in octopus.arms.iter().enumerate() {
        let tip = &arm.tip;
        let reached = out.seams.iter().flatten().any(|v| tip.binary_search(v).is_ok());
        assert!(reached, "arm {i}");
    }
}

#[test]
fn handles_are_cut_with_twice_their_number_of_loops() {
    for (name, mesh) in [
        ("torus", grid(12, 8, [true; 2], false, false)),
        ("torus of quads", grid(12, 8, [true; 2], false, true)),
        ("smallest torus of a grid", grid(3, 3, [true; 2], false, false)),
        ("double torus", double_torus()),
        ("stuffed torus", skin(&crate::generate::torus(1.0, 0.4, 0.2).unwrap())),
    ] {
        let out = charted(&mesh);
        assert_eq!(single(&out).1, 1, "{name}");
        assert!(out.repairs.iter().any(|r| r.contains("handles")), "{name}: {:?}", out.repairs);
    }
    // One cut around the tube (8 edges) and one around the hole (12), less what they share.
    let seams = charted(&grid(12, 8, [true; 2], false, false)).seams.len();
    assert!(seams <= 20, "{seams} edges");
}

#[test]
fn handles_with_holes_keep_the_holes_that_the_cut_misses() {
    let mut triangles = grid(16, 12, [true; 2], false, false).faces.as_triangles().unwrap();
    let points = grid(16, 12, [true; 2], false, false).points;
    for f in [300, 200, 100, 0] {
        triangles.remove(f);
    }
    let out = charted(&mesh(points, &triangles));
    let (_, loops, seams) = single(&out);
    assert!((1..=4).contains(&loops) && seams > 0);
}

#[test]
fn one_sided_surfaces_are_cut_where_directions_meet() {
    let moebius = grid(14, 3, [true, false], true, false);
    let out = charted(&moebius);
    // A cut across the strip makes a disk of it.
    assert_eq!(single(&out).1, 1);
    assert!(out.seams.len() <= 8, "{} edges for a strip of 3", out.seams.len());
    assert!(out.repairs.iter().any(|r| r.contains("one-sided")));
    let klein = charted(&grid(12, 9, [true; 2], true, false));
    assert!(klein.repairs.iter().any(|r| r.contains("one-sided")));
    assert_eq!(klein.charts.len(), 1);
    // The projective plane of six vertices.
    let plane = mesh(
        scattered(6),
        &[[0, 1, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2], [0, 2, 1], [1, 2, 3], [1, 3, 5], [1, 5, 4], [2, 3, 4], [2, 4, 5]],
    );
    assert!(!charted(&plane).seams.is_empty());
}

#[test]
fn a_reversed_face_is_turned_and_named() {
    let cloth = crate::generate::cloth([4, 4], [1.0, 1.0]).unwrap();
    let mut triangles = cloth.faces.as_triangles().unwrap();
    triangles[7].swap(0, 1);
    let out = charted(&mesh(cloth.points.clone(), &triangles));
    assert_eq!(out.reversed_faces, [7]);
    assert!(out.repairs[0].starts_with("1 face is listed against"), "{:?}", out.repairs);
    // Most faces decide, also where the first is against them.
    let mut triangles = cloth.faces.as_triangles().unwrap();
    triangles[0].swap(0, 1);
    let out = charted(&mesh(cloth.points.clone(), &triangles));
    assert_eq!(out.reversed_faces, [0]);
    assert!(disk_defect(&mesh(cloth.points, &triangles)).unwrap().contains("same direction"));
}

#[test]
fn branching_edges_go_on_flat_and_end_elsewhere() {
    // Two triangles in a plane and a third upright on their common edge.
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0], [0.5, 0.0, 1.0]];
    let out = charted(&mesh(points, &[[0, 1, 4], [0, 1, 2], [1, 0, 3]]));
    assert_eq!((out.charts.len(), out.seams.clone()), (2, vec![[0, 1]]));
    assert_eq!((out.charts[0].faces.clone(), out.charts[1].faces.clone()), (vec![0], vec![1, 2]));
    assert!(
        out.repairs[0].starts_with("1 edge is joined by three faces or more, the first is 0 1"),
        "{:?}",
        out.repairs
    );
}

#[test]
fn solids_that_touch_along_an_edge_stay_apart() {
    // A cube and its mirror image share one edge: four faces there, two by two.
    let c = cube(2);
    let n = c.points.len() as u32;
    let image = |v: u32| {
        let p = c.points[v as usize];
        if p[0] == 1.0 && p[1] == 1.0 { v } else { v + n }
    };
    let mut faces = c.faces.clone();
    for p in c.faces.iter() {
        faces.push(&p.iter().map(|&v| image(v)).collect::<Vec<_>>());
    }
    let points = c.points.iter().copied().chain(c.points.iter().map(|p| [2.0 - p[0], 2.0 - p[1], p[2]])).collect();
    let out = charted(&Mesh { name: "two cubes".into(), points, faces, ..Mesh::default() });
    assert_eq!(loops(&out), [1, 1], "{:?}", out.repairs);
}

#[test]
fn a_vertex_alone_joins_nothing() {
    let bow = mesh(scattered(5), &[[0, 1, 2], [2, 3, 4]]);
    let out = charted(&bow);
    assert_eq!((loops(&out), out.seams.len()), (vec![1, 1], 0));
    assert!(out.repairs[0].starts_with("1 vertex joins parts"), "{:?}", out.repairs);
    assert_eq!(disk_defect(&bow).unwrap(), "it has 2 connected parts");
}

#[test]
fn quads_that_share_two_edges_are_parted() {
    // Vertex 1 has two quads only, whose diagonals both join 0 and 2.
    let mut faces = crate::Polygons::new();
    [[0, 1, 2, 3], [2, 1, 0, 4]].iter().for_each(|q| faces.push(q));
    let out = charted(&Mesh { name: "doublet".into(), points: scattered(5), faces, ..Mesh::default() });
    assert_eq!(loops(&out), [1, 1]);
    assert!(out.repairs.iter().any(|r| r.contains("charts of their own") || r.contains("charts of its own")));
}

#[test]
fn components_are_charts_of_their_own() {
    let parts: Vec<Mesh> = (0..44).map(|i| if i % 2 == 0 { cube(2) } else { annulus(5, 2, true) }).collect();
    let out = charted(&together(&parts));
    assert_eq!(loops(&out), (0..44).map(|i| 1 + i % 2).collect::<Vec<_>>());
}

#[test]
fn seams_of_the_user_open_the_surface() {
    let cloth = crate::generate::cloth([4, 4], [1.0, 1.0]).unwrap();
    // Across the whole square, in any order and twice.
    let seam = [[12, 7], [2, 7], [7, 12], [12, 17], [17, 22]];
    let out = with_seams(&cloth, &seam);
    assert_eq!((loops(&out), out.seams.clone()), (vec![1, 1], vec![[2, 7], [7, 12], [12, 17], [17, 22]]));
    // From the border inwards: one chart with a slit.
    let out = with_seams(&cloth, &seam[..2]);
    assert_eq!((single(&out), out.seams.clone()), ((27, 1, 2), vec![[2, 7], [7, 12]]));
    // One edge inside opens nothing, and is said to.
    let out = with_seams(&cloth, &[[7, 12]]);
    assert_eq!(single(&out), (25, 1, 0));
    assert!(out.warnings[0].starts_with("1 seam edge cuts nothing open"), "{:?}", out.warnings);
    let e = charts(&cloth, &ChartOptions { seams: vec![[2, 7], [0, 24]], ..ChartOptions::default() }).unwrap_err();
    assert!(e.to_string().contains("seam 1, from vertex 0 to 24 (0-based), is no edge"), "{e}");
    assert!(charts(&cloth, &ChartOptions { seams: vec![[2, 2]], ..ChartOptions::default() }).is_err());
    assert!(charts(&cloth, &ChartOptions { seams: vec![[2, u32::MAX]], ..ChartOptions::default() }).is_err());
    // A closed surface that the user cuts is not cut again.
    let out = with_seams(&cube(1), &[[0, 1], [1, 2]]);
    assert_eq!(out.seams, [[0, 1], [1, 2]]);
}

#[test]
fn the_same_cut_at_every_scale_and_place() {
    let base = cube(5);
    let seams = charted(&base).seams;
    for (scale, offset) in [(1e-6, 0.0), (1e8, 0.0), (1.0, 1e6), (1e300, 0.0), (1e-300, 0.0)] {
        let points = base.points.iter().map(|p| p.map(|c| scale * c + offset)).collect();
        assert_eq!(charted(&base.with_points(points).unwrap()).seams, seams, "{scale} {offset}");
    }
    // All in one point: topology alone.
    assert_eq!(loops(&charted(&base.with_points(vec![[1.0; 3]; base.n_verts()]).unwrap())), [1]);
}
