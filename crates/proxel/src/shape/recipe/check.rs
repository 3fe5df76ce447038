//! What a recipe has to say, and what it cannot.

use super::{ConstraintSpec, Kind, Recipe};

/// The keys that a constraint has.
fn keys(c: &ConstraintSpec) -> Vec<&'static str> {
    [
        (c.vertices.is_some(), "vertices"),
        (c.faces.is_some(), "faces"),
        (c.edges.is_some(), "edges"),
        (c.pairs.is_some(), "pairs"),
        (c.length.is_some(), "length"),
        (c.min.is_some(), "min"),
        (c.max.is_some(), "max"),
        (c.to.is_some(), "to"),
        (c.points.is_some(), "points"),
        (c.closed.is_some(), "closed"),
        (c.point.is_some(), "point"),
        (c.normal.is_some(), "normal"),
        (c.one_sided.is_some(), "one-sided"),
    ]
    .into_iter()
    .filter_map(|(given, key)| given.then_some(key))
    .collect()
}

impl Kind {
    /// Its name in a recipe.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Planar => "planar",
            Kind::Circle => "circle",
            Kind::Conical => "conical",
            Kind::Parallelogram => "parallelogram",
            Kind::Rectangle => "rectangle",
            Kind::Regular => "regular",
            Kind::Rigid => "rigid",
            Kind::Similar => "similar",
            Kind::Line => "line",
            Kind::EdgeLength => "edge-length",
            Kind::Angle => "angle",
            Kind::Near => "near",
            Kind::Curve => "curve",
            Kind::At => "at",
            Kind::Fixed => "fixed",
            Kind::Plane => "plane",
            Kind::Symmetric => "symmetric",
            Kind::RelativeLaplacian => "relative-laplacian",
            Kind::Laplacian => "laplacian",
        }
    }

    /// The keys that it needs, and those that it may have.
    fn keys(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Kind::Planar | Kind::Rigid | Kind::Similar => (&[], &["faces", "vertices"]),
            Kind::Circle | Kind::Parallelogram | Kind::Rectangle | Kind::Regular => (&[], &["faces"]),
            Kind::Conical | Kind::Fixed => (&[], &["vertices"]),
            Kind::Line => (&["vertices"], &[]),
            Kind::EdgeLength => (&[], &["edges", "length", "min", "max"]),
            Kind::Angle => (&[], &["faces", "min", "max"]),
            Kind::Near => (&[], &["vertices", "to"]),
            Kind::Curve => (&[], &["vertices", "to", "points", "closed"]),
            Kind::At => (&["vertices", "points"], &[]),
            Kind::Plane => (&["point", "normal"], &["vertices", "one-sided"]),
            Kind::Symmetric => (&["point", "normal"], &["pairs", "vertices"]),
            Kind::RelativeLaplacian | Kind::Laplacian => (&[], &[]),
        }
    }
}

/// Says where (`constraint 2 (planar)`) and what is wrong with a recipe, whatever its mesh.
pub(super) fn check(recipe: &Recipe) -> Result<(), (String, String)> {
    let whole = |key: &str, what: String| Err((key.to_string(), what));
    if recipe.mesh.is_empty() {
        return whole("mesh", "it names no mesh; give the file of a surface".to_string());
    }
    if !(recipe.stay >= 0.0 && recipe.stay.is_finite()) {
        return whole("stay", format!("it is {}; give a number that is not negative", recipe.stay));
    }
    if !(recipe.solver.mu > 0.0 && recipe.solver.mu.is_finite()) {
        return whole("solver.mu", format!("it is {}; give a positive number", recipe.solver.mu));
    }
    if recipe.constraints.is_empty() {
        return whole("constraint", "there is none; add a [[constraint]] with a `kind`".to_string());
    }
    for (i, c) in recipe.constraints.iter().enumerate() {
        check_one(c).map_err(|what| (place(i, c), what))?;
    }
    Ok(())
}

/// What a constraint is called in messages.
pub(super) fn place(i: usize, c: &ConstraintSpec) -> String {
    match c.name.is_empty() {
        true => format!("constraint {i} ({})", c.kind.name()),
        false => format!("constraint {i} ({})", c.name),
    }
}

fn check_one(c: &ConstraintSpec) -> Result<(), String> {
    let (needed, allowed) = c.kind.keys();
    let given = keys(c);
    let kind = c.kind.name();
    if let Some(key) = given.iter().find(|k| !needed.contains(k) && !allowed.contains(k)) {
        let can = [needed, allowed].concat();
        let can = if can.is_empty() { "none but weight".to_string() } else { can.join(", ") };
        return Err(format!("`{key}` is no key of {kind}; its keys are {can}"));
    }
    if let Some(key) = needed.iter().find(|k| !given.contains(k)) {
        return Err(format!("`{key}` is missing; {kind} needs it"));
    }
    if let Some(w) = c.weight.filter(|w| !(*w > 0.0 && w.is_finite())) {
        return Err(format!("`weight` is {w}; give a positive number, or none for a hard constraint"));
    }
    let exclusive =
        [["faces", "vertices"], ["to", "points"], ["pairs", "vertices"], ["length", "min"], ["length", "max"]];
    if let Some([a, b]) = exclusive.iter().find(|pair| pair.iter().all(|k| given.contains(k))) {
        return Err(format!("`{a}` and `{b}` exclude each other; give one of them"));
    }
    if matches!(c.kind, Kind::Laplacian | Kind::RelativeLaplacian) && c.weight.is_none() {
        return Err(format!("`weight` is missing; {kind} is soft"));
    }
    if c.kind == Kind::EdgeLength && c.length.is_none() && c.min.is_none() && c.max.is_none() {
        return Err("give `length`, or `min`, `max` or both".to_string());
    }
    if c.kind == Kind::Angle && c.min.is_none() && c.max.is_none() {
        return Err("give `min`, `max` or both, in degrees".to_string());
    }
    let top = if c.kind == Kind::Angle { 180.0 } else { f64::MAX };
    for (key, value) in [("min", c.min), ("max", c.max)] {
        if let Some(v) = value.filter(|v| !(0.0..=top).contains(v)) {
            let what = if c.kind == Kind::Angle { "degrees from 0 to 180" } else { "a length that is not negative" };
            return Err(format!("`{key}` is {v}; give {what}"));
        }
    }
    if let (Some(min), Some(max)) = (c.min, c.max)
        && min > max
    {
        return Err(format!("`min` is {min} and `max` {max}; give the least first"));
    }
    if let Some(super::LengthSpec::Units(l)) = c.length
        && !(l > 0.0 && l.is_finite())
    {
        return Err(format!("`length` is {l}; give a positive length, \"mean\" or \"keep\""));
    }
    let numbers = c.points.iter().flatten().chain(&c.point).chain(&c.normal).flatten();
    if let Some(v) = numbers.copied().find(|v| !v.is_finite()) {
        return Err(format!("a coordinate is {v}; give numbers"));
    }
    Ok(())
}
