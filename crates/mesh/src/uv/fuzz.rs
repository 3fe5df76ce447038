//! Damaged files: what can be read as a mesh can be written with a map, and gives the mesh and the map back.

use proptest::prelude::*;

use super::{Source, UvMap, gltf, obj, parse_uv, ply};
use crate::io::fuzz::{apply, damage};
use crate::io::{Format, parse_mesh};
use crate::mesh::{Mesh, Polygons};

const OBJ: &str = "\u{feff}# head \\\n# more\r\nmtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0 # c\nv 0 1 0\nvn 0 0 1\n\
    vt 0 0\nvt 1 0 \\\n 0\nvt .5 .5\no one\ng a b\nusemtl m\ns 1\nf 1/1/1 2/2/1 -2/-1/1\nf 1/1 \\\n 3/3 \\ \n 4/2\n\
    vt 7 7\nf -4//1 2//1 3//1 4//1\nl 1/1 2/2 3\np 1\ncurv2 1 2\nf 4/4 2/2 1/1";

const PLY: &str = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 4\n\
    property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty float s\nproperty float t\n\
    element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int material\n\
    element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n\
    0 0 0 255 0 0\n1 0 0 0 1 0\n1 1 0 0 1 1\n0 1 0 0 0 1\n\
    3 0 1 2 6 0 0 .5 0 .5 .5 7\n4 0 1 2 3 0 8\n0 2\n";

/// Some map of these faces; about one face in five is left out.
pub(super) fn some_map(faces: &Polygons, seed: u64) -> UvMap {
    let random = |i: usize| {
        (seed ^ i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31).wrapping_mul(0x94d0_49bb_1331_11eb)
    };
    let n = 1 + (seed % 7) as usize;
    let coordinates = (0..n).map(|i| [random(i) as f64 / 3.0, -1.0 / (random(i + 99) | 1) as f64]).collect();
    let mut corners = Vec::new();
    for (f, face) in faces.iter().enumerate() {
        let mapped = random(f + 7) % 5 != 0;
        corners
            .extend((0..face.len()).map(|k| if mapped { (random(13 * f + k) % n as u64) as u32 } else { UvMap::NONE }));
    }
    UvMap { coordinates, corners }
}

/// Bit for bit, at each corner.
fn values(uv: &UvMap) -> Vec<Option<[u64; 2]>> {
    (0..uv.corners.len()).map(|i| uv.at(i).map(|x| x.map(f64::to_bits))).collect()
}

fn round_trip(format: Format, data: &[u8], seed: u64) -> Option<Vec<u8>> {
    let one_line = |e: crate::MeshError| assert_eq!(e.to_string().lines().count(), 1);
    let _ = parse_uv(format, "fuzz", data).map_err(one_line);
    let mesh = parse_mesh(format, "fuzz", data).map_err(one_line).ok()?;
    let uv = some_map(&mesh.faces, seed);
    let mut out = Vec::new();
    match format {
        Format::Obj => obj::rewrite("fuzz", data, &uv, &mut out).unwrap(),
        _ => ply::rewrite("fuzz", data, &mesh.faces, &uv, &mut out).unwrap(),
    }
    let again: Mesh = parse_mesh(format, "fuzz", &out).unwrap();
    assert_eq!(again, mesh);
    match parse_uv(format, "fuzz", &out).unwrap() {
        Some(back) => {
            assert_eq!(values(&back), values(&uv));
            if format == Format::Obj {
                assert_eq!(back, uv);
            }
        }
        None => assert!(uv.corners.iter().all(|&c| c == UvMap::NONE)),
    }
    Some(out)
}

#[test]
fn samples_go_round_and_stay() {
    for (format, data) in [(Format::Obj, OBJ), (Format::Ply, PLY)] {
        for seed in 0..50 {
            let once = round_trip(format, data.as_bytes(), seed).unwrap();
            assert_eq!(round_trip(format, &once, seed).unwrap(), once, "a fixed point");
        }
    }
}

#[test]
fn every_prefix_is_refused_or_goes_round() {
    for (format, data) in [(Format::Obj, OBJ), (Format::Ply, PLY)] {
        for n in 0..data.len() {
            round_trip(format, &data.as_bytes()[..n], n as u64);
        }
    }
}

#[test]
fn every_white_space_parts_numbers() {
    for space in ["\x0b", "\x0c", "\t", " \r"] {
        for seed in 0..5 {
            round_trip(Format::Ply, PLY.replace("1 1\n0 1", &format!("1 1{space}0 1")).as_bytes(), seed).unwrap();
            round_trip(Format::Ply, PLY.replace("4 0 1 2 3", &format!("4 0 1{space}2 3")).as_bytes(), seed).unwrap();
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files(is_obj in any::<bool>(), damages in prop::collection::vec(damage(), 1..6), seed in any::<u64>()) {
        let (format, text) = if is_obj { (Format::Obj, OBJ) } else { (Format::Ply, PLY) };
        let mut data = text.as_bytes().to_vec();
        damages.iter().for_each(|d| apply(&mut data, d));
        round_trip(format, &data, seed);
    }

    #[test]
    fn damaged_gltf(binary in any::<bool>(), damages in prop::collection::vec(damage(), 1..6)) {
        let mesh = parse_mesh(Format::Obj, "fuzz", OBJ.as_bytes()).unwrap();
        let split = gltf::Split::new("fuzz", &mesh, &some_map(&mesh.faces, 5)).unwrap();
        let mut data = Vec::new();
        split.write(binary, &mut data).unwrap();
        prop_assert!(parse_uv(Format::Glb, "fuzz", &data).unwrap().is_some());
        damages.iter().for_each(|d| apply(&mut data, d));
        match parse_uv(Format::Glb, "fuzz", &data) {
            Ok(Some(uv)) => uv.check(&parse_mesh(Format::Glb, "fuzz", &data).unwrap().faces).unwrap(),
            Ok(None) => {}
            Err(e) => prop_assert_eq!(e.to_string().lines().count(), 1),
        }
    }

    #[test]
    fn lines_of_obj(
        text in "(v 0 0 0\n){3}(((f|vt|l|#|g|s)( [-1-3/#\\\\]{1,5}){0,4}[ \r\\\\]{0,2}\n)|(f 1/1 2/ -1//7\n)){0,9}",
        seed in any::<u64>(),
    ) {
        round_trip(Format::Obj, text.as_bytes(), seed);
    }
}

#[test]
fn a_source_of_another_mesh_is_refused() {
    let mesh = parse_mesh(Format::Obj, "a.obj", OBJ.as_bytes()).unwrap();
    let uv = some_map(&mesh.faces, 3);
    let source =
        Source { format: Format::Obj, file: "b.obj", data: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", folder: None };
    let path = std::env::temp_dir().join(format!("proxel-uv-{}-other.obj", std::process::id()));
    let e = super::write_with_uv(&path, &mesh, Some(source), &uv).unwrap_err();
    assert!(e.to_string().contains("its 4 faces are not the 1 of the original file"), "{e}");
    assert!(!path.exists());
}
