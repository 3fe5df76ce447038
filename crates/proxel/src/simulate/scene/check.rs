//! What can be said of a scene without its meshes.

use super::{BodySpec, Generate, ObstacleSpec, Scene, ShapeSpec};
use crate::pins::Rotation;
use crate::settings::{Material, PenaltyName};
use std::collections::BTreeSet;

/// Where, what is wrong there, and what to do.
type Bad = (String, String, String);
type Checked = Result<(), Bad>;

/// Frames and substeps that no scene asks for in earnest.
const MOST_FRAMES: usize = 1_000_000;
const MOST_SUBSTEPS: usize = 100_000;

fn bad(place: &str, what: String, remedy: &str) -> Checked {
    Err((place.to_owned(), what, remedy.to_owned()))
}

fn positive(place: &str, v: f64) -> Checked {
    if v > 0.0 && v.is_finite() { Ok(()) } else { bad(place, format!("it is {v}"), "give a positive finite number") }
}

fn not_negative(place: &str, v: f64) -> Checked {
    if v >= 0.0 && v.is_finite() { Ok(()) } else { bad(place, format!("it is {v}"), "give a number of 0 or more") }
}

fn finite(place: &str, v: &[f64]) -> Checked {
    match v.iter().find(|v| !v.is_finite()) {
        None => Ok(()),
        Some(v) => bad(place, format!("it has {} {v}", if v.is_nan() { "a" } else { "an" }), "give finite numbers"),
    }
}

fn direction(place: &str, v: &[f64; 3]) -> Checked {
    finite(place, v)?;
    if *v == [0.0; 3] { bad(place, "it is zero".into(), "give it a direction") } else { Ok(()) }
}

fn count(place: &str, n: usize, most: usize) -> Checked {
    match n {
        0 => bad(place, "it is 0".into(), "give 1 or more"),
        _ if n > most => bad(place, format!("it is {n}"), &format!("give {most} or less")),
        _ => Ok(()),
    }
}

fn rotation(place: &str, r: &Option<Rotation>) -> Checked {
    let Some(r) = r else { return Ok(()) };
    direction(&format!("{place}.axis"), &r.axis)?;
    finite(&format!("{place}.angle"), &[r.angle])?;
    finite(&format!("{place}.center"), &r.center.unwrap_or_default())
}

fn times(place: &str, times: impl Iterator<Item = f64>) -> Checked {
    let mut before = f64::NEG_INFINITY;
    for (k, time) in times.enumerate() {
        let place = format!("{place}[{k}].time");
        finite(&place, &[time])?;
        if time <= before {
            return bad(
                &place,
                format!("{time} does not come after {before}, that of the one before"),
                "put keyframes in the order of their times",
            );
        }
        before = time;
    }
    Ok(())
}

/// Names go into files and messages.
fn name<'a>(place: &str, name: &'a str, seen: &mut BTreeSet<&'a str>) -> Checked {
    let fine = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | ' ' | '.');
    if !name.chars().all(fine) || name.starts_with('.') || name.len() > 100 {
        return bad(
            place,
            format!("`{}` cannot be part of a file's name", name.escape_default()),
            "use letters, digits, - and _",
        );
    }
    if !seen.insert(name) {
        return bad(place, format!("`{name}` is the name of two"), "give each a name of its own");
    }
    Ok(())
}

pub(super) fn check(scene: &Scene) -> Checked {
    let time = &scene.time;
    positive("time.dt", time.dt)?;
    count("time.frames", time.frames, MOST_FRAMES)?;
    count("time.substeps", time.substeps, MOST_SUBSTEPS)?;
    positive("solver.tol", scene.solver.tol)?;
    count("solver.max_iters", scene.solver.max_iters, usize::MAX)?;
    scene.solver.check()?;
    finite("forces.gravity", &scene.forces.gravity)?;
    if let Some(wind) = &scene.forces.wind {
        finite("forces.wind.velocity", &wind.velocity)?;
        not_negative("forces.wind.drag", wind.drag)?;
    }
    not_negative("damping.mass", scene.damping.mass)?;
    not_negative("damping.stiffness", scene.damping.stiffness)?;
    if scene.bodies.is_empty() {
        return bad("body", "there is none".into(), "add a section [[body]] with a mesh or generate");
    }
    let mut names = BTreeSet::new();
    for (k, spec) in scene.bodies.iter().enumerate() {
        name(&format!("body[{k}].name"), &spec.name, &mut names)?;
        body(&format!("body[{k}]"), spec)?;
    }
    let mut names = BTreeSet::new();
    for (k, spec) in scene.obstacles.iter().enumerate() {
        name(&format!("obstacle[{k}].name"), &spec.name, &mut names)?;
        obstacle(&format!("obstacle[{k}]"), spec)?;
    }
    capabilities(scene)
}

/// What only some methods can do.
fn capabilities(scene: &Scene) -> Checked {
    let method = scene.solver.method;
    if scene.damping.stiffness > 0.0 && !super::super::has_finish(method) {
        let what = format!("{} does not take it", method.as_str());
        return bad("damping.stiffness", what, "leave it out, or use auto or newton");
    }
    let limited = scene.bodies.iter().position(|b| b.strain_limit.is_some());
    if let Some(k) = limited {
        let place = format!("body[{k}].strain_limit");
        if !super::super::has_finish(method) && !scene.solver.holds_sets() {
            let what = format!("{} needs derivatives and cannot hold hard limits", method.as_str());
            return bad(&place, what, "use auto, newton, wrapd, r-admm, w-admm, aa-admm or admm");
        }
    }
    safe_penalty(scene, limited)?;
    let rough = scene.obstacles.iter().position(|o| o.friction > 0.0);
    if let Some(k) = rough
        && !super::super::has_finish(method)
    {
        let what = "friction needs a Newton finish, which pure splitting methods have not";
        return bad(&format!("obstacle[{k}].friction"), what.into(), "leave it out, or use auto or newton");
    }
    if !scene.obstacles.is_empty() && !super::super::has_finish(method) && !scene.solver.holds_sets() {
        let what = format!("{} cannot hold obstacles", method.as_str());
        return bad("solver.method", what, "use auto, newton, wrapd, r-admm, w-admm, aa-admm or admm");
    }
    Ok(())
}

/// What a safe penalty is proven for.
fn safe_penalty(scene: &Scene, limited: Option<usize>) -> Checked {
    if scene.solver.penalty != PenaltyName::Safe {
        return Ok(());
    }
    let place = "solver.penalty";
    if let Err(what) = scene.solver.penalty.check(scene.solver.method) {
        return bad(place, what, "or leave it out");
    }
    if !scene.obstacles.is_empty() || limited.is_some() {
        let what = "`safe` is proven without obstacles and strain limits only".into();
        return bad(place, what, "leave it out, or them");
    }
    let lipschitz = |m: &Material| m.energy == "stvk";
    match scene.bodies.iter().position(|b| !lipschitz(&b.material) || !b.regions.values().all(lipschitz)) {
        Some(k) => bad(
            place,
            format!("`safe` is proven for stvk only, and body[{k}] is of another"),
            "leave it out, or use stvk",
        ),
        None => Ok(()),
    }
}

fn body(place: &str, b: &BodySpec) -> Checked {
    let at = |key: &str| format!("{place}.{key}");
    match (&b.mesh, &b.generate) {
        (None, None) => return bad(&at("mesh"), "it has neither mesh nor generate".into(), "give one of them"),
        (Some(_), Some(_)) => return bad(&at("generate"), "it has a mesh too".into(), "keep one of them"),
        (_, Some(g)) => generate(&at("generate"), g)?,
        _ => {}
    }
    positive(&at("scale"), b.scale)?;
    rotation(&at("rotate"), &b.rotate)?;
    finite(&at("translate"), &b.translate)?;
    finite(&at("velocity"), &b.velocity)?;
    finite(&at("angular_velocity"), &b.angular_velocity)?;
    count(&at("resolution"), b.resolution, 10_000)?;
    positive(&at("density"), b.density)?;
    not_negative(&at("bending"), b.bending)?;
    material(&at("material"), &b.material)?;
    for (region, m) in &b.regions {
        let place = at(&format!("regions.{region}"));
        if region.parse::<i32>().is_err() {
            return bad(&place, format!("`{region}` is no number of a region"), "give a whole number");
        }
        material(&place, m)?;
    }
    if let Some([low, high]) = b.strain_limit
        && !(low > 0.0 && low <= 1.0 && high >= 1.0)
    {
        return bad(&at("strain_limit"), format!("it is [{low}, {high}]"), "give limits with 0 < low <= 1 <= high");
    }
    let mut names = BTreeSet::new();
    for (k, pin) in b.pins.iter().enumerate() {
        let at = |key: &str| format!("{place}.pin[{k}].{key}");
        name(&at("name"), &pin.name, &mut names)?;
        if pin.velocity.is_some() && !pin.keyframes.is_empty() {
            return bad(&at("velocity"), "it has keyframes too".into(), "keep one of them");
        }
        finite(&at("velocity"), &pin.velocity.unwrap_or_default())?;
        times(&at("keyframe"), pin.keyframes.iter().map(|k| k.time))?;
        for (i, key) in pin.keyframes.iter().enumerate() {
            let at = |what: &str| at(&format!("keyframe[{i}].{what}"));
            rotation(&at("rotate"), &key.rotate)?;
            finite(&at("translate"), &key.translate.unwrap_or_default())?;
            if key.targets.is_some() && (key.rotate.is_some() || key.translate.is_some()) {
                return bad(&at("targets"), "targets, rotate and translate exclude each other".into(), "keep one kind");
            }
            finite(&at("targets"), key.targets.as_deref().unwrap_or_default().as_flattened())?;
        }
        if let Err((what, remedy)) = pin.group().check() {
            return bad(&format!("{place}.pin[{k}]"), what, remedy);
        }
    }
    Ok(())
}

fn material(place: &str, m: &Material) -> Checked {
    if let Err(e) = m.lame() {
        return bad(place, e.to_string(), "give moduli of a stable material");
    }
    m.density.map_or(Ok(()), |d| positive(&format!("{place}.density"), d))
}

fn generate(place: &str, g: &Generate) -> Checked {
    let lengths = |key: &str, v: &[f64]| v.iter().try_for_each(|v| positive(&format!("{place}.{key}"), *v));
    match g {
        Generate::Bar { cells, size, .. } => {
            cells.iter().try_for_each(|c| count(&format!("{place}.bar.cells"), *c, 100_000))?;
            lengths("bar.size", size)
        }
        Generate::Cloth { cells, size } => {
            cells.iter().try_for_each(|c| count(&format!("{place}.cloth.cells"), *c, 100_000))?;
            lengths("cloth.size", size)
        }
        Generate::Ball { radius, cell } => lengths("ball", &[*radius, *cell]),
        Generate::Torus { major, minor, cell } => lengths("torus", &[*major, *minor, *cell]),
    }
}

fn obstacle(place: &str, o: &ObstacleSpec) -> Checked {
    let at = |key: &str| format!("{place}.{key}");
    not_negative(&at("friction"), o.friction)?;
    if o.velocity.is_some() && !o.keyframes.is_empty() {
        return bad(&at("velocity"), "it has keyframes too".into(), "keep one of them");
    }
    finite(&at("velocity"), &o.velocity.unwrap_or_default())?;
    times(&at("keyframe"), o.keyframes.iter().map(|k| k.time))?;
    for (i, key) in o.keyframes.iter().enumerate() {
        rotation(&at(&format!("keyframe[{i}].rotate")), &key.rotate)?;
        finite(&at(&format!("keyframe[{i}].translate")), &key.translate.unwrap_or_default())?;
    }
    shape(&at("shape"), &o.shape)
}

fn shape(place: &str, s: &ShapeSpec) -> Checked {
    let at = |key: &str| format!("{place}.{key}");
    match s {
        ShapeSpec::HalfSpace { point, normal } => {
            finite(&at("half-space.point"), point)?;
            direction(&at("half-space.normal"), normal)
        }
        ShapeSpec::Plane { point, normal } => {
            finite(&at("plane.point"), point)?;
            direction(&at("plane.normal"), normal)
        }
        ShapeSpec::Sphere { center, radius } => {
            finite(&at("sphere.center"), center)?;
            positive(&at("sphere.radius"), *radius)
        }
        ShapeSpec::Box { center, size, rotate } => {
            finite(&at("box.center"), center)?;
            size.iter().try_for_each(|s| positive(&at("box.size"), *s))?;
            rotation(&at("box.rotate"), rotate)
        }
        ShapeSpec::Capsule { from, to, radius } => {
            finite(&at("capsule.from"), from)?;
            finite(&at("capsule.to"), to)?;
            positive(&at("capsule.radius"), *radius)
        }
        ShapeSpec::Cylinder { center, axis, radius, length } => {
            finite(&at("cylinder.center"), center)?;
            direction(&at("cylinder.axis"), axis)?;
            positive(&at("cylinder.radius"), *radius)?;
            length.map_or(Ok(()), |l| positive(&at("cylinder.length"), l))
        }
        ShapeSpec::Pit { center, normal, radius } => {
            finite(&at("pit.center"), center)?;
            direction(&at("pit.normal"), normal)?;
            positive(&at("pit.radius"), *radius)
        }
        ShapeSpec::HeightField { origin, spacing, heights, depth } => {
            finite(&at("height-field.origin"), origin)?;
            spacing.iter().try_for_each(|s| positive(&at("height-field.spacing"), *s))?;
            positive(&at("height-field.depth"), *depth)?;
            let columns = heights.first().map_or(0, Vec::len);
            if heights.len() < 2 || columns < 2 {
                return bad(
                    &at("height-field.heights"),
                    format!("it has {} rows of {columns}", heights.len()),
                    "give 2 rows of 2 or more",
                );
            }
            for (k, row) in heights.iter().enumerate() {
                let place = at(&format!("height-field.heights[{k}]"));
                finite(&place, row)?;
                if row.len() != columns {
                    return bad(
                        &place,
                        format!("it has {} heights, the first row {columns}", row.len()),
                        "give all rows the same length",
                    );
                }
            }
            Ok(())
        }
        ShapeSpec::Mesh { scale, rotate, translate, .. } => {
            positive(&at("mesh.scale"), *scale)?;
            rotation(&at("mesh.rotate"), rotate)?;
            finite(&at("mesh.translate"), translate)
        }
    }
}
