//! Figure 11: the wavefront that a coded sensor has seen, accelerated on z alone and by GMRES.

use super::course::{Course, Residual};
use super::figure12::combined;
use super::{csv, panel};
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::Table;
use proxel::imaging::wavefront::{
    Linearised, PyramidSettings, SimulateSettings, Solver, coarse_to_fine, comparable, simulate,
};
use std::fmt::Write as _;

const LEVELS: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];

/// Names and what they stand for.
const METHODS: [(&str, Solver); 10] = [
    ("admm", Solver::Admm { relaxation: 1.0 }),
    ("relaxed 1.8", Solver::Admm { relaxation: 1.8 }),
    ("fast", Solver::Fast),
    ("aa-admm-1 m=6", Solver::AlgorithmOne { window: 6 }),
    ("aa z m=3", Solver::LocalAlone { window: 3 }),
    ("aa z m=6", Solver::LocalAlone { window: 6 }),
    ("aa z m=10", Solver::LocalAlone { window: 10 }),
    ("aa z m=20", Solver::LocalAlone { window: 20 }),
    ("gmres(10)", Solver::Gmres { restart: 10 }),
    ("pcg", Solver::Pcg),
];

/// What another implementation counted to the levels, on a crop of the data of Figure 11 and on a synthetic pair of its own.
const THEIRS: [(&str, &str); 7] = [
    ("admm", "36 84 164 - / 18 124 -"),
    ("aa z m=3", "25 53 92 151 / 14 73 -"),
    ("aa z m=6", "23 49 88 143 / 12 67 198"),
    ("aa z m=10", "23 48 84 135 / 12 64 182"),
    ("aa z m=20", "22 47 80 125 / 12 61 149"),
    ("gmres(10)", "34 56 89 144 / 12 78 199"),
    ("pcg", "161 / 72 132 192"),
];

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let size = if context.options.quick { 96 } else { 256 };
    let simulation = SimulateSettings { size, max_shift: 0.5, seed: 1 };
    let of = problem(&simulation)?;
    let _ = writeln!(
        context.text,
        "Data: none; a synthetic pair of {size} x {size} pixels (`proxel wavefront --simulate {size},0.5,1`), since that of the \
         figure may not be given away.\n\n## The problem\n\nThe first warp of A(32) on the finest level: beta = {}, mu = {}, a \
         margin of {} pixels, textures with values from 0 to 255. Residual: the combined one, \
         sqrt(mu (|grad phi - z|^2 + |dz|^2) / N), of the plain iteration; for gmres and pcg, of that from the point they are at. \
         Last column: counts of another implementation to the same levels, on a crop of the figure's data / on a synthetic pair of \
         its own, which depend on the data: what is to be compared is the ranking. Seconds are those of iterations alone.\n",
        of.beta,
        of.mu,
        PyramidSettings::default().margin
    );
    let n = (of.width * of.height) as f64;
    let mut courses = Vec::new();
    for (name, solver) in METHODS {
        let mut method = of.method(solver).map_err(BenchError::from_display)?;
        let (most, floor) = (context.options.max_iters.unwrap_or(2000), LEVELS[LEVELS.len() - 1]);
        let course = combined("speckle", name, &mut *method, 1.0, (most, floor))?;
        let last = course.points.last().map_or((0, f64::NAN), |p| (p.iteration, p.combined));
        context.tell(&format!("{name}: {} iterations, residual {:.1e}", last.0, last.1));
        courses.push(course);
    }
    let _ = writeln!(context.text, "{}", table(&courses, n));
    let shown: Vec<&Course> = courses.iter().filter(|c| SHOWN.contains(&c.method.as_str())).collect();
    let panels =
        [panel("iterations", &shown, Residual::Combined, false), panel("time", &shown, Residual::Combined, true)];
    context.plot("speckle", "wavefront", &panels)?;
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

/// What the plot has.
const SHOWN: [&str; 5] = ["admm", "aa-admm-1 m=6", "aa z m=6", "gmres(10)", "pcg"];

/// The linearised problem of a pair, without a pyramid.
fn problem(simulation: &SimulateSettings) -> Result<Linearised, BenchError> {
    let pair = simulate(simulation).map_err(BenchError::from_display)?;
    let planes = comparable(&pair.reference, &pair.captured, true).map_err(BenchError::from_display)?;
    let settings = PyramidSettings { coarsest: simulation.size, warps: 1, ..PyramidSettings::default() };
    let mut found = None;
    let solved: Result<_, BenchError> = coarse_to_fine(&planes, &settings, &mut |_, of| {
        found = Some(of.clone());
        Ok(vec![0.0; of.width * of.height])
    });
    solved?;
    found.ok_or_else(|| BenchError::from_display("the pyramid has no level"))
}

fn table(courses: &[Course], pixels: f64) -> Table {
    let levels = LEVELS.iter().map(|level| format!("{level:e}"));
    let columns = ["ns a pixel and iteration", "elsewhere"].map(str::to_string);
    let mut table = Table::new(["method".to_string()].into_iter().chain(levels).chain(columns));
    for course in courses {
        let cell = |level: &f64| match course.reached(Residual::Combined, *level) {
            Some(p) if p.rejected > 0 => format!("{} (+{})", p.iteration, p.rejected),
            Some(p) => p.iteration.to_string(),
            None => "-".to_string(),
        };
        let theirs = THEIRS.iter().find(|(method, _)| *method == course.method).map_or("", |(_, counts)| counts);
        let nanoseconds = format!("{:.0}", 1e9 * course.median() / pixels);
        let cells = [course.method.clone()].into_iter().chain(LEVELS.iter().map(cell));
        table.row(cells.chain([nanoseconds, theirs.to_string()]));
    }
    table
}
