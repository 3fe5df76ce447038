//! Conservative rasterisation: every cell that a closed shape meets is set.

use super::bitmap::{Bitmap, Run};
use super::chart::Prepared;
use super::hull::P2;

/// The cells of a chart at some scale, in one of its four positions.
pub(super) struct Mask {
    /// Cells that the chart meets.
    pub solid: Bitmap,
    /// Cells that points closer to it than the padding meet; rows and columns begin `margin`
    /// cells before those of `solid`.
    pub grown: Vec<Run>,
    /// The area of the chart's cells.
    pub height: usize,
    pub width: usize,
}

/// What rounding may move a boundary by, in cells: coordinates are below 2^13 cells, whose last bit is 2^-40.
const ROUNDING: f64 = 1e-9;

/// The number of cells that a length takes, at least one.
fn cells(length: f64) -> usize {
    (length + 2.0 * ROUNDING).ceil().max(1.0) as usize
}

/// The chart and what is within `radius` cells of it, with `per_unit` cells in a unit of its length. `margin` is at
/// least `radius` + 1. Turned by 0, 90, 180 and 270 degrees, or by 0 only.
pub(super) fn masks(chart: &Prepared, per_unit: f64, radius: f64, margin: usize, rotate: bool) -> Vec<Mask> {
    let size = chart.size.map(|s| cells(s * per_unit));
    let mut solid = Bitmap::new(size[0], size[1]);
    let mut grown = Bitmap::new(size[0] + 2 * margin, size[1] + 2 * margin);
    let at = |v: u32| chart.points[v as usize].map(|c| c * per_unit);
    let mut strips = Strips::default();
    let shift = margin as i64;
    for t in &chart.triangles {
        strips.triangle(t.map(at));
        for (y, lo, hi) in strips.spans() {
            // What sticks out by rounding belongs to the last cell.
            let (y, lo, hi) = (y.clamp(0, size[1] as i64 - 1), lo.max(0), hi.min(size[0] as i64 - 1));
            solid.set(y, lo, hi);
            grown.set(y + shift, lo + shift, hi + shift);
        }
    }
    for e in &chart.outline {
        let [a, b] = e.map(|v| at(v).map(|c| c + margin as f64));
        strips.capsule(a, b, radius);
        strips.spans().for_each(|(y, lo, hi)| grown.set(y, lo, hi));
    }
    let mut out = Vec::with_capacity(4);
    for _ in 0..if rotate { 4 } else { 1 } {
        let next = (solid.turned(), grown.turned());
        out.push(Mask { width: solid.width, height: solid.height, solid, grown: grown.runs() });
        (solid, grown) = next;
    }
    out
}

/// The extent of a convex shape in each row of cells that it meets.
#[derive(Default)]
struct Strips {
    first: i64,
    extents: Vec<[f64; 2]>,
}

impl Strips {
    fn begin(&mut self, bottom: f64, top: f64) {
        self.first = (bottom - ROUNDING).floor() as i64;
        let last = (top + ROUNDING).floor() as i64;
        self.extents.clear();
        self.extents.resize((last - self.first + 1) as usize, [f64::INFINITY, f64::NEG_INFINITY]);
    }

    fn spans(&self) -> impl Iterator<Item = (i64, i64, i64)> {
        let span = |(i, e): (usize, &[f64; 2])| {
            let cell = |x: f64| x.floor() as i64;
            (e[0] <= e[1]).then(|| (self.first + i as i64, cell(e[0] - ROUNDING), cell(e[1] + ROUNDING)))
        };
        self.extents.iter().enumerate().filter_map(span)
    }

    fn triangle(&mut self, p: [P2; 3]) {
        let [a, b, c] = p;
        self.begin(a[1].min(b[1]).min(c[1]), a[1].max(b[1]).max(c[1]));
        for (a, b) in [(a, b), (b, c), (c, a)] {
            let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
            let row = |y: f64| y.floor() as i64 - self.first;
            let rows = row(low[1] - ROUNDING)..=row(high[1] + ROUNDING);
            let (left, right) = (low[0].min(high[0]), low[0].max(high[0]));
            let rise = high[1] - low[1];
            if rise < 4.0 * ROUNDING {
                for i in rows {
                    let e = &mut self.extents[i as usize];
                    *e = [e[0].min(left), e[1].max(right)];
                }
                continue;
            }
            let across = |y: f64| (low[0] + (y - low[1]) / rise * (high[0] - low[0])).clamp(left, right);
            let (begin, end) = (*rows.start(), *rows.end());
            for i in rows {
                // The part of the edge within the row, ends included.
                let y = (self.first + i) as f64;
                let x0 = if i == begin { low[0] } else { across(y) };
                let x1 = if i == end { high[0] } else { across(y + 1.0) };
                let e = &mut self.extents[i as usize];
                *e = [e[0].min(x0).min(x1), e[1].max(x0).max(x1)];
            }
        }
    }

    /// All points within `radius` of a segment.
    fn capsule(&mut self, a: P2, b: P2, radius: f64) {
        let (a, b) = if a[1] <= b[1] { (a, b) } else { (b, a) };
        let d = [b[0] - a[0], b[1] - a[1]];
        let length = d[0].hypot(d[1]);
        // The sides of the capsule are the segment moved across itself, to the right by this.
        let across = if length > 0.0 { [radius * d[1] / length, -radius * d[0] / length] } else { [0.0; 2] };
        let [bottom, top] = [a[1] - radius, b[1] + radius];
        self.begin(bottom, top);
        // The extent at height y, by the two discs and the two sides.
        let at = |y: f64| {
            let mut e = [f64::INFINITY, f64::NEG_INFINITY];
            let mut add = |x: f64| e = [e[0].min(x), e[1].max(x)];
            for p in [a, b] {
                let h2 = radius * radius - (y - p[1]) * (y - p[1]);
                if h2 >= 0.0 {
                    add(p[0] - h2.sqrt());
                    add(p[0] + h2.sqrt());
                }
            }
            for side in [1.0, -1.0] {
                let (x, low) = (a[0] + side * across[0], a[1] + side * across[1]);
                let t = if d[1] > 0.0 { (y - low) / d[1] } else { 2.0 };
                if (0.0..=1.0).contains(&t) {
                    add(x + t * d[0]);
                }
            }
            e
        };
        for i in 0..self.extents.len() {
            let y = (self.first + i as i64) as f64;
            // The right side is a concave function of y and the left one convex: their extremes are in the ends of
            // the row, or at the height of an end of the segment.
            let heights = [y.clamp(bottom, top), (y + 1.0).clamp(bottom, top), a[1], b[1]];
            for h in heights.into_iter().filter(|h| (y - ROUNDING..=y + 1.0 + ROUNDING).contains(h)) {
                let e = at(h);
                self.extents[i] = [self.extents[i][0].min(e[0]), self.extents[i][1].max(e[1])];
            }
        }
    }
}
