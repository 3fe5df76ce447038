//! Local cosines: the objective, its least point, and fine texture.

use proxel_imaging::restore::{Data, Edges, Form, Iteration, Model, Regulariser, duality_gap, psnr};
use proxel_imaging::{Image, Norm, Psf};
use proxel_testkit::SplitMix;
use std::f64::consts::PI;

const W: usize = 18;
const H: usize = 15;

fn kernel() -> Psf {
    Psf::new(3, 2, vec![0.1, 0.4, 0.3, 0.05, 0.1, 0.2], None).expect("positive weights")
}

fn seen() -> Image {
    let mut random = SplitMix::new(4);
    let of = |k: usize| {
        let (i, j) = (k / W, k % W);
        0.4 + 0.2 * (0.9 * i as f64).sin() + if (6..13).contains(&j) { 0.3 } else { 0.0 }
    };
    let plane = (0..W * H).map(|k| of(k) + 0.02 * random.normal()).collect();
    Image::new(W, H, vec![plane]).expect("an image")
}

fn run(model: &Model, iterations: usize) -> (Vec<f64>, f64, Option<f64>) {
    let built = model.build(None).expect("a model");
    let field = built.field.clone();
    let mut method = built.method("test", Iteration::Admm { relaxation: 1.8 }).expect("a method");
    for _ in 0..iterations {
        method.step().expect("a step");
    }
    let gap = duality_gap(&mut *method, &field).map(|gap| gap.relative());
    (field.image(method.x()).remove(0), method.energy().value, gap)
}

/// The objective at x, periodic, by its definition.
fn objective(seen: &[f64], lambda: f64, x: &[f64]) -> f64 {
    let (psf, at) = (kernel(), |i: usize, j: usize| i % H * W + j % W);
    let c = |k: usize, a: usize| {
        (if k == 0 { 0.5 } else { 0.5f64.sqrt() }) * (PI * k as f64 * (a as f64 + 0.5) / 4.0).cos()
    };
    let mut sum = 0.0;
    for i in 0..H {
        for j in 0..W {
            let of = |k: usize| psf.weights[k] * x[at(i + H + psf.center.0 - k / 3, j + W + psf.center.1 - k % 3)];
            sum += lambda * ((0..6).map(of).sum::<f64>() - seen[at(i, j)]).powi(2);
            for kl in 1..16 {
                let (k, l) = (kl / 4, kl % 4);
                let part = |ab: usize| c(k, ab / 4) * c(l, ab % 4) * x[at(i + ab / 4, j + ab % 4)];
                sum += ((0..16).map(part).sum::<f64>() / 4.0).abs() / ((k * k + l * l) as f64).sqrt();
            }
        }
    }
    sum
}

#[test]
fn solutions_have_the_objective_of_the_definition_and_none_near_them_has_less() {
    let (image, lambda) = (seen(), 60.0);
    let model = Model { regulariser: Regulariser::Frame, ..Model::new(&image, kernel(), Edges::Periodic, lambda) };
    let mut values = Vec::new();
    for form in [Form::Held, Form::Split] {
        let (x, energy, gap) = run(&Model { form, ..model.clone() }, 3000);
        let direct = objective(&image.channels[0], lambda, &x);
        assert!((energy - direct).abs() < 1e-10 * direct, "{form:?}: {energy} and {direct}");
        let gap = gap.expect("no hard set");
        assert!((-1e-12..1e-4).contains(&gap), "{form:?}: {gap}");
        values.push(energy);
        let mut random = SplitMix::new(7);
        for trial in 0..200 {
            let size = 0.03 * 10f64.powi(-(trial % 4));
            let moved: Vec<f64> = x.iter().map(|v| v + size * random.normal()).collect();
            let there = objective(&image.channels[0], lambda, &moved);
            assert!(there >= energy * (1.0 - 1e-6), "{form:?}, trial {trial}: {there} and {energy}");
        }
    }
    assert!((values[0] - values[1]).abs() < 1e-5 * values[0], "{values:?}");
}

/// Waves three to five pixels long, which a blur has left little of: total variation takes them for noise.
#[test]
fn fine_texture_stays() {
    const SIDE: usize = 72;
    let mut random = SplitMix::new(9);
    let wave = |k: usize| {
        let (i, j) = ((k / SIDE) as f64, (k % SIDE) as f64);
        0.5 + 0.15 * (1.4 * i + 0.5 * j).sin() + 0.1 * (1.7 * j).sin()
    };
    let psf = Psf::gaussian(1.0).expect("a blur");
    let (r, n) = (psf.center.0, SIDE - 2 * psf.center.0);
    let blurred = |k: usize| {
        let (i, j) = (k / n, k % n);
        let of = |t: usize| psf.weights[t] * wave((i + t / psf.width) * SIDE + j + t % psf.width);
        (0..psf.weights.len()).map(of).sum::<f64>()
    };
    let truth = vec![(0..n * n).map(|k| wave((k / n + r) * SIDE + k % n + r)).collect()];
    let plane = (0..n * n).map(|k| blurred(k) + 0.02 * random.normal()).collect();
    let image = Image::new(n, n, vec![plane]).expect("an image");
    let best = |regulariser| {
        let of = |lambda| {
            let model = Model { regulariser, ..Model::new(&image, psf.clone(), Edges::Unknown, lambda) };
            psnr(&[run(&model, 300).0], &truth)
        };
        [25.0, 50.0, 100.0, 200.0, 400.0, 800.0].map(of).into_iter().fold(0.0, f64::max)
    };
    let (tv, frame) = (best(Regulariser::Tv), best(Regulariser::Frame));
    assert!(frame > tv + 0.5, "{frame} and {tv}");
}

#[test]
fn colours_masks_and_other_data_go_with_it() {
    let image = seen();
    let image = Image::new(W, H, vec![image.channels[0].clone(), image.channels[0].iter().map(|v| 1.0 - v).collect()])
        .expect("an image");
    let mask = Some((0..W * H).map(|k| f64::from(u8::from(k % 5 > 0))).collect());
    for norm in [Norm::Vectorial, Norm::Channels] {
        for data in [Data::Squares, Data::Huber { delta: 0.05 }] {
            let model = Model {
                regulariser: Regulariser::Frame,
                norm,
                data,
                mask: mask.clone(),
                ..Model::new(&image, kernel(), Edges::Unknown, 40.0)
            };
            let (.., gap) = run(&model, 3000);
            let gap = gap.expect("no hard set");
            assert!((-1e-12..2e-3).contains(&gap), "{norm:?}, {data:?}: {gap}");
        }
    }
    let mirrored =
        Model { regulariser: Regulariser::Frame, ..Model::new(&image, Psf::identity(), Edges::Neumann, 40.0) };
    assert!(mirrored.check().expect_err("no transform").0.contains("--boundary unknown"));
}

#[test]
fn the_bits_do_not_depend_on_threads() {
    let mut random = SplitMix::new(1);
    let planes = (0..2).map(|_| (0..151 * 133).map(|_| random.normal()).collect()).collect();
    let image = Image::new(151, 133, planes).expect("an image");
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let model = Model { regulariser: Regulariser::Frame, ..Model::new(&image, kernel(), Edges::Unknown, 5.0) };
            run(&model, 4)
        })
    };
    assert_eq!(run(1), run(3));
}
