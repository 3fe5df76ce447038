//! Every format: what is written comes back bit for bit, and nothing is left behind on failure.

use std::fs;
use std::path::{Path, PathBuf};

use proxel_mesh::generate::{CellSplit, beam, cloth};
use proxel_mesh::topology::surface;
use proxel_mesh::{
    ErrorKind, Fields, Mesh, Polygons, check_output, not_carried, read_mesh, read_mesh_lenient, read_points, write_mesh,
};

/// A folder of its own that disappears at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("proxel-mesh-{}-{name}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn put(&self, name: &str, text: &str) -> PathBuf {
        let path = self.file(name);
        fs::write(&path, text).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).unwrap();
    }
}

/// Coordinates that need all 17 digits, the extremes and the signed zero among them.
fn nasty(mut mesh: Mesh) -> Mesh {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    for p in &mut mesh.points {
        for c in p {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            *c += 1e-3 * (state >> 11) as f64 / (1u64 << 53) as f64;
        }
    }
    mesh.points[0] = [-0.0, f64::MIN_POSITIVE / 3.0, 1e300];
    mesh
}

fn body() -> Mesh {
    let mut mesh = nasty(beam([3, 2, 2], [3.0, 2.0, 2.0], CellSplit::Six).unwrap());
    mesh.tet_regions = Some((0..mesh.tets.len() as i32).map(|i| i % 3).collect());
    mesh
}

/// A triangle, a quad and a pentagon over the vertices of a grid.
fn polygons() -> Mesh {
    let mut mesh = nasty(cloth([3, 3], [1.0, 1.0]).unwrap());
    mesh.faces = Polygons::new();
    mesh.faces.push(&[0, 1, 4]);
    mesh.faces.push(&[1, 2, 6, 5]);
    mesh.faces.push(&[4, 5, 9, 12, 8]);
    mesh
}

fn bits(points: &[[f64; 3]]) -> Vec<[u64; 3]> {
    points.iter().map(|p| p.map(f64::to_bits)).collect()
}

fn round_trip(folder: &Folder, name: &str, mesh: &Mesh) -> Mesh {
    let path = folder.file(name);
    write_mesh(&path, mesh, &Fields::none()).unwrap();
    let back = read_mesh(&path).unwrap();
    assert_eq!(bits(&back.points), bits(&mesh.points), "{name}");
    assert_eq!(bits(&read_points(&path).unwrap()), bits(&mesh.points), "{name}");
    back
}

#[test]
fn bodies_come_back() {
    let folder = Folder::new("bodies");
    let mut mesh = body();
    for base in [0, 1] {
        mesh.index_base = base;
        for name in ["a.node", "b.ele", "c.mesh", "d.msh", "e.vtk", "f.vtu"] {
            let back = round_trip(&folder, name, &mesh);
            assert_eq!(back.tets, mesh.tets, "{name}");
            assert_eq!(back.tet_regions, mesh.tet_regions, "{name}");
            if name.ends_with("node") || name.ends_with("ele") {
                assert_eq!(back.index_base, base);
            }
        }
    }
    assert!(folder.file("a.ele").is_file() && folder.file("b.node").is_file());
}

#[test]
fn surface_formats_get_the_boundary_and_every_vertex() {
    let folder = Folder::new("boundary");
    let mesh = body();
    for name in ["a.obj", "b.ply", "c.off"] {
        let back = round_trip(&folder, name, &mesh);
        assert!(back.tets.is_empty());
        assert_eq!(back.faces, surface(&mesh), "{name}");
        assert_eq!(not_carried(Path::new(name), &mesh, &Fields::none()).unwrap(), ["tetrahedra", "regions"]);
    }
}

#[test]
fn polygons_come_back_in_order() {
    let folder = Folder::new("polygons");
    let mut mesh = polygons();
    mesh.edges = vec![[0, 5], [5, 3]];
    for name in ["a.obj", "b.ply", "c.vtk", "d.vtu", "e.off"] {
        let back = round_trip(&folder, name, &mesh);
        assert_eq!(back.faces, mesh.faces, "{name}");
        if name != "e.off" {
            assert_eq!(back.edges, mesh.edges, "{name}");
        }
    }
    for name in ["a.mesh", "b.msh", "c.node"] {
        let e = write_mesh(&folder.file(name), &mesh, &Fields::none()).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Unsupported, "{e}");
        assert!(!folder.file(name).exists());
    }
}

#[test]
fn triangles_quads_and_edges_with_regions() {
    let folder = Folder::new("regions");
    let mut mesh = polygons();
    mesh.faces = Polygons::new();
    mesh.faces.push(&[0, 1, 4]);
    mesh.faces.push(&[1, 2, 6, 5]);
    mesh.edges = vec![[0, 5], [5, 3]];
    mesh.face_regions = Some(vec![4, 2]);
    mesh.edge_regions = Some(vec![9, 0]);
    for name in ["a.mesh", "b.msh", "c.vtk", "d.vtu"] {
        let back = round_trip(&folder, name, &mesh);
        assert_eq!((&back.faces, &back.edges), (&mesh.faces, &mesh.edges), "{name}");
        assert_eq!((&back.face_regions, &back.edge_regions), (&mesh.face_regions, &mesh.edge_regions), "{name}");
    }
}

#[test]
fn planar_meshes_stay_planar() {
    let folder = Folder::new("planar");
    let mut mesh = cloth([3, 2], [1.0, 1.0]).unwrap();
    mesh.planar = true;
    for name in ["a.node", "b.mesh"] {
        let back = round_trip(&folder, name, &mesh);
        assert!(back.planar, "{name}");
        assert_eq!(back.faces, mesh.faces);
    }
}

#[test]
fn stl_is_a_soup_welded_by_bits() {
    let folder = Folder::new("stl");
    let mesh = nasty(cloth([4, 4], [1.0, 1.0]).unwrap());
    let path = folder.file("a.stl");
    write_mesh(&path, &mesh, &Fields::none()).unwrap();
    let back = read_mesh(&path).unwrap();
    assert_eq!((back.points.len(), back.faces.len()), (mesh.points.len(), mesh.faces.len()));
    for (p, q) in back.faces.iter().zip(mesh.faces.iter()) {
        for (&a, &b) in p.iter().zip(q) {
            assert_eq!(back.points[a as usize].map(f64::to_bits), mesh.points[b as usize].map(f64::to_bits));
        }
    }
}

#[test]
fn arrays_of_positions() {
    let folder = Folder::new("npy");
    let mesh = body();
    let path = folder.file("a.npy");
    write_mesh(&path, &mesh, &Fields::none()).unwrap();
    assert_eq!(bits(&read_points(&path).unwrap()), bits(&mesh.points));
    assert_eq!(read_mesh(&path).unwrap_err().kind(), ErrorKind::Unsupported);
}

#[test]
fn fields_go_with_vtk_vtu_and_ply() {
    let folder = Folder::new("fields");
    let mesh = body();
    let mut fields = Fields::none();
    fields.point("displacement <m>", 3, vec![0.5; 3 * mesh.points.len()]);
    fields.cell("stress", 9, vec![0.25; 9 * mesh.tets.len()]);
    for name in ["a.vtk", "b.vtu", "c.ply"] {
        let path = folder.file(name);
        write_mesh(&path, &mesh, &fields).unwrap();
        let back = read_mesh(&path).unwrap();
        assert_eq!(bits(&back.points), bits(&mesh.points), "{name}");
    }
    let vtu = String::from_utf8_lossy(&fs::read(folder.file("b.vtu")).unwrap()).into_owned();
    assert!(vtu.contains(r#"Name="displacement &lt;m&gt;" NumberOfComponents="3""#));
    let header = String::from_utf8_lossy(&fs::read(folder.file("c.ply")).unwrap()).into_owned();
    assert!(header.contains("property double displacement_<m>_z"));
    assert_eq!(not_carried(Path::new("c.ply"), &mesh, &fields).unwrap(), ["tetrahedra", "regions", "cell arrays"]);
    fields.point("short", 1, vec![0.0; 3]);
    let e = write_mesh(&folder.file("d.vtu"), &mesh, &fields).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::CountMismatch);
}

#[test]
fn a_failed_write_leaves_nothing() {
    let folder = Folder::new("failed");
    let mesh = body();
    let e = write_mesh(&folder.file("none/a.vtu"), &mesh, &Fields::none()).unwrap_err();
    assert!(e.to_string().contains("there is no folder"), "{e}");
    // The .ele of the pair cannot be written: then there is no .node either.
    fs::create_dir(folder.file("a.ele")).unwrap();
    let e = write_mesh(&folder.file("a.node"), &mesh, &Fields::none()).unwrap_err();
    assert!(e.to_string().contains("a.ele: cannot write: it is a folder"), "{e}");
    assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 1);
    // The same can be known beforehand, and asking changes nothing.
    assert!(check_output(&folder.file("a.node")).is_err());
    assert!(check_output(&folder.file("none/a.vtu")).is_err());
    assert!(check_output(&folder.file("a.xyz")).is_err());
    check_output(&folder.file("b.node")).unwrap();
    assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 1);
}

#[test]
fn bad_files_are_named_with_item_and_remedy() {
    let folder = Folder::new("bad");
    let node = "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n";
    // File, .node, .ele, kind, what the message must hold.
    let cases = [
        ("truncated", "4 3 0 0\n0 0 0 0\n1 1 0 0\n", "", ErrorKind::OversizedClaim, "truncated"),
        (
            "cut",
            "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0.00000",
            "",
            ErrorKind::Truncated,
            "line 5: vertex 3 (0-based): the line ends before a coordinate",
        ),
        (
            "word",
            &node.replace("0 1 0", "0 one 0"),
            "",
            ErrorKind::NotANumber,
            "line 4: vertex 2 (0-based): `one` is no number",
        ),
        (
            "nan",
            &node.replace("0 1 0", "0 NaN 0"),
            "",
            ErrorKind::NonFinite,
            "line 4: vertex 2 (0-based): coordinate `NaN` is not finite",
        ),
        (
            "inf",
            &node.replace("0 1 0", "0 1e999 0"),
            "",
            ErrorKind::NonFinite,
            "line 4: vertex 2 (0-based): coordinate `1e999` is not finite",
        ),
        (
            "range",
            node,
            "1 4 0\n0 0 1 2 4\n",
            ErrorKind::IndexOutOfRange,
            "line 2: tetrahedron 0 (0-based): vertex index 4 is out of range",
        ),
        (
            "negative",
            node,
            "1 4 0\n0 0 1 2 -3\n",
            ErrorKind::NegativeIndex,
            "line 2: tetrahedron 0 (0-based): vertex index -3 is negative",
        ),
        (
            "repeated",
            node,
            "1 4 0\n0 0 1 2 2\n",
            ErrorKind::RepeatedVertex,
            "tetrahedron 0 (0-based): vertex 2 occurs twice",
        ),
        ("empty", "0 3 0 0\n", "0 4 0\n", ErrorKind::Empty, "no vertices"),
        ("hollow", node, "0 4 0\n", ErrorKind::Empty, "no elements"),
        ("nothing", "", "", ErrorKind::Truncated, "the file ends before the number of vertices"),
        ("binary", "\u{0}\u{1}", "", ErrorKind::Malformed, "binary data"),
        ("huge", "999999999999 3 0 0\n0 0 0 0\n", "", ErrorKind::OversizedClaim, "999999999999 vertices are announced"),
        (
            "extra",
            &format!("{node}4 1 1 1\n"),
            "1 4 0\n0 0 1 2 3\n",
            ErrorKind::CountMismatch,
            "line 6: more lines than the 4 vertices",
        ),
    ];
    for (name, nodes, elements, kind, part) in cases {
        folder.put(&format!("{name}.node"), nodes);
        folder.put(&format!("{name}.ele"), elements);
        let e = read_mesh(&folder.file(&format!("{name}.node"))).unwrap_err();
        let text = e.to_string();
        assert_eq!(e.kind(), kind, "{text}");
        assert!(text.contains(part), "`{part}` is not in `{text}`");
        assert!(text.contains(name) && text.lines().count() == 1 && !e.remedy().is_empty(), "{text}");
    }
    let e = read_mesh(&folder.file("absent.obj")).unwrap_err();
    assert_eq!((e.kind(), e.to_string().contains("no such file")), (ErrorKind::NotFound, true));
    let e = read_mesh(&folder.put("alone.node", node)).unwrap_err();
    assert!(e.to_string().contains("alone.ele: no such file, though"), "{e}");
    for name in ["a.xyz", "a", "a.meshb"] {
        let e = read_mesh(&folder.put(name, "x")).unwrap_err();
        assert!(matches!(e.kind(), ErrorKind::UnknownFormat | ErrorKind::Unsupported), "{e}");
    }
    let e = read_mesh(&folder.put("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1000001\n")).unwrap_err();
    assert!(
        e.to_string().ends_with(
            "a.obj: face 0 (0-based): vertex index 1000001 is out of range, the 3 vertices are \
             numbered 1 to 3; correct the index or add the missing vertices"
        ),
        "{e}"
    );
    let twice = folder.put("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2\n");
    assert_eq!(read_mesh(&twice).unwrap_err().kind(), ErrorKind::RepeatedVertex);
    assert_eq!(read_mesh_lenient(&twice).unwrap().faces.len(), 1);
    assert_eq!(read_mesh(&folder.put("c.obj", "")).unwrap_err().kind(), ErrorKind::Empty);
}
