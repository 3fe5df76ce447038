//! Bodies put where another program, or another run, has them.

use super::contact::Known;
use super::world::World;
use super::{SimulateError, State};

/// The vertices of a body in motion, in the order of its mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyState {
    /// m
    pub positions: Vec<[f64; 3]>,
    /// m/s
    pub velocities: Vec<[f64; 3]>,
}

/// The state after `frame` frames at which bodies are as given; nothing is known of forces of contact, nor of a step before.
///
/// # Errors
/// Another number of bodies or vertices, a number that is not finite, a body that a lattice carries.
pub(super) fn state(world: &World, frame: usize, bodies: &[BodyState]) -> Result<State, SimulateError> {
    if bodies.len() != world.bodies.len() {
        let (got, want) = (bodies.len(), world.bodies.len());
        return Err(SimulateError::new(format!("there are states of {got} bodies, the scene has {want}")));
    }
    let (mut x, mut v) = (world.start.clone(), world.velocity.clone());
    for (body, given) in world.bodies.iter().zip(bodies) {
        let (name, n) = (&body.mesh.name, body.mesh.n_verts());
        if body.carrier.is_some() {
            let text = format!("`{name}` is carried by a lattice, whose nodes its surface does not tell");
            return Err(SimulateError::new(text));
        }
        for (what, of) in [("positions", &given.positions), ("velocities", &given.velocities)] {
            if of.len() != n {
                let text = format!("`{name}` has {n} vertices, there are {} {what}", of.len());
                return Err(SimulateError::new(text));
            }
            if let Some(k) = of.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
                let text = format!("`{name}`: a number of vertex {k} (0-based) in its {what} is not finite");
                return Err(SimulateError::new(text));
            }
        }
        for (place, (p, u)) in body.number.iter().zip(given.positions.iter().zip(&given.velocities)) {
            for d in 0..3 {
                x[3 * *place as usize + d] = p[d] - world.center[d];
                v[3 * *place as usize + d] = u[d];
            }
        }
    }
    Ok(State { frame, x, v, before: None, known: Known::new(), stresses: Vec::new() })
}
