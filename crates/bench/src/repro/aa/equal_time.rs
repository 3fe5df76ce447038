//! `auto` of `simulate` against plain ADMM, at equal time and at equal counted work.

use super::contest::Contest;
use crate::BenchError;
use crate::motion::{self, Moving};
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use std::fmt::Write as _;

/// Tolerances that `auto` is run with.
const TOLERANCES: [f64; 4] = [1e-2, 1e-4, 1e-6, 1e-9];
/// Where both are compared by positions.
const EXACT: f64 = 1e-11;
/// Iterations of `auto`.
const MOST: usize = 2000;
/// Iterations of plain ADMM beyond which nobody waits.
const LONGEST: usize = 20_000;
/// Plain iterations that are timed to know how many `auto` takes the time of.
const TIMED: usize = 60;
/// What `auto` may be worse by.
const WORSE: f64 = 1.05;
/// Residuals below this are rounding.
const ROUNDING: f64 = 1e-12;

/// A problem: its name, and its frame, counted from 1, with the iterations for each before.
type Frame = (&'static str, usize, usize);

const BARS: [Frame; 4] =
    [("soft-rubber", 1, 200), ("soft-rubber frame 12", 12, 200), ("rubber", 1, 200), ("rubber frame 12", 12, 200)];
const FLAG: [Frame; 3] = [("flag", 5, 60), ("flag frame 15", 15, 60), ("flag frame 30", 30, 60)];
const PIT: [Frame; 2] = [("pit", 30, 60), ("pit frame 34", 34, 13)];
const CYLINDERS: [Frame; 3] = [("cylinders", 20, 60), ("cylinders frame 30", 30, 60), ("cylinders frame 22", 22, 13)];

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let mut text = String::new();
    let mut rows = Rows::new();
    for (name, frame, before) in BARS {
        rows.of(context, name, &Contest::of_bars(name.starts_with("soft"), frame, before)?)?;
    }
    for (find, frames) in
        [(motion::flag as Finder, &FLAG[..]), (motion::pit, &PIT[..]), (motion::cylinders, &CYLINDERS[..])]
    {
        let found = find()?;
        let _ = writeln!(text, "{}", found.source);
        for (name, frame, before) in frames.iter().take(if context.options.quick { 1 } else { usize::MAX }) {
            let mut moving = Moving::new(found.body.clone())?;
            while moving.frames() + 1 < *frame {
                moving.advance(*before)?;
            }
            let file = context.file(&name.replace(' ', "-"));
            rows.of(context, name, &Contest::of_body(moving, &context.options.out.clone(), &file)?)?;
        }
    }
    let _ = writeln!(context.text, "{text}\n{WHAT}\n\n{}\n{}", rows.table, rows.verdict());
    context.csv = Some(rows.csv);
    Ok(())
}

type Finder = fn() -> Result<motion::Find, BenchError>;

const WHAT: &str = "`auto` solves the step at each tolerance; its time is that of the whole frame, the least of the repeats, \
    matrices that steps have in common being there. Plain ADMM is the paper's, w^2 = k V, and gets as many \
    iterations as fit into that time, an iteration taking the median, the least of the repeats. Residuals are forward residuals \
    normalised by A(27): of plain ADMM A(22) or A(24) of the last iteration; of `auto` that of the plain iteration \
    entered at its end, z = Dx and u from the forces of elements and of contact there, |W D A^-1 grad|. Forces of \
    limits are not told apart: the residual of `auto` on the flag is a bound, |grad|/2 over the root of the least \
    m/dt^2. Gradient: its norm over free vertices, forces of contact and of limits included, by which `simulate` \
    ends a step; of plain ADMM that of the objective at its positions, where there are no sets, and the seconds \
    after which it is first at what `auto` had to be below. Error: the largest distance of a vertex from the end \
    of `auto` at 1e-11 in mean edges; among obstacles a step has many minima, and an error that stays may tell of \
    another one. J: f + sum g at the positions, sets aside, in joules. Violation: of limits, or depth in an \
    obstacle in metres. Counted: what `auto` costs as `split::Price` counts it, in plain iterations, and plain \
    ADMM's residual after as many.";

struct Rows {
    table: Table,
    csv: String,
    worst: f64,
    compared: usize,
    worse: Vec<String>,
}

impl Rows {
    fn new() -> Self {
        let table = Table::new([
            "problem",
            "tol",
            "auto",
            "its",
            "s",
            "gradient",
            "residual",
            "error",
            "J",
            "violation",
            "plain s to the same",
            "plain its in that time",
            "gradient",
            "residual",
            "error",
            "J",
            "violation",
            "counted its",
            "residual",
        ]);
        let csv = "problem,method,level,iterations,seconds,status,residual,objective,violation\n".to_string();
        Rows { table, csv, worst: 0.0, compared: 0, worse: Vec::new() }
    }

    fn of(&mut self, context: &mut Context<'_>, name: &str, contest: &Contest) -> Result<(), BenchError> {
        let (repeats, threads) = (context.options.repeats, context.options.threads);
        let ends = TOLERANCES.map(|tol| contest.auto(tol, MOST, repeats, threads));
        let ends = ends.into_iter().collect::<Result<Vec<_>, _>>()?;
        let exact = contest.auto(EXACT, MOST, 1, threads)?;
        let exact = (exact.record.status == "converged").then_some(exact.x);
        let price = contest.price()?;
        // The least of the repeats, as that of `auto` is.
        let mut iteration = f64::INFINITY;
        for _ in 0..=repeats.max(1) {
            iteration = iteration.min(contest.by_admm(TIMED, &[])?.0.median());
        }
        let counted: Vec<usize> =
            ends.iter().map(|e| ((e.record.iterations as f64 * price) as usize).clamp(1, LONGEST)).collect();
        let timed: Vec<usize> = ends.iter().map(|e| ((e.seconds / iteration) as usize).clamp(1, LONGEST)).collect();
        let most = counted.iter().chain(&timed).copied().max().unwrap_or(1);
        let (course, at) = contest.by_admm(most, &timed)?;
        let residual_at = |n: usize| course.points.get(n - 1).map_or(f64::NAN, |p| p.forward);
        let gradient_at = |n: usize| course.points.get(n - 1).map_or(f64::INFINITY, |p| p.position);
        let number = |v: f64| if v.is_finite() { format!("{v:.1e}") } else { "-".to_string() };
        let mut problem = contest.problem()?;
        let far = |x: &[f64]| exact.as_ref().map_or(f64::INFINITY, |e| apart(x, e) / contest.a);
        let error = |x: &[f64]| number(far(x));
        for (k, end) in ends.iter().enumerate() {
            let (plain, tol) = (residual_at(timed[k]), TOLERANCES[k]);
            // By what a step converges by where both have it, else by residuals.
            let (own, other) = (end.record.gradient.unwrap_or(f64::INFINITY), gradient_at(timed[k]));
            let ratio = match (other.is_finite(), contest.has_limits()) {
                (true, _) => own / other,
                (false, true) => far(&end.x) / far(&at[k]),
                (false, false) => end.forward.max(ROUNDING) / plain.max(ROUNDING),
            };
            let bound = end.record.gradient_bound;
            let reached = course.points.iter().find(|p| p.position <= bound).map(|p| p.iteration as f64 * iteration);
            self.compared += 1;
            self.worst = if ratio > self.worst || ratio.is_nan() { ratio } else { self.worst };
            if ratio.is_nan() || ratio > WORSE {
                let status = &end.record.status;
                self.worse.push(format!("{name} at {tol:e} ({status}): {ratio:.2} times; {}", end.record.reason));
            }
            let (own, other) = (problem.energy(&end.x, None).value, problem.energy(&at[k], None).value);
            self.table.row([
                name.to_string(),
                format!("{tol:e}"),
                end.record.status.clone(),
                end.record.iterations.to_string(),
                seconds(end.seconds),
                number(end.record.gradient.unwrap_or(f64::INFINITY)),
                format!("{:.1e}", end.forward),
                error(&end.x),
                format!("{own:.7e}"),
                format!("{:.1e}", contest.violation(&end.x)),
                reached.map_or("-".to_string(), seconds),
                timed[k].to_string(),
                number(gradient_at(timed[k])),
                format!("{plain:.1e}"),
                error(&at[k]),
                format!("{other:.7e}"),
                format!("{:.1e}", contest.violation(&at[k])),
                counted[k].to_string(),
                format!("{:.1e}", residual_at(counted[k])),
            ]);
            let row = |method: &str, n: usize, s: f64, status: &str, r: f64, j: f64, v: f64| {
                format!("{name},{method},{tol:e},{n},{s:.6},{status},{r:e},{j:e},{v:e}\n")
            };
            let (s, n) = (end.seconds, end.record.iterations);
            self.csv += &row("auto", n, s, &end.record.status, end.forward, own, contest.violation(&end.x));
            self.csv += &row("admm", timed[k], s, "", plain, other, contest.violation(&at[k]));
            let (n, r) = (counted[k], residual_at(counted[k]));
            let _ = writeln!(self.csv, "{name},admm counted,{tol:e},{n},{:.6},,{r:e},,", n as f64 * iteration);
            context.tell(&format!(
                "{name}: auto at {tol:e}: {} after {} iterations, {} s, residual {:.1e}; admm {plain:.1e} after {}",
                end.record.status,
                end.record.iterations,
                seconds(end.seconds),
                end.forward,
                timed[k]
            ));
        }
        Ok(())
    }

    fn verdict(&self) -> String {
        let mut text = format!(
            "In {} of {} comparisons what `auto` ends with is at most {WORSE} times what plain ADMM has after the same time: the \
             gradient on bars, the error on the flag, the residual among obstacles. The largest ratio is {:.1e}.\n\n",
            self.compared - self.worse.len(),
            self.compared,
            self.worst
        );
        self.worse.iter().for_each(|w| text += &format!("- {w}\n"));
        text
    }
}

/// The largest distance of a vertex.
fn apart(x: &[f64], y: &[f64]) -> f64 {
    let far = |(x, y): (&[f64; 3], &[f64; 3])| (0..3).map(|d| (x[d] - y[d]).powi(2)).sum::<f64>().sqrt();
    x.as_chunks::<3>().0.iter().zip(y.as_chunks::<3>().0).map(far).fold(0.0, f64::max)
}
