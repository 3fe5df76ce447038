//! Surfaces to be mapped, and runs of a method on one, point by point.

use crate::BenchError;
use proxel::deform::Progress;
use proxel::mesh::{Mesh, read_mesh_lenient};
use proxel::settings::UnwrapSettings;
use proxel::unwrap::{Hooks, MapRow, UnwrapInput, Unwrapped, unwrap};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Name of the generated surface.
pub const CAP: &str = "cap";

/// The early phase ends within this part of the least energy, the late one begins at this relative error.
pub const EARLY: f64 = 1e-2;
/// See [`EARLY`].
pub const LATE: f64 = 1e-6;

/// The files of surfaces in a folder, by name.
pub fn meshes_in(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let is_mesh = |path: &PathBuf| {
        path.extension().and_then(|e| e.to_str()).is_some_and(|e| matches!(e, "obj" | "ply" | "off" | "stl"))
    };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_mesh).collect();
    paths.sort();
    paths
}

/// The name of a file without folder and ending.
pub fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// A folder of `PROXEL_DATA`, where it exists.
pub fn folder(name: &str) -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("PROXEL_DATA")?).join(name);
    folder.is_dir().then_some(folder)
}

/// Names of the surfaces in `parameterization/`.
pub fn found() -> Vec<String> {
    folder("parameterization").map_or_else(Vec::new, |f| meshes_in(&f).iter().map(|p| name_of(p)).collect())
}

/// A sentence that says which data was found.
pub fn describe(names: &[String]) -> String {
    match (folder("parameterization"), names) {
        (_, [name]) if name == CAP => "Data: a generated cap of a sphere, no files.".to_string(),
        (None, _) => format!(
            "Data: none. Set PROXEL_DATA to the folder that holds `parameterization/`, or ask for the generated one with \
             `--models {CAP}`."
        ),
        (Some(_), _) => {
            let files = found();
            format!("Data: {} surfaces found ({}); used here: {}.", files.len(), files.join(", "), names.join(", "))
        }
    }
}

/// Reads a surface by name.
///
/// # Errors
/// A surface that is not there or cannot be read.
pub fn load(name: &str) -> Result<Mesh, BenchError> {
    if name == CAP {
        return Ok(cap(16));
    }
    let missing = || {
        BenchError(format!(
            "{name}: no such surface; set PROXEL_DATA to the folder that holds parameterization/{name}.obj"
        ))
    };
    let path = folder("parameterization")
        .and_then(|f| meshes_in(&f).into_iter().find(|path| name_of(path) == name))
        .ok_or_else(missing)?;
    let mut mesh = read_mesh_lenient(&path).map_err(BenchError::from_display)?;
    mesh.name = name.to_string();
    Ok(mesh)
}

/// Colatitude of the rim of the generated surface, in half turns: nearly a whole sphere.
const RIM: f64 = 0.85;

/// A sphere of radius 1 with an opening around one pole, of rings of triangles around the other.
pub fn cap(rings: usize) -> Mesh {
    let mut points = vec![[0.0, 0.0, 1.0]];
    for ring in 1..=rings {
        let polar = RIM * std::f64::consts::PI * ring as f64 / rings as f64;
        for k in 0..6 * ring {
            let angle = std::f64::consts::TAU * k as f64 / (6 * ring) as f64;
            points.push([polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos()]);
        }
    }
    let first = |ring: usize| if ring == 0 { 0 } else { 1 + 3 * ring * (ring - 1) };
    let at = |ring: usize, k: usize| if ring == 0 { 0 } else { (first(ring) + k % (6 * ring)) as u32 };
    let mut triangles = Vec::new();
    for ring in 1..=rings {
        for side in 0..6 {
            for k in 0..ring {
                let (outer, inner) = (side * ring + k, side * (ring - 1) + k);
                triangles.push([at(ring - 1, inner), at(ring, outer), at(ring, outer + 1)]);
                if k + 1 < ring {
                    triangles.push([at(ring - 1, inner), at(ring, outer + 1), at(ring - 1, inner + 1)]);
                }
            }
        }
    }
    Mesh::from_triangles(CAP, points, &triangles)
}

/// A run of a method on a surface.
#[derive(Clone, Debug)]
pub struct MapRun {
    /// Name of the surface.
    pub problem: String,
    /// Name of the method, with what was changed of its settings.
    pub method: String,
    /// The states, the start first.
    pub rows: Vec<MapRow>,
    /// Why it ended.
    pub reason: String,
    /// The last map, with its report.
    pub end: Unwrapped,
}

/// What is measured of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Within [`EARLY`] of the least energy, that of the local variable while triangles are flipped: eta and tau of the paper.
    EarlyDual,
    /// The same without flips.
    Early,
    /// At a relative error of [`LATE`], without flips: N_c and t_c.
    Late,
}

impl Phase {
    /// All of them.
    pub const ALL: [Phase; 3] = [Phase::EarlyDual, Phase::Early, Phase::Late];
}

impl std::fmt::Display for Phase {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Phase::EarlyDual => "early by energy_z",
            Phase::Early => "early",
            Phase::Late => "late",
        })
    }
}

impl MapRun {
    /// The first state of a phase.
    pub fn reached(&self, phase: Phase, least: f64) -> Option<&MapRow> {
        self.rows.iter().find(|row| match phase {
            Phase::EarlyDual => shown_energy(row) <= (1.0 + EARLY) * least,
            Phase::Early => row.flips == 0 && row.energy <= (1.0 + EARLY) * least,
            Phase::Late => row.flips == 0 && row.energy <= (1.0 + LATE) * least,
        })
    }
}

/// The energy as the paper plots it: that of the local variable while triangles are flipped.
pub fn shown_energy(row: &MapRow) -> f64 {
    if row.flips > 0 && row.energy_z.is_finite() { row.energy_z } else { row.energy }
}

/// Maps a surface. The run ends where, without flips, its energy is at most `until`.
///
/// # Errors
/// Settings or a surface that make no problem.
pub fn run(
    mesh: &Mesh,
    method: impl Into<String>,
    settings: &UnwrapSettings,
    until: f64,
    repeats: usize,
) -> Result<MapRun, BenchError> {
    let input = UnwrapInput { mesh: mesh.clone(), ..UnwrapInput::default() };
    let once = || {
        let mut hooks = Hooks { traced: true, ..Hooks::default() };
        let cancel = hooks.cancel.clone();
        let mut watch = |p: &Progress| {
            if p.inverted == 0 && p.energy <= until {
                cancel.store(true, Ordering::Relaxed);
            }
        };
        hooks.progress = Some(&mut watch);
        unwrap(&input, settings, &mut hooks).map_err(BenchError::from_display)
    };
    let mut end = once()?;
    for _ in 1..repeats.max(1) {
        for (row, again) in end.rows.iter_mut().zip(&once()?.rows) {
            row.seconds = row.seconds.min(again.seconds);
        }
    }
    // The last row is the one at which the watch ended the run.
    let done = end.rows.last().is_some_and(|row| row.flips == 0 && row.energy <= until);
    let reason = if done { "all levels reached".to_string() } else { end.report.reason.clone() };
    Ok(MapRun { problem: mesh.name.clone(), method: method.into(), rows: std::mem::take(&mut end.rows), reason, end })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proxel::mesh::charts::disk_defect;

    #[test]
    fn a_cap_is_a_disk_of_its_area() {
        let mesh = cap(16);
        assert_eq!(disk_defect(&mesh), None);
        assert_eq!(mesh.faces.len(), 6 * 16 * 16);
        let area: f64 = mesh
            .faces
            .fan_triangles()
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| mesh.points[v as usize]);
                let (e, f) = ([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
                let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
                assert!((0..3).map(|d| n[d] * a[d]).sum::<f64>() > 0.0, "outwards");
                0.5 * n.iter().map(|v| v * v).sum::<f64>().sqrt()
            })
            .sum();
        let exact = std::f64::consts::TAU * (1.0 - (RIM * std::f64::consts::PI).cos());
        assert!((area / exact - 1.0).abs() < 0.01, "{area}");
    }
}
