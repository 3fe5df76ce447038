//! Vectors in space.

pub(super) type V3 = [f64; 3];

pub(super) fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scale(s: f64, a: V3) -> V3 {
    a.map(|x| s * x)
}

pub(super) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The direction of `a`; of a vector without one, `otherwise`.
pub(super) fn direction(a: V3, otherwise: V3) -> V3 {
    // Scaled first, so that the squares neither vanish nor overflow.
    let largest = a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return otherwise;
    }
    let a = a.map(|x| x / largest);
    scale(1.0 / dot(a, a).sqrt(), a)
}
