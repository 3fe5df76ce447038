//! One vector with several columns, each of which is read once.

use super::{CombineLeaf, LEAF, dot_leaf, middle};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use std::ops::Range;

/// Part of a vector that stays in the first-level cache while several others pass by.
const TILE: usize = 1024;
/// Vectors that are multiplied with one in a pass.
const AT_ONCE: usize = 8;

/// The pieces of `range` that are handled at a time.
fn tiles(range: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    range.clone().step_by(TILE).map(move |from| from..(from + TILE).min(range.end))
}

/// out_i = v_i . a for i = 0 .. m, with `a` read once for eight of them.
pub fn dots<'v>(m: usize, v: &(impl Fn(usize) -> &'v [f64] + Sync), a: &[f64], out: &mut Vec<f64>) {
    out.clear();
    for first in (0..m).step_by(AT_ONCE) {
        let count = (m - first).min(AT_ONCE);
        let sums = some_dots(&|i| v(first + i), count, a, 0..a.len());
        out.extend_from_slice(&sums[..count]);
    }
}

fn some_dots<'v>(
    v: &(impl Fn(usize) -> &'v [f64] + Sync),
    count: usize,
    a: &[f64],
    range: Range<usize>,
) -> [f64; AT_ONCE] {
    let mut sums = [0.0; AT_ONCE];
    if range.len() <= LEAF {
        for (i, sum) in sums[..count].iter_mut().enumerate() {
            for tile in tiles(range.clone()) {
                *sum += dot_leaf(&v(i)[tile.clone()], &a[tile]);
            }
        }
        return sums;
    }
    let m = range.start + middle(range.len());
    let (l, r) = rayon::join(|| some_dots(v, count, a, range.start..m), || some_dots(v, count, a, m..range.end));
    for i in 0..AT_ONCE {
        sums[i] = l[i] + r[i];
    }
    sums
}

/// out -= sum_i c_i v_i, four columns at a time, so that each of them is a long stream for the processor to run ahead of.
fn subtract_columns<'v>(out: &mut [f64], c: &[f64], v: &impl Fn(usize) -> &'v [f64]) {
    let fours = c.len() / 4 * 4;
    for i in (0..fours).step_by(4) {
        let (c, v) = ([-c[i], -c[i + 1], -c[i + 2], -c[i + 3]], [v(i), v(i + 1), v(i + 2), v(i + 3)]);
        dispatch(AddFour { out, c, v });
    }
    for (i, c) in c.iter().enumerate().skip(fours) {
        dispatch(CombineLeaf { out, a: None, c: -c, b: v(i) });
    }
}

/// out += sum_i c_i v_i
struct AddFour<'a> {
    out: &'a mut [f64],
    c: [f64; 4],
    v: [&'a [f64]; 4],
}

impl Kernel for AddFour<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let (out, out_rest) = self.out.as_chunks_mut::<LANES>();
        let (v0, v0_rest) = self.v[0].as_chunks::<LANES>();
        let (v1, v1_rest) = self.v[1].as_chunks::<LANES>();
        let (v2, v2_rest) = self.v[2].as_chunks::<LANES>();
        let (v3, v3_rest) = self.v[3].as_chunks::<LANES>();
        let [c0, c1, c2, c3] = self.c;
        let (s0, s1, s2, s3) = (F8::<I>::splat(c0), F8::<I>::splat(c1), F8::<I>::splat(c2), F8::<I>::splat(c3));
        let n = out.len().min(v0.len()).min(v1.len()).min(v2.len()).min(v3.len());
        for i in 0..n {
            let sum = s1.mul_add(F8::load(&v1[i]), s0.mul_add(F8::load(&v0[i]), F8::load(&out[i])));
            s3.mul_add(F8::load(&v3[i]), s2.mul_add(F8::load(&v2[i]), sum)).store(&mut out[i]);
        }
        for i in 0..out_rest.len() {
            let sum = c1.mul_add(v1_rest[i], c0.mul_add(v0_rest[i], out_rest[i]));
            out_rest[i] = c3.mul_add(v3_rest[i], c2.mul_add(v2_rest[i], sum));
        }
    }
}

/// out = a - sum_i c_i v_i
pub fn subtract_combination<'v>(out: &mut [f64], a: &[f64], c: &[f64], v: &(impl Fn(usize) -> &'v [f64] + Sync)) {
    fn part<'v>(out: &mut [f64], from: usize, a: &[f64], c: &[f64], v: &(impl Fn(usize) -> &'v [f64] + Sync)) {
        if out.len() > LEAF {
            let m = middle(out.len());
            let (o0, o1) = out.split_at_mut(m);
            rayon::join(|| part(o0, from, a, c, v), || part(o1, from + m, a, c, v));
            return;
        }
        let range = from..from + out.len();
        out.copy_from_slice(&a[range.clone()]);
        subtract_columns(out, c, &|i| &v(i)[range.clone()]);
    }
    part(out, 0, a, c, v);
}

/// y += sum_i c_i v_i; returns b . y.
pub fn add_combination_then_dot<'v>(
    y: &mut [f64],
    c: &[f64],
    v: &(impl Fn(usize) -> &'v [f64] + Sync),
    b: &[f64],
) -> f64 {
    fn part<'v>(y: &mut [f64], from: usize, c: &[f64], v: &(impl Fn(usize) -> &'v [f64] + Sync), b: &[f64]) -> f64 {
        if y.len() > LEAF {
            let m = middle(y.len());
            let (y0, y1) = y.split_at_mut(m);
            let (l, r) = rayon::join(|| part(y0, from, c, v, b), || part(y1, from + m, c, v, b));
            return l + r;
        }
        let mut sum = 0.0;
        let all = tiles(from..from + y.len());
        for (y, tile) in y.chunks_mut(TILE).zip(all) {
            for (i, c) in c.iter().enumerate() {
                dispatch(CombineLeaf { out: y, a: None, c: *c, b: &v(i)[tile.clone()] });
            }
            sum += dot_leaf(y, &b[tile]);
        }
        sum
    }
    part(y, 0, c, v, b)
}
