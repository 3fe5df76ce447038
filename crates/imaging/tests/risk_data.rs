//! lambda for data that are no squares, against the best one by the truth.

use proxel_imaging::restore::{
    Data, Edges, Iteration, Model, RiskSettings, choose_lambda, count_level, noise_level, psnr,
};
use proxel_imaging::{Image, Psf};
use proxel_testkit::SplitMix;

const SIDE: usize = 84;

/// Boxes, a disc on a ramp, waves: values from 0.05 to 0.95.
fn picture(which: usize, i: f64, j: f64) -> f64 {
    match which {
        0 => [0.15, 0.85, 0.4][(i / 19.0) as usize % 3 * usize::from(((j / 23.0) as usize).is_multiple_of(2))],
        1 if (i - 45.0).hypot(j - 40.0) < 22.0 => 0.9,
        1 => 0.1 + 0.005 * j,
        _ => 0.5 + 0.25 * (0.23 * i + 0.11 * j).sin() + 0.15 * (0.6 * j).cos(),
    }
}

/// Truth, and what is seen through the blur without noise.
fn scene(which: usize, psf: &Psf) -> (Vec<f64>, Vec<f64>) {
    let at = |k: usize, a: usize, b: usize| {
        let (i, j) = (k / SIDE + psf.center.0 + 10 - a, k % SIDE + psf.center.1 + 10 - b);
        picture(which, i as f64, j as f64)
    };
    let taps =
        |k: usize| (0..psf.weights.len()).map(|t| psf.weights[t] * at(k, t / psf.width, t % psf.width)).sum::<f64>();
    let truth = (0..SIDE * SIDE).map(|k| at(k, psf.center.0, psf.center.1)).collect();
    (truth, (0..SIDE * SIDE).map(taps).collect())
}

fn reached(model: &Model, truth: &[f64]) -> f64 {
    let built = model.build(None).unwrap();
    let field = built.field.clone();
    let mut method = built.method("test", Iteration::Admm { relaxation: 1.8 }).unwrap();
    for _ in 0..250 {
        method.step().unwrap();
    }
    psnr(&field.image(method.x()), &[truth.to_vec()])
}

/// By how much the best of lambda / 8 to 8 lambda, in factors of 2, is ahead of the lambda found, in dB.
fn behind(model: &Model, noise: f64, truth: &[f64]) -> f64 {
    let risks = choose_lambda(model, noise, &RiskSettings::default(), &mut || false).unwrap();
    let found = risks.last().unwrap().lambda;
    let of = |k: i32| reached(&Model { lambda: found * 2f64.powi(k), ..model.clone() }, truth);
    let best = (-3..=3).map(of).fold(f64::NEG_INFINITY, f64::max);
    println!("lambda {found:.1}: {:.2} dB, best {best:.2}", of(0));
    best - of(0)
}

/// A count of mean m, by the product of uniform numbers; by a normal number from 200 on.
fn count(random: &mut SplitMix, m: f64) -> f64 {
    if m > 200.0 {
        return (m + m.sqrt() * random.normal()).round();
    }
    let (limit, mut product, mut k) = ((-m).exp(), random.uniform(0.0, 1.0), 0.0);
    while product > limit {
        product *= random.uniform(0.0, 1.0);
        k += 1.0;
    }
    k
}

#[test]
fn counts_of_light() {
    for (which, most, psf) in
        [(0, 40.0, Psf::gaussian(1.2)), (1, 120.0, Ok(Psf::identity())), (2, 400.0, Psf::disk(1.5))]
    {
        let psf = psf.unwrap();
        let (truth, blurred) = scene(which, &psf);
        let mut random = SplitMix::new(3);
        let plane: Vec<f64> = blurred.iter().map(|v| count(&mut random, v * most) / most).collect();
        let noise = count_level(SIDE, SIDE, std::slice::from_ref(&plane)).unwrap();
        assert!((noise * most.sqrt() - 1.0).abs() < 0.1, "{which}: {noise} for {}", 1.0 / most.sqrt());
        let edges = if psf.weights.len() > 1 { Edges::Unknown } else { Edges::Neumann };
        let image = Image::new(SIDE, SIDE, vec![plane]).unwrap();
        let model = Model { data: Data::Poisson, ..Model::new(&image, psf, edges, 1.0) };
        let off = behind(&model, noise, &truth);
        assert!(off < 0.5, "{which}: {off} dB behind");
    }
}

#[test]
fn outliers() {
    for (which, part, psf) in [(0, 0.03, Psf::gaussian(1.2)), (1, 0.1, Ok(Psf::identity())), (2, 0.05, Psf::disk(1.5))]
    {
        let psf = psf.unwrap();
        let (truth, blurred) = scene(which, &psf);
        let mut random = SplitMix::new(5);
        let mut plane: Vec<f64> = blurred.iter().map(|v| v + 0.02 * random.normal()).collect();
        for v in &mut plane {
            if random.uniform(0.0, 1.0) < part {
                *v = f64::from(u8::from(random.uniform(0.0, 1.0) < 0.5));
            }
        }
        let noise = noise_level(SIDE, SIDE, std::slice::from_ref(&plane)).unwrap();
        let edges = if psf.weights.len() > 1 { Edges::Unknown } else { Edges::Neumann };
        let image = Image::new(SIDE, SIDE, vec![plane]).unwrap();
        let model = Model { data: Data::Huber { delta: 1.345 * noise }, ..Model::new(&image, psf, edges, 1.0) };
        let off = behind(&model, noise, &truth);
        assert!(off < 0.5, "{which}: {off} dB behind, noise {noise}");
    }
}
