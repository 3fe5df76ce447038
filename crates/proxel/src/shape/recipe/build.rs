//! From a recipe to a problem.

use super::super::measure::{self, ConstraintReport, changes};
use super::super::problem::{Demand, Posed, Shape, Unit};
use super::super::solve::{Solved, in_threads, report, sizes, solve};
use super::super::ways::Way;
use super::super::{FaceErrors, ShapeError, ShapeInput, ShapeSettings, Shaped};
use super::check::place;
use super::select::Selector;
use super::{ConstraintSpec, EdgeSpec, FaceSpec, Kind, LengthName, LengthSpec, Recipe, VertexSpec};
use crate::deform::Hooks;
use proxel_mesh::Mesh;
use proxel_model::constraint::fairing::{Fairing, rings_of_four};
use proxel_model::constraint::{
    AngleRange, Cells, Circle, Closest, Conical, Curve, EdgeDifference, Hold, Length, Line, MeanCentred, Near,
    Parallelogram, Planar, Plane, Points, Rectangle, Reduction, RegularPolygon, Rigid, Set, Similar, Spokes, Symmetric,
    Template, TipDifferences, V3, Vertex, Vertices,
};
use proxel_split::Quadratic;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// Moves the vertices of a mesh until the constraints of a recipe hold, the soft ones as well as can be. `others` are the
/// meshes that constraints name, by the names that they have there.
///
/// # Errors
/// Input that describes no problem: the constraint, and what is wrong with it. A run that does not converge is no error:
/// see [`Shaped::status`].
pub fn shape(
    recipe: &Recipe,
    input: &ShapeInput,
    others: &BTreeMap<String, Mesh>,
    settings: &ShapeSettings,
    hooks: &mut Hooks<'_>,
) -> Result<Shaped, ShapeError> {
    let began = Instant::now();
    settings.check().map_err(ShapeError)?;
    super::check::check(recipe).map_err(|(place, what)| ShapeError(format!("{place}: {what}")))?;
    in_threads(settings.threads, |threads| {
        let frame = Shape::new(input)?;
        let builder = Builder { recipe, frame: &frame, mesh: &input.mesh, others, settings };
        let (posed, fixed) = builder.posed()?;
        let solved = solve(&frame, posed, &fixed, &input.mesh, settings, hooks, began)?;
        let told = |name: &str| {
            let of = |points: &[V3]| {
                let own = solved.groups.iter().filter(|g| g.kind == name);
                own.flat_map(|g| sizes(g, &frame, points)).collect::<Vec<f64>>()
            };
            let [before, after] = [&frame.start, &solved.after].map(|points| of(points));
            let [violation_max, violation_mean] = changes(&before, &after);
            (after.len(), violation_max, violation_mean)
        };
        let constraints = recipe.constraints.iter().enumerate().map(|(i, c)| {
            let name = called(i, c);
            let (elements, violation_max, violation_mean) = told(&name);
            let kind = c.kind.name().to_string();
            ConstraintReport { name, kind, hard: c.weight.is_none(), elements, violation_max, violation_mean }
        });
        let constraints = constraints.filter(|c| c.elements > 0).collect();
        let told = measure::ShapeReport { constraints, ..measure::common(&frame, &solved) };
        let faces = vec![FaceErrors {
            name: "violation".to_string(),
            before: of_faces(&frame, &solved, &frame.start),
            after: of_faces(&frame, &solved, &solved.after),
        }];
        let Solved { positions, distance, ended, .. } = solved;
        let settings = serde_json::to_value(settings).unwrap_or_default();
        let report = report("shape", settings, &ended, &frame, told, threads);
        Ok(Shaped { positions, status: ended.status, report, faces, distance })
    })
}

/// What the report calls a constraint.
fn called(i: usize, c: &ConstraintSpec) -> String {
    if c.name.is_empty() { format!("{} {i}", c.kind.name()) } else { c.name.clone() }
}

/// The largest violation of a hard constraint at a corner of each face.
fn of_faces(frame: &Shape, solved: &Solved, points: &[V3]) -> Vec<f64> {
    let mut worst = vec![0.0_f64; points.len()];
    for group in solved.groups.iter().filter(|g| g.hard) {
        for (e, size) in sizes(group, frame, points).into_iter().enumerate() {
            group.cells.nodes(e).iter().for_each(|v| worst[*v as usize] = worst[*v as usize].max(size));
        }
    }
    frame.faces.iter().map(|f| f.iter().map(|v| worst[*v as usize]).fold(0.0, f64::max)).collect()
}

/// What a problem is made from.
struct Builder<'a> {
    recipe: &'a Recipe,
    frame: &'a Shape,
    mesh: &'a Mesh,
    others: &'a BTreeMap<String, Mesh>,
    settings: &'a ShapeSettings,
}

/// What is added to, and what a constraint is about.
struct Adding<'a> {
    posed: &'a mut Posed,
    fixed: &'a mut Vec<u32>,
    selector: &'a Selector<'a>,
    hold: Hold,
    name: String,
}

impl Adding<'_> {
    fn demand(&self, unit: Unit) -> Demand {
        Demand { hold: self.hold, kind: self.name.clone(), unit, ids: None }
    }

    fn add<R: Reduction, S: Set + 'static>(
        &mut self,
        nodes: Vec<u32>,
        corners: usize,
        set: S,
        unit: Unit,
        ids: Option<Vec<u32>>,
    ) -> Result<(), String> {
        let cells = Cells::<R, S>::new(nodes, corners, set).map_err(|e| e.to_string())?;
        let demand = Demand { ids, ..self.demand(unit) };
        self.posed.constrain(cells, demand);
        Ok(())
    }
}

/// Faces of as many corners each: their nodes and their numbers.
type Alike = BTreeMap<usize, (Vec<u32>, Vec<u32>)>;

impl Builder<'_> {
    fn posed(&self) -> Result<(Posed, Vec<u32>), ShapeError> {
        let selector = Selector::new(self.mesh, &self.recipe.select);
        let selector = selector.map_err(|(place, what)| ShapeError(format!("{place}: {what}")))?;
        let start = &self.frame.start;
        let used = &self.frame.used;
        let stay = self.recipe.stay;
        let springs = (0..start.len()).filter(|v| stay > 0.0 || !used[*v]);
        // What is in no face stays, whatever its weight.
        let springs = springs.map(|v| (v as u32, if used[v] { stay } else { 1.0 }, start[v])).collect();
        let quadratic = Quadratic { springs, ..Quadratic::default() };
        let mut posed = Posed::new(start.as_flattened().to_vec(), Vec::new(), quadratic);
        posed.way = Way::of(self.settings);
        let mut fixed = Vec::new();
        for (i, c) in self.recipe.constraints.iter().enumerate() {
            let hold = c.weight.map_or(Hold::Hard(self.settings.mu), Hold::Soft);
            let mut adding =
                Adding { posed: &mut posed, fixed: &mut fixed, selector: &selector, hold, name: called(i, c) };
            self.add(c, &mut adding).map_err(|what| ShapeError(format!("{}: {what}", place(i, c))))?;
        }
        if posed.groups.is_empty() && posed.problem.quadratic.form.is_empty() {
            return Err(ShapeError(
                "the constraints are about nothing: no vertex, edge or face is selected".to_string(),
            ));
        }
        Ok((posed, fixed))
    }

    /// Own coordinates of points of the user.
    fn own(&self, points: &[V3]) -> Vec<V3> {
        self.frame.own(points)
    }

    fn faces(&self, c: &ConstraintSpec, selector: &Selector<'_>) -> Result<Vec<u32>, String> {
        selector.faces(c.faces.as_ref().unwrap_or(&FaceSpec::Named("all".to_string())))
    }

    fn vertices(&self, c: &ConstraintSpec, selector: &Selector<'_>, default: &str) -> Result<Vec<u32>, String> {
        let found = selector.vertices(c.vertices.as_ref().unwrap_or(&VertexSpec::Named(default.to_string())))?;
        Ok(found)
    }

    fn alike(&self, faces: &[u32], at_least: usize) -> Alike {
        let mut alike = Alike::new();
        for f in faces {
            let face = self.frame.faces.get(*f as usize);
            if face.len() >= at_least {
                let (nodes, ids) = alike.entry(face.len()).or_default();
                nodes.extend_from_slice(face);
                ids.push(*f);
            }
        }
        alike
    }

    /// Faces that have to have four corners: the nodes, and the numbers.
    fn quads(&self, c: &ConstraintSpec, selector: &Selector<'_>) -> Result<(Vec<u32>, Vec<u32>), String> {
        let mut alike = self.alike(&self.faces(c, selector)?, 0);
        let quads = alike.remove(&4).unwrap_or_default();
        if c.faces.is_some()
            && let Some((corners, (_, ids))) = alike.iter().next()
        {
            let f = ids.first().copied().unwrap_or_default();
            return Err(format!("face {f} has {corners} corners, {} is for four; leave it out", c.kind.name()));
        }
        Ok(quads)
    }

    fn add(&self, c: &ConstraintSpec, to: &mut Adding<'_>) -> Result<(), String> {
        let plane = || {
            let (point, normal) = (c.point.unwrap_or_default(), c.normal.unwrap_or_default());
            let point = self.own(&[point])[0];
            Plane::new(point, normal).map_err(|_| "the `normal` has no direction; give a vector".to_string())
        };
        match c.kind {
            Kind::Planar if c.vertices.is_some() => {
                let nodes = self.group(c, to.selector, 4)?;
                let k = nodes.len();
                to.add::<MeanCentred, _>(nodes, k, Planar, Unit::Length, None)
            }
            Kind::Planar => {
                for (k, (nodes, ids)) in self.alike(&self.faces(c, to.selector)?, 4) {
                    to.add::<MeanCentred, _>(nodes, k, Planar, Unit::Length, Some(ids))?;
                }
                Ok(())
            }
            Kind::Circle => {
                for (k, (nodes, ids)) in self.alike(&self.faces(c, to.selector)?, 4) {
                    to.add::<MeanCentred, _>(nodes, k, Circle, Unit::Length, Some(ids))?;
                }
                Ok(())
            }
            Kind::Conical => {
                let wanted = self.vertices(c, to.selector, "inner")?;
                let rings = rings_of_four(self.frame.start.len(), self.frame.faces.iter());
                let ring = |v: &u32| rings.binary_search_by_key(v, |r| r[0]).ok().map(|at| rings[at]);
                if c.vertices.is_some()
                    && let Some(v) = wanted.iter().find(|v| ring(v).is_none())
                {
                    return Err(format!(
                        "vertex {v} is no inner one of four faces, which conical is for; leave it out"
                    ));
                }
                let chosen: Vec<[u32; 5]> = wanted.iter().filter_map(ring).collect();
                let ids = chosen.iter().map(|r| r[0]).collect();
                to.add::<Spokes, _>(chosen.into_flattened(), 5, Conical, Unit::Angle, Some(ids))
            }
            Kind::Parallelogram => {
                let (nodes, ids) = self.quads(c, to.selector)?;
                to.add::<MeanCentred, _>(nodes, 4, Parallelogram, Unit::Length, Some(ids))
            }
            Kind::Rectangle => {
                let (nodes, ids) = self.quads(c, to.selector)?;
                to.add::<MeanCentred, _>(nodes, 4, Rectangle, Unit::Length, Some(ids))
            }
            Kind::Regular => {
                for (k, (nodes, ids)) in self.alike(&self.faces(c, to.selector)?, 3) {
                    let set = RegularPolygon::new(k).map_err(|e| e.to_string())?;
                    to.add::<MeanCentred, _>(nodes, k, set, Unit::Length, Some(ids))?;
                }
                Ok(())
            }
            Kind::Rigid | Kind::Similar => self.add_templates(c, to),
            Kind::Line => {
                let nodes = self.group(c, to.selector, 3)?;
                let k = nodes.len();
                to.add::<MeanCentred, _>(nodes, k, Line, Unit::Length, None)
            }
            Kind::EdgeLength => self.add_lengths(c, to),
            Kind::Angle => {
                let range = AngleRange::new(
                    c.min.unwrap_or(0.0).to_radians(),
                    c.max.map_or(std::f64::consts::PI, f64::to_radians),
                );
                let mut nodes = Vec::new();
                for f in self.faces(c, to.selector)? {
                    let face = self.frame.faces.get(f as usize);
                    let k = face.len();
                    (0..k).for_each(|i| nodes.extend([face[i], face[(i + 1) % k], face[(i + k - 1) % k]]));
                }
                to.add::<TipDifferences, _>(nodes, 3, range, Unit::Angle, None)
            }
            Kind::Near => {
                let nodes = self.vertices(c, to.selector, "all")?;
                let surface: Arc<dyn Closest> = match &c.to {
                    None => self.frame.surface.clone(),
                    Some(file) => self.frame.surface_of(self.other(file)?).map_err(|e| e.0)?,
                };
                let ids = Some(nodes.clone());
                to.add::<Vertex, _>(nodes, 1, Near::Shared(surface), Unit::Length, ids)
            }
            Kind::Curve => {
                let nodes = self.vertices(c, to.selector, "border")?;
                let curve = self.curve(c, to.selector)?;
                let ids = Some(nodes.clone());
                to.add::<Vertex, _>(nodes, 1, Near::Shared(Arc::new(curve)), Unit::Length, ids)
            }
            Kind::At | Kind::Fixed => {
                let nodes = self.vertices(c, to.selector, "all")?;
                let points = match &c.points {
                    None => nodes.iter().map(|v| self.frame.start[*v as usize]).collect(),
                    Some(points) if points.len() == nodes.len() => self.own(points),
                    Some(points) => {
                        let (given, n) = (points.len(), nodes.len());
                        return Err(format!("`points` has {given} of them for {n} vertices; give one each"));
                    }
                };
                if c.kind == Kind::Fixed && matches!(to.hold, Hold::Hard(_)) {
                    to.fixed.extend_from_slice(&nodes);
                }
                let ids = Some(nodes.clone());
                to.add::<Vertex, _>(nodes, 1, Near::At(Points(points)), Unit::Length, ids)
            }
            Kind::Plane => {
                let nodes = self.vertices(c, to.selector, "all")?;
                let plane = plane()?;
                let plane = if c.one_sided.unwrap_or(false) { plane.one_side() } else { plane };
                let ids = Some(nodes.clone());
                to.add::<Vertex, _>(nodes, 1, plane, Unit::Length, ids)
            }
            Kind::Symmetric => {
                let plane = plane()?;
                let (pairs, own) = self.mirrored(c, to.selector, &plane)?;
                to.add::<Vertices, _>(pairs.into_flattened(), 2, Symmetric(plane), Unit::Length, None)?;
                let ids = Some(own.clone());
                to.add::<Vertex, _>(own, 1, plane, Unit::Length, ids)
            }
            Kind::RelativeLaplacian | Kind::Laplacian => {
                let weight = c.weight.unwrap_or(0.0);
                let fairing = match c.kind {
                    Kind::Laplacian => Fairing { smooth: weight, relative: 0.0 },
                    _ => Fairing { smooth: 0.0, relative: weight },
                };
                self.frame.fair(fairing, &mut to.posed.problem.quadratic);
                Ok(())
            }
        }
    }

    /// Vertices that form one element.
    fn group(&self, c: &ConstraintSpec, selector: &Selector<'_>, least: usize) -> Result<Vec<u32>, String> {
        let nodes = self.vertices(c, selector, "all")?;
        match nodes.len() {
            n if n < least => Err(format!("`vertices` are {n}, {} is about at least {least}", c.kind.name())),
            // D^T D of an element is dense.
            n if n > MOST => Err(format!("`vertices` are {n}, more than {MOST} of them are too many for one element")),
            _ => Ok(nodes),
        }
    }

    fn add_templates(&self, c: &ConstraintSpec, to: &mut Adding<'_>) -> Result<(), String> {
        let alike = match c.vertices {
            Some(_) => {
                let nodes = self.group(c, to.selector, 2)?;
                Alike::from([(nodes.len(), (nodes, Vec::new()))])
            }
            None => self.alike(&self.faces(c, to.selector)?, 3),
        };
        for (k, (nodes, ids)) in alike {
            let points = nodes.iter().map(|v| self.frame.start[*v as usize]).collect();
            let template = Template::new(points, k).map_err(|e| e.to_string())?;
            let ids = (!ids.is_empty()).then_some(ids);
            match c.kind {
                Kind::Rigid => to.add::<MeanCentred, _>(nodes, k, Rigid(template), Unit::Length, ids)?,
                _ => to.add::<MeanCentred, _>(nodes, k, Similar(template), Unit::Length, ids)?,
            }
        }
        Ok(())
    }

    fn add_lengths(&self, c: &ConstraintSpec, to: &mut Adding<'_>) -> Result<(), String> {
        let edges = to.selector.edges(c.edges.as_ref().unwrap_or(&EdgeSpec::Named("all".to_string())))?;
        let points = &self.frame.start;
        let length = |[a, b]: &[u32; 2]| {
            let (a, b) = (points[*a as usize], points[*b as usize]);
            (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
        };
        let own = |l: f64| self.frame.own_length(l);
        let lengths = match &c.length {
            Some(LengthSpec::Units(l)) => Length::equal(own(*l)),
            Some(LengthSpec::Named(LengthName::Mean)) => {
                Length::equal(edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64)
            }
            Some(LengthSpec::Named(LengthName::Keep)) => {
                Length::each(edges.iter().map(length).map(|l| [l, l]).collect())
            }
            None => Length::within(c.min.map_or(0.0, own), c.max.map_or(f64::INFINITY, own)),
        };
        to.add::<EdgeDifference, _>(edges.into_flattened(), 2, lengths, Unit::Plain, None)
    }

    fn other(&self, file: &str) -> Result<&Mesh, String> {
        self.others.get(file).ok_or_else(|| format!("the file `{file}` has not been read"))
    }

    fn curve(&self, c: &ConstraintSpec, selector: &Selector<'_>) -> Result<Curve, String> {
        let broken = |e: proxel_model::constraint::ShapeIndexError| e.to_string();
        if let Some(points) = &c.points {
            return Curve::polyline(&self.own(points), c.closed.unwrap_or(false)).map_err(broken);
        }
        if c.closed.is_some() {
            return Err("`closed` is about `points`; leave it out".to_string());
        }
        match &c.to {
            None if selector.border().is_empty() => {
                Err("the mesh has no border; name a curve: `to` or `points`".to_string())
            }
            None => Curve::of_segments(&self.frame.start, selector.border()).map_err(broken),
            Some(file) => {
                let mesh = self.other(file)?;
                let segments = match mesh.edges.is_empty() {
                    false => mesh.edges.clone(),
                    true => Selector::new(mesh, &BTreeMap::new()).map_err(|(_, what)| what)?.border().to_vec(),
                };
                if segments.is_empty() {
                    return Err(format!("`{file}` has neither edges nor a border; give a mesh of lines"));
                }
                Curve::of_segments(&self.own(&mesh.points), &segments).map_err(broken)
            }
        }
    }

    /// Pairs that mirror each other, and vertices that are their own images.
    fn mirrored(
        &self,
        c: &ConstraintSpec,
        selector: &Selector<'_>,
        plane: &Plane,
    ) -> Result<(Vec<[u32; 2]>, Vec<u32>), String> {
        let n = self.frame.start.len();
        if let Some(pairs) = &c.pairs {
            let mut seen = vec![false; n];
            for v in pairs.iter().flat_map(|[a, b]| if a == b { vec![*a] } else { vec![*a, *b] }) {
                match seen.get_mut(v as usize) {
                    None => {
                        return Err(format!("vertex {v} of `pairs` is out of range, the vertices are 0 to {}", n - 1));
                    }
                    Some(seen) if *seen => return Err(format!("vertex {v} is in two `pairs`; name it once")),
                    Some(seen) => *seen = true,
                }
            }
            let (own, pairs): (Vec<[u32; 2]>, Vec<[u32; 2]>) = pairs.iter().partition(|[a, b]| a == b);
            return Ok((pairs, own.into_iter().map(|[a, _]| a).collect()));
        }
        let vertices = self.vertices(c, selector, "all")?;
        let points: Vec<V3> = vertices.iter().map(|v| self.frame.start[*v as usize]).collect();
        let dots: Vec<[u32; 2]> = (0..points.len() as u32).map(|i| [i, i]).collect();
        if dots.is_empty() {
            return Ok((Vec::new(), Vec::new()));
        }
        // The image of each, among the points themselves.
        let among = Curve::of_segments(&points, &dots).map_err(|e| e.to_string())?;
        let mut by_place: Vec<u32> = (0..points.len() as u32).collect();
        let order = |a: &V3, b: &V3| {
            a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        };
        by_place.sort_by(|a, b| order(&points[*a as usize], &points[*b as usize]).then(a.cmp(b)));
        let image = |i: usize| {
            let near = among.closest(plane.mirror(points[i]));
            let at = by_place.partition_point(|k| order(&points[*k as usize], &near).is_lt());
            by_place.get(at).map(|k| *k as usize)
        };
        let images: Vec<Option<usize>> = (0..points.len()).map(image).collect();
        let (mut pairs, mut own) = (Vec::new(), Vec::new());
        for (i, image) in images.iter().enumerate() {
            match image {
                Some(j) if *j == i => own.push(vertices[i]),
                Some(j) if images[*j] == Some(i) => {
                    if i < *j {
                        pairs.push([vertices[i], vertices[*j]]);
                    }
                }
                _ => {
                    let v = vertices[i];
                    return Err(format!(
                        "vertex {v} has no mirror image among the others; give `pairs`, or other `vertices`"
                    ));
                }
            }
        }
        Ok((pairs, own))
    }
}

/// The most vertices of one element.
const MOST: usize = 2000;
