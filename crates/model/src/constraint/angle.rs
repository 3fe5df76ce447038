//! Angles within a range.

use super::{Relation, Row, Set, V3, across, add, cross, dot, norm, scale};

/// low <= angle between the two rows <= high, in radians within [0, pi].
///
/// Outside, the nearest point turns both sides in their plane, by theta and phi with theta + phi = eta, what is
/// missing, and shortens them by cos theta and cos phi: |v1|^2 sin^2 theta + |v2|^2 sin^2 phi is least at
/// theta = atan2(|v2|^2 sin 2 eta, |v1|^2 + |v2|^2 cos 2 eta) / 2.
#[derive(Clone, Copy, Debug)]
pub struct AngleRange {
    low: f64,
    high: f64,
    within: (f64, f64), // cosines of angles that are in the range for certain
}

/// Cosines nearer to a bound than this are decided by the angle.
const CLOSE: f64 = 1e-9;

/// The angle between two vectors, exact for small ones and those near pi.
pub(crate) fn angle(a: V3, b: V3) -> f64 {
    norm(cross(a, b)).atan2(dot(a, b))
}

/// The unit vector in the plane of a and b that is normal to a, on the side of b; where they are parallel any one.
fn toward(a: V3, b: V3) -> V3 {
    let n = cross(a, b);
    // What is left of b without its part along a, without cancellation.
    let side = cross(n, a);
    let length = norm(side);
    let parallel = norm(n) <= f64::EPSILON * norm(a) * norm(b);
    if length > 0.0 && !parallel { scale(1.0 / length, side) } else { across(a) }
}

impl AngleRange {
    /// From `low` to `high`, radians.
    pub fn new(low: f64, high: f64) -> Self {
        AngleRange { low, high, within: (high.cos() + CLOSE, low.cos() - CLOSE) }
    }

    /// The least angle and the largest one.
    pub fn bounds(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// How much the sides have to be turned apart; below 0 together, 0 within the range and where a side has no length.
    fn missing(&self, a: V3, b: V3) -> f64 {
        let size = (dot(a, a) * dot(b, b)).sqrt();
        let cosine = dot(a, b);
        if cosine > self.within.0 * size && cosine < self.within.1 * size {
            return 0.0;
        }
        if !(norm(a) > 0.0 && norm(b) > 0.0) {
            return 0.0;
        }
        let angle = angle(a, b);
        if angle < self.low {
            self.low - angle
        } else if angle > self.high {
            self.high - angle
        } else {
            0.0
        }
    }
}

impl Set for AngleRange {
    fn project(&self, _: usize, v: &mut [V3]) {
        let [a, b] = v else { return };
        let missing = self.missing(*a, *b);
        if missing == 0.0 {
            return;
        }
        let (eta, (a2, b2)) = (missing.abs(), (dot(*a, *a), dot(*b, *b)));
        let theta = 0.5 * (b2 * (2.0 * eta).sin()).atan2(a2 + b2 * (2.0 * eta).cos());
        let theta = theta.clamp(0.0, eta);
        let phi = eta - theta;
        // In the plane of both; where they are parallel the two sides turn the same plane.
        let (to_b, on) = (toward(*a, *b), missing.signum());
        let axis = cross(*a, to_b);
        let from_a = scale(1.0 / (norm(axis) * norm(*b)), cross(axis, *b));
        let turned = |v: V3, normal: V3, by: f64| {
            let (sin, cos) = by.sin_cos();
            let length = norm(v) * cos.max(0.0);
            add(scale(cos.max(0.0) * cos, v), sin * length, normal)
        };
        (*a, *b) = (turned(*a, to_b, -on * theta), turned(*b, from_a, on * phi));
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        match v {
            [a, b] => {
                let missing = self.missing(*a, *b).abs();
                if missing.is_nan() { f64::INFINITY } else { missing }
            }
            _ => 0.0,
        }
    }

    fn linearize(&self, _: usize, v: &[V3], near: f64, row: &mut dyn FnMut(Row<'_>)) {
        let [a, b] = v else { return };
        let (la, lb) = (norm(*a), norm(*b));
        if !(la > 0.0 && lb > 0.0) {
            return;
        }
        let angle = angle(*a, *b);
        // The angle grows where a turns away from b, and b from a.
        let gradient = [scale(-1.0 / la, toward(*a, *b)), scale(-1.0 / lb, toward(*b, *a))];
        if angle - self.high > -near {
            row(Row { value: angle - self.high, relation: Relation::NotAbove, gradient: &gradient });
        }
        if self.low - angle > -near {
            let gradient = gradient.map(|g| scale(-1.0, g));
            row(Row { value: self.low - angle, relation: Relation::NotAbove, gradient: &gradient });
        }
    }
}
