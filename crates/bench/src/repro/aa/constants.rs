//! A small bar and the constants of its convergence theorems.

use crate::BenchError;
use nalgebra::{DMatrix, SymmetricEigen};
use proxel::mesh::generate::{Bars, bars};
use proxel::model::elements::{Elements, Linear, Rest};
use proxel::model::energy::{Energy, Lame, StVenantKirchhoff};
use proxel::split::{Inertia, NormalMatrix, Problem, Quadratic, Term};

/// Two cubes of StVK, 1 m each, held at both ends, which have moved apart by `PULLED` on each side.
pub(super) struct Bar {
    bars: Bars,
    lame: Lame,
    dt: f64,
}

const YOUNG: f64 = 1e3; // Pa
const POISSON: f64 = 0.3;
const DENSITY: f64 = 1e3; // kg/m^3
const PULLED: f64 = 0.02; // m

/// How far below its bound 1/(2 L) rho(K) is brought by the time step.
const BELOW: f64 = 0.5;

impl Bar {
    /// With a time step so small that rho(K) is half of what Theorem 3.3 allows.
    ///
    /// # Errors
    /// Never, but for moduli that would make no material.
    pub fn new() -> Result<Self, BenchError> {
        let lame = Lame::from_young_poisson(YOUNG, POISSON).map_err(BenchError::from_display)?;
        let bars = bars(1, [2, 1, 1], 1.0, 0.0).map_err(BenchError::from_display)?;
        let mut bar = Bar { bars, lame, dt: 1.0 };
        // rho(K) grows with dt^2; L depends on the start, which does not depend on dt.
        let constants = Constants::of(&bar)?;
        bar.dt = (BELOW / (2.0 * constants.lipschitz_xzu.max(constants.lipschitz_zxu) * constants.rho)).sqrt();
        Ok(bar)
    }

    /// The same bar with a step `factor` times as long.
    pub fn slower(&self, factor: f64) -> Bar {
        Bar { bars: self.bars.clone(), lame: self.lame, dt: factor * self.dt }
    }

    /// Seconds of its step.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// A step from rest with squared weights mu k V.
    ///
    /// # Errors
    /// Elements that cannot be used.
    pub fn problem(&self, mu: f64) -> Result<Problem, BenchError> {
        let n_free = self.bars.n_free;
        let rest: Vec<f64> = self.bars.vertices.iter().flatten().copied().collect();
        let mut x0 = rest.clone();
        x0[3 * n_free..].chunks_exact_mut(3).for_each(|p| p[0] += PULLED.copysign(p[0]));
        let tets = Rest::<3, 3>::new(&rest, self.bars.tets[0].as_flattened()).map_err(BenchError::from_display)?;
        let energy = <StVenantKirchhoff as Energy<3>>::from_lame(&self.lame);
        let term: Box<dyn Term> = Box::new(Elements::<3, 3, Linear>::new(&tets, energy, mu * self.lame.bulk()));
        let stiffness = self.bars.masses(DENSITY)[..n_free].iter().map(|m| m / (self.dt * self.dt)).collect();
        let inertia = Inertia::new(stiffness, x0[..3 * n_free].to_vec(), 3).map_err(BenchError::from_display)?;
        let quadratic = Quadratic { inertia, ..Quadratic::default() };
        Ok(Problem { dim: 3, n_free, x0, terms: vec![term], quadratic, barrier: false })
    }

    pub fn describe(&self) -> String {
        format!(
            "## The problem\n\nTwo cubes of 1 m in ten tetrahedra, StVK, E = {YOUNG:e} Pa, nu = {POISSON}, {DENSITY:e} kg/m^3, both ends held \
             and moved outwards by {PULLED} m; one step of implicit Euler from rest. For rho(K) to be {BELOW} of its bound the step is \
             dt = {:.4e} s, {:.4} of the time that a wave takes to cross a cube. In the terms of A: B = W with w^2 = k V, k the bulk \
             modulus, and mu multiplies it.",
            self.dt,
            self.dt * (self.lame.bulk() / DENSITY).sqrt()
        )
    }
}

/// The constants of Assumptions 3.5 and 3.6 and Theorems 3.3 and 3.4, with bounds that hold for StVK where they cannot be
/// had exactly: facts are stated at each.
pub(super) struct Constants {
    /// rho(K), K = A G^-1 A^T: its largest eigenvalue.
    pub rho: f64,
    /// eta of Proposition 3.5: its least eigenvalue on the range of A.
    eta: f64,
    /// L_c and L_d: of grad g(B^-1 .) over the convex hull of the level set that the iteration stays in.
    pub lipschitz_xzu: f64,
    pub lipschitz_zxu: f64,
    /// The least mu for which all that is assumed holds.
    pub least_mu_xzu: f64,
    pub least_mu_zxu: f64,
    start: f64, // T(x0, z0)
}

impl Constants {
    pub fn of(bar: &Bar) -> Result<Self, BenchError> {
        let mut problem = bar.problem(1.0)?;
        let (rho, eta) = spectrum(&problem)?;
        let x0 = problem.x0.clone();
        let start = problem.energy(&x0, None).value;
        let (mu, lambda, base) = (bar.lame.mu(), bar.lame.lambda(), bar.lame.bulk());
        let least_volume = 1.0 / 6.0; // of a corner of a cube of 1 m
        // Where g <= alpha each element has V mu |E|^2 <= alpha, lambda being positive: |E| <= e, and |F|^2 <= 1 + 2 e in the
        // spectral norm, which is convex.
        let strain = |alpha: f64| (alpha / (mu * least_volume)).sqrt();
        let size2 = |alpha: f64| 1.0 + 2.0 * strain(alpha);
        let s = 2.0 * mu + 3.0 * lambda; // |2 mu E + lambda tr(E) I| <= s |E|
        // P = F S(E): |dP| <= |dF| |S| + |F| |dS|, |dE| <= |F| |dF|; in the hull |E| <= max(1/2, e).
        let lipschitz = |alpha: f64| s * (strain(alpha).max(0.5) + size2(alpha)) / base;
        // |B^-T grad g|^2 = sum V/k |P|^2 <= size^2 s^2 / k sum V |E|^2 <= size^2 s^2 alpha / (k mu).
        let force2 = |alpha: f64| size2(alpha) * s * s * alpha / (base * mu);
        let alpha = start + 1.0; // T^0 + c, c being at most 1
        let l = lipschitz(alpha);
        let at_start = force_at_start(&mut problem, &x0);
        // c1 <= 1; mu/2 - L^2/mu > L/2, which is mu > 2 L; gamma_3 < 1.
        let xzu = (0.5 * force2(alpha)).max(2.0 * l).max(1.0 / (1.0 / (2.0 * l) - rho).max(0.0));
        // c2 + c3 <= 1, both falling with 1/mu: |Ax - Ax~|^2 <= rho |x - x~|_G^2 <= 2 rho alpha.
        let c2 = 2.0 / (eta * eta) * 2.0 * rho * alpha + (2.0 * (rho / eta).powi(2) + 1.0) * force2(alpha);
        let c3 = (8.0 * (rho / eta).powi(2) + 4.0) * at_start;
        // The proof asks for mu/2 >= 4/(eta^2 mu) and (mu - L)/2 >= b/mu, the theorem for an invertible I - mu K, which it is
        // where mu eta > 1.
        let b = (4.0 * (rho / eta).powi(2) + 2.0) * (l * l).max(2.0 * l);
        let proof = (8.0_f64.sqrt() / eta).max(0.5 * l + (0.25 * l * l + 2.0 * b).sqrt());
        let zxu = (c2 + c3).max(2.0 * l).max(2.0 / (1.0 / l - rho).max(0.0)).max(proof);
        Ok(Constants { rho, eta, lipschitz_xzu: l, lipschitz_zxu: l, least_mu_xzu: xzu, least_mu_zxu: zxu, start })
    }

    /// gamma_3 = (mu rho/(1 + mu rho) + L/mu) / (1 - L/mu)
    pub fn gamma_3(&self, mu: f64) -> f64 {
        let (k, l) = (mu * self.rho, self.lipschitz_xzu / mu);
        (k / (1.0 + k) + l) / (1.0 - l)
    }

    /// gamma_4 = mu rho/(1 + mu rho) + L/(mu - L)
    pub fn gamma_4(&self, mu: f64) -> f64 {
        let k = mu * self.rho;
        k / (1.0 + k) + self.lipschitz_zxu / (mu - self.lipschitz_zxu)
    }

    /// What the augmented Lagrangian falls by at least in a step of the z-x-u iteration after the first, by the proof of
    /// Theorem 3.6: the factors of |W A (x^{k+1} - x^k)|^2 and of |W B (z^{k+1} - z^k)|^2 with the penalty in W,
    /// 1/2 - 4/(mu eta)^2 and (1 - L/mu)/2 - (4 (rho/eta)^2 + 2) (L/mu)^2.
    pub fn descent_zxu(&self, mu: f64) -> (f64, f64) {
        let l = self.lipschitz_zxu / mu;
        (0.5 - 4.0 / (mu * self.eta).powi(2), 0.5 * (1.0 - l) - (4.0 * (self.rho / self.eta).powi(2) + 2.0) * l * l)
    }

    pub fn describe(&self) -> String {
        format!(
            "## Constants\n\n| constant | value |\n|---|---|\n| T(x0, z0), J | {:.6} |\n| rho(K) | {:.6e} |\n| eta, Proposition 3.5 | {:.6e} |\n\
             | L on the level set, a bound | {:.4} |\n| 1/(2 L), what rho(K) has to be below | {:.6e} |\n\
             | least mu of the x-z-u iteration, `safe` | {:.4e} |\n| least mu of the z-x-u iteration, `safe` | {:.4e} |\n\n\
             StVK is not globally Lipschitz, so that Theorems 3.3 and 3.4 apply and not 3.1 and 3.2, whose gammas are the same. L and \
             the suprema in c1 and c2 are bounds from |F|^2 <= 1 + 2 |E|; the least mu are those for which c1 <= 1 and mu > 2 L, or \
             c2 + c3 <= 1, gamma < 1, and mu is as large as the proofs ask for.\n",
            self.start,
            self.rho,
            self.eta,
            self.lipschitz_xzu,
            0.5 / self.lipschitz_xzu,
            self.least_mu_xzu,
            self.least_mu_zxu
        )
    }
}

/// The largest and the least eigenvalue of G^-1/2 A^T A G^-1/2, which are those of K on the range of A; every coordinate has
/// the same.
fn spectrum(problem: &Problem) -> Result<(f64, f64), BenchError> {
    let normal = NormalMatrix::new(problem).map_err(BenchError::from_display)?;
    let n = problem.n_free;
    let g = problem.quadratic.inertia.stiffness();
    let mut matrix = DMatrix::zeros(n, n);
    for j in 0..n {
        let mut unit = vec![0.0; 3 * n];
        unit[3 * j] = 1.0;
        let mut column = vec![0.0; 3 * n];
        normal.multiply(&unit, &mut column).map_err(BenchError::from_display)?;
        for i in 0..n {
            let own = if i == j { g[i] } else { 0.0 };
            matrix[(i, j)] = (column[3 * i] - own) / (g[i] * g[j]).sqrt();
        }
    }
    let values = SymmetricEigen::new(0.5 * (&matrix + matrix.transpose())).eigenvalues;
    let (most, least) = (values.max(), values.min());
    if least > 1e-9 * most { Ok((most, least)) } else { Err(BenchError("the small bar is loose".to_string())) }
}

/// |B^-T grad g(z0)|^2 at mu = 1.
fn force_at_start(problem: &mut Problem, x0: &[f64]) -> f64 {
    let mut sum = 0.0;
    for term in &mut problem.terms {
        let (mut z, mut u) = (vec![0.0; term.local_len()], vec![0.0; term.local_len()]);
        let mut weights = z.clone();
        term.couple(x0, &mut z);
        term.dual(&z, &mut u);
        term.local_weights2(&mut weights);
        sum += weights.iter().zip(&u).map(|(w, u)| w * u * u).sum::<f64>();
    }
    sum
}
