//! A hilly sheet becomes a map.
//!
//! `cargo run --release -p proxel --example unwrap`

use proxel::mesh::generate::cloth;
use proxel::mesh::uv::{CertificateOptions, certify, write_with_uv};
use proxel::settings::UnwrapSettings;
use proxel::split::Status;
use proxel::unwrap::{Hooks, UnwrapInput, unwrap};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut mesh = cloth([60, 40], [3.0, 2.0])?;
    for p in &mut mesh.points {
        p[2] += 0.3 * (3.0 * p[0]).sin() * (4.0 * p[1]).cos();
    }

    // Symmetric Dirichlet, method auto, packed into the unit square: the defaults, as on the command line.
    let input = UnwrapInput { mesh, ..UnwrapInput::default() };
    let result = unwrap(&input, &UnwrapSettings::default(), &mut Hooks::default())?;
    assert_eq!(result.status, Status::Converged);

    // What is known of the map by exact predicates, and how far it is from an isometry.
    let (points, faces) = (&input.mesh.points, &input.mesh.faces);
    let certificate = certify(points, faces, &result.uv, &CertificateOptions::default())?;
    assert_eq!((certificate.flips, certificate.overlaps.triangle_pairs), (0, 0));
    println!("energy {:.6}, where 1 is an isometry", certificate.distortion.energy);

    let path = std::env::temp_dir().join("proxel-unwrap.obj");
    write_with_uv(&path, &input.mesh, None, &result.uv)?;
    println!("wrote {}", path.display());
    Ok(())
}
