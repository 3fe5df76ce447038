//! How forces of bending follow the rest shape.

use super::{Bending, Hinge, cross, dot, minus, norm};

type V3 = [f64; 3];

impl Bending {
    /// The derivative in the rest positions of phi = w . dE/dx, of the energy E of [`Bending::form`] with the coefficient
    /// `k`: what the forces of bending do along w. `rest`, `x` and `w` have three numbers a node; the result too.
    ///
    /// With f = 3 / A, A = A_0 + A_1, of a hinge, s(v) = sum c_i v_i and b_i = k f (x_i . s(w) + w_i . s(x))
    ///
    /// ```text
    /// phi = k f s(x) . s(w),    d phi = sum_i b_i dc_i - phi dA / A
    /// ```
    ///
    /// and for the angle between vectors a and b, with n = a x b,
    ///
    /// ```text
    /// d(2 area) = (b x n) . da / |n|,    d cot = b . da / |n| - a . b (b x n) . da / |n|^3
    /// ```
    ///
    /// and likewise in b, with n x a in the place of b x n. Edges that do not bend add nothing. Hinges are summed in their
    /// order.
    pub fn rest_sensitivity(&self, rest: &[f64], k: f64, x: &[f64], w: &[f64]) -> Vec<f64> {
        let at = |of: &[f64], v: u32| -> V3 { std::array::from_fn(|d| of[v as usize * 3 + d]) };
        let mut out = vec![0.0; rest.len()];
        for hinge in &self.hinges {
            let [rest, x, w] = [rest, x, w].map(|of| hinge.nodes.map(|v| at(of, v)));
            let found = hinge.rest_sensitivity(rest, k, x, w);
            for (v, found) in hinge.nodes.into_iter().zip(found) {
                let v = v as usize * 3;
                out[v..v + 3].iter_mut().zip(found).for_each(|(to, from)| *to += from);
            }
        }
        out
    }
}

impl Hinge {
    /// Of one hinge, for each of its nodes.
    fn rest_sensitivity(&self, rest: [V3; 4], k: f64, x: [V3; 4], w: [V3; 4]) -> [V3; 4] {
        let (sx, sw) = (self.stencil(x), self.stencil(w));
        let scale = k * self.factor;
        // d phi / d cot, in differences of b that see no translation.
        let by = |i: usize, j: usize| scale * (dot(minus(x[i], x[j]), sw) + dot(minus(w[i], w[j]), sx));
        // d phi / d(2 area) = -phi / (2 A), 1 / A = f / 3.
        let by_area = -scale * dot(sx, sw) * self.factor / 6.0;
        let mut out = [[0.0; 3]; 4];
        // The angle of a triangle at `tip`, between the vectors to `p` and to `q`.
        let mut corner = |[tip, p, q]: [usize; 3], by_cot: f64, by_area: f64| {
            let (a, b) = (minus(rest[p], rest[tip]), minus(rest[q], rest[tip]));
            let n = cross(a, b);
            let (length, along) = (norm(n), dot(a, b));
            let (in_a, in_b) = (cross(b, n), cross(n, a));
            // From n / |n|, of the sizes of a and b: |n|^3 may leave the range of numbers where |n| does not.
            let turn = by_area / length - by_cot * (along / length) / length / length;
            for d in 0..3 {
                let da = by_cot * b[d] / length + turn * in_a[d];
                let db = by_cot * a[d] / length + turn * in_b[d];
                out[p][d] += da;
                out[q][d] += db;
                out[tip][d] -= da + db;
            }
        };
        // c = (c03 + c04, c01 + c02, -c01 - c03, -c02 - c04); both areas from the corners at x_0.
        corner([0, 1, 2], by(1, 2), by_area);
        corner([0, 1, 3], by(1, 3), by_area);
        corner([1, 0, 2], by(0, 2), 0.0);
        corner([1, 0, 3], by(0, 3), 0.0);
        out
    }

    /// sum c_i v_i
    fn stencil(&self, v: [V3; 4]) -> V3 {
        std::array::from_fn(|d| (0..4).map(|i| self.coefficients[i] * v[i][d]).sum())
    }
}
