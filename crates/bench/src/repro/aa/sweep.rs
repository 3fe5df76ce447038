//! The open questions of A, section 5: window, mixing, weights and penalty, one at a time and two together.

use super::most;
use crate::BenchError;
use crate::bars::{Scene, Weights};
use crate::plot::{Axis, Line, Panel};
use crate::repro::context::Context;
use crate::table::Table;
use proxel::split::{Acceleration, Algorithm, Extrapolation, History, Kind, Method};
use std::fmt::Write as _;

/// Position errors, over the mean edge, at which iterations are counted: residuals under different weights cannot be
/// compared, positions can.
const LEVELS: [f64; 2] = [1e-3, 1e-6];

const WINDOWS: [usize; 8] = [1, 2, 3, 4, 6, 8, 10, 15];
const MIXINGS: [f64; 4] = [0.5, 0.7, 0.9, 1.0];
const PENALTIES: [f64; 7] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// Iterations to each level, and rejections until the last.
type Cost = ([Option<usize>; 2], usize);

fn cost(scene: &Scene, how: Option<Acceleration>, exact: &[f64], most: usize) -> Result<Cost, BenchError> {
    let admm = scene.admm()?;
    let mut method: Box<dyn Method> = match how {
        Some(how) => how.of(admm).map_err(BenchError::from_display)?,
        None => Box::new(admm),
    };
    let a = scene.bars.mean_edge();
    let (mut reached, mut rejected) = ([None; 2], 0);
    for iteration in 1..=most {
        rejected += method.step().map_err(BenchError::from_display)?.trial.rejected;
        let apart = method.x().iter().zip(exact).map(|(x, e)| (x - e).abs()).fold(0.0, f64::max) / a;
        for (reached, level) in reached.iter_mut().zip(LEVELS) {
            if apart <= level {
                reached.get_or_insert(iteration);
            } else {
                *reached = None; // it has to stay there
            }
        }
        if apart <= 0.1 * LEVELS[1] {
            break;
        }
    }
    Ok((reached, rejected))
}

fn cell((reached, rejected): &Cost) -> String {
    let [first, last] = reached.map(|n| n.map_or("-".to_string(), |n| n.to_string()));
    if *rejected > 0 { format!("{first}, {last} (+{rejected})") } else { format!("{first}, {last}") }
}

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let quick = context.options.quick;
    let cells = if quick { [6, 2, 2] } else { [12, 3, 3] };
    let mut csv = "problem,method,level,iterations,seconds,rejected\n".to_string();
    let _ = writeln!(
        context.text,
        "Algorithm 3 with Anderson acceleration on the problems of aa-figure2, frame 1. Iterations after which positions stay within 1e-3 \
         and within 1e-6 of the mean edge of the solution; in brackets proposals refused. W^2 = mu k V, k the bulk modulus.\n"
    );
    for (problem, poisson, limit) in [("soft-rubber", 0.399, 600), ("rubber", 0.499, 1500)] {
        if quick && poisson > 0.45 {
            continue;
        }
        let mut scene = Scene::new(poisson, cells)?;
        let limit = most(context, limit);
        context.tell(&format!("{problem}: its solution"));
        let exact = solution(&scene, if quick { 400 } else { 4000 })?;
        let with = |window, mixing| {
            let by = Extrapolation::Anderson { window, mixing, kind: Kind::Two };
            Some(Acceleration { algorithm: Algorithm::Three, by, history: History::AsPublished })
        };
        let mut keep = |name: &str, cost: &Cost| {
            for (level, reached) in LEVELS.iter().zip(cost.0) {
                let n = reached.map_or(String::new(), |n| n.to_string());
                let _ = writeln!(csv, "{problem},{name},{level:e},{n},,{}", cost.1);
            }
        };
        let mut table =
            Table::new(["m".to_string()].into_iter().chain(MIXINGS.iter().map(|beta| format!("beta = {beta}"))));
        for window in WINDOWS {
            let mut row = vec![window.to_string()];
            for mixing in MIXINGS {
                let cost = cost(&scene, with(window, mixing), &exact, limit)?;
                keep(&format!("aa-admm-3 m={window} beta={mixing}"), &cost);
                row.push(cell(&cost));
            }
            context.tell(&format!("{problem}: m = {window}: {}", row.join("; ")));
            table.row(row);
        }
        let _ = writeln!(context.text, "## {problem}: window and mixing\n\n{table}");
        let mut table = Table::new(["mu", "admm", "m = 1", "m = 3", "m = 6", "m = 10"]);
        let mut curves: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
        for mu in PENALTIES {
            scene.mu = mu;
            let mut row = vec![mu.to_string()];
            for (k, how) in [None, with(1, 1.0), with(3, 1.0), with(6, 1.0), with(10, 1.0)].into_iter().enumerate() {
                let name = ["admm", "aa-admm-3 m=1", "aa-admm-3 m=3", "aa-admm-3 m=6", "aa-admm-3 m=10"][k];
                let cost = cost(&scene, how, &exact, limit)?;
                keep(&format!("{name} mu={mu}"), &cost);
                row.push(cell(&cost));
                if curves.len() == k {
                    curves.push((name.to_string(), Vec::new()));
                }
                curves[k].1.extend(cost.0[1].map(|n| (mu, n as f64)));
            }
            context.tell(&format!("{problem}: mu = {}", row.join("; ")));
            table.row(row);
        }
        scene.mu = 1.0;
        let mut weighed = Table::new(["W^2 / V", "admm", "m = 3", "m = 6"]);
        for weights in Weights::ALL {
            scene.weights = weights;
            let mut row = vec![weights.as_str().to_string()];
            for (name, how) in [("admm", None), ("aa-admm-3 m=3", with(3, 1.0)), ("aa-admm-3 m=6", with(6, 1.0))] {
                let cost = cost(&scene, how, &exact, limit)?;
                keep(&format!("{name} W={}", weights.as_str()), &cost);
                row.push(cell(&cost));
            }
            context.tell(&format!("{problem}: W = {}", row.join("; ")));
            weighed.row(row);
        }
        scene.weights = Weights::Bulk;
        let _ = writeln!(
            context.text,
            "## {problem}: penalty and window, beta = 1\n\n{table}\n## {problem}: weights at rest, beta = 1\n\n{weighed}"
        );
        let lines: Vec<Line> = curves
            .into_iter()
            .enumerate()
            .map(|(style, (label, points))| Line { label, points, style, marked: true })
            .collect();
        let all = || lines.iter().flat_map(|line| &line.points);
        let panel = Panel {
            title: format!("{problem}: iterations to 1e-6"),
            x_label: "mu".to_string(),
            y_label: "iterations".to_string(),
            x: Axis::log(0.1, 10.0),
            y: Axis::log_around(all().map(|p| p.1)),
            lines,
            map: None,
        };
        context.plot(problem, "Penalty and window", &[panel])?;
    }
    context.csv = Some(csv);
    Ok(())
}

/// Where all of them go.
fn solution(scene: &Scene, most: usize) -> Result<Vec<f64>, BenchError> {
    let mut method =
        Acceleration::anderson(Algorithm::Three, 10).of(scene.admm()?).map_err(BenchError::from_display)?;
    for _ in 0..most {
        method.step().map_err(BenchError::from_display)?;
        let forward = method.forward_residual().unwrap_or(f64::INFINITY);
        if proxel::split::normalized(forward, method.problem().local_dim(), scene.bars.mean_edge()) < 1e-11 {
            break;
        }
    }
    Ok(method.x().to_vec())
}
