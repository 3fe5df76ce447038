//! glTF files that get another map: all else stays.

mod fuzz;
mod model;
mod spec;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::fuzz::some_map;
use super::{Source, UvMap, as_stored, check_source, gltf, parse_uv, read_uv_onto, write_with_uv};
use crate::error::ErrorKind;
use crate::io::{Format, parse_mesh, read_mesh_lenient};
use crate::mesh::Mesh;
use model::{Model, number};

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("proxel-uv-gltf-{}-{name}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The file with another map.
fn rewritten(data: &[u8], uv: &UvMap, binary: bool) -> crate::Result<Vec<u8>> {
    let mesh = parse_mesh(Format::Glb, "in", data)?;
    let source = Source { format: Format::Glb, file: "in", data, folder: None };
    let file = gltf::rewrite("out", &mesh, source, uv)?;
    let mut out = Vec::new();
    file.write(binary, &mut out).unwrap();
    Ok(out)
}

/// Positions and coordinates at each corner are those of `mesh` and `uv`, which has 32-bit numbers in the file.
fn check_map(out: &[u8], mesh: &Mesh, uv: &UvMap) {
    let back = parse_mesh(Format::Glb, "out", out).unwrap();
    assert_eq!(back.faces.offsets(), mesh.faces.offsets());
    let corners =
        |m: &Mesh| m.faces.indices().iter().map(|&v| m.points[v as usize].map(f64::to_bits)).collect::<Vec<_>>();
    assert_eq!(corners(&back), corners(mesh));
    let (map, stored) = (parse_uv(Format::Glb, "out", out).unwrap().unwrap(), as_stored(uv, Format::Glb));
    for i in 0..uv.corners.len() {
        assert_eq!(map.at(i), Some(stored.at(i).unwrap_or([0.0; 2])), "corner {i}");
    }
}

/// Everything at the corners of two primitives but what depends on the map.
fn check_corners(old: (&Model, &Value), new: (&Model, &Value)) {
    let kept = |attributes: &Value| -> Vec<String> {
        let names = attributes.as_object().unwrap().keys();
        names.filter(|n| !["TEXCOORD_0", "TANGENT"].contains(&n.as_str())).cloned().collect()
    };
    let (from, to) = (old.0.triangles(old.1), new.0.triangles(new.1));
    assert_eq!(from.len(), to.len());
    let sets = |p: &Value| {
        let targets = p["targets"].as_array().cloned().unwrap_or_default();
        [vec![p["attributes"].clone()], targets].concat()
    };
    assert_eq!(sets(old.1).len(), sets(new.1).len());
    for (k, (a, b)) in sets(old.1).iter().zip(&sets(new.1)).enumerate() {
        let names = kept(a);
        assert!(names.iter().all(|n| b.get(n).is_some()) && b.get("TANGENT").is_none(), "{b}");
        for name in names {
            let described = |m: &Model, a: &Value| {
                let mut accessor = m.json["accessors"][number(a)].clone();
                for key in ["bufferView", "byteOffset", "count", "sparse"] {
                    accessor.as_object_mut().unwrap().remove(key);
                }
                accessor
            };
            assert_eq!(described(old.0, &a[&name]), described(new.0, &b[&name]), "{name} of {k}");
            for (&v, &w) in from.as_flattened().iter().zip(to.as_flattened()) {
                assert_eq!(old.0.element(&a[&name], v), new.0.element(&b[&name], w), "{name} of {k}: {v} and {w}");
            }
        }
    }
}

/// What the numbers of accessors and views stand for, in their place.
fn resolved(m: &Model) -> Value {
    let mut json = m.json.clone();
    let elements = |a: &Value| json!((0..m.count(a)).map(|i| m.element(a, i)).collect::<Vec<_>>());
    for skin in json["skins"].as_array_mut().unwrap() {
        skin["inverseBindMatrices"] = elements(&skin["inverseBindMatrices"]);
    }
    for sampler in json["animations"][0]["samplers"].as_array_mut().unwrap() {
        sampler["input"] = elements(&sampler["input"]);
        sampler["output"] = elements(&sampler["output"]);
    }
    json["images"][1]["bufferView"] = json!(m.view_bytes(number(&json["images"][1]["bufferView"])));
    for mesh in json["meshes"].as_array_mut().unwrap() {
        for p in mesh["primitives"].as_array_mut().unwrap() {
            let p = p.as_object_mut().unwrap();
            if !matches!(p.get("mode").and_then(Value::as_u64), Some(1)) {
                ["attributes", "targets", "indices", "mode"].iter().for_each(|k| drop(p.remove(*k)));
            } else {
                let position = elements(&p["attributes"]["POSITION"]);
                let indices = elements(&p["indices"]);
                p.insert("indices".into(), indices);
                p.insert("attributes".into(), position);
            }
        }
    }
    for key in ["accessors", "bufferViews", "buffers"] {
        json.as_object_mut().unwrap().remove(key);
    }
    json
}

#[test]
fn all_but_the_map_is_kept() {
    let old = Model::rich();
    let mesh = parse_mesh(Format::Glb, "in", &old.file(true)).unwrap();
    assert_eq!(mesh.faces.len(), 8 + 2 * (4 + 3), "8 of the body, strip and fan twice");
    for seed in 0..24 {
        let uv = some_map(&mesh.faces, seed);
        let out = rewritten(&old.file(seed % 2 == 0), &uv, seed % 3 == 0).unwrap();
        check_map(&out, &mesh, &uv);
        let new = Model::of(&out);
        spec::check(&new);
        // The second node with the band has one of its own, and nothing else differs.
        let mut expected = old.clone();
        let band = expected.json["meshes"][1].clone();
        expected.json["meshes"].as_array_mut().unwrap().push(band);
        expected.json["nodes"][2]["mesh"] = json!(3);
        assert_eq!(resolved(&new), resolved(&expected));
        for (a, b) in expected.json["meshes"].as_array().unwrap().iter().zip(new.json["meshes"].as_array().unwrap()) {
            for (p, q) in a["primitives"].as_array().unwrap().iter().zip(b["primitives"].as_array().unwrap()) {
                let mode = p.get("mode").map(|m| if number(m) == 1 { 1 } else { 4 });
                assert_eq!(q.get("mode").map(number), mode);
                check_corners((&old, p), (&new, q));
            }
        }
        let primitive = |m: usize, p: usize| &new.json["meshes"][m]["primitives"][p];
        assert_eq!(primitive(0, 0)["attributes"], primitive(0, 1)["attributes"], "shared vertices stay shared");
        assert_eq!(primitive(0, 0)["targets"], primitive(0, 1)["targets"]);
        let hidden = [&old, &new].map(|m| {
            let p = &m.json["meshes"][2]["primitives"][0]["attributes"];
            (0..9).map(|i| (m.element(&p["POSITION"], i), m.element(&p["TEXCOORD_0"], i))).collect::<Vec<_>>()
        });
        assert_eq!(hidden[0], hidden[1], "what no scene shows keeps its coordinates");
        // Again from the output: a fixed point but for the accessor of zeros, which becomes one of bytes.
        let twice = rewritten(&out, &uv, true).unwrap();
        check_map(&twice, &mesh, &uv);
        spec::check(&Model::of(&twice));
        assert_eq!(rewritten(&twice, &uv, true).unwrap(), twice);
    }
}

#[test]
fn a_map_without_seams_divides_nothing() {
    let old = Model::rich();
    let data = old.file(true);
    let mesh = parse_mesh(Format::Glb, "in", &data).unwrap();
    let coordinates = (0..mesh.n_verts()).map(|v| [v as f64 / 64.0, 0.25]).collect();
    let uv = UvMap { coordinates, corners: mesh.faces.indices().to_vec() };
    let new = Model::of(&rewritten(&data, &uv, true).unwrap());
    let p = &new.json["meshes"][0]["primitives"][0];
    let before = &old.json["meshes"][0]["primitives"][0];
    assert_eq!(new.triangles(p), old.triangles(before), "all keep their numbers");
    for (name, a) in before["attributes"].as_object().unwrap() {
        match name.as_str() {
            "TANGENT" => assert!(p["attributes"].get("TANGENT").is_none()),
            "TEXCOORD_0" => {
                let at = |i: usize| model::floats(&[i as f32 / 64.0, 0.75]);
                assert!((0..9).all(|i| new.element(&p["attributes"]["TEXCOORD_0"], i) == at(i)));
            }
            _ => assert!((0..9).all(|i| new.element(&p["attributes"][name], i) == old.element(a, i)), "{name}"),
        }
    }
}

#[test]
fn extensions_that_may_name_accessors_keep_their_numbers() {
    let mut old = Model::rich();
    old.json["extensionsUsed"] = json!(["VENDOR_unknown", "KHR_draco_mesh_compression", "EXT_meshopt_compression"]);
    let compressed =
        json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": {} }, "VENDOR_unknown": 1 });
    old.json["meshes"][0]["primitives"][0]["extensions"] = compressed;
    old.json["bufferViews"][3]["extensions"] = json!({ "EXT_meshopt_compression": { "buffer": 0 } });
    let data = old.file(true);
    let mesh = parse_mesh(Format::Glb, "in", &data).unwrap();
    let new = Model::of(&rewritten(&data, &some_map(&mesh.faces, 4), true).unwrap());
    let n = old.json["accessors"].as_array().unwrap().len();
    for a in 0..n {
        assert_eq!(new.json["accessors"][a], old.json["accessors"][a]);
        let a = json!(a);
        for i in 0..old.count(&a) {
            assert_eq!(new.element(&a, i), old.element(&a, i));
        }
    }
    assert_eq!(new.json["extensionsUsed"], json!(["VENDOR_unknown"]));
    assert_eq!(new.json["meshes"][0]["primitives"][0]["extensions"], json!({ "VENDOR_unknown": 1 }));
    assert_eq!(new.json["bufferViews"][3].get("extensions"), None);
}

#[test]
fn files_beside_the_source() {
    let folder = Folder::new("paths");
    let (from, to) = (folder.0.join("in"), folder.0.join("out"));
    [&from, &to].iter().for_each(|f| fs::create_dir_all(f).unwrap());
    let mut old = Model::rich();
    let (input, data) = (from.join("a.gltf"), old.file(false));
    fs::write(from.join("part one.bin"), &old.buffers[0]).unwrap();
    let mut json: Value = serde_json::from_slice(&data).unwrap();
    json["buffers"][0]["uri"] = json!("part%20one.bin");
    let data = serde_json::to_vec(&json).unwrap();
    fs::write(&input, &data).unwrap();
    let mesh = read_mesh_lenient(&input).unwrap();
    let uv = some_map(&mesh.faces, 2);
    let source = |folder: Option<&'static Path>| Source { format: Format::Gltf, file: "a.gltf", data: b"", folder };
    let source = Source { data: &data, folder: Some(&from), ..source(None) };
    let image = |path: &Path| Model::of(&fs::read(path).unwrap()).json["images"][0]["uri"].clone();
    for (name, uri) in [("a.gltf", "textures/wood%20dark.png"), ("../out/b.glb", "../in/textures/wood%20dark.png")] {
        let out = from.join(name);
        assert_eq!(write_with_uv(&out, &mesh, Some(source), &uv).unwrap(), [""; 0]);
        assert_eq!(image(&out), uri);
        let map = read_uv_onto(&out, &mesh).unwrap().unwrap();
        let stored = as_stored(&uv, Format::Glb);
        assert!((0..map.corners.len()).all(|i| map.at(i) == Some(stored.at(i).unwrap_or([0.0; 2]))));
    }
    // A file that stands for itself, from a place that is not known.
    let data = old.file(true);
    let alone = Source { format: Format::Glb, file: "a.glb", data: &data, folder: None };
    let warnings = write_with_uv(&to.join("c.glb"), &mesh, Some(alone), &uv).unwrap();
    assert_eq!(warnings.len(), 1);
    assert!(
        warnings[0].contains("a.glb: image 0") && warnings[0].contains("`textures/wood%20dark.png`"),
        "{warnings:?}"
    );
    assert_eq!(image(&to.join("c.glb")), "textures/wood%20dark.png");
    // The map of another mesh, and one that is elsewhere.
    old.json["nodes"][0]["mesh"] = json!(2);
    let other = parse_mesh(Format::Glb, "other", &old.file(true)).unwrap();
    let e = write_with_uv(&to.join("d.glb"), &other, Some(source), &some_map(&other.faces, 1)).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::CountMismatch, "{e}");
    assert!(!to.join("d.glb").exists());
    assert_eq!(read_uv_onto(&to.join("c.glb"), &other).unwrap_err().kind(), ErrorKind::CountMismatch);
    let mut moved = mesh.points.clone();
    moved[0][0] += 1e-9;
    let moved = mesh.with_points(moved).unwrap();
    assert_eq!(read_uv_onto(&to.join("c.glb"), &moved).unwrap_err().kind(), ErrorKind::CountMismatch);
}

#[test]
fn what_cannot_be_kept_is_named() {
    let refused = |kind: ErrorKind, part: &str, change: &dyn Fn(&mut Value)| {
        let mut m = Model::rich();
        change(&mut m.json);
        let data = m.file(true);
        let mesh = parse_mesh(Format::Glb, "in.glb", &data).unwrap();
        let source = Source { format: Format::Glb, file: "in.glb", data: &data, folder: None };
        let e = check_source(Format::Gltf, &mesh, source).unwrap_err();
        assert_eq!(e.kind(), kind, "{e}");
        assert!(e.to_string().contains(part), "`{part}` is not in {e}");
        check_source(Format::Obj, &mesh, source).unwrap();
    };
    fn attributes(json: &mut Value) -> &mut Value {
        &mut json["meshes"][0]["primitives"][1]["attributes"]
    }
    use ErrorKind::{CountMismatch, IndexOutOfRange, Malformed, OversizedClaim};
    refused(Malformed, "COLOR_0 is no accessor", &|j| attributes(j)["COLOR_0"] = json!("red"));
    refused(Malformed, "accessor 77: it does not exist", &|j| attributes(j)["COLOR_0"] = json!(77));
    refused(CountMismatch, "accessor 0 has 1 elements for 9 vertices", &|j| attributes(j)["COLOR_0"] = json!(0));
    refused(Malformed, "targets are no list", &|j| j["meshes"][0]["primitives"][0]["targets"] = json!({}));
    refused(Malformed, "its type is none", &|j| j["accessors"][3]["type"] = json!("VEC9"));
    refused(Malformed, "component type", &|j| j["accessors"][3]["componentType"] = json!(1));
    refused(OversizedClaim, "accessor 3", &|j| j["accessors"][3]["byteOffset"] = json!(u64::MAX));
    refused(Malformed, "accessor 99 does not exist", &|j| j["skins"][0]["inverseBindMatrices"] = json!(99));
    refused(Malformed, "buffer view 99 does not exist", &|j| j["images"][1]["bufferView"] = json!(99));
    let sparse = |j: &mut Value| -> usize {
        j["accessors"].as_array().unwrap().iter().position(|a| a.get("sparse").is_some()).unwrap()
    };
    refused(Malformed, "sparse part is incomplete", &|j| {
        let a = sparse(j);
        j["accessors"][a]["sparse"] = json!({ "count": 1 });
    });
    refused(OversizedClaim, "3 elements are claimed", &|j| {
        let a = sparse(j);
        j["accessors"][a]["sparse"]["count"] = json!(3);
    });
    refused(IndexOutOfRange, "replaces element", &|j| {
        let a = sparse(j);
        j["accessors"][a]["sparse"]["indices"]["byteOffset"] = json!(0);
        j["accessors"][a]["sparse"]["indices"]["bufferView"] = json!(2);
    });
}
