//! An energy of one's own is the built-in one, where both have the same formula.

use proxel::deform::{DeformInput, ElementEnergy, Hooks, Matrix, OwnEnergy, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::problem_file::ProblemFile;
use proxel::settings::{DeformSettings, Material, MethodName};
use proxel::split::Status;
use std::sync::Arc;

const MU: f64 = 3e5;
const LAMBDA: f64 = 7e5;

/// psi = mu/2 (|F|^2 - 3) - mu log J + lambda/2 log^2 J, P = mu F + (lambda log J - mu) F^-T; infinite where J <= 0.
struct NeoHookean;

impl ElementEnergy for NeoHookean {
    fn evaluate(&self, gradients: &[Matrix], values: &mut [f64], stresses: &mut [Matrix]) {
        for ((f, psi), p) in gradients.iter().zip(values).zip(stresses) {
            // Cofactors: J F^-T.
            let cofactor = |i: usize, j: usize| {
                let at = |a: usize, b: usize| f[(i + a) % 3][(j + b) % 3];
                at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
            };
            let j: f64 = (0..3).map(|k| f[0][k] * cofactor(0, k)).sum();
            if j <= 0.0 {
                *psi = f64::INFINITY;
                continue;
            }
            let square: f64 = f.as_flattened().iter().map(|v| v * v).sum();
            *psi = MU / 2.0 * (square - 3.0) - MU * j.ln() + LAMBDA / 2.0 * j.ln().powi(2);
            for a in 0..3 {
                for b in 0..3 {
                    p[a][b] = MU * f[a][b] + (LAMBDA * j.ln() - MU) * cofactor(a, b) / j;
                }
            }
        }
    }

    fn is_barrier(&self) -> bool {
        true
    }
}

fn pulled() -> DeformInput {
    let rest = beam([6, 2, 2], [3.0, 1.0, 1.0], CellSplit::Five).unwrap();
    let ends = rest.points.iter().enumerate().filter(|(_, p)| p[0].abs() == 1.5);
    let fixed = ends.map(|(v, &[x, y, z])| (v as u32, [1.3 * x, y + 0.3 * x, z])).collect();
    DeformInput { rest, fixed, ..DeformInput::default() }
}

fn settings(method: MethodName) -> DeformSettings {
    let material = Material { mu: Some(MU), lambda: Some(LAMBDA), ..Material::default() };
    DeformSettings { method, material, ..DeformSettings::default() }
}

#[test]
fn it_takes_the_steps_of_the_built_in_energy() {
    for method in [MethodName::Lbfgs, MethodName::Bcqn] {
        let built_in = deform(&pulled(), &settings(method), &mut Hooks::default()).unwrap();
        let input = DeformInput { energy: Some(OwnEnergy(Arc::new(NeoHookean))), ..pulled() };
        let own = deform(&input, &settings(method), &mut Hooks::default()).unwrap();
        assert_eq!((built_in.status, own.status), (Status::Converged, Status::Converged));
        let (a, b) = (built_in.report.energy.unwrap(), own.report.energy.unwrap());
        assert!((a - b).abs() <= 1e-11 * a.abs(), "{a} and {b}");
        for (p, q) in built_in.positions.as_flattened().iter().zip(own.positions.as_flattened()) {
            assert!((p - q).abs() < 1e-8, "{p} and {q}");
        }
        for (p, q) in built_in.reaction.as_flattened().iter().zip(own.reaction.as_flattened()) {
            assert!((p - q).abs() < 1e-6 * MU, "{p} and {q}");
        }
        assert_eq!(own.report.inverted, Some(0));
    }
}

#[test]
fn what_needs_more_than_gradients_is_refused() {
    let input = DeformInput { energy: Some(OwnEnergy(Arc::new(NeoHookean))), ..pulled() };
    for method in [MethodName::Auto, MethodName::Wrapd, MethodName::Newton] {
        let said = deform(&input, &settings(method), &mut Hooks::default()).unwrap_err().to_string();
        assert!(said.contains("use --method lbfgs or bcqn"), "{said}");
    }
    let file = ProblemFile::deform(&input, &settings(MethodName::Lbfgs)).unwrap();
    assert!(file.to_text().unwrap_err().to_string().contains("no data"));
}
