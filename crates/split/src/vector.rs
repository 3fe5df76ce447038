//! Long vectors in parallel, with the same bits on any number of threads: sums are taken over a fixed binary tree.

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

/// y += c a; returns b . y, y being used while it is in a register.
struct AddDotLeaf<'a>(&'a mut [f64], f64, &'a [f64], &'a [f64]);

impl Kernel for AddDotLeaf<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let c = F8::<I>::splat(self.1);
        let (y, y_rest) = self.0.as_chunks_mut::<LANES>();
        let (a, a_rest) = self.2.as_chunks::<LANES>();
        let (b, b_rest) = self.3.as_chunks::<LANES>();
        let mut sums = [F8::<I>::zero(); 4];
        for i in 0..y.len() {
            let sum = c.mul_add(F8::load(&a[i]), F8::load(&y[i]));
            sum.store(&mut y[i]);
            sums[i % 4] = sum.mul_add(F8::load(&b[i]), sums[i % 4]);
        }
        let mut rest = 0.0;
        for i in 0..y_rest.len() {
            y_rest[i] = self.1.mul_add(a_rest[i], y_rest[i]);
            rest += y_rest[i] * b_rest[i];
        }
        ((sums[0] + sums[1]) + (sums[2] + sums[3])).sum() + rest
    }
}

/// (a . b, a . c), a being read once.
pub fn dots(a: &[f64], b: &[f64], c: &[f64]) -> (f64, f64) {
    debug_assert!(a.len() == b.len() && a.len() == c.len());
    if a.len() <= LEAF {
        return (dot_leaf(a, b), dot_leaf(a, c));
    }
    let m = middle(a.len());
    let ((a0, a1), (b0, b1), (c0, c1)) = (a.split_at(m), b.split_at(m), c.split_at(m));
    let (l, r) = rayon::join(|| dots(a0, b0, c0), || dots(a1, b1, c1));
    (l.0 + r.0, l.1 + r.1)
}

/// |a|
pub fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// y += c a; returns b . y. One pass: the step of the two loops of L-BFGS.
pub fn add_scaled_then_dot(y: &mut [f64], c: f64, a: &[f64], b: &[f64]) -> f64 {
    debug_assert!(y.len() == a.len() && y.len() == b.len());
    if y.len() <= LEAF {
        return dispatch(AddDotLeaf(y, c, a, b));
    }
    let m = middle(y.len());
    let ((y0, y1), (a0, a1), (b0, b1)) = (y.split_at_mut(m), a.split_at(m), b.split_at(m));
    let (l, r) = rayon::join(|| add_scaled_then_dot(y0, c, a0, b0), || add_scaled_then_dot(y1, c, a1, b1));
    l + r
}

/// y += c a
pub fn add_scaled(y: &mut [f64], c: f64, a: &[f64]) {
    debug_assert_eq!(y.len(), a.len());
    if y.len() <= LEAF {
        for (y, a) in y.iter_mut().zip(a) {
            *y += c * a;
        }
        return;
    }
    let m = middle(y.len());
    let ((y0, y1), (a0, a1)) = (y.split_at_mut(m), a.split_at(m));
    rayon::join(|| add_scaled(y0, c, a0), || add_scaled(y1, c, a1));
}

/// out = a - b
pub fn subtract(out: &mut [f64], a: &[f64], b: &[f64]) {
    debug_assert!(out.len() == a.len() && a.len() == b.len());
    if out.len() <= LEAF {
        for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
            *o = a - b;
        }
        return;
    }
    let m = middle(out.len());
    let ((o0, o1), (a0, a1), (b0, b1)) = (out.split_at_mut(m), a.split_at(m), b.split_at(m));
    rayon::join(|| subtract(o0, a0, b0), || subtract(o1, a1, b1));
}

/// Whether every entry is a finite number.
pub fn is_finite(a: &[f64]) -> bool {
    a.iter().all(|v| v.is_finite())
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
    fn sums_agree_with_plain_loops() {
        for n in [0, 1, 7, 8, 9, LEAF - 1, LEAF, LEAF + 1, 3 * LEAF + 5, 100_003] {
            let (a, b) = (sample(n, 1), sample(n, 2));
            let want: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            let scale = norm(&a) * norm(&b) + 1e-300;
            assert!((dot(&a, &b) - want).abs() <= 1e-13 * scale, "n = {n}");
            let scattered = sample(n, 5);
            assert_eq!(dots(&a, &b, &scattered), (dot(&a, &b), dot(&a, &scattered)), "n = {n}");
            let mut y = a.clone();
            let dotted = add_scaled_then_dot(&mut y, 2.0, &b, &a);
            assert!((dotted - dot(&y, &a)).abs() <= 1e-13 * norm(&y) * norm(&a) + 1e-300, "n = {n}");
            let mut o = vec![0.0; n];
            subtract(&mut o, &a, &b);
            let mut z = o.clone();
            add_scaled(&mut z, 3.0, &b);
            for i in 0..n {
                assert!((y[i] - (a[i] + 2.0 * b[i])).abs() <= 1e-15);
                assert_eq!(o[i], a[i] - b[i]);
                assert_eq!(z[i], o[i] + 3.0 * b[i]);
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
