//! Files that grow: what a frame adds is written once, whatever number of frames came before.

use proxel_mesh::atomic_write;
use std::fs::OpenOptions;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A text file that pieces are added to before its last lines. At any time it is whole: a piece and the last lines after it
/// are one write, and what cannot be written is taken back.
pub(super) struct Growing {
    path: PathBuf,
    tail: &'static str,
    end: u64, // where the tail begins
}

impl Growing {
    /// A new file, or one in the place of an old one, with these pieces.
    ///
    /// # Errors
    /// A full disk, a folder that has gone; a file that was there stays.
    pub fn create(
        path: &Path,
        head: &str,
        pieces: impl Iterator<Item = String>,
        tail: &'static str,
    ) -> Result<Self, proxel_mesh::MeshError> {
        let mut end = head.len() as u64;
        atomic_write(path, |w| {
            w.write_all(head.as_bytes())?;
            for piece in pieces {
                w.write_all(piece.as_bytes())?;
                end += piece.len() as u64;
            }
            w.write_all(tail.as_bytes())
        })?;
        Ok(Growing { path: path.to_owned(), tail, end })
    }

    /// Adds a piece.
    ///
    /// # Errors
    /// A full disk, a file that has gone or that is not as it was left; it then is as it was.
    pub fn add(&mut self, piece: &str) -> Result<(), String> {
        let written = self.write(piece);
        written.map_err(|e| format!("{}: it cannot be added to: {e}; name another folder", self.path.display()))?;
        self.end += piece.len() as u64;
        Ok(())
    }

    fn write(&self, piece: &str) -> io::Result<()> {
        let mut file = OpenOptions::new().write(true).open(&self.path)?;
        let length = self.end + self.tail.len() as u64;
        if file.metadata()?.len() != length {
            return Err(io::Error::other("something else has changed it"));
        }
        file.seek(SeekFrom::Start(self.end))?;
        let text = [piece, self.tail].concat();
        file.write_all(text.as_bytes()).inspect_err(|_| {
            // As before: the tail had its room.
            let back = file.set_len(length).and_then(|()| file.seek(SeekFrom::Start(self.end)));
            let _ = back.and_then(|_| file.write_all(self.tail.as_bytes()));
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn it_is_whole_after_each_piece_and_notices_others() {
        let dir = std::env::temp_dir().join(format!("proxel-growing-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let path = dir.join("list.xml");
        let read = || fs::read_to_string(&path).unwrap();
        let mut list = Growing::create(&path, "<a>\n", ["1\n".to_string()].into_iter(), "</a>\n").unwrap();
        assert_eq!(read(), "<a>\n1\n</a>\n");
        for k in 2..5 {
            list.add(&format!("{k}\n")).unwrap();
            assert!(read().ends_with(&format!("{k}\n</a>\n")));
        }
        assert_eq!(read(), "<a>\n1\n2\n3\n4\n</a>\n");
        fs::write(&path, "other").unwrap();
        let said = list.add("5\n").unwrap_err();
        assert!(said.contains("list.xml") && said.contains("something else") && read() == "other", "{said}");
        fs::remove_file(&path).unwrap();
        assert!(list.add("5\n").unwrap_err().contains("list.xml"));
        fs::remove_dir_all(dir).unwrap();
    }
}
