//! Conical vertices.

use super::{Relation, Row, Set, V3, add, cross, dot, largest, norm, scale, sub};

/// Four sides e_0, .., e_3 that lead from a vertex to its neighbours, in their order around it, whose opposite angles sum
/// alike: c(e) = w_01 - w_12 + w_23 - w_30 = 0, w_ij being the angle between e_i and e_j.
///
/// A vertex of four planar faces has this property just where they touch a common cone of revolution (Liu, Pottmann,
/// Wallner, Yang and Wang 2006, *Geometric modeling with conical meshes and developable surfaces*, section 3), so that the
/// mesh has offsets of faces at a constant distance. The other form of the same, face normals at one angle from an axis,
/// needs the axis as an unknown and planar faces to have normals at all; this one is a function of the four sides, and does
/// not mind their lengths.
///
/// The nearest sides have no closed form. They are where c = 0 and z - v + lambda grad c = 0, found by Newton's method on
/// that system with a search along its steps, which keeps c = 0 to rounding and the second equation to 1e-9 of the longest
/// side within a few steps where v is off by some tenths of a radian. Of far ones a point of the set that is no farther than
/// the first one met is what comes out. Where a side has no length, or two neighbours point the same or opposite ways, angles
/// have no gradient: then the sides stay, and are within the set.
///
/// The violation is |c|, in radians.
#[derive(Clone, Copy, Debug, Default)]
pub struct Conical;

/// The sign of the angle from side k to the next.
const SIGNS: [f64; 4] = [1.0, -1.0, 1.0, -1.0];
/// Steps of a projection, at most.
const STEPS: usize = 60;
/// Halvings of a step, at most.
const HALVINGS: usize = 30;
/// The sine below which two sides are parallel: their normal, and with it the gradient, has half the digits.
const PARALLEL: f64 = 1e-8;
/// |z - v + lambda grad c| over the longest side at which a projection ends.
const TOLERANCE: f64 = 1e-13;

/// What c is at a point: its value, and for each pair of neighbours (k, k + 1) what its derivatives are made of.
struct Angles {
    c: f64,
    gradient: [V3; 4],
    pairs: [Pair; 4],
}

#[derive(Clone, Copy, Default)]
struct Pair {
    unit: [V3; 2],   // along both sides
    toward: [V3; 2], // across each, on the side of the other
    normal: V3,      // unit, of the plane of both
    sin: f64,
    cos: f64,
    length: [f64; 2],
}

/// Angles alternately added; none where some have no gradient.
fn angles(e: &[V3; 4]) -> Option<Angles> {
    let mut out = Angles { c: 0.0, gradient: [[0.0; 3]; 4], pairs: [Pair::default(); 4] };
    for k in 0..4 {
        let (a, b) = (e[k], e[(k + 1) % 4]);
        let length = [norm(a), norm(b)];
        if !(length[0] > 0.0 && length[1] > 0.0) {
            return None;
        }
        let unit = [scale(1.0 / length[0], a), scale(1.0 / length[1], b)];
        let n = cross(unit[0], unit[1]);
        let (sin, cos) = (norm(n), dot(unit[0], unit[1]));
        if !(sin > PARALLEL) {
            return None;
        }
        let normal = scale(1.0 / sin, n);
        let toward = [cross(normal, unit[0]), cross(unit[1], normal)];
        out.c += SIGNS[k] * sin.atan2(cos);
        // The angle falls where a side turns toward the other.
        out.gradient[k] = add(out.gradient[k], -SIGNS[k] / length[0], toward[0]);
        let next = (k + 1) % 4;
        out.gradient[next] = add(out.gradient[next], -SIGNS[k] / length[1], toward[1]);
        out.pairs[k] = Pair { unit, toward, normal, sin, cos, length };
    }
    Some(out)
}

impl Angles {
    /// lambda times the Hessian of c, row by row, added to a matrix of 13 columns. Of one angle w between a and b:
    ///
    /// d2w/da2 = (a^ t^T + t a^T + cot w n n^T) / |a|^2, d2w/da db = -n n^T / (sin w |a| |b|)
    ///
    /// with the unit vectors a^ along a, t across it toward b, and n normal to both.
    fn add_hessian(&self, lambda: f64, matrix: &mut [[f64; 14]; 13]) {
        for (k, pair) in self.pairs.iter().enumerate() {
            let (n, weight) = (pair.normal, lambda * SIGNS[k]);
            for (one, other) in [(0, 1), (1, 0)] {
                let (row, column) = (3 * ((k + one) % 4), 3 * ((k + other) % 4));
                let (unit, toward, length) = (pair.unit[one], pair.toward[one], pair.length[one]);
                for i in 0..3 {
                    for j in 0..3 {
                        let own = unit[i] * toward[j] + toward[i] * unit[j] + pair.cos / pair.sin * n[i] * n[j];
                        matrix[row + i][row + j] += weight * own / (length * length);
                        let both = n[i] * n[j] / (pair.sin * pair.length[0] * pair.length[1]);
                        matrix[row + i][column + j] -= weight * both;
                    }
                }
            }
        }
    }
}

/// Gauss's elimination with pivots; none where the system is singular.
fn solve(matrix: &mut [[f64; 14]; 13]) -> Option<[f64; 13]> {
    const N: usize = 13;
    for k in 0..N {
        let pivot = (k..N).max_by(|i, j| matrix[*i][k].abs().total_cmp(&matrix[*j][k].abs()))?;
        matrix.swap(k, pivot);
        if !(matrix[k][k].abs() > 0.0) {
            return None;
        }
        for i in k + 1..N {
            let factor = matrix[i][k] / matrix[k][k];
            for j in k..=N {
                matrix[i][j] -= factor * matrix[k][j];
            }
        }
    }
    let mut x = [0.0; N];
    for k in (0..N).rev() {
        let known: f64 = (k + 1..N).map(|j| matrix[k][j] * x[j]).sum();
        x[k] = (matrix[k][N] - known) / matrix[k][k];
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// A step of the system, and the new lambda: with the Hessian of c, or with that of |z - v|^2 alone, whose step is the
/// nearest point of the linearised set.
fn step(z: &[V3; 4], v: &[V3; 4], at: &Angles, lambda: f64, exact: bool) -> Option<([V3; 4], f64)> {
    if !exact {
        let squares: f64 = at.gradient.iter().map(|g| dot(*g, *g)).sum();
        let along: f64 = (0..4).map(|k| dot(at.gradient[k], sub(v[k], z[k]))).sum();
        let lambda = (at.c + along) / squares;
        let to = |k: usize| sub(add(v[k], -lambda, at.gradient[k]), z[k]);
        return lambda.is_finite().then(|| ([to(0), to(1), to(2), to(3)], lambda));
    }
    let mut matrix = [[0.0; 14]; 13];
    at.add_hessian(lambda, &mut matrix);
    for i in 0..12 {
        let g = at.gradient[i / 3][i % 3];
        matrix[i][i] += 1.0;
        (matrix[i][12], matrix[12][i]) = (g, g);
        matrix[i][13] = v[i / 3][i % 3] - z[i / 3][i % 3];
    }
    matrix[12][13] = -at.c;
    let x = solve(&mut matrix)?;
    let d = [0, 1, 2, 3].map(|k| [x[3 * k], x[3 * k + 1], x[3 * k + 2]]);
    Some((d, x[12]))
}

fn distance2(a: &[V3; 4], b: &[V3; 4]) -> f64 {
    (0..4).map(|k| dot(sub(a[k], b[k]), sub(a[k], b[k]))).sum()
}

/// Sides of length about 1 to the nearest ones.
fn nearest(v: &[V3; 4]) -> [V3; 4] {
    let (mut z, mut lambda) = (*v, 0.0);
    let Some(mut at) = angles(&z) else { return z };
    for _ in 0..STEPS {
        // 1/2 |z - v|^2 + nu |c|, exact above |lambda|: what a step has to lower.
        let mut moved = false;
        for exact in [true, false] {
            let Some((d, next)) = step(&z, v, &at, lambda, exact) else { continue };
            let size = d.iter().map(|d| dot(*d, *d)).sum::<f64>().sqrt();
            let nu = 2.0 * next.abs().max(lambda.abs());
            let merit = |z: &[V3; 4], c: f64| 0.5 * distance2(z, v) + nu * c.abs();
            let slope: f64 = (0..4).map(|k| dot(sub(z[k], v[k]), d[k])).sum::<f64>() - nu * at.c.abs();
            if size <= TOLERANCE {
                lambda = next;
                break;
            }
            if !(slope < 0.0) {
                continue;
            }
            let before = merit(&z, at.c);
            let mut part = 1.0;
            for _ in 0..HALVINGS {
                let there = [0, 1, 2, 3].map(|k| add(z[k], part, d[k]));
                if let Some(new) = angles(&there)
                    && merit(&there, new.c) <= before + 1e-4 * part * slope + f64::EPSILON * before
                {
                    (z, at, lambda, moved) = (there, new, next, true);
                    break;
                }
                part *= 0.5;
            }
            if moved {
                break;
            }
        }
        if !moved {
            break;
        }
    }
    // To the set itself, along the gradient.
    for _ in 0..HALVINGS {
        let squares: f64 = at.gradient.iter().map(|g| dot(*g, *g)).sum();
        let there = [0, 1, 2, 3].map(|k| add(z[k], -at.c / squares, at.gradient[k]));
        match angles(&there) {
            Some(new) if new.c.abs() < at.c.abs() => (z, at) = (there, new),
            _ => break,
        }
    }
    z
}

impl Set for Conical {
    fn project(&self, _: usize, v: &mut [V3]) {
        let Ok(v) = <&mut [V3; 4]>::try_from(v) else { return };
        // The longest side between 1 and 2, by a power of two.
        let size = largest(v.iter().map(|v| norm(*v))).log2().floor().exp2();
        if size > 0.0 && size.is_finite() {
            *v = nearest(&v.map(|v| v.map(|c| c / size))).map(|z| scale(size, z));
        }
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        let v = <&[V3; 4]>::try_from(v).ok();
        v.and_then(angles).map_or(0.0, |at| largest([at.c.abs()].into_iter()))
    }

    /// c = 0, with its gradient: for each angle -t/|a|, t being across a toward the other side.
    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        if let Some(at) = <&[V3; 4]>::try_from(v).ok().and_then(angles) {
            row(Row { value: at.c, relation: Relation::Zero, gradient: &at.gradient });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::{Spokes, laws};
    use proxel_testkit::random::SplitMix;

    /// Sides around a vertex as in a mesh: a quarter turn apart, up or down.
    fn fan(random: &mut SplitMix, rough: f64) -> [V3; 4] {
        [0.0, 1.0, 2.0, 3.0].map(|k: f64| {
            let (sin, cos) = (k * std::f64::consts::FRAC_PI_2).sin_cos();
            let length = random.uniform(0.6, 1.4);
            add(scale(length, [cos, sin, 0.0]), rough, random.array(-1.0, 1.0))
        })
    }

    /// The sides of a member: three of them and the length of the fourth as they are, its direction turned until the sum
    /// vanishes, by bisection.
    fn member(near: &[V3], random: &mut SplitMix) -> Option<Vec<V3>> {
        let e: [V3; 4] = near.try_into().ok()?;
        let (from, to) = (e[3], add(e[3], 1.0, random.array(-1.0, 1.0)));
        let at = |t: f64| [e[0], e[1], e[2], add(from, t, sub(to, from))];
        let c = |t: f64| angles(&at(t)).map(|a| a.c);
        let (mut low, mut high) = (0.0, 1.0);
        if c(low)? * c(high)? > 0.0 {
            return None;
        }
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if c(low)? * c(middle)? > 0.0 { low = middle } else { high = middle }
        }
        Some(at(0.5 * (low + high)).to_vec())
    }

    #[test]
    fn no_member_is_nearer() {
        let (mut random, mut compared) = (SplitMix::new(5), 0);
        for rough in [0.05, 0.2, 0.4] {
            for _ in 0..40 {
                let v = fan(&mut random, rough);
                let mut z = v;
                Conical.project(0, &mut z);
                assert!(Conical.violation(0, &z) < 1e-13, "{v:?} {}", Conical.violation(0, &z));
                let least = distance2(&v, &z).sqrt();
                let mut again = z;
                Conical.project(0, &mut again);
                assert!(distance2(&z, &again).sqrt() < 1e-13);
                for spread in [0.3, 0.1, 1e-2, 1e-3] {
                    for _ in 0..40 {
                        let near = z.map(|z| add(z, spread, random.array(-1.0, 1.0)));
                        let Some(other) = member(&near, &mut random) else { continue };
                        compared += 1;
                        let other: [V3; 4] = other.try_into().unwrap();
                        assert!(distance2(&v, &other).sqrt() > least - 1e-9, "{v:?} {z:?} {other:?}");
                    }
                }
                // z - v is along the gradient.
                let g = angles(&z).unwrap().gradient;
                let along: f64 = (0..4).map(|k| dot(g[k], sub(z[k], v[k]))).sum::<f64>();
                let squares: f64 = g.iter().map(|g| dot(*g, *g)).sum();
                let left = [0, 1, 2, 3].map(|k| add(sub(z[k], v[k]), -along / squares, g[k]));
                assert!(left.iter().map(|l| norm(*l)).fold(0.0, f64::max) < 1e-9, "{left:?}");
            }
        }
        assert!(compared > 2000, "{compared}");
    }

    #[test]
    fn the_laws_that_need_no_members() {
        laws::check_from::<Spokes, _>(
            5,
            |_| Conical,
            |random| {
                let hub: V3 = random.array(-1.0, 1.0);
                let fan = fan(random, 0.3);
                [hub].into_iter().chain(fan.map(|e| add(hub, 1.0, e))).collect()
            },
        );
    }

    /// Faces that touch a cone: planes whose normals make one angle with its axis.
    #[test]
    fn faces_on_a_cone() {
        let mut random = SplitMix::new(8);
        for _ in 0..20 {
            let tilt: f64 = random.uniform(0.3, 1.2);
            let mut turns: [f64; 4] = random.array(0.0, 1.2);
            turns.iter_mut().enumerate().for_each(|(k, t)| *t += 1.6 * k as f64);
            let normals = turns.map(|t| [tilt.sin() * t.cos(), tilt.sin() * t.sin(), tilt.cos()]);
            // Sides are where neighbouring planes meet, downward from the tip.
            let sides = [0, 1, 2, 3].map(|k| {
                let side = cross(normals[k], normals[(k + 1) % 4]);
                scale(-side[2].signum() / norm(side) * random.uniform(0.5, 2.0), side)
            });
            assert!(Conical.violation(0, &sides) < 1e-13, "{}", Conical.violation(0, &sides));
        }
    }

    #[test]
    fn bad_sides_give_numbers() {
        for sides in laws::degenerate(4) {
            laws::finite(&Conical, &sides);
        }
        // Neighbours that point opposite ways: no gradient, and no angle to be changed.
        let mut flat = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let before = flat;
        Conical.project(0, &mut flat);
        assert_eq!(flat, before);
    }
}
