//! Total generalised variation: the step, the certificate, and what it does that total variation does not.

use proxel_imaging::restore::{Data, Edges, Form, Iteration, Model, Regulariser, duality_gap};
use proxel_imaging::{Image, Norm, Psf};
use proxel_testkit::SplitMix;

const W: usize = 18;
const H: usize = 15;
const TGV: Regulariser = Regulariser::Tgv { ratio: 2.0 };

fn kernel() -> Psf {
    Psf::new(3, 2, vec![0.1, 0.4, 0.3, 0.05, 0.1, 0.2], None).expect("positive weights")
}

/// A ramp with a box on it, and noise.
fn seen(noise: f64) -> Image {
    let mut random = SplitMix::new(4);
    let of = |k: usize| {
        let (i, j) = (k / W, k % W);
        0.02 * j as f64 + 0.01 * i as f64 + if (5..10).contains(&i) && (6..13).contains(&j) { 0.4 } else { 0.0 }
    };
    let plane = (0..W * H).map(|k| of(k) + noise * random.normal()).collect();
    Image::new(W, H, vec![plane]).expect("an image")
}

fn run(model: &Model, iterations: usize) -> (Vec<f64>, f64, Option<f64>, Vec<f64>) {
    let built = model.build(None).expect("a model");
    let field = built.field.clone();
    let mut method = built.method("test", Iteration::Admm { relaxation: 1.8 }).expect("a method");
    for _ in 0..iterations {
        method.step().expect("a step");
    }
    let gap = duality_gap(&mut *method, &field).map(|gap| gap.relative());
    (field.image(method.x()).remove(0), method.energy().value, gap, method.x().to_vec())
}

/// The objective at (x, w), periodic, by its definition.
fn objective(seen: &[f64], lambda: f64, ratio: f64, x: &[f64], w: &[f64]) -> f64 {
    let (psf, at) = (kernel(), |i: usize, j: usize| i % H * W + j % W);
    let slope = |i: usize, k: usize, j: usize| w[(i % H * 2 + k) * W + j % W];
    let mut sum = 0.0;
    for i in 0..H {
        for j in 0..W {
            let of = |k: usize| psf.weights[k] * x[at(i + H + psf.center.0 - k / 3, j + W + psf.center.1 - k % 3)];
            sum += lambda * ((0..6).map(of).sum::<f64>() - seen[at(i, j)]).powi(2);
            let here = x[at(i, j)];
            sum += (x[at(i, j + 1)] - here - slope(i, 0, j)).hypot(x[at(i + 1, j)] - here - slope(i, 1, j));
            let e11 = slope(i, 0, j) - slope(i, 0, j + W - 1);
            let e22 = slope(i, 1, j) - slope(i + H - 1, 1, j);
            let e12 = slope(i, 0, j) - slope(i + H - 1, 0, j) + slope(i, 1, j) - slope(i, 1, j + W - 1);
            sum += ratio * (e11 * e11 + e22 * e22 + 0.5 * e12 * e12).sqrt();
        }
    }
    sum
}

#[test]
fn solutions_have_the_objective_of_the_definition_and_a_small_gap() {
    let (image, lambda) = (seen(0.03), 60.0);
    let model = Model { regulariser: TGV, ..Model::new(&image, kernel(), Edges::Periodic, lambda) };
    let mut values = Vec::new();
    for form in [Form::Held, Form::Split] {
        let (x, energy, gap, nodes) = run(&Model { form, ..model.clone() }, 6000);
        let w = &nodes[nodes.len() - 2 * W * H..];
        let direct = objective(&image.channels[0], lambda, 2.0, &x, w);
        assert!((energy - direct).abs() < 1e-10 * direct, "{form:?}: {energy} and {direct}");
        let gap = gap.expect("no hard set");
        assert!((-1e-12..1e-4).contains(&gap), "{form:?}: {gap}");
        values.push(energy);
        let mut random = SplitMix::new(7);
        for trial in 0..200 {
            let size = 0.03 * 10f64.powi(-(trial % 4));
            let moved = |v: &[f64], size: f64, random: &mut SplitMix| -> Vec<f64> {
                v.iter().map(|v| v + size * random.normal()).collect()
            };
            let x = if trial % 3 == 0 { x.clone() } else { moved(&x, size, &mut random) };
            let w = if trial % 3 == 1 { w.to_vec() } else { moved(w, size, &mut random) };
            let there = objective(&image.channels[0], lambda, 2.0, &x, &w);
            assert!(there >= energy * (1.0 - 1e-6), "{form:?}, trial {trial}: {there} and {energy}");
        }
    }
    assert!((values[0] - values[1]).abs() < 1e-5 * values[0], "{values:?}");
}

/// Where bends cost more than any slope saves, slopes are constant, so 0 on what wraps around but for a constant: total
/// variation of x minus a plane that does not wrap; on an image without a mean slope, total variation itself.
#[test]
fn bends_that_cost_everything_leave_total_variation() {
    let flat = |k: usize| if (5..10).contains(&(k / W)) && (6..13).contains(&(k % W)) { 0.7 } else { 0.3 };
    let image = Image::new(W, H, vec![(0..W * H).map(flat).collect()]).expect("an image");
    let model = Model::new(&image, kernel(), Edges::Periodic, 30.0);
    let (tv, energy, ..) = run(&model, 4000);
    let dear = Model { regulariser: Regulariser::Tgv { ratio: 1e3 }, ..model };
    let (tgv, value, ..) = run(&dear, 6000);
    assert!((energy - value).abs() < 1e-4 * energy, "{energy} and {value}");
    assert!(tv.iter().zip(&tgv).all(|(a, b)| (a - b).abs() < 2e-3));
}

#[test]
fn ramps_are_no_stairs() {
    let (truth, image) = (seen(0.0), seen(0.04));
    let error = |regulariser, lambda| {
        let model = Model { regulariser, ..Model::new(&image, Psf::identity(), Edges::Unknown, lambda) };
        let (x, ..) = run(&model, 1500);
        (x.iter().zip(&truth.channels[0]).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / x.len() as f64).sqrt()
    };
    let best =
        |regulariser| [5.0, 8.0, 12.0, 18.0, 27.0].map(|l| error(regulariser, l)).into_iter().fold(1.0, f64::min);
    let (tv, tgv) = (best(Regulariser::Tv), best(TGV));
    assert!(tgv < 0.85 * tv, "{tgv} and {tv}");
}

#[test]
fn colours_masks_and_other_data_go_with_it() {
    let image = seen(0.03);
    let image = Image::new(W, H, vec![image.channels[0].clone(), image.channels[0].iter().map(|v| 1.0 - v).collect()])
        .expect("an image");
    let mask = Some((0..W * H).map(|k| f64::from(u8::from(k % 5 > 0))).collect());
    for norm in [Norm::Vectorial, Norm::Channels, Norm::Differences] {
        for data in [Data::Squares, Data::Huber { delta: 0.05 }] {
            let model = Model {
                regulariser: TGV,
                norm,
                data,
                mask: mask.clone(),
                ..Model::new(&image, kernel(), Edges::Unknown, 40.0)
            };
            let (.., gap, _) = run(&model, 4000);
            let gap = gap.expect("no hard set");
            assert!((-1e-12..2e-3).contains(&gap), "{norm:?}, {data:?}: {gap}");
        }
    }
    let mirrored = Model { regulariser: TGV, ..Model::new(&image, Psf::identity(), Edges::Neumann, 40.0) };
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
            let model = Model { regulariser: TGV, ..Model::new(&image, kernel(), Edges::Unknown, 5.0) };
            run(&model, 4)
        })
    };
    assert_eq!(run(1), run(3));
}
