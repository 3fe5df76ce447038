//! Bodies in motion as in Zhang et al. 2019, Figures 4 to 6, a step in time after another: the flag, and the horse that
//! falls.
//!
//! Everything is as in the authors' implementation: corotated elements without a volume term and w^2 = k V for all of them,
//! masses lumped to vertices, no damping, every vertex of a solid split off for contact. A step begins at x = x~, u = 0.

mod ours;
mod scenes;
#[cfg(test)]
mod tests;
mod walls;
mod wind;

pub use ours::{Ended, Scene};
pub use scenes::{Body, Find, cylinders, flag, pit, simulation};
pub use walls::Walls;
pub use wind::Wind;

use crate::BenchError;
use proxel::model::elements::{Batch, BatchShape, BatchWeights, Rest, batch};
use proxel::model::energy::Lame;
use proxel::model::obstacle::Obstacle;
use proxel::model::points::Points;
use proxel::settings::DeformSettings;
use proxel::split::{Acceleration, Admm, AdmmSettings, Algorithm, Direct, Inertia, Lbfgs, Problem, Quadratic, Term};

/// Seconds of a step.
pub const DT: f64 = 1.0 / 30.0;
/// Acceleration of free vertices along y.
pub const GRAVITY: f64 = -9.8;
/// Young's modulus and Poisson's ratio of the soft rubber that the weight of contact is taken from.
const SOFT_RUBBER: (f64, f64) = (1e7, 0.399);

/// How a step is split.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Splitting {
    /// z = Dx, w^2 = k V: the paper's.
    #[default]
    Linear,
    /// z is the stretch of the polar decomposition of Dx: R-ADMM.
    Polar,
    /// The same with weights that follow the stiffness: WRAPD.
    PolarReweighted,
}

/// A body in motion.
pub struct Moving {
    /// What it is.
    pub body: Body,
    /// The place of each vertex among positions: free ones first.
    place: Vec<u32>,
    n_free: usize,
    rest: Vec<f64>,
    mass: Vec<f64>,
    elements: Vec<u32>,
    x: Vec<f64>,
    v: Vec<f64>,
    frames: usize, // done
}

impl Moving {
    /// At rest.
    ///
    /// # Errors
    /// Elements that cannot be used.
    pub fn new(body: Body) -> Result<Self, BenchError> {
        let n = body.mesh.n_verts();
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.sort_by_key(|v| (body.pins.contains(v), *v));
        let mut place = vec![0; n];
        order.iter().zip(0u32..).for_each(|(v, at)| place[*v as usize] = at);
        let rest: Vec<f64> = order.iter().flat_map(|v| body.mesh.points[*v as usize]).collect();
        let corners = match body.shape {
            BatchShape::Triangles => body.mesh.faces.fan_triangles().into_flattened(),
            _ => body.mesh.tets.as_flattened().to_vec(),
        };
        let elements: Vec<u32> = corners.iter().map(|v| place[*v as usize]).collect();
        let mut moving = Moving {
            n_free: n - body.pins.len(),
            x: rest.clone(),
            v: vec![0.0; rest.len()],
            mass: vec![0.0; n],
            place,
            rest,
            elements,
            body,
            frames: 0,
        };
        moving.weigh()?;
        Ok(moving)
    }

    fn weigh(&mut self) -> Result<(), BenchError> {
        let size = self.corners();
        let measures: Vec<f64> = match self.body.shape {
            BatchShape::Triangles => {
                let rest = Rest::<3, 2>::new(&self.rest, &self.elements).map_err(BenchError::from_display)?;
                (0..self.elements.len() / size).map(|e| rest.measure(e)).collect()
            }
            _ => {
                let rest = Rest::<3, 3>::new(&self.rest, &self.elements).map_err(BenchError::from_display)?;
                (0..self.elements.len() / size).map(|e| rest.measure(e)).collect()
            }
        };
        for (corners, measure) in self.elements.chunks_exact(size).zip(measures) {
            corners.iter().for_each(|v| self.mass[*v as usize] += self.body.density * measure / size as f64);
        }
        Ok(())
    }

    /// Corners of an element.
    fn corners(&self) -> usize {
        if self.body.shape == BatchShape::Triangles { 3 } else { 4 }
    }

    /// Velocities of all vertices with what wind adds in a step, gravity aside.
    fn blown(&self) -> Vec<f64> {
        let mut v = self.v.clone();
        if let Some(wind) = &self.body.wind {
            wind.blow(&self.elements, &self.x, &mut v);
        }
        v
    }

    /// x~ of free vertices, and where held ones are.
    fn start(&self) -> Vec<f64> {
        let mut start = self.x.clone();
        for (i, (x, v)) in start[..3 * self.n_free].iter_mut().zip(self.blown()).enumerate() {
            *x += DT * (v + if i % 3 == 1 { DT * GRAVITY } else { 0.0 });
        }
        start
    }

    /// The problem of the next step: min 1/(2 dt^2) |x - x~|_M^2 + sum g(z), A(28), with strains within their limits and
    /// vertices in front of walls; `mu` multiplies all squared weights.
    ///
    /// # Errors
    /// Elements that cannot be used.
    pub fn problem(&self, splitting: Splitting, mu: f64) -> Result<Problem, BenchError> {
        let Body { lame, limits, walls, .. } = &self.body;
        let weights = |_| BatchWeights { base: mu * lame.bulk(), softening: 1.0 };
        let of = Batch {
            shape: self.body.shape,
            positions: &self.rest,
            flattened: None,
            elements: &self.elements,
            fill: None,
            energy: "corotated",
            lame,
            limits: *limits,
            rotation_aware: splitting != Splitting::Linear,
            singular_values: false,
            weights: &weights,
        };
        let mut terms: Vec<Box<dyn Term>> = vec![batch(&of).map_err(BenchError::from_display)?.0];
        if let Some(walls) = walls {
            let soft = Lame::from_young_poisson(SOFT_RUBBER.0, SOFT_RUBBER.1).map_err(BenchError::from_display)?.bulk();
            let nodes = Points::of_nodes((0..self.n_free as u32).collect());
            let weight2 = vec![mu * 2.0 * soft; self.n_free];
            terms.push(Box::new(Obstacle::new(walls.clone(), nodes, weight2, self.body.size())));
        }
        let x0 = self.start();
        let stiffness = self.mass[..self.n_free].iter().map(|m| m / (DT * DT)).collect();
        let inertia = Inertia::new(stiffness, x0[..3 * self.n_free].to_vec(), 3).map_err(BenchError::from_display)?;
        let quadratic = Quadratic { inertia, ..Quadratic::default() };
        Ok(Problem { dim: 3, n_free: self.n_free, x0, terms, quadratic, barrier: false })
    }

    /// The plain iteration on it.
    ///
    /// # Errors
    /// A problem that does not fit together.
    pub fn admm(&self, splitting: Splitting, mu: f64) -> Result<Admm, BenchError> {
        let ours = DeformSettings::default().admm;
        let settings = AdmmSettings {
            name: "admm".to_string(),
            global: match splitting {
                Splitting::Linear => Box::new(Direct),
                _ => Box::new(Lbfgs::new(ours.lbfgs())),
            },
            reweighting: (splitting == Splitting::PolarReweighted).then(|| ours.reweighting(true)),
            renewed_at: None,
        };
        Admm::new(self.problem(splitting, mu)?, settings).map_err(BenchError::from_display)
    }

    /// Solves the next step by Algorithm 4 with m = 6 and goes on to the one after.
    ///
    /// # Errors
    /// A step that fails.
    pub fn advance(&mut self, iterations: usize) -> Result<(), BenchError> {
        let anderson = Acceleration::anderson(Algorithm::Four, 6);
        let mut method = anderson.of(self.admm(Splitting::Linear, 1.0)?).map_err(BenchError::from_display)?;
        // The cycle that makes the first z and u is none of the iterations.
        for _ in 0..=iterations {
            method.step().map_err(BenchError::from_display)?;
        }
        let x = method.x();
        self.v.iter_mut().zip(x).zip(&self.x).for_each(|((v, x), before)| *v = (x - before) / DT);
        self.x.copy_from_slice(x);
        self.frames += 1;
        Ok(())
    }

    /// Frames done.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Vertices in the mesh's order, from positions in the solver's.
    pub fn vertices(&self, x: &[f64]) -> Vec<[f64; 3]> {
        let at = |place: &u32| [0, 1, 2].map(|d| x.get(3 * *place as usize + d).copied().unwrap_or(f64::NAN));
        self.place.iter().map(at).collect()
    }

    /// Numbers in the mesh's order, from one a vertex in the solver's.
    pub fn of_vertices(&self, values: &[f64]) -> Vec<f64> {
        self.place.iter().map(|place| values.get(*place as usize).copied().unwrap_or(f64::NAN)).collect()
    }

    /// Positions in the solver's order from vertices in the mesh's.
    pub fn flat(&self, vertices: &[[f64; 3]]) -> Vec<f64> {
        let mut x = self.x.clone();
        for (place, p) in self.place.iter().zip(vertices) {
            x[3 * *place as usize..3 * *place as usize + 3].copy_from_slice(p);
        }
        x
    }

    /// Positions and velocities of all vertices now, in the mesh's order; velocities with what wind adds in the next step.
    pub fn state(&self) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        (self.vertices(&self.x), self.vertices(&self.blown()))
    }

    /// The place of each vertex of the mesh in positions.
    pub fn places(&self) -> Vec<usize> {
        self.place.iter().map(|place| *place as usize).collect()
    }

    /// Positions in the solver's order.
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.x.as_chunks::<3>().0.to_vec()
    }

    /// Velocities in the solver's order, with what wind adds in the next step.
    pub fn blown_velocities(&self) -> Vec<[f64; 3]> {
        self.blown().as_chunks::<3>().0.to_vec()
    }

    /// How far stretches of each element are beyond their limits.
    pub fn violations(&self, x: &[f64]) -> Vec<f64> {
        let Some((low, high)) = self.body.limits else { return Vec::new() };
        let beyond = |s: &f64| (low - s).max(s - high).max(0.0);
        let stretches = self.stretches(x);
        stretches.iter().map(|s| s.iter().map(beyond).fold(0.0, f64::max)).collect()
    }

    /// Principal stretches of each triangle.
    fn stretches(&self, x: &[f64]) -> Vec<[f64; 2]> {
        let at = |of: &[f64], v: u32| [0, 1, 2].map(|d| of[3 * v as usize + d]);
        let sub = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|d| a[d] - b[d]);
        let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let of_triangle = |t: &[u32]| {
            let edges = |of: &[f64]| [sub(at(of, t[1]), at(of, t[0])), sub(at(of, t[2]), at(of, t[0]))];
            let ([a, b], [c, d]) = (edges(&self.rest), edges(x));
            // R = the rest edges in their own plane, upper triangular; C = F^T F = R^-T (edge products) R^-1.
            let r00 = dot(&a, &a).sqrt();
            let r01 = dot(&a, &b) / r00;
            let r11 = (dot(&b, &b) - r01 * r01).sqrt();
            let (f0, across) = (c.map(|v| v / r00), r01 / r11);
            let f1 = [0, 1, 2].map(|k| d[k] / r11 - across * f0[k]);
            let (p, q, o) = (dot(&f0, &f0), dot(&f1, &f1), dot(&f0, &f1));
            let (middle, spread) = (0.5 * (p + q), (0.5 * (p - q)).hypot(o));
            [(middle - spread).max(0.0).sqrt(), (middle + spread).sqrt()]
        };
        match self.body.shape {
            BatchShape::Triangles => self.elements.chunks_exact(3).map(of_triangle).collect(),
            _ => Vec::new(),
        }
    }

    /// How deep each vertex is in a wall, in the solver's order.
    pub fn depths(&self, x: &[f64]) -> Vec<f64> {
        use proxel::model::obstacle::Wall as _;
        let Some(walls) = &self.body.walls else { return Vec::new() };
        x.as_chunks::<3>().0.iter().map(|p| (-walls.distance(p)).max(0.0)).collect()
    }

    /// f(x) + sum g(Dx) of the next step, sets aside.
    ///
    /// # Errors
    /// As [`Self::problem`].
    pub fn objective(&self, x: &[f64]) -> Result<f64, BenchError> {
        Ok(self.problem(Splitting::Linear, 1.0)?.energy(x, None).value)
    }
}
