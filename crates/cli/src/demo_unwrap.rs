//! `proxel demo unwrap`: the skin of the octopus, mapped to the plane.

use std::time::Instant;

use proxel::settings::UnwrapSettings;
use proxel::unwrap::UnwrapInput;
use proxel_mesh::Mesh;
use proxel_mesh::generate::{OctopusSettings, octopus};
use proxel_mesh::topology::boundary_surface;

use crate::args::DemoArgs;
use crate::interrupt::Interrupt;
use crate::refusal::Refusal;
use crate::unwrap::{Files, Job};

/// Its name on the command line.
pub const UNWRAP: &str = "unwrap";

/// Makes, maps, writes.
pub fn run(args: &DemoArgs) -> Result<u8, Refusal> {
    let began = Instant::now();
    let settings = UnwrapSettings { threads: args.threads, bijective: true, ..UnwrapSettings::default() };
    settings.check().map_err(Refusal::new)?;
    std::fs::create_dir_all(&args.out).map_err(|e| {
        Refusal::new(format!("{}: the folder cannot be made: {e}; give another --out", args.out.display()))
    })?;
    let file = |ending: &str| args.out.join(format!("{}{ending}", args.sample));
    let files = Files {
        out: file(".obj"),
        report: None,
        trace: None,
        map: Some(file("-map.png")),
        surface: Some(file(".png")),
        heat: Some(file(".ply")),
    };
    files.check()?;
    let interrupt = Interrupt::listen()?;
    let mesh = skin(&octopus(&OctopusSettings::default())?.mesh);
    if !args.quiet {
        say!("the skin of the octopus ({} vertices, {} triangles)", mesh.n_verts(), mesh.faces.len());
    }
    let input = UnwrapInput { mesh, ..UnwrapInput::default() };
    let read = began.elapsed().as_secs_f64();
    Job { source: None, files: &files, input: &input, read, quiet: args.quiet }.run(&settings, &interrupt)
}

/// The boundary of a body, with its own vertices only.
fn skin(body: &Mesh) -> Mesh {
    let mut triangles = boundary_surface(&body.tets);
    let mut number = vec![u32::MAX; body.n_verts()];
    let mut points = Vec::new();
    for v in triangles.iter_mut().flatten() {
        let number = &mut number[*v as usize];
        if *number == u32::MAX {
            *number = points.len() as u32;
            points.push(body.points[*v as usize]);
        }
        *v = *number;
    }
    Mesh::from_triangles(UNWRAP, points, &triangles)
}
