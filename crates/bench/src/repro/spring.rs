//! Chains of springs that have to turn.

use crate::data::Model;
use proxel::deform::DeformInput;
use proxel::mesh::Mesh;

/// A straight chain of `n` unit springs along x; its ends are turned by `angle` about its middle and pulled apart by
/// `stretch`, its inner nodes start where they are at rest. The solution is the straight line between the ends; it is
/// unique, since all springs are under tension.
pub fn chain(n: usize, angle: f64, stretch: f64) -> Model {
    let half = n as f64 / 2.0;
    let points: Vec<[f64; 3]> = (0..=n).map(|i| [i as f64 - half, 0.0, 0.0]).collect();
    let (sin, cos) = angle.sin_cos();
    let solution: Vec<[f64; 3]> = points.iter().map(|p| [stretch * cos * p[0], stretch * sin * p[0], 0.0]).collect();
    let mut start = points.clone();
    let mut fixed = Vec::new();
    for end in [0, n] {
        start[end] = solution[end];
        fixed.push((end as u32, solution[end]));
    }
    let edges = (0..n as u32).map(|i| [i, i + 1]).collect();
    let rest = Mesh { name: "chain".to_string(), points, edges, ..Mesh::default() };
    let input = DeformInput { rest, start: Some(start), fixed, reference: Some(solution), ..DeformInput::default() };
    Model { name: format!("chain of {n}; {:.0} degrees", angle.to_degrees()), input, read: 0.0 }
}
