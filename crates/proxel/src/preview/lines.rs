//! Lines and dots with smooth edges.

/// How far each pixel is covered by lines of one colour.
pub(super) struct Layer {
    width: usize,
    height: usize,
    cover: Vec<f32>,
}

impl Layer {
    pub fn new(width: usize, height: usize) -> Self {
        Layer { width, height, cover: vec![0.0; width * height] }
    }

    /// Adds what is within `radius` of a segment, in pixels; a pixel is covered by how far its middle is inside, so
    /// that where lines meet there are no knots.
    pub fn segment(&mut self, a: [f64; 2], b: [f64; 2], radius: f64) {
        let reach = radius + 0.5;
        let d = [b[0] - a[0], b[1] - a[1]];
        let length2 = d[0] * d[0] + d[1] * d[1];
        if !length2.is_finite() {
            return;
        }
        let range = |lo: f64, hi: f64, n: usize| {
            // Casts of what is below 0 give 0.
            (lo - reach).floor().max(0.0) as usize..((hi + reach).ceil().max(0.0) as usize).min(n)
        };
        for y in range(a[1].min(b[1]), a[1].max(b[1]), self.height) {
            let py = y as f64 + 0.5 - a[1];
            // The part of the segment that comes near this row.
            let (mut x0, mut x1) = (a[0].min(b[0]), a[0].max(b[0]));
            if d[1].abs() > reach {
                let at = |h: f64| a[0] + d[0] * (h / d[1]).clamp(0.0, 1.0);
                let ends = [at(py - reach), at(py + reach)];
                (x0, x1) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            }
            for x in range(x0, x1, self.width) {
                let px = x as f64 + 0.5 - a[0];
                let t = if length2 > 0.0 { ((px * d[0] + py * d[1]) / length2).clamp(0.0, 1.0) } else { 0.0 };
                let distance = (px - t * d[0]).hypot(py - t * d[1]);
                let cover = (reach - distance).clamp(0.0, 1.0) as f32;
                let pixel = &mut self.cover[y * self.width + x];
                *pixel = pixel.max(cover);
            }
        }
    }

    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.cover[y * self.width + x]
    }
}
