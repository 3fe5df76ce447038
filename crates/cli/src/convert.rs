//! `proxel convert`: formats, refinement, orientation.

use proxel::pins::PinFile;
use proxel_mesh::refine::refine;
use proxel_mesh::{Fields, Format, Mesh, check, not_carried, read_mesh, read_points, write_mesh};

use crate::args::ConvertArgs;
use crate::files::Outputs;
use crate::refusal::Refusal;

/// Reads, changes and writes a mesh, and its start and pins with it.
pub fn run(args: &ConvertArgs) -> Result<u8, Refusal> {
    let mut outputs = Outputs::default().mesh("--out", &args.out)?;
    if let Some(path) = &args.init_out {
        outputs = outputs.mesh("--init-out", path)?;
    }
    outputs.file("--pins-out", args.pins_out.as_deref(), &[])?.check()?;

    let mut mesh = match Format::from_path(&args.mesh) {
        Ok(Format::Npy) => {
            Mesh { name: args.mesh.display().to_string(), points: read_points(&args.mesh)?, ..Mesh::default() }
        }
        _ => read_mesh(&args.mesh)?,
    };
    let mut start = args.init.as_deref().map(read_points).transpose()?;
    if let (Some(start), Some(path)) = (&start, &args.init)
        && start.len() != mesh.n_verts()
    {
        let (n, of) = (start.len(), mesh.n_verts());
        let text =
            format!("{}: it has {n} vertices, {} has {of}; give a start of the same mesh", path.display(), mesh.name);
        return Err(Refusal::new(text));
    }
    let mut pins = args.pins.as_deref().map(PinFile::read).transpose()?;
    if let (Some(pins), Some(path)) = (&pins, &args.pins_out) {
        pins.resolve(&mesh.points, start.as_deref())?;
        pins.to_text(path)?; // a list under the name of groups is told before the work
    }

    let turned = if args.fix_orientation { check::fix_orientation(&mesh.points, &mut mesh.tets) } else { 0 };
    for _ in 0..args.refine {
        let fine = refine(&mesh)?;
        pins = pins.map(|p| p.refined(&mesh.points, &fine.midpoint_of)).transpose()?;
        start = start.map(|s| fine.positions(&s)).transpose()?;
        mesh = fine.mesh;
    }

    let mut written = vec![args.out.display().to_string()];
    write_mesh(&args.out, &mesh, &Fields::none())?;
    if let (Some(start), Some(path)) = (start, &args.init_out) {
        let mut posed = mesh.with_points(start)?;
        if Format::from_path(path)? == Format::TetGen {
            // Positions are all that is asked for: a .node file alone.
            posed = Mesh { name: posed.name, points: posed.points, index_base: posed.index_base, ..Mesh::default() };
        }
        write_mesh(path, &posed, &Fields::none())?;
        written.push(path.display().to_string());
    }
    if let (Some(pins), Some(path)) = (&pins, &args.pins_out) {
        pins.write(path)?;
        written.push(path.display().to_string());
    }
    if !args.quiet {
        if args.fix_orientation {
            say!("turned {turned} tetrahedra");
        }
        let lost = not_carried(&args.out, &mesh, &Fields::none())?;
        if !lost.is_empty() {
            eprintln!("warning: {} does not carry {}", args.out.display(), lost.join(" and "));
        }
        say!("wrote {} ({} vertices)", written.join(", "), mesh.n_verts());
    }
    Ok(0)
}
