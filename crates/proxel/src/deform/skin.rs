//! The surface that a lattice carries, as far as it touches something.

use std::collections::BTreeMap;

/// A surface whose vertices nodes of a mesh carry: pressures and obstacles act on it and name its vertices, instead of those
/// of the mesh.
///
/// Vertices at the same place of the same elements, which files have for seams of textures or because each triangle has its
/// own, are one.
#[derive(Clone, Debug, Default)]
pub struct Skin {
    carried: Vec<Option<([u32; 4], [f64; 4])>>,
    same: Vec<u32>, // the first vertex in the same place
    triangles: Vec<[u32; 3]>,
}

impl Skin {
    /// For each vertex the nodes that carry it and their weights, which add up to 1, or nothing where it has no part in the
    /// surface; triangles that are counter-clockwise from outside. Triangles of vertices that are not carried are left out.
    pub fn new(carried: Vec<Option<([u32; 4], [f64; 4])>>, triangles: &[[u32; 3]]) -> Self {
        let mut first: BTreeMap<([u32; 4], [u64; 4]), u32> = BTreeMap::new();
        let same: Vec<u32> = (0u32..)
            .zip(&carried)
            .map(|(v, at)| at.map_or(v, |(nodes, w)| *first.entry((nodes, w.map(f64::to_bits))).or_insert(v)))
            .collect();
        let is_carried = |v: &u32| carried.get(*v as usize).is_some_and(Option::is_some);
        let used = triangles.iter().filter(|t| t.iter().all(is_carried));
        let triangles = used.map(|t| t.map(|v| same[v as usize])).collect();
        Skin { carried, same, triangles }
    }

    /// Number of vertices, carried or not.
    pub fn n(&self) -> usize {
        self.carried.len()
    }

    /// The nodes that carry a vertex, and their weights.
    pub fn at(&self, v: u32) -> Option<([u32; 4], [f64; 4])> {
        *self.carried.get(v as usize)?
    }

    /// The triangles whose corners are all among these vertices, over the first vertex of each place.
    pub fn patch(&self, vertices: &[u32]) -> Vec<[u32; 3]> {
        let mut chosen = vec![false; self.n()];
        for same in vertices.iter().filter_map(|v| self.same.get(*v as usize)) {
            chosen[*same as usize] = true;
        }
        self.triangles.iter().copied().filter(|t| t.iter().all(|v| chosen[*v as usize])).collect()
    }

    /// The vertices of triangles, one for each place, ascending.
    pub fn places(&self) -> Vec<u32> {
        let mut places = self.triangles.as_flattened().to_vec();
        places.sort_unstable();
        places.dedup();
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_in_the_same_place_are_one() {
        let at = |w: f64| Some(([0, 1, 2, 3], [w, 1.0 - w, 0.0, 0.0]));
        // Two triangles with corners of their own, and one with a corner that nothing carries.
        let carried = vec![at(0.0), at(0.1), at(0.2), at(0.1), at(0.2), at(0.3), None];
        let skin = Skin::new(carried, &[[0, 1, 2], [3, 4, 5], [0, 1, 6]]);
        assert_eq!(skin.places(), [0, 1, 2, 5]);
        assert_eq!(skin.patch(&[0, 3, 4]), [[0, 1, 2]], "either copy names the place");
        assert_eq!(skin.patch(&[0, 1, 2, 5]), [[0, 1, 2], [1, 2, 5]]);
        assert!(skin.at(6).is_none() && skin.n() == 7);
    }
}
