//! `proxel demo`: an octopus and other samples, without files.

use std::time::Instant;

use proxel::deform::DeformInput;
use proxel::samples::{Sample, sample};
use proxel::settings::DeformSettings;
use proxel_mesh::generate::{Arm, Octopus, OctopusSettings, octopus};

use crate::args::DemoArgs;
use crate::deform::{Files, Inputs, solve_and_write};
use crate::demo_animation::{self, ANIMATION};
use crate::demo_unwrap::{self, UNWRAP};
use crate::interrupt::Interrupt;
use crate::refusal::Refusal;

/// Makes, poses, writes.
pub fn run(args: &DemoArgs) -> Result<u8, Refusal> {
    if args.sample == ANIMATION {
        return demo_animation::run(args);
    }
    if args.sample == UNWRAP {
        return demo_unwrap::run(args);
    }
    let began = Instant::now();
    let Sample { about, input, settings } = match sample(&args.sample) {
        Some(sample) => sample?,
        None => Sample {
            about: "an octopus; its arms start in waves",
            input: pose(octopus(&OctopusSettings::default())?),
            settings: DeformSettings::default(),
        },
    };
    let settings = DeformSettings { threads: args.threads, ..settings };
    settings.check().map_err(Refusal::new)?;
    std::fs::create_dir_all(&args.out).map_err(|e| {
        Refusal::new(format!("{}: the folder cannot be made: {e}; give another --out", args.out.display()))
    })?;
    let file = |ending: &str| args.out.join(format!("{}.{ending}", args.sample));
    let files = Files { meshes: vec![file("vtu"), file("obj")], preview: Some(file("png")), ..Files::default() };
    files.check()?;
    let interrupt = Interrupt::listen()?;
    if !args.quiet {
        let rest = &input.rest;
        let counts = [(rest.tets.len(), "tetrahedra"), (rest.faces.len(), "triangles"), (rest.edges.len(), "edges")];
        let elements: Vec<String> =
            counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
        say!("{about} ({} vertices, {}, {} vertices pinned)", rest.n_verts(), elements.join(", "), input.fixed.len());
    }
    let inputs = Inputs { input, warnings: Vec::new(), read: began.elapsed().as_secs_f64() };
    solve_and_write(inputs, &settings, &files, &interrupt, args.quiet)
}

/// How far the arms swirl around the vertical axis, in degrees.
const SWIRL: f64 = 28.0;
/// How far they are raised around their roots, every other one, in degrees.
const RAISED: [f64; 2] = [8.0, 62.0];
/// How far each tip is bent inward beyond that, in degrees.
const CURL: f64 = 60.0;
/// How far each tip comes toward its root, so that arms bend instead of stretching.
const SLACK: f64 = 0.16;
/// Waves along each arm in the start, and their height in units of the body (about 1).
const WAVES: (f64, f64) = (3.0, 0.34);

/// The core stays where it is, the tips go rigidly where the arms are raised and curled, and the
/// arms start in wild waves.
fn pose(octopus: Octopus) -> DeformInput {
    let rest = &octopus.mesh.points;
    let poses: Vec<ArmPose> = octopus.arms.iter().enumerate().map(|(i, arm)| ArmPose::new(i, arm)).collect();
    let at = |v: usize| octopus.arm_point[v].map(|at| (&poses[at.arm as usize], at.t));
    let mut start: Vec<[f64; 3]> =
        rest.iter().enumerate().map(|(v, &p)| at(v).map_or(p, |(pose, t)| pose.start(p, t))).collect();
    let mut fixed: Vec<(u32, [f64; 3])> = octopus.core.iter().map(|&v| (v, rest[v as usize])).collect();
    for (arm, pose) in octopus.arms.iter().zip(&poses) {
        fixed.extend(arm.tip.iter().map(|&v| (v, pose.tip(rest[v as usize]))));
    }
    fixed.sort_unstable_by_key(|f| f.0);
    for &(v, target) in &fixed {
        start[v as usize] = target;
    }
    DeformInput { rest: octopus.mesh, start: Some(start), fixed, ..DeformInput::default() }
}

/// What happens to an arm.
struct ArmPose {
    root: [f64; 3],
    tip: [f64; 3],
    across: [f64; 3], // horizontal, the axis that it is raised around
    raised: f64,      // degrees
}

impl ArmPose {
    fn new(i: usize, arm: &Arm) -> Self {
        let (root, tip) = (arm.axis[0], arm.axis[arm.axis.len() - 1]);
        let (x, z) = (tip[0] - root[0], tip[2] - root[2]);
        let length = x.hypot(z).max(f64::MIN_POSITIVE);
        ArmPose { root, tip, across: [-z / length, 0.0, x / length], raised: RAISED[i % RAISED.len()] }
    }

    /// The part `w` of the way from rest to where a rigid arm would go.
    fn swung(&self, p: [f64; 3], w: f64) -> [f64; 3] {
        let p = rotated(p, self.root, self.across, w * self.raised);
        rotated(p, [0.0; 3], [0.0, 1.0, 0.0], w * SWIRL)
    }

    /// Where a vertex of the tip is held.
    fn tip(&self, p: [f64; 3]) -> [f64; 3] {
        let p = rotated(p, self.tip, self.across, CURL);
        self.swung([0, 1, 2].map(|c| p[c] + SLACK * (self.root[c] - self.tip[c])), 1.0)
    }

    /// Where a vertex at `t` of the arm's length starts.
    fn start(&self, p: [f64; 3], t: f64) -> [f64; 3] {
        let envelope = (std::f64::consts::PI * t).sin();
        let wave = WAVES.1 * envelope * (std::f64::consts::TAU * WAVES.0 * t).sin();
        let p = [0, 1, 2].map(|c| p[c] + wave * self.across[c]);
        self.swung(p, t * t * (3.0 - 2.0 * t))
    }
}

/// `p` rotated around the unit vector `axis` through `center` (Rodrigues).
fn rotated(p: [f64; 3], center: [f64; 3], axis: [f64; 3], degrees: f64) -> [f64; 3] {
    let (s, c) = degrees.to_radians().sin_cos();
    let d = [0, 1, 2].map(|i| p[i] - center[i]);
    let along = (0..3).map(|i| axis[i] * d[i]).sum::<f64>();
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        center[i] + c * d[i] + s * (axis[j] * d[k] - axis[k] * d[j]) + (1.0 - c) * along * axis[i]
    })
}
