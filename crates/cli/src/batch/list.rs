//! What is to be done: the meshes of a folder or a manifest, and where their maps go.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use proxel_mesh::Format;

use super::manifest;
use super::options::Options;
use crate::refusal::Refusal;

/// A mesh, and what becomes of it.
#[derive(Clone, Debug)]
pub struct Item {
    /// As the list has it.
    pub name: PathBuf,
    /// Where it is.
    pub mesh: PathBuf,
    /// Where its map goes, in the folder for outputs.
    pub out: PathBuf,
    /// Options of its own.
    pub options: Options,
    /// Where it is listed, for messages.
    pub place: String,
}

/// All meshes of a folder or a manifest. No two have the same output, and none is overwritten.
pub fn items(source: &Path, out: &Path) -> Result<Vec<Item>, Refusal> {
    let items = if source.is_dir() {
        folder(source, out)?
    } else {
        if Format::from_path(source).is_ok() {
            let what = "it is a mesh; give a folder or a manifest, or use `proxel unwrap`";
            return Err(Refusal::new(format!("{}: {what}", source.display())));
        }
        manifest::read(source)?
    };
    if items.is_empty() {
        let text = format!("{}: it has no meshes; give a folder with meshes, or a list of them", source.display());
        return Err(Refusal::new(text));
    }
    check_outputs(&items, out)?;
    Ok(items)
}

/// Whether two items would write the same file, or one the mesh of another.
fn check_outputs(items: &[Item], out: &Path) -> Result<(), Refusal> {
    let mut writers: BTreeMap<&Path, &Item> = BTreeMap::new();
    for item in items {
        if let Some(other) = writers.insert(&item.out, item) {
            let text = format!(
                "{} ({}) and {} ({}) would both write {}; rename one, or give them an `out` each in a manifest",
                other.name.display(),
                other.place,
                item.name.display(),
                item.place,
                out.join(&item.out).display()
            );
            return Err(Refusal::new(text));
        }
    }
    let meshes: BTreeSet<PathBuf> = items.iter().filter_map(|i| i.mesh.canonicalize().ok()).collect();
    for item in items {
        let target = out.join(&item.out);
        if target.canonicalize().is_ok_and(|t| meshes.contains(&t)) {
            let text = format!("{}: --out would write over this mesh; give another folder", target.display());
            return Err(Refusal::new(text));
        }
    }
    Ok(())
}

/// The meshes in a folder and the folders in it, sorted. Each folder is visited once, whatever links lead to it.
fn folder(root: &Path, out: &Path) -> Result<Vec<Item>, Refusal> {
    let refuse = |path: &Path, e: std::io::Error| {
        let text = format!("{}: cannot be read: {e}; allow it, or list the meshes in a manifest", path.display());
        Refusal::new(text)
    };
    let root = std::path::absolute(root).map_err(|e| refuse(root, e))?;
    // Maps in it are no meshes to be mapped; where it is the folder itself `check_outputs` says what is wrong.
    let is_inner = |out: &PathBuf| root.canonicalize().is_ok_and(|root| root != *out);
    let mut visited: BTreeSet<PathBuf> = out.canonicalize().into_iter().filter(is_inner).collect();
    let mut waiting = vec![PathBuf::new()];
    let mut names = Vec::new();
    while let Some(inner) = waiting.pop() {
        let path = root.join(&inner);
        if !visited.insert(path.canonicalize().map_err(|e| refuse(&path, e))?) {
            continue;
        }
        let mut inside = Vec::new();
        for entry in std::fs::read_dir(&path).map_err(|e| refuse(&path, e))? {
            inside.push(entry.map_err(|e| refuse(&path, e))?.file_name());
        }
        // The last of the stack is next: folders are met in the order of their names.
        inside.sort_by(|a, b| b.cmp(a));
        for name in inside.into_iter().filter(|n| !n.as_encoded_bytes().starts_with(b".")) {
            let inner = inner.join(name);
            if root.join(&inner).is_dir() {
                waiting.push(inner);
            } else if is_mesh(&inner) {
                names.push(inner);
            }
        }
    }
    names.sort();
    let item = |name: PathBuf| Item {
        mesh: root.join(&name),
        out: output_of(&name),
        options: Options::default(),
        place: format!("in {}", root.display()),
        name,
    };
    Ok(names.into_iter().map(item).collect())
}

/// By its extension; a TetGen mesh is its .node, and .npy has no faces.
fn is_mesh(path: &Path) -> bool {
    let is_elements = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ele"));
    !is_elements && Format::from_path(path).is_ok_and(|f| f != Format::Npy)
}

/// The name of the map of a mesh: its own where the format carries texture coordinates, else an OBJ's.
pub fn output_of(mesh: &Path) -> PathBuf {
    match Format::from_path(mesh) {
        Ok(Format::Obj | Format::Ply | Format::Gltf | Format::Glb) => mesh.to_owned(),
        _ => mesh.with_extension("obj"),
    }
}

/// The part of a shard: items `index`, `index + count`, ..
pub fn of_shard(items: Vec<Item>, shard: Option<super::args::Shard>) -> Vec<Item> {
    match shard {
        None => items,
        Some(s) => items.into_iter().skip(s.index).step_by(s.count).collect(),
    }
}

/// A path as text, one text for each path: bytes that are no UTF-8 are written as `\xff`.
pub fn text_of(path: &Path) -> String {
    let mut text = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        text += &chunk.valid().replace('\\', r"\\");
        chunk.invalid().iter().for_each(|b| text += &format!("\\x{b:02x}"));
    }
    text
}

/// A path from the bytes of a line.
pub fn path_of(bytes: &[u8]) -> PathBuf {
    #[cfg(unix)]
    let name = <OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(bytes).to_owned();
    #[cfg(not(unix))]
    let name = std::ffi::OsString::from(String::from_utf8_lossy(bytes).into_owned());
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_as_text_are_told_apart() {
        let text = |bytes: &[u8]| text_of(&path_of(bytes));
        assert_eq!(text("a/é.obj".as_bytes()), "a/é.obj");
        #[cfg(unix)]
        {
            assert_eq!(text(b"a\xff\xfe.obj"), r"a\xff\xfe.obj");
            assert_ne!(text(b"a\xff"), text(br"a\xff"));
        }
    }

    #[test]
    fn outputs_keep_the_format_where_it_carries_coordinates() {
        for (mesh, out) in [("s/a.obj", "s/a.obj"), ("a.PLY", "a.PLY"), ("a.glb", "a.glb"), ("b.v2.stl", "b.v2.obj")] {
            assert_eq!(output_of(Path::new(mesh)), Path::new(out));
        }
        assert!(is_mesh(Path::new("a.node")) && !is_mesh(Path::new("a.ele")) && !is_mesh(Path::new("a.npy")));
        assert!(!is_mesh(Path::new("a.png")) && !is_mesh(Path::new("a")));
    }
}
