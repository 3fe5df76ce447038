//! Fields with a vector in each face, whose parts along common edges agree.

use super::field::{CopiedField, Slot, Ties};
use proxel_linalg::simd::LANES;

/// Vectors G_f of faces, each in the plane of its face, whose parts along a common edge agree: e . G_f = e . G_f' for the unit
/// vector e of every edge; the indicator of that on copies of G_f for each edge of the face, two numbers each, with squared
/// weights mu A_f. Edges with one face tie nothing, and weigh nothing. An edge may have any number of faces.
///
/// The projection in the norm sum_f A_f |.|^2 takes from each copy along e what it has more than the mean of all copies at
/// that edge, weighted by area. The image of a copy is its part along e.
pub type FaceField = CopiedField<2, 3, AlongEdges>;

/// Of each edge with more than two faces the slots, and their shares in its mean. Where there are two, each looks at the other.
pub struct AlongEdges {
    crowded: Vec<Vec<(u32, f64)>>,
}

impl Ties for AlongEdges {
    const DIFFERENCES: bool = true;

    fn n_joined(&self) -> usize {
        self.crowded.len()
    }

    fn join(&self, images: &[f64], joined: &mut [f64]) {
        for (mean, slots) in joined.iter_mut().zip(&self.crowded) {
            *mean = slots.iter().map(|(h, share)| share * images[*h as usize]).sum();
        }
    }

    fn unit(&self) -> f64 {
        1.0
    }
}

impl FaceField {
    /// For each face its area, its edges by number, out of `n_edges`, and their unit vectors from the vertex of lower number,
    /// in the frame of the face; and the penalty mu. Edges that do not exist tie nothing.
    pub fn on_faces(n_edges: usize, edges: &[[u32; 3]], directions: &[[[f64; 2]; 3]], area: &[f64], mu: f64) -> Self {
        let n = edges.len().min(directions.len()).min(area.len());
        let mut at = vec![Vec::new(); n_edges]; // slots, and areas
        let mut slots = vec![[Slot::default(); 3]; n];
        for f in 0..n {
            for k in 0..3 {
                slots[f][k].direction = directions[f][k];
                if let Some(at) = at.get_mut(edges[f][k] as usize) {
                    at.push((f, k, area[f]));
                }
            }
        }
        let n_slots = Self::place(n.next_multiple_of(LANES), 0);
        let mut crowded = Vec::new();
        for around in at.into_iter().filter(|around| around.len() > 1) {
            let total: f64 = around.iter().map(|(_, _, area)| area).sum();
            around.iter().for_each(|(f, k, area)| slots[*f][*k].weight2 = mu * area);
            if let [(f, k, of_f), (g, l, of_g)] = around[..] {
                (slots[f][k].other, slots[f][k].share) = (Some(Self::place(g, l)), of_g / total);
                (slots[g][l].other, slots[g][l].share) = (Some(Self::place(f, k)), of_f / total);
            } else {
                let mean = n_slots + crowded.len();
                around.iter().for_each(|(f, k, _)| (slots[*f][*k].other, slots[*f][*k].share) = (Some(mean), 1.0));
                crowded.push(around.iter().map(|(f, k, area)| (Self::place(*f, *k) as u32, area / total)).collect());
            }
        }
        Self::new(&slots, AlongEdges { crowded })
    }
}
