//! Fairing: quadratics that hold the differential coordinates of a mesh.

use proxel_split::{Quadratic, SymmetricForm};

/// A row of L: vertices and their coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stencils {
    starts: Vec<usize>,
    nodes: Vec<u32>,
    coefficients: Vec<f64>,
}

impl Stencils {
    fn push(&mut self, row: impl IntoIterator<Item = (u32, f64)>) {
        self.starts.push(self.nodes.len());
        for (node, c) in row {
            self.nodes.push(node);
            self.coefficients.push(c);
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.starts.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.starts.is_empty()
    }

    /// Vertices and coefficients of each row.
    pub fn iter(&self) -> impl Iterator<Item = (&[u32], &[f64])> + '_ {
        let ends = self.starts.iter().skip(1).copied().chain([self.nodes.len()]);
        self.starts.iter().zip(ends).map(|(from, to)| (&self.nodes[*from..to], &self.coefficients[*from..to]))
    }

    /// K = weight L^T L over n vertices: 1/2 x^T K x = weight/2 |L x|^2.
    pub fn form(&self, n: usize, weight: f64) -> SymmetricForm {
        SymmetricForm::from_stencils(n, self.iter().map(|(nodes, c)| (nodes, c, weight)))
    }
}

/// How a mesh is faired: weights of the quadratics of [`Stencils`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fairing {
    /// w of w/2 |L x|^2, the Laplacian: makes the mesh smooth, whatever it was before.
    pub smooth: f64,
    /// w of w/2 |L (x - x~)|^2, the relative Laplacian (Liu et al. 2011): holds the shape of before.
    pub relative: f64,
}

impl Fairing {
    /// Makes both part of f: K = (smooth + relative) L^T L, b = relative L^T L x~, and the constant relative/2 |L x~|^2, x~
    /// being the positions of all vertices, `3 n` numbers.
    pub fn add_to(&self, stencils: &Stencils, before: &[f64], quadratic: &mut Quadratic) {
        let n = before.len() / 3;
        if stencils.is_empty() || !(self.smooth + self.relative > 0.0) {
            return;
        }
        if self.relative > 0.0 {
            let mut loads = vec![0.0; before.len()];
            let held = stencils.form(n, self.relative);
            quadratic.constant += held.value_and_gradient(before, 3, Some(&mut loads));
            quadratic.loads.resize(before.len(), 0.0);
            quadratic.loads.iter_mut().zip(loads).for_each(|(b, l)| *b += l);
        }
        let form = stencils.form(n, self.smooth + self.relative);
        let others = std::mem::take(&mut quadratic.form);
        quadratic.form = if others.is_empty() { form } else { SymmetricForm::sum(&[others, form]) };
    }
}

/// The rows of the fairing of Liu et al. 2011 for the polygons of a mesh of n vertices, as A's implementation has them:
///
/// - an inner vertex of four edges: v - (n1 + n3)/2 and v - (n2 + n4)/2, its neighbours in their order around it,
/// - any other inner vertex: v - mean of its neighbours,
/// - a vertex of the border with two border edges, of two faces: v - (b1 + b2)/2,
/// - others, such as corners of one face and vertices where more than one border passes: nothing.
///
/// The Laplacian L of [`form`](Stencils::form) times x - x~ holds the shape of before, which is then no part of the
/// gradient.
pub fn laplacian<'a>(n: usize, faces: impl Iterator<Item = &'a [u32]> + Clone) -> Stencils {
    let wings = wings(n, faces);
    let mut out = Stencils::default();
    for around in wings.chunk_by(|a, b| a.0 == b.0) {
        let v = around[0].0;
        // Each edge at v by the other end, once for each face on it.
        let mut ends: Vec<(u32, u32)> = around.iter().flat_map(|w| [(w.1, w.3), (w.2, w.3)]).collect();
        ends.sort_unstable();
        let edges: Vec<&[(u32, u32)]> = ends.chunk_by(|a, b| a.0 == b.0).collect();
        let border: Vec<(u32, u32)> = edges.iter().filter(|e| e.len() == 1).map(|e| e[0]).collect();
        if border.is_empty() {
            match (ring(around), edges.len()) {
                (Some([a, b, c, d]), 4) => {
                    out.push([(v, 1.0), (a, -0.5), (c, -0.5)]);
                    out.push([(v, 1.0), (b, -0.5), (d, -0.5)]);
                }
                _ => {
                    let part = -1.0 / edges.len() as f64;
                    out.push([(v, 1.0)].into_iter().chain(edges.iter().map(|e| (e[0].0, part))));
                }
            }
        } else if let [(a, f), (b, g)] = border[..]
            && f != g
        {
            out.push([(v, 1.0), (a, -0.5), (b, -0.5)]);
        }
    }
    out
}

/// The inner vertices of four faces, each with its neighbours in their order around it, by vertex.
pub fn rings_of_four<'a>(n: usize, faces: impl Iterator<Item = &'a [u32]>) -> Vec<[u32; 5]> {
    let wings = wings(n, faces);
    let closed = |around: &[(u32, u32, u32, u32)]| ring(around).map(|[a, b, c, d]| [around[0].0, a, b, c, d]);
    wings.chunk_by(|a, b| a.0 == b.0).filter_map(closed).collect()
}

/// At each corner the next vertex and the one before it, by vertex: (vertex, next, before, face).
fn wings<'a>(n: usize, faces: impl Iterator<Item = &'a [u32]>) -> Vec<(u32, u32, u32, u32)> {
    let mut wings: Vec<(u32, u32, u32, u32)> = Vec::new();
    for (f, face) in faces.enumerate() {
        for (k, v) in face.iter().enumerate() {
            let (next, before) = (face[(k + 1) % face.len()], face[(k + face.len() - 1) % face.len()]);
            if (*v as usize) < n {
                wings.push((*v, next, before, f as u32));
            }
        }
    }
    wings.sort_unstable();
    wings
}

/// The neighbours of a vertex of four faces in their order around it, whichever way faces are oriented.
fn ring(around: &[(u32, u32, u32, u32)]) -> Option<[u32; 4]> {
    let [first, others @ ..] = around else { return None };
    if others.len() != 3 {
        return None;
    }
    let mut ring = [first.1, first.2, 0, 0];
    let mut left: Vec<&(u32, u32, u32, u32)> = others.iter().collect();
    for k in 2..4 {
        let last = ring[k - 1];
        let at = left.iter().position(|w| w.1 == last || w.2 == last)?;
        let wing = left.swap_remove(at);
        ring[k] = if wing.1 == last { wing.2 } else { wing.1 };
    }
    let closes = left.first().is_some_and(|w| (w.1, w.2) == (ring[3], ring[0]) || (w.2, w.1) == (ring[3], ring[0]));
    closes.then_some(ring)
}
