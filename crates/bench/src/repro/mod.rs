//! Reproductions of the WRAPD paper's quasi-static results, and of the comparisons behind the defaults.
//!
//! Each writes NAME.md, NAME.csv (problem, method, level, iterations, seconds: a row a level, empty cells where it was not
//! reached) and its plots, and says which data it found.

mod aa;
mod comparison;
mod context;
mod figure2;
mod figure4;
mod figure8;
mod growth;
pub mod hopeless;
mod imaging_quality;
mod live;
mod maps;
mod race;
mod schedules;
mod spring;
mod sweeps;
mod table1;
mod variants;
mod weights;

pub use context::{Context, Options};

use crate::{BenchError, data};
use std::fmt::Write as _;

/// A reproduction.
pub struct Reproduction {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it shows.
    pub about: &'static str,
    /// Models where none are named: all that are found if empty.
    pub models: &'static [&'static str],
    /// What its models are.
    pub kind: Kind,
    run: fn(&mut Context<'_>) -> Result<(), BenchError>,
}

impl Reproduction {
    /// Whether its text speaks of maps.
    fn is_of_maps(&self) -> bool {
        self.kind == Kind::Maps || self.name.starts_with("unwrap")
    }
}

/// What a reproduction is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Bodies that are deformed.
    Bodies,
    /// Surfaces that are mapped.
    Maps,
    /// It makes what it needs.
    Standalone,
    /// Bodies in motion, from files or stand-ins; it says itself which.
    Moving,
}

/// Models that solve fast.
const SMALL: &[&str] = &["shear", "homer", "dancer", "untwist", "stretch"];

/// All reproductions.
pub const ALL: [Reproduction; 35] = [
    Reproduction {
        name: "wrapd-table1",
        about: "iterations and seconds of all methods on all models, beside Table 1; convergence as in Figures 1, 6, 7",
        models: &[],
        kind: Kind::Bodies,
        run: table1::run,
    },
    Reproduction {
        name: "wrapd-figure2",
        about: "the spring: its energy over edge vector and length; linear against rotation-aware splitting",
        models: &[],
        kind: Kind::Standalone,
        run: figure2::run,
    },
    Reproduction {
        name: "wrapd-figure4",
        about: "with and without rotation awareness and reweighting; R-ADMM against weight multipliers",
        models: &["homer"],
        kind: Kind::Bodies,
        run: figure4::run,
    },
    Reproduction {
        name: "wrapd-figure8",
        about: "cloth with hard strain limits: position error against time, and pictures at equal time",
        models: &[],
        kind: Kind::Standalone,
        run: figure8::run,
    },
    Reproduction {
        name: "wrapd-sweeps",
        about: "gamma, kappa, k_rw, window and the range of weights, one at a time",
        models: SMALL,
        kind: Kind::Bodies,
        run: sweeps::run,
    },
    Reproduction {
        name: "race",
        about: "`auto` against `wrapd`: seconds to a position error of 1e-4 and to an energy error of 1e-10, in turns",
        models: &[],
        kind: Kind::Bodies,
        run: race::run,
    },
    Reproduction {
        name: "growth",
        about: "seconds at 1, 8 and 64 times the size: `auto`, `wrapd`, `newton` and `newton-cg`",
        models: &["beam", "homer", "centaur"],
        kind: Kind::Bodies,
        run: growth::run,
    },
    Reproduction {
        name: "hopeless",
        about: "from starts that are collapsed, random, mirrored or reflected: does `auto` end at a stationary point",
        models: &[],
        kind: Kind::Bodies,
        run: hopeless::run,
    },
    Reproduction {
        name: "live",
        about: "a handle moves: error against time from the last minimum, beside WRAPD iterations and a cold solve",
        models: &["centaur"],
        kind: Kind::Bodies,
        run: live::run,
    },
    Reproduction {
        name: "schedules",
        about: "paper, reference and default schedule, and what they differ in, one at a time",
        models: &[],
        kind: Kind::Bodies,
        run: schedules::run,
    },
    Reproduction {
        name: "weights",
        about: "first weights near incompressibility, weights that are no scalars, Anderson acceleration of WRAPD",
        models: SMALL,
        kind: Kind::Bodies,
        run: weights::run,
    },
    Reproduction {
        name: "wrapd-table2",
        about: "iterations and seconds of all methods to the early and the late phase of maps, beside Table 2",
        models: &[],
        kind: Kind::Maps,
        run: maps::table2::run,
    },
    Reproduction {
        name: "wrapd-table3",
        about: "the early phase of maps against subdivision, beside Table 3; Figure 10",
        models: &["dino"],
        kind: Kind::Maps,
        run: maps::table3::run,
    },
    Reproduction {
        name: "wrapd-figure3",
        about: "how long the global step goes on: kappa",
        models: &["horse", "dog"],
        kind: Kind::Maps,
        run: maps::figures::figure3,
    },
    Reproduction {
        name: "wrapd-figure5",
        about: "maps with and without rotation awareness and reweighting",
        models: &["horse"],
        kind: Kind::Maps,
        run: maps::figures::figure5,
    },
    Reproduction {
        name: "wrapd-figure9",
        about: "seconds a vertex over many surfaces, as histograms",
        models: &["horse", "dino", "dog", "bimba"],
        kind: Kind::Maps,
        run: maps::figures::figure9,
    },
    Reproduction {
        name: "wrapd-figure10",
        about: "as wrapd-table3",
        models: &["dino"],
        kind: Kind::Maps,
        run: maps::table3::run,
    },
    Reproduction {
        name: "wrapd-figure11",
        about: "energy and its error against time, phases, maps and textured surfaces",
        models: &[],
        kind: Kind::Maps,
        run: maps::figures::figure11,
    },
    Reproduction {
        name: "aa-figure1",
        about: "a quad mesh made planar (costa): ADMM, AA-ADMM and others, residuals, planarity, pictures at equal time",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure1::run,
    },
    Reproduction {
        name: "aa-figure2",
        about: "three bars, Algorithms 1 to 4 of AA-ADMM beside plain ADMM: residuals against iterations and time",
        models: &[],
        kind: Kind::Standalone,
        run: aa::figure2::run,
    },
    Reproduction {
        name: "aa-figure3",
        about: "the same bars: over-relaxation, fast ADMM, type-I Anderson and others beside AA-ADMM",
        models: &[],
        kind: Kind::Standalone,
        run: aa::figure3::run,
    },
    Reproduction {
        name: "aa-figure4",
        about: "a flag with hard strain limits in the wind: Algorithm 4 and others on three frames, what converges, pictures",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure4::run,
    },
    Reproduction {
        name: "aa-figure5",
        about: "a horse falls into a pit: Algorithm 4, others and `auto` on two frames, all frames by `auto`, pictures",
        models: &[],
        kind: Kind::Moving,
        run: aa::falling::figure5,
    },
    Reproduction {
        name: "aa-figure6",
        about: "a horse falls among cylinders: the same on three frames",
        models: &[],
        kind: Kind::Moving,
        run: aa::falling::figure6,
    },
    Reproduction {
        name: "aa-figure7",
        about: "a wire mesh: ADMM and AA-ADMM, residuals, errors of edges and angles, pictures at equal time",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure7::run,
    },
    Reproduction {
        name: "aa-figure8",
        about: "the same wire mesh by the penalty method under three weights, against ADMM: errors and distances, pictures",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure8::run,
    },
    Reproduction {
        name: "aa-figure9",
        about: "as aa-figure1, another mesh (airport)",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure9::run,
    },
    Reproduction {
        name: "aa-figure10",
        about: "deconvolution by total variation: ADMM, over-relaxation, momentum, Anderson on v, on (z, u) and on both splits",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure10::run,
    },
    Reproduction {
        name: "aa-figure11",
        about: "a coded wavefront sensor: ADMM, Anderson on z alone and on both, GMRES, conjugate gradients",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure11::run,
    },
    Reproduction {
        name: "aa-figure12",
        about: "geodesic distances: the nearest integrable field by ADMM and AA-ADMM, beside a sparse system, pictures",
        models: &[],
        kind: Kind::Moving,
        run: aa::figure12::run,
    },
    Reproduction {
        name: "aa-auto",
        about: "`auto` of simulate against plain ADMM on all problems of AA-ADMM, at equal time and equal counted work",
        models: &[],
        kind: Kind::Moving,
        run: aa::equal_time::run,
    },
    Reproduction {
        name: "aa-linear-rate",
        about: "the linear rates that Theorems 3.3 and 3.4 of AA-ADMM prove, and the descent of 3.5, checked on a small bar",
        models: &[],
        kind: Kind::Standalone,
        run: aa::linear_rate::run,
    },
    Reproduction {
        name: "aa-sweep",
        about: "Algorithm 3 of AA-ADMM on the bars: window, mixing parameter and penalty",
        models: &[],
        kind: Kind::Standalone,
        run: aa::sweep::run,
    },
    Reproduction {
        name: "imaging-quality",
        about: "deconvolution with everything automatic against the best lambda and the best constant Wiener filter: PSNR",
        models: &[],
        kind: Kind::Moving,
        run: imaging_quality::run,
    },
    Reproduction {
        name: "unwrap-robustness",
        about: "thousands of random disks mapped at defaults: how many end flip-free and converged",
        models: &[],
        kind: Kind::Standalone,
        run: maps::robustness::run,
    },
];

/// Does the reproduction called `name`; `tell` hears what is being done.
///
/// # Errors
/// A name that is not known, a model that cannot be read, a folder that cannot be written. No data at all is no error: the
/// result says so.
pub fn run(name: &str, options: &Options, tell: &mut dyn FnMut(&str)) -> Result<(), BenchError> {
    let Some(reproduction) = ALL.iter().find(|r| r.name == name) else {
        let names: Vec<&str> = ALL.iter().map(|r| r.name).collect();
        return Err(BenchError(format!("{name}: no such reproduction; there are {}", names.join(", "))));
    };
    std::fs::create_dir_all(&options.out).map_err(|e| BenchError(format!("{}: {e}", options.out.display())))?;
    let models = models_of(reproduction, options);
    let mut context = Context::new(reproduction.name, options, models, tell);
    let _ = writeln!(context.text, "# {}\n\n{}.\n", reproduction.name, capitalised(reproduction.about));
    let needs_models = matches!(reproduction.kind, Kind::Bodies | Kind::Maps);
    let described = match reproduction.kind {
        Kind::Bodies => data::describe(&context.models),
        Kind::Maps => crate::maps::describe(&context.models),
        Kind::Standalone => "Data: none needed.".to_string(),
        Kind::Moving => String::new(),
    };
    if !described.is_empty() {
        let _ = writeln!(context.text, "{described}\n");
    }
    if needs_models {
        context.tell(&described);
        if context.models.is_empty() {
            let _ = writeln!(context.text, "Nothing was run.");
            return context.finish();
        }
    }
    let conditions = match reproduction {
        of if of.is_of_maps() => context.map_conditions(),
        of if of.name.starts_with("aa-") => context.step_conditions(),
        _ => context.conditions(),
    };
    let _ = writeln!(context.text, "{conditions}\n");
    (reproduction.run)(&mut context)?;
    context.finish()
}

/// The models asked for, or those of the reproduction that are found.
fn models_of(reproduction: &Reproduction, options: &Options) -> Vec<String> {
    if !options.models.is_empty() || matches!(reproduction.kind, Kind::Standalone | Kind::Moving) {
        return options.models.clone();
    }
    let mut found = match reproduction.kind {
        Kind::Maps => crate::maps::found(),
        _ => data::found(),
    };
    if reproduction.models.contains(&data::BEAM) {
        found.insert(0, data::BEAM.to_string());
    }
    let few: &[&str] = if reproduction.kind == Kind::Maps { &["bimba", "horse"] } else { &["shear", "stretch"] };
    let wanted = if options.quick && reproduction.models.is_empty() { few } else { reproduction.models };
    let mut models: Vec<String> =
        found.into_iter().filter(|name| wanted.is_empty() || wanted.contains(&name.as_str())).collect();
    if options.quick {
        models.truncate(2);
    }
    models
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
