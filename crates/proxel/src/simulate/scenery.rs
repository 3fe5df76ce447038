//! Obstacles as pictures show them; those without an end are cut off around the bodies.

use super::world::World;
use crate::preview::Model;
use proxel_model::solid::Placement;

type V3 = [f64; 3];
type Surface = (Vec<V3>, Vec<[u32; 3]>);

/// What is drawn of an obstacle, in the solid's own coordinates.
#[derive(Clone, Debug)]
pub(super) enum Drawn {
    /// The surface of what has an end: points and triangles.
    Whole(Vec<V3>, Vec<[u32; 3]>),
    /// A half-space below the plane through the origin across the unit normal, without a ball around the origin; a radius of
    /// 0 leaves it whole.
    Ground { normal: V3, pit: f64 },
    /// An endless cylinder around an axis through the origin, a unit vector.
    Rod { axis: V3, radius: f64 },
}

/// Points around a circle, a multiple of 8 so that squares have their corners.
const AROUND: usize = 96;
/// Rings of the flat top of a ground: what is seen of light and shadow there is worked out at its points.
const RINGS: usize = 24;
/// Rings of a half ball.
const BOWL: usize = 16;
/// How far what has no end goes on beyond the bodies, in units of their reach.
const BEYOND: f64 = 1.25;
/// Thickness of a ground in units of its half width.
const THICKNESS: f64 = 0.05;
/// sRGB of grounds, and of what stands on them.
const GROUND: [f32; 3] = [0.78, 0.79, 0.8];
const OBSTACLE: [f32; 3] = [0.53, 0.6, 0.68];

impl Drawn {
    /// A ball.
    pub fn ball(radius: f64) -> Self {
        Self::turned([0.0, 1.0, 0.0], &arc(radius, -1.0, 1.0, 0.0))
    }

    /// All points near the segment from -`half` to `half`.
    pub fn capsule(half: V3, radius: f64) -> Self {
        let length = norm(half);
        let axis = if length > 0.0 { half.map(|h| h / length) } else { [0.0, 1.0, 0.0] };
        let mut profile = arc(radius, -1.0, 0.0, -length);
        profile.extend(arc(radius, 0.0, 1.0, length));
        Self::turned(axis, &profile)
    }

    /// A cylinder with flat ends, of this half length.
    pub fn cylinder(axis: V3, radius: f64, half: f64) -> Self {
        if half.is_infinite() {
            return Drawn::Rod { axis, radius };
        }
        Self::turned(axis, &[(0.0, -half), (radius, -half), (radius, 0.0), (radius, half), (0.0, half)])
    }

    /// A box around the origin.
    pub fn brick(half: V3) -> Self {
        let points: Vec<V3> =
            (0..8).map(|c| [0, 1, 2].map(|d| if c >> d & 1 == 0 { -half[d] } else { half[d] })).collect();
        const QUADS: [[u32; 4]; 6] =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = QUADS.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        Drawn::Whole(points, triangles)
    }

    /// A profile of (distance from the axis, height along it) that is turned around an axis.
    fn turned(axis: V3, profile: &[(f64, f64)]) -> Self {
        let (points, triangles) = turned(axis, profile);
        Drawn::Whole(points, triangles)
    }

    /// Points and triangles; `around` are points, in the same coordinates, that what has no end goes beyond.
    fn surface(&self, around: &[V3]) -> Surface {
        match self {
            Drawn::Whole(points, triangles) => (points.clone(), triangles.clone()),
            Drawn::Ground { normal, pit } => ground(*normal, *pit, around),
            Drawn::Rod { axis, radius } => {
                let heights = || around.iter().map(|p| dot(*axis, *p));
                let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(-f64::INFINITY, f64::max));
                let (middle, half) = (0.5 * (low + high), (BEYOND * 0.5 * (high - low)).max(*radius));
                turned(
                    *axis,
                    &[
                        (0.0, middle - half),
                        (*radius, middle - half),
                        (*radius, middle),
                        (*radius, middle + half),
                        (0.0, middle + half),
                    ],
                )
            }
        }
    }

    fn color(&self) -> [f32; 3] {
        if matches!(self, Drawn::Ground { .. }) { GROUND } else { OBSTACLE }
    }
}

/// All obstacles of a world at a time.
pub(super) fn models(world: &World, time: f64) -> Vec<Model> {
    let bodies: Vec<V3> = world.bodies.iter().flat_map(|b| corners(&b.start)).collect();
    // Grounds reach below what else is in the scene.
    let mut all = bodies.clone();
    for obstacle in &world.obstacles {
        let home = obstacle.at(0.0, [0.0; 3]).placement;
        match &obstacle.drawn {
            Drawn::Whole(points, _) => all.extend(corners(points).map(|p| home.apply(p))),
            Drawn::Rod { axis, .. } => {
                let along = |p: &V3| home.apply(axis.map(|a| a * dot(*axis, home.undo(*p))));
                all.extend(bodies.iter().map(along));
            }
            Drawn::Ground { .. } => {}
        }
    }
    let one = |obstacle: &super::obstacles::Obstacle| {
        // Cut off once, where it is at the start: it must not grow on its way.
        let home: Placement = obstacle.at(0.0, [0.0; 3]).placement;
        let near = if matches!(obstacle.drawn, Drawn::Ground { .. }) { &all } else { &bodies };
        let around: Vec<V3> = near.iter().map(|p| home.undo(*p)).collect();
        let (points, triangles) = obstacle.drawn.surface(&around);
        let now = obstacle.at(time, [0.0; 3]).placement;
        let mut model = Model::new(points.iter().map(|p| now.apply(*p)).collect(), triangles);
        model.colors = vec![obstacle.drawn.color(); model.points.len()];
        model
    };
    world.obstacles.iter().map(one).collect()
}

/// The corners of the box around points; none where there are no points.
fn corners(points: &[V3]) -> impl Iterator<Item = V3> + use<> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points {
        (low, high) = ([0, 1, 2].map(|d| low[d].min(p[d])), [0, 1, 2].map(|d| high[d].max(p[d])));
    }
    let count = if points.is_empty() { 0 } else { 8 };
    (0..count).map(move |c| [0, 1, 2].map(|d| if c >> d & 1 == 0 { low[d] } else { high[d] }))
}

/// A square slab below the plane, around the foot of what stands over it; with a bowl in it the square is around the bowl.
fn ground(normal: V3, pit: f64, around: &[V3]) -> Surface {
    let (e, f) = across(normal);
    let flat = |p: &V3| [dot(e, *p), dot(f, *p)];
    let bounds = |c: usize| {
        let values = || around.iter().map(|p| flat(p)[c]);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    let sides = [bounds(0), bounds(1)];
    let middle = if pit > 0.0 { [0.0; 2] } else { sides.map(|(low, high)| 0.5 * (low + high)) };
    let reach = (0..2).map(|c| (sides[c].1 - middle[c]).max(middle[c] - sides[c].0)).fold(0.0, f64::max);
    let half = (BEYOND * reach).max(1.5 * pit);
    let depth = (THICKNESS * half).max(1.1 * pit);
    let at = |u: f64, v: f64, h: f64| -> V3 {
        [0, 1, 2].map(|d| (middle[0] + u) * e[d] + (middle[1] + v) * f[d] + h * normal[d])
    };
    // Rings of the square towards its middle: from its edge, t = 1, to the rim of the bowl, t = 0.
    let ring = |t: f64, h: f64| -> Vec<V3> {
        let point = |k: usize| {
            let (s, c) = angle(k).sin_cos();
            let edge = half / s.abs().max(c.abs());
            let r = pit + t * (edge - pit);
            at(r * c, r * s, h)
        };
        (0..AROUND).map(point).collect()
    };
    let mut rows: Vec<Vec<V3>> = vec![ring(1.0, -depth), ring(1.0, 0.0)];
    rows.extend((1..RINGS).map(|i| ring(1.0 - i as f64 / RINGS as f64, 0.0)));
    if pit > 0.0 {
        rows.push(ring(0.0, 0.0));
        for i in 1..BOWL {
            let (s, c) = (i as f64 / BOWL as f64 * std::f64::consts::FRAC_PI_2).sin_cos();
            rows.push((0..AROUND).map(|k| at(pit * c * angle(k).cos(), pit * c * angle(k).sin(), -pit * s)).collect());
        }
    }
    sewn(at(0.0, 0.0, -depth), &rows, at(0.0, 0.0, -pit))
}

/// The angle of point `k` around a circle.
fn angle(k: usize) -> f64 {
    k as f64 / AROUND as f64 * std::f64::consts::TAU
}

/// Points of a circle of the radius from one height to another, in units of the radius, shifted along the axis.
fn arc(radius: f64, from: f64, to: f64, shift: f64) -> Vec<(f64, f64)> {
    let angles = [from, to].map(|h| h.asin());
    let n = if from < 0.0 && to > 0.0 { 2 * BOWL } else { BOWL };
    let point = |i: usize| {
        let (s, c) = (angles[0] + (angles[1] - angles[0]) * i as f64 / n as f64).sin_cos();
        (radius * c.max(0.0), shift + radius * s)
    };
    (0..=n).map(point).collect()
}

/// A profile from the lowest to the highest point, both on the axis.
fn turned(axis: V3, profile: &[(f64, f64)]) -> Surface {
    let (e, f) = across(axis);
    let at = |r: f64, k: usize, h: f64| -> V3 {
        let (s, c) = angle(k).sin_cos();
        [0, 1, 2].map(|d| r * c * e[d] + r * s * f[d] + h * axis[d])
    };
    let [(_, low), inner @ .., (_, high)] = profile else { return Surface::default() };
    let rows: Vec<Vec<V3>> = inner.iter().map(|(r, h)| (0..AROUND).map(|k| at(*r, k, *h)).collect()).collect();
    sewn(at(0.0, 0, *low), &rows, at(0.0, 0, *high))
}

/// Rings of [`AROUND`] points each, one after the other from pole to pole.
fn sewn(first: V3, rows: &[Vec<V3>], last: V3) -> Surface {
    let mut points = vec![first];
    points.extend(rows.iter().flatten());
    points.push(last);
    let (n, end) = (AROUND as u32, points.len() as u32 - 1);
    let at = |i: u32, k: u32| 1 + i * n + k % n;
    let mut triangles = Vec::new();
    for k in 0..n {
        triangles.push([0, at(0, k + 1), at(0, k)]);
        for i in 0..(rows.len() as u32).saturating_sub(1) {
            triangles.push([at(i, k), at(i, k + 1), at(i + 1, k + 1)]);
            triangles.push([at(i, k), at(i + 1, k + 1), at(i + 1, k)]);
        }
        triangles.push([
            at((rows.len() as u32).saturating_sub(1), k),
            at((rows.len() as u32).saturating_sub(1), k + 1),
            end,
        ]);
    }
    (points, triangles)
}

fn dot(a: V3, b: V3) -> f64 {
    (0..3).map(|d| a[d] * b[d]).sum()
}

fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

/// Two unit vectors across a unit vector n, so that all three are a right-handed frame.
fn across(n: V3) -> (V3, V3) {
    let least = (0..3).min_by(|a, b| n[*a].abs().total_cmp(&n[*b].abs())).unwrap_or(0);
    let e = [0, 1, 2].map(|d| f64::from(u8::from(d == least)) - n[least] * n[d]);
    let e = e.map(|v| v / norm(e));
    (e, [n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::closed_mesh::ClosedMesh;
    use proxel_model::solid::{Brick, Capsule, Cylinder, Ground, Pit, Solid, Sphere};

    /// What is drawn is closed and oriented outwards, and its points are on the surface of the solid.
    fn check(drawn: &Drawn, solid: &dyn Solid, around: &[V3], tolerance: f64) {
        let (points, triangles) = drawn.surface(around);
        let closed = ClosedMesh::new(&points, &triangles).expect("closed");
        // What has an end is drawn whole; of what has none only the part that bodies see is on its surface.
        let mut seen = 0;
        for p in &points {
            let depth = solid.nearest(*p).distance;
            assert!(depth < tolerance, "{drawn:?}: {p:?}: {depth}");
            seen += usize::from(depth.abs() < tolerance);
        }
        assert!(seen > points.len() / 2, "{drawn:?}: {seen} of {}", points.len());
        for p in around {
            // Curved surfaces are drawn by chords.
            assert!((closed.nearest(*p).distance - solid.nearest(*p).distance).abs() < 0.02, "{drawn:?}: {p:?}");
        }
    }

    #[test]
    fn surfaces_are_those_of_the_solids() {
        let n: V3 = [0.6, 0.8, 0.0];
        let around = [[1.0, 2.0, -1.0], [2.0, 1.5, 0.5], [0.7, 3.0, 0.9], [1.4, 1.0, 0.1]];
        check(&Drawn::ball(0.8), &Sphere { radius: 0.8 }, &around, 1e-9);
        check(&Drawn::brick([0.5, 0.7, 0.3]), &Brick { half: [0.5, 0.7, 0.3] }, &around, 1e-9);
        let half = n.map(|v| 0.9 * v);
        check(&Drawn::capsule(half, 0.4), &Capsule { half, radius: 0.4 }, &around, 1e-9);
        for half in [0.7, f64::INFINITY] {
            check(&Drawn::cylinder(n, 0.4, half), &Cylinder { axis: n, radius: 0.4, half }, &around, 1e-9);
        }
        check(&Drawn::Ground { normal: n, pit: 0.0 }, &Ground { normal: n }, &around, 1e-9);
        check(&Drawn::Ground { normal: n, pit: 0.6 }, &Pit { normal: n, radius: 0.6 }, &around, 1e-9);
    }

    #[test]
    fn grounds_without_bodies_can_be_drawn() {
        let (points, triangles) = Drawn::Ground { normal: [0.0, 1.0, 0.0], pit: 0.0 }.surface(&[]);
        assert!(triangles.iter().flatten().all(|v| (*v as usize) < points.len()));
    }
}
