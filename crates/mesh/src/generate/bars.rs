//! The stacked bars of Zhang et al. 2019, Figures 2 and 3, of any size.

use super::{CellSplit, beam};
use crate::error::Result;

/// Bars of cubes, each cube in five tetrahedra in the same way, so that the diagonals on faces between cubes do not match.
/// Both ends of each are held.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Positions at rest, those of free vertices first.
    pub vertices: Vec<[f64; 3]>,
    /// Number of free vertices.
    pub n_free: usize,
    /// Vertices of the tetrahedra of each bar.
    pub tets: Vec<Vec<[u32; 4]>>,
}

/// `count` bars of `cells` cubes with the given edge, centred in x and z, `apart` from centre to centre in y.
///
/// # Errors
/// As [`super::beam`].
pub fn bars(count: usize, cells: [usize; 3], edge: f64, apart: f64) -> Result<Bars> {
    let one = beam(cells, cells.map(|n| edge * n as f64), CellSplit::FiveAlike)?;
    let n = one.points.len();
    let along = cells[0] + 1;
    let is_held = |v: &usize| matches!(v % along, i if i == 0 || i + 1 == along); // x is the fastest
    let mut order: Vec<usize> = (0..count * n).collect();
    order.sort_by_key(|v| (is_held(&(v % n)), *v));
    let mut number = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, v)| number[*v] = place as u32);
    let of_bar = |bar: usize| one.tets.iter().map(|tet| tet.map(|v| number[bar * n + v as usize])).collect();
    let place = |v: &usize| {
        let [x, y, z] = one.points[v % n];
        [x, y + apart * (0.5 * (count - 1) as f64 - (v / n) as f64), z]
    };
    Ok(Bars {
        vertices: order.iter().map(place).collect(),
        n_free: order.iter().filter(|v| !is_held(&(*v % n))).count(),
        tets: (0..count).map(of_bar).collect(),
    })
}

impl Bars {
    /// The mean length of the edges, each counted once.
    pub fn mean_edge(&self) -> f64 {
        let mut edges: Vec<(u32, u32)> = Vec::new();
        for tet in self.tets.iter().flatten() {
            for a in 0..4 {
                for b in 0..a {
                    edges.push((tet[a].min(tet[b]), tet[a].max(tet[b])));
                }
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let length = |(a, b): &(u32, u32)| {
            let (a, b) = (self.vertices[*a as usize], self.vertices[*b as usize]);
            (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
        };
        edges.iter().map(length).sum::<f64>() / edges.len() as f64
    }

    /// A quarter of the mass of its tetrahedra for each vertex.
    pub fn masses(&self, density: f64) -> Vec<f64> {
        let mut masses = vec![0.0; self.vertices.len()];
        for tet in self.tets.iter().flatten() {
            let [a, b, c, d] = tet.map(|v| self.vertices[v as usize]);
            let edge = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
            let (u, v, w) = (edge(b), edge(c), edge(d));
            let cross = [v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]];
            let volume = (u[0] * cross[0] + u[1] * cross[1] + u[2] * cross[2]) / 6.0;
            tet.iter().for_each(|v| masses[*v as usize] += density * volume / 4.0);
        }
        masses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bars_of_the_paper() {
        let bars = bars(3, [12, 3, 3], 1.0 / 3.0, 1.75).unwrap();
        assert_eq!((bars.vertices.len(), bars.n_free), (624, 624 - 96));
        assert!(bars.tets.iter().all(|tets| tets.len() == 540));
        // Theirs are of 32-bit coordinates.
        assert!((bars.mean_edge() - 0.410_998_375_1).abs() < 1e-8, "{}", bars.mean_edge());
        let masses = bars.masses(1522.0);
        assert!((masses.iter().sum::<f64>() - 3.0 * 6088.0).abs() < 1e-8 && masses.iter().all(|m| *m > 0.0));
        assert!((bars.vertices[0][1] - (1.75 - 0.5)).abs() < 1e-12);
    }
}
