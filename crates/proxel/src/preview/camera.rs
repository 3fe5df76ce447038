//! From space to pixels.

use super::vec::{V3, add, cross, direction, dot, scale, sub};

/// Where the picture is taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// From the body to the eye.
    pub toward_eye: [f64; 3],
    /// What is up; the ground is across it.
    pub up: [f64; 3],
    /// The opening angle along the shorter side of a panel, in degrees.
    pub opening: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Camera { toward_eye: [0.35, 0.38, 1.0], up: [0.0, 1.0, 0.0], opening: 22.0 }
    }
}

/// The cube around everything, so that what follows works at any scale and far from the origin.
pub(super) struct Frame {
    middle: V3,
    radius: f64,
}

impl Frame {
    pub fn around(points: impl Iterator<Item = V3>) -> Frame {
        let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in points.filter(|p| p.iter().all(|c| c.is_finite())) {
            for c in 0..3 {
                lo[c] = lo[c].min(p[c]);
                hi[c] = hi[c].max(p[c]);
            }
        }
        if lo[0] > hi[0] {
            return Frame { middle: [0.0; 3], radius: 1.0 };
        }
        let radius = (0..3).map(|c| 0.5 * hi[c] - 0.5 * lo[c]).fold(0.0, f64::max);
        Frame { middle: [0, 1, 2].map(|c| 0.5 * lo[c] + 0.5 * hi[c]), radius: if radius > 0.0 { radius } else { 1.0 } }
    }

    pub fn inward(&self, p: V3) -> V3 {
        [0, 1, 2].map(|c| (p[c] - self.middle[c]) / self.radius)
    }
}

/// A camera in place, and its picture of `width` x `height` samples.
#[derive(Clone, Copy)]
pub(super) struct View {
    pub eye: V3,
    /// To the right, up, and backward (to the eye).
    pub axes: [V3; 3],
    /// Up in the world.
    pub up: V3,
    focal: f64, // over half the shorter side of a panel
    unit: f64,  // samples in half the shorter side
    center: [f64; 2],
}

/// Rounds of moving the eye sideways; each leaves a small part of the error.
const CENTERING_ROUNDS: usize = 8;
/// The part of a panel that is left free on each side.
const MARGIN: f64 = 0.07;

impl View {
    /// Moves the camera so that every body fits a panel of `width` x `height`.
    pub fn framing<'a>(
        camera: &Camera,
        bodies: impl Iterator<Item = &'a [V3]> + Clone,
        width: usize,
        height: usize,
    ) -> View {
        let back = direction(camera.toward_eye, [0.0, 0.0, 1.0]);
        let up = direction(camera.up, [0.0, 1.0, 0.0]);
        let right = direction(cross(up, back), perpendicular(back));
        let axes = [right, cross(back, right), back];
        let focal = 1.0 / (0.5 * camera.opening.clamp(1.0, 120.0)).to_radians().tan();
        let shorter = width.min(height).max(1) as f64;
        let half = [width, height].map(|n| (1.0 - 2.0 * MARGIN) * n as f64 / shorter / focal);
        let points = || bodies.clone().flatten().filter(|p| p.iter().all(|c| c.is_finite()));
        // For each side the eye must be so far that no point is beyond it: with slopes +-half the
        // eye is at the crossing of two planes in each direction, and at the farther crossing.
        let mut most = [[f64::NEG_INFINITY; 2]; 2];
        for &p in points() {
            for c in 0..2 {
                let (x, z) = (dot(p, axes[c]), dot(p, back));
                most[c][0] = most[c][0].max(half[c] * z + x);
                most[c][1] = most[c][1].max(half[c] * z - x);
            }
        }
        let mut position = [0.0, 0.0, 10.0];
        if most[0][0].is_finite() {
            let distance = [0, 1].map(|c| 0.5 * (most[c][0] + most[c][1]) / half[c]);
            position = [0.5 * (most[0][0] - most[0][1]), 0.5 * (most[1][0] - most[1][1]), distance[0].max(distance[1])];
            // A single point still needs some distance.
            position[2] = position[2].max(points().map(|p| dot(*p, back)).fold(f64::NEG_INFINITY, f64::max) + 0.1);
            // Along the side that has room, as much of it on the left as on the right.
            for c in 0..2 {
                for _ in 0..CENTERING_ROUNDS {
                    let slope = |p: &V3| (dot(*p, axes[c]) - position[c]) / (position[2] - dot(*p, back));
                    let (lo, hi) = points()
                        .map(slope)
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), s| (lo.min(s), hi.max(s)));
                    position[c] += 0.5 * (lo + hi) * position[2];
                }
            }
        }
        let eye = (0..3).fold([0.0; 3], |e, c| add(e, scale(position[c], axes[c])));
        View { eye, axes, up, focal, unit: 1.0, center: [0.0; 2] }.resized(width, height)
    }

    /// The same view of a picture with another number of samples.
    pub fn resized(self, width: usize, height: usize) -> View {
        let unit = 0.5 * width.min(height).max(1) as f64;
        View { unit, center: [0.5 * width as f64, 0.5 * height as f64], ..self }
    }

    /// Samples in a row and rows.
    pub fn size(&self) -> [usize; 2] {
        self.center.map(|c| (2.0 * c) as usize)
    }

    /// Sample coordinates and the inverse depth.
    pub fn project(&self, p: V3) -> Option<[f64; 3]> {
        let d = sub(p, self.eye);
        let depth = -dot(d, self.axes[2]);
        let s = self.focal * self.unit / depth;
        (depth > 1e-6).then(|| {
            [self.center[0] + s * dot(d, self.axes[0]), self.center[1] - s * dot(d, self.axes[1]), 1.0 / depth]
        })
    }

    /// The direction from the eye through a sample.
    pub fn ray(&self, x: f64, y: f64) -> V3 {
        let s = self.focal * self.unit;
        let (right, up) = ((x - self.center[0]) / s, (self.center[1] - y) / s);
        let across = add(scale(right, self.axes[0]), scale(up, self.axes[1]));
        direction(sub(across, self.axes[2]), scale(-1.0, self.axes[2]))
    }
}

/// Some unit vector across `a`.
pub(super) fn perpendicular(a: V3) -> V3 {
    let helper = if a[0].abs() < 0.7 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    direction(cross(helper, a), [0.0, 0.0, 1.0])
}
