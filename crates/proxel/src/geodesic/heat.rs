//! The heat method: where heat flows, and the distance whose gradient that is (Crane, Weischedel, Wardetzky 2013).

use super::GeodesicError;
use super::surface::Surface;
use proxel_linalg::sparse::{Cholesky, Ordering, SolveScratch, SparseError, SymPattern, Symbolic};
use std::sync::Arc;

impl From<SparseError> for GeodesicError {
    fn from(e: SparseError) -> Self {
        GeodesicError(format!("a system of the surface cannot be factored: {e}"))
    }
}

/// The Laplacian of a surface, and the analysis of its pattern.
pub struct Laplacian {
    pattern: SymPattern,
    symbolic: Arc<Symbolic>,
    stiffness: Vec<f64>, // of the pattern's entries: half the cotangents
    mass: Vec<f64>,      // a third of the areas around each vertex
    hats: Vec<[[f64; 2]; 3]>,
    /// Bytes of the last factor.
    pub factor_bytes: u64,
}

/// What the heat of a step leaves: how long it flowed, and the unit vectors against its gradient.
pub struct Flow {
    /// Time in squared mean edges.
    pub time: f64,
    /// A unit vector for each triangle, in its frame, away from the sources; 0 where there are none.
    pub directions: Vec<[f64; 2]>,
}

/// Heat below this has lost its digits on the way.
const FAINT: f64 = 1e-280;

/// The time is raised by this where heat is too faint far from its sources,
const LONGER: f64 = 4.0;
/// so often.
const RAISES: usize = 12;

impl Laplacian {
    /// L = G^T A G with G the gradient of hat functions.
    ///
    /// # Errors
    /// A pattern that is too large.
    pub fn new(surface: &Surface) -> Result<Self, GeodesicError> {
        let pattern = SymPattern::from_edges(surface.n, &surface.edges)?;
        let symbolic = Arc::new(Symbolic::analyze(&pattern, Ordering::Auto)?);
        let (mut stiffness, mut mass) = (vec![0.0; pattern.nnz()], vec![0.0; surface.n]);
        let hats: Vec<[[f64; 2]; 3]> = (0..surface.triangles.len()).map(|f| surface.hats(f)).collect();
        for (f, t) in surface.triangles.iter().enumerate() {
            let (hats, area) = (&hats[f], surface.area[f]);
            for a in 0..3 {
                mass[t[a] as usize] += area / 3.0;
                for b in 0..=a {
                    let entry = area * (hats[a][0] * hats[b][0] + hats[a][1] * hats[b][1]);
                    let (i, j) = (t[a].max(t[b]) as usize, t[a].min(t[b]) as usize);
                    if let Some(slot) = pattern.slot(i, j) {
                        stiffness[slot] += entry;
                    }
                }
            }
        }
        Ok(Laplacian { pattern, symbolic, stiffness, mass, hats, factor_bytes: 0 })
    }

    fn solve(&mut self, values: &[f64], b: &mut [f64]) -> Result<(), GeodesicError> {
        let mut factor = Cholesky::<f64>::new(self.symbolic.clone());
        factor.refactor(values)?;
        let (lines, workspace) = factor.bytes();
        self.factor_bytes = (lines + workspace) as u64;
        factor.solve_in_place(b, 1, &mut SolveScratch::default())?;
        Ok(())
    }

    /// Makes rows and columns of vertices those of the unit matrix, so that they keep what the right-hand side has; that is to
    /// be 0.
    fn fix(&self, values: &mut [f64], is_fixed: impl Fn(usize) -> bool) {
        for j in 0..self.pattern.n() {
            for slot in self.pattern.col_ptr()[j]..self.pattern.col_ptr()[j + 1] {
                let i = self.pattern.row_idx()[slot] as usize;
                if is_fixed(i) || is_fixed(j) {
                    values[slot] = if i == j { 1.0 } else { 0.0 };
                }
            }
        }
    }

    /// Lets heat flow from the sources for `time` squared mean edges, (M + t L) h = the sources' indicator; longer where it
    /// would not reach the end. Where the surface has a border, h is the mean of what no heat leaves through it and of what is
    /// cold along it, as Crane et al. advise. `reached` tells of each vertex whether its component has a source.
    ///
    /// # Errors
    /// A system that cannot be factored.
    pub fn flow(
        &mut self,
        surface: &Surface,
        sources: &[u32],
        reached: &[bool],
        time: f64,
    ) -> Result<Flow, GeodesicError> {
        let edge = surface.mean_edge();
        let border = surface.border();
        let mut time = time;
        let mut turn = 0;
        loop {
            let t = time * edge * edge;
            let mut values: Vec<f64> = self.stiffness.iter().map(|s| t * s).collect();
            for v in 0..surface.n {
                // A vertex without triangles is a system of its own.
                values[self.pattern.diagonal_slot(v)] += if self.mass[v] > 0.0 { self.mass[v] } else { 1.0 };
            }
            let mut heat = vec![0.0; surface.n];
            sources.iter().for_each(|v| heat[*v as usize] = 1.0);
            self.solve(&values, &mut heat)?;
            let faint = |(h, reached): (&f64, &bool)| *reached && h.abs() < FAINT;
            if turn < RAISES && heat.iter().zip(reached).any(faint) {
                time *= LONGER;
                turn += 1;
                continue;
            }
            if border.contains(&true) {
                let mut cold = vec![0.0; surface.n];
                sources.iter().filter(|v| !border[**v as usize]).for_each(|v| cold[*v as usize] = 1.0);
                self.fix(&mut values, |v| border[v]);
                self.solve(&values, &mut cold)?;
                heat.iter_mut().zip(cold).for_each(|(heat, cold)| *heat += cold);
            }
            let directions = surface.triangles.iter().enumerate().map(|(f, t)| self.against(f, t, &heat)).collect();
            return Ok(Flow { time, directions });
        }
    }

    /// -grad h / |grad h| of a triangle.
    fn against(&self, f: usize, t: &[u32; 3], heat: &[f64]) -> [f64; 2] {
        let h = t.map(|v| heat[v as usize]);
        // In units of the largest, since squares of what is far away vanish.
        let unit = h.iter().fold(0.0_f64, |m, h| m.max(h.abs()));
        let g = [0, 1].map(|d| (0..3).map(|k| self.hats[f][k][d] * (h[k] / unit)).sum::<f64>());
        let size = g[0].hypot(g[1]);
        if size > 0.0 && size.is_finite() { g.map(|g| -g / size) } else { [0.0; 2] }
    }

    /// The function whose gradient is nearest to the field: the minimum of sum_f A_f |grad phi - g_f|^2, which is 0 at one
    /// vertex of each component: `roots` has it for each vertex.
    ///
    /// # Errors
    /// A system that cannot be factored.
    pub fn integrate(
        &mut self,
        surface: &Surface,
        field: &[[f64; 2]],
        roots: &[u32],
    ) -> Result<Vec<f64>, GeodesicError> {
        let mut phi = vec![0.0; surface.n];
        for (f, t) in surface.triangles.iter().enumerate() {
            for k in 0..3 {
                let hat = self.hats[f][k];
                phi[t[k] as usize] += surface.area[f] * (hat[0] * field[f][0] + hat[1] * field[f][1]);
            }
        }
        let is_root = |v: u32| roots[v as usize] == v;
        let mut values = self.stiffness.clone();
        self.fix(&mut values, |v| is_root(v as u32));
        (0..surface.n).filter(|v| is_root(*v as u32)).for_each(|v| phi[v] = 0.0);
        self.solve(&values, &mut phi)?;
        Ok(phi)
    }

    /// The gradient of a function of the vertices, in the frame of each triangle.
    pub fn gradient(&self, surface: &Surface, phi: &[f64]) -> Vec<[f64; 2]> {
        let of = |(f, t): (usize, &[u32; 3])| {
            [0, 1].map(|d| (0..3).map(|k| self.hats[f][k][d] * phi[t[k] as usize]).sum::<f64>())
        };
        surface.triangles.iter().enumerate().map(of).collect()
    }
}
