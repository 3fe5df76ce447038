//! A mesh that moves: one animated file, or a file for each frame.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::atomic::{Staged, check_writable};
use super::gltf::Animation;
use super::{Format, display, write_body};
use crate::error::{ErrorKind, MeshError, Result};
use crate::fields::Fields;
use crate::mesh::Mesh;

/// A moment of a mesh in motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// When, in seconds; ascending.
    pub time: f64,
    /// Where every vertex is.
    pub points: Vec<[f64; 3]>,
    /// Arrays, for formats that have them.
    pub fields: Fields,
}

/// Writes a mesh in motion and returns the files: the one named first, then those of its frames.
///
/// - `.glb`, `.gltf`: one animated file, a morph target for each frame after the first; positions are linear in time
///   between frames. At most 1000 frames.
/// - `.pvd`: ParaView's list of times, and a `.vtu` for each frame with its arrays: `walk.pvd`, `walk_0000.vtu`, ..
/// - any other mesh format: numbered files, `walk_0000.obj`, `walk_0001.obj`, ..
///
/// Frames are taken as they come and not kept. Files get their names only when all are written: if a frame fails, none is
/// there and old ones are as they were.
///
/// # Errors
/// No frames, a frame of another number of vertices, whatever a frame's own error is, a path that cannot be written.
pub fn write_series(path: &Path, mesh: &Mesh, frames: impl IntoIterator<Item = Result<Frame>>) -> Result<Vec<PathBuf>> {
    let target = Target::of(path)?;
    let mut frames = frames.into_iter().enumerate().map(|(i, frame)| {
        let frame = frame?;
        let moved = mesh.with_points(frame.points)?;
        moved.check_indices()?;
        if !frame.time.is_finite() {
            let what = format!("frame {i} is at time {}", frame.time);
            return Err(MeshError::new(ErrorKind::NonFinite, display(path), what, "give frames finite times"));
        }
        Ok((i, frame.time, moved, frame.fields))
    });
    let first = frames.next().unwrap_or_else(|| {
        Err(MeshError::new(ErrorKind::Empty, display(path), "there are no frames", "give at least one"))
    })?;
    if let Target::Animated { binary } = target {
        let mut animation = Animation::new(&display(path), &first.2, first.1)?;
        for frame in frames {
            let (_, time, moved, _) = frame?;
            animation.push(time, &moved.points)?;
        }
        Staged::write(path, |w| animation.write(binary, w))?.publish()?;
        return Ok(vec![path.to_owned()]);
    }
    let (extension, with_list) = match &target {
        Target::Listed => ("vtu".to_owned(), true),
        _ => (path.extension().unwrap_or_default().to_string_lossy().into_owned(), false),
    };
    let (mut staged, mut names, mut times) = (Vec::new(), Vec::new(), Vec::new());
    for frame in std::iter::once(Ok(first)).chain(frames) {
        let (i, time, moved, fields) = frame?;
        let name = numbered(path, i, &extension);
        staged.push(write_body(&name, &moved, &fields)?);
        names.push(name);
        times.push(time);
    }
    if with_list {
        staged.push(vec![Staged::write(path, |w| write_list(&names, &times, w))?]);
    }
    // The list comes last: who finds it finds all that it names.
    staged.into_iter().flatten().try_for_each(Staged::publish)?;
    if with_list {
        names.insert(0, path.to_owned());
    }
    Ok(names)
}

/// Whether [`write_series`] could write to `path`, for use before hours of work.
///
/// # Errors
/// An unknown extension, a path that cannot be written.
pub fn check_series_output(path: &Path) -> Result<()> {
    match Target::of(path)? {
        Target::Animated { .. } | Target::Listed => check_writable(path),
        Target::Numbered => {
            let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
            check_writable(&numbered(path, 0, &extension))
        }
    }
}

enum Target {
    Animated { binary: bool },
    Listed,
    Numbered,
}

impl Target {
    fn of(path: &Path) -> Result<Target> {
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("pvd")) {
            return Ok(Target::Listed);
        }
        Ok(match Format::from_path(path)? {
            Format::Gltf => Target::Animated { binary: false },
            Format::Glb => Target::Animated { binary: true },
            _ => Target::Numbered,
        })
    }
}

/// `folder/walk.obj` as `folder/walk_0007.obj`.
fn numbered(path: &Path, i: usize, extension: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{i:04}.{extension}"))
}

fn write_list(names: &[PathBuf], times: &[f64], w: &mut dyn Write) -> std::io::Result<()> {
    writeln!(w, r#"<?xml version="1.0"?>"#)?;
    writeln!(w, r#"<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">"#)?;
    writeln!(w, "<Collection>")?;
    for (name, time) in names.iter().zip(times) {
        let file = name.file_name().unwrap_or_default().to_string_lossy();
        let file = file.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        writeln!(w, r#"<DataSet timestep="{time}" part="0" file="{file}"/>"#)?;
    }
    writeln!(w, "</Collection>\n</VTKFile>")
}
