//! Charts of the real files in the folder that `PROXEL_DATA` names; without it each test says so and passes.

use std::path::PathBuf;

use proxel_mesh::charts::{ChartOptions, Charts, charts, disk_defect};
use proxel_mesh::{Mesh, read_mesh};

fn data(folder: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("PROXEL_DATA") else {
        println!("skipped: PROXEL_DATA names no folder with data");
        return None;
    };
    let path = PathBuf::from(root).join(folder);
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: {} is missing", path.display());
    None
}

/// The 3D length of the seams over the diagonal of the bounding box of all used vertices.
fn seam_length(mesh: &Mesh, charts: &Charts) -> f64 {
    let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for &v in mesh.faces.indices() {
        for c in 0..3 {
            low[c] = low[c].min(mesh.points[v as usize][c]);
            high[c] = high[c].max(mesh.points[v as usize][c]);
        }
    }
    let length = |e: &[u32; 2]| distance(mesh.points[e[0] as usize], mesh.points[e[1] as usize]);
    charts.seams.iter().map(length).fold(0.0, |a, b| a + b) / distance(low, high)
}

#[test]
fn disks_come_out_untouched() {
    let Some(folder) = data("parameterization") else { return };
    for name in ["bimba", "dino", "dog", "hilbert", "horse"] {
        let mesh = read_mesh(&folder.join(name).with_extension("obj")).unwrap();
        assert_eq!(disk_defect(&mesh), None, "{name}");
        let out = charts(&mesh, &ChartOptions::default()).unwrap();
        assert_eq!((out.charts.len(), out.seams.len(), out.repairs.len(), out.warnings.len()), (1, 0, 0, 0), "{name}");
        let chart = &out.charts[0];
        assert!(chart.is_disk());
        assert!(chart.vertices.iter().copied().eq(0..mesh.n_verts() as u32), "{name}");
        assert_eq!(chart.triangles, mesh.faces.as_triangles().unwrap(), "{name}");
        assert!(out.places.iter().zip(mesh.faces.indices()).all(|(p, v)| p.is_some_and(|p| p.vertex == *v)));
    }
}

#[test]
fn surfaces_have_fewer_charts_and_shorter_seams_than_an_atlas() {
    let Some(folder) = data("surfaces") else { return };
    // Charts, and seams over the diagonal, of uvunwrap 0.3 at its defaults; loops of ours.
    let table: [(&str, usize, f64, &[usize]); 6] = [
        ("cheburashka", 75, 13.439, &[1]),
        ("fandisk", 13, 8.218, &[1]),
        ("spot", 38, 11.655, &[1]),
        ("stanford-bunny", 63, 15.539, &[4]),
        ("suzanne", 57, 12.712, &[1, 1, 2, 1]),
        ("teapot", 42, 4.465, &[]),
    ];
    for (name, most_charts, most_seams, loops) in table {
        let mesh = read_mesh(&folder.join(name).with_extension("obj")).unwrap();
        let out = charts(&mesh, &ChartOptions::default()).unwrap();
        let length = seam_length(&mesh, &out);
        println!("{name}: {} charts, seams {length:.3}", out.charts.len());
        assert!(out.charts.len() < most_charts && length < 0.5 * most_seams, "{name}: {length}");
        if !loops.is_empty() {
            assert_eq!(out.charts.iter().map(|c| c.loops.len()).collect::<Vec<_>>(), loops, "{name}");
        }
        assert!(out.charts.iter().all(|c| c.defect().is_none()));
        assert!(out.places.iter().all(Option::is_some), "{name}");
    }
}

#[test]
fn handles_of_scans_are_cut() {
    let Some(folder) = data("geodesic") else { return };
    for (name, most) in [("eight_nf8k", 4.0), ("kitten_nf20k", 3.0), ("bunny_nf42k", 5.0)] {
        let mesh = read_mesh(&folder.join(name).with_extension("obj")).unwrap();
        let out = charts(&mesh, &ChartOptions::default()).unwrap();
        let length = seam_length(&mesh, &out);
        println!("{name}: seams {length:.3}");
        assert!(out.charts.len() == 1 && out.charts[0].is_disk());
        assert!(length < most, "{name}: {length}");
    }
}
