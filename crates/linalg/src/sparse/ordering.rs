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
        Ordering::Amf => Graph::new(pattern)?.order(Library::Amf),
        Ordering::Amd => Graph::new(pattern)?.order(Library::Amd),
        Ordering::NestedDissection => Graph::new(pattern)?.order(Library::NestedDissection),
        Ordering::Auto => automatic(pattern),
    }
}

/// Minimum fill, and nested dissection too where that can pay for itself: on thin bodies their fill is the same
/// and minimum fill takes a fifth of the time; on solid ones nested dissection halves the work of a factorisation.
fn automatic(pattern: &SymPattern) -> Result<Vec<u32>, SparseError> {
    /// Measured, per vertex of the ordered graph.
    const DISSECTION_SECONDS: f64 = 11e-6;
    /// What nested dissection saves where it saves at all.
    const SAVED_SHARE: f64 = 0.25;
    /// Operations of a factorisation over the square of the unknowns: above this a body is solid. Minimum fill takes
    /// less than 1 on thin ones, and 6 to 20 on bars and cubes of 4,000 vertices.
    const SOLID: f64 = 4.0;
    let graph = Graph::new(pattern)?;
    let fill = graph.order(Library::Amf)?;
    let (seconds, flops) = predicted_seconds(pattern, &fill);
    let is_solid = flops > SOLID * (pattern.n() as f64).powi(2);
    if SAVED_SHARE * seconds < DISSECTION_SECONDS * graph.len() as f64 && !is_solid {
        return Ok(fill);
    }
    let dissection = graph.order(Library::NestedDissection)?;
    Ok(if predicted_seconds(pattern, &dissection).0 < seconds { dissection } else { fill })
}

/// Rough seconds on one core of a typical use of an order, three factorisations and three hundred solves; operations of
/// one factorisation.
fn predicted_seconds(pattern: &SymPattern, perm: &[u32]) -> (f64, f64) {
    const FACTORISATIONS: f64 = 3.0;
    const SOLVES: f64 = 300.0;
    const FLOPS_PER_SECOND: f64 = 30e9;
    const BYTES_PER_SECOND: f64 = 15e9;
    let (_, counts) = super::symbolic::postordered_counts(pattern, perm);
    let (entries, flops) = counts.iter().fold((0.0, 0.0), |(entries, flops), &count| {
        let count = f64::from(count);
        (entries + count, flops + count * count)
    });
    // A solve reads every entry of L, eight bytes, twice.
    (FACTORISATIONS * flops / FLOPS_PER_SECOND + SOLVES * entries * 16.0 / BYTES_PER_SECOND, flops)
}

#[derive(Clone, Copy)]
enum Library {
    Amf,
    Amd,
    NestedDissection,
}

/// Both triangles and the diagonal, rows ascending, as the ordering libraries take them.
///
/// Neighbouring unknowns with the same rows (the coordinates of a vertex) are one vertex of the graph: they may
/// be eliminated together without additional fill.
struct Graph {
    ptr: Vec<i32>,
    rows: Vec<i32>,
    /// First unknown of each vertex, then n.
    first: Vec<u32>,
}

impl Graph {
    fn new(pattern: &SymPattern) -> Result<Self, SparseError> {
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
        let mut next = ptr.clone();
        let mut rows = vec![0u32; ptr[n]];
        // The upper part first, column by column, so that rows come out ascending.
        for j in 0..n {
            for &i in pattern.column(j) {
                rows[next[i as usize]] = j as u32;
                next[i as usize] += 1;
            }
        }
        for j in 0..n {
            for &i in &pattern.column(j)[1..] {
                rows[next[j]] = i;
                next[j] += 1;
            }
        }
        let same = |j: usize| j > 0 && rows[ptr[j - 1]..ptr[j]] == rows[ptr[j]..ptr[j + 1]];
        let (mut vertex, mut first) = (Vec::with_capacity(n), Vec::new());
        for j in 0..n {
            if !same(j) {
                first.push(j as u32);
            }
            vertex.push(first.len() as i32 - 1);
        }
        let mut graph = Self { ptr: vec![0], rows: Vec::new(), first };
        let limit = i32::MAX as usize;
        for &j in &graph.first {
            let start = graph.rows.len();
            for &i in &rows[ptr[j as usize]..ptr[j as usize + 1]] {
                let v = vertex[i as usize];
                if graph.rows.len() == start || graph.rows[graph.rows.len() - 1] != v {
                    graph.rows.push(v);
                }
            }
            if graph.rows.len() > limit {
                let size = graph.rows.len();
                return Err(SparseError::TooLarge { what: "the number of matrix entries to order", size, limit });
            }
            graph.ptr.push(graph.rows.len() as i32);
        }
        graph.first.push(n as u32);
        Ok(graph)
    }

    /// Number of vertices.
    fn len(&self) -> usize {
        self.ptr.len() - 1
    }

    /// The order of the unknowns; what a library returns is checked to be a permutation.
    fn order(&self, library: Library) -> Result<Vec<u32>, SparseError> {
        let failed = |reason: String| SparseError::Ordering { reason };
        let full = CscPattern::new(self.len(), &self.ptr, &self.rows)
            .ok_or_else(|| failed("the pattern was refused".into()))?;
        let order = match library {
            Library::Amf => feral_amf::amf_order(&full).map_err(|e| failed(format!("feral-amf: {e:?}"))),
            Library::Amd => feral_amd::amd_order(&full).map_err(|e| failed(format!("feral-amd: {e:?}"))),
            Library::NestedDissection => {
                feral_metis::metis_order(&full).map_err(|e| failed(format!("feral-metis: {e:?}")))
            }
        }?;
        super::pattern::check_length("the computed order", order.len(), self.len())?;
        // A negative index becomes one that is out of range.
        let order = Permutation::new(order.into_iter().map(|v| v as u32).collect())?;
        Ok(order.forward.iter().flat_map(|&v| self.first[v as usize]..self.first[v as usize + 1]).collect())
    }
}
