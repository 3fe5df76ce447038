//! Pressure on faces.

use proxel_split::Potential;

/// The potential -p V(x) of a pressure p on a patch of oriented triangles, V the volume between the patch and a plane with
/// unit normal n at the height h, measured along n:
///
/// ```text
/// V = sum_t (n . (a + b + c) / 3 - h) n . ((b - a) x (c - a)) / 2
/// ```
///
/// Its forces p A m / 3 on the corners of a face of area A follow the face's normal m, so that p > 0 pushes outwards.
///
/// On a closed patch V depends neither on n nor on h, and the pressure is conservative. On an open one V is that of the prism
/// over the patch: nodes inside the patch feel the pressure exactly, nodes on its border feel the prism's walls besides,
/// which have no height where the border lies in the plane, and do not matter where it is fixed. (A pressure on an open
/// patch with a free border has no potential.)
#[derive(Clone, Debug, PartialEq)]
pub struct Pressure {
    triangles: Vec<[u32; 3]>,
    pressure: f64,
    normal: [f64; 3],
    height: f64,
}

impl Pressure {
    /// On triangles that are counter-clockwise seen from where a positive pressure pushes to; `x` are positions, three
    /// numbers a node, that the plane is taken from: n along the sum of the patch's area normals, h through the mean of
    /// its border.
    pub fn new(triangles: Vec<[u32; 3]>, pressure: f64, x: &[f64]) -> Self {
        let at = |v: u32| [0, 1, 2].map(|d| x.get(v as usize * 3 + d).copied().unwrap_or(0.0));
        let mut sum = [0.0; 3];
        for t in &triangles {
            let [a, b, c] = t.map(at);
            let n = cross(minus(b, a), minus(c, a));
            sum = [0, 1, 2].map(|d| sum[d] + n[d]);
        }
        let border = Self::border(&triangles);
        let length = dot(sum, sum).sqrt();
        // On a closed patch any direction will do.
        let open = !border.is_empty() && length > 0.0;
        let normal = if open { sum.map(|v| v / length) } else { [0.0, 0.0, 1.0] };
        let height = border.iter().map(|[a, _]| dot(normal, at(*a))).sum::<f64>() / (border.len().max(1) as f64);
        Pressure { triangles, pressure, normal, height }
    }

    /// The directed edges without a partner: none on a closed patch.
    pub fn border(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> =
            triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).collect();
        edges.sort_unstable();
        let has = |e: [u32; 2]| edges.binary_search(&e).is_ok();
        edges.iter().copied().filter(|[a, b]| !has([*b, *a])).collect()
    }
}

impl Potential for Pressure {
    fn value_and_gradient(&self, x: &[f64], mut grad: Option<&mut [f64]>) -> f64 {
        let n = self.normal;
        let mut volume = 0.0;
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| [0, 1, 2].map(|d| x[v as usize * 3 + d]));
            let area = dot(n, cross(minus(b, a), minus(c, a))) / 2.0; // seen along n
            let height = (dot(n, a) + dot(n, b) + dot(n, c)) / 3.0 - self.height;
            volume += height * area;
            if let Some(grad) = grad.as_deref_mut() {
                // d area / d a = (b - c) x n / 2, and so around.
                for (v, opposite) in t.iter().zip([minus(b, c), minus(c, a), minus(a, b)]) {
                    let turned = cross(opposite, n);
                    for d in 0..3 {
                        if let Some(g) = grad.get_mut(*v as usize * 3 + d) {
                            *g -= self.pressure * (n[d] * area / 3.0 + height * turned[d] / 2.0);
                        }
                    }
                }
            }
        }
        -self.pressure * volume
    }

    fn has_hessian(&self) -> bool {
        true
    }

    /// With A the area and H the height of a triangle: -p (dH/dv dA/dw + dA/dv dH/dw + H d2A/dvdw), where dH/dv = n / 3,
    /// dA/da = (b - c) x n / 2, and d2A/dadb is the matrix of -n x . / 2.
    fn for_each_block(&self, x: &[f64], give: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        let n = self.normal;
        let turn = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]]; // of n x .
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| [0, 1, 2].map(|d| x[v as usize * 3 + d]));
            let height = (dot(n, a) + dot(n, b) + dot(n, c)) / 3.0 - self.height;
            let areas = [minus(b, c), minus(c, a), minus(a, b)].map(|opposite| cross(opposite, n).map(|v| v / 2.0));
            for (v, row) in t.iter().enumerate() {
                for (w, column) in t.iter().enumerate().filter(|(_, column)| row >= column) {
                    // The next corner's share of the area turns one way, the one before's the other.
                    let sign = [0.0, -0.5, 0.5][(w + 3 - v) % 3];
                    let mut block = [[0.0; 3]; 3];
                    for i in 0..3 {
                        for j in 0..3 {
                            let mixed = (n[i] * areas[w][j] + areas[v][i] * n[j]) / 3.0;
                            block[i][j] = -self.pressure * (mixed + height * sign * turn[i][j]);
                        }
                    }
                    give(*row as usize, *column as usize, block);
                }
            }
        }
    }

    fn n(&self) -> usize {
        self.triangles.as_flattened().iter().max().map_or(0, |v| *v as usize + 1)
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
