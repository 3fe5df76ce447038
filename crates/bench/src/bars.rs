//! The bars of Zhang et al. 2019, Figures 2 and 3: generated, a step in time after another.

use crate::BenchError;
use proxel::mesh::generate::{Bars, bars};
use proxel::model::elements::{Batch, BatchShape, BatchWeights, Stiffness, batch};
use proxel::model::energy::Lame;
use proxel::split::{Admm, AdmmSettings, Direct, Inertia, Method, Problem, Quadratic, Term};

/// Seconds of a step.
pub const DT: f64 = 1.0 / 30.0;
/// Acceleration of free vertices along y.
const GRAVITY: f64 = -9.8;
/// Metres a second by which each end moves outwards.
const PULL: f64 = 1.0;
/// kg/m^3
const DENSITY: f64 = 1522.0;
/// Young's modulus, Pa.
const YOUNG: f64 = 1e7;
/// Of the bars from above.
const ENERGIES: [&str; 3] = ["corotated", "neo-hookean", "stvk"];

/// A step of implicit Euler for bars whose ends are pulled apart: min 1/(2 dt^2) |x - x~|_M^2 + sum g(z), A(28).
pub struct Scene {
    /// The bars at rest.
    pub bars: Bars,
    /// Their material.
    pub lame: Lame,
    /// Positions, those of free vertices first.
    x: Vec<f64>,
    v: Vec<f64>,
    /// The frame that comes next, from 1; at frame k each end has moved (k + 1) dt.
    frame: usize,
    /// Factor of the squared weights: mu.
    pub mu: f64,
    /// What they are over the volume.
    pub weights: Weights,
}

/// Squared weights over volume: the stiffness of an element, W of A(28) squared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weights {
    /// The bulk modulus k whatever the energy, as in the authors' implementation.
    #[default]
    Bulk,
    /// The largest eigenvalue of the energy's Hessian at rest.
    Largest,
    /// The geometric mean of the largest and the least.
    Mean,
    /// The slope fit of Liu, Bouaziz and Kavan 2017.
    Slope,
}

impl Weights {
    /// All of them.
    pub const ALL: [Weights; 4] = [Weights::Bulk, Weights::Largest, Weights::Mean, Weights::Slope];

    /// As in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Weights::Bulk => "bulk modulus",
            Weights::Largest => "largest eigenvalue",
            Weights::Mean => "mean eigenvalue",
            Weights::Slope => "slope fit",
        }
    }

    fn of(self, stiffness: Stiffness, lame: &Lame) -> f64 {
        match self {
            Weights::Bulk => lame.bulk(),
            Weights::Largest => stiffness.largest,
            Weights::Mean => stiffness.mean,
            Weights::Slope => stiffness.slope,
        }
    }
}

impl Scene {
    /// Three bars of 12 x 3 x 3 cubes, 4 m long, or a single one of `cells`; Poisson's ratio as given.
    ///
    /// # Errors
    /// A ratio that belongs to no material.
    pub fn new(poisson: f64, cells: [usize; 3]) -> Result<Self, BenchError> {
        let bars = bars(ENERGIES.len(), cells, 4.0 / cells[0] as f64, 1.75).map_err(BenchError::from_display)?;
        let lame = Lame::from_young_poisson(YOUNG, poisson).map_err(BenchError::from_display)?;
        let x: Vec<f64> = bars.vertices.iter().flatten().copied().collect();
        let mut scene = Scene { v: vec![0.0; x.len()], x, bars, lame, frame: 1, mu: 1.0, weights: Weights::Bulk };
        scene.pull();
        Ok(scene)
    }

    /// Each end moves outwards as far as it does in a step.
    fn pull(&mut self) {
        let fixed = 3 * self.bars.n_free;
        self.x[fixed..].chunks_exact_mut(3).for_each(|p| p[0] += (PULL * DT).copysign(p[0]));
    }

    /// What the step of the next frame begins with: x~ = x + dt v of free vertices under gravity, ends moved.
    fn start(&self) -> Vec<f64> {
        let fixed = 3 * self.bars.n_free;
        let mut start = self.x.clone();
        for (i, x) in start.iter_mut().enumerate() {
            if i < fixed {
                *x += DT * (self.v[i] + if i % 3 == 1 { DT * GRAVITY } else { 0.0 });
            } else if i % 3 == 0 {
                *x += (PULL * DT).copysign(*x);
            }
        }
        start
    }

    /// The problem of the next frame.
    ///
    /// # Errors
    /// Elements that cannot be used.
    pub fn problem(&self) -> Result<Problem, BenchError> {
        let n_free = self.bars.n_free;
        let x0 = self.start();
        let rest: Vec<f64> = self.bars.vertices.iter().flatten().copied().collect();
        let weights = |stiffness: Stiffness| BatchWeights {
            base: self.mu * self.weights.of(stiffness, &self.lame),
            softening: 1.0,
        };
        let term = |(tets, energy): (&Vec<[u32; 4]>, &str)| -> Result<Box<dyn Term>, BenchError> {
            let of = Batch {
                shape: BatchShape::Tetrahedra,
                positions: &rest,
                flattened: None,
                elements: tets.as_flattened(),
                fill: None,
                energy,
                lame: &self.lame,
                limits: None,
                rotation_aware: false,
                singular_values: false,
                weights: &weights,
            };
            Ok(batch(&of).map_err(BenchError::from_display)?.0)
        };
        let terms = self.bars.tets.iter().zip(ENERGIES).map(term).collect::<Result<_, _>>()?;
        let stiffness = self.bars.masses(DENSITY)[..n_free].iter().map(|m| m / (DT * DT)).collect();
        let inertia = Inertia::new(stiffness, x0[..3 * n_free].to_vec(), 3).map_err(BenchError::from_display)?;
        let quadratic = Quadratic { inertia, ..Quadratic::default() };
        Ok(Problem { dim: 3, n_free, x0, terms, quadratic, barrier: false })
    }

    /// Plain ADMM on it.
    ///
    /// # Errors
    /// A problem that does not fit together.
    pub fn admm(&self) -> Result<Admm, BenchError> {
        let settings =
            AdmmSettings { name: "admm".to_string(), global: Box::new(Direct), reweighting: None, renewed_at: None };
        Admm::new(self.problem()?, settings).map_err(BenchError::from_display)
    }

    /// Solves the next frame by so many plain iterations and goes on to the one after.
    ///
    /// # Errors
    /// A step that fails.
    pub fn advance(&mut self, iterations: usize) -> Result<(), BenchError> {
        let mut admm = self.admm()?;
        for _ in 0..iterations {
            admm.step().map_err(BenchError::from_display)?;
        }
        let free = 3 * self.bars.n_free;
        for i in 0..free {
            self.v[i] = (admm.x()[i] - self.x[i]) / DT;
        }
        self.x.copy_from_slice(admm.x());
        self.frame += 1;
        Ok(())
    }

    /// Positions of all vertices, ends where the frame before has left them.
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.x.as_chunks::<3>().0.to_vec()
    }

    /// Velocities of all vertices.
    pub fn velocities(&self) -> Vec<[f64; 3]> {
        self.v.as_chunks::<3>().0.to_vec()
    }

    /// The frame that comes next.
    pub fn frame(&self) -> usize {
        self.frame
    }
}
