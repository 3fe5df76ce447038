//! Methods against each other, and wavefronts against what they were made of.

use super::*;
use crate::Image;
use proxel_split::normalized;

const ALL: [Solver; 7] = [
    Solver::Admm { relaxation: 1.0 },
    Solver::Admm { relaxation: 1.8 },
    Solver::AlgorithmOne { window: 6 },
    Solver::LocalAlone { window: 6 },
    Solver::Fast,
    Solver::Gmres { restart: 10 },
    Solver::Pcg,
];

fn plane(image: &Image) -> Plane {
    Plane { width: image.width, height: image.height, values: image.channels[0].clone() }
}

/// The first linearised problem of a synthetic pair, without a pyramid.
fn problem(size: usize) -> Linearised {
    let pair = simulate(&SimulateSettings { size, max_shift: 0.5, seed: 1 }).unwrap();
    let planes = comparable(&pair.reference, &pair.captured, true).unwrap();
    let settings = PyramidSettings { coarsest: size, warps: 1, margin: 8, ..PyramidSettings::default() };
    let mut first = None;
    let _ = coarse_to_fine::<()>(&planes, &settings, &mut |_, of| {
        first = Some(of.clone());
        Ok(vec![0.0; of.width * of.height])
    });
    first.unwrap()
}

/// Iterations until the normalised combined residual is below each level, A(27).
fn counts(of: &Linearised, solver: Solver, levels: &[f64], most: usize) -> Vec<Option<usize>> {
    let mut method = of.method(solver).unwrap();
    let n = method.problem().local_dim();
    let mut found = vec![None; levels.len()];
    for k in 1..=most {
        method.step().unwrap();
        let r = method.squared_residuals().map_or(f64::INFINITY, |r| normalized(r.combined, n, 1.0));
        for (level, found) in levels.iter().zip(&mut found) {
            if r < *level && found.is_none() {
                *found = Some(k);
            }
        }
        if found.iter().all(Option::is_some) {
            break;
        }
    }
    found
}

#[test]
fn all_methods_have_one_minimum() {
    let of = problem(48);
    let mut reached: Vec<(f64, Vec<f64>)> = Vec::new();
    for solver in ALL {
        let mut method = of.method(solver).unwrap();
        for _ in 0..900 {
            method.step().unwrap();
        }
        method.residuals();
        let evaluation = method.evaluate();
        let x = method.x().to_vec();
        assert!(x.iter().sum::<f64>().abs() < 1e-8, "{solver:?}");
        reached.push((evaluation.energy.value, x));
    }
    let best = reached.iter().map(|r| r.0).fold(f64::INFINITY, f64::min);
    let (want, size) = (&reached[6].1, reached[6].1.iter().fold(0.0_f64, |m, v| m.max(v.abs())));
    for (solver, (energy, x)) in ALL.iter().zip(&reached) {
        assert!(energy - best <= 1e-9 * best, "{solver:?}: {energy} and {best}");
        let off = x.iter().zip(want).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off < 1e-3 * size, "{solver:?}: {off} of {size}");
    }
}

/// Of facts measured elsewhere: Anderson on z alone and GMRES are on a par, both about half of plain.
#[test]
fn the_ranking_of_the_paper() {
    let of = problem(128);
    let at = |solver| counts(&of, solver, &[1e-2], 1000)[0].expect("reached");
    let plain = at(Solver::Admm { relaxation: 1.0 });
    let (alone, gmres) = (at(Solver::LocalAlone { window: 10 }), at(Solver::Gmres { restart: 10 }));
    assert!(2 * alone <= plain + plain / 4, "{alone} of {plain}");
    assert!(2 * gmres <= plain + plain / 2, "{gmres} of {plain}");
    assert!(10 * alone.abs_diff(gmres) <= 5 * alone.max(gmres), "{alone} and {gmres}");
}

fn solved(pair: &SimulatedPair, settings: &PyramidSettings, iterations: usize) -> Plane {
    let planes = comparable(&pair.reference, &pair.captured, settings.texture).unwrap();
    coarse_to_fine::<()>(&planes, settings, &mut |_, of| {
        let mut method = of.method(Solver::LocalAlone { window: 6 }).unwrap();
        for _ in 0..iterations {
            method.step().unwrap();
        }
        Ok(method.x().to_vec())
    })
    .unwrap()
}

/// |phi - known| / |known|, both of mean 0.
fn error(phi: &Plane, known: &Image) -> f64 {
    let known = plane(known);
    let square = |f: &dyn Fn(usize) -> f64| (0..phi.values.len()).map(|k| f(k).powi(2)).sum::<f64>();
    (square(&|k| phi.values[k] - known.values[k]) / square(&|k| known.values[k])).sqrt()
}

#[test]
fn known_wavefronts_are_recovered() {
    for (max_shift, most) in [(0.5, 0.1), (2.0, 0.1)] {
        let pair = simulate(&SimulateSettings { size: 192, max_shift, seed: 7 }).unwrap();
        let phi = solved(&pair, &PyramidSettings::default(), 40);
        let error = error(&phi, &pair.phi);
        assert!(error < most, "{max_shift} pixels: {error}");
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let pair = simulate(&SimulateSettings { size: 96, max_shift: 1.0, seed: 2 }).unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let phi = pool.install(|| solved(&pair, &PyramidSettings::default(), 8));
        phi.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    let one = on(1);
    assert!(one == on(2) && one == on(3));
}

#[test]
fn problems_that_make_no_sense_are_refused() {
    let of = problem(32);
    let wrong = |change: &dyn Fn(&mut Linearised)| {
        let mut of = of.clone();
        change(&mut of);
        ALL.iter().all(|solver| of.method(*solver).is_err())
    };
    assert!(wrong(&|of| of.mu = 0.0));
    assert!(wrong(&|of| of.beta = f64::NAN));
    assert!(wrong(&|of| of.data.gt[5] = f64::INFINITY));
    assert!(wrong(&|of| of.width += 1));
    assert!(of.method(Solver::Gmres { restart: 0 }).is_err());
    assert!(of.method(Solver::Admm { relaxation: 2.0 }).is_err());
}
