//! How far a map of a surface is from an isometry, as numbers and as colours.

use proxel_mesh::{Fields, MeshError};

use super::color::{blend, to_byte, to_linear};
use super::vec::{V3, cross, dot, sub};

/// The colour of flipped triangles.
pub const FLIPPED: [f32; 3] = [1.0, 0.0, 0.85];
/// The colours of what is squeezed, of isometries, and of what is stretched.
const SCALE: [[f32; 3]; 5] =
    [[0.03, 0.19, 0.46], [0.37, 0.62, 0.82], [0.95, 0.94, 0.91], [0.94, 0.52, 0.38], [0.55, 0.03, 0.11]];
/// The stretch from which colours no longer change.
const DARKEST: f64 = 4.0;

/// The colour of a stretch as [`stretches`] gives it: light for 1, through red up to 4, through blue down to 1/4,
/// by its logarithm; [`FLIPPED`] for what is not positive; grey for NaN.
pub fn stretch_color(stretch: f64) -> [f32; 3] {
    if stretch.is_nan() {
        return [0.6; 3];
    }
    if stretch <= 0.0 {
        return FLIPPED;
    }
    let x = (1.0 + (stretch.ln() / DARKEST.ln()).clamp(-1.0, 1.0)) * 0.5 * (SCALE.len() - 1) as f64;
    let i = (x as usize).min(SCALE.len() - 2);
    blend(SCALE[i], SCALE[i + 1], (x - i as f64) as f32)
}

/// The singular values s1 >= |s2| of the linear map of each triangle to the plane, s2 < 0 where it is flipped
/// (clockwise in the plane). NaN for triangles without area and where indices are out of range. `uv` has the
/// coordinates of the corners of each triangle.
pub fn singular_values(points: &[[f64; 3]], triangles: &[[u32; 3]], uv: &[[[f64; 2]; 3]]) -> Vec<[f64; 2]> {
    triangles.iter().zip(uv).map(|(t, uv)| corners(points, *t).map_or([f64::NAN; 2], |x| singular(x, *uv))).collect()
}

fn corners(points: &[[f64; 3]], t: [u32; 3]) -> Option<[V3; 3]> {
    let [a, b, c] = t.map(|v| points.get(v as usize).copied());
    Some([a?, b?, c?])
}

fn singular([a, b, c]: [V3; 3], uv: [[f64; 2]; 3]) -> [f64; 2] {
    let (e1, e2) = (sub(b, a), sub(c, a));
    // The edges in an orthonormal frame of the triangle: (l, 0) and (x, y).
    let l = dot(e1, e1).sqrt();
    let (x, y) = (dot(e1, e2) / l, { dot(cross(e1, e2), cross(e1, e2)).sqrt() / l });
    if !(l > 0.0 && y > 0.0) {
        return [f64::NAN; 2];
    }
    let (d1, d2) = ([uv[1][0] - uv[0][0], uv[1][1] - uv[0][1]], [uv[2][0] - uv[0][0], uv[2][1] - uv[0][1]]);
    // J = [d1 d2] [l x; 0 y]^-1, and s = |conformal part| +- |anticonformal part|.
    let column = d1.map(|d| d / l);
    let other = [0, 1].map(|i| (d2[i] - x * column[i]) / y);
    let half =
        [column[0] + other[1], column[0] - other[1], column[1] + other[0], column[1] - other[0]].map(|v| 0.5 * v);
    let (q, r) = (half[0].hypot(half[3]), half[1].hypot(half[2]));
    [q + r, q - r]
}

/// One number for each triangle: s1 where the map stretches more than it squeezes, else s2, so that the distortion
/// is max(s, 1/s) = max(s1, 1/s2). It is negative for flipped triangles.
///
/// The map is first scaled by the c that minimises the symmetric Dirichlet energy (Smith and Schaefer 2015) of the
/// whole, sum_t A_t (c^2 (s1^2 + s2^2) + c^-2 (s1^-2 + s2^-2)): c^4 = sum_t A_t (s1^-2 + s2^-2) / sum_t A_t (s1^2 +
/// s2^2), A_t the areas on the surface. So a packed map is coloured as the unpacked one. Triangles that are flat on
/// the surface or in the plane have no part in c.
pub fn stretches(points: &[[f64; 3]], triangles: &[[u32; 3]], uv: &[[[f64; 2]; 3]]) -> Vec<f64> {
    let values = singular_values(points, triangles, uv);
    let (mut stretched, mut squeezed) = (0.0, 0.0);
    for (t, [s1, s2]) in triangles.iter().zip(&values) {
        let (up, down) = (s1 * s1 + s2 * s2, 1.0 / (s1 * s1) + 1.0 / (s2 * s2));
        if let (Some(x), true) = (corners(points, *t), down.is_finite() && up.is_finite()) {
            stretched += area(x) * up;
            squeezed += area(x) * down;
        }
    }
    let c = (squeezed / stretched).sqrt().sqrt();
    let c = if c > 0.0 && c.is_finite() { c } else { 1.0 };
    let signed = |[s1, s2]: [f64; 2]| {
        let (s1, s2) = (c * s1, c * s2);
        let size = if s1 * s2.abs() >= 1.0 { s1 } else { s2.abs() };
        if s2 < 0.0 { -size } else { size }
    };
    values.into_iter().map(signed).collect()
}

fn area([a, b, c]: [V3; 3]) -> f64 {
    let n = cross(sub(b, a), sub(c, a));
    0.5 * dot(n, n).sqrt()
}

/// Colours and the array `distortion` for the vertices of a mesh, to be written as PLY.
///
/// `distortion` is the mean of max(|s|, 1/|s|) over the triangles around a vertex, weighted by area; colours are
/// those of the mean of log |s|, [`FLIPPED`] next to flipped triangles. Triangles without area on the surface or in
/// the plane count as nothing; vertices with no others get NaN and grey. `stretch` is what [`stretches`] gives.
///
/// # Errors
/// Unless there is one stretch for each triangle.
pub fn heat_map(points: &[[f64; 3]], triangles: &[[u32; 3]], stretch: &[f64]) -> Result<Fields, MeshError> {
    if stretch.len() != triangles.len() {
        return Err(MeshError::new(
            proxel_mesh::ErrorKind::CountMismatch,
            "heat map",
            format!("{} stretches for {} triangles", stretch.len(), triangles.len()),
            "give one stretch for each triangle",
        ));
    }
    // Sums of areas, of area times distortion and of area times logarithm; whether a flipped triangle is there.
    let mut sums = vec![([0.0; 3], false); points.len()];
    for (t, &s) in triangles.iter().zip(stretch) {
        let Some(x) = corners(points, *t) else { continue };
        let (a, log) = (area(x), s.abs().ln());
        if !log.is_finite() {
            continue;
        }
        for v in t {
            let (sum, flipped) = &mut sums[*v as usize];
            *sum = [sum[0] + a, sum[1] + a * log.abs().exp(), sum[2] + a * log];
            *flipped |= s < 0.0;
        }
    }
    let color = |&([a, _, log], flipped): &([f64; 3], bool)| {
        let c = if flipped { FLIPPED } else { stretch_color((log / a).exp()) };
        c.map(|c| to_byte(to_linear(c)))
    };
    let mut fields = Fields::none();
    fields.colors(sums.iter().map(color).collect());
    fields.point("distortion", 1, sums.iter().map(|(s, _)| s[1] / s[0]).collect());
    Ok(fields)
}
