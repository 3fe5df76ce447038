//! Their arguments.

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::settings::{BoundaryName, DataName, RegulariserName, RestoreMethod, RestoreSettings, VariationName};

use crate::args::{RunArgs, pair};
use crate::refusal::Refusal;

/// The arguments of `proxel deblur`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel deblur photo.png --psf kernel.png --out sharp.png
  proxel deblur scan.tif --psf gaussian:1.6 --out sharp.tif --report r.json
  proxel deblur shake.jpg --psf motion:15,30 --noise 0.01 --out still.png
  proxel deblur small.png --psf gaussian:1 --scale 2 --out large.png
  proxel deblur f.npy --psf kernel.txt --boundary periodic --lambda 400 --truth x.png --trace t.csv --out x.npy

Pixels are taken as linear: integers of n bits over 2^n - 1. Minimises lambda |K x - f|^2 + sum |grad x|. The trace has the
duality gap, and with --truth the PSNR.")]
pub struct DeblurArgs {
    /// The blurred image: .png, .tif, .jpg, .npy or text.
    #[arg(value_name = "IMAGE", required_unless_present = "show_settings")]
    pub image: Option<PathBuf>,
    /// The point spread function: an image, .npy or text file, or gaussian:S, motion:LENGTH,ANGLE or disk:R, in pixels and
    /// degrees. It is divided by its sum.
    #[arg(long, value_name = "PSF", required_unless_present = "show_settings")]
    pub psf: Option<String>,
    /// Row and column of its centre, from 0; floor(n/2) in both directions if not given.
    #[arg(long, value_name = "ROW,COLUMN")]
    pub psf_center: Option<String>,
    #[command(flatten)]
    pub restore: RestoreArgs,
}

/// The arguments of `proxel denoise`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel denoise grainy.png --out smooth.png
  proxel denoise photons.tif --data poisson --lambda 30 --out smooth.tif
  proxel denoise specks.png --data huber --lambda 20 --out clean.png
  proxel denoise grainy.tif --noise 0.05 --variation channels --out smooth.tif

Minimises lambda |x - f|^2 + sum |grad x|.")]
pub struct DenoiseArgs {
    /// The noisy image: .png, .tif, .jpg, .npy or text.
    #[arg(value_name = "IMAGE", required_unless_present = "show_settings")]
    pub image: Option<PathBuf>,
    #[command(flatten)]
    pub restore: RestoreArgs,
}

/// The arguments of `proxel inpaint`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel inpaint scratched.png --mask good.png --lambda 1000 --out whole.png

Minimises lambda |M (x - f)|^2 + sum |grad x|.")]
pub struct InpaintArgs {
    /// The image with gaps: .png, .tif, .jpg, .npy or text.
    #[arg(value_name = "IMAGE", required_unless_present = "show_settings")]
    pub image: Option<PathBuf>,
    /// An image of the same size that is 0 in the gaps and more elsewhere; its first channel counts.
    #[arg(long, value_name = "MASK", required_unless_present = "show_settings")]
    pub mask: Option<PathBuf>,
    #[command(flatten)]
    pub restore: RestoreArgs,
}

/// What they share.
#[derive(Args)]
pub struct RestoreArgs {
    /// The result: .png, .tif or .npy. Bit depth, alpha, EXIF and ICC profile are those of the image.
    #[arg(long, short, value_name = "FILE", required_unless_present = "show_settings")]
    pub out: Option<PathBuf>,
    /// The image that is to be found, to measure against.
    #[arg(long, value_name = "IMAGE")]
    pub truth: Option<PathBuf>,
    #[command(flatten)]
    pub run: RunArgs,
    #[command(flatten)]
    pub method: RestoreMethodArgs,
}

/// How it is solved.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub struct RestoreMethodArgs {
    /// auto: the fastest; admm; relaxed: with over-relaxation; fast: with momentum and restart; aa: Anderson on grad x + u;
    /// aa-zu: on z and u.
    #[arg(long, value_name = "NAME", value_parser = methods(), default_value = RestoreMethod::default().as_str())]
    pub method: String,
    /// Standard deviation of the noise, for pixels from 0 to 1, or auto: estimated. With --data poisson that of a pixel of
    /// value 1: the root of the value of one count.
    #[arg(long, value_name = "auto|SIGMA", default_value = "auto", allow_negative_numbers = true)]
    pub noise: String,
    /// Weight of what was seen, or auto: by an estimate of the risk.
    #[arg(long, value_name = "auto|L", default_value = "auto", allow_negative_numbers = true)]
    pub lambda: String,
    /// What lies beyond the border. periodic: the image again; neumann: its mirror image, for blurs that are symmetric; unknown:
    /// nobody knows, which without a blur is neumann; auto: unknown.
    #[arg(long, value_name = "NAME", value_parser = boundaries(), default_value = BoundaryName::default().as_str())]
    pub boundary: String,
    /// How what was seen is compared. quadratic: normal noise; poisson: counted light, with lambda = 1 / (value of one count);
    /// huber: outliers.
    #[arg(long, value_name = "NAME", value_parser = data(), default_value = DataName::default().as_str())]
    pub data: String,
    /// What huber takes for a small difference, or auto: 1.345 times the noise.
    #[arg(long, value_name = "auto|D", default_value = "auto", allow_negative_numbers = true)]
    pub threshold: String,
    /// Find S times the rows and columns: each pixel that was seen is the mean of S x S pixels of the result. A point spread
    /// function is in pixels of the result.
    #[arg(long, value_name = "S", default_value_t = RestoreSettings::default().scale)]
    pub scale: usize,
    /// What is asked of the image. tv: total variation, flat pieces; tgv: second-order total generalised variation, pieces whose
    /// slope is constant; frame: local cosines, fine texture; auto: tv, or frame where --lambda is auto too, under a blur, and
    /// the estimated risk of frame is less. tgv and frame have no --boundary neumann.
    #[arg(long, value_name = "NAME", value_parser = regularisers(), default_value = RegulariserName::default().as_str())]
    pub regulariser: String,
    /// What a change of slope costs in tgv, over a step: in pixels.
    #[arg(long, value_name = "R", default_value_t = RestoreSettings::default().tgv_ratio, allow_negative_numbers = true)]
    pub tgv_ratio: f64,
    /// Solve for images with more rows or columns than N in overlapping parts of at most N x N, one after another: memory goes
    /// by a part. auto: images that would take more than 4 GiB, in parts that take that.
    #[arg(long, value_name = "auto|N", default_value = "auto", allow_negative_numbers = true)]
    pub tile: String,
    /// vectorial: edges of all colours at one place; channels: each colour by itself; anisotropic: rows and columns by
    /// themselves.
    #[arg(long, value_name = "NAME", value_parser = variations(), default_value = VariationName::default().as_str())]
    pub variation: String,
    /// Least and largest value that the result may have, such as 0,inf.
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true)]
    pub range: Option<[f64; 2]>,
    /// Penalty of the splitting, or auto: by the contrast of the image.
    #[arg(long, value_name = "auto|RHO", default_value = "auto", allow_negative_numbers = true)]
    pub penalty: String,
    /// Over-relaxation of relaxed and aa.
    #[arg(long, value_name = "A", default_value_t = RestoreSettings::default().relaxation, allow_negative_numbers = true)]
    pub relaxation: f64,
    /// Columns of Anderson's history.
    #[arg(long, value_name = "M", default_value_t = RestoreSettings::default().anderson)]
    pub anderson: usize,
    /// Stop after so many iterations.
    #[arg(long, value_name = "N", default_value_t = RestoreSettings::default().max_iters)]
    pub max_iters: usize,
    /// Converged when the duality gap is below T times the objective; with --range or --data poisson, when primal and dual
    /// residual are below T.
    #[arg(long, value_name = "T", default_value = format!("{:e}", RestoreSettings::default().tol), allow_negative_numbers = true)]
    pub tol: f64,
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(RestoreMethod::ALL.map(RestoreMethod::as_str))
}

fn boundaries() -> PossibleValuesParser {
    PossibleValuesParser::new(BoundaryName::ALL.map(BoundaryName::as_str))
}

fn data() -> PossibleValuesParser {
    PossibleValuesParser::new(DataName::ALL.map(DataName::as_str))
}

fn regularisers() -> PossibleValuesParser {
    PossibleValuesParser::new(RegulariserName::ALL.map(RegulariserName::as_str))
}

fn variations() -> PossibleValuesParser {
    PossibleValuesParser::new(VariationName::ALL.map(VariationName::as_str))
}

/// A number, or none for auto.
fn auto_or(option: &str, text: &str) -> Result<Option<f64>, Refusal> {
    if text == "auto" {
        return Ok(None);
    }
    text.parse().map(Some).map_err(|_| Refusal::new(format!("{option} is `{text}`; give auto or a positive number")))
}

/// Pixels, or none for auto.
fn tile(text: &str) -> Result<Option<usize>, Refusal> {
    if text == "auto" {
        return Ok(None);
    }
    text.parse().map(Some).map_err(|_| Refusal::new(format!("--tile is `{text}`; give auto or a number of pixels")))
}

impl RestoreArgs {
    /// Settings and what they cannot be.
    pub fn settings(&self) -> Result<RestoreSettings, Refusal> {
        self.run.check()?;
        let m = &self.method;
        let settings = RestoreSettings {
            // Clap lets no other names through.
            method: RestoreMethod::from_name(&m.method).unwrap_or_default(),
            boundary: BoundaryName::from_name(&m.boundary).unwrap_or_default(),
            data: DataName::from_name(&m.data).unwrap_or_default(),
            threshold: auto_or("--threshold", &m.threshold)?,
            scale: m.scale,
            regulariser: RegulariserName::from_name(&m.regulariser).unwrap_or_default(),
            tgv_ratio: m.tgv_ratio,
            tile: tile(&m.tile)?,
            noise: auto_or("--noise", &m.noise)?,
            lambda: auto_or("--lambda", &m.lambda)?,
            variation: VariationName::from_name(&m.variation).unwrap_or_default(),
            range: m.range,
            penalty: auto_or("--penalty", &m.penalty)?,
            relaxation: m.relaxation,
            anderson: m.anderson,
            tol: m.tol,
            max_iters: m.max_iters,
            time_limit: self.run.time_limit,
            threads: self.run.threads,
        };
        settings.check().map_err(Refusal::new)?;
        Ok(settings)
    }
}
