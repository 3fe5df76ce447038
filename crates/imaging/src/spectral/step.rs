//! The global step in Fourier space.

use super::blur::Blur;
use super::fourier::{Column, Fed, Fourier, Spectra};
use super::kernel::BlurredSquares;
use crate::Grid;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use proxel_split::vector;
use proxel_split::{
    GlobalReport, GlobalStep, Intake, NormalMatrix, Objective, Precision, Problem, Pull, SystemError, Taker,
};
use realfft::num_complex::Complex;
use std::f64::consts::TAU;
use std::sync::Arc;

/// What D^T D of a term is in Fourier space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symbol {
    /// That of the periodic gradient: 4 - 2 cos - 2 cos.
    Laplacian,
    /// Of the identity on x: 1.
    Identity,
    /// Of the identity on the blurred field y = K x: |H|^2.
    Blurred,
}

/// The exact minimiser over x, by one transform there and one back for each field:
///
/// ```text
/// X = (2 lambda conj(H) F - P - conj(H) P_y) / (2 lambda |H|^2 + sum w^2 symbol)
/// ```
///
/// with P the transform of the pull -D^T W^2 p on the nodes of x. Where a blurred field is carried, the nodes behind those of
/// x are y, which is K x at every point that the step returns (a constraint that it keeps, as linear equalities are kept
/// elsewhere); P_y is the pull on them. Then the blur costs two transforms more an iteration, and data terms are terms of
/// single pixels: Poisson, masks of an unknown boundary, sampling.
///
/// What it reads and writes besides the transforms: 32 bytes a pixel and iteration.
pub struct FourierStep {
    grid: Grid,
    fourier: Fourier,
    kernel: Arc<Vec<Complex<f64>>>,
    carries: bool,
    data: Option<BlurredSquares>,
    right: Vec<Vec<Complex<f64>>>, // a channel: 2 lambda conj(H) F
    symbols: Vec<Symbol>,          // of each term of the problem
    weights: Vec<f64>,             // w^2 of each term
    inverse: Vec<f64>,             // 1 / (denominator times pixels), since transforms are not normalised
    laplacian: [Vec<f64>; 2],      // 2 - 2 cos of each row, and of each column
    work: Spectra,
    fed: Vec<Fed>, // the pull on x of each channel, where it was taken row by row
    square: f64,   // lambda |f|^2
}

impl FourierStep {
    /// With a data term that it holds itself and the problem has as a potential; terms by their symbols. None where the border
    /// of the data mirrors, which is [`super::CosineStep`]'s.
    pub fn with_data(data: BlurredSquares, symbols: Vec<Symbol>) -> Option<Self> {
        let Blur::Periodic { fourier, kernel } = data.blur().clone() else { return None };
        let grid = data.grid();
        let right = (0..grid.channels)
            .map(|channel| {
                let rows = data.observed().chunks(grid.width).skip(channel).step_by(grid.channels);
                let observed: Vec<f64> = rows.flatten().copied().collect();
                let mut right = fourier.forward(&observed);
                right.iter_mut().zip(kernel.iter()).for_each(|(f, k)| *f *= k.conj() * (2.0 * data.lambda()));
                right
            })
            .collect();
        let square = data.lambda() * vector::dot(data.observed(), data.observed());
        Some(FourierStep { square, right, data: Some(data), ..Self::new(grid, fourier, kernel, false, symbols) })
    }

    /// With the blurred field behind x.
    pub fn with_blurred(grid: Grid, fourier: Fourier, kernel: Arc<Vec<Complex<f64>>>, symbols: Vec<Symbol>) -> Self {
        Self::new(grid, fourier, kernel, true, symbols)
    }

    /// Terms alone.
    pub fn of_terms(grid: Grid, fourier: Fourier, symbols: Vec<Symbol>) -> Self {
        Self::new(grid, fourier, Arc::default(), false, symbols)
    }

    fn new(grid: Grid, fourier: Fourier, kernel: Arc<Vec<Complex<f64>>>, carries: bool, symbols: Vec<Symbol>) -> Self {
        FourierStep {
            grid,
            fourier,
            kernel,
            carries,
            data: None,
            right: Vec::new(),
            weights: vec![0.0; symbols.len()],
            symbols,
            inverse: Vec::new(),
            laplacian: Default::default(),
            work: Spectra::default(),
            fed: Vec::new(),
            square: 0.0,
        }
    }

    /// sum w^2 symbol + 2 lambda |H|^2 at a frequency; s is 4 - 2 cos - 2 cos.
    fn denominator(&self, s: f64, gain: f64) -> f64 {
        let lambda = self.data.as_ref().map_or(0.0, |data| data.lambda());
        2.0 * lambda * gain + of_terms(&self.symbols, &self.weights, s, gain)
    }

    /// (a, b) of sum w^2 symbol = a (4 - 2 cos - 2 cos) + b, where no field is carried.
    fn penalties(&self) -> [f64; 2] {
        let of = |wanted: Symbol| {
            let weights = self.symbols.iter().zip(&self.weights).filter(|(symbol, _)| **symbol == wanted);
            weights.map(|(_, w2)| w2).sum()
        };
        [of(Symbol::Laplacian), of(Symbol::Identity)]
    }

    fn gain(&self, k: usize) -> f64 {
        self.kernel.get(k).map_or(1.0, |h| h.norm_sqr())
    }
}

/// A column of s X = s (R - P) / denominator in the place of P, s = 1 / pixels, the denominator being 2 lambda |H|^2 + a;
/// returns its part of lambda |K x - f|^2 without lambda |f|^2, which is s times
///
/// ```text
/// lambda |H|^2 |X|^2 - Re conj(X) R = -(Re conj(X) (R + P) + a |X|^2) / 2
/// ```
///
/// and takes no |H|^2, an array less to be read.
struct Held<'a> {
    field: &'a mut [Complex<f64>],
    right: &'a [Complex<f64>], // R = 2 lambda conj(H) F
    inverse: &'a [f64],        // s / denominator
    down: &'a [f64],           // 2 - 2 cos of the row
    slope: f64,                // a / s = slope down + shift
    shift: f64,
}

/// Eight numbers as their real and their imaginary parts.
type Split<I> = [F8<I>; 2];

impl<I: Isa> HeldLanes<I> {
    #[inline(always)]
    fn advance(&mut self, p: Split<I>, r: Split<I>, inverse: F8<I>, down: F8<I>) -> Split<I> {
        let (re, im) = ((r[0] - p[0]) * inverse, (r[1] - p[1]) * inverse);
        let a = self.slope.mul_add(down, self.shift);
        let of_sum = re.mul_add(r[0] + p[0], im * (r[1] + p[1]));
        self.sum += a.mul_add(re.mul_add(re, im * im), of_sum);
        [re, im]
    }
}

struct HeldLanes<I: Isa> {
    slope: F8<I>,
    shift: F8<I>,
    sum: F8<I>,
}

impl Kernel for Held<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let n = self.field.len().min(self.right.len()).min(self.inverse.len()).min(self.down.len());
        let (field, field_rest) = bytemuck::cast_slice_mut(&mut self.field[..n]).as_chunks_mut::<{ 2 * LANES }>();
        let (right, right_rest) = bytemuck::cast_slice(&self.right[..n]).as_chunks::<{ 2 * LANES }>();
        let (inverse, inverse_rest) = self.inverse[..n].as_chunks::<LANES>();
        let (down, down_rest) = self.down[..n].as_chunks::<LANES>();
        let mut lanes = HeldLanes::<I> { slope: F8::splat(self.slope), shift: F8::splat(self.shift), sum: F8::zero() };
        for i in 0..field.len() {
            let (p, r) = (F8::pairs(&field[i]), F8::pairs(&right[i]));
            F8::put_pairs(lanes.advance(p, r, F8::load(&inverse[i]), F8::load(&down[i])), &mut field[i]);
        }
        if !field_rest.is_empty() {
            let (mut p, r) = (filled(field_rest), filled(right_rest));
            let x = lanes.advance(
                F8::pairs(&p),
                F8::pairs(&r),
                F8::load(&filled(inverse_rest)),
                F8::load(&filled(down_rest)),
            );
            F8::put_pairs(x, &mut p);
            field_rest.copy_from_slice(&p[..field_rest.len()]);
        }
        -0.5 * lanes.sum.sum()
    }
}

/// Zeros where there is nothing: they stay, and add nothing.
#[inline(always)]
fn filled<const N: usize>(rest: &[f64]) -> [f64; N] {
    let mut all = [0.0; N];
    all[..rest.len()].copy_from_slice(rest);
    all
}

/// sum w^2 symbol, where the gradient's is s and the squared gain of the blur is given.
pub(super) fn of_terms(symbols: &[Symbol], weights: &[f64], s: f64, gain: f64) -> f64 {
    let of = |symbol: &Symbol| match symbol {
        Symbol::Laplacian => s,
        Symbol::Identity => 1.0,
        Symbol::Blurred => gain,
    };
    symbols.iter().zip(weights).map(|(symbol, w2)| w2 * of(symbol)).sum()
}

/// w^2 of each term, of a problem on so many fields and terms, without fixed nodes.
pub(super) fn weights(problem: &Problem, grid: Grid, fields: usize, terms: usize) -> Result<Vec<f64>, SystemError> {
    if problem.n() != fields * grid.len() || problem.n_free != problem.n() || problem.dim != 1 {
        let (n, len) = (problem.n(), grid.len());
        return Err(SystemError::Factor(format!("{n} nodes for {fields} fields of {len}, none of them fixed")));
    }
    if problem.terms.len() != terms {
        return Err(SystemError::Factor(format!("{terms} symbols for {} terms", problem.terms.len())));
    }
    let pixels = grid.n_pixels() as f64;
    Ok(problem.terms.iter().map(|term| term.scale().weight2 / pixels).collect())
}

impl Intake for FourierStep {
    fn takers(&mut self, len: usize) -> Option<Vec<Box<dyn Taker + '_>>> {
        let row_len = self.grid.row_len();
        if row_len == 0 || !len.is_multiple_of(row_len) {
            return None;
        }
        if self.fed.is_empty() {
            // Room that is not used as long as rows are taken one by one.
            self.fed = self.work.give_rows();
            self.fed.resize_with(self.grid.channels, Fed::default);
        }
        self.fourier.takers(len / row_len, &mut self.fed)
    }
}

impl GlobalStep for FourierStep {
    fn run(
        &mut self,
        objective: &mut Objective<'_>,
        _: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        let is_fed = objective.fed.is_some();
        let (grid, h) = (self.grid, self.fourier.height());
        let (inverse, kernel, pixels) = (&self.inverse, &self.kernel, grid.n_pixels() as f64);
        let (down, along, penalties) = (&self.laplacian[0], &self.laplacian[1], self.penalties());
        let mut f = self.square;
        for channel in 0..grid.channels {
            let layout = super::channel(grid, 0, channel);
            let at = |j: usize| j * h..(j + 1) * h;
            if self.carries {
                let layouts = [layout, super::channel(grid, grid.len(), channel)];
                let of = |column: Column<'_, '_, 2>| {
                    let (inverse, kernel) = (&inverse[at(column.j)], &kernel[at(column.j)]);
                    let [of_x, of_y] = column.fields;
                    for (((x, y), d), k) in of_x.iter_mut().zip(of_y.iter_mut()).zip(inverse).zip(kernel) {
                        *x = (*x + k.conj() * *y) * -d;
                        *y = *x * k;
                    }
                    0.0
                };
                match self.fed.get_mut(channel).filter(|_| is_fed) {
                    Some(fed) => self.fourier.filter_fed(fed, grad, x, &layouts, &mut self.work, of),
                    None => self.fourier.filter(grad, x, &layouts, &mut self.work, of),
                };
                continue;
            }
            let right = self.right.get(channel);
            let of = |column: Column<'_, '_, 1>| {
                let inverse = &inverse[at(column.j)];
                let [field] = column.fields;
                let Some(right) = right else {
                    field.iter_mut().zip(inverse).for_each(|(x, d)| *x *= -d);
                    return 0.0;
                };
                let right = &right[at(column.j)];
                let (slope, shift) = (pixels * penalties[0], pixels * (penalties[0] * along[column.j] + penalties[1]));
                dispatch(Held { field, right, inverse, down, slope, shift }) * column.multiplicity
            };
            f += match self.fed.get_mut(channel).filter(|_| is_fed) {
                Some(fed) => self.fourier.filter_fed(fed, grad, x, &[layout], &mut self.work, of),
                None => self.fourier.filter(grad, x, &[layout], &mut self.work, of),
            };
        }
        let quadratic = self.data.is_some().then_some(f);
        Ok(GlobalReport { inner: 1, quadratic, ..GlobalReport::default() })
    }

    fn precision(&self) -> Option<Precision> {
        None
    }

    fn pull(&self) -> Pull {
        Pull::AtOrigin
    }

    fn intake(&mut self, term: usize) -> Option<&mut dyn Intake> {
        let on_x = |symbol: &Symbol| *symbol != Symbol::Blurred;
        let alone = self.symbols.iter().filter(|symbol| on_x(symbol)).count() == 1;
        (alone && self.symbols.get(term).is_some_and(on_x)).then_some(self)
    }

    fn work(&self) -> f64 {
        /// Nanoseconds a pixel for a transform there and back.
        const PIXEL: f64 = 16.0;
        let fields = if self.carries { 2.0 } else { 1.0 };
        PIXEL * fields * self.grid.len() as f64
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn reset(&mut self) {}

    fn weigh(&mut self, problem: &Problem) -> Result<(), SystemError> {
        let fields = if self.carries { 2 } else { 1 };
        self.weights = weights(problem, self.grid, fields, self.symbols.len())?;
        let (h, w) = (self.fourier.height(), self.fourier.width());
        // 2 - 2 cos t = 4 sin^2(t/2), which does not cancel.
        let part = |k: usize, n: usize| 4.0 * (0.5 * TAU * k as f64 / n as f64).sin().powi(2);
        self.laplacian =
            [(h, h), (self.fourier.n_columns(), w)].map(|(count, n)| (0..count).map(|k| part(k, n)).collect());
        let pixels = self.grid.n_pixels() as f64;
        let mut inverse = std::mem::take(&mut self.inverse);
        inverse.clear();
        for j in 0..self.fourier.n_columns() {
            for i in 0..h {
                let denominator = self.denominator(self.laplacian[0][i] + self.laplacian[1][j], self.gain(j * h + i));
                if !(denominator > 0.0 && denominator.is_finite()) {
                    return Err(SystemError::Singular { node: i * w + j });
                }
                inverse.push(1.0 / (denominator * pixels));
            }
        }
        self.inverse = inverse;
        Ok(())
    }
}
