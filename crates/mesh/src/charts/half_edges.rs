//! Oriented cells with glued sides: the structure in which surfaces are cut.

use crate::topology::Csr;

/// No half-edge, no vertex, no edge.
pub(super) const NONE: u32 = u32::MAX;

/// Cells (polygons) whose corners are listed in one consistent direction. Half-edge h runs from the corner h of its
/// cell to the next one, and is glued to `mate[h]`, which runs the other way. Around a vertex, cells follow each other
/// by mates: each such fan is a path or a ring, so that every gluing is a manifold.
#[derive(Clone, Debug, Default)]
pub(super) struct HalfEdges {
    pub offsets: Vec<u32>, // cell i has the half-edges offsets[i]..offsets[i + 1]
    pub cell: Vec<u32>,    // of each half-edge
    pub vertex: Vec<u32>,  // the mesh vertex where it starts
    pub mate: Vec<u32>,    // NONE on the boundary
}

impl HalfEdges {
    pub fn n_cells(&self) -> usize {
        self.offsets.len() - 1
    }

    pub fn len(&self) -> usize {
        self.mate.len()
    }

    pub fn side(&self, cell: usize) -> std::ops::Range<usize> {
        self.offsets[cell] as usize..self.offsets[cell + 1] as usize
    }

    pub fn next(&self, h: u32) -> u32 {
        let c = self.cell[h as usize] as usize;
        if h + 1 == self.offsets[c + 1] { self.offsets[c] } else { h + 1 }
    }

    pub fn prev(&self, h: u32) -> u32 {
        let c = self.cell[h as usize] as usize;
        if h == self.offsets[c] { self.offsets[c + 1] - 1 } else { h - 1 }
    }

    pub fn unglue(&mut self, h: u32) {
        let m = std::mem::replace(&mut self.mate[h as usize], NONE);
        if m != NONE {
            self.mate[m as usize] = NONE;
        }
    }

    /// The vertex of the surface at the start of each half-edge: a number for each fan, in the order of their first
    /// half-edges. Returns it with the number of fans.
    pub fn fans(&self) -> (Vec<u32>, usize) {
        let mut of = vec![NONE; self.len()];
        let mut count = 0u32;
        for first in 0..self.len() as u32 {
            if of[first as usize] != NONE {
                continue;
            }
            let mut h = first;
            loop {
                of[h as usize] = count;
                let m = self.mate[self.prev(h) as usize];
                if m == first {
                    break;
                }
                if m == NONE {
                    // A path: the part on the other side of the first corner.
                    let mut back = self.mate[first as usize];
                    while back != NONE {
                        back = self.next(back);
                        of[back as usize] = count;
                        back = self.mate[back as usize];
                    }
                    break;
                }
                h = m;
            }
            count += 1;
        }
        (of, count as usize)
    }

    /// The boundary half-edge that follows the boundary half-edge `h`.
    pub fn next_on_boundary(&self, h: u32) -> u32 {
        let mut g = self.next(h);
        while self.mate[g as usize] != NONE {
            g = self.next(self.mate[g as usize]);
        }
        g
    }

    /// The boundary loops, each from its first half-edge, in the direction of the cells.
    pub fn boundary_loops(&self) -> Csr {
        let mut seen = vec![false; self.len()];
        let mut loops = Csr { offsets: vec![0], items: Vec::new() };
        for first in 0..self.len() {
            if self.mate[first] != NONE || seen[first] {
                continue;
            }
            let mut h = first as u32;
            while !std::mem::replace(&mut seen[h as usize], true) {
                loops.items.push(h);
                h = self.next_on_boundary(h);
            }
            loops.offsets.push(loops.items.len() as u32);
        }
        loops
    }

    /// The connected component of each cell, numbered by first cell, and their number.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut of = vec![NONE; self.n_cells()];
        let mut count = 0u32;
        let mut queue = Vec::new();
        for first in 0..self.n_cells() {
            if of[first] != NONE {
                continue;
            }
            of[first] = count;
            queue.push(first);
            while let Some(c) = queue.pop() {
                for h in self.side(c) {
                    let m = self.mate[h];
                    if m != NONE {
                        let d = self.cell[m as usize] as usize;
                        if of[d] == NONE {
                            of[d] = count;
                            queue.push(d);
                        }
                    }
                }
            }
            count += 1;
        }
        (of, count as usize)
    }

    /// The cells given, as a surface of their own, and the half-edge here of each of its half-edges. No cell may be
    /// glued to one that is not given.
    pub fn part(&self, cells: &[u32]) -> (HalfEdges, Vec<u32>) {
        let mut out = HalfEdges { offsets: vec![0], ..HalfEdges::default() };
        let mut from = Vec::new();
        for (i, &c) in cells.iter().enumerate() {
            for h in self.side(c as usize) {
                out.cell.push(i as u32);
                out.vertex.push(self.vertex[h]);
                from.push(h as u32);
            }
            out.offsets.push(from.len() as u32);
        }
        // Cells are ascending, and so are their half-edges: a search finds each mate.
        let whole = from.len() == self.len();
        out.mate = from
            .iter()
            .map(|&h| match self.mate[h as usize] {
                m if m == NONE || whole => m,
                m => from.binary_search(&m).map_or(NONE, |i| i as u32),
            })
            .collect();
        (out, from)
    }

    /// Glues pairs of boundary half-edges that join the same two vertices of the surface in opposite directions: a
    /// slit along a single edge opens nothing, since no vertex is doubled. Returns how many pairs there were.
    pub fn close_slits(&mut self, fan: &[u32]) -> usize {
        let mut open: Vec<([u32; 2], u32)> = (0..self.len() as u32)
            .filter(|&h| self.mate[h as usize] == NONE)
            .map(|h| (sorted(fan[h as usize], fan[self.next(h) as usize]), h))
            .collect();
        open.sort_unstable();
        let mut closed = 0;
        for group in open.chunk_by(|a, b| a.0 == b.0) {
            if let &[(_, g), (_, h)] = group
                && fan[g as usize] != fan[h as usize]
            {
                self.mate[g as usize] = h;
                self.mate[h as usize] = g;
                closed += 1;
            }
        }
        closed
    }
}

pub(super) fn sorted(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Numbers `0..n` by group, each group ascending.
pub(super) fn by_group(group: &[u32], count: usize) -> Csr {
    let mut offsets = vec![0u32; count + 1];
    group.iter().for_each(|&g| offsets[g as usize + 1] += 1);
    (0..count).for_each(|i| offsets[i + 1] += offsets[i]);
    let mut next = offsets.clone();
    let mut items = vec![0; group.len()];
    for (i, &g) in group.iter().enumerate() {
        items[next[g as usize] as usize] = i as u32;
        next[g as usize] += 1;
    }
    Csr { offsets, items }
}
