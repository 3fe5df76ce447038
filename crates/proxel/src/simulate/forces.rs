//! Explicit forces: accelerations of nodes at the start of a step.

use super::scene::{ForceSpec, WindLaw, WindSpec};
use super::world::World;
use crate::deform::elements::Cells;

type V3 = [f64; 3];

/// Acceleration of each free node by gravity and wind, for nodes at `x` with velocities `v` and steps of `tau` seconds.
pub(super) fn accelerations(world: &World, forces: &ForceSpec, x: &[f64], v: &[f64], tau: f64) -> Vec<V3> {
    let mut out = vec![forces.gravity; world.n_free];
    let Some(wind) = &forces.wind else { return out };
    for body in &world.bodies {
        // Lattices carry their surface, which has no mass of its own.
        for cells in body.cells.iter().filter(|_| body.carrier.is_none()) {
            let Cells::Triangles(triangles) = cells else { continue };
            for t in triangles {
                let nodes = t.map(|v| body.number[v as usize] as usize);
                let (push, n) = blow(world, wind, nodes, x, v, tau);
                for node in nodes.into_iter().filter(|node| *node < world.n_free) {
                    let share = match wind.law {
                        WindLaw::Force => push / (3.0 * world.mass[node]),
                        WindLaw::Acceleration => push,
                    };
                    (0..3).for_each(|d| out[node][d] += share * n[d]);
                }
            }
        }
    }
    out
}

/// The push of wind along the unit normal of a triangle: -c A v_n |v_n|. As a force it is damped as an implicit step of the
/// triangle alone would be, so that it never turns v_n around.
fn blow(world: &World, wind: &WindSpec, nodes: [usize; 3], x: &[f64], v: &[f64], tau: f64) -> (f64, V3) {
    let at = |of: &[f64], i: usize| -> V3 { [0, 1, 2].map(|d| of[3 * nodes[i] + d]) };
    let [a, b, c] = [0, 1, 2].map(|i| at(x, i));
    let (u, w) = ([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
    let n = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
    let double = n.iter().map(|n| n * n).sum::<f64>().sqrt();
    if double == 0.0 {
        return (0.0, n);
    }
    let n = n.map(|n| n / double);
    let mean: V3 = [0, 1, 2].map(|d| (at(v, 0)[d] + at(v, 1)[d] + at(v, 2)[d]) / 3.0);
    let vn: f64 = (0..3).map(|d| n[d] * (mean[d] - wind.velocity[d])).sum();
    let push = -wind.drag * (double / 2.0) * vn * vn.abs();
    if wind.law == WindLaw::Acceleration {
        return (push, n);
    }
    let mass: f64 = nodes.iter().map(|i| world.mass[*i]).sum();
    (push / (1.0 + tau * wind.drag * (double / 2.0) * vn.abs() / mass), n)
}
