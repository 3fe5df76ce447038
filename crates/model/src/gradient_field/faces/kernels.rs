//! The passes over a task's faces, in lanes of eight.

use super::{PAIRS, SLOTS, X};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real};
use proxel_split::{LocalReport, Order};

/// What is known of the slots of a task, in the layouts of the term.
#[derive(Clone, Copy)]
pub struct Tied<'a> {
    /// Of these slots.
    pub direction: &'a [f64],
    pub other: &'a [u32],
    pub foreign: &'a [f64],
    pub weight2: &'a [f64],
    /// Those before them.
    pub before: usize,
    /// Of all.
    pub images: &'a [f64],
}

/// Two numbers of each of eight faces, which lie face by face; 0 where there are fewer.
#[inline(always)]
fn pairs<I: Isa>(x: &[f64], block: usize) -> [F8<I>; 2] {
    let rest = x.get(block * X..).unwrap_or_default();
    if let Some(eight) = rest.first_chunk() {
        return F8::pairs(eight);
    }
    let mut some = [0.0; X];
    some[..rest.len()].copy_from_slice(rest);
    F8::pairs(&some)
}

#[inline(always)]
fn put_pairs<I: Isa>(x: &mut [f64], block: usize, v: [F8<I>; 2]) {
    let rest = x.get_mut(block * X..).unwrap_or_default();
    if let Some(eight) = rest.first_chunk_mut() {
        return F8::put_pairs(v, eight);
    }
    let mut some = [0.0; X];
    F8::put_pairs(v, &mut some);
    rest.copy_from_slice(&some[..rest.len()]);
}

/// One number of each of eight faces; `filler` where there are fewer.
#[inline(always)]
fn ones<I: Isa>(a: &[f64], block: usize, filler: f64) -> F8<I> {
    let from = block * LANES;
    if a.len() >= from + LANES {
        return F8::load_at(a, block);
    }
    let mut lanes = [filler; LANES];
    let rest = a.get(from..).unwrap_or_default();
    lanes[..rest.len()].copy_from_slice(rest);
    F8::of(lanes)
}

/// e . (x + u), or e . x.
pub struct Images<'a> {
    pub x: &'a [f64],
    pub u: Option<&'a [f64]>,
    pub direction: &'a [f64],
    pub images: &'a mut [f64],
}

impl Kernel for Images<'_> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let (directions, images) = (self.direction.as_chunks::<PAIRS>().0, self.images.as_chunks_mut::<SLOTS>().0);
        for (block, (e, images)) in directions.iter().zip(images).enumerate() {
            let c = pairs::<I>(self.x, block);
            if let Some(u) = self.u {
                let u: &[f64; PAIRS] = &u.as_chunks().0[block];
                for k in 0..3 {
                    let (v0, v1) = (c[0] + F8::load_at(u, 2 * k), c[1] + F8::load_at(u, 2 * k + 1));
                    (F8::load_at(e, 2 * k) * v0 + F8::load_at(e, 2 * k + 1) * v1).store_at(images, k);
                }
            } else {
                for k in 0..3 {
                    (F8::load_at(e, 2 * k) * c[0] + F8::load_at(e, 2 * k + 1) * c[1]).store_at(images, k);
                }
            }
        }
    }
}

/// A slot of eight faces.
struct Slot<I: Isa> {
    u: [F8<I>; 2],
    z: [F8<I>; 2],
    weight2: F8<I>,
}

/// A block of what is known.
struct Block<'a> {
    direction: &'a [f64; PAIRS],
    other: &'a [[u32; LANES]],
    foreign: &'a [f64; SLOTS],
    weight2: &'a [f64; SLOTS],
    own: &'a [f64; SLOTS],
    images: &'a [f64],
}

impl<'a> Tied<'a> {
    /// All blocks, one after the other.
    #[inline(always)]
    fn blocks(&self) -> impl Iterator<Item = Block<'a>> + use<'a> {
        let images = self.images;
        let own = images[self.before..].as_chunks().0;
        let slots = self.foreign.as_chunks().0.iter().zip(self.weight2.as_chunks().0).zip(own);
        let others = self.other.as_chunks::<LANES>().0.chunks_exact(3);
        slots.zip(self.direction.as_chunks().0).zip(others).map(
            move |((((foreign, weight2), own), direction), other)| Block {
                direction,
                other,
                foreign,
                weight2,
                own,
                images,
            },
        )
    }
}

impl Block<'_> {
    /// z, the nearest point, for the k-th edges.
    #[inline(always)]
    fn nearest<I: Isa>(&self, k: usize, c: [F8<I>; 2], u: &[f64; PAIRS]) -> Slot<I> {
        let apart = F8::load_at(self.own, k) - F8::gather(self.images, &self.other[k], 1, 0);
        let excess = F8::load_at(self.foreign, k) * apart;
        let u = [F8::load_at(u, 2 * k), F8::load_at(u, 2 * k + 1)];
        let e = [F8::load_at(self.direction, 2 * k), F8::load_at(self.direction, 2 * k + 1)];
        let z = [(c[0] + u[0]) - excess * e[0], (c[1] + u[1]) - excess * e[1]];
        Slot { u, z, weight2: F8::load_at(self.weight2, k) }
    }
}

/// The local step: A(6) first line, or A(5) second and third, with the gradient of the penalty.
pub struct Local<'a> {
    pub order: Order,
    pub x: &'a [f64],
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
    pub grad: &'a mut [f64],
    pub tied: Tied<'a>,
}

/// (a - b)^2
#[inline(always)]
fn square<I: Isa>(a: [F8<I>; 2], b: [F8<I>; 2]) -> F8<I> {
    let (d0, d1) = (a[0] - b[0], a[1] - b[1]);
    d0 * d0 + d1 * d1
}

impl Kernel for Local<'_> {
    type Output = LocalReport;
    #[inline(always)]
    fn run<I: Isa>(self) -> LocalReport {
        let zero = F8::<I>::splat(0.0);
        let [mut penalty_before, mut moved2, mut gap2_before, mut gap2, mut penalty_after, mut objective] = [zero; 6];
        let locals = self.p.as_chunks_mut::<PAIRS>().0.iter_mut().zip(self.u.as_chunks_mut::<PAIRS>().0);
        for (block, (tied, (here, dual))) in self.tied.blocks().zip(locals).enumerate() {
            let c = pairs::<I>(self.x, block);
            let mut grad = pairs::<I>(self.grad, block);
            for k in 0..3 {
                let Slot { u, z, weight2 } = tied.nearest(k, c, dual);
                let p = [F8::load_at(here, 2 * k), F8::load_at(here, 2 * k + 1)];
                let before = [p[0] + u[0], p[1] + u[1]];
                let v = [c[0] + u[0], c[1] + u[1]];
                penalty_before += weight2 * square(c, p);
                moved2 += weight2 * square(z, before);
                gap2_before += weight2 * square(c, before);
                gap2 += weight2 * square(c, z);
                penalty_after += weight2 * square(v, z);
                let u = match self.order {
                    Order::Xzu => [v[0] - z[0], v[1] - z[1]],
                    Order::Zxu => u,
                };
                let p = [z[0] - u[0], z[1] - u[1]];
                objective += weight2 * square(c, p);
                for d in 0..2 {
                    grad[d] = weight2.mul_add(c[d] - p[d], grad[d]);
                    p[d].store_at(here, 2 * k + d);
                    u[d].store_at(dual, 2 * k + d);
                }
            }
            put_pairs(self.grad, block, grad);
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
pub struct Sweep<'a> {
    pub x: &'a mut [f64],
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
    pub diagonal: &'a [f64],
    pub stiffness: &'a [f64],
    pub target: &'a [f64],
    pub tied: Tied<'a>,
}

impl Kernel for Sweep<'_> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let zero = F8::<I>::splat(0.0);
        let locals = self.p.as_chunks_mut::<PAIRS>().0.iter_mut().zip(self.u.as_chunks_mut::<PAIRS>().0);
        for (block, (tied, (here, dual))) in self.tied.blocks().zip(locals).enumerate() {
            let c = pairs::<I>(self.x, block);
            let (mut grad, mut z, mut p) = ([zero; 2], [[zero; 2]; 3], [[zero; 2]; 3]);
            for k in 0..3 {
                let slot = tied.nearest(k, c, dual);
                for d in 0..2 {
                    p[k][d] = slot.z[d] - slot.u[d];
                    z[k][d] = p[k][d] + slot.u[d];
                    grad[d] = slot.weight2.mul_add(c[d] - p[k][d], grad[d]);
                }
            }
            let target = pairs::<I>(self.target, block);
            let (stiffness, diagonal) = (ones::<I>(self.stiffness, block, 0.0), ones::<I>(self.diagonal, block, 1.0));
            let mut x = c;
            for d in 0..2 {
                x[d] = c[d] - (grad[d] + stiffness * (c[d] - target[d])) / diagonal;
            }
            put_pairs(self.x, block, x);
            for k in 0..3 {
                for d in 0..2 {
                    let u = x[d] - p[k][d];
                    u.store_at(dual, 2 * k + d);
                    (z[k][d] - u).store_at(here, 2 * k + d);
                }
            }
        }
    }
}
