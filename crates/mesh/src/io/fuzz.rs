//! Damaged files of every format: an error or a sound mesh, never a panic, never memory for what the
//! file only claims.

use proptest::prelude::*;

use super::text::Text;
use super::{Format, parse_mesh};
use super::{gltf, gmsh, medit, npy, obj, off, ply, stl, tetgen, vtk, vtu_write};
use crate::error::Result;
use crate::fields::Fields;
use crate::generate::{CellSplit, beam, cloth};
use crate::mesh::Mesh;

fn written(format: Format) -> Vec<u8> {
    let mut body = beam([1, 1, 1], [1.0; 3], CellSplit::Five).unwrap();
    body.tet_regions = Some(vec![1, 2, 3, 4, 5]);
    body.edges = vec![[0, 1]];
    let cloth = cloth([2, 1], [1.0, 1.0]).unwrap();
    let fields = Fields::none();
    let mut out = Vec::new();
    match format {
        Format::TetGen => tetgen::write_nodes(&body, &mut out),
        Format::Medit => medit::write(&body, &mut out),
        Format::Gmsh => gmsh::write(&body, &mut out),
        Format::Vtk => vtk::write(&body, &fields, &mut out),
        Format::Vtu => vtu_write::write(&body, &fields, &mut out),
        Format::Obj => obj::write(&cloth, &mut out),
        Format::Ply => ply::write(&cloth, &fields, &mut out),
        Format::Stl => stl::write(&cloth, &mut out),
        Format::Off => off::write(&cloth, &mut out),
        Format::Gltf => gltf::write(&cloth, false, &mut out),
        Format::Glb => gltf::write(&cloth, true, &mut out),
        Format::Npy => npy::write_points(&body.points, &mut out),
    }
    .unwrap();
    out
}

/// Gmsh 4.1 in both forms, which are read but not written; VTK in binary; STL in binary.
fn others() -> Vec<(Format, Vec<u8>)> {
    let gmsh4 = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 1 7 0\n$EndEntities\n\
        $Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n\
        $Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";
    let mut binary4 = b"$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n".to_vec();
    let size = |out: &mut Vec<u8>, n: &[u64]| n.iter().for_each(|n| out.extend(n.to_le_bytes()));
    let int = |out: &mut Vec<u8>, n: &[i32]| n.iter().for_each(|n| out.extend(n.to_le_bytes()));
    size(&mut binary4, &[1, 4, 1, 4]);
    int(&mut binary4, &[3, 1, 0]);
    size(&mut binary4, &[4, 1, 2, 3, 4]);
    for x in [0f64, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.] {
        binary4.extend(x.to_le_bytes());
    }
    binary4.extend(b"\n$EndNodes\n$Elements\n");
    size(&mut binary4, &[1, 1, 1, 1]);
    int(&mut binary4, &[3, 1, 4]);
    size(&mut binary4, &[1, 1, 1, 2, 3, 4]);
    binary4.extend(b"\n$EndElements\n");
    let mut vtk = b"# vtk DataFile Version 5.1\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n".to_vec();
    for x in [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.] {
        vtk.extend(x.to_be_bytes());
    }
    vtk.extend(b"\nCELLS 2 4\nOFFSETS vtktypeint64\n");
    [0i64, 4].iter().for_each(|n| vtk.extend(n.to_be_bytes()));
    vtk.extend(b"\nCONNECTIVITY vtktypeint64\n");
    [0i64, 1, 2, 3].iter().for_each(|n| vtk.extend(n.to_be_bytes()));
    vtk.extend(b"\nCELL_TYPES 1\n\0\0\0\x0a\n");
    let mut stl = vec![0; 84 + 50];
    stl[80] = 1;
    stl[84 + 24..84 + 28].copy_from_slice(&1f32.to_le_bytes());
    stl[84 + 40..84 + 44].copy_from_slice(&1f32.to_le_bytes());
    vec![(Format::Gmsh, gmsh4.into()), (Format::Gmsh, binary4), (Format::Vtk, vtk), (Format::Stl, stl)]
}

fn parse(format: Format, data: &[u8]) -> Result<()> {
    match format {
        Format::TetGen => {
            // The same bytes as either file of the pair.
            let mut mesh = Mesh { points: vec![[0.0; 3]; 8], ..Mesh::default() };
            let elements = tetgen::parse_elements("fuzz.ele", data, &mut mesh);
            tetgen::parse_nodes("fuzz.node", data).map(|_| ()).or(elements)
        }
        Format::Npy => npy::parse_points("fuzz", data).map(|_| ()),
        _ => parse_mesh(format, "fuzz", data)?.check_indices(),
    }
}

const ALL: [Format; 12] = [
    Format::TetGen,
    Format::Medit,
    Format::Gmsh,
    Format::Vtk,
    Format::Vtu,
    Format::Obj,
    Format::Ply,
    Format::Stl,
    Format::Off,
    Format::Gltf,
    Format::Glb,
    Format::Npy,
];

fn samples() -> Vec<(Format, Vec<u8>)> {
    let mut all: Vec<_> = ALL.iter().map(|&f| (f, written(f))).collect();
    let mut ele = Vec::new();
    tetgen::write_elements(&beam([1, 1, 1], [1.0; 3], CellSplit::Six).unwrap(), &mut ele).unwrap();
    all.push((Format::TetGen, ele));
    all.extend(others());
    all
}

#[test]
fn samples_are_sound() {
    for (format, data) in samples() {
        parse(format, &data).unwrap_or_else(|e| panic!("{format:?}: {e}"));
    }
}

#[test]
fn every_prefix_is_refused_or_sound() {
    for (format, data) in samples() {
        for n in 0..data.len() {
            if let Err(e) = parse(format, &data[..n]) {
                assert_eq!(e.to_string().lines().count(), 1, "{format:?} cut at {n}");
            }
        }
    }
}

#[test]
fn deep_nesting_does_not_exhaust_the_stack() {
    let deep = format!("<VTKFile>{}", "<a>".repeat(300_000));
    assert!(parse_mesh(Format::Vtu, "fuzz", deep.as_bytes()).is_err());
}

/// One place in a file and what happens there.
#[derive(Clone, Debug)]
pub(crate) enum Damage {
    Set(u8),
    Flip(u8),
    Delete(usize),
    Insert(Vec<u8>),
    Repeat(usize),
}

pub(crate) fn damage() -> impl Strategy<Value = (usize, Damage)> {
    let words = prop::sample::select(vec![
        "-1",
        "0",
        "99999999999999999999",
        "4294967295",
        "9223372036854775807",
        "1e999",
        "nan",
        "-",
        "\n",
        " ",
        "$",
        "\0",
        "<a>",
        "#",
        "/",
        "x",
    ]);
    let kind = prop_oneof![
        any::<u8>().prop_map(Damage::Set),
        (0..8u8).prop_map(Damage::Flip),
        (1..40usize).prop_map(Damage::Delete),
        prop::collection::vec(any::<u8>(), 1..9).prop_map(Damage::Insert),
        words.prop_map(|w| Damage::Insert(w.as_bytes().to_vec())),
        (1..60usize).prop_map(Damage::Repeat),
    ];
    (any::<usize>(), kind)
}

pub(crate) fn apply(data: &mut Vec<u8>, (place, damage): &(usize, Damage)) {
    if data.is_empty() {
        return;
    }
    let at = place % data.len();
    match damage {
        Damage::Set(b) => data[at] = *b,
        Damage::Flip(bit) => data[at] ^= 1 << bit,
        Damage::Delete(n) => drop(data.drain(at..(at + n).min(data.len()))),
        Damage::Insert(bytes) => drop(data.splice(at..at, bytes.iter().copied())),
        Damage::Repeat(n) => {
            let part = data[at..(at + n).min(data.len())].to_vec();
            drop(data.splice(at..at, part));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files(which in 0..17usize, damages in prop::collection::vec(damage(), 1..6)) {
        let (format, mut data) = samples().swap_remove(which);
        damages.iter().for_each(|d| apply(&mut data, d));
        if let Err(e) = parse(format, &data) {
            prop_assert_eq!(e.to_string().lines().count(), 1);
        }
    }

    #[test]
    fn noise(format in prop::sample::select(ALL.to_vec()), data in prop::collection::vec(any::<u8>(), 0..300)) {
        if let Err(e) = parse(format, &data) {
            prop_assert_eq!(e.to_string().lines().count(), 1);
        }
    }

    #[test]
    fn words_are_read_to_the_end(text in "[ \n#a-z0-9\\\\.-]{0,80}") {
        let mut lines = Text::new("fuzz", text.as_bytes()).unwrap();
        while lines.next_line().is_some() {}
        let mut words = Text::new("fuzz", text.as_bytes()).unwrap();
        while words.next_word().is_some() {}
    }
}
