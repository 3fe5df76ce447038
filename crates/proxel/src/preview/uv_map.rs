//! The picture of a UV map.

use rayon::prelude::*;

use super::Image;
use super::color::{blend, to_byte, to_linear};
use super::distortion::{FLIPPED, stretch_color};
use super::lines::Layer;
use super::raster::{Buffer, NOTHING};

type P2 = [f64; 2];

/// A map to be drawn, by triangles.
#[derive(Clone, Copy, Debug)]
pub struct UvPicture<'a> {
    /// The triangles by vertices of the surface: where two of them meet at an edge but not in the plane, is a seam.
    pub triangles: &'a [[u32; 3]],
    /// The coordinates of the corners of each triangle.
    pub uv: &'a [[[f64; 2]; 3]],
    /// The stretch of each triangle (see [`stretches`](super::stretches)); missing ones are grey.
    pub stretch: &'a [f64],
    /// Whether the map lies in the unit square, which is then drawn around it.
    pub unit_square: bool,
}

/// Samples of a pixel along each side.
const SAMPLES: usize = 3;
/// The part of the picture that is left free on each side.
const MARGIN: f64 = 0.035;
/// Half the widths of lines, in pixels.
const LINE: f64 = 0.7;
/// Where flipped triangles are too small to be seen, a dot of this radius in pixels is.
const DOT: f64 = 3.0;
const PAPER: [f32; 3] = [1.0; 3];
const SQUARE: [f32; 3] = [0.97, 0.97, 0.98];
const SQUARE_EDGE: [f32; 3] = [0.72, 0.73, 0.76];
const BORDER: [f32; 3] = [0.16, 0.16, 0.18];
const SEAM: [f32; 3] = [0.0, 0.42, 0.24];

/// Draws a map: triangles coloured by their stretch ([`stretch_color`]), the flipped ones above all others, seams
/// green and borders of the surface black.
pub fn draw_uv_map(map: &UvPicture<'_>, width: usize, height: usize) -> Image {
    let view = View::around(map, width, height);
    let s = SAMPLES as f64;
    let finite = |uv: &[P2; 3]| uv.iter().flatten().all(|c| c.is_finite());
    let flipped = |i: usize| map.stretch.get(i).is_some_and(|&s| s <= 0.0);
    let mut corners = Vec::with_capacity(3 * map.uv.len());
    let mut triangles = Vec::with_capacity(map.uv.len());
    let mut shown = Vec::with_capacity(map.uv.len()); // the number in `map` of each triangle that is drawn
    let mut dots = Vec::new();
    for (i, uv) in map.uv.iter().enumerate().filter(|(_, uv)| finite(uv)) {
        let p = uv.map(|p| view.pixel(p));
        let first = corners.len() as u32;
        triangles.push([first, first + 1, first + 2]);
        shown.push(i);
        let nearness = if flipped(i) { 2.0 } else { 1.0 };
        corners.extend(p.map(|p| Some([s * p[0], s * p[1], nearness])));
        let extent = |c: usize| p.iter().fold(0.0, |m: f64, q| m.max((q[c] - p[0][c]).abs()));
        if flipped(i) && extent(0).max(extent(1)) < 2.0 * DOT {
            dots.push([0, 1].map(|c| (p[0][c] + p[1][c] + p[2][c]) / 3.0));
        }
    }
    let buffer = Buffer::draw(SAMPLES * width, SAMPLES * height, &corners, &triangles);
    let square = map.unit_square.then(|| [view.pixel([0.0, 1.0]), view.pixel([1.0, 0.0])]);
    let [mut seams, mut borders, mut frame, mut marks] = [(); 4].map(|()| Layer::new(width, height));
    for (segment, seam) in open_edges(map.triangles, map.uv) {
        let [a, b] = segment.map(|p| view.pixel(p));
        if seam { seams.segment(a, b, LINE) } else { borders.segment(a, b, LINE) }
    }
    if let Some([[x0, y0], [x1, y1]]) = square {
        let c = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        (0..4).for_each(|k| frame.segment(c[k], c[(k + 1) % 4], LINE));
    }
    dots.iter().for_each(|&d| marks.segment(d, d, DOT));
    let layers = [(frame, SQUARE_EDGE), (borders, BORDER), (seams, SEAM), (marks, FLIPPED)];
    let layers = layers.map(|(l, c)| (l, c.map(to_linear)));
    let sample = |x: usize, y: usize| match buffer.at(x, y) {
        NOTHING => {
            let p = [(x as f64 + 0.5) / s, (y as f64 + 0.5) / s];
            let inside = square.is_some_and(|[a, b]| (0..2).all(|c| (a[c]..b[c]).contains(&p[c])));
            if inside { SQUARE } else { PAPER }
        }
        i => map.stretch.get(shown[i as usize]).map_or([0.6; 3], |&s| stretch_color(s)),
    };
    let pixel = |x: usize, y: usize| {
        let mut sum = [0.0; 3];
        for k in 0..SAMPLES * SAMPLES {
            let c = sample(SAMPLES * x + k % SAMPLES, SAMPLES * y + k / SAMPLES).map(to_linear);
            (0..3).for_each(|i| sum[i] += c[i] / (SAMPLES * SAMPLES) as f32);
        }
        layers.iter().fold(sum, |below, (layer, color)| blend(below, *color, layer.at(x, y))).map(to_byte)
    };
    let rows: Vec<Vec<[u8; 3]>> =
        (0..height).into_par_iter().map(|y| (0..width).map(|x| pixel(x, y)).collect()).collect();
    let mut image = Image::filled(width, height, [PAPER; 2]);
    rows.iter().enumerate().for_each(|(y, row)| image.put_row(0, y, row));
    image
}

/// From the plane to pixels.
struct View {
    middle: P2,
    scale: f64,
    center: P2,
}

impl View {
    fn around(map: &UvPicture<'_>, width: usize, height: usize) -> View {
        let square: &[P2] = if map.unit_square { &[[0.0; 2], [1.0; 2]] } else { &[] };
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in map.uv.iter().flatten().chain(square).filter(|p| p.iter().all(|c| c.is_finite())) {
            for c in 0..2 {
                lo[c] = lo[c].min(p[c]);
                hi[c] = hi[c].max(p[c]);
            }
        }
        let size = [width as f64, height as f64];
        let free = size.map(|s| s - 2.0 * MARGIN * size[0].min(size[1]));
        let scale = (0..2).map(|c| free[c] / (hi[c] - lo[c])).fold(f64::INFINITY, f64::min);
        View {
            middle: [0, 1].map(|c| if lo[c] <= hi[c] { 0.5 * lo[c] + 0.5 * hi[c] } else { 0.0 }),
            scale: if scale > 0.0 && scale.is_finite() { scale } else { 1.0 },
            center: size.map(|s| 0.5 * s),
        }
    }

    fn pixel(&self, p: P2) -> P2 {
        let d = [0, 1].map(|c| self.scale * (p[c] - self.middle[c]));
        [self.center[0] + d[0], self.center[1] - d[1]]
    }
}

/// The edges in the plane that do not have two triangles which agree on it, and whether each is a seam: the surface
/// goes on beyond it. The two sides of a seam are two edges.
fn open_edges(triangles: &[[u32; 3]], uv: &[[P2; 3]]) -> Vec<([P2; 2], bool)> {
    let count = triangles.len().min(uv.len());
    let edges = (0..count).flat_map(|i| {
        (0..3).map(move |k| {
            let (a, b) = (triangles[i][k], triangles[i][(k + 1) % 3]);
            (a.min(b), a.max(b), i as u32, k as u8)
        })
    });
    let mut edges: Vec<(u32, u32, u32, u8)> = edges.collect();
    edges.par_sort_unstable();
    // From the smaller vertex to the larger one.
    let segment = |&(a, _, i, k): &(u32, u32, u32, u8)| {
        let (i, k) = (i as usize, k as usize);
        let s = [uv[i][k], uv[i][(k + 1) % 3]];
        if triangles[i][k] == a { s } else { [s[1], s[0]] }
    };
    let mut out = Vec::new();
    for around in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        match around {
            [one] => out.push((segment(one), false)),
            [one, two] if segment(one) == segment(two) => {}
            _ => out.extend(around.iter().map(|e| (segment(e), true))),
        }
    }
    out.retain(|(s, _)| s.iter().flatten().all(|c| c.is_finite()));
    out
}
