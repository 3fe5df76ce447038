//! What single precision would save of an iteration of total variation, and what it would lose: the same iteration, written
//! once for both precisions and as plainly as can be, beside passes over memory.

use super::images::{LAMBDA, RHO, model, row};
use super::{Row, Samples};
use crate::BenchError;
use proxel::imaging::restore::{Iteration, duality_gap};
use proxel::split::{EnergyReport, Evaluation, Method, Problem, Splitting, StepReport, SystemError};
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, FftNum, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::sync::Arc;

/// Columns of a spectrum that are handled together.
const BLOCK: usize = 8;
/// Over-relaxation.
const ALPHA: f64 = 1.8;
/// Iterations after which both are held against each other.
const COURSE: [usize; 3] = [100, 400, 1600];

/// f32 and f64.
trait Real: FftNum + PartialOrd {
    fn of(v: f64) -> Self;
    fn wide(self) -> f64;
    fn root(self) -> Self;
}

impl Real for f32 {
    fn of(v: f64) -> Self {
        v as f32
    }
    fn wide(self) -> f64 {
        f64::from(self)
    }
    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Real for f64 {
    fn of(v: f64) -> Self {
        v
    }
    fn wide(self) -> f64 {
        self
    }
    fn root(self) -> Self {
        self.sqrt()
    }
}

/// r2c and c2r of n x n numbers, columns in blocks.
struct Transform<T> {
    n: usize,
    rows: Arc<dyn RealToComplex<T>>,
    rows_back: Arc<dyn ComplexToReal<T>>,
    columns: Arc<dyn Fft<T>>,
    columns_back: Arc<dyn Fft<T>>,
    spectrum: Vec<Complex<T>>, // [row][column]
    block: Vec<Complex<T>>,    // [column][row]
    scratch: Vec<Complex<T>>,
}

impl<T: Real> Transform<T> {
    fn new(n: usize) -> Self {
        let (mut real, mut complex) = (RealFftPlanner::new(), FftPlanner::new());
        let (rows, rows_back) = (real.plan_fft_forward(n), real.plan_fft_inverse(n));
        let (columns, columns_back) = (complex.plan_fft_forward(n), complex.plan_fft_inverse(n));
        let zero = Complex::new(T::zero(), T::zero());
        let lengths = [rows.get_scratch_len(), rows_back.get_scratch_len(), columns.get_inplace_scratch_len()];
        let scratch = vec![zero; lengths.into_iter().fold(columns_back.get_inplace_scratch_len(), usize::max)];
        let (spectrum, block) = (vec![zero; n * (n / 2 + 1)], vec![zero; n * BLOCK]);
        Transform { n, rows, rows_back, columns, columns_back, spectrum, block, scratch }
    }

    /// `from`, which is used up, to its spectrum, `of` on every column, and back to `to`; neither way is normalised.
    fn filter(&mut self, from: &mut [T], to: &mut [T], mut of: impl FnMut(usize, &mut [Complex<T>])) {
        let (n, m) = (self.n, self.n / 2 + 1);
        for (from, row) in from.chunks_exact_mut(n).zip(self.spectrum.chunks_exact_mut(m)) {
            // Lengths are those of the plan, which is all that can go wrong.
            let _ = self.rows.process_with_scratch(from, row, &mut self.scratch);
        }
        for first in (0..m).step_by(BLOCK) {
            let width = BLOCK.min(m - first);
            for (i, row) in self.spectrum.chunks_exact(m).enumerate() {
                for b in 0..width {
                    self.block[b * n + i] = row[first + b];
                }
            }
            for (b, column) in self.block.chunks_exact_mut(n).take(width).enumerate() {
                self.columns.process_with_scratch(column, &mut self.scratch);
                of(first + b, column);
                self.columns_back.process_with_scratch(column, &mut self.scratch);
            }
            for (i, row) in self.spectrum.chunks_exact_mut(m).enumerate() {
                for b in 0..width {
                    row[first + b] = self.block[b * n + i];
                }
            }
        }
        for (row, to) in self.spectrum.chunks_exact_mut(m).zip(to.chunks_exact_mut(n)) {
            let _ = self.rows_back.process_with_scratch(row, to, &mut self.scratch);
        }
    }
}

/// v <- v + alpha (D x - z), z = prox(v), x = argmin lambda |K x - f|^2 + rho/2 |D x - (2 z - v)|^2: periodic, n x n.
struct Plain<T> {
    n: usize,
    transform: Transform<T>,
    data: Vec<Complex<T>>, // 2 lambda conj(H) F / denominator, column by column
    inverse: Vec<T>,       // rho / denominator
    v: Vec<T>,             // a row's differences along it, then those down
    x: Vec<T>,
    pull: Vec<T>,
}

impl<T: Real> Plain<T> {
    fn new(n: usize, seen: &[f64], kernel: &[f64]) -> Self {
        let spectrum = |field: &[f64]| {
            let (mut field, mut out) = (field.to_vec(), vec![Complex::new(0.0, 0.0); n * (n / 2 + 1)]);
            let mut back = field.clone();
            Transform::<f64>::new(n).filter(&mut field, &mut back, |j, column| {
                out[j * n..(j + 1) * n].copy_from_slice(column);
            });
            out
        };
        let (h, f) = (spectrum(kernel), spectrum(seen));
        let part = |k: usize| 2.0 - 2.0 * (TAU * k as f64 / n as f64).cos();
        let pixels = (n * n) as f64;
        let (mut data, mut inverse) = (Vec::new(), Vec::new());
        for (k, (h, f)) in h.iter().zip(&f).enumerate() {
            let of = 1.0 / (pixels * (2.0 * LAMBDA * h.norm_sqr() + RHO * (part(k / n) + part(k % n))));
            let d = h.conj() * f * (2.0 * LAMBDA * of);
            data.push(Complex::new(T::of(d.re), T::of(d.im)));
            inverse.push(T::of(RHO * of));
        }
        let zeros = |length: usize| vec![T::zero(); length];
        Plain {
            n,
            transform: Transform::new(n),
            data,
            inverse,
            v: zeros(2 * n * n),
            x: zeros(n * n),
            pull: zeros(n * n),
        }
    }

    fn shrunk(along: T, down: T) -> (T, T) {
        let size = (along * along + down * down).root();
        let threshold = T::of(1.0 / RHO);
        let part = if size > threshold { T::one() - threshold / size } else { T::zero() };
        (along * part, down * part)
    }

    /// 2 z - v of row i.
    fn pulled(&self, i: usize, out: &mut [T]) {
        let (along, down) = self.v[2 * self.n * i..2 * self.n * (i + 1)].split_at(self.n);
        let (to_along, to_down) = out.split_at_mut(self.n);
        for ((a, d), (along, down)) in to_along.iter_mut().zip(to_down).zip(along.iter().zip(down)) {
            let z = Self::shrunk(*along, *down);
            (*a, *d) = (z.0 + z.0 - *along, z.1 + z.1 - *down);
        }
    }

    /// v of x, then x of v: a certificate needs the v that its x is of.
    fn step(&mut self) {
        let n = self.n;
        let alpha = T::of(ALPHA);
        for (i, v) in self.v.chunks_exact_mut(2 * n).enumerate() {
            let row = |i: usize| &self.x[i % n * n..(i % n + 1) * n];
            let (here, below, (along, down)) = (row(i), row(i + 1), v.split_at_mut(n));
            let right = here[1..].iter().chain(&here[..1]);
            for (((a, d), (x, right)), below) in along.iter_mut().zip(down).zip(here.iter().zip(right)).zip(below) {
                let z = Self::shrunk(*a, *d);
                *a = *a + alpha * (*right - *x - z.0);
                *d = *d + alpha * (*below - *x - z.1);
            }
        }
        let mut pull = std::mem::take(&mut self.pull);
        let (mut above, mut here) = (vec![T::zero(); 2 * n], vec![T::zero(); 2 * n]);
        self.pulled(n - 1, &mut above);
        for (i, pull) in pull.chunks_exact_mut(n).enumerate() {
            self.pulled(i, &mut here);
            let ((along, down), above_down) = (here.split_at(n), &above[n..]);
            // D^T
            pull[0] = along[n - 1] - along[0] + above_down[0] - down[0];
            let rest = along.windows(2).zip(down[1..].iter().zip(&above_down[1..]));
            pull[1..].iter_mut().zip(rest).for_each(|(p, (a, (d, above)))| *p = a[0] - a[1] + *above - *d);
            std::mem::swap(&mut here, &mut above);
        }
        let (data, inverse) = (&self.data, &self.inverse);
        self.transform.filter(&mut pull, &mut self.x, |j, column| {
            let range = j * n..(j + 1) * n;
            for ((c, d), w) in column.iter_mut().zip(&data[range.clone()]).zip(&inverse[range]) {
                *c = *c * *w + *d;
            }
        });
        self.pull = pull;
    }
}

/// A point of f32, put into a problem of f64 for its certificate.
struct Put {
    inner: Box<dyn Method>,
    energy: EnergyReport,
    x: Vec<f64>,
    p: Vec<Vec<f64>>,
    u: Vec<Vec<f64>>,
}

impl Method for Put {
    fn name(&self) -> &str {
        self.inner.name()
    }
    fn step(&mut self) -> Result<StepReport, SystemError> {
        self.inner.step()
    }
    fn x(&self) -> &[f64] {
        &self.x
    }
    fn problem(&self) -> &Problem {
        self.inner.problem()
    }
    fn energy(&mut self) -> EnergyReport {
        self.energy
    }
    fn evaluate(&mut self) -> Evaluation {
        self.inner.evaluate()
    }
    fn factor_bytes(&self) -> u64 {
        0
    }
    fn into_problem(self: Box<Self>) -> Problem {
        self.inner.into_problem()
    }
    fn splitting(&mut self) -> Option<Splitting<'_>> {
        let Splitting { problem, .. } = self.inner.splitting()?;
        self.energy = problem.energy(&self.x, None);
        Some(Splitting { problem, x: &self.x, p: &self.p, u: &self.u })
    }
}

/// The relative gap and the objective of a point, in f64.
fn certified<T: Real>(of: &Plain<T>) -> Result<(f64, f64), BenchError> {
    let built = model(of.n)?.build(None).map_err(BenchError::from_display)?;
    let field = built.field.clone();
    let inner = built.method("bench", Iteration::Admm { relaxation: 1.0 }).map_err(BenchError::from_display)?;
    let (mut p, mut u) = (Vec::new(), Vec::new());
    for row in of.v.chunks_exact(2 * of.n) {
        let (along, down) = row.split_at(of.n);
        let of = |k: usize| (along[k].wide(), down[k].wide());
        let z = |k: usize| (Plain::<f64>::shrunk(of(k).0, of(k).1), of(k));
        for first in [true, false] {
            for k in 0..along.len() {
                let ((a, d), (va, vd)) = z(k);
                let (z, v) = if first { (a, va) } else { (d, vd) };
                p.push(z + z - v);
                u.push(v - z);
            }
        }
    }
    let x = of.x.iter().map(|x| x.wide()).collect();
    let mut put = Put { inner, energy: EnergyReport::default(), x, p: vec![p], u: vec![u] };
    // Takes the objective.
    let _ = put.splitting();
    let gap = duality_gap(&mut put, &field).ok_or_else(|| BenchError("a point without a bound".to_string()))?;
    Ok((gap.relative(), gap.objective))
}

/// y <- a y + b: a pass over memory.
fn pass<T: Real>(y: &mut [T]) {
    let (a, b) = (T::of(0.999), T::of(0.001));
    y.iter_mut().for_each(|y| *y = a * *y + b);
    black_box(y);
}

/// All rows: a transform there and back, a pass over v, an iteration, and what is reached, in f32 against f64.
///
/// # Errors
/// A problem that is refused.
pub(super) fn rows(n: usize, repeats: usize) -> Result<Vec<Row>, BenchError> {
    let of = model(n)?;
    let mut kernel = vec![0.0; n * n];
    for (k, w) in of.psf.weights.iter().enumerate() {
        let (i, j) = (k / of.psf.width + n - of.psf.center.0, k % of.psf.width + n - of.psf.center.1);
        kernel[i % n * n + j % n] += w;
    }
    let seen = &of.channels[0];
    let (mut single, mut double) = (Plain::<f32>::new(n, seen, &kernel), Plain::<f64>::new(n, seen, &kernel));
    let mut reached = Vec::new();
    let mut done = 0;
    for iterations in COURSE {
        for _ in done..iterations {
            single.step();
            double.step();
        }
        done = iterations;
        let ((gap32, value32), (gap64, value64)) = (certified(&single)?, certified(&double)?);
        let quantity = format!("precision: after {iterations} iterations in f32, {n} x {n}");
        let against = format!("in f64, a gap of {gap64:.1e}");
        let figures = format!("a gap of {gap32:.1e}, an objective off by {:.1e}", (value32 - value64) / value64);
        reached.push(Row { quantity, against, figures, ratio: None, of_medians: None, threshold: None });
    }
    let [mut ffts, mut passes, mut steps] = <[[Samples; 2]; 3]>::default();
    let (field32, field64) = (single.x.clone(), double.x.clone());
    let (mut back32, mut back64) = (field32.clone(), field64.clone());
    let (mut v32, mut v64) = (single.v.clone(), double.v.clone());
    for _ in 0..repeats {
        // What a transform uses up is renewed before it is timed.
        single.pull.copy_from_slice(&field32);
        double.pull.copy_from_slice(&field64);
        ffts[0].time(|| single.transform.filter(&mut single.pull, &mut back32, |_, _| ()));
        ffts[1].time(|| double.transform.filter(&mut double.pull, &mut back64, |_, _| ()));
        passes[0].time(|| pass(&mut v32));
        passes[1].time(|| pass(&mut v64));
        steps[0].time(|| single.step());
        steps[1].time(|| double.step());
    }
    let name = |what: &str| format!("{what} in f32, {n} x {n}, 1 thread");
    let mut rows: Vec<Row> = [("r2c and c2r", &ffts), ("a pass over v", &passes), ("a plain iteration", &steps)]
        .map(|(what, [a, b])| row(&name(what), "in f64", [a, b], None))
        .into();
    rows.iter_mut().for_each(|row| row.quantity = row.quantity.replacen("images", "precision", 1));
    rows.extend(reached);
    Ok(rows)
}
