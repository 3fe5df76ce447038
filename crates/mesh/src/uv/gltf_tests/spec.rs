//! What glTF 2.0 asks of accessors, views and buffers (sections 3.6 and 3.7.2), as far as a program can see.

use serde_json::Value;

use super::model::{Model, number, size_of, width};

/// Checks a file, of which nothing is unused.
pub fn check(m: &Model) {
    let list = |key: &str| m.json[key].as_array().cloned().unwrap_or_default();
    let (accessors, views) = (list("accessors"), list("bufferViews"));
    assert_eq!(m.buffers.len(), 1);
    let mut end = 0;
    for (v, view) in views.iter().enumerate() {
        let (from, n) = (number(&view["byteOffset"]), number(&view["byteLength"]));
        assert!(n > 0 && from >= end && from < end + 4 && from % 4 == 0, "view {v} is not behind the one before it");
        end = from + n;
        assert!(end <= m.buffers[0].len());
        if let Some(stride) = view.get("byteStride").map(number) {
            assert!((4..=252).contains(&stride) && stride % 4 == 0);
        }
    }
    assert!(m.buffers[0].len() < end + 4, "bytes that no view has");
    for (i, a) in accessors.iter().enumerate() {
        let (count, size) = (number(&a["count"]), size_of(a));
        assert!(count > 0, "accessor {i}");
        let Some(v) = a.get("bufferView").map(number) else { continue };
        let (view, offset) = (&views[v], number(&a["byteOffset"]));
        assert_eq!((offset % width(a), (offset + number(&view["byteOffset"])) % width(a)), (0, 0));
        let stride = view.get("byteStride").map_or(size, number);
        assert!(stride >= size && offset + (count - 1) * stride + size <= number(&view["byteLength"]), "accessor {i}");
    }
    let mut used = vec![false; accessors.len()];
    for p in list("meshes").iter().flat_map(|m| m["primitives"].as_array().unwrap().clone()) {
        let count = m.count(&p["attributes"]["POSITION"]);
        let targets = p["targets"].as_array().cloned().unwrap_or_default();
        for set in std::iter::once(&p["attributes"]).chain(&targets) {
            assert!(!set.as_object().unwrap().is_empty());
            for (name, a) in set.as_object().unwrap() {
                used[number(a)] = true;
                assert_eq!(m.count(a), count, "{name}");
                let accessor = &accessors[number(a)];
                if let Some(view) = accessor.get("bufferView").map(|v| &views[number(v)]) {
                    let stride = view.get("byteStride").map_or(size_of(accessor), number);
                    assert_eq!((stride % 4, number(&accessor["byteOffset"]) % 4), (0, 0), "{name}");
                    assert!([0, 34962].contains(&number(&view["target"])));
                }
                if name == "POSITION" {
                    bounds(m, a, accessor);
                }
            }
        }
        if let Some(a) = p.get("indices") {
            used[number(a)] = true;
            let restart = 256usize.pow(width(&accessors[number(a)]) as u32) - 1;
            assert!((0..m.count(a)).all(|i| m.index(a, i) < count.min(restart)));
            assert_eq!(accessors[number(a)]["type"], "SCALAR");
            assert!([0, 34963].contains(&number(&views[number(&accessors[number(a)]["bufferView"])]["target"])));
        }
    }
    let mut others: Vec<Value> = list("skins").iter().map(|s| s["inverseBindMatrices"].clone()).collect();
    for s in list("animations").iter().flat_map(|a| a["samplers"].as_array().unwrap().clone()) {
        others.extend([s["input"].clone(), s["output"].clone()]);
    }
    others.iter().for_each(|a| used[number(a)] = true);
    assert!(used.iter().all(|&u| u), "accessors that nothing names: {used:?}");
    let mut seen = vec![false; views.len()];
    accessors.iter().chain(&list("images")).filter_map(|a| a.get("bufferView")).for_each(|v| seen[number(v)] = true);
    assert!(seen.iter().all(|&u| u), "views that nothing names: {seen:?}");
}

/// The bounds of positions are those of the numbers that are there.
fn bounds(m: &Model, a: &Value, accessor: &Value) {
    let numbers: Vec<Vec<f32>> = (0..m.count(a))
        .map(|i| m.element(a, i).chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect())
        .collect();
    for d in 0..3 {
        let of = |pick: fn(f32, f32) -> f32| numbers.iter().map(|p| p[d]).reduce(pick).unwrap();
        assert_eq!(accessor["min"][d].as_f64().unwrap() as f32, of(f32::min), "{accessor}");
        assert_eq!(accessor["max"][d].as_f64().unwrap() as f32, of(f32::max), "{accessor}");
    }
}
