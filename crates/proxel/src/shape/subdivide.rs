//! Quad subdivision with fair places for what is new.

use super::ShapeError;
use proxel_linalg::sparse::{Cholesky, Ordering, SolveScratch, SymPattern, Symbolic};
use proxel_mesh::topology::polygon_edges;
use proxel_mesh::{Mesh, subdivide as topological};
use proxel_split::SymmetricForm;
use std::sync::Arc;

/// Splits each face of k corners into k quads. Vertices keep their numbers and places; midpoints of edges follow, sorted
/// by their edge, then centres of faces, where
///
/// ```text
/// sum_v |x_v - mean of its neighbours|^2
/// ```
///
/// over all vertices is least, the neighbours of a vertex on the border being those along the border: the preparation of
/// wire meshes by Zhang et al. 2019, who count all neighbours there, which pulls the border inward.
///
/// # Errors
/// Bad indices, a mesh too large, and a system that cannot be solved.
pub fn subdivide(mesh: &Mesh) -> Result<Mesh, ShapeError> {
    let split = topological::subdivide(mesh)?;
    let (mut out, first) = (split.mesh, split.n_original);
    let n = out.n_verts();
    let (nodes, coefficients, ends) = laplacians(&out);
    let stencils = ends.windows(2).map(|w| (&nodes[w[0]..w[1]], &coefficients[w[0]..w[1]], 1.0));
    let form = SymmetricForm::from_stencils(n, stencils);
    // K_nn d = -(K x)_n: from the middles, where differences are small, whatever the origin.
    let mut pull = vec![0.0; 3 * n];
    form.value_and_gradient(out.points.as_flattened(), 3, Some(&mut pull));
    let free = n - first;
    let mut lower: Vec<(u32, u32)> = Vec::new();
    for i in first..n {
        lower.extend(
            form.row(i).filter(|(j, _)| (first..=i).contains(j)).map(|(j, _)| ((i - first) as u32, (j - first) as u32)),
        );
    }
    let cliques: Vec<[u32; 2]> = lower.iter().map(|(i, j)| [*i, *j]).collect();
    let broken =
        |e: proxel_linalg::sparse::SparseError| ShapeError(format!("{}: new vertices have no place: {e}", mesh.name));
    let pattern = SymPattern::from_cliques(free, &cliques).map_err(broken)?;
    let mut values = vec![0.0; pattern.nnz()];
    for i in first..n {
        for (j, k) in form.row(i).filter(|(j, _)| (first..=i).contains(j)) {
            if let Some(slot) = pattern.slot(i - first, j - first) {
                values[slot] += k;
            }
        }
    }
    let mut factor = Cholesky::<f64>::new(Arc::new(Symbolic::analyze(&pattern, Ordering::Auto).map_err(broken)?));
    factor.refactor(&values).map_err(broken)?;
    let moves = &mut pull[3 * first..];
    factor.solve_in_place(moves, 3, &mut SolveScratch::default()).map_err(broken)?;
    for (p, d) in out.points[first..].iter_mut().zip(moves.as_chunks::<3>().0) {
        *p = [0, 1, 2].map(|c| p[c] - d[c]);
    }
    Ok(out)
}

/// Rows x_v - mean of its neighbours: vertices, coefficients, and where each row ends.
fn laplacians(mesh: &Mesh) -> (Vec<u32>, Vec<f64>, Vec<usize>) {
    // (vertex, neighbour), once for each face on the edge.
    let edges = mesh.faces.iter().flat_map(polygon_edges);
    let mut pairs: Vec<[u32; 2]> = edges.flat_map(|[a, b]| [[a, b], [b, a]]).collect();
    pairs.sort_unstable();
    let (mut nodes, mut coefficients, mut ends) = (Vec::new(), Vec::new(), vec![0]);
    for around in pairs.chunk_by(|a, b| a[0] == b[0]) {
        let neighbours: Vec<&[[u32; 2]]> = around.chunk_by(|a, b| a == b).collect();
        let border = neighbours.iter().any(|n| n.len() == 1);
        let own: Vec<u32> = neighbours.iter().filter(|n| !border || n.len() == 1).map(|n| n[0][1]).collect();
        nodes.push(around[0][0]);
        coefficients.push(1.0);
        coefficients.extend(std::iter::repeat_n(-1.0 / own.len() as f64, own.len()));
        nodes.extend(own);
        ends.push(nodes.len());
    }
    (nodes, coefficients, ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proxel_mesh::Polygons;

    #[test]
    fn new_vertices_are_fair_and_borders_keep_their_line() {
        // A torus of quads: new vertices bulge outward from the middles, whose mean distance from the core is too short.
        let (m, n) = (24usize, 12usize);
        let at = |i: usize, j: usize| ((i % m) * n + j % n) as u32;
        let mut mesh = Mesh { name: "torus".to_string(), ..Mesh::default() };
        for i in 0..m {
            for j in 0..n {
                let (a, b) = (std::f64::consts::TAU * i as f64 / m as f64, std::f64::consts::TAU * j as f64 / n as f64);
                mesh.points.push([(3.0 + b.cos()) * a.cos(), (3.0 + b.cos()) * a.sin(), b.sin()]);
            }
        }
        let mut faces = Polygons::new();
        for i in 0..m {
            for j in 0..n {
                faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        mesh.faces = faces;
        let out = subdivide(&mesh).expect("a surface");
        assert_eq!(out.points[..m * n], mesh.points[..]);
        let off = |p: &[f64; 3]| (((p[0] * p[0] + p[1] * p[1]).sqrt() - 3.0).hypot(p[2]) - 1.0).abs();
        let worst = |points: &[[f64; 3]]| points[m * n..].iter().map(off).fold(0.0, f64::max);
        let middles = topological::subdivide(&mesh).expect("a surface").mesh;
        assert!(worst(&out.points) < 0.5 * worst(&middles.points), "{} {}", worst(&out.points), worst(&middles.points));
        // A band cut from it: new vertices of the border stay on the border's circles, to a fair spline's error.
        let mut band = mesh.clone();
        band.faces = Polygons::new();
        (0..m * n).filter(|f| f % n < n / 2).for_each(|f| band.faces.push(mesh.faces.get(f)));
        let cut = subdivide(&band).expect("a surface");
        // Of those of 4, the outer one; the middle of a chord lies 0.034 inside.
        let near = |p: &&[f64; 3]| p[2].abs() < 0.1 && (p[0].hypot(p[1]) - 4.0).abs() < 0.1;
        let outer: Vec<f64> =
            cut.points[m * n..].iter().filter(near).map(|p| (p[0].hypot(p[1]) - 4.0).hypot(p[2])).collect();
        assert!(outer.len() == m && outer.iter().all(|d| *d < 0.01), "{outer:?}");
        // The same at another place and in another unit.
        let mut far = mesh.clone();
        far.points.iter_mut().for_each(|p| *p = p.map(|c| 1e3 * c + 1e6));
        let moved = subdivide(&far).expect("a surface");
        let same = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|d| (1e3 * a[d] + 1e6 - b[d]).abs() < 1e-7);
        assert!(out.points.iter().zip(&moved.points).all(same));
    }
}
