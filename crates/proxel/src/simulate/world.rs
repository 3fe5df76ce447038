//! All bodies and obstacles of a scene, and the nodes of all bodies as one: free ones first.

use super::body::Body;
use super::obstacles::Obstacle;
use super::scene::SceneFile;
use crate::deform::elements::{Cells, build, measures};
use crate::deform::{DeformError, sheet};
use crate::pins::InputError;
use proxel_mesh::topology::{self, boundary_surface};
use proxel_model::elements::morton;
use proxel_model::points::Points;
use proxel_model::solid::Solid;
use proxel_model::strain_limit::LimitedElements;
use proxel_split::{SymmetricForm, Term, VIOLATION};
use std::sync::Arc;

type V3 = [f64; 3];

/// What never changes while a simulation runs.
pub(super) struct World {
    pub bodies: Vec<Body>,
    pub obstacles: Vec<Obstacle>,
    /// Where the solver's origin is.
    pub center: V3,
    /// Positions at rest, three numbers a node.
    pub rest: Vec<f64>,
    /// Positions at the start.
    pub start: Vec<f64>,
    /// Velocities at the start.
    pub velocity: Vec<f64>,
    /// Mass of each node.
    pub mass: Vec<f64>,
    /// The first nodes are free, the others held.
    pub n_free: usize,
    /// Bending of all sheets.
    pub form: SymmetricForm,
    /// The nodes of each part that nothing holds.
    pub floating: Vec<Vec<u32>>,
    /// Points of surfaces that can move, and those that cannot.
    pub touching: Touching,
    pub held: Touching,
    pub warnings: Vec<String>,
    pub repaired: Vec<String>,
}

/// The elements of all bodies.
pub(super) struct Terms {
    pub terms: Vec<Box<dyn Term>>,
    /// Whether the energy of each forbids inversion.
    pub barriers: Vec<bool>,
    /// Hard limits of the stretches of each, whether they are its sets or not.
    pub limits: Vec<Option<[f64; 2]>>,
}

/// What becomes of hard limits in terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hold {
    /// They are sets that a splitting holds.
    AsSets,
    /// Something else holds them.
    Not,
}

/// Points of the surfaces of bodies.
#[derive(Clone, Default)]
pub(super) struct Touching {
    pub points: Arc<Points>,
    /// The body and the vertex that each is.
    pub who: Vec<(usize, u32)>,
}

impl World {
    /// Reads and builds everything that a scene names.
    ///
    /// # Errors
    /// Whatever cannot be simulated, by the name of its body or obstacle.
    pub fn new(file: &SceneFile) -> Result<Self, InputError> {
        let scene = file.scene();
        let bodies = (0..scene.bodies.len()).map(|k| Body::new(file, k)).collect::<Result<Vec<_>, _>>()?;
        let obstacles = scene.obstacles.iter().enumerate().map(|(k, spec)| Obstacle::new(file, k, spec));
        let obstacles = obstacles.collect::<Result<Vec<_>, _>>()?;
        let mut world = World {
            bodies,
            obstacles,
            center: [0.0; 3],
            rest: Vec::new(),
            start: Vec::new(),
            velocity: Vec::new(),
            mass: Vec::new(),
            n_free: 0,
            form: SymmetricForm::default(),
            floating: Vec::new(),
            touching: Touching::default(),
            held: Touching::default(),
            warnings: Vec::new(),
            repaired: Vec::new(),
        };
        let other = |e: String| file.refuse("body", &e, "correct it");
        world.number().map_err(other)?;
        world.weigh(file)?;
        world.bend();
        world.find_floating();
        world.set_moving(file).map_err(other)?;
        world.find_surfaces();
        if !world.obstacles.is_empty() {
            world.check_start(file)?;
        }
        for body in &mut world.bodies {
            world.warnings.append(&mut body.warnings);
            world.repaired.append(&mut body.repaired);
        }
        Ok(world)
    }

    /// Number of nodes.
    pub fn n(&self) -> usize {
        self.mass.len()
    }

    /// Free nodes of all bodies first, each along a space-filling curve; then held ones.
    fn number(&mut self) -> Result<(), String> {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in self.bodies.iter().flat_map(|b| &b.nodes) {
            (low, high) = ([0, 1, 2].map(|d| low[d].min(p[d])), [0, 1, 2].map(|d| high[d].max(p[d])));
        }
        self.center = [0, 1, 2].map(|d| low[d] / 2.0 + high[d] / 2.0);
        let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        let mut keyed = Vec::new();
        for (b, body) in self.bodies.iter().enumerate() {
            let mut is_held = vec![false; body.nodes.len()];
            for (v, _) in body.held_nodes(0.0)? {
                is_held[v as usize] = true;
            }
            let nodes = body.nodes.iter().zip(&is_held).zip(0u32..);
            keyed.extend(nodes.map(|((p, held), v)| (*held, b, morton(*p, low, size), v)));
        }
        keyed.sort_unstable();
        self.n_free = keyed.partition_point(|k| !k.0);
        self.mass = vec![0.0; keyed.len()];
        self.velocity = vec![0.0; 3 * keyed.len()];
        for body in &mut self.bodies {
            body.number = vec![0; body.nodes.len()];
        }
        for (place, (_, b, _, v)) in keyed.iter().enumerate() {
            self.bodies[*b].number[*v as usize] = place as u32;
        }
        let center = self.center;
        let flat = |of: &dyn Fn(&Body) -> Vec<V3>| {
            let mut out = vec![0.0; 3 * keyed.len()];
            for body in &self.bodies {
                for (p, place) in of(body).iter().zip(&body.number) {
                    (0..3).for_each(|d| out[3 * *place as usize + d] = p[d] - center[d]);
                }
            }
            out
        };
        let rest = flat(&|b| b.element_mesh().points.clone());
        self.start = flat(&|b| b.nodes.clone());
        self.rest = rest;
        Ok(())
    }

    /// Masses of elements, in equal parts on their corners.
    fn weigh(&mut self, file: &SceneFile) -> Result<(), InputError> {
        for body in &self.bodies {
            for (rank, cells) in body.cells.iter().enumerate() {
                let renumbered = cells.renumbered(&body.number);
                let sizes = measures(&renumbered, &self.rest, 3);
                for (material, chosen) in cells.by_material(body.element_mesh(), &body.settings) {
                    let density = material.density.unwrap_or(if rank == 0 { body.settings.density } else { 0.0 });
                    for e in chosen {
                        let fill = match (cells, body.fill()) {
                            (Cells::Tets(_), Some(fill)) => fill.get(e).copied().unwrap_or(1.0),
                            _ => 1.0,
                        };
                        let share = density * sizes[e] * fill / cells.size() as f64;
                        for v in &renumbered.corners()[e * cells.size()..(e + 1) * cells.size()] {
                            self.mass[*v as usize] += share;
                        }
                    }
                }
            }
        }
        for (b, body) in self.bodies.iter().enumerate() {
            let weightless = |place: &u32| (*place as usize) < self.n_free && self.mass[*place as usize] <= 0.0;
            if let Some(v) = body.number.iter().position(weightless) {
                let what = format!("vertex {v} (0-based) has no mass: no element with a density uses it");
                return Err(file.refuse(
                    &format!("body[{b}]"),
                    &what,
                    "remove it, pin it, or give its elements a density",
                ));
            }
            let heavy: f64 = body.number.iter().map(|place| self.mass[*place as usize]).sum();
            if !heavy.is_finite() {
                return Err(file.refuse(
                    &format!("body[{b}].density"),
                    "its mass is no number",
                    "give it in other units",
                ));
            }
        }
        Ok(())
    }

    fn bend(&mut self) {
        let forms: Vec<SymmetricForm> = self
            .bodies
            .iter_mut()
            .map(|body| {
                let Body { mesh, settings, cells, number, warnings, .. } = body;
                sheet::bending(&mesh.name, settings, cells, number, &self.rest, warnings)
            })
            .collect();
        self.form = SymmetricForm::sum(&forms);
    }

    fn find_floating(&mut self) {
        let (mut corners, mut ends) = (Vec::new(), vec![0]);
        for body in &self.bodies {
            for cells in &body.cells {
                for element in cells.corners().chunks_exact(cells.size()) {
                    corners.extend(element.iter().map(|v| body.number[*v as usize]));
                    ends.push(corners.len());
                }
            }
        }
        let elements = ends.windows(2).map(|w| &corners[w[0]..w[1]]);
        let components = topology::components(self.n(), elements);
        let mut parts: Vec<Vec<u32>> = vec![Vec::new(); components.count];
        let mut held = vec![false; components.count];
        for (node, c) in components.of_vertex.iter().enumerate() {
            if let Some(c) = c {
                parts[*c as usize].push(node as u32);
                held[*c as usize] |= node >= self.n_free;
            }
        }
        self.floating = parts.into_iter().zip(held).filter(|(_, held)| !held).map(|(part, _)| part).collect();
    }

    /// Velocities at the start: of held nodes those that their script begins with, and positions at time 0.
    fn set_moving(&mut self, file: &SceneFile) -> Result<(), String> {
        let dt = file.scene().time.dt;
        for (body, spec) in self.bodies.iter().zip(&file.scene().bodies) {
            let at = |place: u32| -> V3 { [0, 1, 2].map(|d| self.start[3 * place as usize + d]) };
            let mass: f64 = body.number.iter().map(|p| self.mass[*p as usize]).sum();
            let moment = |d: usize| body.number.iter().map(|p| self.mass[*p as usize] * at(*p)[d]).sum::<f64>();
            let middle: V3 = [0, 1, 2].map(|d| moment(d) / mass);
            let w = spec.angular_velocity;
            for place in &body.number {
                let r = [0, 1, 2].map(|d| at(*place)[d] - middle[d]);
                let spin = [w[1] * r[2] - w[2] * r[1], w[2] * r[0] - w[0] * r[2], w[0] * r[1] - w[1] * r[0]];
                (0..3).for_each(|d| self.velocity[3 * *place as usize + d] = spec.velocity[d] + spin[d]);
            }
            let next = body.held_nodes(dt)?;
            for ((v, now), (_, then)) in body.held_nodes(0.0)?.into_iter().zip(next) {
                let place = 3 * body.number[v as usize] as usize;
                for d in 0..3 {
                    self.start[place + d] = now[d] - self.center[d];
                    self.velocity[place + d] = (then[d] - now[d]) / dt;
                }
            }
        }
        Ok(())
    }

    /// Vertices of surfaces: of tetrahedra their boundary, of skins their faces' corners, else all corners.
    fn find_surfaces(&mut self) {
        let (mut free, mut held) = ((Points::default(), Vec::new()), (Points::default(), Vec::new()));
        for (b, body) in self.bodies.iter().enumerate() {
            let mut add = |v: u32, nodes: &[u32], weights: &[f64]| {
                let moves = nodes.iter().zip(weights).any(|(n, w)| *w != 0.0 && (*n as usize) < self.n_free);
                let (points, who) = if moves { &mut free } else { &mut held };
                points.push(nodes, weights);
                who.push((b, v));
            };
            if let Some(carrier) = &body.carrier {
                let skin = carrier.skin(&body.mesh);
                for v in skin.places() {
                    if let Some((nodes, weights)) = skin.at(v) {
                        add(v, &nodes.map(|n| body.number[n as usize]), &weights);
                    }
                }
                continue;
            }
            let mut outside: Vec<u32> = Vec::new();
            for cells in &body.cells {
                match cells {
                    Cells::Tets(tets) => outside.extend_from_slice(boundary_surface(tets).as_flattened()),
                    other => outside.extend_from_slice(other.corners()),
                }
            }
            outside.sort_unstable();
            outside.dedup();
            outside.iter().for_each(|v| add(*v, &[body.number[*v as usize]], &[1.0]));
        }
        self.touching = Touching { points: Arc::new(free.0), who: free.1 };
        self.held = Touching { points: Arc::new(held.0), who: held.1 };
    }

    /// Refuses bodies that begin inside of obstacles.
    fn check_start(&self, file: &SceneFile) -> Result<(), InputError> {
        for obstacle in &self.obstacles {
            let solid = obstacle.at(0.0, self.center);
            for touching in [&self.touching, &self.held] {
                for (k, (b, v)) in touching.who.iter().enumerate() {
                    let body = &self.bodies[*b];
                    let depth = -solid.nearest(touching.points.at(k, &self.start)).distance;
                    if depth > VIOLATION * body.size {
                        let what = format!(
                            "vertex {v} (0-based) of `{}` starts {depth:.3e} m inside of obstacle `{}`",
                            body.mesh.name, obstacle.name
                        );
                        return Err(file.refuse(&format!("body[{b}]"), &what, "move the body or the obstacle"));
                    }
                }
            }
        }
        Ok(())
    }

    /// The elements of all bodies as terms, made anew, and whether the energy of each forbids inversion.
    ///
    /// # Errors
    /// Elements or materials that cannot be used.
    pub fn terms(&self, hold: Hold) -> Result<Terms, DeformError> {
        let (mut terms, mut barriers, mut limits) = (Vec::new(), Vec::new(), Vec::new());
        for body in &self.bodies {
            let mut free;
            let settings = match hold {
                Hold::AsSets => &body.settings,
                Hold::Not => {
                    free = body.settings.clone();
                    free.strain_limit = None;
                    &free
                }
            };
            for cells in &body.cells {
                for (material, chosen) in cells.by_material(body.element_mesh(), &body.settings) {
                    let Body { number, mesh, .. } = body;
                    let built = build(cells, &chosen, body.fill(), number, &self.rest, material, settings, &mesh.name)?;
                    terms.push(built.term);
                    // What is turned inside out is beyond any limit.
                    let solid = matches!(cells, Cells::Tets(_));
                    barriers.push(built.barrier || (solid && body.settings.strain_limit.is_some()));
                    limits.push(body.settings.strain_limit);
                }
            }
        }
        Ok(Terms { terms, barriers, limits })
    }

    /// The elements that have hard limits, over the numbers of nodes.
    ///
    /// # Errors
    /// Elements that cannot be used.
    pub fn limited(&self) -> Result<LimitedElements, DeformError> {
        let mut limited = LimitedElements::default();
        for body in &self.bodies {
            let Some(limits) = body.settings.strain_limit else { continue };
            for cells in &body.cells {
                let renumbered = cells.renumbered(&body.number);
                let corners = renumbered.corners();
                let added = match cells {
                    Cells::Tets(_) => limited.add::<3>(&self.rest, corners, body.fill(), limits),
                    Cells::Triangles(_) => limited.add::<2>(&self.rest, corners, None, limits),
                    Cells::Springs(_) => limited.add::<1>(&self.rest, corners, None, limits),
                };
                added.map_err(|e| DeformError(format!("{}: {e}", body.mesh.name)))?;
            }
        }
        Ok(limited)
    }

    /// The mean length at rest of the edges of all elements, each edge of a body once: a of A(27).
    pub fn mean_edge(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for body in &self.bodies {
            let points = &body.element_mesh().points;
            let mut edges: Vec<[u32; 2]> = Vec::new();
            for cells in &body.cells {
                for element in cells.corners().chunks_exact(cells.size()) {
                    for (k, a) in element.iter().enumerate() {
                        edges.extend(element[..k].iter().map(|b| [*a.min(b), *a.max(b)]));
                    }
                }
            }
            edges.sort_unstable();
            edges.dedup();
            let length = |[a, b]: &[u32; 2]| {
                let (a, b) = (points[*a as usize], points[*b as usize]);
                (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
            };
            sum += edges.iter().map(length).sum::<f64>();
            count += edges.len();
        }
        sum / count.max(1) as f64
    }

    /// Where held nodes are at a time, written into positions.
    ///
    /// # Errors
    /// As [`Body::held_nodes`].
    pub fn move_held(&self, time: f64, x: &mut [f64]) -> Result<(), String> {
        for body in &self.bodies {
            for (v, p) in body.held_nodes(time)? {
                let place = 3 * body.number[v as usize] as usize;
                (0..3).for_each(|d| x[place + d] = p[d] - self.center[d]);
            }
        }
        Ok(())
    }

    /// The vertices of body `b` when nodes are at `x`.
    pub fn vertices(&self, b: usize, x: &[f64], time: f64) -> Vec<V3> {
        let body = &self.bodies[b];
        let mut nodes = self.at_nodes(b, x);
        nodes.iter_mut().for_each(|p| *p = [0, 1, 2].map(|d| p[d] + self.center[d]));
        let mut out = body.vertices(&nodes, time);
        if body.carrier.is_none() {
            body.held_at(time).iter().for_each(|(v, target)| out[*v as usize] = *target);
        }
        out
    }

    /// Vectors at the nodes of body `b`, in its own order.
    pub fn at_nodes(&self, b: usize, flat: &[f64]) -> Vec<V3> {
        self.bodies[b].number.iter().map(|p| [0, 1, 2].map(|d| flat[3 * *p as usize + d])).collect()
    }
}
