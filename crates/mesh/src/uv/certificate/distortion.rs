//! How far a map is from an isometry: energies and stretches over the singular values of its triangles.

use super::exact::{Plane, orient, rest_area};
use crate::vec3::{Sum, V3, dot, norm, sub};

/// A triangle on the surface and in the plane. J maps an isometric frame of the first to the second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measure {
    pub area: f64,    // on the surface; 0 exactly where it has none
    pub stretch: V2,  // the singular values of J, s1 >= s2 >= 0
    pub uv_area: f64, // in the plane, absolute
    pub sign: i8,     // of the area in the plane, exact; turned around for reversed faces
}

type V2 = [f64; 2];

impl Measure {
    /// Of the triangle `rest` that is mapped to the points `ids`.
    pub fn new(rest: [V3; 3], plane: &Plane, ids: [u32; 3], reversed: bool) -> Self {
        let [p, q, r] = ids.map(|i| plane.at(i));
        let double = orient(p, q, r);
        let sign = i8::from(double > 0.0) - i8::from(double < 0.0);
        let area = rest_area(rest);
        let back = 1.0 / plane.scale;
        let uv_area = 0.5 * double.abs() * back * back;
        let stretch = if area > 0.0 { stretches(rest, [p, q, r], area, double, back) } else { [0.0; 2] };
        Measure { area, stretch, uv_area, sign: if reversed { -sign } else { sign } }
    }
}

/// The singular values of J: halves of the lengths of its similar and anti-similar parts give the larger one without
/// cancellation, the determinant then the smaller one.
fn stretches(x: [V3; 3], [p, q, r]: [V2; 3], area: f64, double: f64, back: f64) -> V2 {
    let (a, b) = (sub(x[1], x[0]), sub(x[2], x[0]));
    let length = norm(a);
    let (bx, by) = (dot(a, b) / length, 2.0 * area / length);
    let column = |k: usize| {
        let first = (q[k] - p[k]) * back / length;
        [first, ((r[k] - p[k]) * back - first * bx) / by]
    };
    let [[a, b], [c, d]] = [column(0), column(1)];
    let s1 = 0.5 * ((a + d).hypot(c - b) + (a - d).hypot(c + b));
    let det = (double * back / area * back).abs() * 0.5;
    [s1, if s1 > 0.0 { det / s1 } else { 0.0 }]
}

/// Measures of distortion over all triangles that have area on the surface; areas on the surface are the weights.
/// Flipped triangles count with the absolute value of their stretches, so that everything stays finite until an area
/// in the plane is zero: then what contains 1 / s2 is infinite. NaN where no triangle has area.
///
/// s1 >= s2 are the singular values of the map from the surface to the plane after the uniform scale that minimises
/// the symmetric Dirichlet energy, `scale` (where there is none, that which makes the areas equal); only
/// `energy_as_given` and `sander` measures know another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// E = 1/4 sum A (s1^2 + s2^2 + s1^-2 + s2^-2) / sum A, 1 for an isometry: Smith and Schaefer 2015, normalised.
    pub energy: f64,
    /// What coordinates must be multiplied by for it: (sum A (s1^-2 + s2^-2) / sum A (s1^2 + s2^2))^(1/4).
    pub scale: f64,
    /// E of the coordinates as they are, in the units of the mesh.
    pub energy_as_given: f64,
    /// sqrt(sum A (s1^2 + s2^2) / 2 / sum A).
    pub l2_stretch: f64,
    /// max max(s1, 1 / s2).
    pub max_stretch: f64,
    /// The L2 stretch of the map from the plane to the surface (Sander et al. 2001), sqrt(sum A (s1^-2 + s2^-2) / 2 /
    /// sum A) times sqrt(area in the plane / sum A): 1 is the least.
    pub sander_l2: f64,
    /// Their worst case, max 1 / s2 with the same factor.
    pub sander_linf: f64,
    /// sum A (s1 / s2) / sum A.
    pub conformal_mean: f64,
    /// max s1 / s2.
    pub conformal_max: f64,
    /// sum A max(s1 s2, 1 / (s1 s2)) / sum A.
    pub area_mean: f64,
    /// max max(s1 s2, 1 / (s1 s2)).
    pub area_max: f64,
    /// sum A on the surface.
    pub rest_area: f64,
    /// sum A (s1^2 + s2^2) / sum A of the coordinates as they are.
    dirichlet: f64,
    /// sum A (s1^-2 + s2^-2) / sum A of the coordinates as they are.
    inverse: f64,
}

impl Distortion {
    pub(super) fn new(measures: &[Measure]) -> Self {
        let with_area = || measures.iter().filter(|m| m.area > 0.0);
        let sum = |f: &dyn Fn(&Measure) -> f64| total(with_area().map(f));
        let max = |f: &dyn Fn(&Measure) -> f64| with_area().map(f).fold(f64::NAN, f64::max);
        let rest_area = sum(&|m| m.area);
        let mean = |f: &dyn Fn(&Measure) -> f64| sum(&|m| m.area * f(m)) / rest_area;
        let dirichlet = mean(&|m| m.stretch[0].powi(2) + m.stretch[1].powi(2));
        let inverse = mean(&|m| m.stretch[0].powi(-2) + m.stretch[1].powi(-2));
        let uv_area = total(with_area().map(|m| m.uv_area));
        let normal = uv_area.sqrt() / rest_area.sqrt();
        // Where a triangle is mapped to nothing, no scale is the best: areas are made equal. Roots first, so that no
        // quotient leaves the range.
        let scale = match inverse.is_finite() {
            true => (inverse.sqrt() / dirichlet.sqrt()).sqrt(),
            false if normal > 0.0 => 1.0 / normal,
            false => 1.0,
        };
        let ratio = |m: &Measure| if m.stretch[1] > 0.0 { m.stretch[0] / m.stretch[1] } else { f64::INFINITY };
        let s = |m: &Measure| m.stretch.map(|s| s * scale);
        let area_change = |m: &Measure| (s(m)[0] * s(m)[1]).max(1.0 / (s(m)[0] * s(m)[1]));
        let mut out = Distortion {
            energy: 0.0,
            scale,
            energy_as_given: 0.0,
            l2_stretch: (mean(&|m| s(m)[0].powi(2) + s(m)[1].powi(2)) / 2.0).sqrt(),
            max_stretch: max(&|m| s(m)[0].max(1.0 / s(m)[1])),
            sander_l2: (inverse / 2.0).sqrt() * normal,
            sander_linf: max(&|m| 1.0 / m.stretch[1]) * normal,
            conformal_mean: mean(&ratio),
            conformal_max: max(&ratio),
            area_mean: mean(&area_change),
            area_max: max(&area_change),
            rest_area,
            dirichlet,
            inverse,
        };
        // At the best scale both halves are the same; where a triangle has no area there is none, and E is infinite.
        out.energy = if inverse.is_finite() { 0.5 * dirichlet.sqrt() * inverse.sqrt() } else { inverse };
        out.energy_as_given = out.energy_at(1.0);
        out
    }

    /// E of the coordinates times `factor`, in the units of the mesh. For a mesh that is scaled to unit area and
    /// coordinates that stay as they are, the factor is sqrt([`rest_area`](Self::rest_area)).
    pub fn energy_at(&self, factor: f64) -> f64 {
        0.25 * (self.dirichlet * factor * factor + self.inverse / factor / factor)
    }
}

/// Neumaier's sum in the order of the triangles; infinite as soon as a term is.
fn total(terms: impl Iterator<Item = f64>) -> f64 {
    let mut sum = Sum::default();
    let mut worst = 0.0f64;
    for x in terms {
        worst = worst.max(x);
        sum.add(x);
    }
    if worst.is_infinite() { worst } else { sum.value() }
}

pub(super) fn uv_area(measures: &[Measure]) -> f64 {
    total(measures.iter().map(|m| m.uv_area))
}

/// The largest over the smallest of sqrt(area in the plane / area on the surface) over the charts.
pub(super) fn density_spread(measures: &[Measure], charts: &[u32], n: usize) -> f64 {
    let mut areas = vec![[Sum::default(); 2]; n];
    for (m, &c) in measures.iter().zip(charts) {
        areas[c as usize][0].add(m.uv_area);
        areas[c as usize][1].add(m.area);
    }
    let densities = areas.iter().map(|a| [a[0].value(), a[1].value()]).filter(|a| a[0] > 0.0 && a[1] > 0.0);
    let (low, high) = densities
        .map(|a| (a[0] / a[1]).sqrt())
        .fold((f64::INFINITY, 0.0f64), |(low, high), d| (low.min(d), high.max(d)));
    if high > 0.0 { high / low } else { 1.0 }
}
