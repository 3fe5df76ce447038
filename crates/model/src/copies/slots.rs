//! Slots by the nodes that they are copies of, and work on them by ranges of nodes.

use std::ops::{AddAssign, Range};

/// Slots offsets[i] .. offsets[i + 1] are copies of node i.
pub struct Slots {
    offsets: Vec<u32>,
}

/// Nodes that a task handles.
pub const CHUNK: usize = 2048;

/// The part of some vectors that belongs to a range of nodes: z - u and u by slots, and D numbers a node.
pub struct Part<'a> {
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
    pub of_nodes: &'a mut [f64],
}

impl Slots {
    /// So many for each node.
    pub fn new(counts: impl IntoIterator<Item = u32>) -> Self {
        let mut offsets = vec![0];
        let mut total = 0;
        for count in counts {
            total += count;
            offsets.push(total);
        }
        Slots { offsets }
    }

    /// Nodes.
    pub fn n_nodes(&self) -> usize {
        self.offsets.len() - 1
    }

    /// All slots.
    pub fn len(&self) -> usize {
        self.before(self.n_nodes())
    }

    /// Slots of the nodes before this one.
    #[inline]
    pub fn before(&self, node: usize) -> usize {
        self.offsets[node] as usize
    }

    /// Those of a node.
    #[inline]
    pub fn of(&self, node: usize) -> Range<usize> {
        self.offsets[node] as usize..self.offsets[node + 1] as usize
    }

    /// Where a range of nodes is cut, and how many slots come before.
    fn cut(&self, nodes: &Range<usize>) -> (usize, usize) {
        let middle = nodes.start + (nodes.len() / 2).next_multiple_of(CHUNK);
        (middle, (self.offsets[middle] - self.offsets[nodes.start]) as usize)
    }

    /// Runs `leaf` on some nodes at a time, with their slots of `numbers`, `each` numbers a slot.
    pub fn fill(
        &self,
        nodes: Range<usize>,
        each: usize,
        numbers: &mut [f64],
        leaf: &(impl Fn(Range<usize>, &mut [f64]) + Sync),
    ) {
        if nodes.len() <= CHUNK {
            return leaf(nodes, numbers);
        }
        let (middle, slots) = self.cut(&nodes);
        let (low, high) = numbers.split_at_mut(each * slots);
        rayon::join(
            || self.fill(nodes.start..middle, each, low, leaf),
            || self.fill(middle..nodes.end, each, high, leaf),
        );
    }

    /// Runs `leaf` on some nodes at a time, D numbers a slot.
    pub fn for_each<const D: usize>(
        &self,
        nodes: Range<usize>,
        part: Part<'_>,
        leaf: &(impl Fn(Range<usize>, Part<'_>) + Sync),
    ) {
        self.sum::<D, Nothing>(nodes, part, &|nodes, part| {
            leaf(nodes, part);
            Nothing
        });
    }

    /// Runs `leaf` on some nodes at a time, D numbers a slot; the sum, which is taken over a fixed tree.
    pub fn sum<const D: usize, R: AddAssign + Send>(
        &self,
        nodes: Range<usize>,
        part: Part<'_>,
        leaf: &(impl Fn(Range<usize>, Part<'_>) -> R + Sync),
    ) -> R {
        if nodes.len() <= CHUNK {
            return leaf(nodes, part);
        }
        let (middle, slots) = self.cut(&nodes);
        let (p0, p1) = part.p.split_at_mut(D * slots);
        let (u0, u1) = part.u.split_at_mut(D * slots);
        let (n0, n1) = part.of_nodes.split_at_mut(D * (middle - nodes.start));
        let (low, high) = (Part { p: p0, u: u0, of_nodes: n0 }, Part { p: p1, u: u1, of_nodes: n1 });
        let (mut a, b) = rayon::join(
            || self.sum::<D, R>(nodes.start..middle, low, leaf),
            || self.sum::<D, R>(middle..nodes.end, high, leaf),
        );
        a += b;
        a
    }
}

/// The sum of what returns nothing.
struct Nothing;

impl AddAssign for Nothing {
    fn add_assign(&mut self, Nothing: Nothing) {}
}
