//! Bending of thin sheets as a quadratic form.

mod rest;

use proxel_split::SymmetricForm;

/// Rest triangles flatter than this, as 4 sqrt(3) area / sum of squared edges (1 for an equilateral one), are degenerate:
/// their cotangents would swamp the sheet.
const DEGENERATE: f64 = 1e-6;

/// The quadratic bending energy of a triangle mesh over its interior edges e, each with the nodes x_0, x_1 of the edge
/// and x_2, x_3 opposite to it:
///
/// ```text
/// 1/2 sum_e K 3 / (A_0 + A_1) |c_e . x|^2,    c_e . x = sum_i c_i x_i,
/// c = (c03 + c04, c01 + c02, -c01 - c03, -c02 - c04)
/// ```
///
/// with A the areas at rest and c_jk the cotangents at rest of the angles between e_0 = x_1 - x_0 and e_1 = x_2 - x_0,
/// e_2 = x_3 - x_0, e_3 = x_2 - x_1, e_4 = x_3 - x_1. It is 1/2 K times the integral of the squared mean curvature vector
/// (of the trace of the curvature) for isometric deformations of a sheet that is flat at rest; a fold by an angle theta at an
/// edge of length l counts 6 K l^2 sin^2(theta/2) / (A_0 + A_1). Bergou, Wardetzky, Harmon, Zorin and Grinspun, "A
/// quadratic bending model for inextensible surfaces", 2006, section 3.
///
/// K has the unit of force times length, that of the flexural rigidity E h^3 / (12 (1 - nu^2)) of a plate of thickness h.
/// Folds are confined to edges, so that regular meshes are up to 3 times stiffer than that plate.
#[derive(Clone, Debug, Default)]
pub struct Bending {
    hinges: Vec<Hinge>,
    n: usize,
    /// Edges of three or more triangles: they do not bend, having no two sides.
    pub nonmanifold: Vec<[u32; 2]>,
    /// Triangles too flat to have cotangents; their edges do not bend.
    pub degenerate: Vec<u32>,
    /// Edges of one triangle: free borders.
    pub boundary: usize,
}

/// An interior edge.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hinge {
    nodes: [u32; 4],        // the edge's, then the opposite ones
    coefficients: [f64; 4], // c
    factor: f64,            // 3 / (A_0 + A_1)
}

impl Bending {
    /// Of the triangles over positions at rest (flat, `dim` numbers a node, 2 or 3). Triangles may be oriented as they
    /// like.
    pub fn new(positions: &[f64], dim: usize, triangles: &[[u32; 3]]) -> Self {
        let at = |v: u32| -> [f64; 3] {
            std::array::from_fn(|d| if d < dim { positions[v as usize * dim + d] } else { 0.0 })
        };
        let mut bending = Bending { n: positions.len() / dim, ..Bending::default() };
        let mut is_flat = vec![false; triangles.len()];
        // (lower end, higher end, opposite node, triangle)
        let mut sides: Vec<(u32, u32, u32, u32)> = Vec::with_capacity(3 * triangles.len());
        for (t, triangle) in triangles.iter().enumerate() {
            if quality(triangle.map(at)) < DEGENERATE {
                bending.degenerate.push(t as u32);
                is_flat[t] = true;
            }
            for k in 0..3 {
                let (a, b, c) = (triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
                sides.push((a.min(b), a.max(b), c, t as u32));
            }
        }
        sides.sort_unstable_by_key(|s| (s.0, s.1, s.3));
        for edge in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            match edge {
                [_] => bending.boundary += 1,
                [a, b] if !is_flat[a.3 as usize] && !is_flat[b.3 as usize] && a.2 != b.2 => {
                    let nodes = [a.0, a.1, a.2, b.2];
                    bending.hinges.push(Hinge::new(nodes, nodes.map(at)));
                }
                [_, _] => {}
                [a, ..] => bending.nonmanifold.push([a.0, a.1]),
                [] => {}
            }
        }
        bending
    }

    /// Number of interior edges that bend.
    pub fn n_hinges(&self) -> usize {
        self.hinges.len()
    }

    /// The quadratic form with the coefficient K.
    pub fn form(&self, k: f64) -> SymmetricForm {
        SymmetricForm::from_stencils(
            self.n,
            self.hinges.iter().map(|h| (&h.nodes[..], &h.coefficients[..], k * h.factor)),
        )
    }
}

impl Hinge {
    fn new(nodes: [u32; 4], x: [[f64; 3]; 4]) -> Self {
        let e = |from: usize, to: usize| minus(x[to], x[from]);
        let (e0, e1, e2, e3, e4) = (e(0, 1), e(0, 2), e(0, 3), e(1, 2), e(1, 3));
        let back = e0.map(|v| -v);
        // Angles within the triangles: at x_0 between e0 and e1 or e2, at x_1 between -e0 and e3 or e4.
        let (c01, c02, c03, c04) = (cotangent(e0, e1), cotangent(e0, e2), cotangent(back, e3), cotangent(back, e4));
        let areas = norm(cross(e0, e1)) / 2.0 + norm(cross(e0, e2)) / 2.0;
        Hinge { nodes, coefficients: [c03 + c04, c01 + c02, -c01 - c03, -c02 - c04], factor: 3.0 / areas }
    }
}

/// 4 sqrt(3) area / sum of squared edges.
fn quality([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let (u, v, w) = (minus(b, a), minus(c, a), minus(c, b));
    let sum = dot(u, u) + dot(v, v) + dot(w, w);
    2.0 * 3f64.sqrt() * norm(cross(u, v)) / sum.max(f64::MIN_POSITIVE)
}

/// Cotangent of the angle between two vectors.
fn cotangent(a: [f64; 3], b: [f64; 3]) -> f64 {
    dot(a, b) / norm(cross(a, b))
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}
