//! Thousands of random disks at defaults: how many end flip-free and converged, and why the others do not.

use crate::BenchError;
use crate::disks::{Disk, disk, sources};
use crate::maps;
use crate::repro::context::{Context, Reached};
use crate::table::{Table, seconds};
use proxel::mesh::uv::{CertificateOptions, certify};
use proxel::mesh::{Fields, write_mesh};
use proxel::settings::UnwrapSettings;
use proxel::split::Status;
use proxel::unwrap::{Hooks, UnwrapInput, unwrap};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Disks, where no number is asked for, and of a quick run.
const COUNT: usize = 2000;
const QUICK: usize = 60;

/// Part of them that is to end flip-free and converged.
const ASKED: f64 = 0.999;

/// A run that takes longer is ended, seconds: what hangs shows, what is slow on a busy machine goes on.
const PATIENCE: f64 = 600.0;

/// Numbers tried between two words on how far it is.
const AT_ONCE: usize = 50;

/// How the map of a disk ended.
struct Ended {
    disk: Disk,
    status: Option<Status>, // none where there is no map
    reason: String,
    bad: usize, // triangles turned over or without area in the map
    iterations: usize,
    seconds: f64,
    energy: f64,
}

impl Ended {
    fn is_flip_free(&self) -> bool {
        self.status.is_some() && self.bad == 0
    }

    fn is_good(&self) -> bool {
        self.is_flip_free() && self.status == Some(Status::Converged)
    }

    /// What the disk is of.
    fn kind(&self) -> &'static str {
        match &self.disk.made {
            made if made.contains("cut along") => "cuts",
            made if made.starts_with("patch") => "patches",
            _ => "sheets",
        }
    }
}

pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let wanted = context.options.count.unwrap_or(if context.options.quick { QUICK } else { COUNT });
    let folder = maps::folder("surfaces");
    let sources = sources(folder.as_deref())?;
    let max_iters = context.options.max_iters.unwrap_or(UnwrapSettings::default().max_iters);
    // One thread each, many at once.
    let settings =
        UnwrapSettings { threads: Some(1), time_limit: Some(PATIENCE), max_iters, ..UnwrapSettings::default() };
    let workers = context.options.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build().map_err(BenchError::from_display)?;
    let (mut ends, mut no_disks, mut seed) = (Vec::new(), Vec::new(), 0);
    while ends.len() < wanted && no_disks.len() <= wanted {
        let seeds: Vec<u64> = (seed..seed + AT_ONCE.min(wanted - ends.len()) as u64).collect();
        seed += seeds.len() as u64;
        let one = |seed: &u64| disk(*seed, &sources).map(|d| map(d, &settings));
        let tried: Vec<Result<Ended, String>> = pool.install(|| seeds.par_iter().map(one).collect());
        for end in tried {
            match end {
                Ok(end) => {
                    if !end.is_good() {
                        keep(context, &end)?;
                    }
                    ends.push(end);
                }
                Err(what) => no_disks.push(what),
            }
        }
        let bad = ends.iter().filter(|e| !e.is_good()).count();
        context.tell(&format!("{} of {wanted} disks, {bad} not flip-free and converged", ends.len()));
    }
    for end in &ends {
        context.reached.push(Reached {
            problem: end.disk.mesh.name.clone(),
            method: "auto".to_string(),
            level: "flip-free and converged".to_string(),
            at: end.is_good().then_some((end.iterations, end.seconds)),
        });
    }
    let of = |folder: bool| if folder { " and the surfaces of data/surfaces" } else { "; no PROXEL_DATA" };
    let _ = writeln!(
        context.text,
        "Disks made from the numbers 0 to {}: patches, cuts and sheets, of a ball, a torus, an octopus{}; some decimated, made \
         noisy, scaled. {} that came out as no disk do not count. Defaults, one thread a mesh, {PATIENCE} s and {max_iters} \
         iterations at most.\n",
        seed.saturating_sub(1),
        of(folder.is_some()),
        no_disks.len()
    );
    summarise(context, &ends);
    list(context, &ends);
    Ok(())
}

/// Maps a disk, and looks at what came of it.
fn map(disk: Disk, settings: &UnwrapSettings) -> Ended {
    let input = UnwrapInput { mesh: disk.mesh.clone(), ..UnwrapInput::default() };
    let began = std::time::Instant::now();
    let end = catch_unwind(AssertUnwindSafe(|| unwrap(&input, settings, &mut Hooks::default())));
    let seconds = began.elapsed().as_secs_f64();
    let none = |reason: String| Ended {
        disk: disk.clone(),
        status: None,
        reason,
        bad: 0,
        iterations: 0,
        seconds,
        energy: f64::NAN,
    };
    let map = match end {
        Err(_) => return none("it panicked".to_string()),
        Ok(Err(e)) => return none(e.to_string()),
        Ok(Ok(map)) => map,
    };
    let options = CertificateOptions { reversed_faces: map.charts.reversed_faces.clone() };
    let certificate = match certify(&input.mesh.points, &input.mesh.faces, &map.uv, &options) {
        Ok(certificate) => certificate,
        Err(e) => return none(e.to_string()),
    };
    Ended {
        status: Some(map.status),
        reason: format!("{}: {}", map.report.status, map.report.reason),
        bad: certificate.flips + certificate.zero_area + certificate.unmapped_faces,
        iterations: map.report.iterations,
        energy: certificate.distortion.energy,
        ..none(String::new())
    }
}

fn summarise(context: &mut Context<'_>, ends: &[Ended]) {
    let mut table = Table::new([
        "disks",
        "number",
        "faces",
        "flip-free",
        "flip-free and converged",
        "iterations: median, 99 %, most",
        "seconds: median, 99 %, most",
        "energy: median, most",
    ]);
    for kind in ["patches", "cuts", "sheets", "all"] {
        let of: Vec<&Ended> = ends.iter().filter(|e| kind == "all" || e.kind() == kind).collect();
        let sorted = |value: &dyn Fn(&Ended) -> f64| {
            let mut values: Vec<f64> = of.iter().map(|e| value(e)).filter(|v| v.is_finite()).collect();
            values.sort_by(f64::total_cmp);
            move |part: f64| {
                values.get((part * values.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN)
            }
        };
        let (faces, iterations) = (sorted(&|e| e.disk.mesh.faces.len() as f64), sorted(&|e| e.iterations as f64));
        let (time, energy) = (sorted(&|e| e.seconds), sorted(&|e| e.energy));
        let count = |good: &dyn Fn(&Ended) -> bool| of.iter().filter(|e| good(e)).count();
        table.row([
            kind.to_string(),
            of.len().to_string(),
            format!("{} to {}", faces(0.0), faces(1.0)),
            count(&|e| e.is_flip_free()).to_string(),
            count(&|e| e.is_good()).to_string(),
            format!("{}, {}, {}", iterations(0.5), iterations(0.99), iterations(1.0)),
            format!("{}, {}, {}", seconds(time(0.5)), seconds(time(0.99)), seconds(time(1.0))),
            format!("{:.4}, {:.4e}", energy(0.5), energy(1.0)),
        ]);
    }
    let good = ends.iter().filter(|e| e.is_good()).count();
    let part = 100.0 * good as f64 / ends.len().max(1) as f64;
    let _ = writeln!(
        context.text,
        "{table}\n{good} of {} disks, {part:.2} %, end flip-free and converged (asked: {} %; the paper, of 15,000 meshes: 96.2 % \
         for WRAPD and 98.7 % for WRAPD+CM).\n",
        ends.len(),
        100.0 * ASKED
    );
}

fn file(disk: &Disk) -> String {
    format!("{}.obj", disk.mesh.name)
}

/// Writes a disk that failed to the folder of the results.
fn keep(context: &mut Context<'_>, end: &Ended) -> Result<(), BenchError> {
    context.tell(&format!(
        "{}: {} faces, {}: {}, {} bad triangles",
        end.disk.mesh.name,
        end.disk.mesh.faces.len(),
        end.disk.made,
        end.reason,
        end.bad
    ));
    write_mesh(&context.options.out.join(file(&end.disk)), &end.disk.mesh, &Fields::default())
        .map_err(BenchError::from_display)
}

/// The disks that failed, whose meshes are in the folder of the results.
fn list(context: &mut Context<'_>, ends: &[Ended]) {
    let mut table = Table::new(["mesh", "faces", "made", "bad triangles", "iterations", "seconds", "how it ended"]);
    for end in ends.iter().filter(|e| !e.is_good()) {
        table.row([
            file(&end.disk),
            end.disk.mesh.faces.len().to_string(),
            end.disk.made.clone(),
            end.bad.to_string(),
            end.iterations.to_string(),
            seconds(end.seconds),
            end.reason.clone(),
        ]);
    }
    if !table.is_empty() {
        let _ = writeln!(context.text, "## Those that did not\n\n{table}");
    }
}
