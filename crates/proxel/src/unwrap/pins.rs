//! What holds a map: vertices at places, weights of faces.

use super::{UnwrapError, UnwrapInput};
use proxel_mesh::Mesh;
use proxel_mesh::charts::{Chart, Charts};

/// One positive number for each face.
pub(super) fn check_weights(mesh: &Mesh, weights: &[f64]) -> Result<(), UnwrapError> {
    if weights.len() != mesh.faces.len() {
        return Err(UnwrapError(format!(
            "{}: {} weights for {} faces; give one for each",
            mesh.name,
            weights.len(),
            mesh.faces.len()
        )));
    }
    match weights.iter().position(|w| !(*w > 0.0 && w.is_finite())) {
        Some(face) => Err(UnwrapError(format!(
            "{}: the weight of face {face} (0-based) is {}; it must be a positive number",
            mesh.name, weights[face]
        ))),
        None => Ok(()),
    }
}

/// Which charts hold a pinned vertex.
pub(super) fn pinned(input: &UnwrapInput, charts: &Charts) -> Vec<bool> {
    let mut is_pinned = vec![false; if input.pins.is_empty() { 0 } else { input.mesh.n_verts() }];
    for (v, _) in &input.pins {
        if let Some(p) = is_pinned.get_mut(*v as usize) {
            *p = true;
        }
    }
    let holds = |chart: &Chart| chart.vertices.iter().any(|&v| is_pinned.get(v as usize) == Some(&true));
    charts.charts.iter().map(holds).collect()
}

/// The similarity p -> m p + offset, m = [[a, -b], [b, a]], that brings points nearest to their targets (least squares);
/// none where points do not tell a size.
pub(super) fn similarity(points: &[[f64; 2]], targets: &[[f64; 2]]) -> Option<([f64; 2], [f64; 2])> {
    let n = points.len().max(1) as f64;
    let mean = |of: &[[f64; 2]]| [0, 1].map(|d| of.iter().map(|p| p[d]).sum::<f64>() / n);
    let (p0, t0) = (mean(points), mean(targets));
    let (mut dot, mut cross, mut size) = (0.0, 0.0, 0.0);
    for (p, t) in points.iter().zip(targets) {
        let (p, t) = ([p[0] - p0[0], p[1] - p0[1]], [t[0] - t0[0], t[1] - t0[1]]);
        dot += p[0] * t[0] + p[1] * t[1];
        cross += p[0] * t[1] - p[1] * t[0];
        size += p[0] * p[0] + p[1] * p[1];
    }
    let m = if size > 0.0 { [dot / size, cross / size] } else { [0.0, 0.0] };
    let sound = m[0].hypot(m[1]) > 0.0;
    let m = if sound { m } else { [1.0, 0.0] };
    let offset = [t0[0] - m[0] * p0[0] + m[1] * p0[1], t0[1] - m[1] * p0[0] - m[0] * p0[1]];
    offset.iter().all(|v| v.is_finite()).then_some((m, offset))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_similarity_is_found_again() {
        let points = [[0.0, 0.0], [1.0, 0.5], [-2.0, 3.0]];
        let (a, b) = (0.6, -1.7);
        let targets = points.map(|p| [a * p[0] - b * p[1] + 3.0, b * p[0] + a * p[1] - 4.0]);
        let (m, offset) = similarity(&points, &targets).unwrap();
        for (found, is) in m.iter().chain(&offset).zip([a, b, 3.0, -4.0]) {
            assert!((found - is).abs() < 1e-14, "{found} {is}");
        }
        // One point is moved only.
        assert_eq!(similarity(&points[..1], &targets[..1]), Some(([1.0, 0.0], targets[0])));
    }
}
