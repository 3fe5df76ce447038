//! The octopus: a body with long tapered arms, the sample that shows what a deformation does.
//!
//! Implicit surface: a mantle (ellipsoid), a head (sphere), two eyes and arms (tapered tubes around
//! cubic Bezier curves), joined by smooth minima; y points up. Filled by [`stuff`].

use std::f64::consts::TAU;

use super::{invalid, positive, stuff};
use crate::error::Result;
use crate::mesh::Mesh;
use crate::vec3::{V3, add, dot, lerp, norm, scale, sub};

/// What the octopus looks like.
#[derive(Clone, Debug, PartialEq)]
pub struct OctopusSettings {
    /// The number of arms, 1 to 16.
    pub arms: usize,
    /// Edge of a lattice cell, at most 0.2; the number of tetrahedra grows with its inverse cube.
    /// Arms end in tips of radius 0.11, thicker where the cells are too coarse for that.
    pub cell: f64,
}

impl Default for OctopusSettings {
    fn default() -> Self {
        OctopusSettings { arms: 8, cell: 0.1 }
    }
}

/// One arm of the octopus: its axis and the vertices around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Points along the axis from the body (first) to the tip (last).
    pub axis: Vec<[f64; 3]>,
    /// The radius of the tube at each point of the axis.
    pub radii: Vec<f64>,
    /// The vertices of the arm's last tenth, ascending: a handle.
    pub tip: Vec<u32>,
}

/// Where along which arm a vertex lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmPoint {
    /// The arm.
    pub arm: u32,
    /// The place along its axis: 0 at the body, 1 at the tip.
    pub t: f64,
}

/// The mesh and what is needed to pose it.
#[derive(Clone, Debug, PartialEq)]
pub struct Octopus {
    /// The tetrahedra.
    pub mesh: Mesh,
    /// The arms, counter-clockwise seen from above.
    pub arms: Vec<Arm>,
    /// The vertices deep inside mantle and head, ascending: what stays where it is.
    pub core: Vec<u32>,
    /// The arm that each vertex belongs to; `None` for those of the body.
    pub arm_point: Vec<Option<ArmPoint>>,
}

impl Octopus {
    /// The named vertex groups: `core`, `tip-0`, `tip-1`, ...
    pub fn groups(&self) -> Vec<(String, &[u32])> {
        let tips = self.arms.iter().enumerate().map(|(i, a)| (format!("tip-{i}"), &a.tip[..]));
        std::iter::once(("core".to_owned(), &self.core[..])).chain(tips).collect()
    }
}

/// Points on each axis, and the segments that share one bounding ball.
const AXIS_POINTS: usize = 33;
const CHUNK: usize = 4;
/// Radii of an arm at the body and at the tip.
const ARM_RADII: (f64, f64) = (0.25, 0.11);
/// The coarsest cell that still shows arms.
const MOST_CELL: f64 = 0.2;
/// The least radius in cells: a thinner tip would fall apart.
const LEAST_RADIUS: f64 = 0.9;
const MANTLE: (V3, V3) = ([0.0, 0.62, -0.05], [0.56, 0.72, 0.56]); // centre, half axes
const HEAD: (V3, f64) = ([0.0, 0.02, 0.0], 0.47); // centre, radius
const EYES: ([V3; 2], f64) = ([[0.3, 0.42, 0.37], [-0.3, 0.42, 0.37]], 0.165);
/// Over which distance parts blend.
const BLEND: f64 = 0.22;

/// Makes the octopus.
///
/// # Errors
/// No arms or over 16; a cell that is not positive, too coarse for the arms (above 0.2) or too fine.
pub fn octopus(settings: &OctopusSettings) -> Result<Octopus> {
    if !(1..=16).contains(&settings.arms) {
        return Err(invalid(format!("{} arms", settings.arms), "give it 1 to 16"));
    }
    positive("the cell size", settings.cell)?;
    if settings.cell > MOST_CELL {
        return Err(invalid(
            format!("a cell of {} is coarser than the arms are thick", settings.cell),
            "give a cell of at most 0.2",
        ));
    }
    let tubes: Vec<Tube> = (0..settings.arms).map(|i| Tube::new(i, settings)).collect();
    let field = |p: V3| {
        // The closest arms first blend among each other, then with the body.
        let mut arms = f64::INFINITY;
        for tube in &tubes {
            // Beyond the blending distance a tube changes nothing, and most are.
            if tube.whole.distance(p) < arms + BLEND {
                arms = smooth_min(arms, tube.distance(p).0, 0.5 * BLEND);
            }
        }
        smooth_min(arms, body(p), BLEND)
    };
    let mut lo = [-0.6, -0.5, -0.65];
    let mut hi = [0.6, 1.36, 0.6];
    for (p, r) in tubes.iter().flat_map(|t| t.axis.iter().zip(&t.radii)) {
        for c in 0..3 {
            lo[c] = f64::min(lo[c], p[c] - r);
            hi[c] = f64::max(hi[c], p[c] + r);
        }
    }
    let mesh = Mesh { name: "octopus".into(), ..stuff(&field, lo, hi, settings.cell)? };
    Ok(describe(mesh, tubes))
}

/// Sorts the vertices into core, arms and tips.
fn describe(mesh: Mesh, tubes: Vec<Tube>) -> Octopus {
    let mut arm_point = Vec::with_capacity(mesh.points.len());
    let mut core = Vec::new();
    let mut tips = vec![Vec::new(); tubes.len()];
    for (v, &p) in mesh.points.iter().enumerate() {
        let inside = body(p);
        let (arm, (d, t)) = tubes
            .iter()
            .map(|tube| tube.distance(p))
            .enumerate()
            .min_by(|a, b| a.1.0.total_cmp(&b.1.0))
            .unwrap_or((0, (f64::INFINITY, 0.0)));
        if inside < -0.12 {
            core.push(v as u32);
        }
        let of_arm = d < inside;
        arm_point.push(of_arm.then_some(ArmPoint { arm: arm as u32, t }));
        if of_arm && t > 0.9 {
            tips[arm].push(v as u32);
        }
    }
    let arms = tubes.into_iter().zip(tips).map(|(t, tip)| Arm { axis: t.axis, radii: t.radii, tip }).collect();
    Octopus { mesh, arms, core, arm_point }
}

/// Roughly the signed distance to mantle, head and eyes.
fn body(p: V3) -> f64 {
    let q = sub(p, MANTLE.0);
    let scaled = |power: i32| norm([0, 1, 2].map(|c| q[c] / MANTLE.1[c].powi(power)));
    let (k1, k2) = (scaled(1), scaled(2));
    let mantle = if k2 == 0.0 { -MANTLE.1[0] } else { k1 * (k1 - 1.0) / k2 };
    let head = norm(sub(p, HEAD.0)) - HEAD.1;
    let eyes = EYES.0.iter().map(|&e| norm(sub(p, e)) - EYES.1).fold(f64::INFINITY, f64::min);
    smooth_min(smooth_min(mantle, head, BLEND), eyes, 0.05)
}

/// The smaller of two distances, rounded over `k` (quadratic; exact where they differ by k or more).
fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    if h.is_nan() { a.min(b) } else { a.min(b) - 0.25 * k * h * h }
}

/// A tapered tube around a polyline.
struct Tube {
    axis: Vec<V3>,
    radii: Vec<f64>,
    whole: Bound,
    chunks: Vec<Bound>, // of CHUNK segments each
}

/// A ball that holds a part of a tube.
struct Bound {
    centre: V3,
    reach: f64,
}

impl Bound {
    fn new(axis: &[V3], radii: &[f64]) -> Self {
        let centre = lerp(axis[0], axis[axis.len() - 1], 0.5);
        let reach = |(&p, &r): (&V3, &f64)| norm(sub(p, centre)) + r;
        Bound { centre, reach: axis.iter().zip(radii).map(reach).fold(0.0, f64::max) }
    }

    /// The tube is no closer than this.
    fn distance(&self, p: V3) -> f64 {
        norm(sub(p, self.centre)) - self.reach
    }
}

impl Tube {
    fn new(arm: usize, settings: &OctopusSettings) -> Self {
        let angle = TAU * (arm as f64 + 0.5) / settings.arms as f64;
        // Neighbours differ, so that the picture is no wheel: longer and lower, shorter and higher.
        let wave = [0.0, 1.0, 0.35, 0.8, 0.15, 0.9, 0.5, 0.65][arm % 8];
        // (distance from the y axis, height, swirl) of the four control points.
        let control = [
            [0.18, -0.08, 0.0],
            [0.95, -0.05 - 0.15 * wave, 0.0],
            [1.35 + 0.25 * wave, -0.95 + 0.15 * wave, 0.25],
            [2.15 + 0.25 * wave, -0.52 + 0.38 * (1.0 - wave), 0.55],
        ];
        let (sin, cos) = angle.sin_cos();
        let control = control.map(|[r, y, s]| [r * cos - s * sin, y, r * sin + s * cos]);
        let t = |i: usize| i as f64 / (AXIS_POINTS - 1) as f64;
        let axis: Vec<V3> = (0..AXIS_POINTS).map(|i| bezier(control, t(i))).collect();
        let tip = ARM_RADII.1.max(LEAST_RADIUS * settings.cell);
        let radii: Vec<f64> = (0..AXIS_POINTS).map(|i| ARM_RADII.0 + (tip - ARM_RADII.0) * t(i).powf(0.8)).collect();
        let part = |k: usize| k * CHUNK..(k + 1) * CHUNK + 1;
        let chunks = (0..(AXIS_POINTS - 1) / CHUNK).map(|k| Bound::new(&axis[part(k)], &radii[part(k)])).collect();
        let whole = Bound::new(&axis, &radii);
        Tube { axis, radii, whole, chunks }
    }

    /// The distance to the tube's surface (negative inside) and the place along the axis in [0, 1].
    fn distance(&self, p: V3) -> (f64, f64) {
        let mut best: (f64, f64) = (f64::INFINITY, 0.0);
        for (k, chunk) in self.chunks.iter().enumerate() {
            if chunk.distance(p) >= best.0 {
                continue;
            }
            for i in k * CHUNK..(k + 1) * CHUNK {
                let (a, b) = (self.axis[i], self.axis[i + 1]);
                let (ab, ap) = (sub(b, a), sub(p, a));
                let t = (dot(ap, ab) / dot(ab, ab)).clamp(0.0, 1.0);
                let radius = self.radii[i] + t * (self.radii[i + 1] - self.radii[i]);
                let d = norm(sub(ap, scale(t, ab))) - radius;
                if d < best.0 {
                    best = (d, (i as f64 + t) / (AXIS_POINTS - 1) as f64);
                }
            }
        }
        best
    }
}

/// A cubic Bezier curve.
fn bezier(c: [V3; 4], t: f64) -> V3 {
    let s = 1.0 - t;
    let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
    (0..4).fold([0.0; 3], |sum, i| add(sum, scale(weights[i], c[i])))
}
