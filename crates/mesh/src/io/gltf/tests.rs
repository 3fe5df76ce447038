use super::*;
use crate::error::Item;
use crate::generate::{CellSplit, beam, cloth};
use crate::mesh::Mesh;
use serde_json::{Value, json};

/// One triangle over three points, in a file with this JSON beside the usual.
fn file(change: impl Fn(&mut Value)) -> Vec<u8> {
    let mut bytes = Vec::new();
    for x in [0f32, 0., 0., 1., 0., 0., 0., 1., 0.] {
        bytes.extend(x.to_le_bytes());
    }
    for i in [0u16, 1, 2, 0] {
        bytes.extend(i.to_le_bytes());
    }
    use base64::Engine;
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let mut root = json!({
        "asset": { "version": "2.0" },
        "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 8 }
        ],
        "buffers": [{ "byteLength": 44, "uri": format!("data:application/octet-stream;base64,{data}") }]
    });
    change(&mut root);
    serde_json::to_vec(&root).unwrap()
}

fn read_file(change: impl Fn(&mut Value)) -> Mesh {
    parse("f.gltf", &file(change)).unwrap()
}

#[track_caller]
fn refused(kind: ErrorKind, part: &str, change: impl Fn(&mut Value)) {
    let e = parse("f.gltf", &file(change)).unwrap_err();
    assert_eq!(e.kind(), kind, "{e}");
    assert!(e.to_string().contains(part), "`{part}` is not in {e}");
}

#[test]
fn nodes_put_meshes_in_place() {
    let plain = read_file(|_| {});
    assert_eq!(plain.points, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(plain.faces.get(0), [0, 1, 2]);
    // A quarter turn around z and a scale of 2, inside a shift; and the same mesh again in a mirror.
    let s = 0.5f64.sqrt();
    let mesh = read_file(|r| {
        r["scenes"] = json!([{ "nodes": [1, 2] }]);
        r["nodes"] = json!([
            { "mesh": 0, "rotation": [0.0, 0.0, s, s], "scale": [2.0, 2.0, 2.0] },
            { "children": [0], "translation": [10.0, 0.0, 0.0] },
            { "mesh": 0, "matrix": [-1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 5, 1] }
        ]);
    });
    let wanted =
        [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [8.0, 0.0, 0.0], [0.0, 0.0, 5.0], [-1.0, 0.0, 5.0], [0.0, 1.0, 5.0]];
    for (p, q) in mesh.points.iter().zip(&wanted) {
        assert!((0..3).all(|d| (p[d] - q[d]).abs() < 1e-14), "{p:?} is not {q:?}");
    }
    assert_eq!((mesh.points.len(), mesh.faces.len()), (6, 2));
    assert_eq!(mesh.faces.get(1), [3, 5, 4], "mirrored, so turned around");
}

#[test]
fn modes_and_shared_positions() {
    let of = |mode: u32| {
        read_file(move |r| {
            r["accessors"][0]["count"] = json!(3);
            r["accessors"][1]["count"] = json!(4);
            r["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        })
    };
    assert_eq!(of(1).edges, [[0, 1], [2, 0]]);
    assert_eq!(of(2).edges, [[0, 1], [1, 2], [2, 0], [0, 0]], "a loop as it stands");
    assert_eq!(of(3).edges, [[0, 1], [1, 2], [2, 0]]);
    assert_eq!(of(5).faces.as_triangles().unwrap(), [[0, 1, 2], [2, 1, 0]]);
    assert_eq!(of(6).faces.len(), 2);
    assert_eq!(of(0).faces.len(), 0);
    let two = read_file(|r| {
        let p = r["meshes"][0]["primitives"][0].clone();
        r["meshes"][0]["primitives"] = json!([p, p]);
    });
    assert_eq!((two.points.len(), two.faces.len()), (3, 2), "one accessor, one set of vertices");
    let bare = read_file(|r| {
        r["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
        r.as_object_mut().unwrap().remove("nodes");
    });
    assert_eq!(bare.faces.get(0), [0, 1, 2]);
}

#[test]
fn what_is_wrong_is_named() {
    use ErrorKind::{IndexOutOfRange, Malformed, OversizedClaim, Unsupported};
    refused(Malformed, "no `asset`", |r| drop(r.as_object_mut().unwrap().remove("asset")));
    refused(Unsupported, "version 1.0", |r| r["asset"]["version"] = json!("1.0"));
    refused(Unsupported, "KHR_draco", |r| r["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]));
    refused(OversizedClaim, "accessor 0: 4000000000", |r| r["accessors"][0]["count"] = json!(4_000_000_000u64));
    refused(OversizedClaim, "accessor 0", |r| r["accessors"][0]["count"] = json!(u64::MAX));
    refused(OversizedClaim, "accessor 0", |r| r["accessors"][0]["byteOffset"] = json!(u64::MAX));
    refused(Malformed, "buffer view 1 reaches past", |r| r["bufferViews"][1]["byteLength"] = json!(9));
    refused(Malformed, "stride 3", |r| r["bufferViews"][0]["byteStride"] = json!(3));
    refused(OversizedClaim, "buffer 0 claims 45", |r| r["buffers"][0]["byteLength"] = json!(45));
    refused(Malformed, "accessor 7", |r| r["meshes"][0]["primitives"][0]["indices"] = json!(7));
    refused(Malformed, "mesh 3", |r| r["nodes"][0]["mesh"] = json!(3));
    refused(Malformed, "POSITION", |r| r["meshes"][0]["primitives"][0]["attributes"] = json!({}));
    refused(Malformed, "type is SCALAR", |r| r["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(1));
    refused(Malformed, "component type 1", |r| r["accessors"][0]["componentType"] = json!(1));
    refused(Malformed, "unsigned", |r| r["accessors"][1]["componentType"] = json!(5122));
    refused(Malformed, "groups of 3", |r| r["accessors"][1]["count"] = json!(4));
    refused(Malformed, "mode 9", |r| r["meshes"][0]["primitives"][0]["mode"] = json!(9));
    refused(Unsupported, "sparse", |r| r["accessors"][0]["sparse"] = json!({}));
    refused(Unsupported, "no buffer view", |r| drop(r["accessors"][0].as_object_mut().unwrap().remove("bufferView")));
    refused(Unsupported, "another file", |r| r["buffers"][0]["uri"] = json!("a.bin"));
    refused(Malformed, "base 64", |r| r["buffers"][0]["uri"] = json!("data:;base64,!"));
    refused(Malformed, "two parents", |r| r["nodes"] = json!([{ "children": [1] }, { "children": [0, 1] }]));
    refused(Malformed, "in the scene twice", |r| r["scenes"][0]["nodes"] = json!([0, 0]));
    refused(Malformed, "twice", |r| r["nodes"][0]["children"] = json!([0]));
    refused(ErrorKind::NonFinite, "node 0", |r| r["nodes"][0]["rotation"] = json!([1e200, 1e200, 0, 0]));
    // The third vertex of the buffer as positions of indices: the last index is 2 of two vertices.
    refused(IndexOutOfRange, "index 2", |r| r["accessors"][0]["count"] = json!(2));
    let e = parse("f.gltf", b"{ \"asset\": \n [ }").unwrap_err();
    assert_eq!((e.kind(), e.line()), (Malformed, Some(2)), "{e}");
}

#[test]
fn infinite_coordinates_are_named() {
    let mut out = Vec::new();
    write(&cloth([1, 1], [1.0, 1.0]).unwrap(), true, &mut out).unwrap();
    let at = out.windows(4).position(|w| w == (-0.5f32).to_le_bytes()).unwrap();
    out[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let e = parse("f.glb", &out).unwrap_err();
    assert_eq!((e.kind(), e.item()), (ErrorKind::NonFinite, Some(Item::Vertex(0))));
}

#[test]
fn both_forms_come_back() {
    let mut mesh = beam([2, 1, 1], [2.0, 1.0, 1.0], CellSplit::Five).unwrap();
    mesh.faces = crate::topology::surface(&mesh);
    mesh.tets.clear();
    mesh.edges = vec![[0, 3], [3, 5]];
    for binary in [false, true] {
        let mut out = Vec::new();
        write(&mesh, binary, &mut out).unwrap();
        let back = parse("f", &out).unwrap();
        // Quarters and halves: 32 bits hold them.
        assert_eq!((&back.points, &back.faces, &back.edges), (&mesh.points, &mesh.faces, &mesh.edges));
    }
    // Far away the shape keeps its digits.
    let far: Vec<[f64; 3]> = mesh.points.iter().map(|p| [p[0] + 1e7, p[1], 0.1 * p[2]]).collect();
    let mut out = Vec::new();
    write(&mesh.with_points(far.clone()).unwrap(), true, &mut out).unwrap();
    let back = parse("f", &out).unwrap();
    for (p, q) in back.points.iter().zip(&far) {
        assert!((0..3).all(|d| (p[d] - q[d]).abs() < 1e-6), "{p:?} {q:?}");
    }
}

#[test]
fn animations_blend_from_frame_to_frame() {
    let mesh = cloth([1, 1], [1.0, 1.0]).unwrap();
    let lifted = |z: f64| -> Vec<[f64; 3]> { mesh.points.iter().map(|p| [p[0], p[1], z]).collect() };
    let mut a = Animation::new("a.gltf", &mesh, 1.0).unwrap();
    a.push(1.5, &lifted(1.0)).unwrap();
    a.push(2.5, &lifted(3.0)).unwrap();
    assert!(a.push(2.5, &lifted(3.0)).unwrap_err().to_string().contains("frame 3 is at time 2.5"));
    let mut out = Vec::new();
    a.write(false, &mut out).unwrap();
    assert_eq!(parse("a", &out).unwrap().points, mesh.points, "the first frame is the mesh");
    let root: Value = serde_json::from_slice(&out).unwrap();
    assert_eq!(root["meshes"][0]["weights"], json!([0.0, 0.0]));
    let targets = &root["meshes"][0]["primitives"][0]["targets"];
    let of = |a: &Value| &root["accessors"][a.as_u64().unwrap() as usize];
    assert_eq!(of(&targets[1]["POSITION"])["max"], json!([0.0, 0.0, 3.0]));
    let sampler = &root["animations"][0]["samplers"][0];
    assert_eq!((&of(&sampler["input"])["max"], &of(&sampler["output"])["count"]), (&json!([1.5]), &json!(6)));
    // The weights at the three times: none, the first target, the second.
    use base64::Engine;
    let uri = root["buffers"][0]["uri"].as_str().unwrap().split_once(',').unwrap().1;
    let bytes = base64::engine::general_purpose::STANDARD.decode(uri).unwrap();
    let view = &root["bufferViews"][of(&sampler["output"])["bufferView"].as_u64().unwrap() as usize];
    let from = view["byteOffset"].as_u64().unwrap() as usize;
    let weights: Vec<f32> =
        bytes[from..from + 24].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    assert_eq!(weights, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
}
