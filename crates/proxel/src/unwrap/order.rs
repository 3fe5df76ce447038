//! Vertices of a chart as the solver numbers them.

use super::flat::Flat;
use proxel_model::elements::morton;

/// Vertices of a chart as the solver has them: fixed ones last, each kind along a space-filling curve.
#[derive(Clone)]
pub(super) struct Order {
    pub number: Vec<u32>, // of each vertex
    pub n_free: usize,
    pub between: usize, // the first number that is left out for other nodes
}

impl Order {
    /// Of nothing.
    pub fn none() -> Self {
        Order { number: Vec::new(), n_free: 0, between: 0 }
    }

    pub fn new(chart: &Flat<'_>, fixed: &[u32]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in chart.points {
            for d in 0..3 {
                (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
            }
        }
        let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        let mut is_fixed = vec![false; chart.points.len()];
        for v in fixed {
            is_fixed[*v as usize] = true;
        }
        let mut keyed: Vec<(bool, u64, u32)> =
            (0..chart.points.len()).map(|v| (is_fixed[v], morton(chart.points[v], low, size), v as u32)).collect();
        keyed.sort_unstable();
        let mut number = vec![0; keyed.len()];
        for (place, (_, _, v)) in keyed.iter().enumerate() {
            number[*v as usize] = place as u32;
        }
        let n_free = chart.points.len() - fixed.len();
        Order { number, n_free, between: n_free }
    }

    /// With so many other nodes between the free and the fixed ones.
    pub fn with_between(&self, nodes: usize) -> Self {
        let moved = |at: &u32| if (*at as usize) < self.between { *at } else { *at + nodes as u32 };
        Order { number: self.number.iter().map(moved).collect(), ..self.clone() }
    }

    pub fn solver(&self, uv: &[[f64; 2]]) -> Vec<f64> {
        let nodes = self.number.iter().max().map_or(0, |last| *last as usize + 1);
        let mut x = vec![0.0; 2 * nodes];
        for (uv, at) in uv.iter().zip(&self.number) {
            x[2 * *at as usize..][..2].copy_from_slice(uv);
        }
        x
    }

    /// The triangles, in the solver's numbers.
    pub fn elements(&self, chart: &Flat<'_>) -> Vec<u32> {
        chart.triangles.iter().flatten().map(|v| self.number[*v as usize]).collect()
    }

    pub fn user(&self, x: &[f64]) -> Vec<[f64; 2]> {
        self.number.iter().map(|at| [x[2 * *at as usize], x[2 * *at as usize + 1]]).collect()
    }
}

/// The vertex nearest to the middle of the map's bounding box: what is held, since a map can be anywhere.
pub(super) fn middle(uv: &[[f64; 2]]) -> usize {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in uv {
        for d in 0..2 {
            (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
        }
    }
    let distance = |p: &[f64; 2]| (0..2).map(|d| (p[d] - 0.5 * (low[d] + high[d])).powi(2)).sum::<f64>();
    (0..uv.len()).min_by(|a, b| distance(&uv[*a]).total_cmp(&distance(&uv[*b]))).unwrap_or(0)
}
