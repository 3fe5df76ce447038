//! Multifrontal numeric factorisation.

use super::SparseError;
use super::assemble::{AddChild, Part, add_entries};
use super::dense::{BadPivot, FactorBand, FactorRows, Update};
use super::etree::NONE;
use super::front::FrontMemory;
use super::invert::{Invert, copy_triangle};
use super::layout::Layout;
use super::memory::{Lines, Pages, Shared};
use super::pattern::check_length;
use super::symbolic::Symbolic;
use super::vector::Scalar;
use crate::simd::Level;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Column blocks factored before the rows below them, so that those can be shared among threads.
const BAND: usize = 16;
/// Products above this many multiply-adds are shared among threads.
const SPLIT: f64 = 4e6;

/// What a factor is made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Purpose {
    /// Many solves: for each supernode `L11^-1` and `-L21 L11^-1` are kept, so that a solve is one product with each.
    #[default]
    ManySolves,
    /// A few: `L11^-1` and `L21` are, which saves the factorisation the second product, and costs a solve a second step
    /// within each supernode.
    FewSolves,
}

/// A Cholesky factor A = P^T L L^T P of a symmetric positive definite matrix, kept as a solve reads it, see [`Purpose`].
///
/// `T` is the precision of the factor. An `f32` factor is made of the matrix scaled to a unit diagonal by powers
/// of two, so that its exponent range does not matter; its solves have six or seven digits ([`super::MixedCholesky`] corrects them).
///
/// The result does not depend on the number of threads, to the last bit.
///
/// ```
/// use proxel_linalg::sparse::{Cholesky, Ordering, SolveScratch, SymPattern, Symbolic};
/// use std::sync::Arc;
/// let pattern = SymPattern::from_edges(2, &[[0, 1]])?; // slots: (0,0), (1,0), (1,1)
/// let symbolic = Arc::new(Symbolic::analyze(&pattern, Ordering::Auto)?);
/// let mut factor = Cholesky::<f64>::new(symbolic);
/// factor.refactor(&[2.0, 1.0, 2.0])?;
/// let mut x = [3.0, 3.0];
/// factor.solve_in_place(&mut x, 1, &mut SolveScratch::new())?;
/// assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 1.0).abs() < 1e-15);
/// # Ok::<(), proxel_linalg::sparse::SparseError>(())
/// ```
pub struct Cholesky<T: Scalar> {
    pub(super) symbolic: Arc<Symbolic>,
    pub(super) layout: Layout,
    pub(super) panels: Lines,
    arena: Lines,
    /// Powers of two near `1 / sqrt(a_ii)`, new order; empty if the precision is not scaled.
    pub(super) scale: Vec<f64>,
    pub(super) factored: bool,
    pub(super) level: Level,
    pub(super) purpose: Purpose,
    precision: PhantomData<T>,
}

impl<T: Scalar> Cholesky<T> {
    /// A factor for many solves, without numbers yet; all memory is taken here.
    pub fn new(symbolic: Arc<Symbolic>) -> Self {
        Self::with_level(symbolic, Level::best())
    }

    /// The same for another purpose. Results differ in rounding.
    pub fn for_purpose(symbolic: Arc<Symbolic>, purpose: Purpose) -> Self {
        Self::with(symbolic, Level::best(), purpose)
    }

    /// As [`Self::new`], with kernels for this instruction set (or the best of this machine, if that is less).
    /// Results under different instruction sets differ in rounding.
    pub fn with_level(symbolic: Arc<Symbolic>, level: Level) -> Self {
        Self::with(symbolic, level, Purpose::default())
    }

    fn with(symbolic: Arc<Symbolic>, level: Level, purpose: Purpose) -> Self {
        let layout = Layout::new(&symbolic, T::LANES);
        let pages = match purpose {
            Purpose::ManySolves => Pages::Huge,
            Purpose::FewSolves => Pages::Small,
        };
        let panels = Lines::new(layout.panel[layout.panel.len() - 1], pages);
        Self {
            layout,
            panels,
            arena: Lines::default(),
            scale: Vec::new(),
            factored: false,
            level,
            purpose,
            precision: PhantomData,
            symbolic,
        }
    }

    /// The analysis that this factor was made from.
    pub fn symbolic(&self) -> &Arc<Symbolic> {
        &self.symbolic
    }

    /// Bytes held: the factor itself, and the workspace of factorisations.
    pub fn bytes(&self) -> (usize, usize) {
        (self.panels.len() * 64, self.layout.arena * 64)
    }

    /// Computes the numbers of the factor from the values of the pattern's entries.
    ///
    /// Runs on the current rayon pool. The workspace is kept for the next call; see [`Self::release_workspace`].
    ///
    /// # Errors
    /// Values of the wrong length, NaN or infinite; a pivot that is not positive, or that is lost in rounding.
    /// The factor then holds no numbers.
    pub fn refactor(&mut self, values: &[f64]) -> Result<(), SparseError> {
        self.factor(values, false)
    }

    /// As [`Self::refactor`], for matrices that may well not be positive definite: all work ends soon after the first pivot
    /// that fails. Whether one does is the same on any number of threads; which one is named is not.
    ///
    /// # Errors
    /// As [`Self::refactor`].
    pub fn refactor_if_definite(&mut self, values: &[f64]) -> Result<(), SparseError> {
        self.factor(values, true)
    }

    fn factor(&mut self, values: &[f64], stop_early: bool) -> Result<(), SparseError> {
        self.factored = false;
        check_length("values", values.len(), self.symbolic.nnz)?;
        self.arena.reserve(self.layout.arena);
        if T::SCALED {
            self.find_scale(values)?;
        }
        let job = Job::<T> {
            level: self.level,
            purpose: self.purpose,
            symbolic: &self.symbolic,
            layout: &self.layout,
            values,
            scale: &self.scale,
            panels: Shared::new(self.panels.as_mut_ptr()),
            arena: Shared::new(self.arena.as_mut_ptr()),
            stop_early,
            failed: AtomicBool::new(false),
            precision: PhantomData,
        };
        match job.children(&self.layout.roots) {
            Ok(()) => {
                self.factored = true;
                Ok(())
            }
            Err(failure) => Err(failure.error),
        }
    }

    /// Gives back the workspace of factorisations, which the next `refactor` takes anew. Solves do not need it.
    pub fn release_workspace(&mut self) {
        self.arena = Lines::default();
    }

    fn find_scale(&mut self, values: &[f64]) -> Result<(), SparseError> {
        let symbolic = &self.symbolic;
        self.scale.clear();
        self.scale.resize(symbolic.n(), 1.0);
        for node in &symbolic.supernodes {
            let block = symbolic.block;
            for entry in symbolic.entries[node.entries.clone()].iter().filter(|e| e.row == e.column) {
                for k in 0..block {
                    let j = node.first + entry.column as usize * block + k;
                    let value = values[entry.slot * block * block + k * block + k];
                    let column = symbolic.permutation.forward()[j] as usize;
                    if !value.is_finite() {
                        return Err(SparseError::NonFinite { row: column, column, value });
                    }
                    if value <= 0.0 {
                        return Err(SparseError::NotPositiveDefinite { column, pivot: value });
                    }
                    self.scale[j] = power_of_two_below(1.0 / value.sqrt());
                }
            }
        }
        Ok(())
    }
}

/// The power of two at or below a positive normal number.
pub(super) fn power_of_two_below(v: f64) -> f64 {
    f64::from_bits(v.to_bits() & 0x7ff0_0000_0000_0000)
}

/// An error, and where in the elimination order it arose.
struct Failure {
    column: usize,
    error: SparseError,
}

struct Job<'a, T: Scalar> {
    level: Level,
    purpose: Purpose,
    symbolic: &'a Symbolic,
    layout: &'a Layout,
    values: &'a [f64],
    scale: &'a [f64],
    panels: Shared<T>,
    arena: Shared<T>,
    stop_early: bool,
    failed: AtomicBool,
    precision: PhantomData<T>,
}

impl<T: Scalar> Job<'_, T> {
    /// Factors these groups and all below them. All of them run even if one fails, so that the same error is
    /// reported whatever the threads do: the first in elimination order.
    fn children(&self, groups: &[u32]) -> Result<(), Failure> {
        match groups {
            [] => Ok(()),
            [g] => {
                let group = &self.symbolic.groups[*g as usize];
                self.children(&group.children)?;
                self.group(*g as usize)
            }
            _ => {
                let (a, b) = groups.split_at(groups.len() / 2);
                match rayon::join(|| self.children(a), || self.children(b)) {
                    (Err(a), Err(b)) => Err(if a.column <= b.column { a } else { b }),
                    (a, b) => a.and(b),
                }
            }
        }
    }

    fn memory(&self, s: usize, work: usize) -> FrontMemory<T> {
        // SAFETY: offsets of the layout. A panel and an update matrix belong to one supernode, and a workspace to
        // one group; a parent's task starts after its children's have ended.
        unsafe {
            FrontMemory {
                front: self.layout.front(self.symbolic, s),
                panel: self.panels.at(self.layout.panel[s] * T::LANES),
                update: self.arena.at(self.layout.update[s] * T::LANES),
                work: self.arena.at(work * T::LANES),
            }
        }
    }

    fn group(&self, g: usize) -> Result<(), Failure> {
        for s in self.symbolic.groups[g].supernodes.clone() {
            if self.stop_early && self.failed.load(Ordering::Relaxed) {
                // Another one has failed; its pivot is the one to name.
                let column = self.symbolic.n();
                return Err(Failure { column, error: SparseError::NotFactored });
            }
            if let Err(failure) = self.supernode(s, self.layout.work[g]) {
                self.failed.store(true, Ordering::Relaxed);
                return Err(failure);
            }
        }
        Ok(())
    }

    fn supernode(&self, s: usize, work: usize) -> Result<(), Failure> {
        let node = &self.symbolic.supernodes[s];
        let memory = self.memory(s, work);
        let old = |row: usize| self.symbolic.permutation.forward()[row] as usize;
        let row_of = |row: usize| match row.checked_sub(node.width) {
            None => node.first + row,
            Some(below) => self.symbolic.rows[node.row_start + below] as usize,
        };
        let entries = &self.symbolic.entries[node.entries.clone()];
        let block = self.symbolic.block;
        // SAFETY: memory laid out for this front; slots were counted by the analysis.
        let added = unsafe {
            if T::SCALED {
                add_entries(&memory, entries, self.values, block, |row| self.scale[row_of(row)])
            } else {
                add_entries(&memory, entries, self.values, block, |_| 1.0)
            }
        };
        if let Err((row, column, value)) = added {
            let column = node.first + column;
            let error = SparseError::NonFinite { row: old(row_of(row)), column: old(column), value };
            return Err(Failure { column, error });
        }
        self.add_children(s, &memory, Part::Panel);
        self.factor_panel(&memory).map_err(|bad| {
            let column = node.first + bad.column;
            let scale = if T::SCALED { self.scale[column] } else { 1.0 };
            let pivot = bad.pivot.to_f64() / scale / scale;
            Failure { column, error: SparseError::NotPositiveDefinite { column: old(column), pivot } }
        })?;
        let front = memory.front;
        if node.parent != NONE {
            let flops = (front.update_blocks() * T::LANES).pow(2) as f64 / 2.0 * front.w as f64;
            over_blocks(0..front.update_blocks(), flops, &|rows| T::dispatch(self.level, Update { memory, rows }));
            self.add_children(s, &memory, Part::Update);
        }
        copy_triangle(&memory);
        let blocks = match self.purpose {
            Purpose::ManySolves => front.blocks(),
            // The last of them may hold rows of L21 too; they are multiplied as well.
            Purpose::FewSolves => front.triangle_blocks(),
        };
        let flops = (blocks * T::LANES * front.w * front.w) as f64 / 2.0;
        over_blocks(0..blocks, flops, &|rows| T::dispatch(self.level, Invert { memory, rows }));
        Ok(())
    }

    fn add_children(&self, s: usize, memory: &FrontMemory<T>, part: Part) {
        for &c in &self.symbolic.supernodes[s].children {
            let c = c as usize;
            let child = &self.symbolic.supernodes[c];
            let relative = &self.symbolic.relative[child.row_start..child.row_start + child.below];
            let front = self.layout.front(self.symbolic, c);
            // SAFETY: the child is done, and its update matrix stays until this supernode is.
            let update = unsafe { self.arena.at(self.layout.update[c] * T::LANES) };
            T::dispatch(self.level, AddChild { child: front, update, relative, parent: *memory, part });
        }
    }

    fn factor_panel(&self, memory: &FrontMemory<T>) -> Result<(), BadPivot<T>> {
        let front = memory.front;
        let (memory, bands, blocks) = (*memory, front.w.div_ceil(T::LANES), front.blocks());
        let mut start = 0;
        while start < bands {
            let end = (start + BAND).min(bands);
            T::dispatch(self.level, FactorBand { memory, bands: start..end })?;
            let width = ((end - start) * T::LANES) as f64;
            let flops = ((blocks - end) * T::LANES) as f64 * width * ((start + end) * T::LANES) as f64 / 2.0;
            over_blocks(end..blocks, flops, &|rows| {
                T::dispatch(self.level, FactorRows { memory, bands: start..end, rows });
            });
            start = end;
        }
        Ok(())
    }
}

/// Runs `kernel` on all row blocks, in halves on different threads while they are worth it. Blocks are
/// independent, so the split does not change any bit.
fn over_blocks<F: Fn(Range<usize>) + Sync>(rows: Range<usize>, flops: f64, kernel: &F) {
    if flops < SPLIT || rows.len() < 8 {
        if !rows.is_empty() {
            kernel(rows);
        }
        return;
    }
    let middle = rows.start + rows.len() / 2;
    rayon::join(
        || over_blocks(rows.start..middle, flops / 2.0, kernel),
        || over_blocks(middle..rows.end, flops / 2.0, kernel),
    );
}
