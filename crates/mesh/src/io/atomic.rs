//! Files that are written whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{ErrorKind, MeshError, Result};

/// Writes `path` whole or not at all: `fill` writes to a hidden file beside it, which takes the
/// name of `path` only after the last byte. On any failure `path` is as it was and nothing is left
/// behind. Devices and pipes (`/dev/stdout`) are written directly; a symbolic link stays one.
///
/// # Errors
/// A missing folder, no permission, a full disk; or what `fill` returned.
///
/// ```
/// let path = std::env::temp_dir().join(format!("proxel-doc-{}.txt", std::process::id()));
/// proxel_mesh::atomic_write(&path, |w| writeln!(w, "whole"))?;
/// assert_eq!(std::fs::read_to_string(&path).unwrap(), "whole\n");
/// # std::fs::remove_file(path).unwrap();
/// # Ok::<(), proxel_mesh::MeshError>(())
/// ```
pub fn atomic_write(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let staged = Staged::write(path, fill)?;
    staged.publish()
}

/// Whether a file could be written at `path`, for use before hours of work: the folder is there
/// and takes new files, and what stands at `path` may be replaced.
///
/// # Errors
/// What [`atomic_write`] would report.
pub fn check_writable(path: &Path) -> Result<()> {
    // The file made here disappears when dropped; nothing but its folder's time stamp changes.
    Staged::open(path).map(drop)
}

/// A complete file that does not have its name yet. Dropped unpublished, it disappears.
pub(crate) struct Staged {
    /// The name asked for, for messages.
    path: PathBuf,
    /// The file to be replaced, links followed.
    target: PathBuf,
    /// The hidden file; `None` where `target` is a device and is written directly.
    temp: Option<PathBuf>,
}

impl Staged {
    /// Writes the hidden file.
    pub fn write(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<Self> {
        let (staged, file) = Staged::open(path)?;
        let mut out = BufWriter::with_capacity(1 << 16, file);
        fill(&mut out).and_then(|()| out.flush()).map_err(|e| MeshError::io(path, "write", &e))?;
        Ok(staged)
    }

    fn open(path: &Path) -> Result<(Self, File)> {
        let path = path.to_owned();
        let target = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
        let existing = fs::metadata(&target).ok();
        if let Some(meta) = &existing {
            if meta.is_dir() {
                return Err(unwritable(&path, "it is a folder"));
            }
            if !meta.is_file() {
                let file = OpenOptions::new().write(true).open(&target);
                let file = file.map_err(|e| MeshError::io(&path, "write", &e))?;
                return Ok((Staged { path, target, temp: None }, file));
            }
            if meta.permissions().readonly() {
                return Err(unwritable(&path, "the file that stands there is read-only"));
            }
        }
        let Some(name) = target.file_name() else {
            return Err(unwritable(&path, "the path names no file"));
        };
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}-{unique}.tmp", std::process::id()));
        let temp = target.with_file_name(hidden);
        let file = OpenOptions::new().write(true).create_new(true).open(&temp).map_err(|e| {
            match (e.kind(), target.parent()) {
                (io::ErrorKind::NotFound | io::ErrorKind::NotADirectory, Some(folder)) => {
                    unwritable(&path, &format!("there is no folder {}", folder.display()))
                }
                _ => MeshError::io(&path, "write", &e),
            }
        })?;
        let staged = Staged { path, target, temp: Some(temp) };
        if let Some(meta) = existing {
            file.set_permissions(meta.permissions()).map_err(|e| MeshError::io(&staged.path, "write", &e))?;
        }
        Ok((staged, file))
    }

    /// Gives the file its name.
    pub fn publish(mut self) -> Result<()> {
        if let Some(temp) = self.temp.take() {
            fs::rename(&temp, &self.target).map_err(|e| {
                let _ = fs::remove_file(&temp); // the error at hand is the one to tell
                MeshError::io(&self.path, "write", &e)
            })?;
        }
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Some(temp) = &self.temp {
            let _ = fs::remove_file(temp); // nothing more can be done about it here
        }
    }
}

fn unwritable(path: &Path, why: &str) -> MeshError {
    let file = path.display().to_string();
    MeshError::new(ErrorKind::Io, file, format!("cannot write: {why}"), "give another output path")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let dir = std::env::temp_dir().join(format!("proxel-atomic-{}-{name}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        dir
    }

    #[test]
    fn failure_keeps_the_old_file_and_leaves_nothing() {
        let dir = folder("fail");
        let path = dir.join("a.txt");
        atomic_write(&path, |w| w.write_all(b"old")).unwrap();
        let failed = atomic_write(&path, |w| {
            w.write_all(b"new")?;
            Err(io::Error::other("disk on fire"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk on fire"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1);
        fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn missing_folder_and_folder_as_file_are_named() {
        let dir = folder("missing");
        let e = atomic_write(&dir.join("no/such/x.obj"), |_| Ok(())).unwrap_err();
        assert!(e.to_string().contains("there is no folder"), "{e}");
        let e = check_writable(&dir).unwrap_err();
        assert!(e.to_string().contains("it is a folder"), "{e}");
        check_writable(&dir.join("fine.obj")).unwrap();
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 0);
        fs::remove_dir_all(dir).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_survive() {
        let dir = folder("links");
        let (real, link) = (dir.join("real"), dir.join("link"));
        fs::write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        atomic_write(&link, |w| w.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"new");
        atomic_write(Path::new("/dev/null"), |w| w.write_all(b"gone")).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
        fs::remove_dir_all(dir).unwrap();
    }
}
