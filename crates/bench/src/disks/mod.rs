//! Disks that are hard to map: random patches and cuts of surfaces and generated sheets, decimated, bent and made noisy.
//!
//! A number makes a mesh, the same on every machine: kind, size and what is done to it are drawn from it.

mod coarsen;
mod patch;
mod sheet;
mod spoil;

use crate::BenchError;
use proxel::mesh::charts::{ChartOptions, charts, disk_defect};
use proxel::mesh::generate::{OctopusSettings, ball, octopus, torus};
use proxel::mesh::{Mesh, read_mesh_lenient, topology};
use proxel_testkit::SplitMix;
use std::path::Path;

/// A mesh made from a number.
#[derive(Clone, Debug)]
pub struct Disk {
    /// The number.
    pub seed: u64,
    /// What it is of, and what was done to it.
    pub made: String,
    /// The mesh, triangles only.
    pub mesh: Mesh,
}

/// A surface to take patches from.
#[derive(Clone, Debug)]
pub struct Source {
    mesh: Mesh,
    triangles: Vec<[u32; 3]>,
    neighbours: Vec<[u32; 3]>, // across the edge from corner k to the next, or NONE
}

const NONE: u32 = u32::MAX;

/// Faces of most disks, and of one in [`RARE`].
const USUAL: (f64, f64) = (200.0, 5_000.0);
const LARGE: (f64, f64) = (5_000.0, 50_000.0);
const RARE: usize = 40;

impl Source {
    fn new(mesh: Mesh) -> Self {
        let triangles = mesh.faces.fan_triangles();
        let mut edges: Vec<(u32, u32, bool, u32)> = Vec::with_capacity(3 * triangles.len());
        for (f, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                edges.push((a.min(b), a.max(b), a < b, (3 * f + k) as u32));
            }
        }
        edges.sort_unstable();
        let mut neighbours = vec![[NONE; 3]; triangles.len()];
        // Only where exactly two faces meet, in one orientation.
        for group in edges.chunk_by(|e, g| (e.0, e.1) == (g.0, g.1)) {
            if let [(_, _, false, c), (_, _, true, d)] = group {
                neighbours[*c as usize / 3][*c as usize % 3] = d / 3;
                neighbours[*d as usize / 3][*d as usize % 3] = c / 3;
            }
        }
        Source { mesh, triangles, neighbours }
    }
}

/// What patches are taken from: a ball, a torus and an octopus, and the surfaces in `folder`, where there is one.
///
/// # Errors
/// A file that cannot be read.
pub fn sources(folder: Option<&Path>) -> Result<Vec<Source>, BenchError> {
    let solids = [
        ball(1.0, 0.12).map_err(BenchError::from_display)?,
        torus(1.0, 0.35, 0.1).map_err(BenchError::from_display)?,
        octopus(&OctopusSettings::default()).map_err(BenchError::from_display)?.mesh,
    ];
    let skin = |solid: Mesh| Mesh::from_triangles(solid.name, solid.points, &topology::boundary_surface(&solid.tets));
    let mut all: Vec<Source> = solids.into_iter().map(|solid| Source::new(skin(solid))).collect();
    for path in folder.map(crate::maps::meshes_in).unwrap_or_default() {
        let mut mesh = read_mesh_lenient(&path).map_err(BenchError::from_display)?;
        mesh.name = crate::maps::name_of(&path);
        all.push(Source::new(mesh));
    }
    Ok(all)
}

/// The disk of a number; what it was to be, where that is none.
///
/// # Errors
/// The reason why what was made is no disk.
pub fn disk(seed: u64, sources: &[Source]) -> Result<Disk, String> {
    let mut random = SplitMix::new(seed);
    random.bits();
    let (low, high) = if random.below(RARE) == 0 { LARGE } else { USUAL };
    let faces = random.log_uniform(low, high) as usize;
    let mut made = Vec::new();
    let mut mesh = match random.below(10) {
        0..=4 if !sources.is_empty() => {
            patch::random(&sources[random.below(sources.len())], faces, &mut random, &mut made)
        }
        5..=6 if !sources.is_empty() => {
            slit(&sources[random.below(sources.len())], faces, &mut random, &mut made).unwrap_or_default()
        }
        _ => sheet::random(faces, &mut random, &mut made),
    };
    if random.below(3) == 0 {
        mesh = coarsen::random(&mesh, &mut random, &mut made);
    }
    spoil::random(&mut mesh, &mut random, &mut made);
    let made = made.join(", ");
    mesh = compact(&mesh, format!("disk-{seed}"));
    match disk_defect(&mesh) {
        Some(defect) => Err(format!("{made}: {defect}")),
        None => Ok(Disk { seed, made, mesh }),
    }
}

/// The largest chart of a surface that is cut along random paths.
fn slit(source: &Source, faces: usize, random: &mut SplitMix, made: &mut Vec<String>) -> Option<Mesh> {
    let mesh = if source.triangles.len() > 3 * faces {
        patch::random(source, faces, random, made)
    } else {
        made.push(format!("{}, whole", source.mesh.name));
        Mesh::from_triangles(source.mesh.name.clone(), source.mesh.points.clone(), &source.triangles)
    };
    let mut seams = patch::walks(&mesh, random);
    seams.sort_unstable();
    seams.dedup();
    made.push(format!("cut along {} random edges", seams.len()));
    let cut = charts(&mesh, &ChartOptions { seams, ..ChartOptions::default() }).ok()?;
    let largest = cut.charts.iter().filter(|c| c.is_disk()).max_by_key(|c| c.triangles.len())?;
    let points = largest.vertices.iter().map(|v| mesh.points[*v as usize]).collect();
    Some(Mesh::from_triangles(mesh.name.clone(), points, &largest.triangles))
}

/// Without vertices that no face uses.
fn compact(mesh: &Mesh, name: String) -> Mesh {
    let mut number = vec![NONE; mesh.points.len()];
    let mut points = Vec::new();
    let mut triangles = mesh.faces.fan_triangles();
    for v in triangles.iter_mut().flatten() {
        let to = &mut number[*v as usize];
        if *to == NONE {
            *to = points.len() as u32;
            points.push(mesh.points[*v as usize]);
        }
        *v = *to;
    }
    Mesh::from_triangles(name, points, &triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_make_disks_the_same_each_time() {
        let sources = sources(None).expect("generated");
        let disks: Vec<Disk> = (0..60).filter_map(|seed| disk(seed, &sources).ok()).collect();
        assert!(disks.len() >= 50, "{} disks of 60", disks.len());
        for d in &disks {
            assert_eq!(disk_defect(&d.mesh), None, "{}", d.made);
            assert!(d.mesh.faces.len() >= 20, "{}: {} faces", d.made, d.mesh.faces.len());
            assert!(d.mesh.points.iter().flatten().all(|v| v.is_finite()));
            let again = disk(d.seed, &sources).expect("again");
            assert_eq!((again.made, again.mesh), (d.made.clone(), d.mesh.clone()));
        }
        let kinds = |word: &str| disks.iter().filter(|d| d.made.contains(word)).count();
        for word in ["patch", "sheet", "collapsed", "noise", "cut along"] {
            assert!(kinds(word) >= 3, "{word}: {}", kinds(word));
        }
    }
}
