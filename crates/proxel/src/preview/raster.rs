//! Which triangle is seen at each sample.

use rayon::prelude::*;

use super::vec::V3;

/// The nearest triangle at each sample.
pub(super) struct Buffer {
    pub width: usize,
    pub height: usize,
    /// The triangle, or [`NOTHING`].
    pub triangle: Vec<u32>,
    /// Its nearness: larger is nearer, 0 is nothing.
    pub nearness: Vec<f32>,
}

/// No triangle.
pub(super) const NOTHING: u32 = u32::MAX;

/// Rows that are drawn together.
const BAND: usize = 32;

impl Buffer {
    /// Draws triangles over projected vertices (sample coordinates and nearness > 0, which is linear
    /// over a triangle on screen).
    pub fn draw(width: usize, height: usize, projected: &[Option<V3>], triangles: &[[u32; 3]]) -> Buffer {
        let bands = height.div_ceil(BAND).max(1);
        let mut bins: Vec<Vec<u32>> = vec![Vec::new(); bands];
        for (i, t) in triangles.iter().enumerate() {
            let [Some(a), Some(b), Some(c)] = t.map(|v| projected[v as usize]) else { continue };
            let (lo, hi) = (a[1].min(b[1]).min(c[1]), a[1].max(b[1]).max(c[1]));
            if hi < 0.0 || lo >= height as f64 {
                continue;
            }
            let rows = (lo.max(0.0) as usize / BAND)..=((hi as usize).min(height.saturating_sub(1)) / BAND);
            rows.for_each(|band| bins[band].push(i as u32));
        }
        let mut out =
            Buffer { width, height, triangle: vec![NOTHING; width * height], nearness: vec![0.0; width * height] };
        let size = (BAND * width).max(1);
        let rows = out.triangle.par_chunks_mut(size).zip(out.nearness.par_chunks_mut(size));
        rows.zip(&bins).enumerate().for_each(|(band, ((ids, nearness), bin))| {
            for &i in bin {
                let [Some(a), Some(b), Some(c)] = triangles[i as usize].map(|v| projected[v as usize]) else {
                    continue;
                };
                fill(i, [a, b, c], band * BAND, width, ids, nearness);
            }
        });
        out
    }

    pub fn at(&self, x: usize, y: usize) -> u32 {
        self.triangle[y * self.width + x]
    }
}

/// Draws one triangle into rows that begin at `first`.
fn fill(id: u32, [a, b, c]: [V3; 3], first: usize, width: usize, ids: &mut [u32], nearness: &mut [f32]) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let rows = ids.len() / width.max(1);
    let span = |lo: f64, hi: f64, from: usize, n: usize| {
        // Samples stand in the middle of their square.
        let begin = (lo - from as f64 - 0.5).ceil().max(0.0) as usize;
        let end = (hi - from as f64 - 0.5).floor().min(n as f64 - 1.0);
        begin..if end < 0.0 { 0 } else { end as usize + 1 }
    };
    let least = |i: usize| a[i].min(b[i]).min(c[i]);
    let most = |i: usize| a[i].max(b[i]).max(c[i]);
    for y in span(least(1), most(1), first, rows) {
        let py = (first + y) as f64 + 0.5;
        for x in span(least(0), most(0), 0, width) {
            let px = x as f64 + 0.5;
            let w0 = ((b[0] - px) * (c[1] - py) - (c[0] - px) * (b[1] - py)) / area;
            let w1 = ((c[0] - px) * (a[1] - py) - (a[0] - px) * (c[1] - py)) / area;
            let w2 = 1.0 - w0 - w1;
            if w0 < 0.0 || w1 < 0.0 || w2 < 0.0 {
                continue;
            }
            let z = (w0 * a[2] + w1 * b[2] + w2 * c[2]) as f32;
            if z > nearness[y * width + x] {
                nearness[y * width + x] = z;
                ids[y * width + x] = id;
            }
        }
    }
}
