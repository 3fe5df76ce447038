//! Meshes in motion: what is written, and that nothing is where a frame fails.

use proxel_mesh::generate::{CellSplit, beam};
use proxel_mesh::{ErrorKind, Fields, Frame, Mesh, check_series_output, read_mesh, read_points, write_series};
use std::fs;
use std::path::PathBuf;

/// A folder of its own that disappears at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("proxel-series-{}-{name}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(&self.0).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).unwrap();
    }
}

fn body() -> Mesh {
    beam([2, 1, 1], [2.0, 1.0, 1.0], CellSplit::Five).unwrap()
}

fn frame(mesh: &Mesh, i: usize) -> Frame {
    let points = mesh.points.iter().map(|p| [p[0], p[1], p[2] + i as f64]).collect();
    let mut fields = Fields::none();
    fields.point("height", 1, vec![i as f64; mesh.n_verts()]);
    Frame { time: 0.25 * i as f64, points, fields }
}

#[test]
fn a_list_and_its_frames() {
    let (folder, mesh) = (Folder::new("pvd"), body());
    let path = folder.0.join("walk.pvd");
    check_series_output(&path).unwrap();
    let files = write_series(&path, &mesh, (0..3).map(|i| Ok(frame(&mesh, i)))).unwrap();
    assert_eq!(folder.names(), ["walk.pvd", "walk_0000.vtu", "walk_0001.vtu", "walk_0002.vtu"]);
    assert_eq!((files.len(), &files[0]), (4, &path));
    for i in 0..3 {
        let back = read_mesh(&files[i + 1]).unwrap();
        assert_eq!((back.points, back.tets), (frame(&mesh, i).points, mesh.tets.clone()));
    }
    let list = fs::read_to_string(&path).unwrap();
    assert!(list.contains(r#"<DataSet timestep="0.25" part="0" file="walk_0001.vtu"/>"#), "{list}");
    assert!(fs::read(&files[3]).unwrap().windows(6).any(|w| w == b"height"));
}

#[test]
fn numbered_files_and_one_animated() {
    let (folder, mesh) = (Folder::new("numbered"), body());
    let frames = || (0..2).map(|i| Ok(frame(&mesh, i)));
    write_series(&folder.0.join("a.obj"), &mesh, frames()).unwrap();
    write_series(&folder.0.join("b.node"), &mesh, frames()).unwrap();
    write_series(&folder.0.join("c.glb"), &mesh, frames()).unwrap();
    let wanted = ["a_0000.obj", "a_0001.obj", "b_0000.ele", "b_0000.node", "b_0001.ele", "b_0001.node", "c.glb"];
    assert_eq!(folder.names(), wanted);
    assert_eq!(read_points(&folder.0.join("a_0001.obj")).unwrap(), frame(&mesh, 1).points);
    assert_eq!(read_mesh(&folder.0.join("c.glb")).unwrap().points, mesh.points);
}

#[test]
fn a_frame_that_fails_leaves_everything_as_it_was() {
    let (folder, mesh) = (Folder::new("fails"), body());
    let short = Frame { points: vec![[0.0; 3]; 2], ..Frame::default() };
    for name in ["a.pvd", "a.ply", "a.glb"] {
        let path = folder.0.join(name);
        let late = [Ok(frame(&mesh, 0)), Ok(short.clone())];
        assert_eq!(write_series(&path, &mesh, late).unwrap_err().kind(), ErrorKind::CountMismatch);
        let nan = Frame { points: vec![[f64::NAN; 3]; mesh.n_verts()], ..Frame::default() };
        let infinite = [Ok(frame(&mesh, 0)), Ok(nan)];
        assert_eq!(write_series(&path, &mesh, infinite).unwrap_err().kind(), ErrorKind::NonFinite);
        assert_eq!(write_series(&path, &mesh, []).unwrap_err().kind(), ErrorKind::Empty);
        assert!(folder.names().is_empty(), "{:?}", folder.names());
    }
    let e = write_series(&folder.0.join("a.xyz"), &mesh, [Ok(frame(&mesh, 0))]).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::UnknownFormat);
    // Animations go forward in time.
    let same = [Ok(frame(&mesh, 0)), Ok(frame(&mesh, 0))];
    let e = write_series(&folder.0.join("a.glb"), &mesh, same).unwrap_err();
    assert!(e.to_string().contains("ascending times"), "{e}");
}
