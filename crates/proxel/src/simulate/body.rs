//! A body of a scene: its mesh where it starts, its elements, what holds it.

use super::obstacles::pose;
use super::scene::{BodySpec, Generate, Scene, SceneFile, Split};
use super::track::Track;
use crate::deform::check::check_size;
use crate::deform::elements::Cells;
use crate::deform::embedded::{Carrier, Carrying};
use crate::deform::{DeformInput, sheet};
use crate::pins::InputError;
use crate::settings::{AdmmSettings, AndersonWindows, DeformSettings, Schedule};
use proxel_mesh::generate::{CellSplit, ball, beam, cloth, torus};
use proxel_mesh::{Mesh, check};
use std::collections::BTreeMap;

type V3 = [f64; 3];

/// A body before its nodes are numbered among those of all bodies.
pub(super) struct Body {
    /// Its mesh, rest shape where the body was put; what is written.
    pub mesh: Mesh,
    /// Where its vertices start, pins aside.
    pub start: Vec<V3>,
    /// What carries its surface, where it is one in a lattice.
    pub carrier: Option<Box<Carrier>>,
    /// Where its nodes start: vertices, or those of the lattice.
    pub nodes: Vec<V3>,
    /// Its elements over its nodes.
    pub cells: Vec<Cells>,
    /// What it is made of, and how its terms are built.
    pub settings: DeformSettings,
    /// What is held.
    pub tracks: Vec<Track>,
    /// Its vertices that are held, ascending.
    pub held: Vec<u32>,
    /// The diagonal of its box where it starts.
    pub size: f64,
    /// The number of each node among all.
    pub number: Vec<u32>,
    pub warnings: Vec<String>,
    pub repaired: Vec<String>,
}

impl Body {
    /// Body `k` of a scene: reads or makes its mesh, puts it in its place, chooses what is held.
    pub fn new(file: &SceneFile, k: usize) -> Result<Self, InputError> {
        let (scene, spec) = (file.scene(), &file.scene().bodies[k]);
        let place = format!("body[{k}]");
        let refuse = |key: &str, what: &str| file.refuse(&format!("{place}{key}"), what, "correct it");
        let key = if spec.mesh.is_some() { ".mesh" } else { ".generate" };
        let mesh = |e: proxel_mesh::MeshError| refuse(key, &e.to_string());
        let mut rest = match (&spec.mesh, &spec.generate) {
            (Some(path), _) => file.mesh(path).map_err(mesh)?,
            (None, Some(generate)) => make(generate).map_err(mesh)?,
            (None, None) => Mesh::default(),
        };
        rest.name = spec.name.clone();
        rest.check_indices().and_then(|()| rest.check_repeated()).map_err(mesh)?;
        let mut start = match &spec.start {
            Some(path) => file.points(path).map_err(|e| refuse(".start", &e.to_string()))?,
            None => rest.points.clone(),
        };
        if start.len() != rest.n_verts() {
            let what = format!("it has {} vertices, the mesh has {}", start.len(), rest.n_verts());
            return Err(refuse(".start", &what));
        }
        let motion = pose(&spec.rotate);
        for p in rest.points.iter_mut().chain(&mut start) {
            let turned = motion.apply(p.map(|v| v * spec.scale));
            *p = [0, 1, 2].map(|d| turned[d] + spec.translate[d]);
        }
        if let Some(v) = start.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(refuse(".start", &format!("a coordinate of vertex {v} (0-based) is not finite")));
        }
        let settings = settings(scene, spec);
        let deform = |e: crate::deform::DeformError| refuse("", &e.to_string());
        check_size(&rest.name, &rest).map_err(deform)?;
        let mut body = Body {
            size: diagonal(&start),
            mesh: rest,
            start,
            carrier: None,
            nodes: Vec::new(),
            cells: Vec::new(),
            settings,
            tracks: Vec::new(),
            held: Vec::new(),
            number: Vec::new(),
            warnings: Vec::new(),
            repaired: Vec::new(),
        };
        let carrying = Carrier::of(&DeformInput { rest: body.mesh.clone(), ..DeformInput::default() }, &body.settings);
        match carrying.map_err(deform)? {
            Carrying::Body(carrier) => body.carry(carrier, spec).map_err(|e| refuse("", &e))?,
            Carrying::No { warning } => {
                body.warnings.extend(warning);
                body.volumes(spec).map_err(mesh)?;
                body.cells = Cells::all(&body.mesh, &body.mesh.tets, &body.settings);
                body.nodes = body.start.clone();
                if body.cells.iter().all(|cells| cells.len() == 0) {
                    return Err(refuse(key, "it has no elements"));
                }
                sheet::check(&spec.name, &body.mesh.points, &body.settings, &body.cells).map_err(deform)?;
                body.warnings.extend(sheet::repeated(&spec.name, &body.cells));
            }
        }
        body.hold(file, &place, spec)?;
        Ok(body)
    }

    /// Elements of negative volume at rest are turned if that is wanted, and refused if not.
    fn volumes(&mut self, spec: &BodySpec) -> Result<(), proxel_mesh::MeshError> {
        let negative = check::check_tets(&self.mesh.points, &self.mesh.tets).negative;
        if let Some(first) = negative.first().filter(|_| spec.fix_orientation) {
            let turned = check::fix_orientation(&self.mesh.points, &mut self.mesh.tets);
            self.repaired.push(format!(
                "{}: {turned} tetrahedra of negative volume were turned, the first is {first} (0-based)",
                spec.name
            ));
        }
        if !self.mesh.tets.is_empty() {
            check::require_volumes(&self.mesh)?;
        }
        Ok(())
    }

    /// The lattice that carries a surface, and its nodes where the surface starts.
    fn carry(&mut self, carrier: Box<Carrier>, spec: &BodySpec) -> Result<(), String> {
        let lattice = &carrier.embedding().lattice;
        self.nodes = lattice.points.clone();
        if self.start != self.mesh.points {
            let modulus = spec.material.modulus().map_err(|e| e.to_string())?;
            self.nodes = carrier.start(&self.start, &[], modulus).map_err(|e| e.to_string())?;
        }
        self.cells = Cells::all(lattice, &lattice.tets, &self.settings);
        self.warnings.extend_from_slice(carrier.warnings());
        self.carrier = Some(carrier);
        Ok(())
    }

    /// The elements' mesh: the lattice where there is one.
    pub fn element_mesh(&self) -> &Mesh {
        self.carrier.as_ref().map_or(&self.mesh, |carrier| &carrier.embedding().lattice)
    }

    /// The part of each tetrahedron that is material.
    pub fn fill(&self) -> Option<&[f64]> {
        self.carrier.as_ref().map(|carrier| &carrier.embedding().fill[..])
    }

    fn hold(&mut self, file: &SceneFile, place: &str, spec: &BodySpec) -> Result<(), InputError> {
        let mut holder: BTreeMap<u32, usize> = BTreeMap::new();
        for (k, pin) in spec.pins.iter().enumerate() {
            let place = format!("{place}.pin[{k}]");
            if self.carrier.is_some() && pin.keyframes.iter().any(|key| key.targets.is_some()) {
                let what = "a surface in a lattice is held by rigid motions, not by targets";
                return Err(file.refuse(&place, what, "use rotate and translate, or a mesh of tetrahedra"));
            }
            let mut vertices = pin
                .group()
                .select(&spec.name, &pin.name, &self.start)
                .map_err(|e| file.refuse(&place, e.what(), e.remedy().to_owned()))?;
            vertices.sort_unstable();
            vertices.dedup();
            for v in &vertices {
                if let Some(other) = holder.insert(*v, k) {
                    let what = format!("vertex {v} (0-based) is held by `{}` too", spec.pins[other].name);
                    return Err(file.refuse(&place, &what, "give each vertex one pin"));
                }
            }
            let home = vertices.iter().map(|v| (*v, self.start[*v as usize])).collect();
            self.tracks.push(Track::new(&format!("{} pin `{}`", spec.name, pin.name), pin, home)?);
        }
        self.held = holder.into_keys().collect();
        Ok(())
    }

    /// Where held vertices are at a time, ascending.
    pub fn held_at(&self, time: f64) -> Vec<(u32, V3)> {
        let mut held: Vec<(u32, V3)> = self.tracks.iter().flat_map(|track| track.at(time)).collect();
        held.sort_unstable_by_key(|h| h.0);
        held
    }

    /// Where held nodes are at a time, by their own numbers, ascending.
    ///
    /// # Errors
    /// Pins that share tetrahedra of a lattice and move apart.
    pub fn held_nodes(&self, time: f64) -> Result<Vec<(u32, V3)>, String> {
        let held = self.held_at(time);
        let Some(carrier) = &self.carrier else { return Ok(held) };
        let nodes = carrier.held(&self.mesh.points, &held);
        match nodes.springs.first() {
            None => Ok(nodes.nodes),
            Some((v, _)) => Err(format!(
                "{}: at time {time} the pins around vertex {v} (0-based) move apart, but share tetrahedra of the lattice; \
                 raise resolution or let them move alike",
                self.mesh.name
            )),
        }
    }

    /// Its vertices, from its nodes.
    pub fn vertices(&self, nodes: &[V3], time: f64) -> Vec<V3> {
        let Some(carrier) = &self.carrier else { return nodes.to_vec() };
        let held = self.held_at(time);
        let mut out = carrier.positions(nodes, &self.mesh.points, &held);
        held.iter().for_each(|(v, target)| out[*v as usize] = *target);
        out
    }

    /// Vectors at its vertices from those at its nodes.
    pub fn carried(&self, at_nodes: &[V3]) -> Vec<V3> {
        let Some(carrier) = &self.carrier else { return at_nodes.to_vec() };
        let e = carrier.embedding();
        let at = |v: usize| {
            e.at(v).map_or([0.0; 3], |(nodes, w)| {
                [0, 1, 2].map(|d| (0..4).map(|k| w[k] * at_nodes[nodes[k] as usize][d]).sum())
            })
        };
        (0..self.mesh.n_verts()).map(at).collect()
    }
}

fn make(generate: &Generate) -> Result<Mesh, proxel_mesh::MeshError> {
    match generate {
        Generate::Bar { cells, size, split } => {
            let split = match split {
                Split::Five => CellSplit::Five,
                Split::Six => CellSplit::Six,
                Split::FiveAlike => CellSplit::FiveAlike,
            };
            beam(*cells, *size, split)
        }
        Generate::Cloth { cells, size } => cloth(*cells, *size),
        Generate::Ball { radius, cell } => ball(*radius, *cell),
        Generate::Torus { major, minor, cell } => torus(*major, *minor, *cell),
    }
}

/// What `deform` would be told about the body.
fn settings(scene: &Scene, spec: &BodySpec) -> DeformSettings {
    let materials = spec.regions.iter().filter_map(|(k, m)| Some((k.parse().ok()?, m.clone()))).collect();
    let window = scene.solver.window;
    let of = DeformSettings::of(Schedule::Default);
    DeformSettings {
        method: scene.solver.method,
        admm: AdmmSettings { base_weight: scene.solver.base_weight, penalty: scene.solver.penalty, ..of.admm.clone() },
        anderson: AndersonWindows { aa_admm: window, aadr: window, ..AndersonWindows::default() },
        material: spec.material.clone(),
        materials,
        density: spec.density,
        bending: spec.bending,
        strain_limit: spec.strain_limit,
        mixed: spec.mixed,
        surface: spec.model,
        resolution: spec.resolution,
        tol: scene.solver.tol,
        max_iters: scene.solver.max_iters,
        ..of
    }
}

/// The diagonal of the box around points.
pub(super) fn diagonal(points: &[V3]) -> f64 {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points {
        (low, high) = ([0, 1, 2].map(|d| low[d].min(p[d])), [0, 1, 2].map(|d| high[d].max(p[d])));
    }
    (0..3).map(|d| (high[d] - low[d]).powi(2)).sum::<f64>().sqrt()
}
