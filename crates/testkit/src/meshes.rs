//! Meshes small enough to be checked by hand.

/// Tetrahedra with positive volume: `(b - a) . ((c - a) x (d - a)) > 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct TetMesh {
    /// Positions.
    pub vertices: Vec<[f64; 3]>,
    /// Vertices of each tetrahedron.
    pub tets: Vec<[u32; 4]>,
}

/// Triangles, counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct TriMesh {
    /// Positions.
    pub vertices: Vec<[f64; 2]>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// The corner tetrahedron of the unit cube, of volume 1/6.
pub fn one_tet() -> TetMesh {
    TetMesh {
        vertices: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        tets: vec![[0, 1, 2, 3]],
    }
}

/// Two tetrahedra that share the face 1 2 3: volumes 1/6 and 1/3.
pub fn two_tets() -> TetMesh {
    let mut mesh = one_tet();
    mesh.vertices.push([1.0, 1.0, 1.0]);
    mesh.tets.push([1, 2, 3, 4]);
    mesh
}

/// The unit cube in 5 tetrahedra: one in the middle (volume 1/3), four corners (1/6). Vertex x + 2 y + 4 z.
pub fn cube_of_5() -> TetMesh {
    let mut mesh = beam(1, 1, 1, 1.0);
    mesh.tets = vec![[0, 1, 2, 4], [3, 2, 1, 7], [5, 1, 4, 7], [6, 4, 2, 7], [1, 2, 4, 7]];
    mesh
}

/// The unit cube in 6 tetrahedra of equal volume around the diagonal from (0, 0, 0) to (1, 1, 1).
pub fn cube_of_6() -> TetMesh {
    beam(1, 1, 1, 1.0)
}

/// nx x ny x nz cubes of the given edge, each in 6 tetrahedra (Kuhn's subdivision, whose faces match between cubes).
/// Vertex (x, y, z) has the index x + (nx + 1) (y + (ny + 1) z).
pub fn beam(nx: usize, ny: usize, nz: usize, edge: f64) -> TetMesh {
    let index = |p: [usize; 3]| (p[0] + (nx + 1) * (p[1] + (ny + 1) * p[2])) as u32;
    let mut mesh = TetMesh { vertices: Vec::new(), tets: Vec::new() };
    for z in 0..=nz {
        for y in 0..=ny {
            for x in 0..=nx {
                mesh.vertices.push([x as f64 * edge, y as f64 * edge, z as f64 * edge]);
            }
        }
    }
    // Paths from one corner to the opposite one along the axes; an odd order of axes has the other orientation.
    let paths = [
        ([0, 1, 2], false),
        ([1, 2, 0], false),
        ([2, 0, 1], false),
        ([0, 2, 1], true),
        ([2, 1, 0], true),
        ([1, 0, 2], true),
    ];
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                for (axes, odd) in paths {
                    let mut p = [x, y, z];
                    let mut tet = [index(p); 4];
                    for (corner, axis) in axes.into_iter().enumerate() {
                        p[axis] += 1;
                        tet[corner + 1] = index(p);
                    }
                    if odd {
                        tet.swap(2, 3);
                    }
                    mesh.tets.push(tet);
                }
            }
        }
    }
    mesh
}

/// nx x ny squares of the given edge, each in 2 triangles. Vertex (x, y) has the index x + (nx + 1) y.
pub fn grid(nx: usize, ny: usize, edge: f64) -> TriMesh {
    let index = |x: usize, y: usize| (x + (nx + 1) * y) as u32;
    let mut mesh = TriMesh { vertices: Vec::new(), triangles: Vec::new() };
    for y in 0..=ny {
        for x in 0..=nx {
            mesh.vertices.push([x as f64 * edge, y as f64 * edge]);
            if x < nx && y < ny {
                mesh.triangles.push([index(x, y), index(x + 1, y), index(x + 1, y + 1)]);
                mesh.triangles.push([index(x, y), index(x + 1, y + 1), index(x, y + 1)]);
            }
        }
    }
    mesh
}

impl TetMesh {
    /// Signed volume of tetrahedron `t`.
    pub fn volume(&self, t: usize) -> f64 {
        let [a, b, c, d] = self.tets[t].map(|v| self.vertices[v as usize]);
        let edge = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
        let (b, c, d) = (edge(b), edge(c), edge(d));
        (b[0] * (c[1] * d[2] - c[2] * d[1]) - b[1] * (c[0] * d[2] - c[2] * d[0]) + b[2] * (c[0] * d[1] - c[1] * d[0]))
            / 6.0
    }
}

impl TriMesh {
    /// Signed area of triangle `t`.
    pub fn area(&self, t: usize) -> f64 {
        let [a, b, c] = self.triangles[t].map(|v| self.vertices[v as usize]);
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn check(mesh: &TetMesh, volume: f64, boundary_faces: usize) {
        let volumes: Vec<f64> = (0..mesh.tets.len()).map(|t| mesh.volume(t)).collect();
        assert!(volumes.iter().all(|v| *v > 0.0), "{volumes:?}");
        assert!((volumes.iter().sum::<f64>() - volume).abs() < 1e-12, "{volumes:?}");
        let mut faces: HashMap<[u32; 3], usize> = HashMap::new();
        for t in &mesh.tets {
            for skip in 0..4 {
                let mut f: Vec<u32> = (0..4).filter(|c| *c != skip).map(|c| t[c]).collect();
                f.sort_unstable();
                *faces.entry([f[0], f[1], f[2]]).or_default() += 1;
            }
        }
        assert!(faces.values().all(|n| *n <= 2));
        assert_eq!(faces.values().filter(|n| **n == 1).count(), boundary_faces);
    }

    #[test]
    fn tetrahedra_fill_their_shapes_and_match_at_faces() {
        check(&one_tet(), 1.0 / 6.0, 4);
        check(&two_tets(), 1.0 / 2.0, 6);
        check(&cube_of_5(), 1.0, 12);
        check(&cube_of_6(), 1.0, 12);
        check(&beam(4, 2, 3, 0.5), 24.0 * 0.125, 2 * 2 * (8 + 12 + 6));
        assert_eq!(beam(4, 2, 3, 0.5).vertices.len(), 60);
    }

    #[test]
    fn triangles_fill_the_rectangle() {
        let mesh = grid(3, 2, 0.5);
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (12, 12));
        assert!((0..12).all(|t| (mesh.area(t) - 0.125).abs() < 1e-15));
    }
}
