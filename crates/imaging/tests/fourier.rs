//! Transforms, convolutions and the step in Fourier space, against sums written out.

use proxel_imaging::{
    Blur, BlurredSquares, Boundary, Fourier, FourierStep, GradientTerm, Grid, Observed, PixelTerm, Psf, Squares,
    Symbol, TotalVariation, convolve,
};
use proxel_split::{Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Method, Potential, Problem, Quadratic, Term};
use proxel_testkit::SplitMix;
use std::sync::Arc;

fn numbers(n: usize, seed: u64) -> Vec<f64> {
    let mut random = SplitMix::new(seed);
    (0..n).map(|_| random.normal()).collect()
}

fn kernel() -> Psf {
    Psf::new(3, 2, vec![0.1, 0.4, 0.3, 0.05, 0.1, 0.2], None).expect("positive weights")
}

/// (K x)_ij = sum k_ab x_(i - a + ca)(j - b + cb), indices wrapped around.
fn blurred(psf: &Psf, grid: Grid, x: &[f64], i: usize, c: usize, j: usize) -> f64 {
    let (h, w) = (grid.height, grid.width);
    let mut sum = 0.0;
    for a in 0..psf.height {
        for b in 0..psf.width {
            let (i, j) = ((i + 7 * h + psf.center.0 - a) % h, (j + 7 * w + psf.center.1 - b) % w);
            sum += psf.weights[a * psf.width + b] * x[(i * grid.channels + c) * w + j];
        }
    }
    sum
}

#[test]
fn convolutions_are_sums_over_neighbours_that_wrap_around() {
    for (width, height, channels) in [(12, 9, 1), (13, 16, 3), (1, 5, 1), (6, 1, 2), (1, 1, 1), (2, 2, 1), (33, 31, 1)]
    {
        let grid = Grid { width, height, channels };
        let fourier = Fourier::new(width, height);
        let (psf, x, y) = (kernel(), numbers(grid.len(), 1), numbers(grid.len(), 2));
        let spectrum = psf.spectrum(&fourier);
        let (mut forth, mut back) = (vec![0.0; grid.len()], vec![0.0; grid.len()]);
        convolve(grid, &fourier, &spectrum, false, &x, &mut forth);
        convolve(grid, &fourier, &spectrum, true, &y, &mut back);
        for i in 0..height {
            for c in 0..channels {
                for j in 0..width {
                    let (got, expected) = (forth[(i * channels + c) * width + j], blurred(&psf, grid, &x, i, c, j));
                    assert!((got - expected).abs() < 1e-12, "{grid:?} {i} {c} {j}: {got} and {expected}");
                }
            }
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        assert!((dot(&forth, &y) - dot(&x, &back)).abs() < 1e-11, "{grid:?}: not the transpose");
    }
}

#[test]
fn the_gradient_of_the_data_term_is_that_of_finite_differences() {
    let grid = Grid { width: 7, height: 6, channels: 2 };
    let fourier = Fourier::new(7, 6);
    let spectrum = Arc::new(kernel().spectrum(&fourier));
    let data = BlurredSquares::new(grid, Blur::Periodic { fourier, kernel: spectrum }, numbers(grid.len(), 3), 1.7);
    let (x, mut grad) = (numbers(grid.len(), 4), vec![0.0; grid.len()]);
    data.value_and_gradient(&x, Some(&mut grad));
    for node in 0..grid.len() {
        let at = |by: f64| {
            let mut x = x.clone();
            x[node] += by;
            data.value_and_gradient(&x, None)
        };
        let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
        assert!((grad[node] - slope).abs() < 1e-7, "node {node}: {} and {slope}", grad[node]);
    }
}

const LAMBDA: f64 = 40.0;

/// A(31) in the form with one splitting, and in that with the blurred field behind x.
fn deconvolution(grid: Grid, carried: bool) -> Admm {
    let fourier = Fourier::new(grid.width, grid.height);
    let spectrum = Arc::new(kernel().spectrum(&fourier));
    let observed: Vec<f64> = (0..grid.len()).map(|k| f64::from(u8::from(k % 7 > 3)) + 0.1 * (k % 5) as f64).collect();
    let gradient = GradientTerm::new(grid, Boundary::Periodic, 0, TotalVariation::isotropic(1.0), 8.0);
    let (n, mut terms): (usize, Vec<Box<dyn Term>>) = (grid.len(), vec![Box::new(gradient)]);
    let mut quadratic = Quadratic::default();
    let (global, n) = if carried {
        let squares = Squares {
            observed: Observed::new(grid, observed),
            lambda: Observed::new(grid, vec![LAMBDA; n]),
            most: LAMBDA,
        };
        terms.push(Box::new(PixelTerm::new(grid, n, squares, 30.0)));
        (FourierStep::with_blurred(grid, fourier, spectrum, vec![Symbol::Laplacian, Symbol::Blurred]), 2 * n)
    } else {
        let data = BlurredSquares::new(grid, Blur::Periodic { fourier, kernel: spectrum }, observed, LAMBDA);
        quadratic.potentials.push(Arc::new(data.clone()));
        (FourierStep::with_data(data, vec![Symbol::Laplacian]).expect("periodic"), n)
    };
    let problem = Problem { dim: 1, n_free: n, x0: vec![0.0; n], terms, quadratic, barrier: false };
    let global = Box::new(global);
    let settings = AdmmSettings { name: "test".to_string(), global, reweighting: None, renewed_at: None };
    Admm::new(problem, settings).expect("a definite operator")
}

#[test]
fn a_step_is_the_minimiser_and_knows_the_value_of_f() {
    let grid = Grid { width: 10, height: 7, channels: 2 };
    let mut method = deconvolution(grid, false);
    for _ in 0..5 {
        let u: Vec<f64> = method.dual();
        method.step().expect("a step");
        // The gradient of f + 1/2 w^2 |Dx - p|^2 vanishes.
        let forces = method.forces().expect("a splitting");
        let size = proxel_split::vector::norm(&forces);
        assert!(size < 1e-10, "{size}, |u| = {}", proxel_split::vector::norm(&u));
        let known = method.energy().value;
        let x = method.x().to_vec();
        let direct = deconvolution(grid, false).into_parts().0.energy(&x, None).value;
        assert!((known - direct).abs() < 1e-11 * direct, "{known} and {direct}");
    }
}

#[test]
fn all_forms_and_accelerations_have_one_minimum() {
    let grid = Grid { width: 20, height: 15, channels: 1 };
    let least = {
        let mut method = deconvolution(grid, false);
        for _ in 0..3000 {
            method.step().expect("a step");
        }
        method.energy().value
    };
    let relaxed = |carried| {
        let cycle = Cycle { relaxation: 1.8, ..Cycle::PLAIN };
        deconvolution(grid, carried).with_cycle(cycle).expect("a cycle")
    };
    let accelerated = |algorithm, carried| {
        Acceleration::anderson(algorithm, 6).of(deconvolution(grid, carried)).expect("an acceleration")
    };
    let mut methods: Vec<(&str, Box<dyn Method>)> = vec![
        ("relaxed", Box::new(relaxed(false))),
        ("carried, relaxed", Box::new(relaxed(true))),
        ("(z, u)", accelerated(Algorithm::One, false)),
        ("v", accelerated(Algorithm::DouglasRachford, false)),
        ("carried, (z, u)", accelerated(Algorithm::One, true)),
        ("carried, v", accelerated(Algorithm::DouglasRachford, true)),
    ];
    for (name, method) in &mut methods {
        for _ in 0..1500 {
            method.step().expect("a step");
        }
        let energy = method.energy().value;
        assert!((energy - least).abs() < 1e-7 * least, "{name}: {energy} and {least}");
    }
}

#[test]
fn the_blurred_field_is_the_convolution_at_every_step() {
    let grid = Grid { width: 9, height: 8, channels: 2 };
    let mut method = deconvolution(grid, true);
    for _ in 0..3 {
        method.step().expect("a step");
        let (x, y) = method.x().split_at(grid.len());
        for k in 0..grid.len() {
            let (i, c, j) = (k / grid.row_len(), k / grid.width % 2, k % grid.width);
            assert!((y[k] - blurred(&kernel(), grid, x, i, c, j)).abs() < 1e-12);
        }
    }
}

#[test]
fn the_bits_do_not_depend_on_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut method = deconvolution(Grid { width: 150, height: 131, channels: 2 }, false);
            for _ in 0..4 {
                method.step().expect("a step");
            }
            (method.x().to_vec(), method.energy().value)
        })
    };
    assert_eq!(run(1), run(3));
}
