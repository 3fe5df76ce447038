//! Quads that are parallelograms, or rectangles.

use super::{Relation, Row, Set, V3, across, add, largest, norm, scale, sub};

/// Four corners of a parallelogram, in their order around it: v_0 - v_1 + v_2 - v_3 = 0.
///
/// A linear space (Bouaziz et al. 2012, "parallelogram"): a quarter of that vector is taken from corners 0 and 2, and given
/// to 1 and 3. Its length, by which each corner is off, is the violation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parallelogram;

/// Four corners of a rectangle, in their order around it: a parallelogram with diagonals of the same length.
///
/// With the diagonals p = v_2 - v_0 and q = v_3 - v_1, and what a quad is off a parallelogram, corners are an orthogonal
/// sum; so the nearest rectangle has diagonals along p and q whose length is the mean of |p| and |q|. Where one diagonal
/// has no length it gets a direction across the other, all directions being as near. The violation is the farthest way of
/// a corner to that rectangle, a length.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rectangle;

/// (v_0 - v_1 + v_2 - v_3) / 4
fn off(v: &[V3; 4]) -> V3 {
    // Differences of neighbours first, which an origin far away does not touch.
    scale(0.25, add(sub(v[0], v[1]), 1.0, sub(v[2], v[3])))
}

/// The rows 2 n . off for the three axes, whose gradients have length 1.
fn parallel_rows(v: &[V3; 4], row: &mut dyn FnMut(Row<'_>)) {
    let off = off(v);
    for d in 0..3 {
        let axis = [0, 1, 2].map(|c| if c == d { 0.5 } else { 0.0 });
        let gradient = [axis, scale(-1.0, axis), axis, scale(-1.0, axis)];
        row(Row { value: 2.0 * off[d], relation: Relation::Zero, gradient: &gradient });
    }
}

/// A unit vector along a; of none the other one's, turned.
fn direction(a: V3, other: V3) -> V3 {
    let length = norm(a);
    if length > 0.0 { scale(1.0 / length, a) } else { across(other) }
}

impl Set for Parallelogram {
    fn project(&self, _: usize, v: &mut [V3]) {
        let Ok(v) = <&mut [V3; 4]>::try_from(v) else { return };
        let off = off(v);
        for (k, v) in v.iter_mut().enumerate() {
            *v = add(*v, if k % 2 == 0 { -1.0 } else { 1.0 }, off);
        }
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        <&[V3; 4]>::try_from(v).map_or(0.0, |v| largest([norm(off(v))].into_iter()))
    }

    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        if let Ok(v) = v.try_into() {
            parallel_rows(v, row);
        }
    }
}

impl Rectangle {
    /// By how much each corner is off: corners 0 to 3.
    fn ways(v: &[V3; 4]) -> [V3; 4] {
        let (off, p, q) = (off(v), sub(v[2], v[0]), sub(v[3], v[1]));
        // Half of half the difference of lengths, at each end of a diagonal.
        let longer = 0.25 * (norm(p) - norm(q));
        let (along_p, along_q) = (scale(longer, direction(p, q)), scale(longer, direction(q, p)));
        [sub(off, along_p), sub(along_q, off), add(off, 1.0, along_p), add(scale(-1.0, off), -1.0, along_q)]
    }
}

impl Set for Rectangle {
    fn project(&self, _: usize, v: &mut [V3]) {
        let Ok(v) = <&mut [V3; 4]>::try_from(v) else { return };
        let ways = Self::ways(v);
        v.iter_mut().zip(ways).for_each(|(v, way)| *v = sub(*v, way));
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        <&[V3; 4]>::try_from(v).map_or(0.0, |v| largest(Self::ways(v).into_iter().map(norm)))
    }

    /// Those of a parallelogram, and (|p| - |q|) / 2 = 0.
    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        let Ok(v) = <&[V3; 4]>::try_from(v) else { return };
        parallel_rows(v, row);
        let (p, q) = (sub(v[2], v[0]), sub(v[3], v[1]));
        let (along_p, along_q) = (scale(0.5, direction(p, q)), scale(0.5, direction(q, p)));
        let gradient = [scale(-1.0, along_p), along_q, along_p, scale(-1.0, along_q)];
        row(Row { value: 0.5 * (norm(p) - norm(q)), relation: Relation::Zero, gradient: &gradient });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::MeanCentred;
    use crate::constraint::laws;

    #[test]
    fn the_laws_hold() {
        // Any three corners and the fourth.
        laws::check::<MeanCentred, _>(
            4,
            |_| Parallelogram,
            |near, _| vec![near[0], near[1], near[2], add(sub(near[0], near[1]), 1.0, near[2])],
        );
        // A corner, a side, and another one across it.
        laws::check::<MeanCentred, _>(
            4,
            |_| Rectangle,
            |near, _| {
                let (a, b) = (sub(near[1], near[0]), sub(near[3], near[0]));
                let b = sub(b, scale(crate::constraint::dot(a, b) / crate::constraint::dot(a, a), a));
                vec![near[0], add(near[0], 1.0, a), add(add(near[0], 1.0, a), 1.0, b), add(near[0], 1.0, b)]
            },
        );
    }

    #[test]
    fn bad_corners_give_numbers() {
        for corners in laws::degenerate(4) {
            laws::finite(&Parallelogram, &corners);
            laws::finite(&Rectangle, &corners);
        }
    }

    #[test]
    fn a_quad_with_a_diagonal_of_no_length_gets_one() {
        let mut v = [[-1.0, 0.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0], [0.0; 3]];
        assert!((Rectangle.violation(0, &v) - 0.5).abs() < 1e-15);
        Rectangle.project(0, &mut v);
        assert!(Rectangle.violation(0, &v) < 1e-15 && (norm(sub(v[3], v[1])) - 1.0).abs() < 1e-15, "{v:?}");
    }
}
