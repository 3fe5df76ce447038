//! `proxel demo animation`: a bar that nods, with all files that `proxel deform --keyframes` takes.

use std::time::Instant;

use proxel::deform::DeformInput;
use proxel::pins::PinFile;
use proxel::settings::DeformSettings;
use proxel_mesh::generate::{CellSplit, beam};
use proxel_mesh::{Fields, write_mesh};

use crate::args::DemoArgs;
use crate::deform::{Inputs, Outlets, animate};
use crate::files::write_text;
use crate::interrupt::Interrupt;
use crate::refusal::Refusal;

/// Its name on the command line.
pub const ANIMATION: &str = "animation";

const PINS: &str = "\
[groups.foot]
box = { min = [-9, -9, -9], max = [-1.99, 9, 9] }

[groups.head]
box = { min = [1.99, -9, -9], max = [9, 9, 9] }
";

const KEYFRAMES: &str = "\
frames_per_second = 12

[[keyframe]]
time = 0

[[keyframe]]
time = 1
[keyframe.groups.head]
rotate = { axis = [0, 0, 1], angle = 110 }
translate = [-1.6, 1.8, 0]

[[keyframe]]
time = 2
[keyframe.groups.head]
rotate = { axis = [1, 0, 0], angle = 180 }
translate = [0.2, 0, 0]

[[keyframe]]
time = 3
[keyframe.groups.head]
";

/// Makes, moves, writes.
pub fn run(args: &DemoArgs) -> Result<u8, Refusal> {
    let began = Instant::now();
    let mut rest = beam([16, 4, 4], [4.0, 1.0, 1.0], CellSplit::Five)?;
    rest.name = ANIMATION.to_string(); // as the file is called
    let settings = DeformSettings { threads: args.threads, ..DeformSettings::default() };
    settings.check().map_err(Refusal::new)?;
    std::fs::create_dir_all(&args.out).map_err(|e| {
        Refusal::new(format!("{}: the folder cannot be made: {e}; give another --out", args.out.display()))
    })?;
    let file = |name: &str| args.out.join(name);
    let (mesh, pins, keyframes) = (file("animation.mesh"), file("animation-pins.toml"), file("animation-keys.toml"));
    let outlets = Outlets { out: file("animation.glb"), report: None, trace: None };
    outlets.check()?;
    write_mesh(&mesh, &rest, &Fields::none())?;
    write_text(&pins, PINS)?;
    write_text(&keyframes, KEYFRAMES)?;
    let handles = PinFile::read(&pins)?.resolve(&rest.points, None)?;
    let interrupt = Interrupt::listen()?;
    if !args.quiet {
        let (n, tets, dir) = (rest.n_verts(), rest.tets.len(), args.out.display());
        say!("a bar whose head nods and turns ({n} vertices, {tets} tetrahedra); in {dir} the same is");
        say!(
            "proxel deform animation.mesh --pins animation-pins.toml --keyframes animation-keys.toml --out animation.glb"
        );
    }
    let input = DeformInput { rest, fixed: handles.fixed, groups: handles.groups, ..DeformInput::default() };
    let inputs = Inputs { input, warnings: Vec::new(), read: began.elapsed().as_secs_f64() };
    animate(inputs, &keyframes, None, &settings, &outlets, &interrupt, args.quiet)
}
