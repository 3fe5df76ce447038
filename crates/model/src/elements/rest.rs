//! Elements at rest: edges, their inverse, measure.

use super::chunks::morton;

/// An element that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ElementError {
    /// Its measure at rest (signed where it can be) is not a positive number.
    Measure {
        /// Which element.
        element: usize,
        /// Its measure.
        measure: f64,
    },
    /// It names a node that does not exist.
    Index {
        /// Which element.
        element: usize,
        /// The node.
        node: u32,
    },
}

impl std::fmt::Display for ElementError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ElementError::Measure { element, measure } => {
                write!(f, "element {element} has measure {measure:e} at rest; it must be positive")
            }
            ElementError::Index { element, node } => {
                write!(f, "element {element} names node {node}, which does not exist")
            }
        }
    }
}

impl std::error::Error for ElementError {}

/// Simplices of K + 1 corners at rest in D dimensions.
pub struct Rest<const D: usize, const K: usize> {
    positions: Vec<f64>,
    elements: Vec<u32>,
    inverse: Vec<[[f64; K]; K]>,
    measure: Vec<f64>,
    keys: Vec<u64>,
}

impl<const D: usize, const K: usize> Rest<D, K> {
    /// From rest positions (flat, D numbers a node) and elements (flat, K + 1 nodes each). Where K < D the rest edges are
    /// taken in a frame of the element, so that measures are positive; where K = D they are signed.
    ///
    /// # Errors
    /// An element whose measure is not positive, or that names a node past the end.
    pub fn new(positions: &[f64], elements: &[u32]) -> Result<Self, ElementError> {
        let n = elements.len() / (K + 1);
        let mut rest = Rest {
            positions: positions.to_vec(),
            elements: elements.to_vec(),
            inverse: Vec::with_capacity(n),
            measure: Vec::with_capacity(n),
            keys: Vec::with_capacity(n),
        };
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for p in positions.chunks_exact(D) {
            for d in 0..D {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        let size = (0..D).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        for (element, nodes) in elements.chunks_exact(K + 1).enumerate() {
            if let Some(node) = nodes.iter().find(|node| **node as usize >= positions.len() / D) {
                return Err(ElementError::Index { element, node: *node });
            }
            let at = |k: usize| -> [f64; D] { std::array::from_fn(|d| positions[nodes[k] as usize * D + d]) };
            let origin = at(0);
            let mut edges = [[0.0; D]; K]; // one edge a row
            let mut center = [0.0; 3];
            for k in 0..=K {
                let p = at(k);
                for d in 0..D {
                    center[d] += p[d] / (K + 1) as f64;
                    if k > 0 {
                        edges[k - 1][d] = p[d] - origin[d];
                    }
                }
            }
            let (inverse, determinant) = invert(&reduce(&edges));
            rest.push(element, inverse, determinant, morton(center, low, size))?;
        }
        Ok(rest)
    }

    /// From a rest shape for each element, whose columns are its edges from corner 0 in a frame of its own: elements need not
    /// fit each other at rest, as the triangles of a surface that is to be flattened. `centers` are where elements are at
    /// rest; they only say which are near each other.
    ///
    /// # Errors
    /// An element whose measure is not positive, or that names a node past the end.
    pub fn of_shapes(
        shapes: &[[[f64; K]; K]],
        centers: &[[f64; 3]],
        elements: &[u32],
        n_nodes: usize,
    ) -> Result<Self, ElementError> {
        let n = shapes.len();
        let mut rest = Rest {
            positions: Vec::new(),
            elements: elements.to_vec(),
            inverse: Vec::with_capacity(n),
            measure: Vec::with_capacity(n),
            keys: Vec::with_capacity(n),
        };
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for d in 0..3 {
            for center in centers {
                low[d] = low[d].min(center[d]);
                high[d] = high[d].max(center[d]);
            }
        }
        let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        for (element, nodes) in elements.chunks_exact(K + 1).enumerate() {
            if let Some(node) = nodes.iter().find(|node| **node as usize >= n_nodes) {
                return Err(ElementError::Index { element, node: *node });
            }
            let (Some(shape), Some(center)) = (shapes.get(element), centers.get(element)) else {
                return Err(ElementError::Measure { element, measure: f64::NAN });
            };
            let (inverse, determinant) = invert(shape);
            rest.push(element, inverse, determinant, morton(*center, low, size))?;
        }
        Ok(rest)
    }

    fn push(&mut self, element: usize, inverse: [[f64; K]; K], determinant: f64, key: u64) -> Result<(), ElementError> {
        let factorial = [1.0, 1.0, 2.0, 6.0][K];
        let measure = determinant / factorial;
        let finite = inverse.iter().flatten().all(|v| v.is_finite());
        if !(measure > 0.0 && measure.is_finite() && finite) {
            return Err(ElementError::Measure { element, measure });
        }
        self.inverse.push(inverse);
        self.measure.push(measure);
        self.keys.push(key);
        Ok(())
    }

    /// Elements of which only a part is material: energy, weights and forces of element e are `part(e)` times what they
    /// would be. For lattices around a body, whose outer cells are partly empty.
    ///
    /// # Errors
    /// A part that is not positive.
    pub fn filled(mut self, part: impl Fn(usize) -> f64) -> Result<Self, ElementError> {
        for (element, measure) in self.measure.iter_mut().enumerate() {
            *measure *= part(element);
            if !(*measure > 0.0 && measure.is_finite()) {
                return Err(ElementError::Measure { element, measure: *measure });
            }
        }
        Ok(self)
    }

    /// Rest positions, D numbers a node.
    pub(super) fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// Nodes, K + 1 an element.
    pub fn elements(&self) -> &[u32] {
        &self.elements
    }

    /// Inverse of the matrix whose columns are the rest edges: F = [x_1 - x_0, ..] inverse.
    pub fn inverse(&self, e: usize) -> &[[f64; K]; K] {
        &self.inverse[e]
    }

    /// Volume, area or length.
    pub fn measure(&self, e: usize) -> f64 {
        self.measure[e]
    }

    /// Place of each element along a space-filling curve.
    pub(super) fn keys(&self) -> &[u64] {
        &self.keys
    }
}

/// The edges as columns of a K x K matrix: themselves where K = D, else in an orthonormal frame of their own
/// (Gram-Schmidt).
pub(super) fn reduce<const D: usize, const K: usize>(edges: &[[f64; D]; K]) -> [[f64; K]; K] {
    let mut out = [[0.0; K]; K];
    if D == K {
        for (c, edge) in edges.iter().enumerate() {
            for r in 0..K {
                out[r][c] = edge[r];
            }
        }
        return out;
    }
    let mut frame = [[0.0; D]; K];
    for c in 0..K {
        let mut rest = edges[c];
        for r in 0..c {
            let along: f64 = (0..D).map(|d| frame[r][d] * edges[c][d]).sum();
            out[r][c] = along;
            for d in 0..D {
                rest[d] -= along * frame[r][d];
            }
        }
        let length = rest.iter().map(|v| v * v).sum::<f64>().sqrt();
        out[c][c] = length;
        frame[c] = rest.map(|v| v / length);
    }
    out
}

/// Inverse and determinant of a matrix of at most 3 x 3.
pub(super) fn invert<const K: usize>(a: &[[f64; K]; K]) -> ([[f64; K]; K], f64) {
    let mut inverse = [[0.0; K]; K];
    let determinant = match K {
        1 => {
            inverse[0][0] = 1.0 / a[0][0];
            a[0][0]
        }
        2 => {
            let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
            for (r, c, v) in [(0, 0, a[1][1]), (0, 1, -a[0][1]), (1, 0, -a[1][0]), (1, 1, a[0][0])] {
                inverse[r][c] = v / determinant;
            }
            determinant
        }
        _ => {
            let cofactor = |r: usize, c: usize| {
                let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
                a[r1][c1] * a[r2][c2] - a[r1][c2] * a[r2][c1]
            };
            let determinant = (0..3).map(|c| a[0][c] * cofactor(0, c)).sum::<f64>();
            for r in 0..3 {
                for c in 0..3 {
                    inverse[r][c] = cofactor(c, r) / determinant;
                }
            }
            determinant
        }
    };
    (inverse, determinant)
}
