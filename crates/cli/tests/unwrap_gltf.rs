//! `proxel unwrap` from glTF to glTF: the map is new, all else is as it was.

mod common;

use common::Folder;
use common::maps::close;
use serde_json::{Value, json};

/// A wavy quarter of a disk, two materials over common vertices with colours, shown by two nodes; its buffer lies beside it.
fn put(folder: &Folder) -> Value {
    const N: u16 = 8;
    let mut bytes = Vec::new();
    let n = usize::from((N + 1) * (N + 1));
    for i in 0..n as u16 {
        let (x, y) = (f32::from(i % (N + 1)), f32::from(i / (N + 1)));
        [x, y, 0.5 * (x * y / 9.0).sin()].iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    }
    bytes.extend((0..4 * n).map(|i| i as u8)); // colours
    for cell in 0..N * N {
        let a = cell / N * (N + 1) + cell % N;
        [a, a + 1, a + N + 2, a, a + N + 2, a + N + 1].iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    }
    std::fs::write(folder.0.join("in.bin"), &bytes).unwrap();
    let half = usize::from(N * N) * 3;
    let primitive = |material: usize| json!({ "attributes": { "POSITION": 0, "COLOR_0": 1 }, "indices": 2 + material, "material": material });
    let index = |from: usize| json!({ "bufferView": 2, "byteOffset": 2 * from, "componentType": 5123, "count": half, "type": "SCALAR" });
    let json = json!({
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0 }, { "mesh": 0, "translation": [20, 0, 0], "name": "again" }],
        "meshes": [{ "name": "wave", "primitives": [primitive(0), primitive(1)] }],
        "materials": [{ "name": "red" }, { "name": "blue", "normalTexture": { "index": 0 } }],
        "textures": [{ "source": 0 }], "images": [{ "uri": "wood.png" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": n, "type": "VEC3", "min": [0, 0, -1], "max": [8, 8, 1] },
            { "bufferView": 1, "componentType": 5121, "normalized": true, "count": n, "type": "VEC4" },
            index(0), index(half)
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 12 * n },
            { "buffer": 0, "byteOffset": 12 * n, "byteLength": 4 * n },
            { "buffer": 0, "byteOffset": 16 * n, "byteLength": 4 * half }
        ],
        "buffers": [{ "uri": "in.bin", "byteLength": bytes.len() }]
    });
    folder.put("in.gltf", &json.to_string());
    json
}

#[test]
fn materials_nodes_and_textures_are_kept() {
    let folder = Folder::new("unwrap-gltf");
    let old = put(&folder);
    std::fs::create_dir(folder.0.join("maps")).unwrap();
    folder.run("unwrap in.gltf --out maps/out.gltf --report r.json").is(0);
    let r: Value = serde_json::from_str(&folder.read("r.json")).unwrap();
    assert_eq!(
        (&r["status"], &r["charts"], &r["flips"], &r["overlaps"]),
        (&"converged".into(), &2.into(), &0.into(), &0.into())
    );
    assert_eq!((&r["unmapped_faces"], &r["warnings"]), (&0.into(), &json!([])));
    let mut new: Value = serde_json::from_str(&folder.read("maps/out.gltf")).unwrap();
    assert_eq!(new["images"][0]["uri"], "../wood.png");
    new["images"][0]["uri"] = "wood.png".into();
    assert_eq!(new["nodes"][1]["mesh"], 1, "the second node has a map of its own");
    new["nodes"][1]["mesh"] = 0.into();
    for key in ["asset", "scenes", "nodes", "materials", "textures", "images"] {
        assert_eq!(new[key], old[key], "{key}");
    }
    for mesh in [0, 1] {
        assert_eq!(new["meshes"][mesh]["name"], "wave");
        for p in [0, 1] {
            let primitive = &new["meshes"][mesh]["primitives"][p];
            assert_eq!(primitive["material"], p);
            let names: Vec<&String> = primitive["attributes"].as_object().unwrap().keys().collect();
            assert_eq!(names, ["COLOR_0", "POSITION", "TEXCOORD_0"]);
        }
    }
    // The same surface as OBJ has the same map, which glTF rounds.
    folder.run("convert in.gltf --out in.obj").is(0);
    folder.run("unwrap in.obj --out out.obj --report obj.json").is(0);
    let obj: Value = serde_json::from_str(&folder.read("obj.json")).unwrap();
    close(obj["energy"].as_f64().unwrap(), r["energy"].as_f64().unwrap(), 1e-5);
    close(obj["packing"].as_f64().unwrap(), r["packing"].as_f64().unwrap(), 1e-4);
    // The map of the output is a start as good as any, and its seams are borders.
    folder.run("unwrap maps/out.gltf --from-uv --out again.glb --report r.json").is(0);
    let again: Value = serde_json::from_str(&folder.read("r.json")).unwrap();
    close(again["energy"].as_f64().unwrap(), r["energy"].as_f64().unwrap(), 1e-5);
}

#[test]
fn what_cannot_be_kept_is_refused_before_the_solve() {
    let folder = Folder::new("unwrap-gltf-refused");
    let mut json = put(&folder);
    json["accessors"][1]["count"] = 7.into();
    folder.put("in.gltf", &json.to_string());
    folder.run("unwrap in.gltf --out out.glb").is_refused(&["in.gltf", "accessor 1 has 7 elements for 81 vertices"]);
    folder.run("unwrap in.gltf --out out.obj").is(0);
    assert_eq!(folder.names(), ["in.bin", "in.gltf", "out.obj"]);
}
