//! A file with much in it, and an independent reader of its elements.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// The JSON and the buffers of a file, decoded.
#[derive(Clone)]
pub struct Model {
    pub json: Value,
    pub buffers: Vec<Vec<u8>>,
}

pub fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn shorts(numbers: &[u16]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

impl Model {
    fn list(&mut self, key: &str, entry: Value) -> usize {
        let list = self.json[key].as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    }

    fn view(&mut self, buffer: usize, bytes: &[u8], stride: Option<usize>) -> usize {
        let own = &mut self.buffers[buffer];
        own.resize(own.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": buffer, "byteOffset": own.len(), "byteLength": bytes.len() });
        own.extend_from_slice(bytes);
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        self.list("bufferViews", view)
    }

    fn accessor(&mut self, view: usize, component: u32, count: usize, kind: &str) -> usize {
        self.list("accessors", json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }))
    }

    fn packed(&mut self, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
        let view = self.view(0, bytes, None);
        self.accessor(view, component, count, kind)
    }

    /// Positions with their bounds.
    fn points(&mut self, points: &[[f32; 3]]) -> usize {
        let a = self.packed(&floats(points.as_flattened()), 5126, points.len(), "VEC3");
        self.bound(a, points);
        a
    }

    fn bound(&mut self, a: usize, points: &[[f32; 3]]) {
        let bound = |pick: fn(f32, f32) -> f32| {
            points.iter().copied().reduce(|p, q| [0, 1, 2].map(|d| pick(p[d], q[d]))).unwrap()
        };
        self.json["accessors"][a]["min"] = json!(bound(f32::min));
        self.json["accessors"][a]["max"] = json!(bound(f32::max));
    }

    /// Two materials over common vertices with every kind of attribute, a skin and morph targets; a band of strip, fan and
    /// lines that two nodes show, one of them in a mirror; a mesh that no scene shows; textures, an animation, extras.
    pub fn rich() -> Model {
        let json = json!({
            "asset": { "version": "2.0", "generator": "hand", "extras": { "odd": [0.1, 1e-310, 0.30000000000000004] } },
            "extensionsUsed": ["KHR_texture_transform"],
            "scene": 1, "scenes": [{ "nodes": [5] }, { "name": "main", "nodes": [0, 1, 3] }],
            "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.01 } }],
            "materials": [
                { "name": "red", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 0,
                    "extensions": { "KHR_texture_transform": { "scale": [2.0, 3.0] } } } } },
                { "name": "blue", "extras": { "k": 1 }, "normalTexture": { "index": 1 } }
            ],
            "textures": [{ "source": 0, "sampler": 0 }, { "source": 1 }], "samplers": [{ "wrapS": 33071 }],
            "accessors": [], "bufferViews": [], "extras": { "about": "a test", "big": 9007199254740993u64 }
        });
        let mut m = Model { json, buffers: vec![Vec::new(), Vec::new()] };
        // Nothing names the first accessor.
        m.packed(&[7; 12], 5126, 1, "VEC3");
        let n = 9;
        let grid: Vec<[f32; 3]> =
            (0..n).map(|i| [(i % 3) as f32, (i / 3) as f32 + 0.1, 0.3 * (i as f32).sin()]).collect();
        let both: Vec<f32> = grid.iter().flat_map(|p| [p[0], p[1], p[2], 0.0, p[1] - p[0], 1.0]).collect();
        let v = m.view(0, &floats(&both), Some(24));
        let positions = m.accessor(v, 5126, n, "VEC3");
        m.bound(positions, &grid);
        let normals = m.accessor(v, 5126, n, "VEC3");
        m.json["accessors"][normals]["byteOffset"] = json!(12);
        m.json["accessors"][normals]["name"] = json!("normals");
        let v = m.view(0, &(0..4 * n as u8).map(|i| i.wrapping_mul(37)).collect::<Vec<_>>(), Some(4));
        let colors = m.accessor(v, 5121, n, "VEC3");
        m.json["accessors"][colors]["normalized"] = json!(true);
        let joints = m.packed(&(0..4 * n as u8).map(|i| i % 2).collect::<Vec<_>>(), 5121, n, "VEC4");
        let weights = m.packed(&floats(&(0..4 * n).map(|i| i as f32 / 7.0).collect::<Vec<_>>()), 5126, n, "VEC4");
        let v = m.view(0, &shorts(&(0..2 * n as u16).map(|i| 500 * i).collect::<Vec<_>>()), Some(4));
        let ids = m.accessor(v, 5123, n, "SCALAR");
        let uv0 = m.packed(&floats(&(0..2 * n).map(|i| 0.01 * i as f32).collect::<Vec<_>>()), 5126, n, "VEC2");
        let uv1 = m.packed(&shorts(&(0..2 * n as u16).map(|i| 999 * i).collect::<Vec<_>>()), 5123, n, "VEC2");
        m.json["accessors"][uv1]["normalized"] = json!(true);
        let tangents = m.packed(&floats(&[0.5; 36]), 5126, n, "VEC4");
        let moved = m.points(&grid.iter().map(|p| [0.0, 0.0, 0.25 * p[0]]).collect::<Vec<_>>());
        // Zeros but for vertices 1 and 7.
        let (at, new) = (m.view(0, &[1, 7], None), m.view(0, &floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), None));
        let sparse = m.list(
            "accessors",
            json!({ "componentType": 5126, "count": n, "type": "VEC3", "min": [0, 0, 0],
            "max": [4, 5, 6], "sparse": { "count": 2, "indices": { "bufferView": at, "componentType": 5121 },
            "values": { "bufferView": new } } }),
        );
        let attributes = json!({ "POSITION": positions, "NORMAL": normals, "COLOR_0": colors, "JOINTS_0": joints,
            "WEIGHTS_0": weights, "_ID": ids, "TEXCOORD_0": uv0, "TEXCOORD_1": uv1, "TANGENT": tangents });
        let targets = json!([{ "POSITION": moved, "NORMAL": normals, "TANGENT": moved }, { "POSITION": sparse },
            { "TANGENT": moved }]);
        let lower = m.packed(&shorts(&[0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4]), 5123, 12, "SCALAR");
        let upper = m.packed(&[3, 4, 7, 3, 7, 6, 4, 5, 8, 4, 8, 7], 5121, 12, "SCALAR");
        let band: Vec<[f32; 3]> = (0..8).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.2 * i as f32]).collect();
        let band = m.points(&band);
        let strip = m.packed(&shorts(&[0, 1, 2, 3, 3, 4, 4, 5, 6, 7]), 5123, 10, "SCALAR");
        let fan = m.points(&[[9.0, 0.0, 0.0], [9.0, 1.0, 0.0], [9.5, 1.0, 0.5], [10.0, 0.5, 0.0], [9.5, -1.0, 0.2]]);
        let line = m.packed(&[0, 2, 2, 4], 5121, 4, "SCALAR");
        m.json["meshes"] = json!([
            { "name": "body", "weights": [0.5, 0.0, 0.0], "primitives": [
                { "attributes": attributes, "indices": lower, "material": 0, "targets": targets, "extras": "p" },
                { "attributes": attributes, "indices": upper, "material": 1, "targets": targets, "mode": 4 } ] },
            { "name": "band", "primitives": [
                { "attributes": { "POSITION": band }, "indices": strip, "mode": 5 },
                { "attributes": { "POSITION": fan }, "mode": 6, "material": 1 },
                { "attributes": { "POSITION": band }, "indices": line, "mode": 1 } ] },
            { "name": "hidden", "primitives": [{ "attributes": { "POSITION": positions, "TEXCOORD_0": uv0 } }] }
        ]);
        let inverse: Vec<f32> = (0..32).map(|i| if i % 5 == 0 { 1.0 } else { 0.01 * i as f32 }).collect();
        let v = m.view(1, &floats(&inverse), None);
        let inverse = m.accessor(v, 5126, 2, "MAT4");
        m.json["skins"] = json!([{ "joints": [3, 4], "inverseBindMatrices": inverse }]);
        let v = m.view(1, &floats(&[0.0, 1.5, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]), None);
        let (times, places) = (m.accessor(v, 5126, 2, "SCALAR"), m.accessor(v, 5126, 2, "VEC3"));
        m.json["accessors"][places]["byteOffset"] = json!(8);
        m.json["animations"] = json!([{ "channels": [{ "sampler": 0, "target": { "node": 3, "path": "translation" } }],
            "samplers": [{ "input": times, "output": places }] }]);
        m.json["nodes"] = json!([
            { "mesh": 0, "skin": 0, "translation": [5.0, 0.0, 0.0] },
            { "mesh": 1, "children": [2], "translation": [0.1, 0.0, 3.0], "camera": 0 },
            { "mesh": 1, "scale": [-1.0, 2.0, 1.0], "rotation": [0.6, 0.0, 0.0, 0.8], "extras": { "twice": true } },
            { "children": [4] }, { "name": "joint" }, { "mesh": 2 }
        ]);
        let picture = m.view(1, b"\x89PNG, so to speak", None);
        m.json["images"] =
            json!([{ "uri": "textures/wood%20dark.png" }, { "bufferView": picture, "mimeType": "image/png" }]);
        m
    }

    /// As a file; the first buffer of a `.glb` is its chunk.
    pub fn file(&self, binary: bool) -> Vec<u8> {
        let mut json = self.json.clone();
        let entry = |(i, b): (usize, &Vec<u8>)| match binary && i == 0 {
            true => json!({ "byteLength": b.len() }),
            false => json!({ "byteLength": b.len(), "uri": format!("data:;base64,{}", STANDARD.encode(b)) }),
        };
        json["buffers"] = self.buffers.iter().enumerate().map(entry).collect();
        let mut text = serde_json::to_vec(&json).unwrap();
        if !binary {
            return text;
        }
        let mut chunk = self.buffers[0].clone();
        text.resize(text.len().next_multiple_of(4), b' ');
        chunk.resize(chunk.len().next_multiple_of(4), 0);
        let mut out = b"glTF".to_vec();
        let word = |out: &mut Vec<u8>, n: usize| out.extend((n as u32).to_le_bytes());
        word(&mut out, 2);
        word(&mut out, 28 + text.len() + chunk.len());
        word(&mut out, text.len());
        out.extend(b"JSON");
        out.extend(&text);
        word(&mut out, chunk.len());
        out.extend(b"BIN\0");
        out.extend(&chunk);
        out
    }

    /// A file with its buffers inside.
    pub fn of(data: &[u8]) -> Model {
        let word = |at: usize| u32::from_le_bytes(data[at..at + 4].try_into().unwrap()) as usize;
        let (text, chunk) = if data.starts_with(b"glTF") {
            let end = 20 + word(12);
            assert_eq!((word(4), word(8), end % 4, word(end) % 4), (2, data.len(), 0, 0), "lengths of the chunks");
            assert_eq!((&data[16..20], &data[end + 4..end + 8]), (&b"JSON"[..], &b"BIN\0"[..]));
            assert_eq!(end + 8 + word(end), data.len());
            (&data[20..end], Some(data[end + 8..].to_vec()))
        } else {
            (data, None)
        };
        let json: Value = serde_json::from_slice(text).unwrap();
        let bytes = |b: &Value| {
            let bytes = match b["uri"].as_str() {
                Some(uri) => STANDARD.decode(uri.split_once(";base64,").unwrap().1).unwrap(),
                None => chunk.clone().unwrap(),
            };
            let n = b["byteLength"].as_u64().unwrap() as usize;
            assert!((n..n + 4).contains(&bytes.len()), "{n} bytes claimed of {}", bytes.len());
            bytes[..n].to_vec()
        };
        let buffers = json["buffers"].as_array().unwrap().iter().map(bytes).collect();
        Model { json, buffers }
    }

    pub fn view_bytes(&self, v: usize) -> &[u8] {
        let view = &self.json["bufferViews"][v];
        let from = number(&view["byteOffset"]);
        &self.buffers[number(&view["buffer"])][from..from + number(&view["byteLength"])]
    }

    /// Bytes of an element of an accessor, one by one.
    pub fn element(&self, a: &Value, i: usize) -> Vec<u8> {
        let a = &self.json["accessors"][number(a)];
        let size = size_of(a);
        if let Some(sparse) = a.get("sparse") {
            // Its indices are bytes in this model.
            let at = self.view_bytes(number(&sparse["indices"]["bufferView"]));
            if let Some(k) = at.iter().position(|&k| usize::from(k) == i) {
                let from = number(&sparse["values"]["byteOffset"]) + k * size;
                return self.view_bytes(number(&sparse["values"]["bufferView"]))[from..from + size].to_vec();
            }
        }
        let Some(v) = a.get("bufferView") else { return vec![0; size] };
        let stride = self.json["bufferViews"][number(v)].get("byteStride").map_or(size, number);
        let from = number(&a["byteOffset"]) + i * stride;
        self.view_bytes(number(v))[from..from + size].to_vec()
    }

    /// Vertices of the triangles of a primitive, without those that have one twice in a strip.
    pub fn triangles(&self, p: &Value) -> Vec<[usize; 3]> {
        let listed: Vec<usize> = match p.get("indices") {
            Some(a) => (0..self.count(a)).map(|i| self.index(a, i)).collect(),
            None => (0..self.count(&p["attributes"]["POSITION"])).collect(),
        };
        match p["mode"].as_u64() {
            None | Some(4) => listed.chunks(3).map(|t| [t[0], t[1], t[2]]).collect::<Vec<_>>(),
            Some(5) => (2..listed.len())
                .map(|i| if i % 2 == 0 { [i - 2, i - 1, i] } else { [i - 1, i - 2, i] }.map(|k| listed[k]))
                .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
                .collect(),
            Some(6) => (2..listed.len()).map(|i| [listed[0], listed[i - 1], listed[i]]).collect(),
            _ => Vec::new(),
        }
    }

    pub fn index(&self, a: &Value, i: usize) -> usize {
        self.element(a, i).iter().rev().fold(0, |n, &b| 256 * n + usize::from(b))
    }

    pub fn count(&self, a: &Value) -> usize {
        number(&self.json["accessors"][number(a)]["count"])
    }
}

/// Bytes of an element; this model has no matrices of less than four bytes a number.
pub fn size_of(accessor: &Value) -> usize {
    let numbers = match accessor["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        "MAT4" => 16,
        other => panic!("{other}"),
    };
    numbers * width(accessor)
}

/// Bytes of a number.
pub fn width(accessor: &Value) -> usize {
    match accessor["componentType"].as_u64().unwrap() {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    }
}

/// 0 where there is none.
pub fn number(value: &Value) -> usize {
    value.as_u64().unwrap_or(0) as usize
}
