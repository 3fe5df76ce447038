//! The vectors of several calls, newest first, and their differences d_j = v_j - v_{j+1}, which are made in registers: no
//! difference is ever in memory, and each vector is read once for all that is asked of them.

use super::{LEAF, middle};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use std::ops::Range;

/// Differences in a pass. So many streams at a time, and written to in the same loop, are what memory is fastest with: in
/// groups of three or four, or with copies made apart, the same work took 1.1 to 1.5 times as long.
const AT_ONCE: usize = 8;

/// kept <- now, and (d_j . d_0, d_j . now) for j = 0 .. m of v = (now, past_0, past_1, ..).
pub fn copy_then_difference_dots<'v>(
    kept: &mut [f64],
    now: &[f64],
    m: usize,
    past: &(impl Fn(usize) -> &'v [f64] + Sync),
    out: &mut Vec<(f64, f64)>,
) {
    debug_assert_eq!(kept.len(), now.len());
    if m == 0 {
        super::copy(kept, now);
    }
    products(Some(kept), m, &|j| if j == 0 { now } else { past(j - 1) }, [now, past(0), now], out);
}

/// (d_j . (x - y), d_j . z) for j = 0 .. m of v_0 .. v_m.
pub fn difference_dots<'v>(
    m: usize,
    v: &(impl Fn(usize) -> &'v [f64] + Sync),
    xyz: [&[f64]; 3],
    out: &mut Vec<(f64, f64)>,
) {
    products(None, m, v, xyz, out);
}

fn products<'v>(
    mut kept: Option<&mut [f64]>,
    m: usize,
    v: &(impl Fn(usize) -> &'v [f64] + Sync),
    xyz: [&[f64]; 3],
    out: &mut Vec<(f64, f64)>,
) {
    out.clear();
    for first in (0..m).step_by(AT_ONCE) {
        let count = (m - first).min(AT_ONCE);
        let sums = some_products(kept.take(), &|j| v(first + j), count, xyz, 0..xyz[0].len());
        out.extend_from_slice(&sums[..count]);
    }
}

/// Products of up to eight differences; `kept` <- x in the same pass.
fn some_products<'v>(
    kept: Option<&mut [f64]>,
    v: &(impl Fn(usize) -> &'v [f64] + Sync),
    count: usize,
    xyz: [&[f64]; 3],
    range: Range<usize>,
) -> [(f64, f64); AT_ONCE] {
    let mut sums = [(0.0, 0.0); AT_ONCE];
    if range.len() > LEAF {
        let half = middle(range.len());
        let m = range.start + half;
        let (kept_l, kept_r) = kept.map(|kept| kept.split_at_mut(half)).unzip();
        let (l, r) = rayon::join(
            || some_products(kept_l, v, count, xyz, range.start..m),
            || some_products(kept_r, v, count, xyz, m..range.end),
        );
        for i in 0..AT_ONCE {
            sums[i] = (l[i].0 + r[i].0, l[i].1 + r[i].1);
        }
        return sums;
    }
    let xyz = xyz.map(|v| &v[range.clone()]);
    let (kept, of) = (kept.unwrap_or_default(), |j: usize| &v(j)[range.clone()]);
    let sums_of = &mut sums[..count];
    match count {
        1 => sums_of.copy_from_slice(&products_leaf::<1>(kept, of, xyz)),
        2 => sums_of.copy_from_slice(&products_leaf::<2>(kept, of, xyz)),
        3 => sums_of.copy_from_slice(&products_leaf::<3>(kept, of, xyz)),
        4 => sums_of.copy_from_slice(&products_leaf::<4>(kept, of, xyz)),
        5 => sums_of.copy_from_slice(&products_leaf::<5>(kept, of, xyz)),
        6 => sums_of.copy_from_slice(&products_leaf::<6>(kept, of, xyz)),
        7 => sums_of.copy_from_slice(&products_leaf::<7>(kept, of, xyz)),
        _ => sums_of.copy_from_slice(&products_leaf::<AT_ONCE>(kept, of, xyz)),
    }
    sums
}

fn products_leaf<'v, const N: usize>(
    kept: &mut [f64],
    v: impl Fn(usize) -> &'v [f64],
    xyz: [&[f64]; 3],
) -> [(f64, f64); N] {
    dispatch(Products::<N> { kept, newest: v(0), v: std::array::from_fn(|j| v(j + 1)), xyz })
}

/// (d_j . (x - y), d_j . z) for j = 0 .. N, the vectors being of one length; kept <- x, where it is not empty.
struct Products<'a, const N: usize> {
    kept: &'a mut [f64],
    newest: &'a [f64],
    v: [&'a [f64]; N],
    xyz: [&'a [f64]; 3],
}

impl<const N: usize> Kernel for Products<'_, N> {
    type Output = [(f64, f64); N];

    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let [x, y, z] = self.xyz;
        let whole = x.len() / LANES;
        let (x_lanes, y_lanes, z_lanes) = (lanes(x, whole), lanes(y, whole), lanes(z, whole));
        let newest = lanes(self.newest, whole);
        let v = self.v.map(|v| lanes(v, whole));
        let keep = !self.kept.is_empty();
        let kept = self.kept.as_chunks_mut::<LANES>().0;
        let kept = if keep { &mut kept[..whole] } else { kept };
        let mut with_xy = [F8::<I>::zero(); N];
        let mut with_z = [F8::<I>::zero(); N];
        for i in 0..whole {
            let x = F8::load(&x_lanes[i]);
            if keep {
                x.store(&mut kept[i]);
            }
            let xy = x - F8::load(&y_lanes[i]);
            let z = F8::load(&z_lanes[i]);
            let mut newer = F8::load(&newest[i]);
            for j in 0..N {
                let older = F8::load(&v[j][i]);
                let d = newer - older;
                with_xy[j] = d.mul_add(xy, with_xy[j]);
                with_z[j] = d.mul_add(z, with_z[j]);
                newer = older;
            }
        }
        let mut sums = [(0.0, 0.0); N];
        for j in 0..N {
            sums[j] = (with_xy[j].sum(), with_z[j].sum());
        }
        for i in whole * LANES..x.len() {
            if keep {
                self.kept[i] = x[i];
            }
            let mut newer = self.newest[i];
            for j in 0..N {
                let d = newer - self.v[j][i];
                sums[j].0 += d * (x[i] - y[i]);
                sums[j].1 += d * z[i];
                newer = self.v[j][i];
            }
        }
        sums
    }
}

/// The first `whole` blocks of lanes.
#[inline(always)]
fn lanes(v: &[f64], whole: usize) -> &[[f64; LANES]] {
    &v.as_chunks::<LANES>().0[..whole]
}

/// kept <- now, and out <- now - sum_j c_j d_j of v = (now, past_0, past_1, ..).
pub fn copy_then_subtract_differences<'v>(
    out: &mut [f64],
    kept: &mut [f64],
    now: &[f64],
    c: &[f64],
    past: &(impl Fn(usize) -> &'v [f64] + Sync),
) {
    debug_assert!(out.len() == now.len() && now.len() == kept.len());
    subtract(out, kept, 0, now, c, past);
}

fn subtract<'v>(
    out: &mut [f64],
    kept: &mut [f64],
    from: usize,
    now: &[f64],
    c: &[f64],
    past: &(impl Fn(usize) -> &'v [f64] + Sync),
) {
    if out.len() > LEAF {
        let m = middle(out.len());
        let ((o0, o1), (k0, k1)) = (out.split_at_mut(m), kept.split_at_mut(m));
        rayon::join(|| subtract(o0, k0, from, now, c, past), || subtract(o1, k1, from + m, now, c, past));
        return;
    }
    let range = from..from + out.len();
    let now = &now[range.clone()];
    if c.is_empty() {
        kept.copy_from_slice(now);
        out.copy_from_slice(now);
    }
    let mut kept = kept;
    for (group, c) in c.chunks(AT_ONCE).enumerate() {
        let first = group * AT_ONCE;
        let newest = if first == 0 { now } else { &past(first - 1)[range.clone()] };
        let of = |j: usize| &past(first + j)[range.clone()];
        match c.len() {
            1 => subtract_leaf::<1>(out, kept, newest, c, of),
            2 => subtract_leaf::<2>(out, kept, newest, c, of),
            3 => subtract_leaf::<3>(out, kept, newest, c, of),
            4 => subtract_leaf::<4>(out, kept, newest, c, of),
            5 => subtract_leaf::<5>(out, kept, newest, c, of),
            6 => subtract_leaf::<6>(out, kept, newest, c, of),
            7 => subtract_leaf::<7>(out, kept, newest, c, of),
            _ => subtract_leaf::<AT_ONCE>(out, kept, newest, c, of),
        }
        kept = &mut [];
    }
}

fn subtract_leaf<'v, const N: usize>(
    out: &mut [f64],
    kept: &mut [f64],
    newest: &[f64],
    c: &[f64],
    v: impl Fn(usize) -> &'v [f64],
) {
    dispatch(Subtract::<N> { out, kept, newest, c: std::array::from_fn(|j| c[j]), v: std::array::from_fn(v) });
}

/// out -= sum_j c_j d_j, the vectors being of one length; where `kept` is not empty, kept <- newest and
/// out <- newest - sum_j c_j d_j.
struct Subtract<'a, const N: usize> {
    out: &'a mut [f64],
    kept: &'a mut [f64],
    newest: &'a [f64],
    c: [f64; N],
    v: [&'a [f64]; N],
}

impl<const N: usize> Kernel for Subtract<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let n = self.out.len();
        let whole = n / LANES;
        let keep = !self.kept.is_empty();
        let kept = self.kept.as_chunks_mut::<LANES>().0;
        let kept = if keep { &mut kept[..whole] } else { kept };
        let newest = lanes(self.newest, whole);
        let v = self.v.map(|v| lanes(v, whole));
        let mut c = [F8::<I>::zero(); N];
        for j in 0..N {
            c[j] = F8::splat(-self.c[j]);
        }
        let out = &mut self.out.as_chunks_mut::<LANES>().0[..whole];
        for i in 0..whole {
            let mut newer = F8::load(&newest[i]);
            let mut sum = newer;
            if keep {
                newer.store(&mut kept[i]);
            } else {
                sum = F8::load(&out[i]);
            }
            for j in 0..N {
                let older = F8::load(&v[j][i]);
                sum = c[j].mul_add(newer - older, sum);
                newer = older;
            }
            sum.store(&mut out[i]);
        }
        for i in whole * LANES..n {
            let mut newer = self.newest[i];
            if keep {
                self.kept[i] = newer;
                self.out[i] = newer;
            }
            for j in 0..N {
                let older = self.v[j][i];
                self.out[i] = (-self.c[j]).mul_add(newer - older, self.out[i]);
                newer = older;
            }
        }
    }
}
