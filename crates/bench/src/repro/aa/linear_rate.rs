//! The proven linear rates, Theorems 3.3 to 3.6 of A, checked on a bar small enough for all constants.

use super::constants::{Bar, Constants};
use super::safe;
use crate::BenchError;
use crate::plot::{Axis, Line, Panel};
use crate::repro::context::Context;
use crate::table::Table;
use proxel::split::{Cycle, NormalMatrix, Order, Problem, vector};
use std::fmt::Write as _;

/// Changes below this part of the size of the variable are rounding: their ratios say nothing.
const ROUNDING: f64 = 1e-12;

/// Part of that at which a run ends.
const OVER: f64 = 0.1;

/// Steps of a run at most. The slowest are then far from rounding, which near it would be more than what a ratio is below its
/// bound.
const MOST: usize = 400;

/// Points of a curve, and marks.
const DRAWN: usize = 800;
const MARKS: usize = 25;

/// Least change in the plot.
const SHOWN: f64 = 1e-11;

/// A run of one order from the start that its theorem asks for.
pub(super) struct Run {
    /// |B (z^{k+1} - z^k)|, or |v^{k+1} - v^k| of the z-x-u iteration, in units of the weights at mu = 1.
    pub changes: Vec<f64>,
    /// What Theorems 3.5 and 3.6 say has a finite sum: |B (z^{k+1} - z^k)|, or |A (x^{k+1} - x^k)| of the z-x-u iteration.
    pub summed: Vec<f64>,
    /// What the augmented Lagrangian fell by over what is promised, step by step: by A(59), and in the z-x-u iteration by the
    /// proof of Theorem 3.6.
    pub descents: Vec<f64>,
    /// |B z| at the start, in the same units.
    size: f64,
}

impl Run {
    /// How many changes are more than rounding.
    fn above(&self) -> usize {
        self.changes.iter().take_while(|c| **c > ROUNDING * self.size).count()
    }

    /// Whether what is left of the changes is rounding.
    fn is_over(&self) -> bool {
        self.changes.last().is_some_and(|c| *c <= OVER * ROUNDING * self.size)
    }

    pub fn ratios(&self) -> impl Iterator<Item = f64> + '_ {
        self.changes[..self.above()].windows(2).map(|pair| pair[1] / pair[0])
    }

    fn worst(&self) -> f64 {
        self.ratios().fold(0.0, f64::max)
    }
}

/// Points of a curve, down to what is shown, so many at most.
fn thinned(values: impl Iterator<Item = f64>, most: usize) -> Vec<(f64, f64)> {
    let all: Vec<f64> = values.take_while(|c| *c > SHOWN).collect();
    let every = all.len().div_ceil(most).max(1);
    all.into_iter().enumerate().step_by(every).map(|(k, v)| (k as f64, v)).collect()
}

/// A vector over the free nodes becomes one over all, 0 at the fixed ones.
fn padded(free: &[f64], n: usize) -> Vec<f64> {
    let mut all = vec![0.0; n];
    all[..free.len()].copy_from_slice(free);
    all
}

/// sum w^2 v^2
fn weighted(problem: &Problem, v: &[Vec<f64>]) -> f64 {
    let mut sum = 0.0;
    for (term, v) in problem.terms.iter().zip(v) {
        let mut weights = vec![0.0; v.len()];
        term.local_weights2(&mut weights);
        sum += weights.iter().zip(v).map(|(w, v)| w * v * v).sum::<f64>();
    }
    sum
}

/// The x-z-u iteration at penalty mu; the augmented Lagrangian is to fall by `promised` times |W (z^{k+1} - z^k)|^2, W having
/// mu in it.
pub(super) fn xzu(bar: &Bar, promised: f64, mu: f64, steps: usize) -> Result<Run, BenchError> {
    let mut problem = bar.problem(mu)?;
    let mut normal = NormalMatrix::new(&problem).map_err(BenchError::from_display)?;
    let mut x = problem.x0.clone();
    let mut grad = vec![0.0; 3 * problem.n_free];
    // z0 = B^-1 (A x0 - c), u0 = B^-T grad g(z0) / mu: Assumption 3.5.
    let mut p: Vec<Vec<f64>> = problem.terms.iter().map(|term| vec![0.0; term.local_len()]).collect();
    let mut u = p.clone();
    for ((term, p), u) in problem.terms.iter_mut().zip(&mut p).zip(&mut u) {
        term.couple(&x, p);
        term.dual(p, u);
    }
    let size = (weighted(&problem, &p) / mu).sqrt();
    p.iter_mut().zip(&u).for_each(|(p, u)| vector::add_scaled(p, -1.0, u));
    let mut g = problem.energy(&x, None).value - problem.quadratic.value_and_gradient(&x, 3, None);
    let mut run = Run { changes: Vec::new(), summed: Vec::new(), descents: Vec::new(), size };
    // L(x, z, u) of A(4).
    let lagrangian = |problem: &mut Problem, x: &[f64], p: &[Vec<f64>], u: &[Vec<f64>], g: f64, grad: &mut [f64]| {
        problem.penalty(x, p, grad).value + g - 0.5 * weighted(problem, u)
    };
    let mut before = lagrangian(&mut problem, &x, &p, &u, g, &mut grad);
    for _ in 0..steps {
        problem.penalty(&x, &p, &mut grad);
        normal.solve(&mut grad).map_err(BenchError::from_display)?;
        vector::add_scaled(&mut x[..grad.len()], -1.0, &grad);
        let local = problem.local_step(&x, &mut p, &mut u, &mut grad);
        g = local.value_after;
        let after = lagrangian(&mut problem, &x, &p, &u, g, &mut grad);
        run.changes.push((local.moved2 / mu).sqrt());
        run.summed.push((local.moved2 / mu).sqrt());
        run.descents.push((before - after) / (promised * local.moved2));
        before = after;
        if run.is_over() {
            break;
        }
    }
    Ok(run)
}

fn zxu(bar: &Bar, constants: &Constants, mu: f64, steps: usize) -> Result<Run, BenchError> {
    let mut problem = bar.problem(mu)?;
    let mut normal = NormalMatrix::new(&problem).map_err(BenchError::from_display)?;
    // x0 = x~, u0 = 0: Assumption 3.6.
    let mut x = problem.x0.clone();
    let n = x.len();
    let mut grad = vec![0.0; 3 * problem.n_free];
    let mut p: Vec<Vec<f64>> = problem.terms.iter().map(|term| vec![0.0; term.local_len()]).collect();
    let mut u = p.clone();
    for (term, p) in problem.terms.iter_mut().zip(&mut p) {
        term.couple(&x, p);
    }
    let size = (weighted(&problem, &p) / mu).sqrt();
    let cycle = Cycle { order: Order::Zxu, relaxation: 1.0 };
    let mut run = Run { changes: Vec::new(), summed: Vec::new(), descents: Vec::new(), size };
    let mut before: Option<Vec<Vec<f64>>> = None;
    let (of_positions, of_locals) = constants.descent_zxu(mu);
    let mut lagrangian: Option<f64> = None;
    let mut coupled: Vec<Vec<f64>> = p.clone();
    for _ in 0..steps {
        let local = problem.cycle_step(&cycle, &x, &mut p, &mut u, &mut grad);
        normal.solve(&mut grad).map_err(BenchError::from_display)?;
        vector::add_scaled(&mut x[..grad.len()], -1.0, &grad);
        let mut moved = coupled.clone(); // A (x^{k+1} - x^k)
        for (((term, p), u), (old, moved)) in
            problem.terms.iter_mut().zip(&mut p).zip(&mut u).zip(coupled.iter_mut().zip(&mut moved))
        {
            let mut c = vec![0.0; p.len()];
            term.couple(&x, &mut c);
            moved.iter_mut().zip(&c).for_each(|(old, now)| *old = now - *old);
            for ((p, u), c) in p.iter_mut().zip(u).zip(&c) {
                let z = *p + *u;
                *u = c - *p;
                *p = z - *u;
            }
            *old = c;
        }
        // L(x, z, u) of A(4): the first step, from u = 0, is one that the proof lets rise.
        let after = problem.penalty(&x, &p, &mut grad).value + local.value_after - 0.5 * weighted(&problem, &u);
        if let Some(before) = lagrangian.replace(after) {
            let of_x = weighted(&problem, &moved);
            run.descents.push((before - after) / (of_positions * of_x + of_locals * local.moved2));
            run.summed.push((of_x / mu).sqrt());
        }
        // v = (I - mu K) u, K = A G^-1 A^T.
        let mut y = vec![0.0; 3 * problem.n_free];
        problem.adjoint(&u, &mut y);
        let stiffness = problem.quadratic.inertia.stiffness();
        y.iter_mut().enumerate().for_each(|(i, y)| *y /= stiffness[i / 3]);
        let y = padded(&y, n);
        let mut v = u.clone();
        for (term, v) in problem.terms.iter_mut().zip(&mut v) {
            let mut dy = vec![0.0; v.len()];
            term.couple(&y, &mut dy);
            v.iter_mut().zip(dy).for_each(|(v, dy)| *v -= dy);
        }
        if let Some(before) = &before {
            let change: Vec<Vec<f64>> =
                v.iter().zip(before).map(|(v, b)| v.iter().zip(b).map(|(v, b)| v - b).collect()).collect();
            run.changes.push((weighted(&problem, &change) / mu).sqrt());
        }
        before = Some(v);
        if run.is_over() {
            break;
        }
    }
    Ok(run)
}

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A file that cannot be written; a rate or a descent that is not what is proven.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let bar = Bar::new()?;
    let constants = Constants::of(&bar)?;
    let steps = context.options.max_iters.unwrap_or(if context.options.quick { 60 } else { MOST });
    let _ = writeln!(context.text, "{}\n\n{}", bar.describe(), constants.describe());
    let mut table =
        Table::new(["order", "mu", "mu rho(K)", "L / mu", "proven gamma", "largest ratio measured", "mean"]);
    let mut lines = Vec::new();
    let mut csv = "problem,method,level,iterations,seconds,gamma,largest_ratio\n".to_string();
    let mut descent = String::new();
    for (order, least) in [(Order::Xzu, constants.least_mu_xzu), (Order::Zxu, constants.least_mu_zxu)] {
        for factor in [1.05, 2.0, 8.0] {
            let mu = factor * least;
            let (gamma, l, run) = match order {
                Order::Xzu => {
                    let l = constants.lipschitz_xzu;
                    (constants.gamma_3(mu), l, xzu(&bar, 0.5 - (l / mu).powi(2) - 0.5 * l / mu, mu, steps)?)
                }
                Order::Zxu => (constants.gamma_4(mu), constants.lipschitz_zxu, zxu(&bar, &constants, mu, steps)?),
            };
            let name = format!("{} mu={mu:.3e}", order.as_str());
            let (worst, count) = (run.worst(), run.ratios().count());
            context.tell(&format!("{name}: gamma {gamma:.6}, largest ratio {worst:.6} of {count}"));
            if !(gamma < 1.0 && worst <= gamma && count > 0) {
                return Err(BenchError(format!("{name}: a ratio of {worst} where at most {gamma} is proven")));
            }
            let mean = run.ratios().map(f64::ln).sum::<f64>() / count as f64;
            table.row([
                order.as_str().to_string(),
                format!("{mu:.4e}"),
                format!("{:.4}", mu * constants.rho),
                format!("{:.4}", l / mu),
                format!("{gamma:.6}"),
                format!("{worst:.6}"),
                format!("{:.6}", mean.exp()),
            ]);
            for level in [1e-2, 1e-4, 1e-6, 1e-8] {
                let reached = run.changes.iter().position(|c| *c <= level * run.changes[0]);
                let cell = reached.map_or(String::new(), |k| (k + 1).to_string());
                let _ = writeln!(csv, "stvk-bar,{name},{level:e},{cell},,{gamma},{worst}");
            }
            let first = run.changes[0];
            let measured = run.changes.iter().map(|c| c / first);
            let proven = (0..run.changes.len()).map(|k| gamma.powi(k as i32));
            // The marks are what is proven, the line of the same colour what was measured.
            for (points, marked) in [(thinned(measured, DRAWN), false), (thinned(proven, MARKS), true)] {
                lines.push((order, Line { label: name.clone(), points, style: lines.len() / 2, marked }));
            }
            // The last descents are differences of equal numbers.
            let sound = run.changes.iter().take_while(|c| **c > 1e-5 * first).count();
            let least = run.descents[..sound].iter().copied().fold(f64::INFINITY, f64::min);
            let sum: f64 = run.summed.iter().sum();
            let one = run.summed.first().copied().unwrap_or(f64::NAN);
            if least.is_nan() || least < 1.0 {
                return Err(BenchError(format!("{name}: the Lagrangian fell by {least} of what is promised")));
            }
            let (what, theorem) = match order {
                Order::Xzu => ("|B (z^(k+1) - z^k)|", "A(59)"),
                Order::Zxu => ("|A (x^(k+1) - x^k)|", "the proof of Theorem 3.6"),
            };
            let _ = writeln!(
                descent,
                "- {}, mu = {mu:.4e}: over {sound} steps the augmented Lagrangian fell by at least {least:.3} times what {theorem} \
                 promises; all {} steps {what} sum to {:.4} times the first, the last is {:.1e} of it.",
                order.as_str(),
                run.summed.len(),
                sum / one,
                run.summed.last().copied().unwrap_or(f64::NAN) / one
            );
        }
    }
    let _ = writeln!(
        context.text,
        "## Rates\n\nEvery ratio of successive changes, |B (z^(k+1) - z^k)| of the x-z-u and |v^(k+1) - v^k| of the z-x-u iteration, \
         until they are {ROUNDING:e} of z, which is rounding.\n\n{table}\n## Descent, Theorems 3.5 and 3.6\n\n{descent}"
    );
    safe::descend(context, &bar, steps)?;
    let panel = |title: &str, order: Order| {
        let lines: Vec<Line> = lines.iter().filter(|(of, _)| *of == order).map(|(_, line)| line.clone()).collect();
        let most = lines.iter().flat_map(|line| &line.points).map(|p| p.0).fold(0.0, f64::max);
        Panel {
            title: title.to_string(),
            x_label: "iterations".to_string(),
            y_label: "change over the first".to_string(),
            x: Axis::linear(0.0, most),
            y: Axis::log(SHOWN, 2.0),
            lines,
            map: None,
        }
    };
    context.csv = Some(csv);
    let panels = [panel("x-z-u, Theorem 3.3", Order::Xzu), panel("z-x-u, Theorem 3.4", Order::Zxu)];
    context.plot("", "Linear rates: lines are measured, marks proven", &panels)
}
