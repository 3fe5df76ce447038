//! Figure 3: other accelerations of ADMM on the soft bars.

use super::course::{Course, Residual};
use super::figure2::course;
use super::{COUNTING, LEVELS, csv, most, panel, table};
use crate::BenchError;
use crate::bars::Scene;
use crate::repro::context::Context;
use proxel::split::{Acceleration, Admm, Algorithm, Balancing, Cycle, Extrapolation, History, Kind};
use std::fmt::Write as _;

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    const PROBLEM: &str = "soft-rubber";
    let cells = if context.options.quick { [6, 2, 2] } else { [12, 3, 3] };
    let scene = Scene::new(0.399, cells)?;
    let iterations = most(context, 400);
    let mut courses = Vec::new();
    let mut of = |context: &mut Context<'_>, name: &str, admm: Admm, how: Option<Acceleration>| {
        course(context, (PROBLEM, &scene), (name, admm, how), iterations).map(|course| courses.push(course))
    };
    of(context, "admm", scene.admm()?, None)?;
    of(context, "aa-admm-3 m=6", scene.admm()?, Some(Acceleration::anderson(Algorithm::Three, 6)))?;
    for relaxation in [1.5, 1.6, 1.7, 1.8] {
        let cycle = Cycle { relaxation, ..Cycle::PLAIN };
        let admm = scene.admm()?.with_cycle(cycle).map_err(BenchError::from_display)?;
        of(context, &format!("over-relaxation {relaxation}"), admm, None)?;
    }
    let by = |algorithm, by| Some(Acceleration { algorithm, by, history: History::AsPublished });
    for (name, corrected) in [("fast-admm", false), ("fast-admm corrected", true)] {
        let momentum = Extrapolation::Momentum { eta: Some(0.999), corrected };
        of(context, name, scene.admm()?, by(Algorithm::One, momentum))?;
    }
    let one = Extrapolation::Anderson { window: 6, mixing: 1.0, kind: Kind::One };
    of(context, "type-1 m=6", scene.admm()?, by(Algorithm::Three, one))?;
    of(context, "aadr m=6", scene.admm()?, Some(Acceleration::anderson(Algorithm::Envelope, 6)))?;
    of(context, "residual-balancing", scene.admm()?.with_balancing(Balancing::default()), None)?;

    let all: Vec<&Course> = courses.iter().collect();
    let _ = writeln!(
        context.text,
        "## The methods\n\nThe problem of aa-figure2, soft rubber, frame 1. {COUNTING}\n\nover-relaxation: Eckstein and Bertsekas 1992. \
         fast-admm: Goldstein et al. 2014 with restart, eta = 0.999; its iterations there include those that were restarted. \
         fast-admm corrected: with the correction of Guler 1992, in the place of Kadkhodaie et al. 2015, whose text was not at hand. \
         type-1: Anderson acceleration of type I (Zhang, O'Donoghue and Boyd 2018) on the z of Algorithm 3. aadr: Ouyang et al. 2020. \
         residual-balancing: He, Yang and Wang 2000.\n\n## Forward residual\n\n{}\n## Combined residual\n\n{}",
        table(&all, Residual::Forward),
        table(&all, Residual::Combined)
    );
    // As many curves as there are colours: those of the paper's figure, and what it does not have.
    let published = |c: &&Course| c.method.starts_with("over") || c.method.starts_with("fast");
    for (suffix, keeps) in [("", true), ("others", false)] {
        let both = |c: &&Course| c.method == "admm" || c.method == "aa-admm-3 m=6";
        let most = |c: &&Course| c.method != "over-relaxation 1.7";
        let shown: Vec<&Course> =
            all.iter().copied().filter(|c| both(c) || (published(c) == keeps && most(c))).collect();
        let panels = [
            panel("combined", &shown, Residual::Combined, false),
            panel("forward", &shown, Residual::Forward, false),
            panel("forward", &shown, Residual::Forward, true),
        ];
        context.plot(suffix, "Soft rubber, frame 1", &panels)?;
    }
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}
