//! Random faces over few vertices: every defect at once.

use proptest::prelude::*;

use super::shapes::scattered;
use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn any_soup_gives_charts_or_an_error(
        n in 3usize..14,
        faces in prop::collection::vec(prop::collection::vec(0u32..14, 0..7), 0..40),
        seams in prop::collection::vec((0usize..400, 0usize..7), 0..6),
        triangles in any::<bool>(),
    ) {
        let mut polygons = crate::Polygons::new();
        for face in &faces {
            let mut p: Vec<u32> = face.iter().map(|&v| v % n as u32).collect();
            if triangles {
                p.truncate(3);
            }
            polygons.push(&p);
        }
        // Seams along sides of faces.
        let seams: Vec<[u32; 2]> = seams
            .iter()
            .filter(|_| !faces.is_empty())
            .map(|&(f, k)| (polygons.get(f % faces.len()), k))
            .filter(|(p, _)| p.len() > 1)
            .map(|(p, k)| [p[k % p.len()], p[(k + 1) % p.len()]])
            .filter(|e| e[0] != e[1])
            .collect();
        let mesh = Mesh { name: "soup".into(), points: scattered(n), faces: polygons, ..Mesh::default() };
        let options = ChartOptions { seams, ..ChartOptions::default() };
        match charts(&mesh, &options) {
            Ok(out) => twin::check_all(&mesh, &out),
            Err(e) => prop_assert_eq!(e.kind(), ErrorKind::Empty, "{}", e),
        }
    }
}
