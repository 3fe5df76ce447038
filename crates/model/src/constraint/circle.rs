//! Polygons whose corners lie on a circle.

use super::complement::complement;
use super::{BestPlane, Relation, Row, Set, V3, across, add, cross, dot, largest, norm, scale};

/// Corners on a common circle, any number of them: the faces of circular meshes, which have offsets of vertices at a constant
/// distance (Liu et al. 2006). A line counts as the circle of no curvature, which is what circles of growing size tend to.
///
/// The nearest corners are those on the circle that minimises the sum of squared distances ([`BestCircle`]), each at its
/// nearest point of it. The violation is the largest distance from that circle, a length.
#[derive(Clone, Copy, Debug, Default)]
pub struct Circle;

/// The circle that fits mean-centred points best, by the sum of squared distances in space.
///
/// With a point q of it, the unit vector e from there to its middle, its curvature k and the unit normal n of its plane, the
/// signed distance in the plane of a point p is
///
/// ```text
/// s(p) = 2 P / (1 + sqrt(1 + 2 k P)),   P = k/2 |p - q|^2 - e . (p - q)
/// ```
///
/// (after Chernov and Lesort 2005, *Least squares fitting of circles*, who keep the curvature for the same reason: lines are
/// nothing special). The sum of s^2 and of the squared heights over the plane, which passes through the mean, is minimised by
/// Levenberg and Marquardt's method over five numbers: two tilts, the ways of q along e, of e, and of k. It starts at the
/// best plane and the algebraic circle in it (Kasa 1976), and, where points are far from flat, at the two other principal
/// planes too. Near a circle it converges within three or four steps to rounding; for points far from every circle the sum
/// is exact to about 1e-12 of its value, at a local minimum which is the least of those found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BestCircle {
    /// The unit normal of its plane.
    pub normal: V3,
    /// One of its points.
    pub point: V3,
    /// The unit vector from there to its middle, which is point + inward / curvature.
    pub inward: V3,
    /// 1 / radius, not below 0; 0 for a line.
    pub curvature: f64,
}

/// Steps of a fit, at most.
const STEPS: usize = 100;
/// A step this small, over the size of points and in radians, is the last.
const SMALL: f64 = 1e-14;
/// The part of the extent along the second axis that points may be off their plane before others are tried: well beyond what
/// faces of meshes are.
const FLAT: f64 = 0.2;

/// What a point of the plane is to a circle: its signed distance, the direction in which that grows, and its derivatives by
/// the ways of q and e and by the curvature.
struct Distance {
    signed: f64,
    outward: V3,
    by: [f64; 3],
}

impl BestCircle {
    /// Of mean-centred points; of less than three one through them.
    pub fn of(v: &[V3]) -> Self {
        // Scaled, so that powers neither vanish nor overflow.
        let size = v.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        if !(size > 0.0 && size.is_finite()) {
            return BestCircle { normal: [0.0, 0.0, 1.0], point: [0.0; 3], inward: [1.0, 0.0, 0.0], curvature: 0.0 };
        }
        let inverse = 1.0 / size;
        let plane = BestPlane::of(v);
        let extent = |axis: V3| v.iter().map(|v| (dot(axis, *v) * inverse).powi(2)).sum::<f64>().sqrt();
        let mut best = Self::start(v, inverse, plane.normal, plane.along).fitted(v, inverse);
        if extent(plane.normal) > FLAT * extent(plane.along[1]) {
            for (normal, along) in
                [(plane.along[1], [plane.along[0], plane.normal]), (plane.along[0], [plane.along[1], plane.normal])]
            {
                let other = Self::start(v, inverse, normal, along).fitted(v, inverse);
                if other.1 < best.1 {
                    best = other;
                }
            }
        }
        let circle = best.0;
        BestCircle { point: scale(size, circle.point), curvature: circle.curvature * inverse, ..circle }
    }

    /// Kasa's circle in a plane: its middle m solves 2 sum p p^T m = sum |p|^2 p, its squared radius is the mean of
    /// |p - m|^2. Where points have no extent across their longest axis it is that axis.
    fn start(v: &[V3], inverse: f64, normal: V3, along: [V3; 2]) -> Self {
        let line = BestCircle { normal, point: [0.0; 3], inward: along[1], curvature: 0.0 };
        let (mut xx, mut xy, mut yy, mut rx, mut ry) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for v in v {
            let [x, y] = along.map(|a| dot(a, *v) * inverse);
            let squared = x * x + y * y;
            (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
            (rx, ry) = (rx + squared * x, ry + squared * y);
        }
        let (k, det) = (v.len().max(1) as f64, xx * yy - xy * xy);
        let middle = [0.5 * (yy * rx - xy * ry) / det, 0.5 * (xx * ry - xy * rx) / det];
        let radius = ((xx + yy) / k + middle[0].powi(2) + middle[1].powi(2)).sqrt();
        // A radius of more than the inverse of the precision is none.
        if !(radius < 1.0 / f64::EPSILON) {
            return line;
        }
        let middle = add(scale(middle[0], along[0]), middle[1], along[1]);
        let away = norm(middle);
        // The point next to the mean; of a middle there any.
        let inward = if away > f64::EPSILON * radius { scale(1.0 / away, middle) } else { along[0] };
        BestCircle { normal, point: add(middle, -radius, inward), inward, curvature: 1.0 / radius }
    }

    /// What p, a point in its plane, is to it.
    fn distance(&self, p: V3) -> Distance {
        let way = add(p, -1.0, self.point);
        let squared = dot(way, way);
        let power = 0.5 * self.curvature * squared - dot(self.inward, way);
        // 1 + 2 k P = (k rho)^2, rho being the distance from the middle.
        let root = (1.0 + 2.0 * self.curvature * power).max(0.0).sqrt();
        let signed = 2.0 * power / (1.0 + root);
        let out = add(scale(self.curvature, way), -1.0, self.inward);
        let length = norm(out);
        // At the middle all directions are outward: the one to q is taken.
        let outward = if length > 0.0 { scale(1.0 / length, out) } else { scale(-1.0, self.inward) };
        let side = cross(self.normal, self.inward);
        let by = if root > 0.0 {
            // s (1 + k s / 2) = P: (1 + k s) ds = dP - s^2/2 dk.
            let along =
                [1.0 - self.curvature * dot(self.inward, way), -dot(side, way), 0.5 * (squared - signed * signed)];
            along.map(|by| by / root)
        } else {
            [0.0; 3]
        };
        Distance { signed, outward, by }
    }

    /// The sum of squared distances of scaled points.
    fn sum(&self, v: &[V3], inverse: f64) -> f64 {
        let of = |v: &V3| {
            let v = scale(inverse, *v);
            let height = dot(self.normal, v);
            height * height + self.distance(add(v, -height, self.normal)).signed.powi(2)
        };
        v.iter().map(of).sum()
    }

    /// J^T J and J^T r of all distances, by tilts about `inward` and about the axis across it, and by the ways of q, e and k.
    fn normal_equations(&self, v: &[V3], inverse: f64) -> ([[f64; 5]; 5], [f64; 5]) {
        let side = cross(self.normal, self.inward);
        let (mut matrix, mut right) = ([[0.0; 5]; 5], [0.0; 5]);
        for v in v {
            let v = scale(inverse, *v);
            let height = dot(self.normal, v);
            let at = self.distance(add(v, -height, self.normal));
            let [x, y] = [dot(self.inward, v), dot(side, v)];
            // The plane tilts up by a along inward and by b along side: n + a inward + b side, and points of it go down.
            let heights = [x, y, 0.0, 0.0, 0.0];
            let [d, a, k] = at.by;
            let (u, w) = (dot(self.inward, at.outward), dot(side, at.outward));
            let signed = [-height * u, -height * w, d, a, k];
            for (row, r) in [(heights, height), (signed, at.signed)] {
                for i in 0..5 {
                    right[i] += row[i] * r;
                    for j in 0..5 {
                        matrix[i][j] += row[i] * row[j];
                    }
                }
            }
        }
        (matrix, right)
    }

    /// After a step of all five.
    fn moved(&self, d: [f64; 5]) -> Self {
        let side = cross(self.normal, self.inward);
        let tilted = add(add(self.normal, d[0], self.inward), d[1], side);
        let normal = scale(1.0 / norm(tilted), tilted);
        // Along the way back: q + d e, less its height, and e turned in the plane and laid into the new one.
        let flat = |v: V3| add(v, -dot(normal, v), normal);
        let point = {
            let q = add(self.point, d[2], self.inward);
            // q keeps its place in the plane, which tilts about the mean.
            let lifted = add(q, -(d[0] * dot(self.inward, q) + d[1] * dot(side, q)), self.normal);
            flat(lifted)
        };
        let (sin, cos) = d[3].sin_cos();
        let inward = flat(add(scale(cos, self.inward), sin, side));
        let length = norm(inward);
        let inward = if length > 0.0 { scale(1.0 / length, inward) } else { across(normal) };
        let curvature = self.curvature + d[4];
        if curvature < 0.0 {
            return BestCircle { normal, point, inward: scale(-1.0, inward), curvature: -curvature };
        }
        BestCircle { normal, point, inward, curvature }
    }

    /// The best one from here, and the sum.
    fn fitted(self, v: &[V3], inverse: f64) -> (Self, f64) {
        let (mut circle, mut sum, mut damping, mut last) = (self, self.sum(v, inverse), 0.0, f64::INFINITY);
        for _ in 0..STEPS {
            let (matrix, right) = circle.normal_equations(v, inverse);
            let diagonal = [0, 1, 2, 3, 4].map(|i| matrix[i][i]);
            let most = diagonal.iter().fold(0.0_f64, |m, d| m.max(*d));
            let mut damped = matrix;
            for i in 0..5 {
                // Directions that points do not see stay; (damping) as Marquardt has it.
                damped[i][i] += damping * diagonal[i] + f64::EPSILON * most;
            }
            let Some(step) = solve(damped, right) else { break };
            let next = circle.moved(step.map(|s| -s));
            let there = next.sum(v, inverse);
            let size = step.iter().fold(0.0_f64, |m, s| m.max(s.abs()));
            // Next to the minimum the sum is flat to rounding, while steps still shrink.
            let flat = there <= sum * (1.0 + 8.0 * f64::EPSILON) && size < 0.9 * last;
            if there < sum || flat {
                (circle, sum, last) = (next, there, size);
                damping = if damping > 1e-6 { 0.1 * damping } else { 0.0 };
            } else {
                damping = (10.0 * damping).max(1e-3);
            }
            if !(size > SMALL) || damping > 1e10 {
                break;
            }
        }
        (circle, sum)
    }

    /// The point of it nearest to x.
    pub fn nearest(&self, x: V3) -> V3 {
        let flat = add(x, -dot(self.normal, x), self.normal);
        let at = self.distance(flat);
        add(flat, -at.signed, at.outward)
    }
}

/// Cholesky's solution; none where the matrix is not definite.
fn solve(a: [[f64; 5]; 5], b: [f64; 5]) -> Option<[f64; 5]> {
    let (mut l, mut x) = ([[0.0; 5]; 5], b);
    for j in 0..5 {
        let left = a[j][j] - (0..j).map(|k| l[j][k] * l[j][k]).sum::<f64>();
        if !(left > 0.0) {
            return None;
        }
        l[j][j] = left.sqrt();
        for i in j + 1..5 {
            l[i][j] = (a[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>()) / l[j][j];
        }
    }
    for i in 0..5 {
        x[i] = (x[i] - (0..i).map(|k| l[i][k] * x[k]).sum::<f64>()) / l[i][i];
    }
    for i in (0..5).rev() {
        x[i] = (x[i] - (i + 1..5).map(|k| l[k][i] * x[k]).sum::<f64>()) / l[i][i];
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}

impl Set for Circle {
    fn project(&self, _: usize, v: &mut [V3]) {
        // Three points have a circle, or a line.
        if v.len() > 3 {
            let circle = BestCircle::of(v);
            v.iter_mut().for_each(|v| *v = circle.nearest(*v));
        }
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        if v.len() <= 3 {
            return 0.0;
        }
        let circle = BestCircle::of(v);
        largest(v.iter().map(|v| norm(add(*v, -1.0, circle.nearest(*v)))))
    }

    /// Heights h_i over the best plane and signed distances s_i in it, to first order of what they are: with orthonormal bases
    /// a of what is orthogonal to 1 and to both coordinates, and b of what is orthogonal to the derivatives of s by the circle,
    /// sum_i a_i h_i = 0 and sum_i b_i s_i = 0, 2 (k - 3) equations.
    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        if v.len() <= 3 {
            return;
        }
        let circle = BestCircle::of(v);
        let (n, side) = (circle.normal, cross(circle.normal, circle.inward));
        let column = |of: &dyn Fn(&V3) -> f64| v.iter().map(of).collect::<Vec<f64>>();
        let mut equation = |b: &[f64], value: &dyn Fn(&V3) -> f64, along: &dyn Fn(&V3) -> V3| {
            let sum = v.iter().zip(b).map(|(v, b)| b * value(v)).sum();
            let gradient: Vec<V3> = v.iter().zip(b).map(|(v, b)| scale(*b, along(v))).collect();
            row(Row { value: sum, relation: Relation::Zero, gradient: &gradient });
        };
        let spanned = [vec![1.0; v.len()], column(&|v| dot(circle.inward, *v)), column(&|v| dot(side, *v))];
        // Corners on a line leave more than planes and circles need.
        let needed = v.len() - 3;
        let basis = complement(&spanned);
        for b in &basis[basis.len() - needed..] {
            equation(b, &|v| dot(n, *v), &|_| n);
        }
        let at = |v: &V3| circle.distance(add(*v, -dot(n, *v), n));
        // All three as lengths.
        let size = norm(v.iter().fold([0.0; 3], |m, v| [0, 1, 2].map(|d| m[d].max(v[d].abs()))));
        let per = if size > 0.0 { 1.0 / size } else { 1.0 };
        let spanned = [column(&|v| at(v).by[0]), column(&|v| at(v).by[1] * per), column(&|v| at(v).by[2] * per * per)];
        let basis = complement(&spanned);
        for b in &basis[basis.len() - needed..] {
            equation(b, &|v| at(v).signed, &|v| at(v).outward);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::{MeanCentred, laws, sub};
    use proxel_testkit::random::SplitMix;

    /// Corners next to a circle, in order around it.
    fn around(random: &mut SplitMix, corners: usize, rough: f64) -> Vec<V3> {
        let frame = random.rotation();
        (0..corners)
            .map(|i| {
                let (sin, cos) =
                    (std::f64::consts::TAU * (i as f64 + random.uniform(-0.3, 0.3)) / corners as f64).sin_cos();
                add(add(scale(cos, frame[0]), sin, frame[1]), rough, random.array(-1.0, 1.0))
            })
            .collect()
    }

    /// Of the nearest points of any circle none are nearer: through three points near to corners, which knows no fit.
    fn member(near: &[V3], random: &mut SplitMix) -> Option<Vec<V3>> {
        let (i, j) = (random.below(near.len()), 1 + random.below(near.len() - 2));
        let (a, b, c) = (near[i], near[(i + j) % near.len()], near[(i + near.len() - 1) % near.len()]);
        let (u, w) = (sub(b, a), sub(c, a));
        let n = cross(u, w);
        if !(norm(n) > 1e-3) {
            return None;
        }
        let middle = add(a, 0.5 / dot(n, n), cross(add(scale(dot(u, u), w), -dot(w, w), u), scale(-1.0, n)));
        let (radius, unit) = (norm(sub(a, middle)), scale(1.0 / norm(n), n));
        let on = |v: &V3| {
            let way = sub(*v, middle);
            let flat = add(way, -dot(way, unit), unit);
            add(middle, radius / norm(flat), flat)
        };
        let mut out: Vec<V3> = near.iter().map(on).collect();
        let mean = scale(1.0 / out.len() as f64, out.iter().fold([0.0; 3], |s, p| add(s, 1.0, *p)));
        out.iter_mut().for_each(|p| *p = sub(*p, mean));
        Some(out)
    }

    fn centred(v: &[V3]) -> Vec<V3> {
        let mean = scale(1.0 / v.len() as f64, v.iter().fold([0.0; 3], |s, p| add(s, 1.0, *p)));
        v.iter().map(|p| sub(*p, mean)).collect()
    }

    #[test]
    fn no_circle_is_nearer() {
        let (mut random, mut compared) = (SplitMix::new(3), 0);
        for (corners, rough) in [(4, 0.02), (4, 0.2), (5, 0.1), (6, 0.3), (9, 0.2), (4, 0.5), (6, 1.0)] {
            for _ in 0..20 {
                let v = centred(&around(&mut random, corners, rough));
                let mut z = v.clone();
                Circle.project(0, &mut z);
                assert!(Circle.violation(0, &z) < 1e-12, "{v:?} {}", Circle.violation(0, &z));
                let distance2 = |a: &[V3]| a.iter().zip(&v).map(|(a, v)| dot(sub(*a, *v), sub(*a, *v))).sum::<f64>();
                let least = distance2(&z);
                for spread in [1.0, 0.3, 0.1, 1e-2, 1e-3] {
                    for _ in 0..40 {
                        let near: Vec<V3> = z.iter().map(|z| add(*z, spread, random.array(-1.0, 1.0))).collect();
                        let Some(other) = member(&near, &mut random) else { continue };
                        assert!(Circle.violation(0, &other) < 1e-9, "not a member: {other:?}");
                        compared += 1;
                        assert!(distance2(&other) > least - 1e-9, "{corners} {rough}: {v:?}");
                    }
                }
            }
        }
        assert!(compared > 10_000, "{compared}");
    }

    #[test]
    fn the_laws_that_need_no_members() {
        for corners in [4, 5, 8] {
            laws::check_from::<MeanCentred, _>(corners, |_| Circle, |random| around(random, corners, 0.2));
        }
    }

    #[test]
    fn a_line_is_a_circle_of_no_curvature() {
        let line: Vec<V3> = [-3.0, -1.0, 0.5, 1.5, 2.0].iter().map(|t| [*t, -2.0 * t, 0.5 * t]).collect();
        assert!(Circle.violation(0, &line) < 1e-14);
        // A short arc of a large one.
        let arc: Vec<V3> = (0..6).map(|i| [f64::from(i), 1e-7 * f64::from(i * i), 0.0]).collect();
        assert!(Circle.violation(0, &centred(&arc)) < 1e-12);
        let fit = BestCircle::of(&centred(&arc));
        assert!((fit.curvature - 2e-7).abs() < 1e-12, "{fit:?}");
    }

    #[test]
    fn bad_corners_give_numbers() {
        for k in [4, 6] {
            for corners in laws::degenerate(k) {
                laws::finite(&Circle, &corners);
            }
        }
    }
}
