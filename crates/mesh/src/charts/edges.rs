//! The edges of a mesh and the corners that start them.

use super::half_edges::sorted;
use crate::mesh::Polygons;

/// All sides of all faces by edge. A side has the number of the corner where it starts.
pub(super) struct Edges {
    starts: Vec<u32>, // sides whose smaller end is v: items[starts[v]..starts[v + 1]]
    items: Vec<u64>,  // the larger end, then the corner, ascending in each row
}

impl Edges {
    /// Sorts the sides; one from a vertex to itself is no edge.
    pub fn new(n_verts: usize, faces: &Polygons) -> Self {
        let sides = || {
            faces.offsets().windows(2).flat_map(|w| {
                let (lo, hi) = (w[0] as usize, w[1] as usize);
                (lo..hi).filter_map(move |c| {
                    let e = sorted(faces.indices()[c], faces.indices()[if c + 1 == hi { lo } else { c + 1 }]);
                    (e[0] != e[1]).then_some((e, c as u32))
                })
            })
        };
        let mut starts = vec![0u32; n_verts + 1];
        sides().for_each(|(e, _)| starts[e[0] as usize + 1] += 1);
        (0..n_verts).for_each(|v| starts[v + 1] += starts[v]);
        let mut next = starts.clone();
        let mut items = vec![0u64; starts[n_verts] as usize];
        for (e, c) in sides() {
            let slot = &mut next[e[0] as usize];
            items[*slot as usize] = u64::from(e[1]) << 32 | u64::from(c);
            *slot += 1;
        }
        for v in 0..n_verts {
            items[starts[v] as usize..starts[v + 1] as usize].sort_unstable();
        }
        Edges { starts, items }
    }

    fn row(&self, v: u32) -> &[u64] {
        match self.starts.get(v as usize..v as usize + 2) {
            Some(w) => &self.items[w[0] as usize..w[1] as usize],
            None => &[],
        }
    }

    /// The sides along the edge, by corner.
    pub fn sides(&self, a: u32, b: u32) -> impl Iterator<Item = u32> + '_ {
        let [a, b] = sorted(a, b);
        let row = self.row(a);
        let lo = row.partition_point(|&i| i >> 32 < u64::from(b));
        row[lo..].iter().take_while(move |&&i| i >> 32 == u64::from(b)).map(|&i| i as u32)
    }

    /// Every edge (smaller end first), in lexicographic order, with the corners of its sides.
    pub fn iter(&self) -> impl Iterator<Item = ([u32; 2], &[u64])> {
        (0..self.starts.len() as u32 - 1)
            .flat_map(|v| self.row(v).chunk_by(|a, b| a >> 32 == b >> 32).map(move |g| ([v, (g[0] >> 32) as u32], g)))
    }
}
