//! Wind on a sheet.

/// Each triangle adds share dt (-coupling A v_n |v_n| n) to the velocity of each of its corners, whatever their mass; A is
/// its area, n its normal, v_n = n . (its mean velocity - wind), after Wejchert and Haumann 1991. One triangle after the other, in
/// the order of the mesh, so that each feels what those before it have done: a step that added all at once would turn the
/// motion around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wind {
    /// m/s
    pub velocity: [f64; 3],
    /// 1/m^3
    pub coupling: f64,
    /// Of each corner.
    pub share: f64,
}

impl Wind {
    /// A step of velocities `v` of vertices at `x`.
    pub fn blow(&self, triangles: &[u32], x: &[f64], v: &mut [f64]) {
        for t in triangles.as_chunks::<3>().0 {
            let at = |of: &[f64], corner: usize| [0, 1, 2].map(|d| of[3 * t[corner] as usize + d]);
            let [a, b, c] = [0, 1, 2].map(|k| at(x, k));
            let (p, q) = ([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
            let n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
            let double = n.iter().map(|n| n * n).sum::<f64>().sqrt();
            if double == 0.0 {
                continue;
            }
            let [u0, u1, u2] = [0, 1, 2].map(|k| at(v, k));
            let along: f64 = (0..3).map(|d| n[d] / double * ((u0[d] + u1[d] + u2[d]) / 3.0 - self.velocity[d])).sum();
            let push = -self.share * super::DT * self.coupling * (0.5 * double) * along * along.abs();
            for corner in t {
                (0..3).for_each(|d| v[3 * *corner as usize + d] += push * n[d] / double);
            }
        }
    }
}
