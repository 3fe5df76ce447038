//! glTF 2.0, `.gltf` and `.glb` (Khronos Group, ISO/IEC 12113:2022): positions and topology of all meshes of the scene, in
//! place. Materials, textures, normals, skins and morph targets are read past.
//!
//! Positions are 32-bit in this format. Vertices that a file has several times, for seams of its textures, stay several.

mod accessor;
mod animate;
mod json;
mod raw;
mod read;
mod rewrite;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use animate::Animation;
pub use animate::MOST_FRAMES as MOST_GLTF_FRAMES;
pub(crate) use read::{Texcoords, parse, parse_uv, read, read_uv};
pub(crate) use rewrite::{Division, Group, Rewritten, rewrite};
pub(crate) use write::{Document, require_range, write};

use crate::error::{ErrorKind, MeshError, Result};
use json::Root;

const MAGIC: &[u8; 4] = b"glTF";
const JSON: u32 = 0x4e4f_534a;
const BIN: u32 = 0x004e_4942;
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// A file taken apart: its JSON, and the binary chunk of a `.glb`.
struct Parts<'a> {
    root: Root,
    chunk: Option<&'a [u8]>,
}

fn malformed(file: &str, what: impl Into<String>) -> MeshError {
    MeshError::new(ErrorKind::Malformed, file, what, "check that the file is whole, or export it again")
}

fn unsupported(file: &str, what: impl Into<String>, remedy: &str) -> MeshError {
    MeshError::new(ErrorKind::Unsupported, file, what, remedy)
}

/// Both forms, told apart by their first bytes.
fn take_apart<'a>(file: &str, data: &'a [u8]) -> Result<Parts<'a>> {
    let (text, chunk) = text_and_chunk(file, data)?;
    Ok(Parts { root: parsed(file, text)?, chunk })
}

/// The JSON as text, and the binary chunk of a `.glb`.
fn text_and_chunk<'a>(file: &str, data: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let (text, chunk) = match data.starts_with(MAGIC) {
        true => chunks(file, data)?,
        false => (data, None),
    };
    Ok((text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text), chunk))
}

fn parsed<'a, T: serde::Deserialize<'a>>(file: &str, text: &'a [u8]) -> Result<T> {
    serde_json::from_slice(text).map_err(|e| {
        let what = e.to_string();
        let what = what.split(" at line ").next().unwrap_or_default().to_owned();
        malformed(file, format!("its JSON: {what}")).at_line(e.line())
    })
}

/// The JSON and the binary chunk of a `.glb`.
fn chunks<'a>(file: &str, data: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let truncated = || {
        let remedy = "it is truncated: write or copy it again";
        MeshError::new(ErrorKind::Truncated, file, "the file ends before its chunks do", remedy)
    };
    let (version, length) = (word(4).ok_or_else(truncated)?, word(8).ok_or_else(truncated)? as usize);
    if version != 2 {
        return Err(unsupported(file, format!("glTF of version {version}"), "export it as glTF 2.0"));
    }
    let data = data.get(..length).ok_or_else(truncated)?;
    let (mut json, mut bin, mut at) = (None, None, HEADER);
    while at + CHUNK_HEADER <= data.len() {
        let (size, kind) = (word(at).ok_or_else(truncated)? as usize, word(at + 4).ok_or_else(truncated)?);
        let body = data[at + CHUNK_HEADER..].get(..size).ok_or_else(truncated)?;
        match kind {
            JSON if json.is_none() => json = Some(body),
            BIN if bin.is_none() => bin = Some(body),
            _ => {} // chunks of other kinds are to be read past
        }
        at += CHUNK_HEADER + size;
    }
    Ok((json.ok_or_else(|| malformed(file, "it has no JSON chunk"))?, bin))
}
