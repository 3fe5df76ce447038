//! `proxel deform` on surfaces without tetrahedra: generated ones, and the bunny and spot where the data is there.

mod common;
use common::Folder;
use proxel_mesh::{read_mesh, read_points};
use std::path::PathBuf;

/// The skin of the beam as `skin.obj`, and pins that lift its far end.
fn skin(folder: &Folder, n: usize) {
    folder.beam(n).run("convert rest.node --out skin.obj").is(0);
    let end = n as f64 - 0.01;
    folder.put(
        "lift.toml",
        &format!(
            "[groups.foot]\nplane = {{ point = [0.01, 0, 0], normal = [-1, 0, 0] }}\n\
             [groups.hand]\nplane = {{ point = [{end}, 0, 0], normal = [1, 0, 0] }}\ntranslate = [0, 0, 1]\n"
        ),
    );
}

fn report(folder: &Folder) -> serde_json::Value {
    serde_json::from_str(&folder.read("r.json")).unwrap()
}

#[test]
fn a_skin_is_deformed_as_a_body_in_every_format() {
    let folder = Folder::new("skin");
    skin(&folder, 4);
    let run = folder.run(
        "deform skin.obj --pins lift.toml --resolution 12 --out posed.obj --lattice-out l.vtu --preview p.png --report r.json",
    );
    run.is(0);
    assert!(run.out.contains("wrote posed.obj, l.vtu, p.png, r.json"), "{run:?}");
    let (rest, posed) =
        (read_mesh(&folder.0.join("skin.obj")).unwrap(), read_mesh(&folder.0.join("posed.obj")).unwrap());
    assert_eq!(posed.faces, rest.faces);
    for (p, q) in rest.points.iter().zip(&posed.points) {
        match p[0] {
            0.0 => assert_eq!(p, q),
            4.0 => assert_eq!([p[0], p[1], p[2] + 1.0], *q),
            _ => assert!(q[2] > p[2] && q[2] < p[2] + 1.0, "{p:?} goes to {q:?}"),
        }
    }
    let lattice = read_mesh(&folder.0.join("l.vtu")).unwrap();
    let r = report(&folder);
    assert_eq!(r["lattice"]["tetrahedra"].as_u64(), Some(lattice.tets.len() as u64));
    assert_eq!((r["settings"]["surface"].as_str(), r["settings"]["resolution"].as_u64()), (Some("embed"), Some(12)));
    assert!(folder.has("p.png"));
    // The same through glTF, but for its 32-bit numbers; without --resolution, since it is closed.
    folder.run("convert skin.obj --out skin.glb --quiet").is(0);
    folder.run("deform skin.glb --pins lift.toml --resolution 12 --out posed.gltf --quiet").is(0);
    let points = read_points(&folder.0.join("posed.gltf")).unwrap();
    for (p, q) in posed.points.iter().zip(&points) {
        assert!((0..3).all(|d| (p[d] - q[d]).abs() < 1e-5), "{p:?} {q:?}");
    }
}

#[test]
fn sheets_and_nonsense() {
    let folder = Folder::new("sheets");
    skin(&folder, 2);
    folder.put("plane.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
    folder.put("pin.txt", "0\n");
    let deform = |words: &str| folder.run(&format!("deform {words} --out x.obj"));
    deform("plane.obj --pins pin.txt --embed").is_refused(&["plane.obj", "no inside", "--shell"]);
    deform("plane.obj --pins pin.txt --resolution 8").is_refused(&["plane.obj", "no inside"]);
    deform("skin.obj --resolution 0").is_refused(&["resolution is 0", "1 to 256"]);
    deform("skin.obj --resolution 4 --shell").is_refused(&["--resolution", "--shell"]);
    deform("rest.node --embed").is_refused(&["rest.node", "only faces can be embedded"]);
    let run = deform("plane.obj --pins pin.txt --quiet --lattice-out l.vtu");
    run.is_refused(&["plane.obj", "no lattice is made", "--lattice-out"]);
    assert!(!folder.has("l.vtu") && !folder.has("x.obj"));
    let run = deform("plane.obj --pins pin.txt");
    assert_eq!(run.status, Some(0));
    assert!(run.err.contains("taken for a thin sheet"), "{run:?}");
    assert!(!deform("plane.obj --pins pin.txt --shell").err.contains("thin sheet"));
    folder.put("bad.gltf", "{ \"asset\": { \"version\": \"2.0\" }, \"nodes\": [{ \"mesh\": 3 }] }");
    deform("bad.gltf").is_refused(&["bad.gltf", "mesh 3 does not exist"]);
}

/// A file of data/surfaces, or none, saying why.
fn data(name: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("PROXEL_DATA") else {
        println!("{name}: skipped, PROXEL_DATA is not set");
        return None;
    };
    let path = PathBuf::from(root).join("surfaces").join(name);
    if !path.is_file() {
        println!("{name}: skipped, {} is missing", path.display());
        return None;
    }
    Some(path)
}

/// Poses a real surface and checks what holds for every one.
fn pose(name: &str, pins: &str, resolution: usize) {
    let Some(path) = data(&format!("{name}.obj")) else { return };
    let folder = Folder::new(name);
    folder.put("pins.toml", pins);
    let words = format!(
        "--pins pins.toml --resolution {resolution} --out posed.glb --preview p.png --report r.json --tol 1e-6"
    );
    let mut command = folder.command("deform");
    let output = command.arg(&path).args(words.split_whitespace()).output().unwrap();
    let run = common::Run::of(output);
    run.is(0);
    let r = report(&folder);
    assert_eq!((r["status"].as_str(), r["inverted"].as_u64()), (Some("converged"), Some(0)), "{r}");
    assert!(r["lattice"]["pin_error"].as_f64().unwrap() < 1e-5, "{r}");
    // Tetrahedra that parts of the body share are no fault of the surface.
    assert!(!r["warnings"].to_string().contains("corners of another"), "{r}");
    let (rest, posed) = (read_mesh(&path).unwrap(), read_mesh(&folder.0.join("posed.glb")).unwrap());
    assert_eq!((posed.n_verts(), posed.faces.len()), (rest.n_verts(), rest.faces.fan_triangles().len()));
    assert!(folder.has("p.png"));
}

#[test]
fn the_bunny_pricks_up_its_ears() {
    let ears = "[groups.foot]\nplane = { point = [0, 0.04, 0], normal = [0, -1, 0] }\n\
                [groups.ears]\nplane = { point = [0, 0.165, 0], normal = [0, 1, 0] }\n\
                rotate = { axis = [0, 0, 1], angle = 35, center = [-0.06, 0.13, 0] }\n";
    pose("stanford-bunny", ears, 16);
}

#[test]
fn spot_looks_aside() {
    let head = "[groups.hooves]\nplane = { point = [0, -0.6, 0], normal = [0, -1, 0] }\n\
                [groups.head]\nbox = { min = [-1, 0.2, -1], max = [1, 2, -0.2] }\n\
                rotate = { axis = [0, 1, 0], angle = 40 }\n";
    pose("spot", head, 16);
}
