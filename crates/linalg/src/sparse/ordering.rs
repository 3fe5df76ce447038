//! Elimination orders.

use super::symbolic::invert;
use super::{SparseError, SymPattern, Symbolic};
use feral_metis::CscPattern;

/// How to choose the elimination order, which decides how many entries L has.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Ordering {
    /// What was fastest in total (order, analysis, factor and some hundred solves) on meshes of this size.
    #[default]
    Auto,
    /// Approximate minimum fill (Amestoy 1999).
    Amf,
    /// Approximate minimum degree (Amestoy, Davis and Duff 1996).
    Amd,
    /// Multilevel nested dissection (Karypis and Kumar 1998).
    NestedDissection,
    /// As numbered by the caller, but for a postorder of the elimination tree, which leaves the fill as it is.
    Natural,
    /// `perm[new] = old`, but for a postorder of the elimination tree.
    Given(Vec<u32>),
}

/// A permutation of 0..n, `perm[new] = old`, and its inverse.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Permutation {
    forward: Vec<u32>,
    inverse: Vec<u32>,
}

impl Permutation {
    /// Takes `perm[new] = old`.
    ///
    /// # Errors
    /// An index that is out of range or repeated.
    pub fn new(forward: Vec<u32>) -> Result<Self, SparseError> {
        let mut seen = vec![false; forward.len()];
        for (position, &value) in forward.iter().enumerate() {
            match seen.get_mut(value as usize) {
                Some(seen) if !*seen => *seen = true,
                _ => return Err(SparseError::NotPermutation { position, value: value as usize }),
            }
        }
        Ok(Self::from_valid(forward))
    }

    pub(super) fn from_valid(forward: Vec<u32>) -> Self {
        Self { inverse: invert(&forward), forward }
    }

    /// Number of indices.
    pub fn len(&self) -> usize {
        self.forward.len()
    }

    /// True for n = 0.
    pub fn is_empty(&self) -> bool {
        self.forward.is_empty()
    }

    /// `forward()[new] = old`.
    pub fn forward(&self) -> &[u32] {
        &self.forward
    }

    /// `inverse()[old] = new`.
    pub fn inverse(&self) -> &[u32] {
        &self.inverse
    }
}

/// The elimination order of a pattern, postorder of the elimination tree included: the order that
/// [`Symbolic::analyze`] would use.
///
/// # Errors
/// See [`Symbolic::analyze`].
pub fn order(pattern: &SymPattern, ordering: Ordering) -> Result<Permutation, SparseError> {
    Symbolic::analyze(pattern, ordering).map(|symbolic| symbolic.permutation().clone())
}

/// `perm[new] = old` before any postorder.
pub(super) fn fill_reducing(pattern: &SymPattern, ordering: Ordering) -> Result<Vec<u32>, SparseError> {
    let n = pattern.n();
    match ordering {
        Ordering::Natural => Ok((0..n as u32).collect()),
        Ordering::Given(perm) => {
            super::pattern::check_length("the given order", perm.len(), n)?;
            Permutation::new(perm).map(|p| p.forward)
        }
        _ if n == 0 => Ok(Vec::new()),
        Ordering::Auto | Ordering::Amf => {
            with_full_pattern(pattern, |full| feral_amf::amf_order(full).map_err(|e| format!("feral-amf: {e:?}")))
        }
        Ordering::Amd => {
            with_full_pattern(pattern, |full| feral_amd::amd_order(full).map_err(|e| format!("feral-amd: {e:?}")))
        }
        Ordering::NestedDissection => {
            with_full_pattern(pattern, |full| feral_metis::metis_order(full).map_err(|e| format!("feral-metis: {e:?}")))
        }
    }
}

/// Calls an ordering library with both triangles, and checks that what it returns is a permutation.
fn with_full_pattern(
    pattern: &SymPattern,
    call: impl FnOnce(&CscPattern<'_>) -> Result<Vec<i32>, String>,
) -> Result<Vec<u32>, SparseError> {
    let n = pattern.n();
    let mut ptr = vec![0usize; n + 1];
    for j in 0..n {
        for &i in pattern.column(j) {
            ptr[i as usize + 1] += 1;
            ptr[j + 1] += usize::from(i as usize != j);
        }
    }
    for j in 0..n {
        ptr[j + 1] += ptr[j];
    }
    let limit = i32::MAX as usize;
    if ptr[n] > limit {
        return Err(SparseError::TooLarge { what: "the number of matrix entries to order", size: ptr[n], limit });
    }
    let mut next = ptr.clone();
    let mut rows = vec![0i32; ptr[n]];
    // Upper part first: column by column, so that rows come out ascending.
    for j in 0..n {
        for &i in pattern.column(j) {
            let i = i as usize;
            rows[next[i]] = j as i32;
            next[i] += 1;
        }
    }
    for j in 0..n {
        for &i in &pattern.column(j)[1..] {
            rows[next[j]] = i as i32;
            next[j] += 1;
        }
    }
    let ptr: Vec<i32> = ptr.into_iter().map(|p| p as i32).collect();
    let failed = |reason: String| SparseError::Ordering { reason };
    let full = CscPattern::new(n, &ptr, &rows).ok_or_else(|| failed("the pattern was refused".into()))?;
    let perm = call(&full).map_err(failed)?;
    super::pattern::check_length("the computed order", perm.len(), n)?;
    // A negative index becomes one that is out of range.
    Permutation::new(perm.into_iter().map(|p| p as u32).collect()).map(|p| p.forward)
}
