//! A group of triangles seen from afar: its field as a Taylor series around a centre.

use crate::vec3::{V3, add, cross, dot, norm, scale, sub};
use std::f64::consts::PI;

/// Moments of the normals n of a group of triangles over its area, d the way from the centre p: what w needs where r =
/// p - q is long against d. With F(x) = (x - q)/|x - q|^3 and w = 1/(4 pi) int n . F,
///
/// ```text
/// n_i   = int n_i            F_i                 = r_i/r^3
/// m_ij  = int n_i d_j        d_j F_i             = delta_ij/r^3 - 3 r_i r_j/r^5
/// t_ijk = int n_i d_j d_k    d_k d_j F_i         = -3 (delta_ij r_k + delta_jk r_i + delta_ki r_j)/r^5 + 15 r_i r_j r_k/r^7
/// w     = 1/(4 pi) (n . F + m : dF + 1/2 t : ddF)
/// ```
///
/// Barill et al. 2018, equations 8 to 13. F is a gradient of a harmonic function, so only the symmetric parts count.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments {
    center: V3,
    radius: f64,  // of the ball around the centre that holds all corners
    n: V3,        // int n
    m: [f64; 6],  // sym(m): xx yy zz yz zx xy
    trace: f64,   // m_ii
    t: [f64; 10], // sym(t): xxx yyy zzz, then xxy xxz yyx yyz zzx zzy, then xyz
    t_trace: V3,  // sym(t)_ijj
}

impl Moments {
    /// Of these triangles; the centre is that of their area.
    pub fn of(triangles: &[[V3; 3]]) -> Moments {
        let mut out = Moments::default();
        let (mut sum, mut area) = ([0.0; 3], 0.0);
        for t in triangles {
            let a = norm(cross(sub(t[1], t[0]), sub(t[2], t[0])));
            area += a;
            sum = add(sum, scale(a / 3.0, add(t[0], add(t[1], t[2]))));
        }
        out.center = match area > 0.0 {
            true => scale(1.0 / area, sum),
            false => triangles.first().map_or([0.0; 3], |t| t[0]),
        };
        for t in triangles {
            out.add(t.map(|v| sub(v, out.center)));
        }
        let [xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, _] = out.t;
        out.t_trace = [xxx + yyx + zzx, yyy + xxy + zzy, zzz + xxz + yyz];
        out
    }

    fn add(&mut self, d: [V3; 3]) {
        // int n = the area vector; int n d = n c; int n d d^T = n (sum d d^T + 9 c c^T) / 12, c the centroid.
        let n = scale(0.5, cross(sub(d[1], d[0]), sub(d[2], d[0])));
        let c = scale(1.0 / 3.0, add(d[0], add(d[1], d[2])));
        let second = |j: usize, k: usize| (d.iter().map(|v| v[j] * v[k]).sum::<f64>() + 9.0 * c[j] * c[k]) / 12.0;
        self.n = add(self.n, n);
        self.trace += dot(n, c);
        for (slot, (i, j)) in [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            self.m[slot] += 0.5 * (n[i] * c[j] + n[j] * c[i]);
        }
        let mut x = [[0.0; 3]; 3];
        for (j, row) in x.iter_mut().enumerate() {
            for (k, entry) in row.iter_mut().enumerate() {
                *entry = second(j, k);
            }
        }
        for i in 0..3 {
            self.t[i] += n[i] * x[i][i];
        }
        for (slot, (i, j)) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)].into_iter().enumerate() {
            self.t[3 + slot] += (2.0 * n[i] * x[i][j] + n[j] * x[i][i]) / 3.0;
        }
        self.t[9] += (n[0] * x[1][2] + n[1] * x[2][0] + n[2] * x[0][1]) / 3.0;
        self.radius = d.iter().fold(self.radius, |r, &v| r.max(norm(v)));
    }

    /// w of the group at q, where q is more than `ratio` radii away from the centre.
    pub fn seen_from(&self, q: V3, ratio: f64) -> Option<f64> {
        let r = sub(self.center, q);
        let r2 = dot(r, r);
        let near = ratio * self.radius;
        if r2.is_nan() || r2 <= near * near {
            return None;
        }
        let inverse = 1.0 / r2;
        let (i3, i5) = (inverse * inverse.sqrt(), inverse * inverse * inverse.sqrt());
        let [x, y, z] = r;
        let m = &self.m;
        let mrr = m[0] * x * x + m[1] * y * y + m[2] * z * z + 2.0 * (m[3] * y * z + m[4] * z * x + m[5] * x * y);
        let t = &self.t;
        let trrr = t[0] * x * x * x
            + t[1] * y * y * y
            + t[2] * z * z * z
            + 3.0 * (x * x * (t[3] * y + t[4] * z) + y * y * (t[5] * x + t[6] * z) + z * z * (t[7] * x + t[8] * y))
            + 6.0 * t[9] * x * y * z;
        let first = dot(self.n, r) * i3;
        let second = self.trace * i3 - 3.0 * mrr * i5;
        let third = 0.5 * (15.0 * trrr * i5 * inverse - 9.0 * dot(self.t_trace, r) * i5);
        Some((first + second + third) / (4.0 * PI))
    }
}
