//! Elements in chunks, nodes local to a chunk: where positions are gathered from and forces are added to.
//!
//! A chunk is a fixed run of blocks of eight elements, sorted along a space-filling curve so that it is compact. It
//! copies the positions of its nodes once, computes on them with 16-bit indices, and adds forces into its own
//! partial sums, which are small enough to stay in the cache. A node then sums the few partial sums it has, in the
//! order of the chunks: no atomics, no colouring, and the same bits on any number of threads.

use proxel_linalg::simd::LANES;
use rayon::prelude::*;

/// Blocks of eight elements in a chunk.
pub(super) const BLOCKS: usize = 64;

/// Elements in a chunk.
pub(super) const CHUNK: usize = BLOCKS * LANES;

/// Nodes that one thread sums at a time.
const GATHER: usize = 1024;

/// The chunks of a batch of elements with CORNERS nodes each.
pub(super) struct Chunks {
    n_elems: usize,
    corners: usize,
    /// The element at each place of the sorted order.
    pub order: Vec<u32>,
    /// Nodes of all chunks, one after another.
    nodes: Vec<u32>,
    /// Where each chunk's nodes begin, and where the last one's end.
    starts: Vec<u32>,
    /// [block][corner][lane]: place of the node among its chunk's nodes.
    local: Vec<u16>,
    /// Partial sums of node i: slots[gather[i]..gather[i + 1]].
    gather: Vec<u32>,
    slots: Vec<u32>,
}

impl Chunks {
    /// Sorts elements (flat node lists, `corners` each) by `key` and cuts them into chunks.
    pub fn new(elements: &[u32], corners: usize, key: &[u64]) -> Self {
        let n_elems = elements.len() / corners;
        let mut order: Vec<u32> = (0..n_elems as u32).collect();
        order.sort_by_key(|e| (key[*e as usize], *e));
        let n_blocks = n_elems.div_ceil(LANES);
        let mut local = vec![0u16; n_blocks * corners * LANES];
        let mut nodes = Vec::new();
        let mut starts = vec![0u32];
        let mut mine: Vec<u32> = Vec::with_capacity(CHUNK * corners);
        for (c, chunk) in order.chunks(CHUNK).enumerate() {
            mine.clear();
            mine.extend(chunk.iter().flat_map(|e| &elements[*e as usize * corners..][..corners]));
            mine.sort_unstable();
            mine.dedup();
            for place in 0..chunk.len().next_multiple_of(LANES) {
                // Padding lanes repeat the last element.
                let e = chunk[place.min(chunk.len() - 1)] as usize;
                let (b, lane) = (c * BLOCKS + place / LANES, place % LANES);
                for k in 0..corners {
                    let at = mine.binary_search(&elements[e * corners + k]).unwrap_or(0);
                    local[(b * corners + k) * LANES + lane] = at as u16;
                }
            }
            nodes.extend_from_slice(&mine);
            starts.push(nodes.len() as u32);
        }
        let top = nodes.iter().max().map_or(0, |m| *m as usize + 1);
        let mut gather = vec![0u32; top + 1];
        for n in &nodes {
            gather[*n as usize + 1] += 1;
        }
        for i in 0..top {
            gather[i + 1] += gather[i];
        }
        let mut fill = gather.clone();
        let mut slots = vec![0u32; nodes.len()];
        for (slot, n) in nodes.iter().enumerate() {
            slots[fill[*n as usize] as usize] = slot as u32;
            fill[*n as usize] += 1;
        }
        Chunks { n_elems, corners, order, nodes, starts, local, gather, slots }
    }

    pub fn n_elems(&self) -> usize {
        self.n_elems
    }

    pub fn corners(&self) -> usize {
        self.corners
    }

    pub fn n_blocks(&self) -> usize {
        self.n_elems.div_ceil(LANES)
    }

    /// Number of chunk-local nodes of all chunks: how many partial sums there are.
    pub fn n_slots(&self) -> usize {
        self.nodes.len()
    }

    /// The slots of chunk c.
    pub fn slots_of(&self, c: usize) -> std::ops::Range<usize> {
        self.starts[c] as usize..self.starts[c + 1] as usize
    }

    /// The nodes of chunk c.
    pub fn nodes_of(&self, c: usize) -> &[u32] {
        &self.nodes[self.slots_of(c)]
    }

    /// The chunk-local indices of the blocks of chunk c, [block][corner][lane].
    pub fn local_of(&self, c: usize) -> &[u16] {
        let size = BLOCKS * self.corners * LANES;
        &self.local[c * size..((c + 1) * size).min(self.local.len())]
    }

    /// Number of blocks of chunk c.
    pub fn blocks_of(&self, c: usize) -> usize {
        self.local_of(c).len() / (self.corners * LANES)
    }

    /// The nodes of the element at `place` of the sorted order.
    pub fn element(&self, place: usize) -> impl Iterator<Item = u32> + '_ {
        let (b, lane) = (place / LANES, place % LANES);
        let first = self.starts[b / BLOCKS] as usize;
        (0..self.corners).map(move |k| self.nodes[first + self.local[(b * self.corners + k) * LANES + lane] as usize])
    }

    /// Positions of nodes (flat, `dim` numbers each) by slot.
    pub fn positions(&self, x: &[f64], dim: usize) -> Vec<f64> {
        self.nodes.iter().flat_map(|node| &x[*node as usize * dim..][..dim]).copied().collect()
    }

    /// The slots of the element at `place` of the sorted order; the first of its chunk past its corners.
    pub fn slots(&self, place: usize) -> [usize; 4] {
        let (b, lane) = (place / LANES, place % LANES);
        let first = self.starts[b / BLOCKS] as usize;
        let mut slots = [first; 4];
        for (k, slot) in slots.iter_mut().enumerate().take(self.corners) {
            *slot += self.local[(b * self.corners + k) * LANES + lane] as usize;
        }
        slots
    }

    /// grad_i += sum of node i's partial sums, for the nodes that `grad` covers.
    pub fn add_partials<const D: usize>(&self, partials: &[f64], grad: &mut [f64]) {
        let covered = (grad.len() / D).min(self.gather.len() - 1);
        grad[..covered * D].par_chunks_mut(GATHER * D).enumerate().for_each(|(g, out)| {
            for (j, out) in out.chunks_exact_mut(D).enumerate() {
                let i = g * GATHER + j;
                for slot in &self.slots[self.gather[i] as usize..self.gather[i + 1] as usize] {
                    let from = &partials[*slot as usize * D..][..D];
                    for d in 0..D {
                        out[d] += from[d];
                    }
                }
            }
        });
    }
}

/// Interleaves the bits of a point's coordinates on a grid of 2^21 cells a side: neighbours in the order are neighbours
/// in space (Morton 1966).
pub fn morton(p: [f64; 3], low: [f64; 3], size: f64) -> u64 {
    let spread = |v: u64| {
        let mut v = v & 0x1f_ffff;
        v = (v | v << 32) & 0x001f_0000_0000_ffff;
        v = (v | v << 16) & 0x001f_0000_ff00_00ff;
        v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
        v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
        (v | v << 2) & 0x1249_2492_4924_9249
    };
    (0..3).fold(0, |key, c| {
        let cell = ((p[c] - low[c]) / size.max(f64::MIN_POSITIVE) * 2_097_151.0).clamp(0.0, 2_097_151.0);
        key | spread(cell as u64) << c
    })
}
