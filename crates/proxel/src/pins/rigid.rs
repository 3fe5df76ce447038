//! Motions that keep shapes.

use super::motion::rotation;

type V3 = [f64; 3];

/// How far R^T R may be from the identity, and det R from 1, for a matrix to count as a rotation: as written with six digits.
const RIGID: f64 = 1e-5;

/// x -> R x + t with a rotation R.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMotion {
    rotation: [V3; 3], // rows
    translation: V3,
}

impl Default for RigidMotion {
    fn default() -> Self {
        RigidMotion::identity()
    }
}

impl RigidMotion {
    /// Nothing moves.
    pub fn identity() -> Self {
        Self::translation([0.0; 3])
    }

    /// x -> x + t.
    pub fn translation(t: V3) -> Self {
        RigidMotion { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: t }
    }

    /// A turn around an axis (of any length but 0) through `center` by an angle in degrees, by the right-hand rule.
    pub fn rotation(axis: V3, degrees: f64, center: V3) -> Self {
        RigidMotion { rotation: rotation(axis, degrees), translation: [0.0; 3] }.around(center)
    }

    /// From the rows of R and t. `None` where R is no rotation to five digits; what is within that is made one.
    pub fn from_rows(rows: [V3; 3], translation: V3) -> Option<Self> {
        let dot = |a: V3, b: V3| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
        let [a, b, c] = rows;
        let normal = cross(a, b);
        let off =
            [dot(a, a) - 1.0, dot(b, b) - 1.0, dot(c, c) - 1.0, dot(a, b), dot(b, c), dot(c, a), dot(normal, c) - 1.0];
        let rigid = off.iter().all(|v| v.abs() <= RIGID) && translation.iter().all(|v| v.is_finite());
        rigid.then(|| RigidMotion { rotation: to_rows(to_quaternion(rows)), translation })
    }

    /// x -> R (x - center) + center + t.
    #[must_use]
    pub fn around(self, center: V3) -> Self {
        let turned = RigidMotion { translation: [0.0; 3], ..self }.apply(center);
        RigidMotion { translation: [0, 1, 2].map(|i| self.translation[i] + center[i] - turned[i]), ..self }
    }

    /// This motion, then the other.
    #[must_use]
    pub fn then(self, other: RigidMotion) -> Self {
        let (a, b) = (other.rotation, self.rotation);
        let rotation = [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()));
        RigidMotion { rotation, translation: other.apply(self.translation) }
    }

    /// Where x goes.
    pub fn apply(&self, x: V3) -> V3 {
        let (r, t) = (&self.rotation, &self.translation);
        [0, 1, 2].map(|i| r[i][0] * x[0] + r[i][1] * x[1] + r[i][2] * x[2] + t[i])
    }

    /// The part s of the way from this motion to the other: rotations along the shortest arc (slerp, Shoemake 1985), the
    /// image of `center` along a straight line.
    #[must_use]
    pub fn interpolate(&self, other: &RigidMotion, s: f64, center: V3) -> Self {
        let (a, b) = (self.apply(center), other.apply(center));
        let q = slerp(to_quaternion(self.rotation), to_quaternion(other.rotation), s);
        let turned = RigidMotion { rotation: to_rows(q), translation: [0.0; 3] };
        let to = turned.apply(center);
        RigidMotion { translation: [0, 1, 2].map(|i| (1.0 - s) * a[i] + s * b[i] - to[i]), ..turned }
    }
}

fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// (w, x, y, z) of a rotation, from the largest of the four (Shepperd 1978), of length 1.
fn to_quaternion(r: [V3; 3]) -> [f64; 4] {
    let trace = r[0][0] + r[1][1] + r[2][2];
    let squares = [trace, r[0][0], r[1][1], r[2][2]];
    let mut largest = 0;
    for k in 1..4 {
        if squares[k] > squares[largest] {
            largest = k;
        }
    }
    let off = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
    let mut q = [0.0; 4];
    if largest == 0 {
        q = [1.0 + trace, off[0], off[1], off[2]];
    } else {
        let (i, j, k) = (largest - 1, largest % 3, (largest + 1) % 3);
        q[0] = off[i];
        q[1 + i] = 1.0 + r[i][i] - r[j][j] - r[k][k];
        q[1 + j] = r[j][i] + r[i][j];
        q[1 + k] = r[k][i] + r[i][k];
    }
    unit(q)
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / length)
}

fn to_rows([w, x, y, z]: [f64; 4]) -> [V3; 3] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// From a to b on the unit sphere, the shorter way around; q and -q are the same rotation.
fn slerp(a: [f64; 4], b: [f64; 4], s: f64) -> [f64; 4] {
    let cos: f64 = (0..4).map(|i| a[i] * b[i]).sum();
    let b = if cos < 0.0 { b.map(|v| -v) } else { b };
    // The angle between unit vectors from their difference and sum, which is exact for small angles.
    let length = |sign: f64| (0..4).map(|i| (b[i] + sign * a[i]).powi(2)).sum::<f64>().sqrt();
    let angle = 2.0 * length(-1.0).atan2(length(1.0));
    let sin = angle.sin();
    if sin < 1e-9 {
        return unit([0, 1, 2, 3].map(|i| (1.0 - s) * a[i] + s * b[i]));
    }
    let (u, v) = (((1.0 - s) * angle).sin() / sin, (s * angle).sin() / sin);
    unit([0, 1, 2, 3].map(|i| u * a[i] + v * b[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: V3, b: V3) -> bool {
        (0..3).all(|i| (a[i] - b[i]).abs() < 1e-14)
    }

    #[test]
    fn halfway_is_half_the_turn_about_the_same_axis() {
        let (axis, center, x) = ([1.0, -2.0, 0.5], [0.3, 0.1, -0.7], [1.0, 2.0, 3.0]);
        for angle in [1e-7, 10.0, 90.0, 179.0, -120.0] {
            let turn = RigidMotion::rotation(axis, angle, center);
            for s in [0.0, 0.25, 0.5, 1.0] {
                let part = RigidMotion::identity().interpolate(&turn, s, center);
                let want = RigidMotion::rotation(axis, s * angle, center);
                assert!(close(part.apply(x), want.apply(x)), "{angle} {s}");
                assert!(close(part.apply(center), center));
            }
        }
    }

    #[test]
    fn matrices_that_are_no_rotations_are_refused_and_rounded_ones_mended() {
        let turn = RigidMotion::rotation([0.2, 1.0, 0.4], 75.0, [0.0; 3]);
        let rounded = turn.rotation.map(|r| r.map(|v| (v * 1e6).round() / 1e6));
        let mended = RigidMotion::from_rows(rounded, [1.0, 0.0, 0.0]).expect("a rotation to six digits");
        let p = mended.apply([3.0, 4.0, 12.0]);
        assert!((((p[0] - 1.0).powi(2) + p[1].powi(2) + p[2].powi(2)).sqrt() - 13.0).abs() < 1e-13);
        let mirror = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let scaled = turn.rotation.map(|r| r.map(|v| 1.01 * v));
        for rows in [mirror, scaled, [[f64::NAN; 3]; 3]] {
            assert!(RigidMotion::from_rows(rows, [0.0; 3]).is_none(), "{rows:?}");
        }
    }

    #[test]
    fn one_motion_and_then_another() {
        let a = RigidMotion::rotation([0.0, 0.0, 1.0], 90.0, [1.0, 0.0, 0.0]);
        let b = RigidMotion::translation([0.0, 5.0, 0.0]);
        assert!(close(a.then(b).apply([2.0, 0.0, 0.0]), [1.0, 6.0, 0.0]));
        assert!(close(b.then(a).apply([2.0, 0.0, 0.0]), [-4.0, 1.0, 0.0]));
    }
}
