//! Where a group's vertices go.

use std::collections::BTreeSet;

use super::Group;

type V3 = [f64; 3];

/// x -> R S (x - c) + c + t with a centre for each of the two.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    scale: Option<(V3, V3)>,       // factors, centre
    rotate: Option<([V3; 3], V3)>, // rows, centre
    translate: Option<V3>,
}

impl Motion {
    /// The motion of a group whose rest positions have this centroid.
    pub fn of(group: &Group, centroid: V3) -> Motion {
        Motion {
            scale: group.scale.map(|s| (s.factors, s.center.unwrap_or(centroid))),
            rotate: group.rotate.map(|r| (rotation(r.axis, r.angle), r.center.unwrap_or(centroid))),
            translate: group.translate,
        }
    }

    /// Where `x` goes.
    pub fn apply(&self, mut x: V3) -> V3 {
        if let Some((s, c)) = self.scale {
            x = [0, 1, 2].map(|i| c[i] + s[i] * (x[i] - c[i]));
        }
        if let Some((r, c)) = self.rotate {
            let d = [0, 1, 2].map(|i| x[i] - c[i]);
            x = [0, 1, 2].map(|i| c[i] + (r[i][0] * d[0] + r[i][1] * d[1] + r[i][2] * d[2]));
        }
        if let Some(t) = self.translate {
            x = [0, 1, 2].map(|i| x[i] + t[i]);
        }
        x
    }
}

/// The rows of the rotation around `axis` (any length but 0) by an angle in degrees (Rodrigues).
pub(super) fn rotation(axis: V3, degrees: f64) -> [V3; 3] {
    // Scaled first: an axis of 1e-200 has a direction too.
    let largest = axis.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let a = axis.map(|x| x / largest);
    let length = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = a.map(|x| x / length);
    // Quarter turns exactly, so that 90 and 180 degrees map axes to axes.
    let (s, c) = match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        d => d.to_radians().sin_cos(),
    };
    let k = 1.0 - c;
    [
        [c + k * x * x, k * x * y - s * z, k * x * z + s * y],
        [k * x * y + s * z, c + k * y * y, k * y * z - s * x],
        [k * x * z - s * y, k * y * z + s * x, c + k * z * z],
    ]
}

/// The mean of some of the points, kept accurate far from the origin.
pub(super) fn centroid(points: &[V3], members: &BTreeSet<u32>) -> V3 {
    let Some(&first) = members.first() else { return [0.0; 3] };
    let base = points[first as usize];
    let n = members.len() as f64;
    [0, 1, 2].map(|c| base[c] + members.iter().map(|&v| points[v as usize][c] - base[c]).sum::<f64>() / n)
}
