//! The plain list: 0-based indices, any number a line, `#` comments.

use super::InputError;

/// The indices in file order, each with its 1-based line.
pub(super) fn parse(file: &str, content: &str) -> Result<Vec<(u32, usize)>, InputError> {
    let content = content.strip_prefix('\u{feff}').unwrap_or(content);
    let mut out = Vec::new();
    for (number, line) in content.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        for word in line.split_whitespace() {
            let index = index(word).map_err(|(what, remedy)| {
                InputError::new(file, format!("`{}` {what}", short(word)), remedy).at_line(number + 1)
            })?;
            out.push((index, number + 1));
        }
    }
    Ok(out)
}

fn index(word: &str) -> Result<u32, (&'static str, &'static str)> {
    // The largest u32 is kept free: meshes have fewer vertices.
    match word.parse::<u32>() {
        Ok(v) if v < u32::MAX => return Ok(v),
        _ => {}
    }
    let digits = word.strip_prefix(['-', '+']).unwrap_or(word);
    let integer = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    Err(match (integer, word.starts_with('-'), word.parse::<f64>()) {
        (true, true, _) => ("is negative", "give 0-based vertex indices"),
        (true, false, _) => ("is no index of any mesh, it is too large", "give 0-based vertex indices"),
        (false, _, Ok(_)) => ("is no integer", "give 0-based vertex indices"),
        _ => ("is no vertex index", "give integers parted by blanks; comments start with #"),
    })
}

/// A word as it may stand in a message.
fn short(word: &str) -> String {
    const LONGEST: usize = 32;
    let mut out: String = word.chars().take(LONGEST).collect();
    if out.len() < word.len() {
        out.push_str("...");
    }
    out
}
