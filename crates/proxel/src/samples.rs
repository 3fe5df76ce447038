//! Problems without files: what `proxel demo` solves, and what tests and reproductions begin with.

use crate::deform::DeformInput;
use crate::settings::{DeformSettings, Material};
use proxel_mesh::generate::{CellSplit, beam, cloth as grid};
use proxel_mesh::{Mesh, MeshError};
use std::collections::BTreeMap;

/// A problem and the settings that belong to it.
#[derive(Clone, Debug)]
pub struct Sample {
    /// What it is, in a sentence.
    pub about: &'static str,
    /// The problem.
    pub input: DeformInput,
    /// Its settings.
    pub settings: DeformSettings,
}

/// The names of the samples, in the order of [`sample`].
pub const NAMES: [&str; 4] = ["cloth", "planar", "springs", "mixed"];

/// The sample of a name, of the size that `proxel demo` solves.
///
/// # Errors
/// Sizes that make no mesh, which these do not; `None` for a name that is not known.
pub fn sample(name: &str) -> Option<Result<Sample, MeshError>> {
    Some(match name {
        "cloth" => cloth(64),
        "planar" => planar(48),
        "springs" => springs(32),
        "mixed" => mixed(10),
        _ => return None,
    })
}

/// How far the corners of the cloth are moved towards each other, in units of its side.
const SLACK: f64 = 0.12;

/// A square of cloth of `cells` x `cells` squares, its side 1 m, held at its corners closer together than they were, and
/// relaxed under its weight from a start in waves: the problem of W, Figure 8. ARAP stretch, strains within 5 %,
/// quadratic bending.
///
/// # Errors
/// As [`proxel_mesh::generate::cloth`].
pub fn cloth(cells: usize) -> Result<Sample, MeshError> {
    let mut rest = grid([cells; 2], [1.0; 2])?;
    for p in &mut rest.points {
        *p = [p[0], 0.0, -p[1]]; // lying, normals up
    }
    let corners = [0, cells, cells * (cells + 1), (cells + 1) * (cells + 1) - 1];
    let shrunk = |p: [f64; 3]| [p[0] * (1.0 - SLACK), p[1], p[2] * (1.0 - SLACK)];
    let fixed: Vec<(u32, [f64; 3])> = corners.map(|v| (v as u32, shrunk(rest.points[v]))).to_vec();
    let start = rest.points.iter().map(|p| {
        // Waves that vanish at the corners.
        let [x, _, z] = *p;
        let (a, b) = (std::f64::consts::TAU * x, std::f64::consts::TAU * z);
        let envelope = (1.0 - 16.0 * x * x * z * z).max(0.0);
        let height =
            0.06 * (3.0 * a + 1.5 * b).sin() + 0.05 * (2.0 * b - a).cos() + 0.03 * (5.0 * a).sin() * (4.0 * b).cos();
        let [x, _, z] = shrunk(*p);
        [x, envelope * height, z]
    });
    let start = start.collect();
    let groups = ["near left", "near right", "far left", "far right"]
        .iter()
        .zip(corners)
        .map(|(name, v)| ((*name).to_owned(), vec![v as u32]))
        .collect();
    let settings = DeformSettings {
        // E h of 100 N/m and E h^3 / 12 of 1e-5 N m are a light fabric of 0.2 kg/m^2.
        material: Material { energy: "arap".into(), young: 100.0, poisson: 0.0, ..Material::default() },
        bending: 1e-5,
        strain_limit: Some([0.95, 1.05]),
        density: 0.2,
        gravity: [0.0, -9.81, 0.0],
        ..DeformSettings::default()
    };
    let input = DeformInput { rest, start: Some(start), fixed, groups, ..DeformInput::default() };
    Ok(Sample { about: "a square of cloth held at its corners; it starts in waves", input, settings })
}

/// A strip in the plane z = 0, 4 times as long as high, `cells` squares long; its left end is held, the right one is turned
/// by a right angle and lowered.
///
/// # Errors
/// As [`proxel_mesh::generate::cloth`].
pub fn planar(cells: usize) -> Result<Sample, MeshError> {
    let height = cells.div_ceil(4).max(1);
    let rest = grid([cells, height], [2.0, 0.5])?;
    let mut fixed = Vec::new();
    for (v, &[x, y, z]) in rest.points.iter().enumerate() {
        if x <= -1.0 {
            fixed.push((v as u32, [x, y, z]));
        } else if x >= 1.0 {
            fixed.push((v as u32, [0.3 + y, -1.2, z]));
        }
    }
    let settings = DeformSettings {
        material: Material { energy: "stable-neo-hookean".into(), young: 1e5, poisson: 0.4, ..Material::default() },
        planar: true,
        ..DeformSettings::default()
    };
    let input = DeformInput { rest, fixed, ..DeformInput::default() };
    Ok(Sample { about: "a strip in the plane, one end held, the other turned", input, settings })
}

/// A net of springs along the edges of `cells` x `cells` squares and their diagonals, held at its rim, that sags under its
/// weight.
///
/// # Errors
/// As [`proxel_mesh::generate::cloth`].
pub fn springs(cells: usize) -> Result<Sample, MeshError> {
    let mut rest = grid([cells; 2], [1.0; 2])?;
    for p in &mut rest.points {
        *p = [p[0], 0.0, -p[1]];
    }
    let on_rim = |p: &[f64; 3]| p[0].abs().max(p[2].abs()) >= 0.5;
    let fixed = (0..).zip(&rest.points).filter(|(_, p)| on_rim(p)).map(|(v, p)| (v, *p)).collect();
    let settings = DeformSettings {
        material: Material { energy: "spring".into(), young: 4.0, poisson: 0.0, ..Material::default() },
        density: 0.1,
        gravity: [0.0, -9.81, 0.0],
        ..DeformSettings::default()
    };
    // A net that lies flat has no stiffness upwards: it starts a little lower.
    let start = rest.points.iter().map(|p| [p[0], -0.4 * (0.25 - p[0] * p[0]) * (0.25 - p[2] * p[2]) * 16.0, p[2]]);
    let start = start.map(|p| p.map(|c| if c == 0.0 { 0.0 } else { c })).collect();
    let input = DeformInput { rest, start: Some(start), fixed, ..DeformInput::default() };
    Ok(Sample { about: "a net of springs held at its rim", input, settings })
}

/// Regions of the membrane and of the cables.
const MEMBRANE: i32 = 1;
const CABLES: i32 = 2;

/// Tetrahedra, triangles and edges in one mesh: a rubber block that hangs on four cables and carries a membrane, which
/// hangs down from its lower front edge. `cells` squares along the membrane's width.
///
/// # Errors
/// As [`proxel_mesh::generate::beam`].
pub fn mixed(cells: usize) -> Result<Sample, MeshError> {
    let high = cells.div_ceil(2).max(1);
    let mut rest = Mesh { name: "mixed".into(), ..beam([cells, high, high], [1.0, 0.5, 0.5], CellSplit::Five)? };
    // Cables from the upper corners to hooks.
    let corners: Vec<u32> = (0u32..)
        .zip(&rest.points)
        .filter(|(_, p)| p[0].abs() >= 0.5 && p[1] >= 0.25 && p[2].abs() >= 0.25)
        .map(|(v, _)| v)
        .collect();
    let mut fixed = Vec::new();
    for v in corners {
        let [x, y, z] = rest.points[v as usize];
        let hook = rest.points.len() as u32;
        rest.points.push([1.3 * x, y + 0.6, 1.3 * z]);
        fixed.push((hook, rest.points[hook as usize]));
        rest.edges.push([v, hook]);
    }
    // The membrane: rows of vertices below the lower front edge, which it shares.
    let mut row: Vec<u32> = (0u32..)
        .zip(&rest.points)
        .filter(|(_, p)| p[1] <= -0.25 && p[2] >= 0.25 && p[1] > -0.3)
        .map(|(v, _)| v)
        .collect();
    for k in 0..cells {
        let below: Vec<u32> = (0..row.len() as u32).map(|i| rest.points.len() as u32 + i).collect();
        for v in &row {
            let [x, y, z] = rest.points[*v as usize];
            // It starts obliquely, as a sail in the wind, and swings down.
            rest.points.push([x, y - 0.06, z + 0.05]);
        }
        for i in 0..row.len().saturating_sub(1) {
            let (a, b, c, d) = (row[i], row[i + 1], below[i], below[i + 1]);
            let split = if (i + k) % 2 == 0 { [[a, c, d], [a, d, b]] } else { [[a, c, b], [c, d, b]] };
            split.iter().for_each(|t| rest.faces.push(t));
        }
        row = below;
    }
    rest.face_regions = Some(vec![MEMBRANE; rest.faces.len()]);
    rest.edge_regions = Some(vec![CABLES; rest.edges.len()]);
    let membrane =
        Material { energy: "arap".into(), young: 2e3, poisson: 0.3, density: Some(1.0), ..Material::default() };
    let cable =
        Material { energy: "spring".into(), young: 1e4, poisson: 0.0, density: Some(0.1), ..Material::default() };
    let settings = DeformSettings {
        material: Material { energy: "stable-neo-hookean".into(), young: 5e5, poisson: 0.4, ..Material::default() },
        materials: BTreeMap::from([(MEMBRANE, membrane), (CABLES, cable)]),
        bending: 1e-3,
        density: 1000.0,
        gravity: [0.0, -9.81, 0.0],
        mixed: true,
        ..DeformSettings::default()
    };
    let groups = vec![("hooks".to_owned(), fixed.iter().map(|f| f.0).collect())];
    let input = DeformInput { rest, fixed, groups, ..DeformInput::default() };
    Ok(Sample { about: "a block on four cables, with a membrane", input, settings })
}
