//! Algorithms 1 to 4 of Zhang et al. 2019 as they are printed, on dense matrices, as twins of those on the one driver.
//!
//! Three things are set right in the twins: `reset` becomes false when a point has been accepted; m_k = min(m, j) everywhere
//! instead of m = min(m, j), which would freeze the window; z and x are sensed as Bz and Ax, the metric of the splitting, save
//! in the raw form of Algorithm 2.

mod common;

use common::{FREE, Law, SMOOTH, admm, problem};
use proxel_split::{Acceleration, Algorithm, History, Problem};

type Vector = Vec<f64>;

fn combine(a: f64, x: &[f64], b: f64, y: &[f64]) -> Vector {
    x.iter().zip(y).map(|(x, y)| a * x + b * y).collect()
}

fn square(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// Gaussian elimination with row pivoting.
fn solve(mut a: Vec<Vector>, mut b: Vector) -> Vector {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).expect("a row");
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

/// min f(x) + g(z) subject to Ax - Bz = c with mu = 1, A(13); z here is Bz, so that B is gone.
struct Dense {
    law: Law,
    w: Vector,
    a: Vec<Vector>,      // rows of A = W D over the free nodes
    c: Vector,           // -W D x over the fixed node
    system: Vec<Vector>, // G + A^T A
    pull: Vector,        // G x~, loads included
    x: Vector,
}

impl Dense {
    fn new(law: Law) -> Self {
        let mut problem: Problem = problem(law, true);
        let mut weight2 = vec![0.0; FREE];
        problem.terms[0].local_weights2(&mut weight2);
        let w: Vector = weight2.iter().map(|w| w.sqrt()).collect();
        let mut couple = |x: &[f64]| {
            let mut out = vec![0.0; FREE];
            problem.terms[0].couple(x, &mut out);
            out
        };
        let unit = |j: usize| (0..=FREE).map(|i| f64::from(u8::from(i == j))).collect::<Vector>();
        let columns: Vec<Vector> = (0..=FREE).map(|j| couple(&unit(j))).collect();
        let a: Vec<Vector> = (0..FREE).map(|e| (0..FREE).map(|j| w[e] * columns[j][e]).collect()).collect();
        let fixed = problem.x0[FREE];
        let c = (0..FREE).map(|e| -w[e] * columns[FREE][e] * fixed).collect();
        let inertia = &problem.quadratic.inertia;
        let g = inertia.stiffness().to_vec();
        let pull = (0..FREE).map(|i| g[i] * inertia.target()[i] + problem.quadratic.loads[i]).collect();
        let entry =
            |i: usize, j: usize| (0..FREE).map(|e| a[e][i] * a[e][j]).sum::<f64>() + if i == j { g[i] } else { 0.0 };
        let system = (0..FREE).map(|i| (0..FREE).map(|j| entry(i, j)).collect()).collect();
        Dense { law, w, a, c, system, pull, x: problem.x0[..FREE].to_vec() }
    }

    fn ax(&self, x: &[f64]) -> Vector {
        self.a.iter().map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
    }

    /// A(15)
    fn x_step(&self, z: &[f64], u: &[f64]) -> Vector {
        let t: Vector = (0..FREE).map(|e| z[e] + self.c[e] - u[e]).collect();
        let right = (0..FREE).map(|i| self.pull[i] + (0..FREE).map(|e| self.a[e][i] * t[e]).sum::<f64>()).collect();
        solve(self.system.clone(), right)
    }

    /// A(16)
    fn z_step(&self, x: &[f64], u: &[f64]) -> Vector {
        let ax = self.ax(x);
        (0..FREE).map(|e| self.w[e] * self.law.prox((ax[e] - self.c[e] + u[e]) / self.w[e])).collect()
    }

    /// Ax - Bz - c
    fn gap(&self, x: &[f64], z: &[f64]) -> Vector {
        let ax = self.ax(x);
        (0..FREE).map(|e| ax[e] - z[e] - self.c[e]).collect()
    }

    /// A(21)
    fn dual(&self, z: &[f64]) -> Vector {
        (0..FREE).map(|e| self.w[e] * self.law.slope(z[e] / self.w[e])).collect()
    }
}

/// A(9) and A(10) from all images and residuals since the last reset.
struct Past {
    m: usize,
    g: Vec<Vector>,
    f: Vec<Vector>,
}

impl Past {
    fn new(m: usize) -> Self {
        Past { m, g: Vec::new(), f: Vec::new() }
    }

    fn clear(&mut self) {
        self.g.clear();
        self.f.clear();
    }

    /// The next point, and whether it is an extrapolation.
    fn next(&mut self, g: Vector, f: Vector) -> (Vector, bool) {
        self.g.push(g.clone());
        self.f.push(f.clone());
        let k = self.g.len() - 1;
        let m = self.m.min(k);
        let difference = |v: &[Vector], i: usize| combine(1.0, &v[k - i], -1.0, &v[k - i - 1]);
        let df: Vec<Vector> = (0..m).map(|i| difference(&self.f, i)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let gram = df.iter().map(|a| df.iter().map(|b| dot(a, b)).collect()).collect();
        let theta = solve(gram, df.iter().map(|a| dot(a, &f)).collect());
        ((0..m).fold(g, |q, i| combine(1.0, &q, -theta[i], &difference(&self.g, i))), m > 0)
    }
}

/// x after each accepted iteration, and rejections so far.
type Path = Vec<(Vector, usize)>;

fn concat(a: &[f64], b: &[f64]) -> Vector {
    [a, b].concat()
}

/// From z = Ax - c, u = 0, one z-u step before the first x-step: where the driver begins.
fn start(p: &Dense) -> (Vector, Vector) {
    let u = vec![0.0; FREE];
    let z = p.z_step(&p.x, &u);
    (z.clone(), p.gap(&p.x, &z))
}

fn algorithm_1(p: &Dense, m: usize, steps: usize) -> Path {
    // The driver enters the cycle at z: its x belongs to the state, and its first merit is that of the start.
    let (mut z, mut u) = (p.gap(&p.x, &[0.0; FREE]), vec![0.0; FREE]);
    let mut x = p.x.clone();
    let (mut default, mut previous, mut moved, mut rejected) = ((z.clone(), u.clone()), f64::INFINITY, false, 0);
    let (mut history, mut path) = (Past::new(m), Path::new());
    while path.len() < steps {
        let z1 = p.z_step(&x, &u);
        let u1 = combine(1.0, &u, 1.0, &p.gap(&x, &z1));
        let r = square(&combine(1.0, &u1, -1.0, &u)) + square(&combine(1.0, &z1, -1.0, &z));
        if !moved || r < previous {
            (default, previous) = ((z1.clone(), u1.clone()), r);
            path.push((p.x_step(&z1, &u1), rejected));
            let f = concat(&combine(1.0, &z1, -1.0, &z), &combine(1.0, &u1, -1.0, &u));
            let next;
            (next, moved) = history.next(concat(&z1, &u1), f);
            (z, u) = (next[..FREE].to_vec(), next[FREE..].to_vec());
        } else {
            (z, u) = default.clone();
            moved = false;
            rejected += 1;
            history.clear();
        }
        x = p.x_step(&z, &u);
    }
    path
}

fn algorithm_2(p: &Dense, m: usize, steps: usize) -> Path {
    // Sensed are Ax and u, extrapolated x and u: x rides along.
    algorithm_2_sensing(p, m, steps, |dx, du| concat(&p.ax(dx), du))
}

/// The u of an element is a w-th of the u here.
fn algorithm_2_raw(p: &Dense, m: usize, steps: usize) -> Path {
    algorithm_2_sensing(p, m, steps, |dx, du| {
        let own: Vector = du.iter().zip(&p.w).map(|(u, w)| u / w).collect();
        concat(dx, &own)
    })
}

/// Algorithm 2 with F of these coordinates of x_next - x and u_next - u.
fn algorithm_2_sensing(p: &Dense, m: usize, steps: usize, sense: impl Fn(&[f64], &[f64]) -> Vector) -> Path {
    let (mut x, mut u) = (p.x.clone(), vec![0.0; FREE]);
    let (mut default, mut previous, mut moved, mut rejected) = ((x.clone(), u.clone()), f64::INFINITY, false, 0);
    let (mut history, mut path) = (Past::new(m), Path::new());
    while path.len() < steps {
        let z1 = p.z_step(&x, &u);
        let x1 = p.x_step(&z1, &u);
        let u1 = combine(1.0, &u, 1.0, &p.gap(&x1, &z1));
        let change = combine(1.0, &x1, -1.0, &x);
        let r = square(&p.gap(&x1, &z1)) + square(&p.ax(&change));
        if !moved || r < previous {
            (default, previous) = ((x1.clone(), u1.clone()), r);
            path.push((x1.clone(), rejected));
            let f = sense(&change, &combine(1.0, &u1, -1.0, &u));
            let next;
            (next, moved) = history.next(concat(&x1, &u1), f);
            (x, u) = (next[..FREE].to_vec(), next[FREE..].to_vec());
        } else {
            (x, u) = default.clone();
            moved = false;
            rejected += 1;
            history.clear();
        }
    }
    path
}

fn algorithm_3(p: &Dense, m: usize, steps: usize) -> Path {
    let (mut z, mut u) = start(p);
    let mut z_default = z.clone();
    let (mut x_before, mut u_before) = (p.x.clone(), vec![0.0; FREE]);
    let (mut previous, mut moved, mut rejected) = (f64::INFINITY, false, 0);
    let (mut history, mut path) = (Past::new(m), Path::new());
    while path.len() < steps {
        let mut x = p.x_step(&z, &u);
        let mut r = square(&p.gap(&x, &z));
        if moved && r >= previous {
            z = z_default.clone();
            u = combine(1.0, &u_before, 1.0, &p.gap(&x_before, &z));
            x = p.x_step(&z, &u);
            r = square(&p.gap(&x, &z));
            rejected += 1;
        }
        path.push((x.clone(), rejected));
        z_default = p.z_step(&x, &u);
        (x_before, u_before) = (x, u);
        (z, moved) = history.next(z_default.clone(), combine(1.0, &z_default, -1.0, &z));
        u = p.dual(&z);
        previous = r;
    }
    path
}

fn algorithm_4(p: &Dense, m: usize, steps: usize) -> Path {
    let (mut x, mut u) = (p.x.clone(), vec![0.0; FREE]);
    let (mut default, mut previous, mut moved, mut rejected) = ((x.clone(), u.clone()), f64::INFINITY, false, 0);
    let (mut history, mut path) = (Past::new(m), Path::new());
    while path.len() < steps {
        let mut z = p.z_step(&x, &u);
        let mut r = square(&p.gap(&x, &z));
        if moved && r >= previous {
            (x, u) = default.clone();
            z = p.z_step(&x, &u);
            r = square(&p.gap(&x, &z));
            rejected += 1;
            history.clear();
        }
        let x1 = p.x_step(&z, &u);
        let u1 = combine(1.0, &u, 1.0, &p.gap(&x1, &z));
        path.push((x1.clone(), rejected));
        let f = combine(1.0, &u1, -1.0, &u);
        default = (x1.clone(), u1.clone());
        let next;
        // The first cycle makes x and u fit each other, A(23), and is no part of the history.
        (next, moved) = if path.len() > 1 { history.next(concat(&x1, &u1), f) } else { (concat(&x1, &u1), false) };
        (x, u) = (next[..FREE].to_vec(), next[FREE..].to_vec());
        previous = r;
    }
    path
}

#[test]
fn the_driver_does_what_is_printed() {
    const STEPS: usize = 25;
    type Twin = fn(&Dense, usize, usize) -> Path;
    let twins: [(Algorithm, Twin); 5] = [
        (Algorithm::One, algorithm_1),
        (Algorithm::Two, algorithm_2),
        (Algorithm::TwoRaw, algorithm_2_raw),
        (Algorithm::Three, algorithm_3),
        (Algorithm::Four, algorithm_4),
    ];
    let law = |k, q| Law { k, q, limits: None };
    let mut rejections = [0; 5];
    for law in [SMOOTH, law(0.3, 60.0), law(0.01, 500.0), law(1.0, 5000.0), law(-0.9, 20.0)] {
        let dense = Dense::new(law);
        for (k, (algorithm, twin)) in twins.into_iter().enumerate() {
            for m in [0, 1, 3, 5] {
                let how = Acceleration { history: History::AsPublished, ..Acceleration::anderson(algorithm, m) };
                let mut method = how.of(admm(problem(law, true))).expect("a method");
                let (mut rejected, mut first) = (0, 0.0_f64);
                for (step, (x, refused)) in twin(&dense, m, STEPS).into_iter().enumerate() {
                    let report = method.step().expect("a step");
                    rejected += report.trial.rejected;
                    let merit = report.merit.expect("a merit");
                    first = first.max(merit);
                    if merit < 1e-18 * first {
                        break; // what is left is rounding, and so are decisions
                    }
                    let apart = method.x().iter().zip(&x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(apart < 1e-7, "{algorithm:?}, m = {m}, step {step}: {apart}");
                    assert_eq!(rejected, refused, "{algorithm:?}, m = {m}, step {step}");
                }
                rejections[k] += rejected;
            }
        }
    }
    // Of combined residuals this chain refuses none; that rejections of theirs are what they should be is tested elsewhere.
    assert!(rejections[3] > 0 && rejections[4] > 0, "the safeguard has nothing to do: {rejections:?}");
}

/// A2DM2 (Kadkhodaie et al. 2015) as it is printed: momentum of the dual, and from it zhat = argmin g(z) - <u, z>, here
/// worked out anew from the law in the place of going by the coefficients of the dual.
#[test]
fn a2dm2_is_momentum_of_the_dual_and_the_z_that_has_it() {
    let law = Law { k: 3.0, q: 0.0, limits: None };
    let dense = Dense::new(law);
    let mut method = Acceleration::a2dm2().of(admm(problem(law, true))).expect("a quadratic");
    let nearest = |u: &[f64]| -> Vector { (0..FREE).map(|e| dense.w[e] + u[e] / law.k).collect() };
    // A plain cycle makes x, z and u fit each other; with that the recurrence begins.
    let mut x = dense.x.clone();
    let mut u = vec![0.0; FREE];
    let cycle = |x: &mut Vector, u: &[f64]| {
        let z = dense.z_step(x, u);
        let u = combine(1.0, u, 1.0, &dense.gap(x, &z));
        *x = dense.x_step(&z, &u);
        (z, u)
    };
    let mut z;
    (z, u) = cycle(&mut x, &u);
    method.step().expect("a step");
    let (mut alpha, mut before) = (1.0_f64, u.clone());
    let (mut hat_z, mut hat_u) = (z.clone(), u.clone());
    let mut moved = 0.0;
    for k in 1..80 {
        let hat_x = dense.x_step(&hat_z, &hat_u);
        z = dense.z_step(&hat_x, &hat_u);
        u = combine(1.0, &hat_u, 1.0, &dense.gap(&hat_x, &z));
        let report = method.step().expect("a step");
        let image = dense.x_step(&z, &u);
        let apart = square(&combine(1.0, &image, -1.0, method.x())).sqrt();
        assert!(apart < 1e-11, "cycle {k}: {apart}");
        assert_eq!(report.trial.rejected, 0, "cycle {k}");
        // The first image of the recurrence has none before it.
        let next = 0.5 * (1.0 + (1.0 + 4.0 * alpha * alpha).sqrt());
        let momentum = if k == 1 { 0.0 } else { (alpha - 1.0) / next };
        hat_u = combine(1.0 + momentum, &u, -momentum, &before);
        hat_z = nearest(&hat_u);
        moved += momentum * square(&combine(1.0, &u, -1.0, &before)).sqrt();
        (alpha, before) = (next, u.clone());
    }
    assert!(moved > 1e-3, "no momentum to be seen: {moved}");
    let gradient = method.evaluate().gradient_norm;
    assert!(gradient < 1e-3, "{gradient}");
}
