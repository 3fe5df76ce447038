//! Bounds on how far an image is from the best, against the best.

use proxel_imaging::restore::{Data, Edges, Form, Iteration, Model, duality_gap};
use proxel_imaging::{Fourier, Grid, Image, Norm, Psf, convolve};
use proxel_testkit::SplitMix;

/// Edges, a ramp and what looks like noise, of so many channels.
fn image(w: usize, h: usize, channels: usize) -> Image {
    let value = |c: usize, k: usize| {
        let (i, j) = (k / w, k % w);
        let square = if (6..15).contains(&i) && (4 + c..13).contains(&j) { 0.4 } else { 0.0 };
        0.2 + square + 0.01 * j as f64 + 0.03 * ((k * 7919 + c * 31) as f64).sin()
    };
    Image::new(w, h, (0..channels).map(|c| (0..w * h).map(|k| value(c, k)).collect()).collect()).expect("an image")
}

fn blur() -> Psf {
    Psf::new(4, 3, vec![1.0, 2.0, 0.0, 1.0, 3.0, 4.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0], None).expect("a kernel")
}

fn round() -> Psf {
    Psf::new(3, 3, vec![1.0, 2.0, 1.0, 2.0, 5.0, 2.0, 1.0, 2.0, 1.0], None).expect("a kernel")
}

/// Name and model.
fn models() -> Vec<(&'static str, Model)> {
    let one = image(22, 20, 1);
    let mut all = vec![
        ("periodic", Model::new(&one, blur(), Edges::Periodic, 40.0)),
        ("neumann", Model::new(&one, round(), Edges::Neumann, 40.0)),
        ("unknown", Model::new(&one, round(), Edges::Unknown, 40.0)),
        ("unknown, uneven", Model::new(&one, blur(), Edges::Unknown, 40.0)),
        ("unknown, three", Model::new(&image(22, 20, 3), blur(), Edges::Unknown, 40.0)),
        ("denoise", Model::new(&one, Psf::identity(), Edges::Neumann, 20.0)),
    ];
    let mut split = Model::new(&one, blur(), Edges::Periodic, 40.0);
    split.form = Form::Split;
    all.push(("split", split));
    let mut gaps = Model::new(&one, Psf::identity(), Edges::Neumann, 20.0);
    gaps.mask = Some((0..440).map(|k| if k % 7 < 2 { 0.0 } else { 1.0 }).collect());
    all.push(("gaps", gaps));
    let mut huber = Model::new(&one, Psf::identity(), Edges::Neumann, 20.0);
    huber.data = Data::Huber { delta: 0.03 };
    all.push(("huber", huber));
    let mut outliers = Model::new(&one, blur(), Edges::Unknown, 20.0);
    outliers.data = Data::Huber { delta: 0.03 };
    outliers.norm = Norm::Differences;
    all.push(("huber, unknown", outliers));
    for (name, norm) in
        [("vectorial", Norm::Vectorial), ("channels", Norm::Channels), ("anisotropic", Norm::Differences)]
    {
        let mut model = Model::new(&image(22, 20, 3), blur(), Edges::Periodic, 40.0);
        model.norm = norm;
        all.push((name, model));
    }
    all
}

/// The objective as low as it came in so many iterations, and gaps on the way: (iteration, objective, gap, over all images).
fn run(model: &Model, iterations: usize) -> (f64, Vec<(usize, f64, f64, bool)>) {
    let built = model.build(None).expect("a problem");
    let field = built.field.clone();
    let mut method = built.method("x", Iteration::Admm { relaxation: 1.8 }).expect("a method");
    let (mut best, mut gaps) = (f64::INFINITY, Vec::new());
    for k in 1..=iterations {
        method.step().expect("a step");
        best = best.min(method.energy().value);
        if [3, 10, 30, 100, 300, iterations].contains(&k) {
            let gap = duality_gap(method.as_mut(), &field).expect("no hard sets");
            gaps.push((k, gap.objective, gap.gap, gap.range.is_none()));
        }
    }
    (best, gaps)
}

#[test]
fn no_gap_is_smaller_than_what_is_missing() {
    for (name, model) in models() {
        let (best, gaps) = run(&model, 3000);
        for (k, objective, gap, _) in &gaps {
            let missing = objective - best;
            assert!(*gap >= missing - 1e-10 * best, "{name}, iteration {k}: {gap} for at least {missing}");
        }
        let (_, objective, gap, _) = gaps[gaps.len() - 1];
        assert!(gap < 1e-5 * objective, "{name}: {gap} of {objective}");
    }
}

/// The bound over all images is that of a dual point: it holds for images far outside the range of what was seen, where the
/// one within a range says nothing.
#[test]
fn where_data_and_gradient_are_all_no_range_is_needed() {
    let whole = |model: &Model| model.edges != Edges::Unknown && model.mask.is_none();
    for (name, model) in models().into_iter().filter(|(_, model)| whole(model)) {
        let (_, gaps) = run(&model, 300);
        assert!(gaps.iter().any(|(.., all)| *all), "{name}: {gaps:?}");
    }
}

/// Nothing of the field that was made larger is left in what is minimised: sums over what was seen and over the pixels that it
/// depends on, written out.
#[test]
fn an_unknown_border_is_one_that_nothing_lies_beyond() {
    for (channels, lambda) in [(1, 40.0), (3, 7.0)] {
        let (psf, seen) = (blur(), image(22, 20, channels));
        let model = Model::new(&seen, psf.clone(), Edges::Unknown, lambda);
        let built = model.build(None).expect("a problem");
        let field = built.field.clone();
        let mut method = built.method("x", Iteration::Admm { relaxation: 1.8 }).expect("a method");
        for _ in 0..17 {
            method.step().expect("a step");
        }
        let (w, h) = (22 + psf.width - 1, 20 + psf.height - 1);
        assert!(field.grid.width > w && field.grid.height > h);
        let x = |i: usize, c: usize, j: usize| method.x()[(i * channels + c) * field.grid.width + j];
        let mut want = 0.0;
        for (i, j) in (0..20).flat_map(|i| (0..22).map(move |j| (i, j))) {
            for c in 0..channels {
                // Weight (a, b) of the function takes the pixel that lies as far on the other side of its centre.
                let taps = (0..psf.height).flat_map(|a| (0..psf.width).map(move |b| (a, b)));
                let at = |a: usize, b: usize| x(i + psf.height - 1 - a, c, j + psf.width - 1 - b);
                let y: f64 = taps.map(|(a, b)| psf.weights[a * psf.width + b] * at(a, b)).sum();
                want += lambda * (y - seen.channels[c][i * 22 + j]).powi(2);
            }
        }
        for (i, j) in (0..h - 1).flat_map(|i| (0..w - 1).map(move |j| (i, j))) {
            let square = |c: usize| (x(i, c, j + 1) - x(i, c, j)).powi(2) + (x(i + 1, c, j) - x(i, c, j)).powi(2);
            want += (0..channels).map(square).sum::<f64>().sqrt();
        }
        let got = method.energy().value;
        assert!((got - want).abs() < 1e-10 * want, "{got} and {want}");
    }
}

/// Counts, of a picture with edges, a ramp and texture: blurred, noisy, nothing known beyond its border.
#[test]
fn an_unknown_border_takes_few_hundred_iterations() {
    let (psf, n) = (Psf::gaussian(1.6).expect("a kernel"), 110);
    let fourier = Fourier::new(n, n);
    let truth = image(n, n, 1);
    let disk = |k: usize| f64::from(u8::from((k / n).abs_diff(60).pow(2) + (k % n).abs_diff(50).pow(2) < 700));
    let sharp: Vec<f64> = (0..n * n).map(|k| truth.channels[0][k] + 0.3 * disk(k)).collect();
    let mut blurred = vec![0.0; n * n];
    convolve(Grid::new(n, n), &fourier, &psf.spectrum(&fourier), false, &sharp, &mut blurred);
    let mut random = SplitMix::new(5);
    let seen: Vec<f64> = blurred.iter().map(|v| v + 0.01 * random.normal()).collect();
    // Cut off where it wraps around.
    let inner = (8..n - 8).flat_map(|i| seen[i * n + 8..(i + 1) * n - 8].to_vec()).collect();
    let seen = Image::new(n - 16, n - 16, vec![inner]).expect("an image");
    for (lambda, most) in [(100.0, 600), (400.0, 400), (1600.0, 400)] {
        let built = Model::new(&seen, psf.clone(), Edges::Unknown, lambda).build(None).expect("a problem");
        let field = built.field.clone();
        let mut method = built.method("x", Iteration::Admm { relaxation: 1.8 }).expect("a method");
        let mut k = 0;
        loop {
            for _ in 0..20 {
                method.step().expect("a step");
            }
            k += 20;
            let gap = duality_gap(method.as_mut(), &field).expect("no hard sets");
            if gap.relative() <= 1e-4 {
                break;
            }
            assert!(k < most, "lambda {lambda}: {} after {k}", gap.relative());
        }
    }
}

/// Another method for images without a blur: projected gradients on the dual (Chambolle 2004), written out here.
#[test]
fn denoising_has_the_optimum_of_another_method() {
    let model = Model::new(&image(22, 20, 1), Psf::identity(), Edges::Neumann, 20.0);
    let (best, gaps) = run(&model, 3000);
    let (w, h, f) = (22, 20, &model.channels[0]);
    // x = f - D^T q / (2 lambda), q <- P(q + 2 lambda D x / 8), |D|^2 <= 8; the dual is lambda (|f|^2 - |x|^2).
    let (mut along, mut down) = (vec![0.0; w * h], vec![0.0; w * h]);
    let lambda = 20.0;
    let image_of = |along: &[f64], down: &[f64]| -> Vec<f64> {
        (0..w * h)
            .map(|k| {
                let (i, j) = (k / w, k % w);
                let mut adjoint = -along[k] - down[k];
                adjoint += if j > 0 { along[k - 1] } else { 0.0 } + if i > 0 { down[k - w] } else { 0.0 };
                f[k] - adjoint / (2.0 * lambda)
            })
            .collect()
    };
    for _ in 0..40_000 {
        let x = image_of(&along, &down);
        for k in 0..w * h {
            let (i, j) = (k / w, k % w);
            let a = along[k] + 2.0 * lambda / 8.0 * if j + 1 < w { x[k + 1] - x[k] } else { 0.0 };
            let d = down[k] + 2.0 * lambda / 8.0 * if i + 1 < h { x[k + w] - x[k] } else { 0.0 };
            let r = a.hypot(d).max(1.0);
            (along[k], down[k]) = (a / r, d / r);
        }
    }
    let x = image_of(&along, &down);
    let dual: f64 = lambda * f.iter().map(|f| f * f).sum::<f64>() - lambda * x.iter().map(|x| x * x).sum::<f64>();
    let (_, objective, gap, _) = gaps[gaps.len() - 1];
    assert!(dual <= best * (1.0 + 1e-12), "{dual} above {best}");
    assert!(best - dual < 1e-5 * best, "{dual} and {best}");
    let bound = objective - gap;
    assert!(bound <= best * (1.0 + 1e-12) && bound >= dual - 1e-5 * best, "{bound}, {dual} and {best}");
}
