//! Maps of meshes with triangles as thin as needles.

use proxel::mesh::Mesh;
use proxel::mesh::uv::{CertificateOptions, certify};
use proxel::settings::UnwrapSettings;
use proxel::split::Status;
use proxel::unwrap::{Hooks, UnwrapInput, Unwrapped, unwrap};

/// A sheet with a bump as high as `height`; every `every`th triangle is cut into three at a point as near to a corner or a side
/// as `least`, by barycentric coordinates.
fn sheet(cells: usize, height: f64, every: usize, least: f64) -> Mesh {
    let (n, row) = (cells as u32, cells as u32 + 1);
    let mut points = Vec::new();
    for j in 0..row {
        for i in 0..row {
            let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            let r2 = (u - 0.5).powi(2) + (v - 0.5).powi(2);
            points.push([u, v, height * (-30.0 * r2).exp()]);
        }
    }
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let a = i + row * j;
            triangles.extend([[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]);
        }
    }
    for (k, f) in (0..triangles.len()).step_by(every).enumerate() {
        let [a, b, c] = triangles[f];
        let w = [1.0, least.powf((k % 5) as f64 / 4.0), least.powf((k % 3) as f64 / 2.0)];
        let sum: f64 = w.iter().sum();
        let corners = [a, b, c].map(|v| points[v as usize]);
        let new = points.len() as u32;
        points.push([0, 1, 2].map(|d| (0..3).map(|k| w[k] / sum * corners[k][d]).sum()));
        triangles[f] = [a, b, new];
        triangles.extend([[b, c, new], [c, a, new]]);
    }
    Mesh::from_triangles("sheet", points, &triangles)
}

fn flips_and_map(mesh: &Mesh) -> (usize, Unwrapped) {
    let input = UnwrapInput { mesh: mesh.clone(), ..UnwrapInput::default() };
    let map = unwrap(&input, &UnwrapSettings::default(), &mut Hooks::default()).expect("a map");
    let certificate = certify(&mesh.points, &mesh.faces, &map.uv, &CertificateOptions::default()).expect("certified");
    (certificate.flips + certificate.zero_area, map)
}

/// With factors in f32 alone neither is there after 300 iterations: their rounding hides all but the stiffness of the needles.
#[test]
fn needles_take_factors_in_f64() {
    for (cells, height, every, least) in [(14, 2.0, 6, 1e-6), (20, 2.0, 20, 1e-6)] {
        let (bad, map) = flips_and_map(&sheet(cells, height, every, least));
        assert_eq!((map.status, bad), (Status::Converged, 0), "{}", map.report.reason);
        assert!(map.report.iterations <= 150, "{} iterations", map.report.iterations);
    }
}
