//! What of a file is still used, in one buffer.

use super::super::accessor::Buffers;
use super::super::malformed;
use super::fresh::{Fresh, MOST, too_large};
use super::{Rewritten, each, number};
use crate::error::Result;
use serde_json::{Map, Value, json};

/// Extensions that name no accessors or buffer views, or only where they are looked for here.
const KNOWN: [&str; 9] = [
    "KHR_mesh_quantization",
    "KHR_lights_punctual",
    "KHR_xmp_json_ld",
    "KHR_node_visibility",
    "KHR_animation_pointer",
    "EXT_mesh_gpu_instancing",
    "EXT_lights_image_based",
    "MSFT_lod",
    "MSFT_texture_dds",
];
const OF_LOOKS: [&str; 4] = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "EXT_materials_"];

/// Joins the file and what it got anew. Accessors and views that nothing names any more go; where an extension is used that
/// may name some in ways of its own, all of them stay, with their numbers.
pub(super) fn finish(file: &str, buffers: &Buffers<'_>, mut root: Value, fresh: Fresh<'_>) -> Result<Rewritten> {
    let Fresh { bytes, views: fresh_views, accessors: fresh_accessors, .. } = fresh;
    let all_known = all_known(&root);
    let mut accessors = taken(&mut root, "accessors");
    accessors.extend(fresh_accessors);
    if all_known {
        compact(file, "accessor", &mut accessors, &mut root, in_accessors)?;
    }
    root["accessors"] = Value::Array(accessors);
    let mut views = taken(&mut root, "bufferViews");
    let old = views.len();
    views.extend(fresh_views);
    let origins = if all_known {
        compact(file, "buffer view", &mut views, &mut root, in_views)?
    } else {
        (0..views.len()).collect()
    };
    let mut buffer = Vec::new();
    for (view, &v) in views.iter_mut().zip(&origins) {
        let from = |key: &str| view.get(key).and_then(number).unwrap_or(0);
        let part = match v < old {
            true => buffers.bytes("what is kept", v)?,
            false => bytes.get(from("byteOffset")..).and_then(|b| b.get(..from("byteLength"))).unwrap_or_default(),
        };
        // Whatever was aligned stays so: no number is longer than four bytes.
        buffer.resize(buffer.len().next_multiple_of(4), 0);
        if part.len() > MOST - buffer.len().min(MOST) {
            return Err(too_large(file));
        }
        view["buffer"] = json!(0);
        view["byteOffset"] = json!(buffer.len());
        buffer.extend_from_slice(part);
    }
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    root["bufferViews"] = Value::Array(views);
    Ok(Rewritten { entry: entry(&mut root), root, buffer })
}

fn all_known(root: &Value) -> bool {
    let known =
        |e: &Value| e.as_str().is_some_and(|e| KNOWN.contains(&e) || OF_LOOKS.iter().any(|looks| e.starts_with(looks)));
    match root.get("extensionsUsed") {
        None | Some(Value::Null) => true,
        Some(used) => used.as_array().is_some_and(|used| used.iter().all(known)),
    }
}

fn taken(root: &mut Value, list: &str) -> Vec<Value> {
    match root.get_mut(list).map(Value::take) {
        Some(Value::Array(list)) => list,
        _ => Vec::new(),
    }
}

/// What is said of the buffer beside its size and address: all of it where there was one.
fn entry(root: &mut Value) -> Value {
    let mut buffers = taken(root, "buffers");
    let mut entry = match (buffers.pop(), buffers.is_empty()) {
        (Some(Value::Object(entry)), true) => entry,
        _ => Map::new(),
    };
    entry.remove("uri");
    Value::Object(entry)
}

/// A visit to each place that names a thing by its number.
type Visit<'a> = &'a mut dyn FnMut(&mut Value) -> Result<()>;

/// Takes the things from a list that nothing names, and corrects the numbers of the others; what number each had.
fn compact(
    file: &str,
    what: &str,
    things: &mut Vec<Value>,
    root: &mut Value,
    places: fn(&mut Value, Visit<'_>) -> Result<()>,
) -> Result<Vec<usize>> {
    let mut used = vec![false; things.len()];
    places(root, &mut |place| {
        let use_of = number(place).and_then(|n| used.get_mut(n));
        *use_of.ok_or_else(|| malformed(file, format!("{what} {place} does not exist")))? = true;
        Ok(())
    })?;
    let origins: Vec<usize> = (0..used.len()).filter(|&i| used[i]).collect();
    let mut new = vec![0; used.len()];
    origins.iter().enumerate().for_each(|(k, &i)| new[i] = k);
    let mut kept = used.iter();
    things.retain(|_| kept.next().is_some_and(|&u| u));
    places(root, &mut |place| {
        if let Some(&k) = number(place).and_then(|n| new.get(n)) {
            *place = json!(k);
        }
        Ok(())
    })?;
    Ok(origins)
}

/// The value under a key, where there is one.
fn value(of: &mut Value, key: &str, visit: Visit<'_>) -> Result<()> {
    of.get_mut(key).filter(|v| !v.is_null()).map_or(Ok(()), visit)
}

/// All values of an object.
fn values(of: Option<&mut Value>, visit: Visit<'_>) -> Result<()> {
    let values = of.and_then(Value::as_object_mut).into_iter().flat_map(Map::values_mut);
    values.filter(|v| !v.is_null()).try_for_each(visit)
}

/// Where accessors are named.
fn in_accessors(root: &mut Value, visit: Visit<'_>) -> Result<()> {
    for primitive in each(root, "meshes").flat_map(|m| each(m, "primitives")) {
        values(primitive.get_mut("attributes"), visit)?;
        value(primitive, "indices", visit)?;
        each(primitive, "targets").try_for_each(|t| values(Some(t), visit))?;
    }
    each(root, "skins").try_for_each(|s| value(s, "inverseBindMatrices", visit))?;
    for sampler in each(root, "animations").flat_map(|a| each(a, "samplers")) {
        value(sampler, "input", visit)?;
        value(sampler, "output", visit)?;
    }
    for node in each(root, "nodes") {
        let instances = node.get_mut("extensions").and_then(|e| e.get_mut("EXT_mesh_gpu_instancing"));
        values(instances.and_then(|i| i.get_mut("attributes")), visit)?;
    }
    Ok(())
}

/// Where buffer views are named.
fn in_views(root: &mut Value, visit: Visit<'_>) -> Result<()> {
    for accessor in each(root, "accessors") {
        value(accessor, "bufferView", visit)?;
        if let Some(sparse) = accessor.get_mut("sparse") {
            for part in ["indices", "values"] {
                sparse.get_mut(part).map_or(Ok(()), |p| value(p, "bufferView", visit))?;
            }
        }
    }
    each(root, "images").try_for_each(|i| value(i, "bufferView", visit))
}
