//! `proxel info`: what a mesh is and what is wrong with it.

use proxel_mesh::check::{Severity, diagnose};
use proxel_mesh::read_mesh_lenient;

use crate::args::InfoArgs;
use crate::refusal::Refusal;

/// Prints a diagnosis of each mesh; refuses if one of them could not be solved on.
pub fn run(args: &InfoArgs) -> Result<u8, Refusal> {
    let mut unsound = None;
    for (i, path) in args.meshes.iter().enumerate() {
        let report = diagnose(&read_mesh_lenient(path)?);
        if i > 0 {
            say!("");
        }
        print!("{report}");
        let errors = report.problems.iter().filter(|p| p.severity == Severity::Error);
        let mut errors = errors.map(|p| p.text.clone());
        if let Some(first) = errors.next() {
            unsound.get_or_insert((first, errors.count()));
        }
    }
    match unsound {
        None => Ok(0),
        Some((first, 0)) => Err(Refusal::new(first)),
        Some((first, more)) => Err(Refusal::new(format!("{first} (and {more} more, see above)"))),
    }
}
