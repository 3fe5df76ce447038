//! Damaged files: an error in one line, or a file with the map and the same positions.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::super::fuzz::some_map;
use super::model::Model;
use super::{check_map, rewritten};
use crate::io::fuzz::{apply, damage};
use crate::io::{Format, parse_mesh};

/// Whether it could be written.
fn round_trip(data: &[u8], seed: u64) -> bool {
    let one_line = |e: crate::MeshError| assert_eq!(e.to_string().lines().count(), 1);
    let Ok(mesh) = parse_mesh(Format::Glb, "in", data).map_err(one_line) else { return false };
    let uv = some_map(&mesh.faces, seed);
    match rewritten(data, &uv, seed.is_multiple_of(2)) {
        Ok(out) if mesh.faces.is_empty() => parse_mesh(Format::Glb, "out", &out).is_ok(),
        Ok(out) => {
            check_map(&out, &mesh, &uv);
            true
        }
        Err(e) => {
            one_line(e);
            false
        }
    }
}

/// All values in a JSON, and those within them.
fn places(value: &Value, here: String, out: &mut Vec<String>) {
    match value {
        Value::Array(all) => all.iter().enumerate().for_each(|(i, v)| places(v, format!("{here}/{i}"), out)),
        Value::Object(all) => all.iter().for_each(|(k, v)| places(v, format!("{here}/{k}"), out)),
        _ => {}
    }
    out.push(here);
}

/// Every value of the JSON becomes each of these, or goes.
#[test]
fn every_value_may_be_wrong() {
    let model = Model::rich();
    let mut all = Vec::new();
    places(&model.json, String::new(), &mut all);
    assert!(all.len() > 400, "{}", all.len());
    let wrong =
        [json!(null), json!(-1), json!(0), json!(3), json!(1e300), json!(u64::MAX), json!("x"), json!([]), json!({})];
    let mut written = 0;
    for (k, place) in all.iter().enumerate() {
        for (w, wrong) in wrong.iter().enumerate() {
            let mut broken = model.clone();
            *broken.json.pointer_mut(place).unwrap() = wrong.clone();
            if broken.json.is_object() {
                written += usize::from(round_trip(&broken.file(true), (k + w) as u64));
            }
        }
    }
    assert!(written > all.len(), "{written} of {} are harmless", all.len() * wrong.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files(binary in any::<bool>(), damages in prop::collection::vec(damage(), 1..4), seed in any::<u64>()) {
        let mut data = Model::rich().file(binary);
        damages.iter().for_each(|d| apply(&mut data, d));
        round_trip(&data, seed);
    }
}
