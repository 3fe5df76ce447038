//! The real files in the folder that `PROXEL_DATA` names; without it each test says so and passes.

use std::path::PathBuf;

use proxel_mesh::check::{check_tets, require_volumes};
use proxel_mesh::embed::embed;
use proxel_mesh::refine::refine;
use proxel_mesh::topology::{mesh_components, tet_faces};
use proxel_mesh::{read_mesh, read_points};

/// Model, vertices, tetrahedra, index base.
const QUASISTATIC: [(&str, usize, usize, u32); 9] = [
    ("stretch", 4913, 20480, 0),
    ("shear", 4913, 20480, 0),
    ("untwist", 4961, 20000, 0),
    ("dancer", 15681, 54948, 1),
    ("dino", 16115, 58191, 1),
    ("homer", 16592, 61257, 1),
    ("cat", 24519, 94441, 0),
    ("dinoskel", 24786, 93318, 0),
    ("centaur", 26118, 98210, 0),
];

fn data(folder: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("PROXEL_DATA") else {
        println!("skipped: PROXEL_DATA names no folder with data");
        return None;
    };
    let path = PathBuf::from(root).join(folder);
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: {} is missing", path.display());
    None
}

#[test]
fn quasistatic_models_load_and_are_sound() {
    let Some(folder) = data("quasistatic") else { return };
    for (name, n_verts, n_tets, base) in QUASISTATIC {
        let model = folder.join(name);
        let mesh = read_mesh(&model.join("rest.node")).unwrap();
        assert_eq!((mesh.points.len(), mesh.tets.len(), mesh.index_base), (n_verts, n_tets, base), "{name}");
        assert_eq!(mesh.tets, read_mesh(&model.join("rest.ele")).unwrap().tets);
        assert_eq!(mesh.tets, read_mesh(&model.join("rest")).unwrap().tets);
        let check = require_volumes(&mesh).unwrap();
        let ratio = check.volumes.0 / check.volumes.1;
        println!("{name}: {} slivers, smallest volume {ratio:.1e} of the largest", check.slivers.len());
        assert!(ratio > 0.0);
        let components = mesh_components(&mesh);
        assert_eq!((components.count, components.unreferenced().count()), (1, 0), "{name}");
        assert!(tet_faces(&mesh.tets).non_manifold.is_empty());
        for start in ["init.node", "solution.node", "minimum.npy"] {
            assert_eq!(read_points(&model.join(start)).unwrap().len(), n_verts, "{name}/{start}");
        }
    }
}

#[test]
fn refined_models_keep_volume_and_orientation() {
    let Some(folder) = data("quasistatic") else { return };
    for (name, ..) in QUASISTATIC {
        let mesh = read_mesh(&folder.join(name).join("rest.node")).unwrap();
        let fine = refine(&mesh).unwrap().mesh;
        let (before, after) = (check_tets(&mesh.points, &mesh.tets), check_tets(&fine.points, &fine.tets));
        assert_eq!(fine.tets.len(), 8 * mesh.tets.len());
        assert_eq!((after.negative.len(), after.zero.len()), (0, 0), "{name}");
        assert!((after.total / before.total - 1.0).abs() < 1e-12, "{name}");
    }
}

#[test]
fn surfaces_keep_their_polygons() {
    // File, vertices, triangles, quads, larger polygons.
    let expected = [
        ("surfaces/spot.obj", 2930, 5856, 0, 0),
        ("surfaces/suzanne.obj", 507, 32, 468, 0),
        ("surfaces/teapot.obj", 3644, 6320, 0, 0),
        ("geometry/airport3k_poly.obj", 2570, 40, 2391, 44),
        ("geometry/costa2k_poly.obj", 2908, 0, 2825, 0),
        ("geodesic/bunny_nf42k.obj", 21168, 42332, 0, 0),
        ("parameterization/dino.obj", 24605, 47960, 0, 0),
        ("simulation/cloth.obj", 1251, 2400, 0, 0),
    ];
    let Some(root) = data(".") else { return };
    for (file, n_verts, triangles, quads, polygons) in expected {
        let mesh = read_mesh(&root.join(file)).unwrap();
        let of = |sizes: std::ops::RangeFrom<usize>| mesh.faces.iter().filter(|p| sizes.contains(&p.len())).count();
        assert_eq!(mesh.points.len(), n_verts, "{file}");
        assert_eq!((of(3..) - of(4..), of(4..) - of(5..), of(5..)), (triangles, quads, polygons), "{file}");
    }
    let box768 = read_mesh(&root.join("simulation/box768.node")).unwrap();
    assert_eq!((box768.points.len(), box768.tets.len()), (413, 1175));
    let horse759 = read_mesh(&root.join("simulation/horse759.ele")).unwrap();
    assert_eq!((horse759.points.len(), horse759.tets.len()), (962, 3221));
}

/// Surface, and its vertices, all of which must find a tetrahedron.
const SURFACES: [(&str, usize); 6] = [
    ("spot", 2930),
    ("stanford-bunny", 35947),
    ("suzanne", 507),
    ("cheburashka", 6669),
    ("fandisk", 6475),
    ("teapot", 3644),
];

#[test]
fn surfaces_are_embedded() {
    let Some(folder) = data("surfaces") else { return };
    for (name, n_verts) in SURFACES {
        let mesh = read_mesh(&folder.join(format!("{name}.obj"))).unwrap();
        assert_eq!(mesh.n_verts(), n_verts, "{name}");
        let e = embed(&mesh, 24).unwrap();
        println!(
            "{name}: closed {:.3}, {} tetrahedra, {} joins, {} unreferenced",
            e.closedness,
            e.lattice.tets.len(),
            e.joins.len(),
            e.tet_of.iter().filter(|t| t.is_none()).count()
        );
        require_volumes(&e.lattice).unwrap();
        let unused = mesh_components(&mesh).unreferenced().count();
        assert_eq!(e.tet_of.iter().filter(|t| t.is_none()).count(), unused, "{name}");
        let back = e.carry(&e.lattice.points, &mesh.points);
        let size = e.cell * 24.0;
        for (p, q) in mesh.points.iter().zip(&back) {
            assert!((0..3).all(|d| (p[d] - q[d]).abs() < 1e-12 * size), "{name}");
        }
    }
}
