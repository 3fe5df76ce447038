//! Twists a rubber beam by a third of a turn: the library in one call.
//!
//! `cargo run --release -p proxel --example pose`

use proxel::deform::{DeformInput, Hooks, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::settings::DeformSettings;
use proxel::split::Status;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A beam of 2 x 0.5 x 0.5 along x. The left end stays, the right end is turned by 120 degrees around x.
    let rest = beam([16, 4, 4], [2.0, 0.5, 0.5], CellSplit::Five)?;
    let (sin, cos) = 120.0_f64.to_radians().sin_cos();
    let mut fixed = Vec::new();
    for (v, &[x, y, z]) in rest.points.iter().enumerate() {
        if x == -1.0 {
            fixed.push((v as u32, [x, y, z]));
        } else if x == 1.0 {
            fixed.push((v as u32, [x, cos * y - sin * z, sin * y + cos * z]));
        }
    }

    // Neo-Hookean, Young 1e7, Poisson 0.45, method auto: the defaults, as on the command line. Without a start the free
    // vertices follow the fixed ones smoothly.
    let input = DeformInput { rest, fixed, ..DeformInput::default() };
    let result = deform(&input, &DeformSettings::default(), &mut Hooks::default())?;

    let report = &result.report;
    println!("{} after {} iterations: {}", report.status, report.iterations, report.reason);
    println!("energy {:.6e}, {} inverted", report.energy.unwrap_or(f64::NAN), report.inverted.unwrap_or(0));

    // The cross-section in the middle takes half of the turn.
    let middle = |y: f64| input.rest.points.iter().position(|p| *p == [0.0, y, 0.0]).map(|v| result.positions[v]);
    let (Some(a), Some(b)) = (middle(-0.25), middle(0.25)) else { return Err("the grid has no middle".into()) };
    let angle = (b[2] - a[2]).atan2(b[1] - a[1]).to_degrees();
    println!("the middle is turned by {angle:.1} degrees");
    assert_eq!(result.status, Status::Converged);
    assert_eq!(report.inverted, Some(0));
    assert!((angle - 60.0).abs() < 1.0);
    Ok(())
}
