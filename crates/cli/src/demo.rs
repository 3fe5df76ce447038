//! `proxel demo`: an octopus without files.

use std::time::Instant;

use proxel::deform::DeformInput;
use proxel::settings::DeformSettings;
use proxel_mesh::generate::{Octopus, OctopusSettings, octopus};

use crate::args::DemoArgs;
use crate::deform::{Files, Inputs, solve_and_write};
use crate::interrupt::Interrupt;
use crate::refusal::Refusal;

/// Makes, poses, writes.
pub fn run(args: &DemoArgs) -> Result<u8, Refusal> {
    let settings = DeformSettings { threads: args.threads, ..DeformSettings::default() };
    settings.check().map_err(Refusal::new)?;
    std::fs::create_dir_all(&args.out).map_err(|e| {
        Refusal::new(format!("{}: the folder cannot be made: {e}; give another --out", args.out.display()))
    })?;
    let file = |name: &str| args.out.join(name);
    let files = Files {
        meshes: vec![file("octopus.vtu"), file("octopus.obj")],
        preview: Some(file("octopus.png")),
        ..Files::default()
    };
    files.check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    let octopus = octopus(&OctopusSettings::default())?;
    let input = pose(octopus);
    if !args.quiet {
        println!(
            "an octopus of {} vertices and {} tetrahedra, {} of them pinned; its arms start twisted",
            input.rest.n_verts(),
            input.rest.tets.len(),
            input.fixed.len()
        );
    }
    let inputs = Inputs { input, warnings: Vec::new(), read: began.elapsed().as_secs_f64() };
    solve_and_write(inputs, &settings, &files, &interrupt, args.quiet)
}

/// Turns of the arms around the body in the start, at the tip.
const SWIRL: f64 = 0.55;

/// The core stays, the tips are held where a swirl around the vertical axis takes them, and the
/// start has all arms wound up by far more than that.
fn pose(octopus: Octopus) -> DeformInput {
    let rest = &octopus.mesh.points;
    let turned = |p: [f64; 3], angle: f64, lift: f64| {
        let (s, c) = angle.sin_cos();
        [c * p[0] + s * p[2], p[1] + lift, c * p[2] - s * p[0]]
    };
    let start: Vec<[f64; 3]> = rest
        .iter()
        .zip(&octopus.arm_point)
        .map(|(&p, arm)| match arm {
            None => p,
            Some(at) => turned(p, SWIRL * std::f64::consts::TAU * at.t * at.t, 0.0),
        })
        .collect();
    let mut fixed: Vec<(u32, [f64; 3])> = octopus.core.iter().map(|&v| (v, rest[v as usize])).collect();
    for arm in &octopus.arms {
        fixed.extend(arm.tip.iter().map(|&v| (v, start[v as usize])));
    }
    fixed.sort_unstable_by_key(|f| f.0);
    DeformInput { rest: octopus.mesh, start: Some(start), fixed, ..DeformInput::default() }
}
