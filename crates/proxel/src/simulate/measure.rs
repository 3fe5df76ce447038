//! What is measured of a state.

use super::State;
use super::contact::Walls;
use super::engine::Engine;
use super::record::FrameRecord;
use super::scene::Scene;
use super::world::World;
use proxel_model::contact::Contacts;

type V3 = [f64; 3];

/// The energy of elements and of bending, and its gradient over all nodes.
pub(super) fn elastic(world: &World, engine: &mut Engine, x: &[f64]) -> (f64, Vec<f64>) {
    let mut grad = vec![0.0; x.len()];
    let mut value: f64 = engine.elements().iter_mut().map(|t| t.energy(x, Some(&mut grad)).value).sum();
    value += world.form.value_and_gradient(x, 3, Some(&mut grad));
    (value, grad)
}

/// Energies and momenta of a state, and how well limits and obstacles hold.
pub(super) fn measure(scene: &Scene, world: &World, engine: &mut Engine, state: &State) -> FrameRecord {
    let State { x, v, frame, .. } = state;
    let time = *frame as f64 * scene.time.dt;
    let (mut kinetic, mut potential, mut p, mut l) = (0.0, 0.0, [0.0; 3], [0.0; 3]);
    for (i, m) in world.mass.iter().enumerate() {
        let r: V3 = [0, 1, 2].map(|d| x[3 * i + d] + world.center[d]);
        let u: V3 = [0, 1, 2].map(|d| v[3 * i + d]);
        let spin = [r[1] * u[2] - r[2] * u[1], r[2] * u[0] - r[0] * u[2], r[0] * u[1] - r[1] * u[0]];
        for d in 0..3 {
            kinetic += 0.5 * m * u[d] * u[d];
            potential -= m * scene.forces.gravity[d] * r[d];
            p[d] += m * u[d];
            l[d] += m * spin[d];
        }
    }
    let walls = Walls::new(world, time, time);
    let depth = walls.deepest(&world.touching, x).0.max(walls.deepest(&world.held, x).0);
    let (mut elastic, mut inverted) = (0.0, 0);
    for term in engine.elements() {
        let report = term.energy(x, None);
        elastic += report.value;
        inverted += report.inverted;
    }
    elastic += world.form.value_and_gradient(x, 3, None);
    FrameRecord {
        frame: *frame,
        time,
        kinetic,
        elastic,
        potential,
        momentum: p,
        angular_momentum: l,
        max_strain_violation: engine.strain_violation(x),
        max_penetration: depth,
        inverted,
        ..FrameRecord::default()
    }
}

/// Points that press on something.
pub(super) fn pressing(contacts: &Contacts, x: &[f64]) -> usize {
    let mut points: Vec<u32> =
        contacts.touches().iter().filter(|t| contacts.pressure(t, x) > 0.0).map(|t| t.point).collect();
    points.dedup();
    points.len()
}

/// Forces of obstacles on the vertices of each body.
pub(super) fn contact_forces(world: &World, contacts: &Contacts, x: &[f64]) -> Vec<Vec<V3>> {
    let mut out: Vec<Vec<V3>> = world.bodies.iter().map(|b| vec![[0.0; 3]; b.mesh.n_verts()]).collect();
    for touch in contacts.touches() {
        let force = contacts.force(touch, x);
        if let Some((b, v)) = world.touching.who.get(touch.point as usize) {
            (0..3).for_each(|d| out[*b][*v as usize][d] += force[d]);
        }
    }
    out
}
