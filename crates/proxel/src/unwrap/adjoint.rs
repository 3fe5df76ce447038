//! Gradients through [`unwrap`](super::unwrap), by the implicit function theorem.

use super::chart::ChartInput;
use super::flat::Flat;
use super::order::{Order, middle};
use super::problem::{MODULUS, problem};
use super::start::Start;
use super::{UnwrapError, UnwrapInput, Unwrapped, chart, pool};
use crate::settings::UnwrapSettings;
use proxel_model::elements::{BatchShape, SensitivityError, Step};
use proxel_model::energy::Lame;
use proxel_split::{Status, Tangent, TangentError, vector};

/// The derivatives of a function L of a map in what the run was given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapAdjoint {
    /// dL/d(position) of each vertex of the mesh, pins being where they are.
    pub vertices: Vec<[f64; 3]>,
    /// dL/d(place) of each entry of [`UnwrapInput::pins`].
    pub pins: Vec<[f64; 2]>,
    /// How far the map is from its minimum, to first order, in units of the mesh.
    pub distance: f64,
}

/// The derivatives of a function of the map `result`, which [`unwrap`](super::unwrap) has made of `input` and
/// `settings`. `slope` is dL/duv of each coordinate of the map.
///
/// The rest shape of each triangle follows its vertices; where H w = dL/duv, dL/dV = -d(w . g)/dV, g the gradient of
/// the energy in uv and H its Hessian. A chart without pins is determined up to a motion of the plane, and one with one
/// pin up to a turn about it. Derivatives are those of the map that is always moved and turned, as a whole, such that
/// it lies nearest to the present one (by the sum of squares over its coordinates): what L changes under motions of the
/// map counts for nothing. For an L that does not see where a chart lies and how it is turned, that is no restriction.
///
/// Costs a factor of each chart's Hessian in f64, and three solves. The same bits on any number of threads.
///
/// # Errors
/// A run that has not converged; packed maps, borders that are held, maps without overlaps and bounded stretches, which
/// depend on more than a minimum; triangles without area; a map at which the Hessian is not positive definite.
pub fn adjoint(
    input: &UnwrapInput,
    settings: &UnwrapSettings,
    result: &Unwrapped,
    slope: &[[f64; 2]],
) -> Result<MapAdjoint, UnwrapError> {
    check(input, settings, result, slope)?;
    pool(settings)?.install(|| adjoint_here(input, settings, result, slope))
}

/// Refuses what has no derivative.
fn check(
    input: &UnwrapInput,
    settings: &UnwrapSettings,
    result: &Unwrapped,
    slope: &[[f64; 2]],
) -> Result<(), UnwrapError> {
    let name = &input.mesh.name;
    let refuse = |text: String| Err(UnwrapError(format!("{name}: {text}")));
    let n = result.uv.coordinates.len();
    if slope.len() != n {
        return refuse(format!("dL/duv has {} rows for {n} coordinates; give one for each", slope.len()));
    }
    if let Some(c) = slope.iter().position(|s| s.iter().any(|s| !s.is_finite())) {
        return refuse(format!("dL/duv of coordinate {c} (0-based) is {:?}; give finite numbers", slope[c]));
    }
    if result.status != Status::Converged {
        return refuse(format!(
            "the run has the status \"{}\" ({}), so that it is at no minimum, whose gradients these would be; let it \
             converge: more iterations (--max-iters), more time, or another method",
            result.status.as_str(),
            result.report.reason
        ));
    }
    let packed = result.report.map.as_ref().is_some_and(|map| map.density.is_some());
    let (what, remedy) = match () {
        () if packed => ("packing", "leave the map in units of the mesh (--no-pack; pack=False)"),
        () if settings.fixed_boundary => ("the border of the start", "hold vertices of the border by pins"),
        () if settings.bijective => ("maps without overlaps", "leave out --bijective"),
        () if settings.max_stretch.is_some() => {
            ("cuts that bound the stretch", "leave out --max-stretch, and give seams")
        }
        () => return Ok(()),
    };
    refuse(format!("there are no gradients through {what}; {remedy}"))
}

fn adjoint_here(
    input: &UnwrapInput,
    settings: &UnwrapSettings,
    result: &Unwrapped,
    slope: &[[f64; 2]],
) -> Result<MapAdjoint, UnwrapError> {
    let mut out = MapAdjoint { vertices: vec![[0.0; 3]; input.mesh.n_verts()], ..MapAdjoint::default() };
    let mut pins = vec![[0.0; 2]; if input.pins.is_empty() { 0 } else { input.mesh.n_verts() }];
    let mut first = 0;
    for of in chart::inputs(input, &result.charts)? {
        // As charts are laid one after another.
        let range = first..first + of.points.len();
        first = range.end;
        let (Some(uv), Some(slope)) = (result.uv.coordinates.get(range.clone()), slope.get(range)) else {
            return Err(UnwrapError(format!("{}: the map is not the one of these charts", input.mesh.name)));
        };
        let part = Chart::new(&of, uv, slope)
            .and_then(|chart| chart.solve(settings))
            .map_err(|e| UnwrapError(format!("{}: {}", input.mesh.name, e.0)))?;
        out.distance = out.distance.max(part.distance);
        for (v, g) in of.chart.vertices.iter().zip(&part.vertices) {
            (0..3).for_each(|d| out.vertices[*v as usize][d] += g[d]);
        }
        for ((v, _), g) in of.pins.iter().zip(&part.pins) {
            let pin = &mut pins[of.chart.vertices[*v as usize] as usize];
            (0..2).for_each(|d| pin[d] += g[d]);
        }
    }
    out.pins = input.pins.iter().map(|(v, _)| pins[*v as usize]).collect();
    Ok(out)
}

/// A chart at its map, in units of its shapes.
struct Chart<'a> {
    input: &'a ChartInput<'a>,
    flat: Flat<'a>,
    order: Order,
    uv: Vec<[f64; 2]>,
    slope: Vec<[f64; 2]>, // dL/duv
    fixed: Vec<u32>,
}

impl<'a> Chart<'a> {
    fn new(input: &'a ChartInput<'a>, uv: &[[f64; 2]], slope: &[[f64; 2]]) -> Result<Self, UnwrapError> {
        let Some(flat) = input.flat() else {
            return Err(UnwrapError("a chart has no area, and so no gradient; remove its faces".to_string()));
        };
        if let Some(t) = flat.degenerate.first() {
            let face = input.chart.faces[*t as usize];
            return Err(UnwrapError(format!(
                "face {face} (0-based) has a triangle without area, whose stand-in has no gradient; move its vertices \
                 or remove it"
            )));
        }
        let mut fixed: Vec<u32> = input.pins.iter().map(|p| p.0).collect();
        if fixed.is_empty() {
            fixed.push(middle(uv) as u32);
        }
        let order = Order::new(&flat, &fixed);
        let uv = uv.iter().map(|p| p.map(|v| v * flat.scale)).collect();
        // dL/d(s uv) = (1/s) dL/duv
        let mut slope: Vec<[f64; 2]> = slope.iter().map(|g| g.map(|v| v / flat.scale)).collect();
        if input.pins.is_empty() {
            without_push(&mut slope);
        }
        Ok(Chart { input, flat, order, uv, slope, fixed })
    }

    /// The turn about what is held, where that is one vertex: it costs nothing.
    fn turns(&self) -> Vec<Vec<f64>> {
        let [held] = self.fixed[..] else { return Vec::new() };
        let [cx, cy] = self.uv[held as usize];
        let turn: Vec<[f64; 2]> = self.uv.iter().map(|[x, y]| [cy - y, x - cx]).collect();
        vec![self.order.solver(&turn)[..2 * self.order.n_free].to_vec()]
    }

    fn solve(mut self, settings: &UnwrapSettings) -> Result<MapAdjoint, UnwrapError> {
        if self.input.pins.is_empty() {
            without_turn(&mut self.slope, &self.uv);
        }
        let start = Start { uv: self.uv.clone(), flips: 0, weights: None };
        let mut problem = problem(&self.flat, &self.order, &start, self.input, settings)?;
        let mut w = vec![0.0; problem.x0.len()];
        let mut distance = 0.0;
        let free = 2 * problem.n_free;
        if free > 0 {
            let x = problem.x0.clone();
            let refuse = |e: TangentError| UnwrapError(format!("{e}; give the map pins, or begin elsewhere"));
            let mut tangent = Tangent::new(&mut problem, &x, self.turns(), settings.newton().memory).map_err(refuse)?;
            w[..free].copy_from_slice(&tangent.solve(&self.order.solver(&self.slope)[..free]).map_err(refuse)?);
            let mut g = vec![0.0; free];
            problem.energy(&x, Some(&mut g));
            distance = vector::norm(&tangent.solve(&g).map_err(refuse)?) / self.flat.scale;
        }
        let w = self.order.user(&w);
        let lame = Lame::new(MODULUS, 0.0).map_err(|e| UnwrapError(e.to_string()))?;
        let corners = self.flat.triangles.as_flattened();
        let found = Step {
            shape: BatchShape::PlanarTriangles,
            positions: &[],
            shapes: Some(&self.flat.shapes),
            elements: corners,
            fill: self.input.weights.as_deref(),
            per_measure: None,
            energy: &settings.energy,
            lame: &lame,
            x: self.uv.as_flattened(),
            w: w.as_flattened(),
        }
        .sensitivity()
        .map_err(|e| match e {
            SensitivityError::Kink(t) => UnwrapError(format!(
                "face {} (0-based) is where the energy has no second derivative; choose another energy",
                self.input.chart.faces[t]
            )),
            other => UnwrapError(other.to_string()),
        })?;
        let at = |v: u32, d: usize| self.slope[v as usize][d] - found.x[2 * v as usize + d];
        // The place of a pin in units of the shapes is scale times that of the user.
        let pins = self.input.pins.iter().map(|(v, _)| [0, 1].map(|d| self.flat.scale * at(*v, d))).collect();
        let mut vertices = vec![[0.0; 3]; self.input.points.len()];
        for (t, (corners, g)) in self.flat.triangles.iter().zip(&found.shapes).enumerate() {
            let gradient = self.edge_gradient(t, *corners, g);
            for (k, g) in gradient.iter().enumerate() {
                for d in 0..3 {
                    vertices[corners[k + 1] as usize][d] -= g[d];
                    vertices[corners[0] as usize][d] += g[d];
                }
            }
        }
        Ok(MapAdjoint { vertices, pins, distance })
    }

    /// From d phi / d(shape) of a triangle to that of its two edges in space. With A the shape and E the edges (as
    /// columns), scaled and as the metric sees them, Q = E A^-1 is the frame of the shape, and d phi / dE = Q d phi /
    /// dA.
    fn edge_gradient(&self, t: usize, corners: [u32; 3], g: &[[f64; 2]; 2]) -> [[f64; 3]; 2] {
        let [a, b, c] = corners.map(|v| self.input.points[v as usize]);
        let metric = self.input.metric.as_ref().map(|m| &m[t]);
        let edges = [b, c].map(|p| {
            let edge = [0, 1, 2].map(|d| self.flat.scale * (p[d] - a[d]));
            metric.map_or(edge, |m| m.apply(edge))
        });
        let frame = frame(self.flat.shapes[t], edges);
        [0, 1].map(|k| {
            let along = [0, 1, 2].map(|d| self.flat.scale * (frame[0][d] * g[0][k] + frame[1][d] * g[1][k]));
            metric.map_or(along, |m| m.apply_transposed(along))
        })
    }
}

/// The columns of [e, f] [[a, b], [0, d]]^-1.
fn frame([[a, b], [_, d]]: [[f64; 2]; 2], [e, f]: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
    let first = e.map(|v| v / a);
    [first, [0, 1, 2].map(|k| (f[k] - b * first[k]) / d)]
}

/// Forces without their mean.
fn without_push(slope: &mut [[f64; 2]]) {
    let n = slope.len().max(1) as f64;
    let mean = [0, 1].map(|d| slope.iter().map(|g| g[d]).sum::<f64>() / n);
    slope.iter_mut().for_each(|g| (0..2).for_each(|d| g[d] -= mean[d]));
}

/// Forces without their part along the turn of all points about their mean.
fn without_turn(slope: &mut [[f64; 2]], uv: &[[f64; 2]]) {
    let n = uv.len().max(1) as f64;
    let mean = [0, 1].map(|d| uv.iter().map(|p| p[d]).sum::<f64>() / n);
    let turn = |p: &[f64; 2]| [mean[1] - p[1], p[0] - mean[0]];
    let (mut along, mut size) = (0.0, 0.0);
    for (g, p) in slope.iter().zip(uv) {
        let t = turn(p);
        along += g[0] * t[0] + g[1] * t[1];
        size += t[0] * t[0] + t[1] * t[1];
    }
    if size > 0.0 {
        for (g, p) in slope.iter_mut().zip(uv) {
            let t = turn(p);
            (0..2).for_each(|d| g[d] -= along / size * t[d]);
        }
    }
}
