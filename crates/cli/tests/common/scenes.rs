//! Scenes of `proxel simulate`, and their runs.

use super::Folder;
use serde_json::Value;

/// A scene of one generated body; `more` is appended to its section, `rest` to the file.
pub fn scene(time: &str, material: &str, more: &str, rest: &str) -> String {
    format!(
        "[time]\n{time}\n[[body]]\nname = \"cube\"\ngenerate = {{ bar = {{ cells = [2, 2, 2], size = [1, 1, 1] }} }}\n\
         material = {{ {material} }}\ndensity = 1000\n{more}\n{rest}\n"
    )
}

pub const SOFT: &str = "energy = \"neo-hookean\", young = 1e5, poisson = 0.4";
pub const FLOOR: &str =
    "[[obstacle]]\nname = \"floor\"\nshape = { half-space = { point = [0, 0, 0], normal = [0, 1, 0] } }";
pub const NO_GRAVITY: &str = "[forces]\ngravity = [0, 0, 0]";

/// How a command ended.
pub struct Ended {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

pub fn go(folder: &Folder, words: &str) -> Ended {
    let run = folder.run(words);
    Ended { code: run.status.unwrap_or(-1), stdout: run.out, stderr: run.err }
}

pub fn report(folder: &Folder, dir: &str) -> Value {
    serde_json::from_str(&folder.read(&format!("{dir}/report.json"))).unwrap()
}
