//! The passes over a task's nodes, in lanes of eight.

use super::Ties;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real};
use proxel_split::{LocalReport, Order};
use std::marker::PhantomData;

/// One number of each of eight nodes.
type Lanes = [f64; LANES];
/// Eight nodes of a local vector.
type Block<const D: usize, const K: usize> = [[Lanes; D]; K];

/// What is known of the slots of a task, in the layouts of the term.
pub struct Tied<'a, const D: usize, const K: usize, T> {
    /// Of these slots.
    pub direction: &'a [f64],
    pub other: &'a [u32],
    pub share: &'a [f64],
    pub weight2: &'a [f64],
    /// Those before them.
    pub before: usize,
    /// Of all.
    pub images: &'a [f64],
    pub ties: PhantomData<T>,
}

#[inline(always)]
fn blocks<const D: usize, const K: usize>(local: &[f64]) -> &[Block<D, K>] {
    local.as_chunks().0.as_chunks().0.as_chunks().0
}

#[inline(always)]
fn blocks_mut<const D: usize, const K: usize>(local: &mut [f64]) -> &mut [Block<D, K>] {
    local.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0
}

/// Blocks of one number a slot.
#[inline(always)]
fn ones_of_slots<T, const K: usize>(of_slots: &[T]) -> &[[[T; LANES]; K]] {
    of_slots.as_chunks().0.as_chunks().0
}

// Loops, not closures: those are functions without the instruction set of their caller.

#[inline(always)]
fn zero<I: Isa, const D: usize>() -> [F8<I>; D] {
    [F8::splat(0.0); D]
}

#[inline(always)]
fn load<I: Isa, const D: usize>(from: &[Lanes; D]) -> [F8<I>; D] {
    let mut v = zero();
    for d in 0..D {
        v[d] = F8::load(&from[d]);
    }
    v
}

#[inline(always)]
fn store<I: Isa, const D: usize>(v: [F8<I>; D], to: &mut [Lanes; D]) {
    for d in 0..D {
        v[d].store(&mut to[d]);
    }
}

/// a + b
#[inline(always)]
fn sum<I: Isa, const D: usize>(a: [F8<I>; D], b: [F8<I>; D]) -> [F8<I>; D] {
    let mut v = a;
    for d in 0..D {
        v[d] = a[d] + b[d];
    }
    v
}

/// a - b
#[inline(always)]
fn gap<I: Isa, const D: usize>(a: [F8<I>; D], b: [F8<I>; D]) -> [F8<I>; D] {
    let mut v = a;
    for d in 0..D {
        v[d] = a[d] - b[d];
    }
    v
}

/// a . b
#[inline(always)]
fn dot<I: Isa, const D: usize>(a: [F8<I>; D], b: [F8<I>; D]) -> F8<I> {
    let mut sum = a[0] * b[0];
    for d in 1..D {
        sum += a[d] * b[d];
    }
    sum
}

/// |a - b|^2
#[inline(always)]
fn square<I: Isa, const D: usize>(a: [F8<I>; D], b: [F8<I>; D]) -> F8<I> {
    let gap = gap(a, b);
    dot(gap, gap)
}

/// The numbers of the eight nodes of a block, which lie node by node; the filler where there are fewer nodes.
#[inline(always)]
fn nodes<I: Isa, const D: usize>(x: &[f64], block: usize, filler: f64) -> [F8<I>; D] {
    let rest = x.get(block * D * LANES..).unwrap_or_default();
    let mut v = zero();
    if D == 1 && rest.len() >= LANES {
        v[0] = F8::load_at(rest, 0);
        return v;
    }
    if let (true, Some(eight)) = (D == 2, rest.first_chunk()) {
        v.copy_from_slice(&F8::pairs(eight)[..D]);
        return v;
    }
    for d in 0..D {
        let mut lanes = [filler; LANES];
        for (lane, x) in lanes.iter_mut().zip(rest.iter().skip(d).step_by(D)) {
            *lane = *x;
        }
        v[d] = F8::of(lanes);
    }
    v
}

/// Puts them where [`nodes`] takes them from.
#[inline(always)]
fn put_nodes<I: Isa, const D: usize>(x: &mut [f64], block: usize, v: [F8<I>; D]) {
    let rest = x.get_mut(block * D * LANES..).unwrap_or_default();
    if D == 1 && rest.len() >= LANES {
        return v[0].store_at(rest, 0);
    }
    if let (true, Some(eight)) = (D == 2, rest.first_chunk_mut()) {
        return F8::put_pairs([v[0], v[D - 1]], eight);
    }
    for d in 0..D {
        let lanes = v[d].to_array();
        for (lane, x) in lanes.iter().zip(rest.iter_mut().skip(d).step_by(D)) {
            *x = *lane;
        }
    }
}

/// d . (x + u), or d . x.
pub struct Images<'a, const D: usize, const K: usize> {
    pub x: &'a [f64],
    pub u: Option<&'a [f64]>,
    pub direction: &'a [f64],
    pub images: &'a mut [f64],
}

impl<const D: usize, const K: usize> Kernel for Images<'_, D, K> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let images: &mut [[Lanes; K]] = self.images.as_chunks_mut().0.as_chunks_mut().0;
        let u = self.u.map(blocks::<D, K>);
        for (block, (direction, images)) in blocks::<D, K>(self.direction).iter().zip(images).enumerate() {
            let c = nodes::<I, D>(self.x, block, 0.0);
            if let Some(u) = u {
                for k in 0..K {
                    dot(load(&direction[k]), sum(c, load(&u[block][k]))).store(&mut images[k]);
                }
            } else {
                for k in 0..K {
                    dot(load(&direction[k]), c).store(&mut images[k]);
                }
            }
        }
    }
}

/// A slot of eight nodes.
struct Slot<I: Isa, const D: usize> {
    u: [F8<I>; D],
    z: [F8<I>; D],
    weight2: F8<I>,
}

/// A block of what is known.
struct Known<'a, const D: usize, const K: usize, T> {
    direction: &'a Block<D, K>,
    other: &'a [[u32; LANES]; K],
    share: &'a [Lanes; K],
    weight2: &'a [Lanes; K],
    own: &'a [Lanes; K],
    images: &'a [f64],
    ties: PhantomData<T>,
}

impl<'a, const D: usize, const K: usize, T: Ties> Tied<'a, D, K, T> {
    /// All blocks, one after the other.
    #[inline(always)]
    fn blocks(&self) -> impl Iterator<Item = Known<'a, D, K, T>> + use<'a, D, K, T> {
        let (images, ties) = (self.images, self.ties);
        let own = ones_of_slots(&images[self.before..]);
        let slots = ones_of_slots(self.share).iter().zip(ones_of_slots(self.weight2)).zip(own);
        let known = slots.zip(blocks(self.direction)).zip(ones_of_slots(self.other));
        known.map(move |((((share, weight2), own), direction), other)| Known {
            direction,
            other,
            share,
            weight2,
            own,
            images,
            ties,
        })
    }
}

impl<const D: usize, const K: usize, T: Ties> Known<'_, D, K, T> {
    /// z, the nearest point, for the k-th copies.
    #[inline(always)]
    fn nearest<I: Isa>(&self, k: usize, c: [F8<I>; D], u: &Block<D, K>) -> Slot<I, D> {
        let other = F8::gather(self.images, &self.other[k], 1, 0);
        let counts = if T::DIFFERENCES { F8::load(&self.own[k]) - other } else { other };
        let excess = F8::load(&self.share[k]) * counts;
        let (u, direction) = (load(&u[k]), load::<I, D>(&self.direction[k]));
        let mut z = sum(c, u);
        for d in 0..D {
            z[d] -= excess * direction[d];
        }
        Slot { u, z, weight2: F8::load(&self.weight2[k]) }
    }
}

/// The local step: A(6) first line, or A(5) second and third, with the gradient of the penalty.
pub struct Local<'a, const D: usize, const K: usize, T> {
    pub order: Order,
    pub x: &'a [f64],
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
    pub grad: &'a mut [f64],
    pub tied: Tied<'a, D, K, T>,
}

impl<const D: usize, const K: usize, T: Ties> Kernel for Local<'_, D, K, T> {
    type Output = LocalReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> LocalReport {
        let [mut penalty_before, mut moved2, mut gap2_before, mut gap2, mut penalty_after, mut objective] =
            zero::<I, 6>();
        let locals = blocks_mut::<D, K>(self.p).iter_mut().zip(blocks_mut::<D, K>(self.u));
        for (block, (tied, (here, dual))) in self.tied.blocks().zip(locals).enumerate() {
            let c = nodes::<I, D>(self.x, block, 0.0);
            let mut grad = nodes::<I, D>(self.grad, block, 0.0);
            for k in 0..K {
                let Slot { u, z, weight2 } = tied.nearest(k, c, dual);
                let p = load(&here[k]);
                let (before, v) = (sum(p, u), sum(c, u));
                penalty_before += weight2 * square(c, p);
                moved2 += weight2 * square(z, before);
                gap2_before += weight2 * square(c, before);
                gap2 += weight2 * square(c, z);
                penalty_after += weight2 * square(v, z);
                let u = match self.order {
                    Order::Xzu => gap(v, z),
                    Order::Zxu => u,
                };
                let p = gap(z, u);
                objective += weight2 * square(c, p);
                for d in 0..D {
                    grad[d] = weight2.mul_add(c[d] - p[d], grad[d]);
                }
                store(p, &mut here[k]);
                store(u, &mut dual[k]);
            }
            put_nodes(self.grad, block, grad);
        }
        LocalReport {
            penalty_before: 0.5 * penalty_before.sum(),
            moved2: moved2.sum(),
            gap2_before: gap2_before.sum(),
            gap2: gap2.sum(),
            penalty_after: 0.5 * penalty_after.sum(),
            objective: 0.5 * objective.sum(),
            ..LocalReport::default()
        }
    }
}

/// An iteration of the z-x-u order, after its images.
pub struct Sweep<'a, const D: usize, const K: usize, T> {
    pub x: &'a mut [f64],
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
    pub diagonal: &'a [f64],
    pub stiffness: &'a [f64],
    pub target: &'a [f64],
    pub tied: Tied<'a, D, K, T>,
}

impl<const D: usize, const K: usize, T: Ties> Kernel for Sweep<'_, D, K, T> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let locals = blocks_mut::<D, K>(self.p).iter_mut().zip(blocks_mut::<D, K>(self.u));
        for (block, (tied, (here, dual))) in self.tied.blocks().zip(locals).enumerate() {
            let c = nodes::<I, D>(self.x, block, 0.0);
            let (mut grad, mut z, mut p) = (zero::<I, D>(), [zero::<I, D>(); K], [zero::<I, D>(); K]);
            for k in 0..K {
                let slot = tied.nearest(k, c, dual);
                p[k] = gap(slot.z, slot.u);
                z[k] = sum(p[k], slot.u);
                for d in 0..D {
                    grad[d] = slot.weight2.mul_add(c[d] - p[k][d], grad[d]);
                }
            }
            let target = nodes::<I, D>(self.target, block, 0.0);
            let [stiffness] = nodes::<I, 1>(self.stiffness, block, 0.0);
            let [diagonal] = nodes::<I, 1>(self.diagonal, block, 1.0);
            let mut x = c;
            for d in 0..D {
                x[d] = c[d] - (grad[d] + stiffness * (c[d] - target[d])) / diagonal;
            }
            put_nodes(self.x, block, x);
            for k in 0..K {
                let u = gap(x, p[k]);
                store(u, &mut dual[k]);
                store(gap(z[k], u), &mut here[k]);
            }
        }
    }
}
