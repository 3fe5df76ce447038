//! Figure 2: three bars, two materials, Algorithm 3 with several windows, Algorithm 1.

use super::course::{Course, Residual};
use super::{COUNTING, LEVELS, csv, most, panel, table};
use crate::BenchError;
use crate::bars::Scene;
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::split::{Acceleration, Admm, Algorithm, History, Method, NormalMatrix, vector};
use std::fmt::Write as _;
use std::time::Instant;

/// The residual at which a run ends.
const FLOOR: f64 = 1e-10;

/// Problem, Poisson's ratio, frame, iterations at most.
const PROBLEMS: [(&str, f64, usize, usize); 3] =
    [("soft-rubber", 0.399, 1, 400), ("soft-rubber frame 12", 0.399, 12, 400), ("rubber", 0.499, 1, 1600)];

/// Plain iterations for the frames before the one that is looked at.
const BEFORE: usize = 200;

/// Methods of the plots: those of the paper's figure, and the algorithms beside each other.
const WINDOWS: [&str; 6] =
    ["admm", "aa-admm-3 m=1", "aa-admm-3 m=3", "aa-admm-3 m=6", "aa-admm-3 m=10", "aa-admm-1 m=6"];
const ALGORITHMS: [&str; 6] = ["admm", "aa-admm-1 m=6", "aa-admm-2 m=6", "aa-admm-3 m=6", "aa-admm-4 m=6", "aadr m=6"];

fn methods() -> Vec<(String, Option<Acceleration>)> {
    let of = |algorithm, window| Some(Acceleration::anderson(algorithm, window));
    let mut methods = vec![("admm".to_string(), None)];
    methods.extend([1, 3, 6, 10].map(|m| (format!("aa-admm-3 m={m}"), of(Algorithm::Three, m))));
    // With m = 6 nothing is refused, and there is nothing to clear.
    methods.extend([1, 3].map(|m| {
        let how = Acceleration { history: History::Clear, ..Acceleration::anderson(Algorithm::Three, m) };
        (format!("aa-admm-3 m={m} cleared"), Some(how))
    }));
    methods.push(("aa-admm-1 m=6".to_string(), of(Algorithm::One, 6)));
    methods.push(("aa-admm-2 m=6".to_string(), of(Algorithm::Two, 6)));
    methods.push(("aa-admm-4 m=6".to_string(), of(Algorithm::Four, 6)));
    methods.push(("aadr m=6".to_string(), of(Algorithm::Envelope, 6)));
    methods
}

/// A method on the scene's next frame.
pub(super) fn course(
    context: &mut Context<'_>,
    (problem, scene): (&str, &Scene),
    (name, admm, how): (&str, Admm, Option<Acceleration>),
    most: usize,
) -> Result<Course, BenchError> {
    let order = how.map_or(admm.cycle().order, |how| how.algorithm.order());
    let mut method: Box<dyn Method> = match how {
        Some(how) => how.of(admm).map_err(BenchError::from_display)?,
        None => Box::new(admm),
    };
    let a = scene.bars.mean_edge();
    let course = Course::run(problem, name, &mut *method, order, a, (most, FLOOR))?;
    let last = course.points.last().map_or((0, f64::NAN), |p| (p.iteration, p.forward));
    context.tell(&format!("{problem}: {name}: {} iterations, forward residual {:.1e}", last.0, last.1));
    Ok(course)
}

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let cells = if context.options.quick { [6, 2, 2] } else { [12, 3, 3] };
    let mut courses = Vec::new();
    let mut cost = String::new();
    for (name, poisson, frame, iterations) in PROBLEMS {
        let mut scene = Scene::new(poisson, cells)?;
        while scene.frame() < frame {
            scene.advance(BEFORE)?;
        }
        let iterations = most(context, iterations);
        for (method, how) in methods() {
            let admm = scene.admm()?;
            courses.push(course(context, (name, &scene), (&method, admm, how), iterations)?);
        }
        if frame == 1 && poisson < 0.45 {
            cost = price(&scene, &courses)?;
        }
    }
    let _ = writeln!(
        context.text,
        "## The problem\n\nThree bars of 12 x 3 x 3 cubes (1620 tetrahedra, 624 vertices), corotated, neo-Hookean and StVK, E = 1e7, \
         nu = 0.399 (soft rubber) and 0.499 (rubber), 1522 kg/m^3, under gravity; both ends are held and moved outwards by 1 m/s. One \
         step of implicit Euler, dt = 1/30 s, w^2 = k V with the bulk modulus k. The figure does not tell its frame: frame 1, and \
         frame 12 after frames of {BEFORE} plain iterations. {COUNTING}\n"
    );
    for (name, ..) in PROBLEMS {
        let of: Vec<&Course> = courses.iter().filter(|c| c.problem == name).collect();
        let _ = writeln!(
            context.text,
            "## {name}\n\nIterations to levels of the forward residual.\n\n{}\nAnd of the combined residual.\n\n{}",
            table(&of, Residual::Forward),
            table(&of.iter().filter(|c| c.has(Residual::Combined)).copied().collect::<Vec<_>>(), Residual::Combined)
        );
        let _ = writeln!(context.text, "{}", agreement(&of));
        // As many curves as there are colours.
        let file = name.replace(' ', "-");
        let windows: Vec<&Course> = of.iter().filter(|c| WINDOWS.contains(&c.method.as_str())).copied().collect();
        let algorithms: Vec<&Course> = of.iter().filter(|c| ALGORITHMS.contains(&c.method.as_str())).copied().collect();
        for (suffix, shown) in [("", windows), ("-algorithms", algorithms)] {
            let panels = [
                panel("forward", &shown, Residual::Forward, false),
                panel("combined", &shown, Residual::Combined, false),
                panel("forward", &shown, Residual::Forward, true),
            ];
            context.plot(&format!("{file}{suffix}"), name, &panels)?;
        }
    }
    let _ = writeln!(context.text, "{cost}");
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

/// How far the ends of those that reached the floor are from each other.
fn agreement(courses: &[&Course]) -> String {
    let done: Vec<&&Course> = courses.iter().filter(|c| c.reached(Residual::Forward, FLOOR).is_some()).collect();
    let Some(first) = done.first() else { return "No method reached 1e-10.\n".to_string() };
    let apart = |x: &[f64]| x.iter().zip(&first.x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let most = done.iter().map(|c| apart(&c.x)).fold(0.0, f64::max);
    format!("The ends of the {} runs that reached 1e-10 are at most {most:.1e} m from each other.\n", done.len())
}

/// The price of an iteration beside that of its parts, benched alone in turns.
fn price(scene: &Scene, courses: &[Course]) -> Result<String, BenchError> {
    const TURNS: usize = 60;
    let (mut problem, mut admm) = (scene.problem()?, scene.admm()?);
    let mut normal = NormalMatrix::new(&problem).map_err(BenchError::from_display)?;
    for _ in 0..5 {
        admm.step().map_err(BenchError::from_display)?;
    }
    let (mut p, mut u) = (admm.p().to_vec(), admm.u().to_vec());
    let mut grad = vec![0.0; 3 * problem.n_free];
    let mut least = [f64::INFINITY; 3];
    for _ in 0..TURNS {
        let mut clock = |k: usize, work: &mut dyn FnMut() -> Result<(), BenchError>| -> Result<(), BenchError> {
            let began = Instant::now();
            work()?;
            least[k] = least[k].min(began.elapsed().as_secs_f64());
            Ok(())
        };
        clock(0, &mut || admm.step().map(|_| ()).map_err(BenchError::from_display))?;
        clock(1, &mut || {
            problem.local_step(admm.x(), &mut p, &mut u, &mut grad);
            Ok(())
        })?;
        let mut right = grad.clone();
        clock(2, &mut || normal.solve(&mut right).map_err(BenchError::from_display))?;
        if !vector::is_finite(&right) {
            return Err(BenchError("a solve that is not finite".to_string()));
        }
    }
    let [iteration, sweep, solve] = least;
    let mut table = Table::new(["", "ms"]);
    for (what, s) in [("a plain iteration", iteration), ("a prox sweep alone", sweep), ("a solve alone", solve)] {
        table.row([what.to_string(), format!("{:.3}", 1e3 * s)]);
    }
    let mut text = format!(
        "## The price of an iteration\n\nThe least of {TURNS} turns. An iteration takes {:.2} times as long as a sweep and a solve.\n\n\
         {table}\n| method | ms an iteration, median |\n|---|---|\n",
        iteration / (sweep + solve)
    );
    for course in courses.iter().filter(|c| c.problem == "soft-rubber") {
        let _ = writeln!(text, "| {} | {} |", course.method, seconds(1e3 * course.median()));
    }
    Ok(text)
}
