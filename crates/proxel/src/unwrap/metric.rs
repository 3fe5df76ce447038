//! Target metrics: how long a face's edges are to be in the map.

use super::{UnwrapError, UnwrapInput};
use proxel_mesh::Mesh;

/// A symmetric positive definite M, as xx, xy, xz, yy, yz, zz: an edge e of the surface is to have the length sqrt(e^T M e) in
/// the map. s^2 I asks for s times the length in all directions; I + (s^2 - 1) d d^T for that along the unit vector d only.
pub type Metric = [f64; 6];

/// The metric that asks for `factor` times the length in all directions.
pub fn uniform(factor: f64) -> Metric {
    let m = factor * factor;
    [m, 0.0, 0.0, m, 0.0, m]
}

/// L^T of M = L L^T, which takes an edge to one whose plain length is the one that M asks for; by rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch([[f64; 3]; 3]);

impl Stretch {
    /// None where M is not positive definite.
    fn of([xx, xy, xz, yy, yz, zz]: Metric) -> Option<Self> {
        let root = |v: f64| (v > 0.0 && v.is_finite()).then(|| v.sqrt());
        let a = root(xx)?;
        let (b, c) = (xy / a, xz / a);
        let d = root(yy - b * b)?;
        let e = (yz - b * c) / d;
        let f = root(zz - c * c - e * e)?;
        let rows = [[a, b, c], [0.0, d, e], [0.0, 0.0, f]];
        rows.iter().flatten().all(|v| v.is_finite()).then_some(Stretch(rows))
    }

    pub fn apply(&self, e: [f64; 3]) -> [f64; 3] {
        self.0.map(|row| row[0] * e[0] + row[1] * e[1] + row[2] * e[2])
    }

    /// By L: derivatives in the image become those in the edge.
    pub fn apply_transposed(&self, g: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|d| self.0[0][d] * g[0] + self.0[1][d] * g[1] + self.0[2][d] * g[2])
    }
}

/// One positive definite tensor for each face.
pub(super) fn check(mesh: &Mesh, metric: &[Metric]) -> Result<(), UnwrapError> {
    if metric.len() != mesh.faces.len() {
        return Err(UnwrapError(format!(
            "{}: {} target metrics for {} faces; give one for each",
            mesh.name,
            metric.len(),
            mesh.faces.len()
        )));
    }
    match metric.iter().position(|m| Stretch::of(*m).is_none()) {
        Some(face) => Err(UnwrapError(format!(
            "{}: the target metric of face {face} (0-based) is {:?}; it must be positive definite: six numbers \
             xx xy xz yy yz zz",
            mesh.name, metric[face]
        ))),
        None => Ok(()),
    }
}

/// What the metrics of the input do to the triangles of these faces.
pub(super) fn of_faces(input: &UnwrapInput, faces: &[u32]) -> Option<Vec<Stretch>> {
    // Checked before: every metric has a factor.
    input.metric.as_ref().and_then(|metric| faces.iter().map(|f| Stretch::of(*metric.get(*f as usize)?)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_get_the_length_that_the_metric_asks_for() {
        let m: Metric = [2.0, 0.5, -0.3, 1.5, 0.2, 3.0];
        let e = [0.7, -1.1, 0.4];
        let form = m[0] * e[0] * e[0]
            + 2.0 * (m[1] * e[0] * e[1] + m[2] * e[0] * e[2] + m[4] * e[1] * e[2])
            + m[3] * e[1] * e[1]
            + m[5] * e[2] * e[2];
        let image = Stretch::of(m).unwrap().apply(e);
        let length = image.iter().map(|v| v * v).sum::<f64>();
        assert!((length - form).abs() < 1e-14 * form, "{length} {form}");
        assert_eq!(Stretch::of(uniform(3.0)).unwrap().apply(e), e.map(|v| 3.0 * v));
    }

    #[test]
    fn what_is_not_positive_definite_is_no_metric() {
        for m in [
            [0.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            [1.0, 1.0, 0.0, 1.0, 0.0, 1.0],
            [1.0, 0.0, 1.1, 1.0, 0.0, 1.0],
            [f64::NAN, 0.0, 0.0, 1.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 1.0, f64::INFINITY, 1.0],
        ] {
            assert!(Stretch::of(m).is_none(), "{m:?}");
        }
    }
}
