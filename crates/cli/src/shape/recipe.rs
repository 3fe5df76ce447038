//! `proxel shape`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::shape::{Recipe, RecipeFile, ShapeError, ShapeInput, ShapeMethod, ShapeSettings, shape};
use proxel_mesh::{Mesh, read_mesh_lenient};
use serde::Serialize;

use super::{Room, files};
use crate::args::{SolveArgs, show_settings};
use crate::refusal::Refusal;

/// The arguments of `proxel shape`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel shape facade.toml --out facade.obj --preview facade.png
  proxel shape facade.toml --method aa-admm --max-iters 1000 --out facade.vtu --report facade.json
  proxel schema recipe                                  all keys of a recipe

A recipe names a mesh and constraints on parts of it, hard ones and soft ones:

  mesh = \"roof.obj\"
  [[constraint]]
  kind = \"planar\"
  [[constraint]]
  kind = \"fixed\"
  vertices = \"border\"
  [[constraint]]
  kind = \"near\"
  weight = 1

Kinds: planar, circle, conical, parallelogram, rectangle, regular, rigid, similar, line, edge-length, angle, near, curve,
at, fixed, plane, symmetric, relative-laplacian, laplacian.")]
pub struct RecipeArgs {
    /// The recipe: TOML or JSON. Files that it names are seen from its folder.
    #[arg(value_name = "RECIPE")]
    pub recipe: PathBuf,
    #[command(flatten)]
    pub solve: SolveArgs,
    /// In place of the recipe's method.
    #[arg(long, value_name = "NAME", value_parser = methods(), help_heading = "Method")]
    pub method: Option<String>,
    /// In place of the recipe's penalty.
    #[arg(long, value_name = "MU", allow_negative_numbers = true, help_heading = "Method")]
    pub mu: Option<f64>,
    /// In place of the recipe's columns of Anderson acceleration.
    #[arg(long, value_name = "M", help_heading = "Method")]
    pub anderson: Option<usize>,
    #[command(flatten)]
    pub room: Room,
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(ShapeMethod::ALL.map(ShapeMethod::as_str))
}

/// All that is settled before a run.
#[derive(Serialize)]
struct Shown<'a> {
    recipe: &'a Recipe,
    #[serde(flatten)]
    settings: &'a ShapeSettings,
}

/// Reads, solves, writes.
pub fn recipe(args: &RecipeArgs) -> Result<u8, Refusal> {
    let mut file = RecipeFile::read(&args.recipe)?;
    let solver = &mut file.recipe.solver;
    solver.method = args.method.as_deref().and_then(ShapeMethod::from_name).unwrap_or(solver.method);
    solver.mu = args.mu.unwrap_or(solver.mu);
    solver.anderson = args.anderson.unwrap_or(solver.anderson);
    let settings = ShapeSettings {
        method: solver.method,
        mu: solver.mu,
        anderson: solver.anderson,
        tol: args.solve.tol,
        max_iters: args.solve.max_iters,
        memory: 1e9 * args.room.memory,
        time_limit: args.solve.run.time_limit,
        threads: args.solve.run.threads,
        ..ShapeSettings::recipe()
    };
    settings.check().map_err(Refusal::new)?;
    if args.solve.run.show_settings {
        return show_settings(&Shown { recipe: &file.recipe, settings: &settings });
    }
    let recipe = &file.recipe;
    let mut others: BTreeMap<String, Mesh> = BTreeMap::new();
    for name in recipe.constraints.iter().filter_map(|c| c.to.as_ref()) {
        if !others.contains_key(name) {
            others.insert(name.clone(), read_mesh_lenient(&file.path(name))?);
        }
    }
    let mut read = || {
        let mesh = read_mesh_lenient(&file.path(&recipe.mesh))?;
        let reference = recipe.reference.as_deref().map(|name| read_mesh_lenient(&file.path(name))).transpose()?;
        Ok(ShapeInput { mesh, reference })
    };
    let named = |e: ShapeError| ShapeError(format!("{}: {e}", file.name()));
    files::run(&args.solve, &mut read, &mut |input, hooks| {
        shape(recipe, input, &others, &settings, hooks).map_err(named)
    })
}
