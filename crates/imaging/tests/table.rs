//! Counts of iterations that another implementation has measured on the same image, where the image is at hand.

use proxel_imaging::io::read_image;
use proxel_imaging::{
    Blur, BlurredSquares, Boundary, Fourier, FourierStep, GradientTerm, Grid, Observed, PixelTerm, Psf, Squares,
    Symbol, TotalVariation,
};
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Extrapolation, History, LocalReport, Method, Problem,
    Quadratic, Term, normalized,
};
use std::path::PathBuf;
use std::sync::Arc;

const LAMBDA: f64 = 400.0;

struct Given {
    grid: Grid,
    observed: Vec<f64>,
    fourier: Fourier,
    spectrum: Arc<Vec<realfft::num_complex::Complex<f64>>>,
}

/// `camera` of scikit-image, blurred by the snake with a periodic boundary, with normal noise of .01: float64.
fn given() -> Option<Given> {
    let folder = PathBuf::from(std::env::var_os("PROXEL_DATA")?).join("imaging");
    let (image, psf) = (folder.join("camera-snake15.npy"), folder.join("snake15.txt"));
    if !(image.exists() && psf.exists()) {
        return None;
    }
    let image = read_image(&image).expect("an image").image;
    let psf = read_image(&psf).expect("a matrix").image;
    let psf = Psf::new(psf.width, psf.height, psf.channels[0].clone(), None).expect("a kernel");
    let fourier = Fourier::new(image.width, image.height);
    let spectrum = Arc::new(psf.spectrum(&fourier));
    let grid = Grid::new(image.width, image.height);
    Some(Given { grid, observed: image.channels[0].clone(), fourier, spectrum })
}

impl Given {
    fn admm(&self, rho: f64, relaxation: f64, carried: bool) -> Admm {
        let tv = TotalVariation::isotropic(1.0);
        let gradient = GradientTerm::new(self.grid, Boundary::Periodic, 0, tv, rho);
        let (n, mut terms): (usize, Vec<Box<dyn Term>>) = (self.grid.len(), vec![Box::new(gradient)]);
        let mut quadratic = Quadratic::default();
        let (global, n) = if carried {
            let observed = Observed::new(self.grid, self.observed.clone());
            let squares = Squares { observed, lambda: Observed::new(self.grid, vec![LAMBDA; n]), most: LAMBDA };
            terms.push(Box::new(PixelTerm::new(self.grid, n, squares, rho)));
            let symbols = vec![Symbol::Laplacian, Symbol::Blurred];
            (FourierStep::with_blurred(self.grid, self.fourier.clone(), self.spectrum.clone(), symbols), 2 * n)
        } else {
            let (fourier, spectrum) = (self.fourier.clone(), self.spectrum.clone());
            let data = BlurredSquares::new(
                self.grid,
                Blur::Periodic { fourier, kernel: spectrum },
                self.observed.clone(),
                LAMBDA,
            );
            quadratic.potentials.push(Arc::new(data.clone()));
            (FourierStep::with_data(data, vec![Symbol::Laplacian]).expect("periodic"), n)
        };
        let problem = Problem { dim: 1, n_free: n, x0: vec![0.0; n], terms, quadratic, barrier: false };
        let global = Box::new(global);
        let settings = AdmmSettings { name: "tv".to_string(), global, reweighting: None, renewed_at: None };
        let cycle = Cycle { relaxation, ..Cycle::PLAIN };
        Admm::new(problem, settings).and_then(|admm| admm.with_cycle(cycle).map_err(Into::into)).expect("a method")
    }
}

/// Iterations until the combined residual is below each level, those that were taken back too. The local step of x_k,
/// z_(k-1), u_(k-1) is the first half of our iteration k + 1, which is entered at z: the residual of another
/// implementation's iteration k is known then.
///
/// Where `image` has a cycle, it is the residual of what that makes of the image of the last point: a v that was proposed has
/// a z by the prox, which the one that rides along with it is not.
fn counts<const N: usize>(method: &mut dyn Method, levels: [f64; N], image: Option<Cycle>) -> [usize; N] {
    let n = method.problem().local_dim();
    let (mut reached, mut refused) = ([0; N], 0);
    for iteration in 0..700 {
        let report = method.step().expect("a step");
        refused += report.trial.rejected;
        let (local, iteration) = match &image {
            Some(cycle) => (local_of_image(method, cycle), iteration + 1),
            None => (report.local, iteration),
        };
        let residual = normalized(local.combined(), n, 1.0);
        for (reached, level) in reached.iter_mut().zip(levels) {
            if *reached == 0 && iteration > 0 && residual < level {
                *reached = iteration + refused;
            }
        }
        if reached.iter().all(|r| *r > 0) {
            break;
        }
    }
    reached
}

/// The local step that would follow, on copies.
fn local_of_image(method: &mut dyn Method, cycle: &Cycle) -> LocalReport {
    let at = method.splitting().expect("a splitting");
    let (mut p, mut u, mut grad) = (at.p[0].clone(), at.u[0].clone(), vec![0.0; at.x.len()]);
    at.problem.terms[0].cycle_step(cycle, at.x, &mut p, &mut u, &mut grad)
}

#[test]
fn iterations_are_those_of_another_implementation() {
    let Some(given) = given() else {
        eprintln!("skipped: PROXEL_DATA names no folder with imaging/camera-snake15.npy and imaging/snake15.txt");
        return;
    };
    let fast = Extrapolation::Momentum { eta: Some(0.999), corrected: false };
    let fast = |algorithm| Some(Acceleration { algorithm, by: fast, history: History::AsPublished });
    let anderson = |algorithm| Some(Acceleration::anderson(algorithm, 6));
    let (v, both) = (Algorithm::DouglasRachford, Algorithm::One);
    type Row = (&'static str, f64, f64, bool, Option<Acceleration>, [usize; 3]);
    let rows: [Row; 11] = [
        ("both split, admm", 30.0, 1.0, true, None, [33, 94, 166]),
        ("both split, aa", 30.0, 1.0, true, anderson(both), [26, 62, 106]),
        ("v, admm", 20.0, 1.0, false, None, [8, 34, 147]),
        ("v, relaxed", 20.0, 1.8, false, None, [9, 24, 85]),
        ("v, fast", 20.0, 1.0, false, fast(v), [11, 28, 98]),
        ("v, aa", 20.0, 1.0, false, anderson(v), [7, 26, 104]),
        ("v, aa, relaxed", 20.0, 1.8, false, anderson(v), [8, 25, 90]),
        // By a recurrence written out in numpy, with alpha one ahead: the first half-iteration is none of its.
        ("(z, u), fast", 20.0, 1.0, false, fast(both), [13, 28, 106]),
        ("(z, u), aa", 20.0, 1.0, false, anderson(both), [8, 30, 135]),
        ("v, admm", 100.0, 1.0, false, None, [10, 69, 249]),
        ("v, relaxed", 100.0, 1.8, false, None, [11, 58, 182]),
    ];
    let mut wrong = Vec::new();
    for (name, rho, relaxation, carried, acceleration, expected) in rows {
        let admm = given.admm(rho, relaxation, carried);
        let mut method: Box<dyn Method> = match acceleration {
            Some(acceleration) => acceleration.of(admm).expect("an acceleration"),
            None => Box::new(admm),
        };
        let image = acceleration.filter(|by| by.algorithm == v).map(|_| Cycle { relaxation, ..Cycle::PLAIN });
        let got = counts(&mut *method, [1e-2, 1e-3, 1e-4], image);
        let text = format!("{name}, rho {rho}: {got:?}, elsewhere {expected:?}");
        println!("{text}");
        // Within a tenth, and one iteration where a tenth is less.
        if got.iter().zip(expected).any(|(got, expected)| got.abs_diff(expected) > (expected / 10).max(1)) {
            wrong.push(text);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
