//! Sparse quadratic forms, applied to each coordinate alike.

use proxel_linalg::sparse::SymPattern;

/// Rows that one thread handles at a time.
const LEAF: usize = 1024;

/// 1/2 sum_c x_c^T K x_c over the coordinates c of nodes, with a sparse symmetric K over all nodes, fixed ones included.
///
/// A sum of stencils k c c^T, each over a few nodes, so that K is positive semidefinite by construction where no k is
/// negative.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SymmetricForm {
    starts: Vec<u32>,  // where each row begins, and where the last one ends
    columns: Vec<u32>, // ascending within a row
    values: Vec<f64>,
}

impl SymmetricForm {
    /// sum k c c^T over stencils (nodes, coefficients c, factor k) among `n` nodes.
    ///
    /// # Panics
    /// Never: nodes past the end are ignored, as are coefficients without a node.
    pub fn from_stencils<'a>(n: usize, stencils: impl Iterator<Item = (&'a [u32], &'a [f64], f64)>) -> Self {
        let mut entries: Vec<(u32, u32, f64)> = Vec::new();
        for (nodes, c, k) in stencils {
            for (a, ca) in nodes.iter().zip(c) {
                for (b, cb) in nodes.iter().zip(c) {
                    if (*a as usize) < n && (*b as usize) < n {
                        entries.push((*a, *b, k * (ca * cb)));
                    }
                }
            }
        }
        // Stable, so that equal places are summed in the order of the stencils.
        entries.sort_by_key(|(a, b, _)| (*a, *b));
        let mut form = SymmetricForm { starts: vec![0; n + 1], ..Default::default() };
        for same in entries.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            form.columns.push(same[0].1);
            form.values.push(same.iter().map(|e| e.2).sum());
            form.starts[same[0].0 as usize + 1] = form.columns.len() as u32;
        }
        for i in 0..n {
            form.starts[i + 1] = form.starts[i + 1].max(form.starts[i]);
        }
        form
    }

    /// The sum of forms; those that are nothing may have any number of nodes, the others have the same.
    pub fn sum(forms: &[SymmetricForm]) -> Self {
        let n = forms.iter().filter(|form| !form.is_empty()).map(|form| form.n()).max().unwrap_or(0);
        let mut out = SymmetricForm { starts: vec![0; if n > 0 { n + 1 } else { 0 }], ..Default::default() };
        for i in 0..n {
            let rows = forms.iter().filter(|form| i < form.n()).flat_map(|form| form.row(i));
            let mut row: Vec<(usize, f64)> = rows.collect();
            // Stable, so that equal places are summed in the order of the forms.
            row.sort_by_key(|(column, _)| *column);
            for same in row.chunk_by(|a, b| a.0 == b.0) {
                out.columns.push(same[0].0 as u32);
                out.values.push(same.iter().map(|e| e.1).sum());
            }
            out.starts[i + 1] = out.columns.len() as u32;
        }
        out
    }

    /// Number of nodes; 0 for a form that is nothing.
    pub fn n(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether it has no entries.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The entries (column, value) of a row.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[i] as usize..self.starts[i + 1] as usize;
        self.columns[range.clone()].iter().map(|c| *c as usize).zip(self.values[range].iter().copied())
    }

    /// Whether all entries are finite numbers.
    pub fn is_finite(&self) -> bool {
        crate::vector::is_finite(&self.values)
    }

    /// 1/2 sum_c x_c^T K x_c; K x over the nodes that `grad` covers is added to it.
    pub fn value_and_gradient(&self, x: &[f64], dim: usize, grad: Option<&mut [f64]>) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let grad = grad.unwrap_or(&mut []);
        match dim {
            1 => self.over::<1>(x, grad, 0, self.n()),
            2 => self.over::<2>(x, grad, 0, self.n()),
            _ => self.over::<3>(x, grad, 0, self.n()),
        }
    }

    /// Rows `from..to`; `grad` begins at row `from`. Sums are taken over a binary tree that depends on the rows alone.
    fn over<const D: usize>(&self, x: &[f64], grad: &mut [f64], from: usize, to: usize) -> f64 {
        if to - from > LEAF {
            let middle = from + ((to - from) / 2).next_multiple_of(LEAF);
            let (first, second) = grad.split_at_mut(((middle - from) * D).min(grad.len()));
            let (a, b) =
                rayon::join(|| self.over::<D>(x, first, from, middle), || self.over::<D>(x, second, middle, to));
            return a + b;
        }
        let mut value = 0.0;
        for i in from..to {
            // Differences from the row's own node: rows of K that sum to 0 then see no translation.
            let own: [f64; D] = std::array::from_fn(|d| x[i * D + d]);
            let (mut kx, mut sum) = ([0.0; D], 0.0);
            for at in self.starts[i] as usize..self.starts[i + 1] as usize {
                let (j, k) = (self.columns[at] as usize, self.values[at]);
                sum += k;
                for d in 0..D {
                    kx[d] += k * (x[j * D + d] - own[d]);
                }
            }
            for d in 0..D {
                kx[d] += sum * own[d];
                value += 0.5 * own[d] * kx[d];
            }
            if let Some(grad) = grad.get_mut((i - from) * D..(i - from + 1) * D) {
                for d in 0..D {
                    grad[d] += kx[d];
                }
            }
        }
        value
    }

    /// Calls `visit` with every pair of nodes i > j that has an entry.
    pub fn for_each_pair(&self, visit: &mut dyn FnMut(u32, u32)) {
        for i in 0..self.n() {
            for (j, _) in self.row(i).take_while(|(j, _)| *j < i) {
                visit(i as u32, j as u32);
            }
        }
    }

    /// Adds K over the nodes of `pattern`, the first ones, to the values of its lower triangle.
    pub fn add_to(&self, pattern: &SymPattern, values: &mut [f64]) {
        for i in 0..self.n().min(pattern.n()) {
            for (j, k) in self.row(i).take_while(|(j, _)| *j <= i) {
                if let Some(slot) = pattern.slot(i, j) {
                    values[slot] += k;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_gradient_and_entries_agree_with_the_stencils() {
        let stencils: [([u32; 3], [f64; 3], f64); 3] = [
            ([0, 1, 2], [1.0, -2.0, 1.0], 3.0),
            ([1, 2, 3], [1.0, -2.0, 1.0], 0.5),
            ([3, 0, 1], [2.0, 1.0, -4.0], 1.0),
        ];
        let form = SymmetricForm::from_stencils(4, stencils.iter().map(|(n, c, k)| (&n[..], &c[..], *k)));
        let x = [0.3, -1.0, 2.0, 0.25, -0.5, 4.0, 1.0, 1.0];
        let by_hand: f64 = stencils
            .iter()
            .map(|(n, c, k)| {
                let of = |d: usize| (0..3).map(|i| c[i] * x[n[i] as usize * 2 + d]).sum::<f64>();
                0.5 * k * (of(0).powi(2) + of(1).powi(2))
            })
            .sum();
        let mut g = vec![0.0; 6];
        let value = form.value_and_gradient(&x, 2, Some(&mut g));
        assert!((value - by_hand).abs() < 1e-13 * by_hand);
        for i in 0..6 {
            let at = |h: f64| {
                let mut y = x;
                y[i] += h;
                form.value_and_gradient(&y, 2, None)
            };
            assert!(((at(1e-3) - at(-1e-3)) / 2e-3 - g[i]).abs() < 1e-9 * by_hand, "{i}");
        }
        for i in 0..4 {
            for (j, k) in form.row(i) {
                assert!(form.row(j).any(|(c, v)| c == i && v == k), "symmetric");
            }
        }
        let mut pairs = 0;
        form.for_each_pair(&mut |i, j| {
            assert!(i > j);
            pairs += 1;
        });
        assert_eq!(pairs, 6, "0-1, 0-2, 0-3, 1-2, 1-3, 2-3");
    }

    #[test]
    fn sums_add_up() {
        let of = |k: f64, nodes: [u32; 3]| {
            SymmetricForm::from_stencils(5, [(&nodes[..], &[1.0, -2.0, 1.0][..], k)].into_iter())
        };
        let (a, b) = (of(3.0, [0, 1, 2]), of(0.5, [1, 2, 4]));
        let sum = SymmetricForm::sum(&[a.clone(), SymmetricForm::default(), b.clone()]);
        let x = [0.3, -1.0, 2.0, 0.25, -0.5];
        let value = |form: &SymmetricForm| form.value_and_gradient(&x, 1, None);
        assert!((value(&sum) - value(&a) - value(&b)).abs() < 1e-14 * value(&sum));
        assert!(sum.n() == 5 && SymmetricForm::sum(&[]).is_empty() && SymmetricForm::sum(&[]).n() == 0);
    }

    #[test]
    fn the_same_bits_on_any_number_of_threads() {
        let n = 10_000u32;
        let stencils: Vec<([u32; 3], [f64; 3])> = (0..n - 2).map(|i| ([i, i + 1, i + 2], [1.0, -2.1, 1.0])).collect();
        let form = SymmetricForm::from_stencils(n as usize, stencils.iter().map(|(n, c)| (&n[..], &c[..], 0.7)));
        let x: Vec<f64> = (0..3 * n).map(|i| (f64::from(i) * 0.37).sin()).collect();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of a few threads");
            let mut g = vec![0.0; x.len() - 300];
            let value = pool.install(|| form.value_and_gradient(&x, 3, Some(&mut g)));
            (value.to_bits(), g.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
        };
        assert!(on(1) == on(2) && on(1) == on(3));
    }
}
