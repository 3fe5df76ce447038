//! Thin sheets: bending and limits of stretches.

use super::DeformError;
use super::elements::Cells;
use crate::settings::DeformSettings;
use proxel_model::bending::Bending;
use proxel_split::SymmetricForm;

/// Refuses what asks for triangles where there are none, and triangles that are none.
pub(crate) fn check(
    name: &str,
    points: &[[f64; 3]],
    settings: &DeformSettings,
    kinds: &[Cells],
) -> Result<(), DeformError> {
    check_areas(name, points, kinds)?;
    if settings.bending > 0.0 && !kinds.iter().any(|cells| matches!(cells, Cells::Triangles(_))) {
        return Err(DeformError(format!(
            "{name}: it has no elastic triangles to bend; leave --bending out, or use --mixed where there are tetrahedra too"
        )));
    }
    Ok(())
}

/// The quadratic form of bending over all triangles, in the solver's numbering; edges that cannot bend are warned of.
pub(crate) fn bending(
    name: &str,
    settings: &DeformSettings,
    kinds: &[Cells],
    number: &[u32],
    rest: &[f64],
    warnings: &mut Vec<String>,
) -> SymmetricForm {
    let Some(triangles) = bent(settings, kinds) else { return SymmetricForm::default() };
    let renumbered: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| number[v as usize])).collect();
    let bending = Bending::new(rest, 3, &renumbered);
    let original = |place: u32| number.iter().position(|p| *p == place).unwrap_or_default();
    if let Some([a, b]) = bending.nonmanifold.first() {
        warnings.push(format!(
            "{name}: {} edges have three or more triangles and do not bend, the first is {} {} (0-based)",
            bending.nonmanifold.len(),
            original(*a),
            original(*b)
        ));
    }
    if let Some(t) = bending.degenerate.first() {
        warnings.push(format!(
            "{name}: {} triangles are nearly flat lines, whose edges do not bend, the first is {t} (0-based)",
            bending.degenerate.len()
        ));
    }
    let form = bending.form(settings.bending);
    // The energy over K has no unit: a closed cylinder has about 30, a fold by an angle t about t^2 for each edge of it.
    if form.value_and_gradient(rest, 3, None) > FLAT * settings.bending {
        warnings.push(format!("{name}: the sheet is not flat at rest; bending is that of a flat one and flattens it"));
    }
    form
}

/// The derivative in the rest positions of what the forces of bending do along w, three numbers a vertex in the user's
/// numbering; nothing where nothing bends.
pub(crate) fn rest_sensitivity(
    settings: &DeformSettings,
    kinds: &[Cells],
    rest: &[f64],
    x: &[f64],
    w: &[f64],
) -> Vec<f64> {
    let of = |triangles: &[[u32; 3]]| Bending::new(rest, 3, triangles).rest_sensitivity(rest, settings.bending, x, w);
    bent(settings, kinds).map(of).unwrap_or_default()
}

/// The triangles that bend.
fn bent<'a>(settings: &DeformSettings, kinds: &'a [Cells]) -> Option<&'a [[u32; 3]]> {
    let triangles = kinds.iter().find_map(|cells| match cells {
        Cells::Triangles(triangles) => Some(&triangles[..]),
        _ => None,
    });
    triangles.filter(|_| settings.bending > 0.0)
}

/// Bending energies at rest up to this part of the stiffness are rounding.
const FLAT: f64 = 1e-6;

/// Triangles thinner than this, as 4 sqrt(3) area over the sum of squared edges (1 for an equilateral one), are lines up to
/// rounding.
const LINE: f64 = 1e-12;

/// Refuses triangles without an area, which resist nothing.
fn check_areas(name: &str, points: &[[f64; 3]], kinds: &[Cells]) -> Result<(), DeformError> {
    for cells in kinds {
        let Cells::Triangles(triangles) = cells else { continue };
        for (t, corners) in triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|v| points[v as usize]);
            let minus = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|d| a[d] - b[d]);
            let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
            let (u, v, w) = (minus(b, a), minus(c, a), minus(c, b));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let quality = 2.0 * 3f64.sqrt() * dot(n, n).sqrt() / (dot(u, u) + dot(v, v) + dot(w, w));
            if quality.is_nan() || quality <= LINE {
                return Err(DeformError(format!(
                    "{name}: triangle {t} (0-based) has no area, its corners {corners:?} lie on a line; move or remove it"
                )));
            }
        }
    }
    Ok(())
}

/// A warning where elements have the same corners: they count as often as they are there.
pub(crate) fn repeated(name: &str, kinds: &[Cells]) -> Vec<String> {
    let mut warnings = Vec::new();
    for cells in kinds {
        let mut sorted: Vec<(Vec<u32>, usize)> = cells
            .corners()
            .chunks_exact(cells.size())
            .map(|corners| {
                let mut corners = corners.to_vec();
                corners.sort_unstable();
                corners
            })
            .zip(0..)
            .collect();
        sorted.sort_unstable();
        let again = sorted.windows(2).filter(|w| w[0].0 == w[1].0).map(|w| w[1].1);
        let count = again.clone().count();
        if let Some(first) = again.min() {
            warnings.push(format!(
                "{name}: {count} elements have the corners of another, the first is {} {first} (0-based); each counts, \
                 so that the body is stiffer there",
                cells.noun()
            ));
        }
    }
    warnings
}
