//! Texture coordinates of OBJ: read, written, and exchanged in a file of which all else stays as it stands.

use std::io::{self, Write};

use super::UvMap;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::io::numbers::{parse_f64, parse_int};
use crate::io::text::{Line, Text};
use crate::mesh::{Mesh, Polygons};

/// The byte order mark, which [`Text`] skips.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// The parts of `a`, `a/t`, `a/t/n` or `a//n`; what is missing is empty.
fn corner_parts(word: &[u8]) -> [&[u8]; 3] {
    let mut parts = word.splitn(3, |&b| b == b'/');
    [(); 3].map(|()| parts.next().unwrap_or_default())
}

/// Reads the `vt` lines and the second numbers of face corners. `None` where no face has any.
pub(super) fn parse(file: &str, data: &[u8], faces: &Polygons) -> Result<Option<UvMap>> {
    let mut text = Text::new(file, data)?;
    let mut uv = UvMap { coordinates: Vec::new(), corners: Vec::with_capacity(faces.indices().len()) };
    let mut ahead = Vec::new(); // places in `corners` that name a coordinate which may follow later in the file
    let mut face = 0;
    while let Some(mut line) = text.next_line() {
        match line.next() {
            Some(b"vt") => uv.coordinates.push(coordinate(&mut line, uv.coordinates.len())?),
            Some(b"f") => {
                while let Some(word) = line.next() {
                    let [_, word, _] = corner_parts(word);
                    if word.is_empty() {
                        uv.corners.push(UvMap::NONE);
                        continue;
                    }
                    let at = |e: MeshError| e.at_line(line.number).at_item(Item::Face(face));
                    let index = index(file, word, uv.coordinates.len()).map_err(at)?;
                    if index as usize >= uv.coordinates.len() {
                        ahead.push((uv.corners.len(), line.number, face));
                    }
                    uv.corners.push(index);
                }
                face += 1;
            }
            _ => {}
        }
    }
    for (corner, line, face) in ahead {
        let (index, n) = (u64::from(uv.corners[corner]) + 1, uv.coordinates.len());
        if index > n as u64 {
            let what = format!("texture coordinate {index} is out of range, there are {n}");
            let e = MeshError::new(ErrorKind::IndexOutOfRange, file, what, "correct the index or add `vt` lines");
            return Err(e.at_line(line).at_item(Item::Face(face)));
        }
    }
    uv.unmap_incomplete(faces);
    if uv.corners.iter().all(|&c| c == UvMap::NONE) {
        return Ok(None);
    }
    uv.check(faces)?;
    Ok(Some(uv))
}

/// `vt u [v [w]]`: v is 0 where it is not given, w is read past.
fn coordinate(line: &mut Line<'_>, i: usize) -> Result<[f64; 2]> {
    let mut uv = [0.0; 2];
    for (d, x) in uv.iter_mut().enumerate() {
        let Some(word) = line.next() else {
            if d == 1 {
                break;
            }
            return Err(line.missing("a texture coordinate"));
        };
        *x = parse_f64(word).ok_or_else(|| line.not_a_number(word, "a texture coordinate"))?;
        if !x.is_finite() {
            let what = format!("texture coordinate {} is {x}", i + 1);
            return Err(line.error(ErrorKind::NonFinite, what, "replace it by a finite number"));
        }
    }
    line.only_numbers_follow()?;
    Ok(uv)
}

/// A number counted from 1, or backwards from -1, the latest of `so_far`.
fn index(file: &str, word: &[u8], so_far: usize) -> Result<u32> {
    let bad = |kind, what: String| MeshError::new(kind, file, what, "correct the index");
    let shown = || String::from_utf8_lossy(word).into_owned();
    let Some(index) = parse_int(word) else {
        return Err(bad(ErrorKind::NotANumber, format!("`{}` is no number of a texture coordinate", shown())));
    };
    let from_0 = if index < 0 { (so_far as i64).saturating_add(index) } else { index - 1 };
    match u32::try_from(from_0) {
        Ok(i) if i < UvMap::NONE => Ok(i),
        _ => {
            let what = format!("texture coordinate {} is out of range, there are {so_far} so far", shown());
            Err(bad(ErrorKind::IndexOutOfRange, what))
        }
    }
}

fn write_coordinates(uv: &UvMap, end: &str, w: &mut dyn Write) -> io::Result<()> {
    uv.coordinates.iter().try_for_each(|[u, v]| write!(w, "vt {u:.16e} {v:.16e}{end}"))
}

/// Writes a mesh with its map and nothing else.
pub(super) fn write(mesh: &Mesh, uv: &UvMap, w: &mut dyn Write) -> io::Result<()> {
    for p in &mesh.points {
        writeln!(w, "v {:.16e} {:.16e} {:.16e}", p[0], p[1], p[2])?;
    }
    write_coordinates(uv, "\n", w)?;
    let mut corners = uv.corners.iter();
    for face in mesh.faces.iter() {
        write!(w, "f")?;
        for (&v, &c) in face.iter().zip(&mut corners) {
            let v = u64::from(v) + 1;
            if c == UvMap::NONE { write!(w, " {v}")? } else { write!(w, " {v}/{}", u64::from(c) + 1)? }
        }
        writeln!(w)?;
    }
    for e in &mesh.edges {
        writeln!(w, "l {} {}", u64::from(e[0]) + 1, u64::from(e[1]) + 1)?;
    }
    Ok(())
}

/// Writes the file `data` again with other texture coordinates: `vt` lines are exchanged for those of the map, face
/// corners get its numbers, lines lose theirs. Every other byte stays.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] where the faces of the file are not those that the map is for.
pub(super) fn rewrite(file: &str, data: &[u8], uv: &UvMap, w: &mut dyn Write) -> io::Result<()> {
    let body = data.strip_prefix(MARK).unwrap_or(data);
    let mut text = Text::new(file, data).map_err(io::Error::other)?;
    let end =
        if body.iter().position(|&b| b == b'\n').is_some_and(|n| body[..n].ends_with(b"\r")) { "\r\n" } else { "\n" };
    let mut corners = uv.corners.iter();
    let mut listed = false;
    let mut done = 0; // bytes of the body that are behind us
    w.write_all(&data[..data.len() - body.len()])?;
    while let Some(mut line) = text.next_line() {
        let from = line.at;
        let keyword = line.next();
        // The new list takes the place of the old one; where a face or nothing comes before, it goes before that.
        if matches!(keyword, Some(b"vt" | b"f")) && !std::mem::replace(&mut listed, true) {
            w.write_all(&body[done..from])?;
            done = from;
            write_coordinates(uv, end, w)?;
        }
        match keyword {
            Some(b"vt") => {
                w.write_all(&body[done..from])?;
                done = text.position();
            }
            Some(b"f" | b"l") => {
                let is_face = keyword == Some(b"f");
                while let Some(word) = line.next() {
                    let [vertex, old, normal] = corner_parts(word);
                    let new = match is_face {
                        true => *corners.next().ok_or_else(not_this_file)?,
                        false => UvMap::NONE,
                    };
                    if old.is_empty() && new == UvMap::NONE {
                        continue;
                    }
                    w.write_all(&body[done..line.at - word.len()])?;
                    done = line.at;
                    w.write_all(vertex)?;
                    match new {
                        UvMap::NONE if normal.is_empty() => {}
                        UvMap::NONE => w.write_all(b"/")?,
                        new => write!(w, "/{}", u64::from(new) + 1)?,
                    }
                    if !normal.is_empty() {
                        w.write_all(b"/")?;
                        w.write_all(normal)?;
                    }
                }
            }
            _ => {}
        }
    }
    if corners.next().is_some() {
        return Err(not_this_file());
    }
    w.write_all(&body[done..])
}

fn not_this_file() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, "the map is for other faces than those of the original file")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::obj;

    const SOURCE: &str = "# head\r\nmtllib a.mtl\r\nv 0 0 0 1 0 0\r\nv 1 0 0 0 1 0\r\nv 1 1 0 0 0 1 # c\r\nvn 0 0 1\r\n\
        vt 0.5 0.5 # gone\r\no one\r\nusemtl red\r\ns 1\r\nf 1/1/1  -2//1 \\\r\n 3/1 # tail\r\nvt 1 1\r\nv 0 1 0\r\n\
        g two\r\nl 1/1 2/2 3\r\nf -4 3 4\r\ncurv 1 2 3\r\n";

    fn map() -> UvMap {
        UvMap {
            coordinates: vec![[0.1, -0.0], [1e-300, 2.0 / 3.0], [5.0, 6.0], [7.0, 8.0]],
            corners: vec![0, 1, 2, 3, 2, 1],
        }
    }

    fn rewritten(source: &[u8], uv: &UvMap) -> Vec<u8> {
        let mut out = Vec::new();
        rewrite("a.obj", source, uv, &mut out).unwrap();
        out
    }

    #[test]
    fn all_but_the_coordinates_stays() {
        let out = String::from_utf8(rewritten(SOURCE.as_bytes(), &map())).unwrap();
        let list = "vt 1.0000000000000001e-1 -0.0000000000000000e0\r\n\
            vt 1.0000000000000000e-300 6.6666666666666663e-1\r\n\
            vt 5.0000000000000000e0 6.0000000000000000e0\r\nvt 7.0000000000000000e0 8.0000000000000000e0\r\n";
        let expected = SOURCE
            .replace("vt 0.5 0.5 # gone\r\n", list)
            .replace("vt 1 1\r\n", "")
            .replace("f 1/1/1  -2//1 \\\r\n 3/1 # tail", "f 1/1/1  -2/2/1 \\\r\n 3/3 # tail")
            .replace("l 1/1 2/2 3", "l 1 2 3")
            .replace("f -4 3 4", "f -4/4 3/3 4/2");
        assert_eq!(out, expected);
        let (before, after) = (obj::parse("a", SOURCE.as_bytes()).unwrap(), obj::parse("a", out.as_bytes()).unwrap());
        assert_eq!(before, after);
        let back = parse("a", out.as_bytes(), &after.faces).unwrap().unwrap();
        assert_eq!(back, map());
        assert!(back.coordinates[0][1].is_sign_negative(), "bit for bit");
        assert_eq!(rewritten(out.as_bytes(), &map()), out.as_bytes(), "a fixed point");
    }

    #[test]
    fn faces_without_coordinates_and_files_without_a_list() {
        let source = "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\ng a\nf 1//7 2//7 3//7\nf 3/9/7 2/9 1/9/7";
        let uv =
            UvMap { coordinates: vec![[0.0; 2]; 3], corners: vec![0, 1, 2, UvMap::NONE, UvMap::NONE, UvMap::NONE] };
        let out = String::from_utf8(rewritten(source.as_bytes(), &uv)).unwrap();
        let zero = "vt 0.0000000000000000e0 0.0000000000000000e0\n";
        let head = "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\ng a\n";
        assert_eq!(out, format!("{head}{}f 1/1/7 2/2/7 3/3/7\nf 3//7 2 1//7", zero.repeat(3)));
        let faces = obj::parse("a", out.as_bytes()).unwrap().faces;
        assert_eq!(parse("a", out.as_bytes(), &faces).unwrap().unwrap(), uv);
        let other = UvMap { coordinates: vec![[0.0; 2]], corners: vec![0; 5] };
        assert!(rewrite("a", source.as_bytes(), &other, &mut Vec::new()).is_err());
    }

    #[test]
    fn relative_and_later_coordinates_and_refusals() {
        let read = |text: &str| {
            let faces = obj::parse("a.obj", text.as_bytes()).unwrap().faces;
            parse("a.obj", text.as_bytes(), &faces)
        };
        let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        let uv = read(&format!("{head}vt 1\nvt 2 3 0\nf 1/-1 2/-2 3/3\nvt 4 5\nf 1/1 2/1 3\n")).unwrap().unwrap();
        assert_eq!(uv.coordinates, [[1.0, 0.0], [2.0, 3.0], [4.0, 5.0]]);
        assert_eq!(uv.corners, [1, 0, 2, UvMap::NONE, UvMap::NONE, UvMap::NONE]);
        assert_eq!(read(&format!("{head}vt 1 1\nf 1 2 3\n")).unwrap(), None);
        let message = |tail: &str| read(&format!("{head}{tail}")).unwrap_err().to_string();
        assert_eq!(
            message("vt 0 0\nf 1/1 2/1 3/7\n"),
            "a.obj: line 5: face 0 (0-based): texture coordinate 7 is out of range, there are 1; correct the index \
             or add `vt` lines"
        );
        assert!(
            message("f 1/-1 2/1 3/1\n").contains("line 4: face 0 (0-based): texture coordinate -1 is out of range")
        );
        assert!(message("vt 0 0\nf 1/0 2/1 3/1\n").contains("texture coordinate 0 is out of range"));
        assert!(message("vt 0 0\nf 1/x 2/1 3/1\n").contains("`x` is no number"));
        assert!(message("vt 0 nan\nf 1/1 2/1 3/1\n").contains("texture coordinate 1 is NaN"));
    }
}
