//! Paths of images, relative to the file that names them.

use super::each;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Component, Path};

/// Makes relative paths begin in the folder `to` instead of `from`, and names those that stay as they are because there is
/// no such path.
pub(super) fn relink(file: &str, root: &mut Value, from: Option<&Path>, to: &Path) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut way = None; // looked for once, and only where an image needs it
    for (i, image) in each(root, "images").enumerate() {
        let Some(uri) = image.get("uri").and_then(Value::as_str).filter(|uri| is_relative(uri)) else { continue };
        match way.get_or_insert_with(|| from.and_then(|from| between(to, from))) {
            Some(way) => {
                let uri = format!("{way}{uri}");
                image["uri"] = json!(uri);
            }
            None => warnings.push(format!(
                "{file}: image {i}: its path `{}` stays as it is, there is none from the folder of the output; put \
                 the image there",
                uri.escape_debug()
            )),
        }
    }
    warnings
}

/// Neither data nor an address nor a path from the root.
fn is_relative(uri: &str) -> bool {
    let scheme = uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    });
    !(uri.is_empty() || scheme || uri.starts_with('/'))
}

/// The way from one folder to another as the beginning of an address; empty if they are the same.
fn between(from: &Path, to: &Path) -> Option<String> {
    let canonical = |path: &Path| {
        let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        std::fs::canonicalize(path).ok()
    };
    let (from, to) = (canonical(from)?, canonical(to)?);
    let (from, to): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let (up, down) = (from.get(common..)?, to.get(common..)?);
    // Another drive, say.
    let plain = up.iter().chain(down).all(|c| matches!(c, Component::Normal(_)));
    if !plain || common == 0 {
        return None;
    }
    let mut way = "../".repeat(up.len());
    for folder in down {
        encode(folder.as_os_str().to_str()?, &mut way);
        way.push('/');
    }
    Some(way)
}

/// Appends a name with all but unreserved characters (RFC 3986, section 2.3) as the hexadecimal digits of their bytes.
fn encode(name: &str, out: &mut String) {
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            out.push(char::from(byte));
        } else {
            // A string takes whatever is written.
            let _ = write!(out, "%{byte:02X}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_apart() {
        for relative in ["a.png", "../t/a%20b.png", "1:2", "a/b:c", "./c:d"] {
            assert!(is_relative(relative), "{relative}");
        }
        for other in ["", "data:image/png;base64,AA", "https://a/b.png", "file:///a.png", "/a.png", "C:\\a.png"] {
            assert!(!is_relative(other), "{other}");
        }
    }

    #[test]
    fn ways_between_folders() {
        let root = std::env::temp_dir().join(format!("proxel-links-{}", std::process::id()));
        let (a, b) = (root.join("a/x y"), root.join("b"));
        std::fs::create_dir_all(&a).unwrap();
        std::fs::create_dir_all(&b).unwrap();
        assert_eq!(between(&a, &a).unwrap(), "");
        assert_eq!(between(&a.join("../x y"), &a).unwrap(), "");
        assert_eq!(between(&b, &a).unwrap(), "../a/x%20y/");
        assert_eq!(between(&a, &b).unwrap(), "../../b/");
        assert_eq!(between(&root, &b).unwrap(), "b/");
        assert_eq!(between(&root.join("none"), &b), None);
        let mut json = json!({ "images": [{ "uri": "t/1.png" }, { "bufferView": 0 }, { "uri": "data:,a" }] });
        assert_eq!(relink("f", &mut json, Some(&a), &b), [""; 0]);
        assert_eq!(json["images"], json!([{ "uri": "../a/x%20y/t/1.png" }, { "bufferView": 0 }, { "uri": "data:,a" }]));
        let before = json.clone();
        let warnings = relink("f", &mut json, None, &b);
        assert_eq!((warnings.len(), &json), (1, &before));
        assert!(warnings[0].contains("f: image 0: its path `../a/x%20y/t/1.png`"), "{warnings:?}");
        std::fs::remove_dir_all(root).unwrap();
    }
}
