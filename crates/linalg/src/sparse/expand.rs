//! The analysis of a matrix of blocks from that of the graph of its vertices.

use super::assemble::MOST;
use super::etree::NONE;
use super::ordering::Permutation;
use super::symbolic::{Group, Supernode};
use super::{SparseError, Symbolic};

impl Symbolic {
    /// The analysis of the matrix that has a `block` x `block` block for each entry of the analysed pattern: unknown
    /// `block i + r` is component r of vertex i. Ordering, tree and supernodes are those of the vertices, so that this
    /// takes a fraction of an analysis of the larger pattern. Values are those of a [`super::BlockMatrix`].
    ///
    /// # Errors
    /// A size beyond 32-bit indices, a block of none or of more than 3, or an analysis that is expanded already.
    pub fn expanded(&self, block: usize) -> Result<Self, SparseError> {
        let limit = i32::MAX as usize - 1;
        let size = self.n().saturating_mul(block).max(self.rows.len().saturating_mul(block));
        if !(1..=MOST).contains(&block) || self.block != 1 {
            return Err(SparseError::TooLarge { what: "the size of blocks", size: block * self.block, limit: MOST });
        }
        if size > limit {
            return Err(SparseError::TooLarge { what: "the number of unknowns in blocks", size, limit });
        }
        let each = |of: &[u32]| -> Vec<u32> {
            let mut out = Vec::with_capacity(of.len() * block);
            for &v in of {
                for r in 0..block as u32 {
                    out.push(v * block as u32 + r);
                }
            }
            out
        };
        let supernodes = self.supernodes.iter().map(|node| Supernode {
            first: node.first * block,
            width: node.width * block,
            below: node.below * block,
            row_start: node.row_start * block,
            ..node.clone()
        });
        let groups = self.groups.iter().map(|group| Group {
            supernodes: group.supernodes.clone(),
            columns: group.columns.start * block..group.columns.end * block,
            to_parent: if group.parent == NONE { Vec::new() } else { each(&group.to_parent) },
            parent: group.parent,
            children: group.children.clone(),
        });
        Ok(Symbolic {
            permutation: Permutation::from_valid(each(self.permutation.forward())),
            nnz: self.nnz * block * block,
            block,
            supernodes: supernodes.collect(),
            rows: each(&self.rows),
            relative: each(&self.relative),
            entries: self.entries.clone(),
            groups: groups.collect(),
        })
    }
}
