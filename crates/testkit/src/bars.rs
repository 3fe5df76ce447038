//! The stacked bars of Zhang et al. 2019, Figures 2 and 3, of any size.

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

/// Corners of the tetrahedra of a cube; corner c stands at (c & 1, c >> 1 & 1, c >> 2).
const CUBE: [[usize; 4]; 5] = [[7, 4, 1, 5], [4, 1, 2, 7], [4, 7, 2, 6], [1, 2, 7, 3], [4, 2, 1, 0]];

/// `count` bars of `cells` cubes with the given edge, centred in x and z, `apart` from centre to centre in y.
pub fn bars(count: usize, cells: [usize; 3], edge: f64, apart: f64) -> Bars {
    let [nx, ny, nz] = cells;
    let n = (nx + 1) * (ny + 1) * (nz + 1);
    let place = |v: usize| {
        let (bar, v) = (v / n, v % n);
        let at = |i: usize, n: usize| edge * (i as f64 - 0.5 * n as f64);
        let (i, j, k) = (v % (nx + 1), v / (nx + 1) % (ny + 1), v / ((nx + 1) * (ny + 1)));
        [at(i, nx), at(j, ny) + apart * (0.5 * (count - 1) as f64 - bar as f64), at(k, nz)]
    };
    let is_held = |v: &usize| matches!(v % (nx + 1), i if i == 0 || i == nx);
    let mut order: Vec<usize> = (0..count * n).collect();
    order.sort_by_key(|v| (is_held(v), *v));
    let mut number = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, v)| number[*v] = place as u32);
    let mut tets = vec![Vec::new(); count];
    for (bar, tets) in tets.iter_mut().enumerate() {
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    let corner = |c: usize| {
                        let (x, y, z) = (i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                        number[bar * n + x + (nx + 1) * (y + (ny + 1) * z)]
                    };
                    tets.extend(CUBE.map(|tet| tet.map(corner)));
                }
            }
        }
    }
    let n_free = order.iter().filter(|v| !is_held(v)).count();
    Bars { vertices: order.iter().map(|v| place(*v)).collect(), n_free, tets }
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
        let bars = bars(3, [12, 3, 3], 1.0 / 3.0, 1.75);
        assert_eq!((bars.vertices.len(), bars.n_free), (624, 624 - 96));
        assert!(bars.tets.iter().all(|tets| tets.len() == 540));
        // Theirs are of 32-bit coordinates.
        assert!((bars.mean_edge() - 0.410_998_375_1).abs() < 1e-8, "{}", bars.mean_edge());
        let masses = bars.masses(1522.0);
        assert!((masses.iter().sum::<f64>() - 3.0 * 6088.0).abs() < 1e-8 && masses.iter().all(|m| *m > 0.0));
        assert!((bars.vertices[0][1] - (1.75 - 0.5)).abs() < 1e-12);
    }
}
