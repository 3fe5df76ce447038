//! Where the numbers of a factor lie, in lines of `lanes` values.
//!
//! The front of a supernode with w columns and r rows below has m = w + r rows, cut into blocks of `lanes`
//! rows. A block is stored column by column, one line a column; in the diagonal part block b ends at
//! column `lanes (b + 1)`, beyond which it is zero. This is at once the packed operand of the register-tiled
//! matrix product and the order in which a solve reads: every line once forward, once backward.

use super::symbolic::Symbolic;

/// Shape of a front.
#[derive(Clone, Copy, Debug)]
pub(super) struct Front {
    /// Columns.
    pub w: usize,
    /// Rows.
    pub m: usize,
    /// Rows per block.
    pub lanes: usize,
}

impl Front {
    /// Blocks of the panel.
    #[inline(always)]
    pub fn blocks(&self) -> usize {
        self.m.div_ceil(self.lanes)
    }

    /// Blocks that hold rows of L11.
    #[inline(always)]
    pub fn triangle_blocks(&self) -> usize {
        self.w.div_ceil(self.lanes)
    }

    /// Columns of block b.
    #[inline(always)]
    pub fn block_columns(&self, b: usize) -> usize {
        (self.lanes * (b + 1)).min(self.w)
    }

    /// First line of block b, from the start of the panel.
    #[inline(always)]
    pub fn block_start(&self, b: usize) -> usize {
        let short = (self.w / self.lanes).min(b);
        self.lanes * (short * (short + 1) / 2) + (b - short) * self.w
    }

    /// Lines of the panel.
    pub fn panel_lines(&self) -> usize {
        self.block_start(self.blocks())
    }

    /// First block of the update matrix: it starts at the block that holds row w, so that it shares the
    /// panel's blocks; up to `lanes - 1` leading rows and columns belong to the panel and are not used.
    #[inline(always)]
    pub fn update_block(&self) -> usize {
        self.w / self.lanes
    }

    /// Blocks of the update matrix.
    #[inline(always)]
    pub fn update_blocks(&self) -> usize {
        if self.m > self.w { self.blocks() - self.update_block() } else { 0 }
    }

    /// First line of block b of the update matrix (b counted from its first).
    #[inline(always)]
    pub fn update_start(&self, b: usize) -> usize {
        self.lanes * (b * (b + 1) / 2)
    }

    /// Lines of the update matrix, a lower triangle of blocks.
    pub fn update_lines(&self) -> usize {
        self.update_start(self.update_blocks())
    }

    /// Lines of the copy of L11 that the inversion reads, column blocks of rows, and of the reciprocal pivots.
    pub fn work_lines(&self) -> usize {
        let blocks = self.triangle_blocks();
        (0..blocks).map(|b| self.w - b * self.lanes).sum::<usize>() + 2 * blocks
    }
}

/// Offsets of one precision.
#[derive(Debug)]
pub(super) struct Layout {
    pub lanes: usize,
    /// First line of each panel; the last entry is the number of lines.
    pub panel: Vec<usize>,
    /// First row index of each supernode in `index`.
    pub index_ptr: Vec<usize>,
    /// For each panel row, padded to whole blocks, its place in the vector of the group; padding names a spare place.
    pub index: Vec<u32>,
    /// First line of each update matrix in the arena.
    pub update: Vec<usize>,
    /// First line of each group's factorisation workspace in the arena.
    pub work: Vec<usize>,
    /// Lines of the arena.
    pub arena: usize,
    /// First row of each group's vector among all vectors, one spare row each; then the total.
    pub vector: Vec<usize>,
    /// Most columns and panel blocks of a supernode, by group.
    pub widest: Vec<(usize, usize)>,
    /// Groups without a parent.
    pub roots: Vec<u32>,
}

impl Layout {
    pub fn new(symbolic: &Symbolic, lanes: usize) -> Self {
        let ns = symbolic.supernodes.len();
        let mut layout = Self {
            lanes,
            panel: Vec::with_capacity(ns + 1),
            index_ptr: Vec::with_capacity(ns + 1),
            index: Vec::new(),
            update: vec![0; ns],
            work: Vec::new(),
            arena: 0,
            vector: vec![0],
            widest: Vec::new(),
            roots: symbolic.root_groups(),
        };
        let mut lines = 0;
        for (g, group) in symbolic.groups.iter().enumerate() {
            let spare = symbolic.local_len(g) as u32;
            let boundary = symbolic.boundary(g);
            let (mut widest, mut work) = ((0, 0), 0);
            // Update matrices live on two stacks by the parity of the depth: a parent is pushed on the one while
            // its children, on top of the other, are read and then dropped.
            let mut top = [0usize; 2];
            let mut most = [0usize; 2];
            for s in group.supernodes.clone() {
                let node = &symbolic.supernodes[s];
                let front = layout.front(symbolic, s);
                layout.panel.push(lines);
                lines += front.panel_lines();
                layout.index_ptr.push(layout.index.len());
                layout.index.extend((0..node.width).map(|k| (node.first - group.columns.start + k) as u32));
                let rows = &symbolic.rows[node.row_start..node.row_start + node.below];
                let inside = rows.partition_point(|&r| (r as usize) < group.columns.end);
                layout.index.extend(rows[..inside].iter().map(|&r| r - group.columns.start as u32));
                let mut at = 0;
                for &r in &rows[inside..] {
                    // Both ascend: rows of a supernode beyond the group are among the group's boundary.
                    at += boundary[at..].partition_point(|&b| b < r);
                    layout.index.push((group.columns.len() + at) as u32);
                }
                layout.index.resize(layout.index_ptr[s] + front.blocks() * lanes, spare);
                widest = (widest.0.max(node.width), widest.1.max(front.blocks()));
                work = work.max(front.work_lines());

                let side = (node.depth % 2) as usize;
                let own = |c: &&u32| group.supernodes.contains(&(**c as usize));
                if let Some(&first) = node.children.iter().find(own) {
                    // Stack offsets of children are still relative to the stack.
                    top[1 - side] = layout.update[first as usize];
                }
                layout.update[s] = top[side];
                top[side] += front.update_lines();
                most[side] = most[side].max(top[side]);
            }
            for s in group.supernodes.clone() {
                let odd = symbolic.supernodes[s].depth % 2 == 1;
                layout.update[s] += layout.arena + if odd { most[0] } else { 0 };
            }
            layout.arena += most[0] + most[1];
            layout.work.push(layout.arena);
            layout.arena += work;
            layout.widest.push(widest);
            layout.vector.push(layout.vector[g] + spare as usize + 1);
        }
        layout.panel.push(lines);
        layout.index_ptr.push(layout.index.len());
        layout
    }

    pub fn front(&self, symbolic: &Symbolic, s: usize) -> Front {
        let node = &symbolic.supernodes[s];
        Front { w: node.width, m: node.width + node.below, lanes: self.lanes }
    }
}
