//! An energy over many elements at once: where dynamic dispatch ends.
//!
//! A batch of elements knows its energy by this trait alone, one call for several blocks, so that the geometry (gathering,
//! decompositions, forces) is compiled once for each shape, not once for each energy and shape.

use super::stretch_hessian::{curvatures, stretch_hessian};
use crate::energy::{Energy, Limited};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use proxel_split::Projection;

/// What [`Density::prox`] did, summed over the blocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct ProxSums {
    /// sum V psi at the old stretches.
    pub value_before: f64,
    /// sum V psi at the new ones.
    pub value_after: f64,
    /// Elements that missed the tolerance.
    pub missed: u64,
}

/// A density psi over K principal stretches, on blocks of eight elements: `[block][K][lane]` for stretches and their
/// gradients, `[block][lane]` for numbers of elements.
pub trait Density<const K: usize>: Send + Sync {
    /// Replaces the stretches `v` by argmin psi(s) + k/2 |s - v|^2, k = weight2 / measure, and `warm`, the guess, by the
    /// same. Only the first `n_elems` elements are counted.
    fn prox(&self, v: &mut [f64], warm: &mut [f64], weight2: &[f64], measure: &[f64], n_elems: usize) -> ProxSums;

    /// sum V psi(s), hard limits left out: [`Energy::smooth_value`].
    fn value(&self, s: &[f64], measure: &[f64]) -> f64;

    /// As [`Density::prox`], over stretches in [low, high]: that of [`Limited`].
    fn prox_within(
        &self,
        limits: (f64, f64),
        v: &mut [f64],
        warm: &mut [f64],
        weight2: &[f64],
        measure: &[f64],
        n_elems: usize,
    ) -> ProxSums;

    /// Hard limits that the density has of its own: [`Energy::limits`].
    fn limits(&self) -> Option<(f64, f64)>;

    /// Whether the density is infinite where a stretch is not positive: [`Energy::BARRIER`].
    fn is_barrier(&self) -> bool;

    /// Whether the density is a strictly convex quadratic of the stretches: [`Energy::QUADRATIC`].
    fn is_quadratic(&self) -> bool;

    /// Whether a solution has no element with a measure of zero or below: [`Energy::PROX_POSITIVE`].
    fn is_positive(&self) -> bool;

    /// [`Energy::level_bound`]
    fn level_bound(&self, level: f64) -> Option<(f64, f64)>;

    /// Replaces the stretches s by d psi / d s.
    fn gradient(&self, s: &mut [f64]);

    /// The Hessian of psi in the entries of F, in the frame of the stretches s and projected: `stretch_hessian` says how
    /// it is laid out.
    fn hessian(&self, s: &[f64], projection: Projection, out: &mut [f64]);

    /// The largest eigenvalue of the Hessian at s, W(20), element by element.
    fn effective_stiffness(&self, s: &[f64], out: &mut [f64]);

    /// The same at rest, W(21).
    fn rest_stiffness(&self) -> f64;

    /// The Frobenius norm of the Hessian at rest.
    fn rest_hessian_norm(&self) -> f64;

    /// [`Energy::slope_stiffness`]
    fn slope_stiffness(&self) -> f64;

    /// [`Energy::mean_stiffness`]
    fn mean_stiffness(&self) -> f64;
}

struct ProxKernel<'a, E, const K: usize> {
    energy: &'a E,
    v: &'a mut [f64],
    warm: &'a mut [f64],
    weight2: &'a [f64],
    measure: &'a [f64],
    n_elems: usize,
}

impl<E: Energy<K>, const K: usize> Kernel for ProxKernel<'_, E, K> {
    type Output = ProxSums;
    #[inline(always)]
    fn run<I: Isa>(self) -> ProxSums {
        let (mut before, mut after) = (F8::<I>::zero(), F8::<I>::zero());
        let mut missed = 0;
        for b in 0..self.measure.len() / LANES {
            let measure = F8::<I>::load_at(self.measure, b);
            let k = F8::<I>::load_at(self.weight2, b) / measure;
            let mut v = [F8::<I>::zero(); K];
            let mut warm = [F8::<I>::zero(); K];
            for i in 0..K {
                v[i] = F8::load_at(self.v, b * K + i);
                warm[i] = F8::load_at(self.warm, b * K + i);
            }
            before = self.energy.value(warm).mul_add(measure, before);
            let prox = self.energy.prox(v, k, warm);
            after = self.energy.value(prox.s).mul_add(measure, after);
            for i in 0..K {
                prox.s[i].store_at(self.v, b * K + i);
                prox.s[i].store_at(self.warm, b * K + i);
            }
            let used = (self.n_elems - (b * LANES).min(self.n_elems)).min(LANES) as u32;
            missed += u64::from((!prox.converged.bits() & ((1u16 << used) - 1) as u8).count_ones());
        }
        ProxSums { value_before: before.sum(), value_after: after.sum(), missed }
    }
}

struct ValueKernel<'a, E, const K: usize> {
    energy: &'a E,
    s: &'a [f64],
    measure: &'a [f64],
}

impl<E: Energy<K>, const K: usize> Kernel for ValueKernel<'_, E, K> {
    type Output = f64;
    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let mut value = F8::<I>::zero();
        for b in 0..self.measure.len() / LANES {
            let mut s = [F8::<I>::zero(); K];
            for i in 0..K {
                s[i] = F8::load_at(self.s, b * K + i);
            }
            value = self.energy.smooth_value(s).mul_add(F8::load_at(self.measure, b), value);
        }
        value.sum()
    }
}

struct GradientKernel<'a, E, const K: usize> {
    energy: &'a E,
    s: &'a mut [f64],
}

impl<E: Energy<K>, const K: usize> Kernel for GradientKernel<'_, E, K> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for b in 0..self.s.len() / (K * LANES) {
            let mut s = [F8::<I>::zero(); K];
            for i in 0..K {
                s[i] = F8::load_at(self.s, b * K + i);
            }
            let g = self.energy.gradient(s);
            for i in 0..K {
                g[i].store_at(self.s, b * K + i);
            }
        }
    }
}

struct StiffnessKernel<'a, E, const K: usize> {
    energy: &'a E,
    s: &'a [f64],
    out: &'a mut [f64],
}

impl<E: Energy<K>, const K: usize> Kernel for StiffnessKernel<'_, E, K> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for b in 0..self.out.len() / LANES {
            let mut s = [F8::<I>::zero(); K];
            for i in 0..K {
                s[i] = F8::load_at(self.s, b * K + i);
            }
            self.energy.effective_stiffness(s).store_at(self.out, b);
        }
    }
}

struct HessianKernel<'a, E, const K: usize> {
    energy: &'a E,
    s: &'a [f64],
    projection: Projection,
    out: &'a mut [f64],
}

impl<E: Energy<K>, const K: usize> Kernel for HessianKernel<'_, E, K> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for b in 0..self.s.len() / (K * LANES) {
            let mut s = [F8::<I>::zero(); K];
            for i in 0..K {
                s[i] = F8::load_at(self.s, b * K + i);
            }
            let h = stretch_hessian(self.energy, s, self.projection);
            for c in 0..curvatures(K) {
                h[c].store_at(self.out, b * curvatures(K) + c);
            }
        }
    }
}

impl<E: Energy<K>, const K: usize> Density<K> for E {
    fn prox(&self, v: &mut [f64], warm: &mut [f64], weight2: &[f64], measure: &[f64], n_elems: usize) -> ProxSums {
        dispatch(ProxKernel::<E, K> { energy: self, v, warm, weight2, measure, n_elems })
    }

    fn value(&self, s: &[f64], measure: &[f64]) -> f64 {
        dispatch(ValueKernel::<E, K> { energy: self, s, measure })
    }

    fn prox_within(
        &self,
        (low, high): (f64, f64),
        v: &mut [f64],
        warm: &mut [f64],
        weight2: &[f64],
        measure: &[f64],
        n_elems: usize,
    ) -> ProxSums {
        match Limited::new(self.clone(), low, high) {
            Ok(limited) => {
                dispatch(ProxKernel::<Limited<E>, K> { energy: &limited, v, warm, weight2, measure, n_elems })
            }
            // Limits that leave no room leave no prox either: every element has missed.
            Err(_) => ProxSums { missed: n_elems as u64, ..ProxSums::default() },
        }
    }

    fn limits(&self) -> Option<(f64, f64)> {
        Energy::limits(self)
    }

    fn is_barrier(&self) -> bool {
        E::BARRIER
    }

    fn is_quadratic(&self) -> bool {
        E::QUADRATIC
    }

    fn is_positive(&self) -> bool {
        E::PROX_POSITIVE
    }

    fn level_bound(&self, level: f64) -> Option<(f64, f64)> {
        Energy::level_bound(self, level)
    }

    fn gradient(&self, s: &mut [f64]) {
        dispatch(GradientKernel::<E, K> { energy: self, s });
    }

    fn hessian(&self, s: &[f64], projection: Projection, out: &mut [f64]) {
        dispatch(HessianKernel::<E, K> { energy: self, s, projection, out });
    }

    fn effective_stiffness(&self, s: &[f64], out: &mut [f64]) {
        dispatch(StiffnessKernel::<E, K> { energy: self, s, out });
    }

    fn rest_stiffness(&self) -> f64 {
        Energy::rest_stiffness(self)
    }

    fn rest_hessian_norm(&self) -> f64 {
        self.hessian([1.0; K]).iter().flatten().map(|h: &f64| h * h).sum::<f64>().sqrt()
    }

    fn slope_stiffness(&self) -> f64 {
        Energy::slope_stiffness(self)
    }

    fn mean_stiffness(&self) -> f64 {
        Energy::mean_stiffness(self)
    }
}
