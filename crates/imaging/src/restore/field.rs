//! The field that is solved for, and what is seen of it.

use super::Edges;
use crate::{Blur, BlurredSquares, Boundary, Grid, ImageError, Psf, Shrinkage, TotalVariation, Window};
use std::sync::Arc;

/// The field that is solved for, and where the image lies in it.
#[derive(Clone)]
pub struct Field {
    /// Its pixels.
    pub grid: Grid,
    /// Row and column of the image's first pixel.
    pub at: (usize, usize),
    /// Columns and rows of the image that is sought.
    pub size: (usize, usize),
    /// Every so manieth of its pixels is seen, in rows and in columns.
    pub step: usize,
    /// The blur, over the field.
    pub blur: Blur,
    /// Least and largest value of what was seen; a solution lies about there.
    pub values: [f64; 2],
    /// Whether the blurred field stands behind x among the nodes.
    pub carries: bool,
    /// Whether a field of slopes stands behind these: two numbers a pixel and channel.
    pub slopes: bool,
    /// The data term, where the global step holds it.
    pub held: Option<BlurredSquares>,
    /// Rows and columns, from the first on, that what was seen depends on; none where the border is known.
    pub reach: Option<[usize; 2]>,
    /// Total variation of it, where that is what is asked of an image.
    pub variation: Option<TotalVariation>,
    /// Local cosines of it, likewise.
    pub frame: Option<Shrinkage>,
    /// Which nodes of the blurred field were measured, where the data term is one of the problem's.
    pub measured: Arc<Vec<bool>>,
}

/// The least n' >= n of the form 2^a 3^b 5^c, a > 0: transforms of such lengths are fast.
fn fast_length(n: usize) -> usize {
    let smooth = |mut n: usize| {
        for p in [2, 3, 5] {
            while n.is_multiple_of(p) {
                n /= p;
            }
        }
        n == 1
    };
    (n.max(2)..).find(|n| n.is_multiple_of(2) && smooth(*n)).unwrap_or(n)
}

impl Field {
    /// For an image of which so many pixels are sought, all of them seen under this blur.
    ///
    /// # Errors
    /// [`Edges::Neumann`] and a blur that is not symmetric.
    pub fn new(width: usize, height: usize, channels: usize, psf: &Psf, edges: Edges) -> Result<Self, ImageError> {
        let (w, h, at) = match edges {
            Edges::Periodic | Edges::Neumann => (width, height, (0, 0)),
            // Pixel i of what was seen depends on x from i - (n - 1 - c) to i + c. One more, so that opposite sides are apart.
            Edges::Unknown => (
                fast_length(width + psf.width),
                fast_length(height + psf.height),
                (psf.height - 1 - psf.center.0, psf.width - 1 - psf.center.1),
            ),
        };
        let boundary = if edges == Edges::Neumann { Boundary::Neumann } else { Boundary::Periodic };
        let blur = Blur::new(w, h, psf, boundary)?;
        let grid = Grid { width: w, height: h, channels };
        Ok(Field {
            grid,
            at,
            size: (width, height),
            step: 1,
            blur,
            values: [f64::INFINITY, f64::NEG_INFINITY],
            carries: false,
            slopes: false,
            held: None,
            reach: (edges == Edges::Unknown).then_some([height + psf.height - 1, width + psf.width - 1]),
            variation: None,
            frame: None,
            measured: Arc::default(),
        })
    }

    /// The first node of the slopes, where there are some.
    pub fn first_slope(&self) -> Option<usize> {
        self.slopes.then(|| self.grid.len() * if self.carries { 2 } else { 1 })
    }

    /// The pixels whose differences to the next ones, or to those before where `backward`, lie in what was seen: what is further
    /// away has nothing to do with the image, nor has its other side. None where all count.
    pub(super) fn window(&self, backward: bool) -> Option<Window> {
        self.reach.map(|[rows, columns]| {
            let span = |n: usize| [usize::from(backward), n.saturating_sub(1).max(usize::from(backward))];
            Window { width: self.grid.width, rows: span(rows), columns: span(columns) }
        })
    }

    /// The pixels whose surroundings of so many rows and columns, from each on, lie in what was seen; likewise.
    pub(super) fn surroundings(&self, side: usize) -> Option<Window> {
        self.reach.map(|[rows, columns]| {
            let span = |n: usize| [0, (n + 1).saturating_sub(side)];
            Window { width: self.grid.width, rows: span(rows), columns: span(columns) }
        })
    }

    /// The node of a pixel of the image.
    fn node(&self, row: usize, channel: usize, column: usize) -> usize {
        ((self.at.0 + row) * self.grid.channels + channel) * self.grid.width + self.at.1 + column
    }

    /// Planes of what was seen, put to their places in a field that is `other` elsewhere.
    pub(super) fn embed(&self, planes: &[&[f64]], other: f64) -> Vec<f64> {
        let mut field = vec![other; self.grid.len()];
        for (c, plane) in planes.iter().enumerate() {
            for (i, row) in plane.chunks_exact((self.size.0 / self.step).max(1)).enumerate() {
                let to = field[self.node(i * self.step, c, 0)..].iter_mut().step_by(self.step);
                to.zip(row).for_each(|(to, v)| *to = *v);
            }
        }
        field
    }

    /// Every `step`-th pixel of the image within a field: a plane a channel.
    fn pixels(&self, x: &[f64], step: usize) -> Vec<Vec<f64>> {
        let row = |c: usize, i: usize| x[self.node(i, c, 0)..][..self.size.0].iter().step_by(step).copied();
        let plane = |c: usize| (0..self.size.1).step_by(step).flat_map(|i| row(c, i)).collect();
        (0..self.grid.channels).map(plane).collect()
    }

    /// The image within a field: a plane a channel.
    pub fn image(&self, x: &[f64]) -> Vec<Vec<f64>> {
        self.pixels(x, 1)
    }

    /// What is seen of a field through the blur: a plane a channel.
    pub fn seen(&self, x: &[f64]) -> Vec<Vec<f64>> {
        let n = self.grid.len();
        if self.carries {
            return self.pixels(&x[n..], self.step);
        }
        let mut blurred = vec![0.0; n];
        self.blur.apply(self.grid, false, &x[..n], &mut blurred);
        self.pixels(&blurred, self.step)
    }
}
