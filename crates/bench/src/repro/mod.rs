//! Reproductions of the WRAPD paper's quasi-static results, and of the comparisons behind the defaults.
//!
//! Each writes NAME.md, NAME.csv (problem, method, level, iterations, seconds: a row a level, empty cells where it was not
//! reached) and its plots, and says which data it found.

mod comparison;
mod context;
mod figure2;
mod figure4;
mod figure8;
mod growth;
pub mod hopeless;
mod live;
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
    /// Whether it needs no model.
    pub standalone: bool,
    run: fn(&mut Context<'_>) -> Result<(), BenchError>,
}

/// Models that solve fast.
const SMALL: &[&str] = &["shear", "homer", "dancer", "untwist", "stretch"];

/// All reproductions.
pub const ALL: [Reproduction; 11] = [
    Reproduction {
        name: "wrapd-table1",
        about: "iterations and seconds of all methods on all models, beside Table 1; convergence as in Figures 1, 6, 7",
        models: &[],
        standalone: false,
        run: table1::run,
    },
    Reproduction {
        name: "wrapd-figure2",
        about: "the spring: its energy over edge vector and length; linear against rotation-aware splitting",
        models: &[],
        standalone: true,
        run: figure2::run,
    },
    Reproduction {
        name: "wrapd-figure4",
        about: "with and without rotation awareness and reweighting; R-ADMM against weight multipliers",
        models: &["homer"],
        standalone: false,
        run: figure4::run,
    },
    Reproduction {
        name: "wrapd-figure8",
        about: "cloth with hard strain limits: position error against time, and pictures at equal time",
        models: &[],
        standalone: true,
        run: figure8::run,
    },
    Reproduction {
        name: "wrapd-sweeps",
        about: "gamma, kappa, k_rw, window and the range of weights, one at a time",
        models: SMALL,
        standalone: false,
        run: sweeps::run,
    },
    Reproduction {
        name: "race",
        about: "`auto` against `wrapd`: seconds to a position error of 1e-4 and to an energy error of 1e-10, in turns",
        models: &[],
        standalone: false,
        run: race::run,
    },
    Reproduction {
        name: "growth",
        about: "seconds at 1, 8 and 64 times the size: `auto`, `wrapd`, `newton` and `newton-cg`",
        models: &["beam", "homer", "centaur"],
        standalone: false,
        run: growth::run,
    },
    Reproduction {
        name: "hopeless",
        about: "from starts that are collapsed, random, mirrored or reflected: does `auto` end at a stationary point",
        models: &[],
        standalone: false,
        run: hopeless::run,
    },
    Reproduction {
        name: "live",
        about: "a handle moves: error against time from the last minimum, beside WRAPD iterations and a cold solve",
        models: &["centaur"],
        standalone: false,
        run: live::run,
    },
    Reproduction {
        name: "schedules",
        about: "paper, reference and default schedule, and what they differ in, one at a time",
        models: &[],
        standalone: false,
        run: schedules::run,
    },
    Reproduction {
        name: "weights",
        about: "first weights near incompressibility, weights that are no scalars, Anderson acceleration of WRAPD",
        models: SMALL,
        standalone: false,
        run: weights::run,
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
    let mut models = options.models.clone();
    if models.is_empty() && !reproduction.standalone {
        let mut found = data::found();
        if reproduction.models.contains(&data::BEAM) {
            found.insert(0, data::BEAM.to_string());
        }
        let wanted = if options.quick && reproduction.models.is_empty() {
            &["shear", "stretch"][..]
        } else {
            reproduction.models
        };
        models = found.into_iter().filter(|name| wanted.is_empty() || wanted.contains(&name.as_str())).collect();
        if options.quick {
            models.truncate(2);
        }
    }
    let mut context = Context::new(reproduction.name, options, models, tell);
    let _ = writeln!(context.text, "# {}\n\n{}.\n", reproduction.name, capitalised(reproduction.about));
    if !reproduction.standalone {
        let described = data::describe(&context.models);
        context.tell(&described);
        let _ = writeln!(context.text, "{described}\n");
        if context.models.is_empty() {
            let _ = writeln!(context.text, "Nothing was run.");
            return context.finish();
        }
    } else {
        let _ = writeln!(context.text, "Data: none needed.\n");
    }
    let conditions = context.conditions();
    let _ = writeln!(context.text, "{conditions}\n");
    (reproduction.run)(&mut context)?;
    context.finish()
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
