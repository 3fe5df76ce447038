//! Analysis of a pattern: everything that does not depend on the numbers.

use super::etree::{Lower, NONE, children, column_counts, elimination_tree, postorder};
use super::groups;
use super::layout::Layout;
use super::ordering::{Ordering, Permutation, fill_reducing};
use super::supernodes::{Supernodes, trapezoid};
use super::vector::{Line, Scalar};
use super::{SparseError, SymPattern};
use std::ops::Range;

/// The order, the supernodes and the tasks of a factorisation of one pattern.
///
/// Made once by [`Symbolic::analyze`] and shared (in an `Arc`) by any number of factors of either precision.
/// It depends on the pattern and the [`Ordering`] only, not on the number of threads.
#[derive(Debug)]
pub struct Symbolic {
    pub(super) permutation: Permutation,
    pub(super) nnz: usize,
    /// Unknowns a vertex of the pattern, see [`Symbolic::expanded`].
    pub(super) block: usize,
    pub(super) supernodes: Vec<Supernode>,
    /// Rows below the diagonal block of each supernode, in the new order, ascending.
    pub(super) rows: Vec<u32>,
    /// Where those rows lie in the front of the parent.
    pub(super) relative: Vec<u32>,
    pub(super) entries: Vec<Entry>,
    pub(super) groups: Vec<Group>,
}

/// A supernode: `width` columns from `first` over `below` rows.
#[derive(Debug, Clone)]
pub(super) struct Supernode {
    pub first: usize,
    pub width: usize,
    pub below: usize,
    /// Offset of its rows in [`Symbolic::rows`] and `relative`.
    pub row_start: usize,
    pub parent: u32,
    /// Range of its matrix entries.
    pub entries: Range<usize>,
    /// Children, ascending.
    pub children: Vec<u32>,
    /// Distance from the root of its group, for the placement of update matrices.
    pub depth: u32,
}

/// A matrix entry, or a block of them, and its place in the front of its supernode.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    pub slot: usize,
    pub row: u32,
    pub column: u32,
    /// Whether the elimination order has row and column of the pattern the other way round.
    pub transposed: bool,
}

/// A task: a range of supernodes, run in order once the children have run.
///
/// It works on a vector of its own: its columns, then its boundary, the rows of its last supernode, which
/// hold what it passes on to its parent.
#[derive(Debug)]
pub(super) struct Group {
    pub supernodes: Range<usize>,
    pub columns: Range<usize>,
    /// Place of each boundary row in the vector of the parent.
    pub to_parent: Vec<u32>,
    pub parent: u32,
    pub children: Vec<u32>,
}

impl Symbolic {
    /// Orders the unknowns, finds supernodes and tasks, and lays out the fronts.
    ///
    /// # Errors
    /// A given order that is no permutation, or a pattern too large for the order's 32-bit interface.
    pub fn analyze(pattern: &SymPattern, ordering: Ordering) -> Result<Self, SparseError> {
        let fill = fill_reducing(pattern, ordering)?;
        let (Tree { perm, parent }, counts) = postordered_counts(pattern, &fill);
        let merged = Supernodes::find(&parent, &counts);
        let grouping = groups::group(&merged);

        let final_perm: Vec<u32> =
            grouping.order.iter().flat_map(|&s| merged.columns[s as usize].iter().map(|&j| perm[j as usize])).collect();
        let permutation = Permutation::from_valid(final_perm);
        let lower = Lower::permuted(pattern, permutation.inverse());
        let mut symbolic = Self {
            permutation,
            nnz: pattern.nnz(),
            block: 1,
            supernodes: Vec::with_capacity(merged.parent.len()),
            rows: Vec::new(),
            relative: Vec::new(),
            entries: Vec::with_capacity(pattern.nnz()),
            groups: Vec::new(),
        };
        symbolic.place_supernodes(&merged, &grouping);
        symbolic.find_rows(&lower);
        symbolic.find_groups(&grouping);
        Ok(symbolic)
    }

    fn place_supernodes(&mut self, merged: &Supernodes, grouping: &groups::Grouping) {
        let place = invert(&grouping.order);
        let mut first = 0;
        for &s in &grouping.order {
            let s = s as usize;
            let width = merged.columns[s].len();
            let parent = match merged.parent[s] {
                NONE => NONE,
                p => place[p as usize],
            };
            let below = merged.below[s] as usize;
            self.supernodes.push(Supernode {
                first,
                width,
                below,
                row_start: 0,
                parent,
                entries: 0..0,
                children: Vec::new(),
                depth: 0,
            });
            first += width;
        }
        for s in 0..self.supernodes.len() {
            if self.supernodes[s].parent != NONE {
                let p = self.supernodes[s].parent as usize;
                self.supernodes[p].children.push(s as u32);
            }
        }
        for s in (0..self.supernodes.len()).rev() {
            let p = self.supernodes[s].parent;
            if p != NONE && grouping.group[p as usize] == grouping.group[s] {
                self.supernodes[s].depth = self.supernodes[p as usize].depth + 1;
            }
        }
    }

    /// Rows of each supernode: those of its matrix columns and of its children. Then places in fronts.
    fn find_rows(&mut self, lower: &Lower) {
        let n = self.permutation.len();
        let mut seen = vec![NONE; n];
        for s in 0..self.supernodes.len() {
            let start = self.rows.len();
            let node = &self.supernodes[s];
            let end = node.first + node.width;
            let mut add = |rows: &mut Vec<u32>, i: u32| {
                if i as usize >= end && seen[i as usize] != s as u32 {
                    seen[i as usize] = s as u32;
                    rows.push(i);
                }
            };
            for j in node.first..end {
                lower.column(j).iter().for_each(|&i| add(&mut self.rows, i));
            }
            for &c in &node.children {
                let child = &self.supernodes[c as usize];
                for k in child.row_start..child.row_start + child.below {
                    let i = self.rows[k];
                    add(&mut self.rows, i);
                }
            }
            self.rows[start..].sort_unstable();
            let node = &mut self.supernodes[s];
            node.row_start = start;
            node.below = self.rows.len() - start;
        }
        self.relative = vec![0; self.rows.len()];
        let mut place = vec![0u32; n];
        for s in 0..self.supernodes.len() {
            let node = &self.supernodes[s];
            for k in 0..node.width {
                place[node.first + k] = k as u32;
            }
            for k in 0..node.below {
                place[self.rows[node.row_start + k] as usize] = (node.width + k) as u32;
            }
            for &c in &node.children {
                let child = &self.supernodes[c as usize];
                for k in child.row_start..child.row_start + child.below {
                    self.relative[k] = place[self.rows[k] as usize];
                }
            }
            let start = self.entries.len();
            for k in 0..node.width {
                let j = node.first + k;
                for at in lower.ptr[j]..lower.ptr[j + 1] {
                    let i = lower.rows[at] as usize;
                    let old = self.permutation.forward();
                    let transposed = old[i] < old[j];
                    self.entries.push(Entry { slot: lower.slots[at], row: place[i], column: k as u32, transposed });
                }
            }
            self.supernodes[s].entries = start..self.entries.len();
        }
    }

    fn find_groups(&mut self, grouping: &groups::Grouping) {
        let group = &grouping.group;
        let mut start = 0;
        while start < group.len() {
            let number = self.groups.len() as u32;
            let end = start + group[start..].iter().take_while(|&&g| g == number).count();
            let (first, last) = (&self.supernodes[start], &self.supernodes[end - 1]);
            let parent = if last.parent == NONE { NONE } else { group[last.parent as usize] };
            let columns = first.first..last.first + last.width;
            self.groups.push(Group {
                supernodes: start..end,
                columns,
                to_parent: Vec::new(),
                parent,
                children: Vec::new(),
            });
            start = end;
        }
        for g in 0..self.groups.len() {
            let parent = self.groups[g].parent;
            if parent != NONE {
                self.groups[parent as usize].children.push(g as u32);
                self.groups[g].to_parent =
                    self.boundary(g).iter().map(|&row| self.local(parent as usize, row)).collect();
            }
        }
    }

    /// Rows beyond the columns of group g that it adds to.
    pub(super) fn boundary(&self, g: usize) -> &[u32] {
        let last = &self.supernodes[self.groups[g].supernodes.end - 1];
        &self.rows[last.row_start..last.row_start + last.below]
    }

    /// Place of a row in the vector of group g, which must hold it.
    pub(super) fn local(&self, g: usize, row: u32) -> u32 {
        let columns = &self.groups[g].columns;
        if columns.contains(&(row as usize)) {
            row - columns.start as u32
        } else {
            (columns.len() + self.boundary(g).partition_point(|&r| r < row)) as u32
        }
    }

    /// Rows of the vector of group g: columns and boundary.
    pub(super) fn local_len(&self, g: usize) -> usize {
        self.groups[g].columns.len() + self.boundary(g).len()
    }

    /// Groups without a parent.
    pub(super) fn root_groups(&self) -> Vec<u32> {
        (0..self.groups.len() as u32).filter(|&g| self.groups[g as usize].parent == NONE).collect()
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.permutation.len()
    }

    /// Number of entries of the pattern, the length of the values that `refactor` takes.
    pub fn nnz(&self) -> usize {
        self.nnz
    }

    /// The elimination order, postorder of the tree included. Unknowns numbered by it and analysed with
    /// [`Ordering::Natural`] have the same fill, and a solve then reads its right-hand sides nearly in order.
    pub fn permutation(&self) -> &Permutation {
        &self.permutation
    }

    /// Number of supernodes.
    pub fn supernode_count(&self) -> usize {
        self.supernodes.len()
    }

    /// Entries of L, the zeros stored by relaxed supernodes included.
    pub fn factor_nnz(&self) -> usize {
        self.supernodes.iter().map(|s| trapezoid(s.width, s.below) as usize).sum()
    }

    /// Bytes that a factor of precision `T` takes, and the workspace of its factorisations, which can be released.
    pub fn factor_bytes<T: Scalar>(&self) -> (usize, usize) {
        let layout = Layout::new(self, T::LANES);
        (layout.panel[layout.panel.len() - 1] * size_of::<Line>(), layout.arena * size_of::<Line>())
    }

    /// Floating-point operations of a factorisation, `sum over columns of count^2`.
    pub fn factor_flops(&self) -> f64 {
        self.supernodes.iter().flat_map(|s| (0..s.width).map(|k| ((s.width - k + s.below) as f64).powi(2))).sum()
    }
}

/// An elimination tree whose columns are in postorder.
pub(super) struct Tree {
    /// `perm[new] = old`
    pub perm: Vec<u32>,
    pub parent: Vec<u32>,
}

/// Postorders the elimination tree of the matrix in this order, and counts the entries of the columns of L.
pub(super) fn postordered_counts(pattern: &SymPattern, fill: &[u32]) -> (Tree, Vec<u32>) {
    let lower = Lower::permuted(pattern, &invert(fill));
    let above = elimination_tree(&lower);
    let (ptr, list) = children(&above);
    let post = postorder(&ptr, &list);
    let perm: Vec<u32> = post.iter().map(|&k| fill[k as usize]).collect();
    let relabel = invert(&post);
    let mut parent = vec![NONE; fill.len()];
    for (old, &p) in above.iter().enumerate() {
        if p != NONE {
            parent[relabel[old] as usize] = relabel[p as usize];
        }
    }
    let lower = Lower::permuted(pattern, &invert(&perm));
    let counts = column_counts(&lower, &parent);
    (Tree { perm, parent }, counts)
}

/// Inverse of a permutation.
pub(super) fn invert(perm: &[u32]) -> Vec<u32> {
    let mut inverse = vec![0; perm.len()];
    for (new, &old) in perm.iter().enumerate() {
        inverse[old as usize] = new as u32;
    }
    inverse
}
