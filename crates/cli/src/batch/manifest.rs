//! Manifests: a line for each mesh.

use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::list::{Item, output_of, path_of};
use super::options::Options;
use crate::refusal::Refusal;

/// A line in JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    mesh: String,
    #[serde(default)]
    out: Option<String>,
    #[serde(default)]
    args: Vec<String>,
}

/// The meshes of a manifest, in its order.
pub fn read(path: &Path) -> Result<Vec<Item>, Refusal> {
    let refuse = |e: std::io::Error| Refusal::new(format!("{}: cannot be read: {e}; check the path", path.display()));
    let bytes = std::fs::read(path).map_err(refuse)?;
    let folder = std::path::absolute(path).map_err(refuse)?.parent().map(Path::to_owned).unwrap_or_default();
    parse(&bytes, path, &folder)
}

/// As [`read`]; `path` is for messages and `folder` is where relative names begin.
fn parse(bytes: &[u8], path: &Path, folder: &Path) -> Result<Vec<Item>, Refusal> {
    let mut items = Vec::new();
    for (k, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if line.trim_ascii().is_empty() || line.starts_with(b"#") {
            continue;
        }
        let item = item(line, folder).map_err(|e| Refusal::new(format!("{}: line {}: {e}", path.display(), k + 1)))?;
        items.push(Item { place: format!("line {}", k + 1), ..item });
    }
    Ok(items)
}

fn item(line: &[u8], folder: &Path) -> Result<Item, String> {
    let (mesh, out, args) = match line.first() {
        Some(b'{') => {
            let line: Line = serde_json::from_slice(line)
                .map_err(|e| format!("it is no object with mesh, out and args: {e}; correct the line"))?;
            (PathBuf::from(line.mesh), line.out.map(PathBuf::from), line.args)
        }
        Some(b'"') => {
            let mesh: String =
                serde_json::from_slice(line).map_err(|e| format!("it is no JSON string: {e}; correct the line"))?;
            (PathBuf::from(mesh), None, Vec::new())
        }
        _ => (path_of(line), None, Vec::new()),
    };
    let out = match out {
        Some(out) => inside(out)?,
        None => output_of(&without_parents(&mesh)?),
    };
    Ok(Item {
        name: mesh.clone(),
        mesh: folder.join(mesh),
        out,
        options: Options::for_one(&args, folder)?,
        place: String::new(),
    })
}

/// An output must lie in the folder for outputs.
fn inside(out: PathBuf) -> Result<PathBuf, String> {
    let plain: PathBuf = out.components().filter(|c| *c != Component::CurDir).collect();
    let is_inside = plain.components().all(|c| matches!(c, Component::Normal(_)));
    if !is_inside || plain.file_name().is_none() {
        return Err(format!("the output {} does not lie in --out; give a relative path without `..`", out.display()));
    }
    proxel_mesh::uv::require_uv_format(&plain).map_err(|e| e.to_string())?;
    Ok(plain)
}

/// A mesh outside of the manifest's folder leaves its map under its own name.
fn without_parents(mesh: &Path) -> Result<PathBuf, String> {
    if mesh.is_relative() && !mesh.components().any(|c| c == Component::ParentDir) {
        return Ok(mesh.components().filter(|c| *c != Component::CurDir).collect());
    }
    let name = mesh.file_name().ok_or_else(|| format!("{} names no file; give a mesh", mesh.display()))?;
    Ok(PathBuf::from(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Vec<Item>, Refusal> {
        parse(text.as_bytes(), Path::new("list"), Path::new("/base"))
    }

    #[test]
    fn paths_and_objects() {
        let text = "# scans\r\na.obj\n\nsub/b c.stl\r\n\"d.ply\"\n/else/e.off\n../f.obj\n\
                    {\"mesh\": \"a.obj\", \"out\": \"./two/x.glb\", \"args\": [\"--method\", \"cm\"]}";
        let items = parsed(text).unwrap();
        let files: Vec<(&str, &str, &str)> =
            items.iter().map(|i| (i.mesh.to_str().unwrap(), i.out.to_str().unwrap(), i.place.as_str())).collect();
        let expected = [
            ("/base/a.obj", "a.obj", "line 2"),
            ("/base/sub/b c.stl", "sub/b c.obj", "line 4"),
            ("/base/d.ply", "d.ply", "line 5"),
            ("/else/e.off", "e.obj", "line 6"),
            ("/base/../f.obj", "f.obj", "line 7"),
            ("/base/a.obj", "two/x.glb", "line 8"),
        ];
        assert_eq!(files, expected);
        assert_eq!(items[5].options.words().collect::<Vec<_>>(), ["--method=cm"]);
    }

    #[test]
    fn bad_lines_are_named() {
        for (text, parts) in [
            ("a.obj\n{\"mesh\": 1}", &["list: line 2", "mesh"][..]),
            ("{\"mush\": \"a.obj\"}", &["line 1", "mush"]),
            ("{\"mesh\": \"a.obj\"", &["line 1", "EOF"]),
            ("\"a.obj", &["line 1", "JSON string"]),
            ("{\"mesh\": \"a.obj\", \"out\": \"../a.obj\"}", &["line 1", "../a.obj", "relative path"]),
            ("{\"mesh\": \"a.obj\", \"out\": \"/tmp/a.obj\"}", &["line 1", "relative path"]),
            ("{\"mesh\": \"a.obj\", \"out\": \"a.stl\"}", &["line 1", "a.stl", "write .obj"]),
            ("{\"mesh\": \"a.obj\", \"args\": [\"--metod\"]}", &["line 1", "--metod"]),
            ("..", &["line 1", "names no file"]),
        ] {
            let e = parsed(text).unwrap_err().to_string();
            assert!(parts.iter().all(|p| e.contains(p)) && !e.contains('\n'), "{text}: {e}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn names_keep_their_bytes() {
        use std::os::unix::ffi::OsStrExt;
        let items = parse(b"a\xff.obj\n", Path::new("list"), Path::new("/base")).unwrap();
        assert_eq!(items[0].mesh.as_os_str().as_bytes(), b"/base/a\xff.obj");
        assert_eq!(items[0].out.as_os_str().as_bytes(), b"a\xff.obj");
    }
}
