//! Pressure on faces.

use proxel_split::Potential;

/// The potential -p V(x) of a pressure p on a patch of oriented triangles, V = sum a . (b x c) / 6 the volume between the
/// patch and the point `apex`: its forces p A n / 3 on the corners of a face of area A follow the normal n, so that p > 0
/// pushes outwards.
///
/// On a closed patch V does not depend on the apex, and the pressure is conservative. On an open one V is that of the cone
/// to the apex: nodes inside the patch feel the pressure exactly, nodes on its border feel the walls of the cone besides,
/// which does not matter where the border is fixed. (A pressure on an open patch with a free border has no potential.)
#[derive(Clone, Debug, PartialEq)]
pub struct Pressure {
    triangles: Vec<[u32; 3]>,
    pressure: f64,
    apex: [f64; 3],
}

impl Pressure {
    /// On triangles that are counter-clockwise seen from where a positive pressure pushes to.
    pub fn new(triangles: Vec<[u32; 3]>, pressure: f64, apex: [f64; 3]) -> Self {
        Pressure { triangles, pressure, apex }
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
        let mut volume = 0.0;
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| [0, 1, 2].map(|d| x[v as usize * 3 + d] - self.apex[d]));
            let normals = [cross(b, c), cross(c, a), cross(a, b)]; // 6 times the derivatives of this cone's volume
            volume += (0..3).map(|d| a[d] * normals[0][d]).sum::<f64>() / 6.0;
            if let Some(grad) = grad.as_deref_mut() {
                for (v, n) in t.iter().zip(&normals) {
                    for d in 0..3 {
                        if let Some(g) = grad.get_mut(*v as usize * 3 + d) {
                            *g -= self.pressure * n[d] / 6.0;
                        }
                    }
                }
            }
        }
        -self.pressure * volume
    }

    fn n(&self) -> usize {
        self.triangles.as_flattened().iter().max().map_or(0, |v| *v as usize + 1)
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
