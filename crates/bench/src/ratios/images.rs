//! An iteration of images against its transforms, Anderson against passes over its history, two threads against one.

use super::{Row, Samples, Threshold};
use crate::BenchError;
use crate::parts::pool;
use proxel::imaging::restore::{Edges, Iteration, Model};
use proxel::imaging::wavefront::{Consistency, CosineLaplacian, Linearised, Solver};
use proxel::imaging::{Column, Complex, Fourier, Image, Layout, Psf, Spectra};
use proxel::split::{Anderson, Method, vector};
use rayon::ThreadPool;
use std::hint::black_box;

/// lambda_1 and rho of the problem whose iterations other implementations have counted.
pub(super) const LAMBDA: f64 = 400.0;
pub(super) const RHO: f64 = 20.0;
/// Side of the blur.
const BLUR: usize = 15;
/// Columns of Anderson's history.
const WINDOW: usize = 6;
/// Iterations before the first that is timed.
const BEFORE: usize = 3;

/// Squares, slopes and waves, with what looks like noise: an iteration takes the same time for any image.
fn image(n: usize) -> Result<Image, BenchError> {
    let value = |k: usize| {
        let (i, j) = (k / n, k % n);
        let square = if (i / 37 + j / 23).is_multiple_of(2) { 0.2 } else { -0.2 };
        0.5 + square + 0.1 * (i as f64 / 9.0).sin() + 0.01 * ((k * 7919 % 10_007) as f64 / 5003.5 - 1.0)
    };
    Image::new(n, n, vec![(0..n * n).map(value).collect()]).map_err(BenchError::from_display)
}

/// Deconvolution with a periodic border.
pub(super) fn model(n: usize) -> Result<Model, BenchError> {
    let line = (0..BLUR * BLUR).map(|k| if (k / BLUR).abs_diff(k % BLUR) < 2 { 1.0 } else { 0.0 }).collect();
    let psf = Psf::new(BLUR, BLUR, line, None).map_err(BenchError::from_display)?;
    let mut model = Model::new(&image(n)?, psf, Edges::Periodic, LAMBDA);
    model.penalty = Some(RHO);
    Ok(model)
}

/// The same, the data held by the global step.
fn single_split(n: usize, iteration: Iteration) -> Result<Box<dyn Method>, BenchError> {
    let built = model(n)?.build(None).map_err(BenchError::from_display)?;
    built.method("bench", iteration).map_err(BenchError::from_display)
}

/// A(32) with gradients of the light that change from pixel to pixel.
fn wavefront(n: usize) -> Result<Box<dyn Method>, BenchError> {
    let plane = |size: f64, step: f64| (0..n * n).map(|k| size * (step * k as f64).sin()).collect();
    let data = Consistency { gx: plane(30.0, 1.3), gy: plane(20.0, 0.7), gt: plane(5.0, 0.31) };
    let problem = Linearised { width: n, height: n, data, beta: 30.0, mu: 100.0 };
    problem.method(Solver::Admm { relaxation: 1.8 }).map_err(BenchError::from_display)
}

/// A field, its spectrum, and room for transforms.
struct Transforms {
    fourier: Fourier,
    field: Vec<f64>,
    used: Vec<f64>,
    back: Vec<f64>,
    spectrum: Vec<Complex>,
    work: Spectra,
}

impl Transforms {
    fn new(n: usize) -> Self {
        let field: Vec<f64> = (0..n * n).map(|k| (0.37 * k as f64).sin()).collect();
        let fourier = Fourier::new(n, n);
        let spectrum = fourier.forward(&field);
        Transforms { fourier, used: field.clone(), back: field.clone(), field, spectrum, work: Spectra::default() }
    }

    /// What a transform uses up is renewed before it is timed.
    fn renew(&mut self) {
        self.used.copy_from_slice(&self.field);
    }

    /// Both as the iteration has them: columns go back before they leave the cache.
    fn fused(&mut self) {
        let layouts = [Layout { first: 0, stride: self.fourier.width() }];
        let of = |column: Column<'_, '_, 1>| {
            black_box(&column.fields);
            0.0
        };
        black_box(self.fourier.filter(&mut self.used, &mut self.back, &layouts, &mut self.work, of));
    }

    /// r2c
    fn forward(&mut self) {
        self.fourier.forward_to(&mut self.used, &mut self.work, &mut self.spectrum);
    }

    /// c2r
    fn backward(&mut self) {
        self.fourier.backward_to(&self.spectrum, &mut self.work, &mut self.back);
    }
}

fn step(method: &mut dyn Method) -> Result<(), BenchError> {
    method.step().map(|_| ()).map_err(BenchError::from_display)
}

fn plain_row(quantity: &str, samples: &Samples) -> Row {
    Row {
        quantity: format!("images: {quantity}"),
        against: String::new(),
        figures: samples.milliseconds(),
        ratio: None,
        of_medians: None,
        threshold: None,
    }
}

pub(super) fn row(quantity: &str, against: &str, [a, b]: [&Samples; 2], threshold: Option<Threshold>) -> Row {
    Row {
        against: format!("{against}, {}", b.milliseconds()),
        ratio: Some(a.least() / b.least()),
        of_medians: Some(a.median() / b.median()),
        threshold,
        ..plain_row(quantity, a)
    }
}

/// All rows. Each thing is timed in turns with what it is held against.
///
/// # Errors
/// A problem that is refused, a step that fails.
pub(super) fn rows(repeats: usize) -> Result<Vec<Row>, BenchError> {
    let pools = [pool(1)?, pool(2)?];
    let mut rows = pools[0].install(|| single(512, repeats))?;
    rows.extend(pools[0].install(|| anderson(512, repeats))?);
    rows.extend(pools[0].install(|| of_wavefront(1024, repeats.div_ceil(2)))?);
    rows.extend(threads(2048, repeats.div_ceil(4), &pools)?);
    Ok(rows)
}

/// An iteration against its transforms.
fn single(n: usize, repeats: usize) -> Result<Vec<Row>, BenchError> {
    let mut method = single_split(n, Iteration::Admm { relaxation: 1.8 })?;
    let mut transforms = Transforms::new(n);
    for _ in 0..BEFORE {
        step(method.as_mut())?;
        transforms.fused();
    }
    let [mut whole, mut fused, mut forward, mut backward] = <[Samples; 4]>::default();
    for _ in 0..2 * repeats {
        // Each after one of its own, as in a run: what stood in between has taken the cache from it.
        step(method.as_mut())?;
        whole.time(|| step(method.as_mut()))?;
        for samples in [&mut Samples::default(), &mut fused] {
            transforms.renew();
            samples.time(|| transforms.fused());
        }
        for turn in [None, Some((&mut forward, &mut backward))] {
            let mut first = <[Samples; 2]>::default();
            let [a, b] = &mut first;
            let (forward, backward) = turn.unwrap_or((a, b));
            transforms.renew();
            forward.time(|| transforms.forward());
            backward.time(|| transforms.backward());
        }
    }
    let name = format!("an iteration of the single-split form, {n} x {n}, 1 thread");
    let part = |what: &str, samples: &Samples| plain_row(&format!("{what} of {n} x {n}, 1 thread"), samples);
    let (least, median) = (forward.least() + backward.least(), forward.median() + backward.median());
    Ok(vec![
        part("r2c", &forward),
        part("c2r", &backward),
        Row {
            quantity: format!("images: {name}"),
            against: format!("one r2c and one c2r, {:.2}; {:.2} ms", 1e3 * least, 1e3 * median),
            figures: whole.milliseconds(),
            ratio: Some(whole.least() / least),
            of_medians: Some(whole.median() / median),
            threshold: Some(Threshold::AtMost(1.6)),
        },
        row(&name, "the two in one pass over columns", [&whole, &fused], None),
    ])
}

/// What Anderson costs by itself, on the 2 N numbers of v = grad x + u, against reading its history.
fn anderson(n: usize, repeats: usize) -> Result<Vec<Row>, BenchError> {
    let length = 2 * n * n;
    let mut anderson = Anderson::new(WINDOW);
    let g: Vec<f64> = (0..length).map(|k| (0.37 * k as f64).sin()).collect();
    let mut f: Vec<f64> = (0..length).map(|k| (0.11 * k as f64).cos()).collect();
    let history: Vec<Vec<f64>> = (0..2 * WINDOW).map(|_| g.clone()).collect();
    let mut out = vec![0.0; length];
    let [mut own, mut passes] = <[Samples; 2]>::default();
    for round in 0..WINDOW + repeats {
        // Another residual each time, as in a run.
        f.iter_mut().enumerate().for_each(|(k, f)| *f *= if (k + round) % 3 == 0 { 0.9 } else { 0.7 });
        let (mut one, mut two) = <(Samples, Samples)>::default();
        one.time(|| black_box(anderson.extrapolate(&g, &f, &mut out)));
        two.time(|| (0..2).for_each(|_| history.iter().for_each(|h| _ = black_box(vector::dot(h, h)))));
        if round >= WINDOW {
            own.append(one);
            passes.append(two);
        }
    }
    let name = format!("Anderson, {WINDOW} columns of {length} numbers, 1 thread");
    let mut rows = vec![row(&name, "2 passes over its history", [&own, &passes], Some(Threshold::AtMost(1.0)))];
    let mut methods = [
        single_split(n, Iteration::Admm { relaxation: 1.0 })?,
        single_split(n, Iteration::Anderson { window: WINDOW, both: false, relaxation: 1.0 })?,
    ];
    let mut samples = <[Samples; 2]>::default();
    for round in 0..WINDOW + repeats {
        for (method, samples) in methods.iter_mut().zip(&mut samples) {
            let mut one = Samples::default();
            one.time(|| step(method.as_mut()))?;
            if round > WINDOW {
                samples.append(one);
            }
        }
    }
    let [plain, accelerated] = &samples;
    rows.push(row(
        &format!("an iteration under Anderson on v, {n} x {n}, 1 thread"),
        "a plain one",
        [accelerated, plain],
        None,
    ));
    Ok(rows)
}

/// An iteration of A(32) against the cosine transforms of its global step.
fn of_wavefront(n: usize, repeats: usize) -> Result<Vec<Row>, BenchError> {
    let mut method = wavefront(n)?;
    let mut laplacian = CosineLaplacian::new(n, n);
    let b: Vec<f64> = (0..n * n).map(|k| (0.37 * k as f64).sin()).collect();
    let mut x = vec![0.0; n * n];
    let [mut whole, mut transforms] = <[Samples; 2]>::default();
    for round in 0..BEFORE + repeats {
        let (mut one, mut two) = <(Samples, Samples)>::default();
        one.time(|| step(method.as_mut()))?;
        two.time(|| black_box(laplacian.solve(1.0, &b, &mut x)));
        if round >= BEFORE {
            whole.append(one);
            transforms.append(two);
        }
    }
    let name = format!("an iteration of a wavefront, {n} x {n}, 1 thread");
    Ok(vec![row(&name, "its transforms", [&whole, &transforms], Some(Threshold::AtMost(2.0)))])
}

/// One thread against two, for an iteration, and for arithmetic that needs no memory: what the machine has to give.
fn threads(n: usize, repeats: usize, pools: &[ThreadPool; 2]) -> Result<Vec<Row>, BenchError> {
    let mut method = pools[1].install(|| single_split(n, Iteration::Admm { relaxation: 1.8 }))?;
    let (mut images, mut sums) = <([Samples; 2], [Samples; 2])>::default();
    for round in 0..BEFORE + repeats {
        for ((pool, images), sums) in pools.iter().zip(&mut images).zip(&mut sums) {
            let (mut one, mut two) = <(Samples, Samples)>::default();
            one.time(|| pool.install(|| step(method.as_mut())))?;
            two.time(|| pool.install(|| rayon::join(arithmetic, arithmetic)));
            if round >= BEFORE {
                images.append(one);
                sums.append(two);
            }
        }
    }
    let name = format!("an iteration of the single-split form, {n} x {n}, 1 thread");
    Ok(vec![
        row("arithmetic without memory, 1 thread", "2 threads", [&sums[0], &sums[1]], None),
        row(&name, "2 threads", [&images[0], &images[1]], Some(Threshold::AtLeast(1.6))),
    ])
}

/// A sum that waits for itself.
fn arithmetic() -> f64 {
    black_box((0..10_000_000).fold(0.0, |sum: f64, k| sum + f64::from(k)))
}
