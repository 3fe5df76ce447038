//! Runs the built `proxel` in a folder of its own.
#![allow(dead_code)] // each test file uses a part

pub mod maps;
pub mod scenes;
pub mod surface;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A folder that disappears with the test.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new(name: &str) -> Self {
        let dir = std::env::temp_dir().join(format!("proxel-cli-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&dir);
        std::fs::create_dir_all(&dir).unwrap();
        Folder(dir)
    }

    /// As `write`, where nothing follows.
    pub fn put(&self, name: &str, text: &str) {
        self.write(name, text);
    }

    pub fn write(&self, name: &str, text: &str) -> &Self {
        std::fs::write(self.0.join(name), text).unwrap();
        self
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(name)).unwrap()
    }

    pub fn has(&self, name: &str) -> bool {
        self.0.join(name).exists()
    }

    /// Turns the first tetrahedron of the beam inside out.
    pub fn turn_first(&self) {
        let text = self.read("rest.ele");
        assert!(text.contains("\n0 0 4 5 7\n"), "{text}");
        self.put("rest.ele", &text.replacen("\n0 0 4 5 7\n", "\n0 4 0 5 7\n", 1));
    }

    /// The names of all files, sorted.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(&self.0).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// `proxel` with these words, blanks part them.
    pub fn command(&self, words: &str) -> Command {
        let mut command = Command::new(Path::new(env!("CARGO_BIN_EXE_proxel")));
        command.args(words.split_whitespace()).current_dir(&self.0).stdin(Stdio::null());
        command
    }

    pub fn run(&self, words: &str) -> Run {
        Run::of(self.command(words).output().unwrap())
    }

    /// Writes a body of `n` cells along x, unit cubes of six tetrahedra, as `rest.node` and
    /// `rest.ele`; `pins.txt` holds the face x = 0, and `init.node` has the rest stretched by two.
    pub fn beam(&self, n: usize) -> &Self {
        let verts = || (0..=n).flat_map(|x| (0..4).map(move |k| [x as f64, (k % 2) as f64, (k / 2) as f64]));
        let nodes = |stretch: f64| {
            let lines = verts().enumerate().map(|(i, p)| format!("{i} {} {} {}\n", stretch * p[0], p[1], p[2]));
            format!("{} 3 0 0\n{}", 4 * (n + 1), lines.collect::<String>())
        };
        let mut tets = Vec::new();
        for x in 0..n {
            // Corner (x, y, z) of the cell: 4 (i + x) + y + 2 z.
            let v = |c: usize| 4 * (x + (c & 1)) + (c >> 1 & 1) + 2 * (c >> 2);
            for t in [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]] {
                tets.push(t.map(v));
            }
        }
        let lines = tets.iter().enumerate().map(|(i, t)| format!("{i} {} {} {} {}\n", t[0], t[1], t[2], t[3]));
        let elements = format!("{} 4 0\n{}", tets.len(), lines.collect::<String>());
        self.write("rest.node", &nodes(1.0)).write("rest.ele", &elements);
        self.write("init.node", &nodes(2.0)).write("pins.txt", "0 1 2 3 # the left side\n")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// How a command ended.
#[derive(Debug)]
pub struct Run {
    pub status: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Run {
    pub fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Run { status: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// Exit status 2 and one line on stderr that has all these parts.
    #[track_caller]
    pub fn is_refused(&self, parts: &[&str]) {
        assert_eq!(self.status, Some(2), "{self:?}");
        assert!(self.err.starts_with("error: ") && self.err.ends_with('\n'), "{self:?}");
        assert_eq!(self.err.lines().count(), 1, "{self:?}");
        for part in parts {
            assert!(self.err.contains(part), "`{part}` is not in {}", self.err);
        }
    }

    #[track_caller]
    pub fn is(&self, status: i32) -> &Self {
        assert_eq!(self.status, Some(status), "{self:?}");
        self
    }
}
