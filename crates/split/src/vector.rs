//! Long vectors in parallel, with the same bits on any number of threads: sums are taken over a fixed binary tree.

mod columns;
mod differences;

pub use columns::{add_combination_then_dot, dots, subtract_combination};
pub use differences::{copy_then_difference_dots, copy_then_subtract_differences, difference_dots};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};

/// Below this length a vector is handled by one thread, in order.
const LEAF: usize = 8192;

/// Where a vector of length n > LEAF is cut: depends on n alone.
fn middle(n: usize) -> usize {
    (n / 2).next_multiple_of(LEAF)
}

/// a . b
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    if a.len() <= LEAF {
        return dot_leaf(a, b);
    }
    let m = middle(a.len());
    let ((a0, a1), (b0, b1)) = (a.split_at(m), b.split_at(m));
    let (l, r) = rayon::join(|| dot(a0, b0), || dot(a1, b1));
    l + r
}

/// Products of lanes in four sums, so that additions do not wait for each other.
struct DotLeaf<'a>(&'a [f64], &'a [f64]);

impl Kernel for DotLeaf<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let (a, a_rest) = self.0.as_chunks::<LANES>();
        let (b, b_rest) = self.1.as_chunks::<LANES>();
        let mut sums = [F8::<I>::zero(); 4];
        let fours = a.len() / 4;
        for i in 0..fours {
            for k in 0..4 {
                sums[k] = F8::load(&a[4 * i + k]).mul_add(F8::load(&b[4 * i + k]), sums[k]);
            }
        }
        for i in 4 * fours..a.len() {
            sums[0] = F8::load(&a[i]).mul_add(F8::load(&b[i]), sums[0]);
        }
        let mut rest = 0.0;
        for i in 0..a_rest.len() {
            rest += a_rest[i] * b_rest[i];
        }
        ((sums[0] + sums[1]) + (sums[2] + sums[3])).sum() + rest
    }
}

fn dot_leaf(a: &[f64], b: &[f64]) -> f64 {
    dispatch(DotLeaf(a, b))
}

/// (a . b, a . c), a being read once.
pub fn two_dots(a: &[f64], b: &[f64], c: &[f64]) -> (f64, f64) {
    debug_assert!(a.len() == b.len() && a.len() == c.len());
    if a.len() <= LEAF {
        return (dot_leaf(a, b), dot_leaf(a, c));
    }
    let m = middle(a.len());
    let ((a0, a1), (b0, b1), (c0, c1)) = (a.split_at(m), b.split_at(m), c.split_at(m));
    let (l, r) = rayon::join(|| two_dots(a0, b0, c0), || two_dots(a1, b1, c1));
    (l.0 + r.0, l.1 + r.1)
}

/// |a|
pub fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// out = a + c b, or out += c b where there is no a.
struct CombineLeaf<'a> {
    out: &'a mut [f64],
    a: Option<&'a [f64]>,
    c: f64,
    b: &'a [f64],
}

impl Kernel for CombineLeaf<'_> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let c = F8::<I>::splat(self.c);
        let (out, out_rest) = self.out.as_chunks_mut::<LANES>();
        let (b, b_rest) = self.b.as_chunks::<LANES>();
        if let Some(a) = self.a {
            let (a, a_rest) = a.as_chunks::<LANES>();
            for i in 0..out.len() {
                c.mul_add(F8::load(&b[i]), F8::load(&a[i])).store(&mut out[i]);
            }
            for i in 0..out_rest.len() {
                out_rest[i] = self.c.mul_add(b_rest[i], a_rest[i]);
            }
        } else {
            for i in 0..out.len() {
                c.mul_add(F8::load(&b[i]), F8::load(&out[i])).store(&mut out[i]);
            }
            for i in 0..out_rest.len() {
                out_rest[i] = self.c.mul_add(b_rest[i], out_rest[i]);
            }
        }
    }
}

/// y += c a
pub fn add_scaled(y: &mut [f64], c: f64, a: &[f64]) {
    debug_assert_eq!(y.len(), a.len());
    if y.len() <= LEAF {
        return dispatch(CombineLeaf { out: y, a: None, c, b: a });
    }
    let m = middle(y.len());
    let ((y0, y1), (a0, a1)) = (y.split_at_mut(m), a.split_at(m));
    rayon::join(|| add_scaled(y0, c, a0), || add_scaled(y1, c, a1));
}

/// out = a - b
pub fn subtract(out: &mut [f64], a: &[f64], b: &[f64]) {
    debug_assert!(out.len() == a.len() && a.len() == b.len());
    if out.len() <= LEAF {
        return dispatch(CombineLeaf { out, a: Some(a), c: -1.0, b });
    }
    let m = middle(out.len());
    let ((o0, o1), (a0, a1), (b0, b1)) = (out.split_at_mut(m), a.split_at(m), b.split_at(m));
    rayon::join(|| subtract(o0, a0, b0), || subtract(o1, a1, b1));
}

/// to = from
pub fn copy(to: &mut [f64], from: &[f64]) {
    debug_assert_eq!(to.len(), from.len());
    if to.len() <= LEAF {
        return to.copy_from_slice(from);
    }
    let m = middle(to.len());
    let ((t0, t1), (f0, f1)) = (to.split_at_mut(m), from.split_at(m));
    rayon::join(|| copy(t0, f0), || copy(t1, f1));
}

/// out = c a
pub fn scale_to(out: &mut [f64], c: f64, a: &[f64]) {
    debug_assert_eq!(out.len(), a.len());
    if out.len() <= LEAF {
        for i in 0..out.len() {
            out[i] = c * a[i];
        }
        return;
    }
    let m = middle(out.len());
    let ((o0, o1), (a0, a1)) = (out.split_at_mut(m), a.split_at(m));
    rayon::join(|| scale_to(o0, c, a0), || scale_to(o1, c, a1));
}

/// Whether every entry is a finite number.
pub fn is_finite(a: &[f64]) -> bool {
    if a.len() <= LEAF {
        return dispatch(Finite(a));
    }
    let (l, r) = a.split_at(middle(a.len()));
    let (l, r) = rayon::join(|| is_finite(l), || is_finite(r));
    l && r
}

/// 0 v is 0 for finite numbers alone.
struct Finite<'a>(&'a [f64]);

impl Kernel for Finite<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self) -> bool {
        let (lanes, rest) = self.0.as_chunks::<LANES>();
        let zero = F8::<I>::zero();
        let mut sum = [zero; 4];
        let (fours, others) = lanes.as_chunks::<4>();
        for four in fours {
            for k in 0..4 {
                sum[k] = zero.mul_add(F8::load(&four[k]), sum[k]);
            }
        }
        for lanes in others {
            sum[0] = zero.mul_add(F8::load(lanes), sum[0]);
        }
        let sum = (sum[0] + sum[1]) + (sum[2] + sum[3]);
        sum.sum() == 0.0 && rest.iter().all(|v| v.is_finite())
    }
}

/// The largest side of the box around positions, `dim` numbers a node; at least the smallest normal number.
pub fn extent(x: &[f64], dim: usize) -> f64 {
    let side = |d: usize| {
        let of_axis = x.iter().skip(d).step_by(dim);
        let (low, high) = of_axis.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        high - low
    };
    (0..dim).map(side).fold(f64::MIN_POSITIVE, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(n: usize, seed: u64) -> Vec<f64> {
        let mut s = seed;
        (0..n)
            .map(|_| {
                s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (s >> 11) as f64 / (1u64 << 52) as f64 - 1.0
            })
            .collect()
    }

    #[test]
    fn what_is_not_finite_is_found_wherever_it_is() {
        for n in [1, 7, 8, 31, 32, 41, LEAF, 2 * LEAF + 13] {
            let mut a = vec![f64::MAX; n];
            assert!(is_finite(&a), "n = {n}");
            for at in [0, n / 3, n / 2, n - 1] {
                for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let kept = std::mem::replace(&mut a[at], wrong);
                    assert!(!is_finite(&a), "n = {n}: {wrong} at {at}");
                    a[at] = kept;
                }
            }
        }
    }

    #[test]
    fn sums_agree_with_plain_loops() {
        for n in [0, 1, 7, 8, 9, LEAF - 1, LEAF, LEAF + 1, 3 * LEAF + 5, 100_003] {
            let (a, b) = (sample(n, 1), sample(n, 2));
            let want: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            let scale = norm(&a) * norm(&b) + 1e-300;
            assert!((dot(&a, &b) - want).abs() <= 1e-13 * scale, "n = {n}");
            let (c, d) = (sample(n, 3), sample(n, 4));
            assert_eq!(two_dots(&a, &b, &c), (dot(&a, &b), dot(&a, &c)), "n = {n}");
            let three = |i: usize| [&b, &c, &d][i].as_slice();
            let mut y = a.clone();
            let dotted = add_combination_then_dot(&mut y, &[2.0, -0.5, 0.25], &three, &a);
            assert!((dotted - dot(&y, &a)).abs() <= 1e-13 * norm(&y) * norm(&a) + 1e-300, "n = {n}");
            let mut w = vec![7.0; n];
            subtract_combination(&mut w, &a, &[2.0, -0.5, 0.25], &three);
            let mut several = Vec::new();
            dots(11, &|i| three(i % 3), &a, &mut several);
            assert_eq!(several.len(), 11);
            for (i, sum) in several.iter().enumerate() {
                assert!((sum - dot(three(i % 3), &a)).abs() <= 1e-13 * scale + 1e-300, "n = {n}, product {i}");
            }
            let mut scaled = vec![7.0; n];
            scale_to(&mut scaled, -3.0, &a);
            let mut o = vec![0.0; n];
            subtract(&mut o, &a, &b);
            let mut copied = vec![7.0; n];
            copy(&mut copied, &b);
            assert!(copied == b && is_finite(&b), "n = {n}");
            let mut z = o.clone();
            add_scaled(&mut z, 3.0, &b);
            for i in 0..n {
                let sum = 2.0 * b[i] - 0.5 * c[i] + 0.25 * d[i];
                assert!((y[i] - (a[i] + sum)).abs() <= 1e-15 && (w[i] - (a[i] - sum)).abs() <= 1e-15);
                assert_eq!(o[i], a[i] - b[i]);
                assert!((z[i] - (o[i] + 3.0 * b[i])).abs() <= 1e-15);
                assert_eq!(scaled[i], -3.0 * a[i]);
            }
        }
    }

    #[test]
    fn differences_of_calls_are_what_they_are_when_written_out() {
        for n in [0, 1, 7, 8, 9, LEAF, LEAF + 1, 3 * LEAF + 5] {
            let v: Vec<Vec<f64>> = (0..20).map(|k| sample(n, k)).collect();
            let now = sample(n, 99);
            let difference = |newer: &[f64], older: &[f64]| {
                let mut d = vec![0.0; n];
                subtract(&mut d, newer, older);
                d
            };
            for m in 0..=19 {
                let d: Vec<Vec<f64>> =
                    (0..m).map(|j| difference(if j == 0 { &now } else { &v[j - 1] }, &v[j])).collect();
                let (mut kept, mut products) = (vec![7.0; n], vec![(7.0, 7.0)]);
                copy_then_difference_dots(&mut kept, &now, m, &|j| v[j].as_slice(), &mut products);
                assert!(kept == now && products.len() == m, "n = {n}, m = {m}");
                for (j, (with_new, with_now)) in products.iter().enumerate() {
                    let wrong = (with_new - dot(&d[j], &d[0])).abs() + (with_now - dot(&d[j], &now)).abs();
                    assert!(wrong <= 1e-13 * norm(&d[j]) * (norm(&d[0]) + norm(&now)), "n = {n}, m = {m}, j = {j}");
                }

                let (x, y, z) = (&v[3], &v[5], &v[7]);
                difference_dots(m, &|j| v[j].as_slice(), [x, y, z], &mut products);
                assert_eq!(products.len(), m);
                for (j, (with_xy, with_z)) in products.iter().enumerate() {
                    let (d, xy) = (difference(&v[j], &v[j + 1]), difference(x, y));
                    let wrong = (with_xy - dot(&d, &xy)).abs() + (with_z - dot(&d, z)).abs();
                    assert!(wrong <= 1e-13 * norm(&d) * (norm(&xy) + norm(z)), "n = {n}, m = {m}, j = {j}");
                }

                let c = sample(m, 5);
                let (mut kept, mut out, mut want) = (vec![7.0; n], vec![7.0; n], vec![7.0; n]);
                copy_then_subtract_differences(&mut out, &mut kept, &now, &c, &|j| v[j].as_slice());
                subtract_combination(&mut want, &now, &c, &|j| d[j].as_slice());
                assert_eq!(kept, now, "n = {n}, m = {m}");
                for i in 0..n {
                    assert!((out[i] - want[i]).abs() <= 1e-14, "n = {n}, m = {m}, entry {i}");
                }
            }
        }
    }

    #[test]
    fn the_same_bits_on_any_number_of_threads() {
        let (a, b) = (sample(300_007, 3), sample(300_007, 4));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of a few threads");
            pool.install(|| dot(&a, &b)).to_bits()
        };
        assert_eq!(on(1), on(2));
        assert_eq!(on(1), on(3));
    }
}
