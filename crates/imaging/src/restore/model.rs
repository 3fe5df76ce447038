//! What is known of an image, and the problem made of it.

use super::{Data, Edges, Field, Form, Regulariser, Restoration};
use crate::{
    Bends, Blur, BlurredSquares, CosineStep, FourierStep, GradientTerm, Grid, Huber, Image, ImageError, Interval,
    LocalCosines, Norm, Observed, PixelTerm, Pointwise, Poisson, Psf, SecondOrderStep, Shrinkage, Slopes, Squares,
    StencilTerm, Symbol, TotalVariation,
};
use proxel_split::{GlobalStep, Problem, Quadratic, Term};
use std::borrow::Cow;
use std::sync::Arc;

/// What is known of an image.
#[derive(Clone, Debug)]
pub struct Model {
    /// Columns of what was seen.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What was seen, a plane a channel.
    pub channels: Vec<Vec<f64>>,
    /// The blur, in pixels of what is sought.
    pub psf: Psf,
    /// How it is compared.
    pub data: Data,
    /// Each pixel of what was seen is the mean of so many by so many of what is sought, after the blur; 1 for as many.
    pub scale: usize,
    /// What lies beyond the border.
    pub edges: Edges,
    /// 1 where a pixel was measured, 0 where it was not; all of them where there is no mask.
    pub mask: Option<Vec<f64>>,
    /// lambda
    pub lambda: f64,
    /// What is asked of the image itself.
    pub regulariser: Regulariser,
    /// Which differences of a pixel count together.
    pub norm: Norm,
    /// Values that the image may have; any where there are none.
    pub range: Option<[f64; 2]>,
    /// How the data term is split.
    pub form: Form,
    /// 5.5 over the standard deviation of the image, by which penalties are chosen: see [`natural_penalty`].
    pub natural: f64,
    /// 1 over the root mean square of the steps between neighbours, likewise.
    pub steep: f64,
    /// Penalty rho, the squared weight of the gradient term; by [`Model::penalties`] if none.
    pub penalty: Option<f64>,
    /// That of the data term where it is split, and of the range; likewise.
    pub data_penalty: Option<f64>,
}

/// The penalty of E w over that of grad x - w.
const BEND: f64 = 1.0;

/// The largest [`Model::scale`].
pub const MOST_SCALE: usize = 8;

impl Model {
    /// Of an image: nothing is masked, any value is allowed.
    pub fn new(image: &Image, psf: Psf, edges: Edges, lambda: f64) -> Self {
        Model {
            width: image.width,
            height: image.height,
            channels: image.channels.clone(),
            psf,
            data: Data::Squares,
            scale: 1,
            edges,
            mask: None,
            lambda,
            regulariser: Regulariser::Tv,
            norm: Norm::Vectorial,
            range: None,
            form: Form::Auto,
            natural: natural_penalty(&image.channels),
            steep: steepness(image),
            penalty: None,
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
        if let Some(p) = [self.penalty, self.data_penalty].into_iter().flatten().find(|p| !(*p > 0.0 && p.is_finite()))
        {
            return refuse(format!("a penalty is {p}; it has to be positive"));
        }
        if !(1..=MOST_SCALE).contains(&self.scale) {
            return refuse(format!("the scale is {}; it can be 1 to {MOST_SCALE}", self.scale));
        }
        if self.scale > 1 && self.edges == Edges::Neumann {
            let text = "a finer image cannot be found with --boundary neumann, since means over pixels are not symmetric about one; \
                take --boundary unknown";
            return refuse(text.to_string());
        }
        if let Regulariser::Tgv { ratio } = self.regulariser {
            if !(ratio > 0.0 && ratio.is_finite()) {
                return refuse(format!("the ratio of total generalised variation is {ratio}; it has to be positive"));
            }
            if self.edges == Edges::Neumann {
                let text = "total generalised variation cannot be had with --boundary neumann, since no cosine transform makes it \
                    diagonal; take --boundary unknown";
                return refuse(text.to_string());
            }
        }
        if self.regulariser == Regulariser::Frame && self.edges == Edges::Neumann {
            let text = "a frame of local cosines cannot be had with --boundary neumann, since it wraps around; take --boundary unknown";
            return refuse(text.to_string());
        }
        match self.data {
            Data::Huber { delta } if !(delta > 0.0 && delta.is_finite()) => {
                return refuse(format!("the threshold of large differences is {delta}; it has to be positive"));
            }
            Data::Poisson => {
                let negative = |plane: &Vec<f64>| plane.iter().position(|v| *v < 0.0);
                let found = self.channels.iter().enumerate().find_map(|(c, plane)| Some((c, plane, negative(plane)?)));
                if let Some((c, plane, k)) = found {
                    let (row, column) = (k / self.width.max(1), k % self.width.max(1));
                    return refuse(format!(
                        "channel {c}, row {row}, column {column}: {} is no count of light; data that are Poisson's are not \
                         negative",
                        plane[k]
                    ));
                }
            }
            _ => {}
        }
        let (width, height, psf) = (self.width * self.scale, self.height * self.scale, &self.psf);
        if psf.width > width || psf.height > height {
            let size = format!("{} x {}", psf.width, psf.height);
            return refuse(format!("the point spread function has {size} pixels, the image {width} x {height}"));
        }
        if let Some(mask) = &self.mask {
            if mask.len() != self.width * self.height {
                let (w, h) = (self.width, self.height);
                return refuse(format!("the mask has {} pixels, the image {w} x {h}", mask.len()));
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
        let psf = self.whole_psf()?;
        let (width, height) = (self.width * self.scale, self.height * self.scale);
        let mut field = Field::new(width, height, self.channels.len(), &psf, self.edges)?;
        field.step = self.scale;
        let values = self.channels.iter().flatten();
        field.values = values.fold(field.values, |[low, high], v| [low.min(*v), high.max(*v)]);
        let held = self.holds();
        if self.form == Form::Held && !held {
            let text = "the data term can be held by the global step only where it is a sum of squares over all pixels of an \
                image whose border is known";
            return Err(ImageError(text.to_string()));
        }
        field.carries = !held && psf.weights.len() > 1;
        let planes: Vec<&[f64]> = self.channels.iter().map(Vec::as_slice).collect();
        let observed = field.embed(&planes, 0.0);
        let (grid, n) = (field.grid, field.grid.len());
        let (penalty, data_penalty) = self.penalties();
        let tv = TotalVariation { lambda: 1.0, norm: self.norm, within: field.window(false) };
        let mut terms: Vec<Box<dyn Term>> = Vec::new();
        let mut symbols = Vec::new();
        if let Regulariser::Tgv { ratio } = self.regulariser {
            let slopes = n * if field.carries { 2 } else { 1 };
            let norm = if self.norm == Norm::Channels { Norm::Triples } else { self.norm };
            let bent = TotalVariation { lambda: ratio, norm, within: field.window(true) };
            terms.push(Box::new(StencilTerm::new(grid, Slopes { slopes }, tv, penalty)));
            terms.push(Box::new(StencilTerm::new(grid, Bends { slopes }, bent, BEND * penalty)));
            field.slopes = true;
        } else if self.regulariser == Regulariser::Frame {
            let within = field.surroundings(LocalCosines::SIDE);
            let joint = self.norm == Norm::Vectorial;
            let shrinkage = Shrinkage { weights: Arc::new(frame_weights()), joint, within };
            field.frame = Some(shrinkage.clone());
            terms.push(Box::new(StencilTerm::new(grid, LocalCosines::default(), shrinkage, penalty)));
            symbols.push(Symbol::Identity); // the frame is tight
        } else {
            terms.push(Box::new(GradientTerm::new(grid, field.blur.boundary(), 0, tv, penalty)));
            symbols.push(Symbol::Laplacian);
            field.variation = Some(tv);
        }
        let mut quadratic = Quadratic::default();
        let mut data = None;
        if held {
            let squares = BlurredSquares::new(grid, field.blur.clone(), observed, self.lambda);
            quadratic.potentials.push(Arc::new(squares.clone()));
            field.held = Some(squares.clone());
            data = Some(squares);
        } else {
            let mask =
                self.mask.as_deref().map_or_else(|| Cow::Owned(vec![1.0; self.width * self.height]), Cow::Borrowed);
            let mut lambda = field.embed(&vec![&*mask; self.channels.len()], 0.0);
            field.measured = Arc::new(lambda.iter().map(|l| *l > 0.0).collect());
            lambda.iter_mut().for_each(|l| *l *= self.lambda);
            let first = if field.carries { n } else { 0 };
            terms.push(Box::new(PixelTerm::new(grid, first, self.compared(grid, observed, lambda), data_penalty)));
            symbols.push(if field.carries { Symbol::Blurred } else { Symbol::Identity });
        }
        if let Some([low, high]) = self.range {
            terms.push(Box::new(PixelTerm::new(grid, 0, Interval { low, high }, data_penalty)));
            symbols.push(Symbol::Identity);
        }
        let step = step(&field, data.as_ref(), symbols);
        let mut x0 = start.map_or_else(|| vec![0.0; n], <[f64]>::to_vec);
        if x0.len() != n {
            return Err(ImageError(format!("a start of {} numbers for a field of {n}", x0.len())));
        }
        if field.carries {
            let mut y = vec![0.0; n];
            field.blur.apply(grid, false, &x0, &mut y);
            x0.extend(y);
        }
        if field.slopes {
            x0.resize(x0.len() + 2 * n, 0.0);
        }
        let problem = Problem { dim: 1, n_free: x0.len(), x0, terms, quadratic, barrier: false };
        Ok(Restoration { problem, step, field })
    }

    /// What the values of K x are asked.
    fn compared(&self, grid: Grid, observed: Vec<f64>, lambda: Vec<f64>) -> Box<dyn Pointwise> {
        let (observed, lambda, most) = (Observed::new(grid, observed), Observed::new(grid, lambda), self.lambda);
        match self.data {
            Data::Squares => Box::new(Squares { observed, lambda, most }),
            Data::Poisson => Box::new(Poisson { observed, lambda, most }),
            Data::Huber { delta } => Box::new(Huber { observed, lambda, most, delta }),
        }
    }

    /// The blur, and after it the mean over the pixels that are seen as one.
    ///
    /// # Errors
    /// None that [`Model::check`] has let through.
    pub fn whole_psf(&self) -> Result<Psf, ImageError> {
        if self.scale == 1 { Ok(self.psf.clone()) } else { self.psf.averaged(self.scale) }
    }

    /// The penalties of the gradient term and of the data term, where they are not given: with rho_0 = [`Model::natural`] and
    /// rho_1 = 0.8 [`Model::steep`],
    ///
    /// ```text
    /// no blur, every pixel measured    4 rho_0
    /// no blur, gaps                    rho_0,      max(rho_0 / 2, sqrt(rho_0 lambda) / 10)
    /// a blur, held                     rho_0
    /// a blur, split                    rho_1,      0.23 sqrt(rho_1 lambda); twice as much of both for local cosines
    /// a blur and a finer image         rho_0 / 2,  sqrt(rho_0 lambda) / 10
    /// ```
    ///
    /// Found by counting iterations to a gap of 1e-4 over lambda from 20 to 10^4. A penalty of the data term holds back what
    /// was not measured too, gaps and what lies beyond the border: it may not grow with lambda as the data term's own
    /// curvature does.
    pub fn penalties(&self) -> (f64, f64) {
        let (natural, steep) = (self.natural, 0.8 * self.steep);
        let mean = || {
            let n: usize = self.channels.iter().map(Vec::len).sum();
            self.channels.iter().flatten().sum::<f64>() / n.max(1) as f64
        };
        // That of squares as steep: Poisson's second derivative at the data is lambda / f.
        let lambda = match self.data {
            Data::Poisson if mean() > 0.0 => self.lambda / (2.0 * mean()),
            _ => self.lambda,
        };
        let data = 0.1 * (natural * lambda).sqrt();
        let blurs = self.psf.weights.len() > 1 || self.scale > 1;
        let (gradient, data) = match () {
            () if blurs && self.holds() => (natural, data),
            () if blurs && self.scale == 1 && self.regulariser == Regulariser::Frame => {
                (2.0 * steep, 0.46 * (steep * lambda).sqrt())
            }
            () if blurs && self.scale == 1 => (steep, 0.23 * (steep * lambda).sqrt()),
            () if blurs => (0.5 * natural, data),
            () if self.holds() => (4.0 * natural, data),
            () => (natural, data.max(0.5 * natural)),
        };
        (self.penalty.unwrap_or(gradient), self.data_penalty.unwrap_or(data))
    }

    /// Whether the global step holds the data term.
    fn holds(&self) -> bool {
        let whole = self.edges != Edges::Unknown && self.mask.is_none() && self.scale == 1;
        whole && self.data == Data::Squares && self.form != Form::Split
    }
}

/// rho_0 = 5.5 over the standard deviation of the image: a threshold of the gradient of 1/rho_0 is a typical step of it. 20 for
/// `camera`.
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
    let size = channels.iter().flatten().fold(0.0f64, |size, v| size.max(v.abs()));
    let typical = if deviation > 0.0 { deviation } else { size };
    if typical > 0.0 { STEPS / typical } else { 1.0 }
}

/// 1 over the root mean square of the steps between neighbours. As a threshold of the gradient they are what a blurred image is
/// made of; that of its contrast is too small for fine texture.
fn steepness(image: &Image) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for plane in &image.channels {
        let mut add = |a: f64, b: f64| {
            sum += (a - b) * (a - b);
            count += 1;
        };
        plane.chunks(image.width.max(1)).for_each(|row| row.windows(2).for_each(|w| add(w[0], w[1])));
        plane.iter().zip(plane.iter().skip(image.width)).for_each(|(a, b)| add(*a, *b));
    }
    // Of both directions, as a gradient has them.
    let step = (2.0 * sum / count.max(1) as f64).sqrt();
    if step > 0.0 { 1.0 / step } else { natural_penalty(&image.channels) }
}

/// 1 / sqrt(k^2 + l^2), in the order of [`LocalCosines`]; 0 for the mean. As what is seen of the world has less of what is finer.
fn frame_weights() -> Vec<f64> {
    let m = LocalCosines::SIDE;
    (0..LocalCosines::PLANES).map(|k| if k == 0 { 0.0 } else { 1.0 / ((k / m) as f64).hypot((k % m) as f64) }).collect()
}

/// The global step of a field, with a data term that it holds or none.
fn step(field: &Field, data: Option<&BlurredSquares>, symbols: Vec<Symbol>) -> Box<dyn GlobalStep> {
    let grid = field.grid;
    match &field.blur {
        Blur::Periodic { fourier, kernel } if field.slopes => {
            let held = data.and_then(|data| SecondOrderStep::with_data(data, symbols.clone()));
            let (fourier, kernel) = (fourier.clone(), kernel.clone());
            Box::new(match held {
                Some(held) => held,
                None if field.carries => SecondOrderStep::with_blurred(grid, fourier, kernel, symbols),
                None => SecondOrderStep::of_terms(grid, fourier, symbols),
            })
        }
        Blur::Periodic { fourier, kernel } => {
            let held = data.and_then(|data| FourierStep::with_data(data.clone(), symbols.clone()));
            Box::new(match held {
                Some(held) => held,
                None if field.carries => FourierStep::with_blurred(grid, fourier.clone(), kernel.clone(), symbols),
                None => FourierStep::of_terms(grid, fourier.clone(), symbols),
            })
        }
        Blur::Neumann { cosine, kernel } => {
            let held = data.and_then(|data| CosineStep::with_data(data, symbols.clone()));
            Box::new(match held {
                Some(held) => held,
                None if field.carries => CosineStep::with_blurred(grid, cosine.clone(), kernel.clone(), symbols),
                None => CosineStep::of_terms(grid, cosine.clone(), symbols),
            })
        }
    }
}
