//! Small text files: seams, pins, weights, target metrics. `#` begins a comment; commas count as blanks.

use std::path::Path;

use proxel::unwrap::{Metric, uniform};
use proxel_mesh::Mesh;

use crate::refusal::Refusal;

/// Lines with their numbers, as words.
fn lines(path: &Path) -> Result<Vec<(usize, Vec<String>)>, Refusal> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Refusal::new(format!("{}: cannot be read: {e}; check the path", path.display())))?;
    let words = |line: &str| -> Vec<String> {
        let line = line.split('#').next().unwrap_or_default();
        line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty()).map(str::to_owned).collect()
    };
    Ok(text.lines().enumerate().map(|(k, line)| (k + 1, words(line))).filter(|(_, words)| !words.is_empty()).collect())
}

fn refuse(path: &Path, line: usize, what: &str, remedy: &str) -> Refusal {
    Refusal::new(format!("{}: line {line}: {what}; {remedy}", path.display()))
}

fn number(path: &Path, line: usize, word: &str) -> Result<f64, Refusal> {
    let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
    value.ok_or_else(|| refuse(path, line, &format!("`{word}` is no finite number"), "correct the word"))
}

fn vertex(path: &Path, line: usize, word: &str, mesh: &Mesh) -> Result<u32, Refusal> {
    let known = word.parse::<u32>().ok().filter(|v| (*v as usize) < mesh.n_verts());
    let range = format!("give a vertex from 0 to {}", mesh.n_verts().saturating_sub(1));
    known.ok_or_else(|| refuse(path, line, &format!("`{word}` is no vertex of {}", mesh.name), &range))
}

/// Edges: two vertices a line.
pub fn seams(path: &Path, mesh: &Mesh) -> Result<Vec<[u32; 2]>, Refusal> {
    let edge = |(line, words): (usize, Vec<String>)| match &words[..] {
        [a, b] => Ok([vertex(path, line, a, mesh)?, vertex(path, line, b, mesh)?]),
        _ => Err(refuse(path, line, &format!("{} words", words.len()), "write the two vertices of an edge")),
    };
    lines(path)?.into_iter().map(edge).collect()
}

/// Pins: a vertex and its place a line.
pub fn pins(path: &Path, mesh: &Mesh) -> Result<Vec<(u32, [f64; 2])>, Refusal> {
    let pin = |(line, words): (usize, Vec<String>)| match &words[..] {
        [v, x, y] => Ok((vertex(path, line, v, mesh)?, [number(path, line, x)?, number(path, line, y)?])),
        _ => Err(refuse(path, line, &format!("{} words", words.len()), "write a vertex, u and v")),
    };
    lines(path)?.into_iter().map(pin).collect()
}

/// A weight for each face; from weights of vertices the mean over the corners.
pub fn weights(path: &Path, mesh: &Mesh) -> Result<Vec<f64>, Refusal> {
    let mut out = Vec::new();
    for (line, words) in lines(path)? {
        for word in &words {
            let value = number(path, line, word)?;
            if value <= 0.0 {
                return Err(refuse(
                    path,
                    line,
                    &format!("the weight {word} is not positive"),
                    "give a positive number",
                ));
            }
            out.push(value);
        }
    }
    if out.len() == mesh.faces.len() {
        return Ok(out);
    }
    if out.len() == mesh.n_verts() {
        let mean = |face: &[u32]| face.iter().map(|v| out[*v as usize]).sum::<f64>() / face.len().max(1) as f64;
        return Ok(mesh.faces.iter().map(mean).collect());
    }
    Err(Refusal::new(format!(
        "{}: it has {} weights, {} has {} faces and {} vertices; give one for each face or for each vertex",
        path.display(),
        out.len(),
        mesh.name,
        mesh.faces.len(),
        mesh.n_verts()
    )))
}

/// A target metric for each face: a factor of its lengths, or the six numbers of a tensor.
pub fn metric(path: &Path, mesh: &Mesh) -> Result<Vec<Metric>, Refusal> {
    let of_line = |(line, words): (usize, Vec<String>)| -> Result<Metric, Refusal> {
        let values = words.iter().map(|w| number(path, line, w)).collect::<Result<Vec<f64>, Refusal>>()?;
        match values[..] {
            [factor] if factor > 0.0 => Ok(uniform(factor)),
            [factor] => {
                Err(refuse(path, line, &format!("the factor {factor} is not positive"), "give a positive number"))
            }
            [xx, xy, xz, yy, yz, zz] => Ok([xx, xy, xz, yy, yz, zz]),
            _ => Err(refuse(path, line, &format!("{} words", words.len()), "write one number, or xx xy xz yy yz zz")),
        }
    };
    let out = lines(path)?.into_iter().map(of_line).collect::<Result<Vec<Metric>, Refusal>>()?;
    if out.len() != mesh.faces.len() {
        return Err(Refusal::new(format!(
            "{}: it has {} metrics, {} has {} faces; write a line for each face",
            path.display(),
            out.len(),
            mesh.name,
            mesh.faces.len()
        )));
    }
    Ok(out)
}
