//! Fields with a difference along each edge, which sum to zero around faces.

use super::field::{CopiedField, Slot, Ties};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, dispatch};
use proxel_split::Term;
use rayon::prelude::*;

/// An edge with more faces than a term has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyFaces {
    /// The edge.
    pub edge: u32,
    /// Its faces.
    pub faces: usize,
    /// Faces that there is room for.
    pub most: usize,
}

impl std::fmt::Display for TooManyFaces {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "edge {} has {} faces; unknowns on edges are for {} at most", self.edge, self.faces, self.most)
    }
}

impl std::error::Error for TooManyFaces {}

/// Differences x_e along edges, whose sum around every face is zero: s_1 x_1 + s_2 x_2 + s_3 x_3 = 0 with the signs with which
/// the face runs through them; the indicator of that on a copy of x_e for each face of the edge.
///
/// The projection in the norm sum_e (.)^2 / l_e^2 spreads what is wrong over the edges by the squares of their lengths. The
/// image of a copy is s x.
pub struct AroundFaces {
    faces: Vec<[[u32; LANES]; 3]>, // slots of eight faces, the last ones filled up
    scale: f64,                    // the mean length of edges of faces
}

/// Blocks of eight faces that a task handles.
const CHUNK: usize = 512;

/// Sums of three numbers of eight faces.
struct Sums<'a> {
    faces: &'a [[[u32; LANES]; 3]],
    images: &'a [f64],
    sums: &'a mut [f64],
}

impl Kernel for Sums<'_> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (slots, sums) in self.faces.iter().zip(self.sums.as_chunks_mut::<LANES>().0) {
            let first = F8::<I>::gather(self.images, &slots[0], 1, 0) + F8::gather(self.images, &slots[1], 1, 0);
            (first + F8::gather(self.images, &slots[2], 1, 0)).store(sums);
        }
    }
}

impl Ties for AroundFaces {
    const DIFFERENCES: bool = false;

    fn n_joined(&self) -> usize {
        LANES * self.faces.len()
    }

    fn join(&self, images: &[f64], joined: &mut [f64]) {
        let tasks = joined.par_chunks_mut(CHUNK * LANES).zip(self.faces.par_chunks(CHUNK));
        tasks.for_each(|(sums, faces)| dispatch(Sums { faces, images, sums }));
    }

    fn unit(&self) -> f64 {
        self.scale
    }
}

/// The term of differences along `n_edges` edges: for each face its edges, the signs with which it runs through them, and the
/// squared weights of their copies; and the lengths of all edges. The edges of a face are three.
///
/// # Errors
/// An edge with more than 16 faces.
pub fn field_on_edges(
    n_edges: usize,
    edges: &[[u32; 3]],
    signs: &[[f64; 3]],
    weights2: &[[f64; 3]],
    lengths: &[f64],
) -> Result<Box<dyn Term>, TooManyFaces> {
    const MOST: usize = 16;
    let mut around = vec![Vec::new(); n_edges]; // (face, which of its edges)
    for (f, edges) in edges.iter().enumerate() {
        for (k, e) in edges.iter().enumerate() {
            if let Some(around) = around.get_mut(*e as usize) {
                around.push((f, k));
            }
        }
    }
    let surface = Edges { edges, signs, weights2, lengths, around };
    let crowd = surface.around.iter().enumerate().max_by_key(|(_, around)| around.len());
    Ok(match crowd.map_or((0, 0), |(e, around)| (e, around.len())) {
        (_, 0..=2) => Box::new(surface.field::<2>()),
        (_, 3..=4) => Box::new(surface.field::<4>()),
        (_, 5..=MOST) => Box::new(surface.field::<MOST>()),
        (edge, faces) => return Err(TooManyFaces { edge: edge as u32, faces, most: MOST }),
    })
}

struct Edges<'a> {
    edges: &'a [[u32; 3]],
    signs: &'a [[f64; 3]],
    weights2: &'a [[f64; 3]],
    lengths: &'a [f64],
    around: Vec<Vec<(usize, usize)>>,
}

impl Edges<'_> {
    /// With room for K faces at an edge.
    fn field<const K: usize>(&self) -> CopiedField<1, K, AroundFaces> {
        let place = CopiedField::<1, K, AroundFaces>::place;
        let n = self.around.len();
        let n_slots = place(n.next_multiple_of(LANES), 0);
        let mut faces = vec![[[0; LANES]; 3]; self.edges.len().div_ceil(LANES)];
        let mut slots = vec![[Slot::default(); K]; n];
        for (e, around) in self.around.iter().enumerate() {
            for (column, (f, k)) in around.iter().enumerate() {
                faces[f / LANES][*k][f % LANES] = place(e, column) as u32;
                let total: f64 = self.edges[*f].iter().map(|e| self.lengths[*e as usize].powi(2)).sum();
                slots[e][column] = Slot {
                    direction: [self.signs[*f][*k]],
                    other: Some(n_slots + f),
                    share: self.lengths[e].powi(2) / total,
                    weight2: self.weights2[*f][*k],
                };
            }
        }
        let sum: f64 = self.edges.iter().flatten().map(|e| self.lengths[*e as usize]).sum();
        CopiedField::new(&slots, AroundFaces { faces, scale: sum / (3 * self.edges.len()).max(1) as f64 })
    }
}
