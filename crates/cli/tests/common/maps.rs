//! Runs of `proxel unwrap`, and what they leave.

use super::surface::{Mapped, Surface};
use super::{Folder, Run};
use serde_json::Value;

/// Maps `in.obj` to `out.obj` with `r.json`.
pub fn unwrap(folder: &Folder, options: &str) -> Run {
    folder.run(&format!("unwrap in.obj --out out.obj --report r.json {options}"))
}

pub fn report(folder: &Folder) -> Value {
    serde_json::from_str(&folder.read("r.json")).unwrap()
}

pub fn mapped(folder: &Folder) -> Mapped {
    Mapped::parse(&folder.read("out.obj"))
}

/// A folder with this surface as `in.obj`.
pub fn folder(name: &str, surface: &Surface) -> Folder {
    let folder = Folder::new(&format!("unwrap-{name}"));
    folder.put("in.obj", &surface.obj());
    folder
}

/// A map is made, without a flip, and the report says what the file shows. Returns the report and the map.
#[track_caller]
pub fn maps(folder: &Folder, options: &str) -> (Value, Mapped) {
    unwrap(folder, options).is(0);
    let (r, map) = (report(folder), mapped(folder));
    assert_eq!(r["status"], "converged");
    for key in ["flips", "zero_area", "overlaps", "unmapped_faces", "inverted"] {
        assert_eq!(r[key], 0, "{key}");
    }
    assert_eq!(map.points.len(), folder.read("in.obj").lines().filter(|l| l.starts_with("v ")).count());
    (r, map)
}

#[track_caller]
pub fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance * a.abs().max(b.abs()), "{a} is not {b}");
}
