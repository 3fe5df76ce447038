//! A plane that stays where it is: vertices on it or on one side, and pairs that mirror each other.

use super::{Relation, Row, Set, V3, add, dot, largest, norm, scale, sub};

/// The points x of a plane, n . (x - p) = 0, or of the half-space that its normal points into, n . (x - p) >= 0.
///
/// The nearest point is x less its distance along n. The violation is that distance, a length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    point: V3,
    normal: V3, // of length 1
    one_side: bool,
}

/// A plane without a point or a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneError;

impl std::fmt::Display for PlaneError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a plane needs a point and a normal of finite numbers, the normal not zero")
    }
}

impl std::error::Error for PlaneError {}

impl Plane {
    /// Through a point, across a normal of any length.
    ///
    /// # Errors
    /// A normal of no direction, numbers that are not finite.
    pub fn new(point: V3, normal: V3) -> Result<Self, PlaneError> {
        // Scaled, so that squares neither vanish nor overflow.
        let size = normal.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        let unit = normal.map(|c| c / size);
        let unit = scale(1.0 / norm(unit), unit);
        let finite = point.iter().chain(&unit).all(|c| c.is_finite());
        if finite { Ok(Plane { point, normal: unit, one_side: false }) } else { Err(PlaneError) }
    }

    /// All that is on the plane, or where its normal points to.
    pub fn one_side(self) -> Self {
        Plane { one_side: true, ..self }
    }

    /// n . (x - p)
    pub fn height(&self, x: V3) -> f64 {
        dot(self.normal, sub(x, self.point))
    }

    /// Its unit normal.
    pub fn normal(&self) -> V3 {
        self.normal
    }

    /// x on the other side, as far away.
    pub fn mirror(&self, x: V3) -> V3 {
        add(x, -2.0 * self.height(x), self.normal)
    }

    /// v without its part along the normal, twice: what a mirror makes of a direction.
    fn mirror_direction(&self, v: V3) -> V3 {
        add(v, -2.0 * dot(self.normal, v), self.normal)
    }

    fn off(&self, x: V3) -> f64 {
        let height = self.height(x);
        if self.one_side && height >= 0.0 { 0.0 } else { height }
    }
}

impl Set for Plane {
    fn project(&self, _: usize, v: &mut [V3]) {
        v.iter_mut().for_each(|v| *v = add(*v, -self.off(*v), self.normal));
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        largest(v.iter().map(|v| self.off(*v).abs()))
    }

    fn linearize(&self, _: usize, v: &[V3], near: f64, row: &mut dyn FnMut(Row<'_>)) {
        let Some(v) = v.first() else { return };
        let height = self.height(*v);
        if !self.one_side {
            row(Row { value: height, relation: Relation::Zero, gradient: &[self.normal] });
        } else if -height > -near {
            let gradient = [scale(-1.0, self.normal)];
            row(Row { value: -height, relation: Relation::NotAbove, gradient: &gradient });
        }
    }
}

/// Pairs (a, b) of vertices that mirror each other in a plane: b = M a.
///
/// A linear space: each is moved by half of what is missing, a <- (a + M b)/2, b <- (b + M a)/2. By how much each is off,
/// |b - M a| / 2, is the violation, a length. A vertex that is its own mirror image lies on the [`Plane`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetric(pub Plane);

impl Set for Symmetric {
    fn project(&self, _: usize, v: &mut [V3]) {
        if let [a, b] = v {
            let missing = scale(0.5, sub(self.0.mirror(*b), *a));
            (*a, *b) = (add(*a, 1.0, missing), add(*b, -1.0, self.0.mirror_direction(missing)));
        }
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        match v {
            [a, b] => largest([0.5 * norm(sub(self.0.mirror(*b), *a))].into_iter()),
            _ => 0.0,
        }
    }

    /// (a - M b)/sqrt 2 = 0 in the three coordinates.
    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        let [a, b] = v else { return };
        let (off, size) = (sub(*a, self.0.mirror(*b)), std::f64::consts::FRAC_1_SQRT_2);
        for d in 0..3 {
            let axis = [0, 1, 2].map(|c| if c == d { size } else { 0.0 });
            let gradient = [axis, scale(-1.0, self.0.mirror_direction(axis))];
            row(Row { value: size * off[d], relation: Relation::Zero, gradient: &gradient });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::laws::{self, Motion};
    use crate::constraint::{Vertex, Vertices};

    fn moved(motion: &Motion) -> Plane {
        let (point, normal) = ([0.3, -0.2, 0.5], [1.0, 2.0, -0.5]);
        Plane::new(motion.point(point), motion.direction(normal)).unwrap()
    }

    #[test]
    fn the_laws_hold() {
        let n = Plane::new([0.0; 3], [1.0, 2.0, -0.5]).unwrap().normal;
        let (p, onto) = ([0.3, -0.2, 0.5], |x: V3, h: f64| add(x, h - dot(n, sub(x, [0.3, -0.2, 0.5])), n));
        laws::check::<Vertex, _>(1, moved, |near, _| vec![onto(near[0], 0.0)]);
        laws::check::<Vertex, _>(
            1,
            |m| moved(m).one_side(),
            |near, _| {
                let height = dot(n, sub(near[0], p));
                vec![onto(near[0], height.max(0.0))]
            },
        );
        laws::check::<Vertices, _>(
            2,
            |m| Symmetric(moved(m)),
            |near, _| {
                let height = dot(n, sub(near[0], p));
                vec![near[0], onto(near[0], -height)]
            },
        );
    }

    #[test]
    fn planes_without_a_direction_are_refused() {
        for normal in [[0.0; 3], [f64::NAN, 1.0, 0.0], [f64::INFINITY, 0.0, 0.0]] {
            assert_eq!(Plane::new([0.0; 3], normal), Err(PlaneError));
        }
        assert_eq!(Plane::new([f64::NAN; 3], [0.0, 0.0, 1.0]), Err(PlaneError));
        assert_eq!(Plane::new([0.0; 3], [0.0, 1e-300, 0.0]).unwrap().normal(), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn rows_of_a_half_space_near_its_border_only() {
        let half = Plane::new([0.0; 3], [0.0, 0.0, 2.0]).unwrap().one_side();
        let rows = |z: f64| {
            let mut out = Vec::new();
            half.linearize(0, &[[1.0, 2.0, z]], 0.5, &mut |row| out.push((row.value, row.relation, row.gradient[0])));
            out
        };
        assert_eq!(rows(-1.0), [(1.0, Relation::NotAbove, [0.0, 0.0, -1.0])]);
        assert_eq!(rows(0.25), [(-0.25, Relation::NotAbove, [0.0, 0.0, -1.0])]);
        assert!(rows(0.75).is_empty());
    }
}
