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

#[inline(always)]
fn each<I: Isa, const D: usize>(f: impl FnMut(usize) -> F8<I>) -> [F8<I>; D] {
    std::array::from_fn(f)
}

/// The numbers of eight nodes, which lie node by node.
#[inline(always)]
fn apart<I: Isa, const D: usize>(x: &[f64]) -> [F8<I>; D] {
    match x.first_chunk() {
        Some(eight) if D == 2 => {
            let pair = F8::pairs(eight);
            each(|d| pair[d])
        }
        _ => each(|d| F8::of(std::array::from_fn(|lane| x[D * lane + d]))),
    }
}

#[inline(always)]
fn join<I: Isa, const D: usize>(v: [F8<I>; D], x: &mut [f64]) {
    match x.first_chunk_mut() {
        Some(eight) if D == 2 => F8::put_pairs([v[0], v[D - 1]], eight),
        _ => {
            let v = v.map(F8::to_array);
            x.iter_mut().enumerate().for_each(|(i, x)| *x = v[i % D][i / D]);
        }
    }
}

/// Those of a block; the filler where there are fewer nodes.
#[inline(always)]
fn nodes<I: Isa, const D: usize>(x: &[f64], block: usize, filler: f64) -> [F8<I>; D] {
    let rest = x.get(block * D * LANES..).unwrap_or_default();
    if rest.len() >= D * LANES {
        return if D == 1 { each(|_| F8::load_at(rest, 0)) } else { apart(&rest[..D * LANES]) };
    }
    let lanes = |d: usize| std::array::from_fn(|lane| rest.get(D * lane + d).copied().unwrap_or(filler));
    each(|d| F8::of(lanes(d)))
}

#[inline(always)]
fn put_nodes<I: Isa, const D: usize>(x: &mut [f64], block: usize, v: [F8<I>; D]) {
    let rest = x.get_mut(block * D * LANES..).unwrap_or_default();
    let here = rest.len().min(D * LANES);
    match here == D * LANES && D == 1 {
        true => v[0].store_at(rest, 0),
        false => join(v, &mut rest[..here]),
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
        let dot = |a: &[Lanes; D], v: [F8<I>; D]| {
            let first = F8::load(&a[0]) * v[0];
            (1..D).fold(first, |sum, d| sum + F8::load(&a[d]) * v[d])
        };
        let images: &mut [[Lanes; K]] = self.images.as_chunks_mut().0.as_chunks_mut().0;
        let u = self.u.map(blocks::<D, K>);
        for (block, (direction, images)) in blocks::<D, K>(self.direction).iter().zip(images).enumerate() {
            let c = nodes::<I, D>(self.x, block, 0.0);
            match u {
                Some(u) => {
                    for k in 0..K {
                        dot(&direction[k], each(|d| c[d] + F8::load(&u[block][k][d]))).store(&mut images[k]);
                    }
                }
                None => (0..K).for_each(|k| dot(&direction[k], c).store(&mut images[k])),
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
        let u = each(|d| F8::load(&u[k][d]));
        let z = each(|d| (c[d] + u[d]) - excess * F8::load(&self.direction[k][d]));
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

/// |a - b|^2
#[inline(always)]
fn square<I: Isa, const D: usize>(a: [F8<I>; D], b: [F8<I>; D]) -> F8<I> {
    let gap: [F8<I>; D] = each(|d| a[d] - b[d]);
    (1..D).fold(gap[0] * gap[0], |sum, d| sum + gap[d] * gap[d])
}

impl<const D: usize, const K: usize, T: Ties> Kernel for Local<'_, D, K, T> {
    type Output = LocalReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> LocalReport {
        let zero = F8::<I>::splat(0.0);
        let [mut penalty_before, mut moved2, mut gap2_before, mut gap2, mut penalty_after, mut objective] = [zero; 6];
        let locals = blocks_mut::<D, K>(self.p).iter_mut().zip(blocks_mut::<D, K>(self.u));
        for (block, (tied, (here, dual))) in self.tied.blocks().zip(locals).enumerate() {
            let c = nodes::<I, D>(self.x, block, 0.0);
            let mut grad = nodes::<I, D>(self.grad, block, 0.0);
            for k in 0..K {
                let Slot { u, z, weight2 } = tied.nearest(k, c, dual);
                let p = each(|d| F8::load(&here[k][d]));
                let before: [F8<I>; D] = each(|d| p[d] + u[d]);
                let v: [F8<I>; D] = each(|d| c[d] + u[d]);
                penalty_before += weight2 * square(c, p);
                moved2 += weight2 * square(z, before);
                gap2_before += weight2 * square(c, before);
                gap2 += weight2 * square(c, z);
                penalty_after += weight2 * square(v, z);
                let u = match self.order {
                    Order::Xzu => each(|d| v[d] - z[d]),
                    Order::Zxu => u,
                };
                let p = each(|d| z[d] - u[d]);
                objective += weight2 * square(c, p);
                for d in 0..D {
                    grad[d] = weight2.mul_add(c[d] - p[d], grad[d]);
                    p[d].store(&mut here[k][d]);
                    u[d].store(&mut dual[k][d]);
                }
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
        let zero = F8::<I>::splat(0.0);
        let locals = blocks_mut::<D, K>(self.p).iter_mut().zip(blocks_mut::<D, K>(self.u));
        for (block, (tied, (here, dual))) in self.tied.blocks().zip(locals).enumerate() {
            let c = nodes::<I, D>(self.x, block, 0.0);
            let (mut grad, mut z, mut p) = ([zero; D], [[zero; D]; K], [[zero; D]; K]);
            for k in 0..K {
                let slot = tied.nearest(k, c, dual);
                for d in 0..D {
                    p[k][d] = slot.z[d] - slot.u[d];
                    z[k][d] = p[k][d] + slot.u[d];
                    grad[d] = slot.weight2.mul_add(c[d] - p[k][d], grad[d]);
                }
            }
            let target = nodes::<I, D>(self.target, block, 0.0);
            let [stiffness] = nodes::<I, 1>(self.stiffness, block, 0.0);
            let [diagonal] = nodes::<I, 1>(self.diagonal, block, 1.0);
            let x: [F8<I>; D] = each(|d| c[d] - (grad[d] + stiffness * (c[d] - target[d])) / diagonal);
            put_nodes(self.x, block, x);
            for k in 0..K {
                for d in 0..D {
                    let u = x[d] - p[k][d];
                    u.store(&mut dual[k][d]);
                    (z[k][d] - u).store(&mut here[k][d]);
                }
            }
        }
    }
}
