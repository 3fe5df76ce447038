//! Restoration: images of which a blurred, noisy or incomplete one is known.
//!
//! ```text
//! min over x   lambda |M (K x - f)|^2 + sum over pixels |grad x|_2        A(31), with lambda = lambda_1 and lambda_2 = 1
//! ```
//!
//! K is the convolution with a point spread function, M leaves out what was not measured. [`Model`] says what is known,
//! [`Restoration`] is the problem and the global step made of it.

mod certificate;
mod noise;
mod risk;

pub use certificate::{Gap, duality_gap};
pub use noise::{noise_level, psnr};
pub use risk::{Risk, RiskSettings, choose_lambda};

use crate::{
    BlurredSquares, Boundary, Fourier, FourierStep, GradientTerm, Grid, Image, ImageError, Interval, Norm, Observed,
    PixelTerm, Psf, Squares, Symbol, TotalVariation,
};
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Extrapolation, History, Method, Problem, Quadratic,
    SystemError, Term,
};
use realfft::num_complex::Complex;
use std::sync::Arc;

/// What lies beyond the border of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Edges {
    /// Nobody knows: the field is larger than the image by what the blur reaches, and only what was seen is compared.
    #[default]
    Unknown,
    /// The image again.
    Periodic,
}

/// How the data term is split.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// What costs the fewest transforms: held where it can be.
    #[default]
    Auto,
    /// The global step holds it: one transform there and one back an iteration.
    Held,
    /// It is a term of the blurred field: two there and two back. The only one for masks and unknown borders.
    Split,
}

/// How it is iterated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Iteration {
    /// ADMM with a relaxation; 1 is plain.
    Admm {
        /// alpha
        relaxation: f64,
    },
    /// Fast ADMM with restart (Goldstein et al. 2014).
    Fast,
    /// Anderson with so many columns on v = grad x + u, the Douglas-Rachford variable.
    Anderson {
        /// m
        window: usize,
        /// Whether (z, u) is accelerated instead, A, Algorithm 1.
        both: bool,
        /// alpha
        relaxation: f64,
    },
}

/// What is known of an image.
#[derive(Clone, Debug)]
pub struct Model {
    /// Columns of what was seen.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What was seen, a plane a channel.
    pub channels: Vec<Vec<f64>>,
    /// The blur.
    pub psf: Psf,
    /// What lies beyond the border.
    pub edges: Edges,
    /// 1 where a pixel was measured, 0 where it was not; all of them where there is no mask.
    pub mask: Option<Vec<f64>>,
    /// lambda
    pub lambda: f64,
    /// Which differences of a pixel count together.
    pub norm: Norm,
    /// Values that the image may have; any where there are none.
    pub range: Option<[f64; 2]>,
    /// How the data term is split.
    pub form: Form,
    /// Penalty rho, the squared weight of the gradient term.
    pub penalty: f64,
    /// That of the data term where it is split, and of the range; by lambda and rho if none.
    pub data_penalty: Option<f64>,
}

/// A problem and the step that solves for x.
pub struct Restoration {
    problem: Problem,
    step: FourierStep,
    /// What certificates need.
    pub field: Field,
}

/// The field that is solved for, and where the image lies in it.
#[derive(Clone)]
pub struct Field {
    /// Its pixels.
    pub grid: Grid,
    /// Row and column of the image's first pixel.
    pub at: (usize, usize),
    /// Columns and rows of the image.
    pub size: (usize, usize),
    /// Plans of its size.
    pub fourier: Fourier,
    /// The spectrum of the blur.
    pub kernel: Arc<Vec<Complex<f64>>>,
    /// Whether the blurred field stands behind x among the nodes.
    pub carries: bool,
}

/// The least n' >= n of the form 2^a 3^b 5^c, a > 0: transforms of such lengths are fast.
fn fast_length(n: usize) -> usize {
    let smooth = |mut n: usize| {
        for p in [2, 3, 5] {
            while n.is_multiple_of(p) {
                n /= p;
            }
        }
        n == 1
    };
    (n.max(2)..).find(|n| n.is_multiple_of(2) && smooth(*n)).unwrap_or(n)
}

impl Field {
    /// For an image of this size under this blur.
    pub fn new(width: usize, height: usize, channels: usize, psf: &Psf, edges: Edges) -> Self {
        let (w, h, at) = match edges {
            Edges::Periodic => (width, height, (0, 0)),
            // Pixel i of what was seen depends on x from i - (n - 1 - c) to i + c. One more, so that opposite sides are apart.
            Edges::Unknown => (
                fast_length(width + psf.width),
                fast_length(height + psf.height),
                (psf.height - 1 - psf.center.0, psf.width - 1 - psf.center.1),
            ),
        };
        let fourier = Fourier::new(w, h);
        let kernel = Arc::new(psf.spectrum(&fourier));
        let grid = Grid { width: w, height: h, channels };
        Field { grid, at, size: (width, height), fourier, kernel, carries: false }
    }

    /// Planes of the image, put to their place in a field that is `other` elsewhere.
    fn embed(&self, planes: &[&[f64]], other: f64) -> Vec<f64> {
        let mut field = vec![other; self.grid.len()];
        for (c, plane) in planes.iter().enumerate() {
            for (i, row) in plane.chunks_exact(self.size.0).enumerate() {
                let start = ((self.at.0 + i) * self.grid.channels + c) * self.grid.width + self.at.1;
                field[start..start + self.size.0].copy_from_slice(row);
            }
        }
        field
    }

    /// The image within a field: a plane a channel.
    pub fn image(&self, x: &[f64]) -> Vec<Vec<f64>> {
        (0..self.grid.channels)
            .map(|c| {
                let row = |i: usize| {
                    let start = ((self.at.0 + i) * self.grid.channels + c) * self.grid.width + self.at.1;
                    x[start..start + self.size.0].iter().copied()
                };
                (0..self.size.1).flat_map(row).collect()
            })
            .collect()
    }

    /// The blurred field in place of x, or behind it: what the image looks like through the blur.
    pub fn blurred(&self, x: &[f64]) -> Vec<f64> {
        let n = self.grid.len();
        if self.carries {
            return x[n..].to_vec();
        }
        let mut out = vec![0.0; n];
        crate::convolve(self.grid, &self.fourier, &self.kernel, false, &x[..n], &mut out);
        out
    }
}

impl Model {
    /// Of an image: nothing is masked, any value is allowed.
    pub fn new(image: &Image, psf: Psf, edges: Edges, lambda: f64) -> Self {
        let penalty = natural_penalty(&image.channels);
        Model {
            width: image.width,
            height: image.height,
            channels: image.channels.clone(),
            psf,
            edges,
            mask: None,
            lambda,
            norm: Norm::Vectorial,
            range: None,
            form: Form::Auto,
            penalty,
            data_penalty: None,
        }
    }

    /// # Errors
    /// Numbers that make no sense, a mask of another size or without a measured pixel, a blur that is larger than the image.
    pub fn check(&self) -> Result<(), ImageError> {
        let refuse = |text: String| Err(ImageError(text));
        if !(self.lambda > 0.0 && self.lambda.is_finite()) {
            return refuse(format!("lambda is {}; it has to be positive", self.lambda));
        }
        if let Some(p) =
            [Some(self.penalty), self.data_penalty].into_iter().flatten().find(|p| !(*p > 0.0 && p.is_finite()))
        {
            return refuse(format!("a penalty is {p}; it has to be positive"));
        }
        let (width, height, psf) = (self.width, self.height, &self.psf);
        if psf.width > width || psf.height > height {
            let size = format!("{} x {}", psf.width, psf.height);
            return refuse(format!("the point spread function has {size} pixels, the image {width} x {height}"));
        }
        if let Some(mask) = &self.mask {
            if mask.len() != width * height {
                return refuse(format!("the mask has {} pixels, the image {width} x {height}", mask.len()));
            }
            if !mask.iter().any(|m| *m > 0.0) {
                return refuse("the mask leaves no pixel that was measured".to_string());
            }
        }
        if let Some([low, high]) = self.range
            && (low.is_nan() || high.is_nan() || low >= high)
        {
            return refuse(format!("values from {low} to {high}: give a smaller number first"));
        }
        Ok(())
    }

    /// The problem of it, with x = 0 at the start or as given.
    ///
    /// # Errors
    /// As [`Model::check`], and [`Form::Held`] where the data term cannot be held.
    pub fn build(&self, start: Option<&[f64]>) -> Result<Restoration, ImageError> {
        self.check()?;
        let mut field = Field::new(self.width, self.height, self.channels.len(), &self.psf, self.edges);
        let whole = self.edges == Edges::Periodic && self.mask.is_none();
        if self.form == Form::Held && !whole {
            let text =
                "the data term can be held by the global step only where every pixel of a periodic image is known";
            return Err(ImageError(text.to_string()));
        }
        let held = whole && self.form != Form::Split;
        let blurs = self.psf.weights.len() > 1;
        field.carries = !held && blurs;
        let planes: Vec<&[f64]> = self.channels.iter().map(Vec::as_slice).collect();
        let observed = field.embed(&planes, 0.0);
        let (grid, n) = (field.grid, field.grid.len());
        let tv = TotalVariation { lambda: 1.0, norm: self.norm };
        let gradient = GradientTerm::new(grid, Boundary::Periodic, 0, tv, self.penalty);
        let mut terms: Vec<Box<dyn Term>> = vec![Box::new(gradient)];
        let mut symbols = vec![Symbol::Laplacian];
        let mut quadratic = Quadratic::default();
        let data = held.then(|| {
            let (fourier, kernel) = (field.fourier.clone(), field.kernel.clone());
            BlurredSquares::new(grid, fourier, kernel, observed.clone(), self.lambda)
        });
        if let Some(data) = &data {
            quadratic.potentials.push(Arc::new(data.clone()));
        } else {
            let ones = vec![1.0; self.width * self.height];
            let mask = self.mask.as_ref().unwrap_or(&ones);
            let mut lambda = field.embed(&vec![mask.as_slice(); self.channels.len()], 0.0);
            lambda.iter_mut().for_each(|l| *l *= self.lambda);
            let (observed, lambda) = (Observed::new(grid, observed), Observed::new(grid, lambda));
            let squares = Squares { observed, lambda, most: self.lambda };
            let first = if field.carries { n } else { 0 };
            // Where the data term's own curvature 2 lambda and the penalty are alike, neither of the two is waited for.
            terms.push(Box::new(PixelTerm::new(grid, first, squares, self.data_penalty())));
            symbols.push(if field.carries { Symbol::Blurred } else { Symbol::Identity });
        }
        if let Some([low, high]) = self.range {
            terms.push(Box::new(PixelTerm::new(grid, 0, Interval { low, high }, self.data_penalty())));
            symbols.push(Symbol::Identity);
        }
        let step = match data {
            Some(data) => FourierStep::with_data(data, symbols),
            None if field.carries => {
                FourierStep::with_blurred(grid, field.fourier.clone(), field.kernel.clone(), symbols)
            }
            None => FourierStep::of_terms(grid, field.fourier.clone(), symbols),
        };
        let mut x0 = start.map_or_else(|| vec![0.0; n], <[f64]>::to_vec);
        if x0.len() != n {
            return Err(ImageError(format!("a start of {} numbers for a field of {n}", x0.len())));
        }
        if field.carries {
            let mut y = vec![0.0; n];
            crate::convolve(grid, &field.fourier, &field.kernel, false, &x0, &mut y);
            x0.extend(y);
        }
        let problem = Problem { dim: 1, n_free: x0.len(), x0, terms, quadratic, barrier: false };
        Ok(Restoration { problem, step, field })
    }

    /// The penalty of the data term, where it is split.
    fn data_penalty(&self) -> f64 {
        /// Of 2 lambda.
        const PART: f64 = 0.1;
        self.data_penalty.unwrap_or_else(|| (PART * 2.0 * self.lambda).max(self.penalty))
    }
}

/// rho = 5.5 over the standard deviation of the image: the threshold 1/rho of the gradient is then a typical step of it. 20
/// for `camera`.
pub fn natural_penalty(channels: &[Vec<f64>]) -> f64 {
    const STEPS: f64 = 5.5;
    let n: usize = channels.iter().map(Vec::len).sum();
    let mean = |plane: &Vec<f64>| plane.iter().sum::<f64>() / plane.len().max(1) as f64;
    let square = |plane: &Vec<f64>| {
        let mean = mean(plane);
        plane.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>()
    };
    let deviation = (channels.iter().map(square).sum::<f64>() / n.max(1) as f64).sqrt();
    // An image of one colour is its own solution under any penalty.
    if deviation > 0.0 { STEPS / deviation } else { 1.0 }
}

impl Restoration {
    /// The problem put under an iteration.
    ///
    /// # Errors
    /// Settings that the splitting refuses.
    pub fn method(self, name: &str, iteration: Iteration) -> Result<Box<dyn Method>, SystemError> {
        let global = Box::new(self.step);
        let settings = AdmmSettings { name: name.to_string(), global, reweighting: None, renewed_at: None };
        let admm = Admm::new(self.problem, settings)?;
        let relaxed = |admm: Admm, relaxation: f64| admm.with_cycle(Cycle { relaxation, ..Cycle::PLAIN });
        Ok(match iteration {
            Iteration::Admm { relaxation } => Box::new(relaxed(admm, relaxation)?),
            Iteration::Fast => {
                let by = Extrapolation::Momentum { eta: 0.999, corrected: false };
                Acceleration { algorithm: Algorithm::One, by, history: History::AsPublished }.of(admm)?
            }
            Iteration::Anderson { window, both, relaxation } => {
                let algorithm = if both { Algorithm::One } else { Algorithm::DouglasRachford };
                Acceleration::anderson(algorithm, window).of(relaxed(admm, relaxation)?)?
            }
        })
    }
}
