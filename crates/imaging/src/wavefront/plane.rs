//! One channel of numbers and what the pyramid does with it.

use rayon::prelude::*;

/// A channel, row by row; outside it is continued by its border.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plane {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` numbers.
    pub values: Vec<f64>,
}

/// Rows that one task handles.
const ROWS: usize = 8;

impl Plane {
    /// f(row, column) everywhere.
    pub fn from_fn(width: usize, height: usize, f: impl Fn(usize, usize) -> f64 + Sync) -> Self {
        let mut values = vec![0.0; width * height];
        values.par_chunks_mut((ROWS * width).max(1)).enumerate().for_each(|(task, out)| {
            for (k, v) in out.iter_mut().enumerate() {
                *v = f(task * ROWS + k / width, k % width);
            }
        });
        Plane { width, height, values }
    }

    /// The value at a pixel, that of the nearest outside; the plane has pixels.
    #[inline]
    pub fn at(&self, row: isize, column: isize) -> f64 {
        let i = row.clamp(0, self.height as isize - 1) as usize;
        let j = column.clamp(0, self.width as isize - 1) as usize;
        self.values[i * self.width + j]
    }

    /// The same size, each value a function of where it stands.
    fn map(&self, f: impl Fn(isize, isize) -> f64 + Sync) -> Plane {
        Plane::from_fn(self.width, self.height, |i, j| f(i as isize, j as isize))
    }

    /// Least and largest value.
    pub fn range(&self) -> (f64, f64) {
        self.values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)))
    }

    /// Derivatives along the row and the column, [1 -8 0 8 -1] / 12.
    pub fn derivatives(&self) -> [Plane; 2] {
        let of = |a: f64, b: f64, c: f64, d: f64| ((a - d) - 8.0 * (b - c)) / 12.0;
        [
            self.map(|i, j| of(self.at(i, j - 2), self.at(i, j - 1), self.at(i, j + 1), self.at(i, j + 2))),
            self.map(|i, j| of(self.at(i - 2, j), self.at(i - 1, j), self.at(i + 1, j), self.at(i + 2, j))),
        ]
    }

    /// Half as many rows and columns, rounded up. Pixel i of the result lies between 2i and 2i + 1, which with one more on
    /// either side are weighed by [1 3 3 1] / 8.
    pub fn halved(&self) -> Plane {
        const WEIGHTS: [f64; 4] = [0.125, 0.375, 0.375, 0.125];
        let sum = |f: &dyn Fn(isize) -> f64| (0..4).map(|k| WEIGHTS[k] * f(k as isize - 1)).sum::<f64>();
        let narrow = Plane::from_fn(self.width.div_ceil(2), self.height, |i, j| {
            sum(&|k| self.at(i as isize, 2 * j as isize + k))
        });
        Plane::from_fn(narrow.width, self.height.div_ceil(2), |i, j| {
            sum(&|k| narrow.at(2 * i as isize + k, j as isize))
        })
    }

    /// The value between pixels by cubic convolution (Keys 1981, a = -1/2): exact for quadratic functions.
    pub fn cubic(&self, row: f64, column: f64) -> f64 {
        // Beyond this all is border; it keeps the conversion within range, and NaN goes to the border too.
        let inside = |v: f64, n: usize| v.max(-4.0).min(n as f64 + 4.0);
        let (row, column) = (inside(row, self.height), inside(column, self.width));
        let (i, j) = (row.floor(), column.floor());
        let (wi, wj) = (keys(row - i), keys(column - j));
        let (i, j) = (i as isize, j as isize);
        let mut value = 0.0;
        for (a, wi) in wi.iter().enumerate() {
            let i = i + a as isize - 1;
            let line: f64 = (0..4).map(|b| wj[b] * self.at(i, j + b as isize - 1)).sum();
            value += wi * line;
        }
        value
    }

    /// The median of each pixel and its eight neighbours.
    pub fn median(&self) -> Plane {
        self.map(|i, j| {
            let mut nine: [f64; 9] = std::array::from_fn(|k| self.at(i + k as isize / 3 - 1, j + k as isize % 3 - 1));
            *nine.select_nth_unstable_by(4, f64::total_cmp).1
        })
    }

    /// A part of it.
    pub fn cropped(&self, row: usize, column: usize, width: usize, height: usize) -> Plane {
        Plane::from_fn(width, height, |i, j| self.at((row + i) as isize, (column + j) as isize))
    }
}

/// Weights of the pixels at -1, 0, 1, 2 for a value at t in [0, 1].
fn keys(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-0.5 * t * s * s, 1.0 + t * t * (1.5 * t - 2.5), 1.0 + s * s * (1.5 * s - 2.5), -0.5 * s * t * t]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quadratic(i: f64, j: f64) -> f64 {
        0.3 * i * i - 0.2 * i * j + 0.05 * j * j + j - 2.0 * i
    }

    #[test]
    fn quadratic_functions_are_exact() {
        let plane = Plane::from_fn(12, 10, |i, j| quadratic(i as f64, j as f64));
        let [along, down] = plane.derivatives();
        assert!((along.at(4, 5) - (-0.2 * 4.0 + 0.1 * 5.0 + 1.0)).abs() < 1e-13);
        assert!((down.at(4, 5) - (0.6 * 4.0 - 0.2 * 5.0 - 2.0)).abs() < 1e-13);
        for (i, j) in [(3.0, 4.0), (3.25, 4.75), (5.999, 7.001)] {
            assert!((plane.cubic(i, j) - quadratic(i, j)).abs() < 1e-12, "{i}, {j}");
        }
        assert_eq!(plane.cubic(f64::NAN, 1e300).to_bits(), plane.cubic(-4.0, 16.0).to_bits());
    }

    #[test]
    fn half_the_size_is_the_same_picture() {
        let linear = Plane::from_fn(9, 8, |i, j| 2.0 * i as f64 - j as f64);
        let half = linear.halved();
        assert_eq!((half.width, half.height), (5, 4));
        // Pixel (1, 2) of it lies at (2.5, 4.5).
        assert!((half.at(1, 2) - (2.0 * 2.5 - 4.5)).abs() < 1e-13);
    }

    #[test]
    fn medians_drop_what_stands_alone() {
        let mut plane = Plane::from_fn(5, 5, |i, _| i as f64);
        plane.values[12] = 1e9;
        let median = plane.median();
        assert_eq!(median.at(2, 2), 2.0);
        assert_eq!((median.at(0, 0), median.at(4, 4)), (0.0, 4.0));
    }
}
