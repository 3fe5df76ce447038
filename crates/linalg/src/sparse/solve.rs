//! Triangular solves over the tree of groups.

use super::SparseError;
use super::factor::{Cholesky, Purpose, power_of_two_below};
use super::memory::{Lines, Shared};
use super::pattern::check_length;
use super::sweep::{Step, Sweep, stride};
use super::vector::Scalar;

/// Memory that solves work in. One scratch serves any factor, precision and number of right-hand sides; it grows
/// at the first solve that needs more and then stays, so that later solves allocate nothing.
#[derive(Default)]
pub struct SolveScratch {
    lines: Lines,
    /// First line of each group's room.
    room: Vec<usize>,
}

impl SolveScratch {
    /// An empty scratch.
    pub fn new() -> Self {
        Self::default()
    }
}

impl<T: Scalar> Cholesky<T> {
    /// Solves A X = B in place: `rhs` is n x nrhs, row by row (the right-hand sides of an unknown are neighbours).
    ///
    /// Up to four right-hand sides share one pass over the factor. Runs on the current rayon pool, with the same
    /// result to the last bit on any number of threads. With an `f32` factor the result has six or seven digits.
    ///
    /// # Errors
    /// `rhs` of the wrong length, or a factor without numbers.
    pub fn solve_in_place(&self, rhs: &mut [f64], nrhs: usize, scratch: &mut SolveScratch) -> Result<(), SparseError> {
        let n = self.symbolic.n();
        check_length("rhs", rhs.len(), n.saturating_mul(nrhs))?;
        if !self.factored {
            return Err(SparseError::NotFactored);
        }
        if n == 0 || nrhs == 0 {
            return Ok(());
        }
        let (mut first, data) = (0, Shared::new(rhs.as_mut_ptr()));
        while first < nrhs {
            let count = (nrhs - first).min(4);
            match count {
                1 => self.solve_some::<1>(data, nrhs, first, scratch),
                2 => self.solve_some::<2>(data, nrhs, first, scratch),
                3 => self.solve_some::<3>(data, nrhs, first, scratch),
                _ => self.solve_some::<4>(data, nrhs, first, scratch),
            }
            first += count;
        }
        Ok(())
    }

    fn solve_some<const NR: usize>(&self, rhs: Shared<f64>, nrhs: usize, first: usize, scratch: &mut SolveScratch) {
        let layout = &self.layout;
        let (lanes, stride) = (T::LANES, stride(NR));
        let groups = layout.widest.len();
        let mut lines = (layout.vector[groups] * stride).div_ceil(lanes) + groups;
        scratch.room.clear();
        for &(w, blocks) in &layout.widest {
            scratch.room.push(lines);
            lines += (w * stride).div_ceil(lanes).max(blocks * NR);
        }
        scratch.lines.reserve(lines);
        let task = Task::<T, NR> {
            factor: self,
            unit: self.column_units(rhs, nrhs, first),
            rhs,
            nrhs,
            first,
            room: &scratch.room,
            lines: Shared::new(scratch.lines.as_mut_ptr()),
        };
        let roots = &layout.roots;
        task.forward(roots);
        task.backward(roots);
    }

    /// For each right-hand side the power of two that brings it within the range of T, where that is scaled.
    fn column_units<const NR: usize>(&self, rhs: Shared<f64>, nrhs: usize, first: usize) -> [f64; NR] {
        let mut most = [0.0f64; NR];
        if T::SCALED {
            for (&scale, &old) in self.scale.iter().zip(self.symbolic.permutation.forward()) {
                for c in 0..NR {
                    // SAFETY: rhs has n rows of nrhs values; no task runs.
                    let b = unsafe { *rhs.at(old as usize * nrhs + first + c) };
                    most[c] = most[c].max((b * scale).abs());
                }
            }
        }
        most.map(|v| if v.is_normal() { power_of_two_below(v) } else { 1.0 })
    }
}

struct Task<'a, T: Scalar, const NR: usize> {
    factor: &'a Cholesky<T>,
    rhs: Shared<f64>,
    /// Power of two that each right-hand side is divided by.
    unit: [f64; NR],
    nrhs: usize,
    first: usize,
    room: &'a [usize],
    lines: Shared<T>,
}

impl<T: Scalar, const NR: usize> Task<'_, T, NR> {
    fn forward(&self, groups: &[u32]) {
        match groups {
            [] => {}
            [g] => {
                self.forward(&self.factor.symbolic.groups[*g as usize].children);
                self.forward_group(*g as usize);
            }
            _ => {
                let (a, b) = groups.split_at(groups.len() / 2);
                rayon::join(|| self.forward(a), || self.forward(b));
            }
        }
    }

    fn backward(&self, groups: &[u32]) {
        match groups {
            [] => {}
            [g] => {
                self.backward_group(*g as usize);
                self.backward(&self.factor.symbolic.groups[*g as usize].children);
            }
            _ => {
                let (a, b) = groups.split_at(groups.len() / 2);
                rayon::join(|| self.backward(a), || self.backward(b));
            }
        }
    }

    /// The vector of group g.
    fn vector(&self, g: usize) -> *mut T {
        let row = self.factor.layout.vector[g];
        // A line more for each group, so that vectors start on their own.
        let line = (row * stride(NR)).div_ceil(T::LANES) + g;
        // SAFETY: laid out by `solve_some`; one task a group.
        unsafe { self.lines.at(line * T::LANES) }
    }

    fn sweep(&self, g: usize, forward: bool) {
        let factor = self.factor;
        let (symbolic, layout) = (&*factor.symbolic, &factor.layout);
        let panels: *const T = factor.panels.as_ptr();
        let step = |s: usize| {
            let (from, to) = (layout.index_ptr[s], layout.index_ptr[s + 1]);
            let (w, blocks) = (symbolic.supernodes[s].width, (to - from) / T::LANES);
            Step {
                w,
                blocks,
                product: match factor.purpose {
                    Purpose::ManySolves => blocks,
                    Purpose::FewSolves => w.div_ceil(T::LANES),
                },
                // SAFETY: offsets of the layout.
                panel: unsafe { panels.add(layout.panel[s] * T::LANES) },
                index: layout.index[from..to].as_ptr(),
            }
        };
        let sweep = Sweep::<T, _, NR> {
            step: &step,
            range: symbolic.groups[g].supernodes.clone(),
            vector: self.vector(g),
            // SAFETY: laid out by `solve_some`.
            room: unsafe { self.lines.at(self.room[g] * T::LANES) },
            forward,
        };
        T::dispatch(factor.level, sweep);
    }

    fn forward_group(&self, g: usize) {
        let (symbolic, stride) = (&*self.factor.symbolic, stride(NR));
        let group = &symbolic.groups[g];
        let own = group.columns.len();
        let rows = self.factor.layout.vector[g + 1] - self.factor.layout.vector[g];
        let vector = self.vector(g);
        // SAFETY: the vector has `rows` rows; each entry of rhs belongs to one column of one group; children are done.
        unsafe {
            for (k, &old) in symbolic.permutation.forward()[group.columns.clone()].iter().enumerate() {
                let from = self.rhs.at(old as usize * self.nrhs + self.first);
                let scale = self.scale(group.columns.start + k);
                for c in 0..NR {
                    *vector.add(k * stride + c) =
                        T::from_f64(if T::SCALED { *from.add(c) * scale / self.unit[c] } else { *from.add(c) });
                }
                for c in NR..stride {
                    *vector.add(k * stride + c) = T::default();
                }
            }
            std::ptr::write_bytes(vector.add(own * stride), 0, (rows - own) * stride);
            for &child in &group.children {
                let from = self.vector(child as usize).add(symbolic.groups[child as usize].columns.len() * stride);
                for (k, &place) in symbolic.groups[child as usize].to_parent.iter().enumerate() {
                    for c in 0..stride {
                        let to = vector.add(place as usize * stride + c);
                        *to = T::sum(*to, *from.add(k * stride + c));
                    }
                }
            }
        }
        self.sweep(g, true);
    }

    fn backward_group(&self, g: usize) {
        let (symbolic, stride) = (&*self.factor.symbolic, stride(NR));
        let group = &symbolic.groups[g];
        let vector = self.vector(g);
        // SAFETY: as `forward_group`; the parent is done.
        unsafe {
            let to = vector.add(group.columns.len() * stride);
            for (k, &place) in group.to_parent.iter().enumerate() {
                let from = self.vector(group.parent as usize).add(place as usize * stride);
                std::ptr::copy_nonoverlapping(from, to.add(k * stride), stride);
            }
            // What the padding of panels gathers, times zero.
            std::ptr::write_bytes(to.add(group.to_parent.len() * stride), 0, stride);
        }
        self.sweep(g, false);
        // SAFETY: as `forward_group`.
        unsafe {
            for (k, &old) in symbolic.permutation.forward()[group.columns.clone()].iter().enumerate() {
                let to = self.rhs.at(old as usize * self.nrhs + self.first);
                let scale = self.scale(group.columns.start + k);
                for c in 0..NR {
                    let x = (*vector.add(k * stride + c)).to_f64();
                    *to.add(c) = if T::SCALED { x * scale * self.unit[c] } else { x };
                }
            }
        }
    }

    #[inline(always)]
    fn scale(&self, j: usize) -> f64 {
        if T::SCALED { self.factor.scale[j] } else { 1.0 }
    }
}
