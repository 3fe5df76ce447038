//! Borders that mirror, against sums over mirrored neighbours and against a mirrored image that wraps around.

use proxel_imaging::restore::{Data, Edges, Form, Iteration, Model, duality_gap};
use proxel_imaging::{Blur, Boundary, Grid, Image, Norm, Psf};
use proxel_testkit::SplitMix;

fn numbers(n: usize, seed: u64) -> Vec<f64> {
    let mut random = SplitMix::new(seed);
    (0..n).map(|_| random.normal()).collect()
}

/// 3 rows, 5 columns, symmetric in both directions, not square.
fn kernel() -> Psf {
    let of = |k: usize| [[1.0, 2.0, 4.0, 2.0, 1.0], [0.5, 3.0, 9.0, 3.0, 0.5], [1.0, 2.0, 4.0, 2.0, 1.0]][k / 5][k % 5];
    Psf::new(5, 3, (0..15).map(of).collect(), None).expect("positive weights")
}

/// Where index k stands in a row of n that is mirrored at its ends, which count twice.
fn mirrored(k: isize, n: usize) -> usize {
    let k = k.rem_euclid(2 * n as isize) as usize;
    if k < n { k } else { 2 * n - 1 - k }
}

#[test]
fn convolutions_are_sums_over_mirrored_neighbours() {
    for (width, height, channels) in [(12, 9, 1), (13, 16, 3), (1, 5, 1), (6, 1, 2), (1, 1, 1), (2, 3, 1), (37, 33, 1)]
    {
        let (grid, psf) = (Grid { width, height, channels }, kernel());
        let blur = Blur::new(width, height, &psf, Boundary::Neumann).expect("symmetric");
        let (x, y) = (numbers(grid.len(), 1), numbers(grid.len(), 2));
        let (mut forth, mut back) = (vec![0.0; grid.len()], vec![0.0; grid.len()]);
        blur.apply(grid, false, &x, &mut forth);
        blur.apply(grid, true, &y, &mut back);
        for (k, got) in forth.iter().enumerate() {
            let (i, c, j) = (k / (width * channels), k / width % channels, k % width);
            let mut expected = 0.0;
            for (a, weight) in psf.weights.iter().enumerate() {
                let row = mirrored(i as isize + 1 - (a / 5) as isize, height);
                let column = mirrored(j as isize + 2 - (a % 5) as isize, width);
                expected += weight * x[(row * channels + c) * width + column];
            }
            assert!((got - expected).abs() < 1e-12, "{grid:?} {k}: {got} and {expected}");
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        assert!((dot(&forth, &y) - dot(&x, &back)).abs() < 1e-11, "{grid:?}: not the transpose");
    }
}

#[test]
fn blurs_that_cosines_do_not_make_diagonal_are_refused() {
    let skew = Psf::new(3, 3, vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], None).expect("weights");
    let refused = Blur::new(9, 9, &skew, Boundary::Neumann).err().expect("not symmetric").0;
    assert!(refused.contains("--boundary unknown"), "{refused}");
    let image = Image::new(9, 9, vec![vec![0.5; 81]]).expect("an image");
    assert!(Model::new(&image, skew, Edges::Neumann, 1.0).build(None).is_err());
}

fn solved(model: &Model, iterations: usize) -> (Vec<Vec<f64>>, f64, f64) {
    let built = model.build(None).expect("a model");
    let field = built.field.clone();
    let mut method = built.method("test", Iteration::Admm { relaxation: 1.8 }).expect("a method");
    for _ in 0..iterations {
        method.step().expect("a step");
    }
    let gap = duality_gap(&mut *method, &field).expect("no hard sets").relative();
    (field.image(method.x()), method.energy().value, gap)
}

/// Each difference by itself, a mirrored image of twice the size that wraps around has each pixel four times, and each of its
/// differences; those across the border are 0. So it has the same solution, and four times the objective.
#[test]
fn the_solution_is_that_of_the_mirrored_image_that_wraps_around() {
    let (w, h) = (14, 11);
    let seen: Vec<f64> =
        (0..w * h).map(|k| f64::from(u8::from((k / w) / 4 + (k % w) / 5 == 1)) + 0.05 * (k % 7) as f64).collect();
    let twice: Vec<f64> = (0..4 * w * h)
        .map(|k| seen[mirrored((k / (2 * w)) as isize, h) * w + mirrored((k % (2 * w)) as isize, w)])
        .collect();
    let model = |width, height, plane: &Vec<f64>, edges| {
        let image = Image::new(width, height, vec![plane.clone()]).expect("an image");
        Model { norm: Norm::Differences, penalty: Some(10.0), ..Model::new(&image, kernel(), edges, 60.0) }
    };
    let (large, value, _) = solved(&model(2 * w, 2 * h, &twice, Edges::Periodic), 3000);
    let here = model(w, h, &seen, Edges::Neumann);
    for form in [Form::Held, Form::Split] {
        let (small, energy, gap) = solved(&Model { form, data_penalty: Some(10.0), ..here.clone() }, 3000);
        assert!((4.0 * energy - value).abs() < 1e-6 * value, "{form:?}: {energy} and {value}");
        assert!((-1e-12..1e-4).contains(&gap), "{form:?}: {gap}");
        for k in 0..w * h {
            let (got, expected) = (small[0][k], large[0][k / w * 2 * w + k % w]);
            assert!((got - expected).abs() < 1e-4, "{form:?}, pixel {k}: {got} and {expected}");
        }
    }
}

#[test]
fn the_bits_do_not_depend_on_threads() {
    let (w, h) = (151, 133);
    let image = Image::new(w, h, vec![numbers(w * h, 3), numbers(w * h, 4)]).expect("an image");
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            [Data::Squares, Data::Huber { delta: 0.2 }].map(|data| {
                let model = Model { data, ..Model::new(&image, kernel(), Edges::Neumann, 5.0) };
                solved(&model, 4)
            })
        })
    };
    assert_eq!(run(1), run(3));
}
