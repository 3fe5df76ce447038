//! Settings by keyword: what the caller gives, in the place of the defaults of the facade.

use crate::error::{InputError, refused};
use proxel::compose::ComposeSettings;
use proxel::settings::{
    DeformSettings, GeodesicSettings, RestoreSettings, Schedule, UnwrapSettings, WavefrontSettings,
};
use proxel::shape::{ShapeMethod, ShapeSettings, WireSettings};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyMapping, PySequence, PyString};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// What was given by keyword.
pub type Given = Map<String, Value>;

/// Deeper than any settings are.
const DEEPEST: usize = 16;

/// An object of Python as JSON: None, booleans, numbers, strings, sequences, mappings, and arrays and scalars of numpy.
fn value(object: &Bound<'_, PyAny>, name: &str, depth: usize) -> PyResult<Value> {
    let refuse = |what: String| Err(InputError::new_err(format!("setting `{name}`: {what}")));
    if depth > DEEPEST {
        return refuse(format!("it is nested more than {DEEPEST} deep; give plain values"));
    }
    if object.is_none() {
        return Ok(Value::Null);
    }
    if let Ok(flag) = object.cast::<PyBool>() {
        return Ok(Value::Bool(flag.is_true()));
    }
    if object.is_instance_of::<PyInt>() {
        return match object.extract::<i64>() {
            Ok(n) => Ok(n.into()),
            Err(_) => refuse(format!("{object} is too large")),
        };
    }
    if object.is_instance_of::<PyFloat>() {
        let number: f64 = object.extract()?;
        return match serde_json::Number::from_f64(number) {
            Some(n) => Ok(Value::Number(n)),
            None => refuse(format!("it is {number}; give a finite number, or None")),
        };
    }
    if let Ok(text) = object.cast::<PyString>() {
        return Ok(Value::String(text.to_cow()?.into_owned()));
    }
    // Arrays and scalars of numpy know what they are in Python.
    if object.hasattr("dtype")? && object.hasattr("tolist")? {
        return value(&object.call_method0("tolist")?, name, depth + 1);
    }
    if let Ok(mapping) = object.cast::<PyMapping>() {
        let mut out = Map::new();
        for item in mapping.items()?.iter() {
            let (key, item): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
            let key = key.str()?.to_cow()?.into_owned();
            let inside = value(&item, &format!("{name}.{key}"), depth + 1)?;
            out.insert(key, inside);
        }
        return Ok(Value::Object(out));
    }
    if let Ok(sequence) = object.cast::<PySequence>() {
        let items = sequence.to_list()?;
        let of = |item: Bound<'_, PyAny>| value(&item, name, depth + 1);
        return Ok(Value::Array(items.iter().map(of).collect::<PyResult<_>>()?));
    }
    refuse(format!("a {} is no setting; give a number, a string, a sequence or a dict", object.get_type().name()?))
}

/// A whole object of Python as JSON; `name` stands in messages for it.
pub fn to_value(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Value> {
    value(object, name, 0)
}

/// The keywords of a call. One that Python keeps for itself has an underscore at its end: `lambda_`.
pub fn given(keywords: &Bound<'_, PyDict>) -> PyResult<Given> {
    let mut out = Map::new();
    for (key, item) in keywords.iter() {
        let key: String = key.extract()?;
        let key = key.trim_end_matches('_').to_owned();
        let item = value(&item, &key, 0)?;
        out.insert(key, item);
    }
    Ok(out)
}

/// What was given in the place of the defaults; sections such as `admm` may be given in part.
///
/// # Errors
/// A name that no setting has, with the known ones; a value of the wrong kind.
pub fn merged<T: Serialize + DeserializeOwned>(defaults: &T, given: Given) -> PyResult<T> {
    let mut all = serde_json::to_value(defaults).map_err(refused)?;
    let Value::Object(settings) = &mut all else { return Err(InputError::new_err("the settings are no object")) };
    for (name, value) in given {
        let Some(place) = settings.get_mut(&name) else { return Err(unknown(&name, settings)) };
        put(place, value);
        // One at a time, so that messages can name it.
        if let Err(e) = serde_json::from_value::<T>(Value::Object(settings.clone())) {
            return Err(InputError::new_err(format!("setting `{name}`: {e}")));
        }
    }
    serde_json::from_value(all).map_err(refused)
}

/// Sections in part, all else as a whole.
fn put(place: &mut Value, value: Value) {
    match (place, value) {
        (Value::Object(section), Value::Object(given)) => {
            for (name, value) in given {
                put(section.entry(name).or_insert(Value::Null), value);
            }
        }
        (place, value) => *place = value,
    }
}

fn unknown(name: &str, settings: &Map<String, Value>) -> PyErr {
    let known: Vec<&str> = settings.keys().map(String::as_str).collect();
    InputError::new_err(format!("there is no setting `{name}`; known are {}", known.join(", ")))
}

/// Reads one name of the given ones before the others: what other defaults depend on.
fn named<T: DeserializeOwned + Default>(given: &Given, name: &str) -> PyResult<T> {
    match given.get(name) {
        None => Ok(T::default()),
        Some(value) => {
            serde_json::from_value(value.clone()).map_err(|e| InputError::new_err(format!("setting `{name}`: {e}")))
        }
    }
}

/// Of `deform`. `material` may be a name, and `young`, `poisson`, `mu` and `lambda` stand beside it, as on the
/// command line.
pub fn deform(mut given: Given) -> PyResult<DeformSettings> {
    let mut material = match given.remove("material") {
        Some(Value::String(name)) => Map::from_iter([("energy".to_string(), Value::String(name))]),
        Some(Value::Object(material)) => material,
        None => Map::new(),
        Some(other) => {
            return Err(InputError::new_err(format!(
                "setting `material`: {other} is no material; give a name or a dict"
            )));
        }
    };
    for name in ["young", "poisson", "mu", "lambda"] {
        if let Some(value) = given.remove(name) {
            material.insert(name.to_string(), value);
        }
    }
    if !material.is_empty() {
        given.insert("material".to_string(), Value::Object(material));
    }
    let schedule: Schedule = named(&given, "schedule")?;
    merged(&DeformSettings::of(schedule), given)
}

/// Of `planarize`.
pub fn planarize(given: Given) -> PyResult<ShapeSettings> {
    let method: ShapeMethod = named(&given, "method")?;
    merged(&ShapeSettings::planarize_by(method), given)
}

/// Of `wire`.
pub fn wire(given: Given) -> PyResult<WireSettings> {
    let method: ShapeMethod = named(&given, "method")?;
    merged(&WireSettings::by(method), given)
}

/// All settings of a command as JSON, with those given in the place of defaults.
#[pyfunction]
pub fn settings(command: &str, keywords: &Bound<'_, PyDict>) -> PyResult<String> {
    let given = given(keywords)?;
    match command {
        "unwrap" => text(&merged(&UnwrapSettings::default(), given)?),
        "deform" => text(&deform(given)?),
        "planarize" => text(&planarize(given)?),
        "wire" => text(&wire(given)?),
        "shape" => text(&merged(&ShapeSettings::recipe(), given)?),
        "problem" => text(&merged(&ComposeSettings::default(), given)?),
        "geodesic" => text(&merged(&GeodesicSettings::default(), given)?),
        "deblur" | "denoise" | "inpaint" => text(&merged(&RestoreSettings::default(), given)?),
        "wavefront" => text(&merged(&WavefrontSettings::default(), given)?),
        other => Err(InputError::new_err(format!(
            "there are no settings of `{other}`; known are unwrap, deform, planarize, wire, shape, problem, geodesic, \
             deblur, denoise, inpaint and wavefront"
        ))),
    }
}

fn text(settings: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(settings).map_err(refused)
}
