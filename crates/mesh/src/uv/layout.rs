//! What a map joins: corners of one vertex with the same coordinates are one UV vertex, whatever a file calls them.

use super::UvMap;
use crate::mesh::Polygons;

/// The UV vertices of a map, in the order of their mesh vertices.
pub(crate) struct Layout {
    pub corners: Vec<u32>,        // of each corner of the faces: its UV vertex, or UvMap::NONE
    pub positions: Vec<[f64; 2]>, // of each UV vertex
}

/// A side of a face at an edge of the mesh between the vertices `low` < `high`.
#[derive(Clone, Copy)]
pub(crate) struct EdgeUse {
    high: u32,        // the vertex
    pub uv: [u32; 2], // the UV vertices at low and at high
    pub face: u32,
}

/// Up to this many corners at a vertex are compared one by one, more are sorted.
const FEW: usize = 24;

/// As numbers that are equal exactly if the coordinates are: -0 is 0.
fn key(uv: [f64; 2]) -> [u64; 2] {
    uv.map(|x| (x + 0.0).to_bits())
}

impl Layout {
    /// The UV vertices of a map that has passed [`UvMap::check`].
    pub fn new(faces: &Polygons, uv: &UvMap) -> Self {
        let vertices = faces.indices();
        let n = vertices.iter().max().map_or(0, |&v| v as usize + 1);
        let mapped = || (0..vertices.len()).filter(|&i| uv.corners[i] != UvMap::NONE);
        let at = buckets(n, || mapped().map(|i| (vertices[i], i as u32)));
        let mut out = Layout { corners: vec![UvMap::NONE; vertices.len()], positions: Vec::new() };
        let mut sorted = Vec::new();
        for v in 0..n {
            let corners = at.row(v);
            let first = out.positions.len();
            if corners.len() <= FEW {
                for &c in corners {
                    let x = uv.coordinates[uv.corners[c as usize] as usize];
                    let known = out.positions[first..].iter().position(|&p| p == x);
                    let id = known.map_or(out.positions.len(), |k| first + k);
                    if known.is_none() {
                        out.positions.push(x);
                    }
                    out.corners[c as usize] = id as u32;
                }
                continue;
            }
            sorted.clear();
            sorted.extend(corners.iter().map(|&c| (key(uv.coordinates[uv.corners[c as usize] as usize]), c)));
            sorted.sort_unstable();
            for same in sorted.chunk_by(|a, b| a.0 == b.0) {
                for &(_, c) in same {
                    out.corners[c as usize] = out.positions.len() as u32;
                }
                out.positions.push(same[0].0.map(f64::from_bits));
            }
        }
        out
    }

    /// Every edge of a mapped face, as (smaller, larger) vertex and in ascending order, with the sides that faces have
    /// there; sides with the same UV vertices stand together.
    pub fn for_each_edge(&self, faces: &Polygons, mut visit: impl FnMut([u32; 2], &[EdgeUse])) {
        let vertices = faces.indices();
        let n = vertices.iter().max().map_or(0, |&v| v as usize + 1);
        let sides = || {
            faces.offsets().windows(2).enumerate().flat_map(|(face, ends)| {
                let (from, to) = (ends[0] as usize, ends[1] as usize);
                (from..to).filter_map(move |i| {
                    let j = if i + 1 < to { i + 1 } else { from };
                    let (i, j) = if vertices[i] < vertices[j] { (i, j) } else { (j, i) };
                    let there = vertices[i] != vertices[j] && self.corners[i] != UvMap::NONE;
                    let side = EdgeUse { high: vertices[j], uv: [self.corners[i], self.corners[j]], face: face as u32 };
                    there.then_some((vertices[i], side))
                })
            })
        };
        let at = buckets(n, sides);
        let mut row = Vec::new();
        for low in 0..n {
            row.clear();
            row.extend_from_slice(at.row(low));
            row.sort_unstable_by_key(|s: &EdgeUse| (s.high, s.uv, s.face));
            for uses in row.chunk_by(|a, b| a.high == b.high) {
                visit([low as u32, uses[0].high], uses);
            }
        }
    }
}

/// Whether the map is discontinuous along an edge with these sides.
pub(crate) fn is_seam(uses: &[EdgeUse]) -> bool {
    uses.windows(2).any(|w| w[0].uv != w[1].uv)
}

/// Things in rows, each row in the order of the things.
struct Rows<T> {
    offsets: Vec<u32>,
    items: Vec<T>,
}

impl<T> Rows<T> {
    fn row(&self, i: usize) -> &[T] {
        &self.items[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }
}

/// Counting sort: `things` yields each with its row, the same ones at each call.
fn buckets<T: Copy, I: Iterator<Item = (u32, T)>>(n: usize, things: impl Fn() -> I) -> Rows<T> {
    let mut offsets = vec![0u32; n + 1];
    for (row, _) in things() {
        offsets[row as usize + 1] += 1;
    }
    for i in 0..n {
        offsets[i + 1] += offsets[i];
    }
    let mut items = match things().next() {
        Some((_, filler)) => vec![filler; offsets[n] as usize],
        None => Vec::new(),
    };
    let mut next = offsets.clone();
    for (row, thing) in things() {
        let slot = &mut next[row as usize];
        items[*slot as usize] = thing;
        *slot += 1;
    }
    Rows { offsets, items }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use crate::uv::seams_of;

    #[test]
    fn few_and_many_corners_are_joined_alike() {
        // A fan around vertex 0, first with few, then with many faces; every other face has 0 elsewhere.
        for n in [6u32, 200] {
            let mut faces = Polygons::new();
            let mut values = Vec::new();
            for k in 0..n {
                faces.push(&[0, 1 + k, 1 + (k + 1) % n]);
                let rim = |k: u32| Some([f64::from(k), 1.0]);
                values.extend([Some([f64::from(k % 2), -0.0 * f64::from(k)]), rim(k), rim((k + 1) % n)]);
            }
            let uv = UvMap::from_values(&faces, &values).unwrap();
            assert_eq!(uv.coordinates.len(), n as usize + 2);
            assert_eq!(Layout::new(&faces, &uv).positions.len(), n as usize + 2);
            let mesh = Mesh { points: vec![[0.0; 3]; n as usize + 1], faces, ..Mesh::default() };
            let seams = seams_of(&mesh, &uv).unwrap();
            assert_eq!(seams, (1..=n).map(|k| [0, k]).collect::<Vec<_>>(), "every spoke, and no edge of the rim");
        }
    }
}
