//! Maps through files of each format, and certificates against an independent evaluator on real meshes.

use std::fs;
use std::path::{Path, PathBuf};

use proxel_mesh::uv::{
    Certificate, CertificateOptions, Source, UvMap, as_stored, certify, parse_uv, read_uv, require_uv_format, seams_of,
    write_with_uv,
};
use proxel_mesh::{ErrorKind, Fields, Format, Mesh, Polygons, read_mesh, write_mesh};

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("proxel-uv-{}-{name}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn data(file: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("PROXEL_DATA") else {
        println!("skipped: PROXEL_DATA names no folder with data");
        return None;
    };
    let path = PathBuf::from(root).join(file);
    if path.is_file() {
        return Some(path);
    }
    println!("skipped: {} is missing", path.display());
    None
}

/// A quad and two triangles around a seam from vertex 1 to 4, one face unmapped, and an edge.
fn sample() -> (Mesh, UvMap) {
    let points =
        vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.1], [2.0, 1.0, 0.0], [9.0; 3]];
    let mut faces = Polygons::new();
    let listed: [&[u32]; 4] = [&[0, 1, 4, 3], &[4, 1, 2], &[4, 2, 5], &[0, 3, 6]];
    listed.iter().for_each(|f| faces.push(f));
    let mesh = Mesh { name: "sample".into(), points, faces, edges: vec![[0, 6]], ..Mesh::default() };
    let none = UvMap::NONE;
    let third = 1.0 / 3.0;
    let coordinates =
        vec![[0.0, 0.0], [third, 0.0], [third, 0.1], [0.0, 0.1], [0.5, 0.1], [0.5, 0.0], [0.9, 1e-9], [0.9, 0.1]];
    let corners = vec![0, 1, 2, 3, 4, 5, 6, 4, 6, 7, none, none, none];
    (mesh, UvMap { coordinates, corners })
}

fn values(uv: &UvMap) -> Vec<Option<[f64; 2]>> {
    (0..uv.corners.len()).map(|i| uv.at(i)).collect()
}

#[test]
fn obj_and_ply_give_back_every_bit() {
    let folder = Folder::new("formats");
    let (mesh, uv) = sample();
    assert_eq!(seams_of(&mesh, &uv).unwrap(), [[1, 4]]);
    for name in ["a.obj", "a.ply"] {
        let path = folder.at(name);
        write_with_uv(&path, &mesh, None, &uv).unwrap();
        let back = read_mesh(&path).unwrap();
        assert_eq!((&back.points, &back.faces, &back.edges), (&mesh.points, &mesh.faces, &mesh.edges), "{name}");
        let map = read_uv(&path).unwrap().unwrap();
        assert_eq!(values(&map), values(&uv), "{name}");
        assert_eq!(seams_of(&back, &map).unwrap(), [[1, 4]], "{name}");
        // Again from this file as it is, over itself, with another map of the same numbers.
        let other = UvMap { coordinates: uv.coordinates.iter().rev().copied().collect(), ..uv.clone() };
        let bytes = fs::read(&path).unwrap();
        let file = path.display().to_string();
        let source = Source { format: Format::from_path(&path).unwrap(), file: &file, data: &bytes, folder: None };
        write_with_uv(&path, &back, Some(source), &other).unwrap();
        assert_eq!(values(&read_uv(&path).unwrap().unwrap()), values(&other), "{name}");
        assert_eq!(fs::read(&path).unwrap().len(), bytes.len(), "{name}: nothing but numbers changed");
    }
}

#[test]
fn ply_keeps_what_it_does_not_know() {
    let folder = Folder::new("ply");
    let text = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\n\
        property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty float s\nproperty float t\n\
        element face 1\nproperty uchar flag\n\
        property list uchar float texcoord\nproperty list uchar int vertex_indices\nelement thing 1\nproperty int a\n\
        end_header\n0 0 0 255 .25 1\n1 0 0 254 .5 1\n0 1.50 0 253 .75 1\n7 6 0 0 1 0 0 1 3 0 1 2\n42\n";
    let path = folder.at("a.ply");
    fs::write(&path, text).unwrap();
    let mesh = read_mesh(&path).unwrap();
    assert_eq!(read_uv(&path).unwrap().unwrap().coordinates, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], "lists come first");
    let pairs = text.replace("property list uchar float texcoord\n", "").replace("7 6 0 0 1 0 0 1 3", "7 3");
    let of_vertices = parse_uv(Format::Ply, "a", pairs.as_bytes()).unwrap().unwrap();
    assert_eq!(of_vertices.coordinates, [[0.25, 1.0], [0.5, 1.0], [0.75, 1.0]]);
    let uv = UvMap { coordinates: vec![[0.5, 0.25], [1.0, 2.0], [3.0, 4.0]], corners: vec![2, 1, 0] };
    let source = Source { format: Format::Ply, file: "a.ply", data: text.as_bytes(), folder: None };
    write_with_uv(&path, &mesh, Some(source), &uv).unwrap();
    let lists = "6 3.0000000000000000e0 4.0000000000000000e0 1.0000000000000000e0 2.0000000000000000e0 \
        5.0000000000000000e-1 2.5000000000000000e-1";
    let expected = text
        .replace("property list uchar float texcoord\n", "")
        .replace("vertex_indices\n", "vertex_indices\nproperty list uchar double texcoord\n")
        .replace("7 6 0 0 1 0 0 1 3 0 1 2", &format!("7 3 0 1 2 {lists}"));
    // Between numbers there is one space, and one behind the last of them.
    let plain = |t: &str| t.lines().map(|l| l.trim_end().to_owned()).collect::<Vec<_>>();
    assert_eq!(plain(&fs::read_to_string(&path).unwrap()), plain(&expected));
    let bad = text.replace("7 6 0 0 1 0 0 1 3", "7 4 0 0 1 0 3");
    let e = parse_uv(Format::Ply, "a.ply", bad.as_bytes()).unwrap_err();
    assert!(e.to_string().contains("face 0 (0-based): a list of 4 texture coordinates for 3 corners"), "{e}");
}

#[test]
fn gltf_splits_vertices_along_seams() {
    let folder = Folder::new("gltf");
    let (mesh, uv) = sample();
    for (name, format) in [("a.glb", Format::Glb), ("a.gltf", Format::Gltf)] {
        let path = folder.at(name);
        write_with_uv(&path, &mesh, None, &uv).unwrap();
        let back = read_mesh(&path).unwrap();
        // The vertices 4 and 1, on the seam, follow again in the order of the corners; then those of the unmapped face.
        let single = |v: usize| mesh.points[v].map(|x| f64::from(x as f32));
        let order: Vec<usize> = (0..7).chain([4, 1, 0, 3]).collect();
        assert_eq!(back.points, order.iter().map(|&v| single(v)).collect::<Vec<_>>());
        let faces = [[0, 1, 4], [0, 4, 3], [7, 8, 2], [7, 2, 5], [9, 10, 6]];
        assert_eq!(back.faces.as_triangles().unwrap(), faces);
        let map = read_uv(&path).unwrap().unwrap();
        let stored = as_stored(&uv, format);
        let fan = [0, 1, 2, 0, 2, 3, 4, 5, 6, 7, 8, 9].map(|i| stored.at(i));
        assert_eq!(values(&map)[..12], fan);
        assert_eq!(values(&map)[12..], [Some([0.0, 1.0 - 1.0]); 3], "(0, 0)");
        let error = (0..10).map(|i| (stored.at(i).unwrap()[0] - uv.at(i).unwrap()[0]).abs()).fold(0.0, f64::max);
        assert!(error > 0.0 && error < 6e-8, "{error}: 32 bits");
        assert_eq!(as_stored(&stored, format), stored);
    }
    let plain = folder.at("plain.glb");
    write_mesh(&plain, &mesh, &Fields::none()).unwrap();
    assert_eq!(read_uv(&plain).unwrap(), None);
    let wide = UvMap { coordinates: vec![[1e300, 0.0]; 8], ..uv };
    let e = write_with_uv(&folder.at("b.glb"), &mesh, None, &wide).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::Unsupported, "{e}");
}

#[test]
fn other_formats_are_refused_before_anything_is_written() {
    let folder = Folder::new("refused");
    let (mesh, uv) = sample();
    for name in ["a.off", "a.stl", "a.vtu", "a.vtk", "a.mesh", "a.msh", "a.node", "a.npy"] {
        let path = folder.at(name);
        let e = write_with_uv(&path, &mesh, None, &uv).unwrap_err();
        assert!(
            e.to_string().ends_with("its format carries no texture coordinates; write .obj, .ply, .glb or .gltf"),
            "{e}"
        );
        assert!(require_uv_format(&path).is_err() && !path.exists());
    }
    let off = folder.at("a.off");
    write_mesh(&off, &mesh, &Fields::none()).unwrap();
    assert_eq!(read_uv(&off).unwrap(), None);
    assert_eq!(read_uv(Path::new("none.obj")).unwrap_err().kind(), ErrorKind::NotFound);
    let other = UvMap { corners: vec![0; 5], ..uv };
    let e = write_with_uv(&folder.at("a.obj"), &mesh, None, &other).unwrap_err();
    assert!(e.to_string().contains("5 corners for faces of 13 corners"), "{e}");
    let bare = Mesh { points: vec![[0.0; 3]], ..Mesh::default() };
    assert!(
        write_with_uv(&folder.at("a.obj"), &bare, None, &UvMap::default())
            .unwrap_err()
            .to_string()
            .contains("no faces")
    );
    assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 1);
}

/// What another program says of the same map.
struct Figures {
    energy: f64,
    energy_as_given: f64,
    flips: usize,
    scale: f64,
    l2: f64,
    max_stretch: f64,
    conformal: [f64; 2], // mean, max
    area: [f64; 2],
}

#[track_caller]
fn compare(name: &str, c: &Certificate, f: &Figures) {
    let d = c.distortion;
    assert_eq!(c.flips + c.zero_area, f.flips, "{name}");
    let pairs = [
        ("energy", d.energy, f.energy),
        ("energy as given", d.energy_as_given, f.energy_as_given),
        ("scale", d.scale, f.scale),
        ("L2", d.l2_stretch, f.l2),
        ("largest stretch", d.max_stretch, f.max_stretch),
        ("conformal, mean", d.conformal_mean, f.conformal[0]),
        ("conformal, largest", d.conformal_max, f.conformal[1]),
        ("area, mean", d.area_mean, f.area[0]),
        ("area, largest", d.area_max, f.area[1]),
    ];
    for (what, ours, theirs) in pairs {
        // Its determinants cancel where a triangle is nearly folded, ours do not: stretches of 1e5 keep ten digits.
        assert!((ours - theirs).abs() <= 1e-9 * theirs, "{name}: {what}: {ours} is not {theirs}");
    }
}

/// The figures come from an evaluator written in Python with NumPy on the same coordinates: u = x + 0.3 z and
/// v = y - 0.2 z, with about as many flips as not.
#[test]
fn projections_of_real_meshes_measure_as_elsewhere() {
    let figures = [
        (
            "bimba",
            Figures {
                energy: 116.32659938460436,
                energy_as_given: 8909.643339251734,
                flips: 5318,
                scale: 12.376458405095468,
                l2: 10.785480952864566,
                max_stretch: 1220.143721815472,
                conformal: [8.643992747787195, 16050.775134347163],
                area: [95.90362571792113, 162.8280465573655],
            },
        ),
        (
            "dino",
            Figures {
                energy: 100.82311826259755,
                energy_as_given: 6603.124288380038,
                flips: 24956,
                scale: 11.444505008150962,
                l2: 10.041071569439069,
                max_stretch: 2183.3344676336687,
                conformal: [8.149314443820185, 24993.406206346706],
                area: [83.78817615129321, 190.72828081939068],
            },
        ),
        (
            "dog",
            Figures {
                energy: 391.33469029002515,
                energy_as_given: 98429.79033231582,
                flips: 43375,
                scale: 22.428655777204277,
                l2: 19.782181130755657,
                max_stretch: 6394.060943075456,
                conformal: [9.852484570874795, 148512.75652372095],
                area: [329.3294716363318, 534.7373602609553],
            },
        ),
        (
            "hilbert",
            Figures {
                energy: 21.622004588046366,
                energy_as_given: 298.98068276824506,
                flips: 16124,
                scale: 5.255379756382581,
                l2: 4.649946729592325,
                max_stretch: 71.64405337351248,
                conformal: [6.60205850817228, 383.3738451163209],
                area: [18.47838036516488, 28.834450817097267],
            },
        ),
        (
            "horse",
            Figures {
                energy: 1117.9111254675086,
                energy_as_given: 925157.1060249461,
                flips: 19264,
                scale: 40.683567045028035,
                l2: 33.43517796374813,
                max_stretch: 5811.493479599227,
                conformal: [33.55448480260929, 241041.05973800816],
                area: [766.7149823265115, 1759.353590439748],
            },
        ),
    ];
    let folder = Folder::new("projections");
    for (name, figures) in figures {
        let Some(path) = data(&format!("parameterization/{name}.obj")) else { return };
        let mesh = read_mesh(&path).unwrap();
        let coordinates = mesh.points.iter().map(|p| [p[0] + 0.3 * p[2], p[1] - 0.2 * p[2]]).collect();
        let uv = UvMap { coordinates, corners: mesh.faces.indices().to_vec() };
        // Through a file: its faces and vertices stay, its map is the new one.
        let (bytes, out) = (fs::read(&path).unwrap(), folder.at("out.obj"));
        let source = Source { format: Format::Obj, file: "source.obj", data: &bytes, folder: None };
        write_with_uv(&out, &mesh, Some(source), &uv).unwrap();
        let back = read_mesh(&out).unwrap();
        assert_eq!((&back.points, &back.faces), (&mesh.points, &mesh.faces), "{name}");
        let map = read_uv(&out).unwrap().unwrap();
        assert_eq!(map, uv, "{name}");
        let c = certify(&back.points, &back.faces, &map, &CertificateOptions::default()).unwrap();
        compare(name, &c, &figures);
        assert_eq!((c.charts, c.seam_length, c.density_spread), (1, 0.0, 1.0), "{name}");
        assert!(c.overlaps.triangle_pairs > 1000, "{name}: a projection of both sides");
    }
}

/// Maps that are in the files; figures as above.
#[test]
fn maps_of_real_files_measure_as_elsewhere() {
    let figures = [
        (
            "parameterization/dino",
            1,
            Figures {
                energy: 17.98284069279088,
                energy_as_given: 117.62529498975056,
                flips: 0,
                scale: 3.6062522093606955,
                l2: 4.240617961192788,
                max_stretch: 943.5804161685234,
                conformal: [4.906413908439478, 2127.9947221676443],
                area: [13.323739868424983, 737.8114122089854],
            },
        ),
        (
            "surfaces/spot",
            0,
            Figures {
                energy: 10.044048835983553,
                energy_as_given: 469.56384720869744,
                flips: 177,
                scale: 9.669033690870751,
                l2: 3.169234739804477,
                max_stretch: 404.48477198197384,
                conformal: [1.8465295578693037, 705.8744262927847],
                area: [8.108779462360564, 277.15652730326974],
            },
        ),
    ];
    for (name, charts, figures) in figures {
        let Some(path) = data(&format!("{name}.obj")) else { return };
        let (mesh, uv) = (read_mesh(&path).unwrap(), read_uv(&path).unwrap().unwrap());
        let c = certify(&mesh.points, &mesh.faces, &uv, &CertificateOptions::default()).unwrap();
        compare(name, &c, &figures);
        println!("{name}: {c:?}");
        if charts > 0 {
            assert_eq!(c.charts, charts);
            assert!(c.overlaps.is_injective(), "{name}: Tutte's map is");
        } else {
            assert!(c.charts > 1 && c.seam_length > 0.0);
            assert!(c.overlaps.triangle_pairs > 0, "{name}: flipped triangles lie over others");
        }
    }
}
