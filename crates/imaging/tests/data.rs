//! Data terms and samples of a finer image, against sums written out.

use proxel_imaging::restore::{Data, Edges, Iteration, Model, duality_gap};
use proxel_imaging::{Image, Psf};
use proxel_split::Method;
use proxel_testkit::SplitMix;

const W: usize = 12;
const H: usize = 10;

fn kernel() -> Psf {
    Psf::new(3, 3, vec![0.0, 1.0, 0.0, 1.0, 4.0, 1.0, 0.0, 1.0, 0.0], None).expect("weights")
}

/// Boxes with noise, none below 0, one pixel of zero, and one far off.
fn seen() -> Vec<f64> {
    let mut random = SplitMix::new(5);
    let mut seen: Vec<f64> = (0..W * H)
        .map(|k| if (k / W / 4 + k % W / 5).is_multiple_of(2) { 0.2 } else { 0.7 } + 0.03 * random.normal())
        .map(|v: f64| v.max(0.0))
        .collect();
    (seen[17], seen[58]) = (0.0, 3.0);
    seen
}

fn run(model: &Model, iterations: usize) -> (Box<dyn Method>, proxel_imaging::restore::Field) {
    let built = model.build(None).expect("a model");
    let field = built.field.clone();
    let mut method = built.method("test", Iteration::Admm { relaxation: 1.8 }).expect("a method");
    for _ in 0..iterations {
        method.step().expect("a step");
    }
    (method, field)
}

/// The objective by its definition, periodic.
fn objective(x: &[f64], lambda: f64, of: &dyn Fn(f64, f64) -> f64) -> f64 {
    let at = |i: usize, j: usize| x[i % H * W + j % W];
    let seen = seen();
    let mut sum = 0.0;
    for i in 0..H {
        for j in 0..W {
            let blurred = 4.0 * at(i, j) + at(i + 1, j) + at(i + H - 1, j) + at(i, j + 1) + at(i, j + W - 1);
            sum += lambda * of(blurred / 8.0, seen[i * W + j]);
            sum += (at(i, j + 1) - at(i, j)).hypot(at(i + 1, j) - at(i, j));
        }
    }
    sum
}

#[test]
fn solutions_are_least_among_their_neighbours() {
    let image = Image::new(W, H, vec![seen()]).expect("an image");
    let poisson = |z: f64, f: f64| z - f + if f > 0.0 { f * (f / z).ln() } else { 0.0 };
    let huber = |z: f64, f: f64| {
        let r = (z - f).abs();
        if r <= 0.05 { r * r } else { 0.1 * r - 0.0025 }
    };
    type Case<'a> = (Data, f64, &'a dyn Fn(f64, f64) -> f64);
    let cases: [Case<'_>; 2] = [(Data::Poisson, 8.0, &poisson), (Data::Huber { delta: 0.05 }, 40.0, &huber)];
    for (data, lambda, of) in cases {
        let model = Model { data, ..Model::new(&image, kernel(), Edges::Periodic, lambda) };
        let (mut method, field) = run(&model, 6000);
        let x = field.image(method.x()).remove(0);
        let least = objective(&x, lambda, of);
        assert!((method.energy().value - least).abs() < 1e-9 * least, "{data:?}: {least}");
        let gap = duality_gap(&mut *method, &field);
        match data {
            // Its bound is one over all images.
            Data::Huber { .. } => assert!((-1e-12..1e-5).contains(&gap.expect("no hard set").relative()), "{gap:?}"),
            _ => assert!(gap.is_none()),
        }
        let mut random = SplitMix::new(9);
        for trial in 0..400 {
            let size = 10f64.powi(-(trial % 5));
            // Noise, and constants over boxes: what total variation lets move most easily.
            let step = 0.1 * size * random.normal();
            let (i0, j0) = (trial as usize * 7 % H, trial as usize * 5 % W);
            let (i1, j1) = (i0 + 1 + trial as usize % 4, j0 + 1 + trial as usize / 3 % 5);
            let moved: Vec<f64> = x
                .iter()
                .enumerate()
                .map(|(k, x)| {
                    let inside = (i0..i1).contains(&(k / W)) && (j0..j1).contains(&(k % W));
                    x + if trial % 2 == 0 { 0.1 * size * random.normal() } else { f64::from(u8::from(inside)) * step }
                })
                .collect();
            let there = objective(&moved, lambda, of);
            assert!(there.is_nan() || there >= least * (1.0 - 1e-7), "{data:?}, trial {trial}: {there} and {least}");
        }
    }
}

#[test]
fn an_outlier_moves_a_huber_fit_less_than_a_square_one() {
    let image = Image::new(W, H, vec![seen()]).expect("an image");
    let fit = |data| {
        let model = Model { data, ..Model::new(&image, Psf::identity(), Edges::Neumann, 20.0) };
        let (method, field) = run(&model, 2000);
        field.image(method.x())[0][58]
    };
    let around = seen()[59];
    let (squares, huber) = (fit(Data::Squares) - around, fit(Data::Huber { delta: 0.05 }) - around);
    assert!(squares > 1.5 && huber.abs() < 0.1, "{squares} and {huber}");
}

#[test]
fn negative_data_are_no_counts() {
    let mut seen = seen();
    seen[W + 3] = -0.25;
    let image = Image::new(W, H, vec![seen]).expect("an image");
    let model = Model { data: Data::Poisson, ..Model::new(&image, kernel(), Edges::Periodic, 8.0) };
    let refused = model.check().expect_err("negative").0;
    assert!(refused.contains("row 1, column 3") && refused.contains("-0.25"), "{refused}");
}

/// What is seen of a field: the mean of scale x scale pixels of the blurred image, row by row.
#[test]
fn samples_are_means_of_blurred_pixels() {
    let mut random = SplitMix::new(2);
    for edges in [Edges::Unknown, Edges::Periodic] {
        for scale in [1, 2, 3] {
            let image = Image::new(W, H, vec![seen(), seen()]).expect("an image");
            // Not symmetric, with its centre off the middle.
            let psf = Psf::new(3, 2, vec![0.1, 0.4, 0.3, 0.05, 0.1, 0.2], Some((0, 2))).expect("weights");
            let built = Model { scale, ..Model::new(&image, psf.clone(), edges, 1.0) }.build(None).expect("a model");
            let mut field = built.field;
            field.carries = false;
            let x: Vec<f64> = (0..field.grid.len()).map(|_| random.normal()).collect();
            let (grid, seen) = (field.grid, field.seen(&x));
            assert_eq!(field.size, (W * scale, H * scale));
            assert_eq!((seen.len(), seen[0].len()), (2, W * H));
            let blurred = |c: usize, i: usize, j: usize| -> f64 {
                let of = |k: usize| {
                    let row = (field.at.0 + i + psf.center.0 + grid.height - k / 3) % grid.height;
                    let column = (field.at.1 + j + psf.center.1 + grid.width - k % 3) % grid.width;
                    psf.weights[k] * x[(row * 2 + c) * grid.width + column]
                };
                (0..6).map(of).sum()
            };
            for c in 0..2 {
                for k in 0..W * H {
                    let (i, j) = (k / W * scale, k % W * scale);
                    let part = |a: usize| blurred(c, i + a / scale, j + a % scale) / (scale * scale) as f64;
                    let expected: f64 = (0..scale * scale).map(part).sum();
                    assert!((seen[c][k] - expected).abs() < 1e-12, "{edges:?}, {scale}, {c}, {k}");
                }
            }
        }
    }
}

#[test]
fn a_finer_image_is_found_from_its_means() {
    // A disk: total variation knows nothing of where between two pixels a straight edge lies, but round ones are shortest.
    let (fine_w, fine_h) = (2 * W, 2 * H);
    let radius = |k: usize| ((k % fine_w) as f64 - 11.3).hypot((k / fine_w) as f64 - 9.6);
    let truth: Vec<f64> = (0..fine_w * fine_h).map(|k| if radius(k) < 6.7 { 0.8 } else { 0.2 }).collect();
    let mean = |k: usize| {
        let at = k / W * 2 * fine_w + k % W * 2;
        (truth[at] + truth[at + 1] + truth[at + fine_w] + truth[at + fine_w + 1]) / 4.0
    };
    let image = Image::new(W, H, vec![(0..W * H).map(mean).collect()]).expect("an image");
    let model = Model { scale: 2, ..Model::new(&image, Psf::identity(), Edges::Unknown, 2000.0) };
    let (method, field) = run(&model, 4000);
    let found = field.image(method.x()).remove(0);
    let rms = |a: &dyn Fn(usize) -> f64| {
        ((0..truth.len()).map(|k| (a(k) - truth[k]).powi(2)).sum::<f64>() / truth.len() as f64).sqrt()
    };
    let repeated = |k: usize| image.channels[0][k / fine_w / 2 * W + k % fine_w / 2];
    assert!(rms(&|k| found[k]) < 0.7 * rms(&repeated), "{} and {}", rms(&|k| found[k]), rms(&repeated));
}
