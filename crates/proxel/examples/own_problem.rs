//! A problem put together by hand: a rubber block that hangs on four cables, solved by R-ADMM with an observer of one's
//! own.
//!
//! `cargo run --release -p proxel --example own_problem`

use proxel::mesh::generate::{CellSplit, beam};
use proxel::model::elements::{Elements, Polar, Rest};
use proxel::model::energy::{Energy, Lame, NeoHookean, Spring};
use proxel::split::{
    Admm, AdmmSettings, GradientTolerance, IterationLimit, Lbfgs, LbfgsSettings, Method, Observer, Problem, Quadratic,
    Status, StepReport, run,
};

/// Prints a line every twenty iterations.
struct Printer;

impl Observer for Printer {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        if report.iteration.is_multiple_of(20) {
            let now = method.evaluate();
            println!(
                "{:4}  energy {:+.8e}  gradient {:.2e}  {} inner",
                report.iteration, now.energy.value, now.gradient_norm, report.inner
            );
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Nodes: those of the block, then a hook for each of its upper corners, half a unit above and outwards. Nodes at the
    // end stay where they are; the first n_free are unknowns.
    let block = beam([6, 3, 6], [1.0, 0.5, 1.0], CellSplit::Five)?;
    let n_free = block.n_verts();
    let mut x0: Vec<f64> = block.points.as_flattened().to_vec();
    let mut cables: Vec<u32> = Vec::new();
    for (v, &[x, y, z]) in block.points.iter().enumerate() {
        if x.abs() == 0.5 && z.abs() == 0.5 && y == 0.25 {
            cables.extend([v as u32, (x0.len() / 3) as u32]);
            x0.extend([1.5 * x, y + 0.5, 1.5 * z]);
        }
    }

    // Two terms, rotation-aware both: the block's tetrahedra and the cables. An element's squared weight is its measure
    // times the stiffness at rest, W(21).
    let rubber: NeoHookean = <NeoHookean as Energy<3>>::from_lame(&Lame::from_young_poisson(1e5, 0.4)?);
    let cable = Spring { stiffness: 2e4 };
    let tets = Rest::<3, 3>::new(&x0, block.tets.as_flattened())?;
    let lines = Rest::<3, 1>::new(&x0, &cables)?;
    let tets = Elements::<3, 3, Polar>::new(&tets, rubber, Energy::<3>::rest_stiffness(&rubber));
    let lines = Elements::<3, 1, Polar>::new(&lines, cable, cable.rest_stiffness());

    // The weight, 0.5 x 1000 x 9.81 in all, spread evenly over the block's nodes: -b . x with b pointing down.
    let weight = 0.5 * 1000.0 * 9.81;
    let mut loads = vec![0.0; x0.len()];
    (0..n_free).for_each(|v| loads[3 * v + 1] = -weight / n_free as f64);

    let problem = Problem {
        dim: 3,
        n_free,
        x0: x0.clone(),
        terms: vec![Box::new(tets), Box::new(lines)],
        quadratic: Quadratic { loads, ..Quadratic::default() },
        barrier: true, // a solution has no inverted element
    };

    // R-ADMM: polar coupling, L-BFGS as the global step, weights that stay.
    let global = Box::new(Lbfgs::new(LbfgsSettings::default()));
    let settings = AdmmSettings { name: "r-admm".to_owned(), global, reweighting: None, renewed_at: None };
    let mut method = Admm::new(problem, settings)?;
    let mut tolerance = GradientTolerance::new(1e-9, &mut method);
    let outcome = run(&mut method, &mut [&mut tolerance, &mut IterationLimit(2000)], &mut Printer);
    println!("{} after {} iterations: {}", outcome.status.as_str(), outcome.iterations, outcome.reason);

    // The cables carry the weight: force = stiffness (s - 1), of which the vertical part counts.
    let at = |x: &[f64], v: u32| -> [f64; 3] { std::array::from_fn(|d| x[v as usize * 3 + d]) };
    let carried: f64 = cables
        .chunks_exact(2)
        .map(|ends| {
            let span = |x: &[f64]| {
                let (a, b) = (at(x, ends[0]), at(x, ends[1]));
                let e = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
                (e[1], (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sqrt())
            };
            let ((_, rest), (rise, length)) = (span(&x0), span(&outcome.x));
            cable.stiffness * (length / rest - 1.0) * rise / length
        })
        .sum();
    println!("the cables carry {carried:.6} of {weight:.6}");
    assert_eq!(outcome.status, Status::Converged);
    assert!((carried - weight).abs() < 1e-6 * weight);
    Ok(())
}
