//! Bodies as they are: meshes with fields, and pictures.

use super::world::World;
use super::{SimulateError, State, scenery};
use crate::deform::Extras;
use crate::preview::{Camera, Image, Model, Scene, Style, render};
use proxel_mesh::topology::surface;
use proxel_mesh::{Fields, Mesh};

type V3 = [f64; 3];

/// Pixels of a picture.
const SIZE: [usize; 2] = [960, 720];

/// Body `b`: its mesh as it is, and displacement, velocity, stress, contact and reaction forces.
pub(super) fn body(
    world: &World,
    b: usize,
    state: &State,
    time: f64,
    contact: &[V3],
    reaction: &[f64],
) -> Result<(String, Mesh, Fields), SimulateError> {
    let body = &world.bodies[b];
    let points = world.vertices(b, &state.x, time);
    let mesh = body.mesh.with_points(points)?;
    let mut fields = Fields::none();
    let flat = |v: &[V3]| v.as_flattened().to_vec();
    let displacement: Vec<V3> =
        mesh.points.iter().zip(&body.mesh.points).map(|(x, rest)| [0, 1, 2].map(|d| x[d] - rest[d])).collect();
    fields.point("displacement", 3, flat(&displacement));
    fields.point("velocity", 3, flat(&body.carried(&world.at_nodes(b, &state.v))));
    let none = vec![[0.0; 3]; mesh.n_verts()];
    fields.point("contact_force", 3, flat(if contact.is_empty() { &none } else { contact }));
    let reaction = if reaction.is_empty() { none } else { at_held(world, b, reaction) };
    fields.point("reaction_force", 3, flat(&reaction));
    let mut pinned = vec![0.0; mesh.n_verts()];
    body.held.iter().for_each(|v| pinned[*v as usize] = 1.0);
    fields.point("pinned", 1, pinned);
    elements(world, b, state, &mesh, &mut fields)?;
    Ok((mesh.name.clone(), mesh, fields))
}

/// Forces on what holds a body, at its vertices; those on nodes of a lattice are shared out among the vertices around them.
fn at_held(world: &World, b: usize, reaction: &[f64]) -> Vec<V3> {
    let body = &world.bodies[b];
    let at_nodes = world.at_nodes(b, reaction);
    let Some(carrier) = &body.carrier else { return at_nodes };
    let mut out = vec![[0.0; 3]; body.mesh.n_verts()];
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); at_nodes.len()];
    for v in &body.held {
        if let Some((nodes, _)) = carrier.embedding().at(*v as usize) {
            nodes.iter().for_each(|n| around[*n as usize].push(*v));
        }
    }
    for (force, vertices) in at_nodes.iter().zip(&around) {
        for v in vertices {
            (0..3).for_each(|d| out[*v as usize][d] += force[d] / vertices.len() as f64);
        }
    }
    out
}

/// Stretches, energies and stresses: of elements, or of the lattice's tetrahedra at the vertices that they carry.
fn elements(world: &World, b: usize, state: &State, mesh: &Mesh, fields: &mut Fields) -> Result<(), SimulateError> {
    let body = &world.bodies[b];
    let Some(cells) = body.cells.first() else { return Ok(()) };
    let flat = |of: &[f64]| -> Vec<f64> { world.at_nodes(b, of).into_iter().flatten().collect() };
    let (rest, x) = (flat(&world.rest), flat(&state.x));
    let mut extras = Extras::default();
    extras.fill(body.element_mesh(), cells, &body.settings, (&rest, &x), 3)?;
    if let Some(carrier) = &body.carrier {
        let tets = &carrier.embedding().tet_of;
        let at = |of: &[f64]| tets.iter().map(|t| t.and_then(|t| of.get(t as usize)).copied().unwrap_or(0.0)).collect();
        fields.point("energy_density", 1, at(&extras.energy_density));
        fields.point("von_mises_stress", 1, at(&extras.von_mises));
        return Ok(());
    }
    let primary = [mesh.tets.len(), mesh.faces.len(), mesh.edges.len()].into_iter().find(|n| *n > 0).unwrap_or(0);
    if primary == extras.energy_density.len() {
        fields.cell("stretches", 3, extras.stretches.as_flattened().to_vec());
        fields.cell("energy_density", 1, extras.energy_density);
        fields.cell("von_mises_stress", 1, extras.von_mises);
    }
    Ok(())
}

/// All bodies and obstacles, seen as at the start.
pub(super) fn image(world: &World, x: &[f64], time: f64) -> Image {
    let mut models = Vec::new();
    for b in 0..world.bodies.len() {
        let body = &world.bodies[b];
        let model = Model::new(world.vertices(b, x, time), surface(&body.mesh).fan_triangles());
        models.push(model.pinned(body.held.iter().copied()));
        // Points without triangles hold the camera.
        models.push(Model::new(body.start.clone(), Vec::new()));
    }
    models.extend(scenery::models(world, time));
    render(&[Scene { models }], &Camera::default(), &Style::default(), SIZE[0], SIZE[1])
}
