//! The colour of each sample.

use super::color::{blend, to_byte, to_linear};
use super::light::{GroundLight, ShadowMap, sky};
use super::raster::{Buffer, NOTHING};
use super::vec::{V3, add, cross, direction, dot, scale, sub};
use super::{Body, Style, View};

/// Everything that is known before the samples are coloured.
pub(super) struct Shader<'a> {
    body: &'a Body,
    view: View,
    buffer: Buffer,
    key: ShadowMap,
    open: Vec<f32>, // the part of the sky that each vertex sees
    to_key: V3,
    to_fill: V3,
    ground: Option<Ground>,
    background: [[f32; 3]; 2], // linear
}

/// The plane below the body.
struct Ground {
    plane: Plane,
    sky: GroundLight,
    key: GroundLight,
}

struct Plane {
    height: f64,   // along up
    axes: [V3; 2], // in the plane
    middle: V3,    // of the body, on the plane
}

/// Half the edge of the square of ground that light is worked out for.
const GROUND_REACH: f64 = 2.6;
/// Texels of the key light's shadow map along each side.
const KEY_TEXELS: usize = 2048;
/// Cells of the ground along each side for the key light, whose shadow has softer edges there:
/// PENUMBRA texels to each side.
const KEY_CELLS: usize = 480;
const PENUMBRA: i64 = 12;
// Linear light.
const KEY: [f32; 3] = [2.15, 2.0, 1.8];
const FILL: [f32; 3] = [0.16, 0.2, 0.28];
const ZENITH: [f32; 3] = [0.62, 0.68, 0.76];
const BOUNCE: [f32; 3] = [0.34, 0.31, 0.28];

impl<'a> Shader<'a> {
    pub fn new(body: &'a Body, view: &View, style: &Style) -> Self {
        let size = view.size();
        let projected: Vec<Option<V3>> = body.points.iter().map(|&p| view.project(p)).collect();
        let buffer = Buffer::draw(size[0], size[1], &projected, &body.triangles);
        // The lights stand fixed beside the camera, the key light high on the left.
        let [right, _, back] = view.axes;
        let up = view.up;
        let flat = direction(cross(right, up), back);
        let toward = |x: f64, y: f64, z: f64| direction(add(scale(x, right), add(scale(y, up), scale(z, flat))), up);
        let to_key = toward(-0.75, 1.5, 0.6);
        let plane = Plane::below(body, right, up);
        let (open, sky) = sky(body, up, |u, v| plane.point(u, v));
        let key = ShadowMap::new(body, to_key, KEY_TEXELS);
        let ground = style.ground.then(|| {
            let key = GroundLight::new(KEY_CELLS, |u, v| key.lit(plane.point(u, v), 0.004, PENUMBRA));
            Ground { plane, sky, key }
        });
        Shader {
            key,
            to_key,
            to_fill: toward(0.9, 0.25, 0.6),
            body,
            view: *view,
            buffer,
            open,
            ground,
            background: style.background.map(|c| c.map(to_linear)),
        }
    }

    /// A row of pixels, each the mean of `samples` x `samples` samples.
    pub fn row(&self, y: usize, width: usize, samples: usize) -> Vec<[u8; 3]> {
        let part = 1.0 / (samples * samples) as f32;
        let pixel = |x: usize| {
            let mut sum = [0.0; 3];
            for j in 0..samples {
                for i in 0..samples {
                    let c = self.sample(x * samples + i, y * samples + j);
                    (0..3).for_each(|k| sum[k] += part * c[k]);
                }
            }
            sum.map(to_byte)
        };
        (0..width).map(pixel).collect()
    }

    fn sample(&self, x: usize, y: usize) -> [f32; 3] {
        let ray = self.view.ray(x as f64 + 0.5, y as f64 + 0.5);
        match self.buffer.at(x, y) {
            NOTHING => self.behind(ray, (y as f32 + 0.5) / self.buffer.height as f32),
            i => self.surface(i as usize, ray),
        }
    }

    /// The background and the ground, which has its colour but for the shadows.
    fn behind(&self, ray: V3, t: f32) -> [f32; 3] {
        let color = blend(self.background[0], self.background[1], t);
        let Some(ground) = &self.ground else { return color };
        let down = -dot(ray, self.view.up);
        if down < 1e-3 {
            return color;
        }
        let distance = (dot(self.view.eye, self.view.up) - ground.plane.height) / down;
        if distance <= 0.0 {
            return color;
        }
        let p = add(self.view.eye, scale(distance, ray));
        let (u, v) = ground.plane.coordinates(p);
        // Shadows fade out toward the end of what is known.
        let edge = u.abs().max(v.abs()) as f32;
        let fade = 1.0 - smooth((edge - 0.7) / 0.3);
        let (sky, key) = (ground.sky.at(u, v), ground.key.at(u, v));
        let dark = 0.50 * (1.0 - sky) + 0.26 * (1.0 - key);
        let tint = [1.0, 0.97, 0.92]; // shadows are a little blue
        [0, 1, 2].map(|k| color[k] * (1.0 - fade * dark * tint[k]))
    }

    fn surface(&self, i: usize, ray: V3) -> [f32; 3] {
        let t = self.body.triangles[i];
        let [a, b, c] = t.map(|v| self.body.points[v as usize]);
        let w = barycentric(self.view.eye, ray, a, b, c);
        let mix = |f: &dyn Fn(usize) -> f32| (0..3).map(|k| w[k] as f32 * f(k)).sum::<f32>();
        let p = (0..3).fold([0.0; 3], |p, k| add(p, scale(w[k], [a, b, c][k])));
        let n = self.body.normals[i];
        let mut n = direction((0..3).fold([0.0; 3], |s, k| add(s, scale(w[k], n[k]))), scale(-1.0, ray));
        if dot(n, ray) > 0.0 {
            n = scale(-1.0, n); // both sides are drawn
        }
        let albedo = self.body.albedo(i, w);
        let open = mix(&|j| self.open[t[j] as usize]).clamp(0.0, 1.0);

        let up = dot(n, self.view.up) as f32;
        let cosine = dot(n, self.to_key) as f32;
        let lit = if cosine > 0.0 { self.key.lit(add(p, scale(0.008, n)), 0.008, 3) } else { 0.0 };
        // Wrapped a little around the edge of light, as on skin.
        let key = lit * smooth_edge(cosine);
        let fill = (dot(n, self.to_fill) as f32).max(0.0) * open;
        let half = direction(sub(self.to_key, ray), n);
        let gloss = lit * (dot(n, half) as f32).max(0.0).powi(48) * 0.32;
        let grazing = (1.0 + dot(n, ray) as f32).clamp(0.0, 1.0);
        let rim = grazing.powi(4) * 0.22 * open;
        [0, 1, 2].map(|k| {
            let ambient = blend(BOUNCE, ZENITH, 0.5 + 0.5 * up)[k] * open;
            let light = 0.5 * KEY[k] * key + FILL[k] * fill + ambient;
            roll_off(albedo[k] * light + gloss + rim * ZENITH[k])
        })
    }
}

impl Plane {
    fn below(body: &Body, right: V3, up: V3) -> Plane {
        let finite = || body.points.iter().filter(|p| p.iter().all(|c| c.is_finite()));
        let lowest = finite().map(|&p| dot(p, up)).fold(f64::INFINITY, f64::min);
        let height = if lowest.is_finite() { lowest - 0.01 } else { -1.0 };
        Plane { height, axes: [right, cross(up, right)], middle: scale(height, up) }
    }

    /// The point of the ground at (u, v) in [-1, 1]^2.
    fn point(&self, u: f64, v: f64) -> V3 {
        let across = add(scale(u * GROUND_REACH, self.axes[0]), scale(v * GROUND_REACH, self.axes[1]));
        add(self.middle, across)
    }

    fn coordinates(&self, p: V3) -> (f64, f64) {
        let d = sub(p, self.middle);
        (dot(d, self.axes[0]) / GROUND_REACH, dot(d, self.axes[1]) / GROUND_REACH)
    }
}

/// Where the ray meets the plane of the triangle, clamped to the triangle's sides.
fn barycentric(eye: V3, ray: V3, a: V3, b: V3, c: V3) -> [f64; 3] {
    // Moeller and Trumbore 1997.
    let (e1, e2) = (sub(b, a), sub(c, a));
    let h = cross(ray, e2);
    let det = dot(e1, h);
    if det == 0.0 {
        return [1.0 / 3.0; 3];
    }
    let s = sub(eye, a);
    let u = dot(s, h) / det;
    let v = dot(ray, cross(s, e1)) / det;
    let w = [1.0 - u - v, u, v].map(|x| x.clamp(0.0, 1.0));
    let sum: f64 = w.iter().sum();
    if sum > 0.0 { w.map(|x| x / sum) } else { [1.0 / 3.0; 3] }
}

/// 0 below 0, 1 above 1, smooth between.
fn smooth(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// max(x, 0), but rounded near 0 so that the edge of light is no line.
fn smooth_edge(x: f32) -> f32 {
    const W: f32 = 0.12;
    if x > W {
        x
    } else if x < -W {
        0.0
    } else {
        (x + W) * (x + W) / (4.0 * W)
    }
}

/// Bright light is compressed instead of cut off.
fn roll_off(x: f32) -> f32 {
    const KNEE: f32 = 0.7;
    if x <= KNEE { x } else { KNEE + (1.0 - KNEE) * (1.0 - (-(x - KNEE) / (1.0 - KNEE)).exp()) }
}
