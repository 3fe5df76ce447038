//! Thin sheets: bending and limits of stretches.

use super::DeformError;
use super::elements::Cells;
use crate::settings::DeformSettings;
use proxel_model::bending::Bending;
use proxel_split::SymmetricForm;

/// Refuses what asks for triangles where there are none.
pub(super) fn check(name: &str, settings: &DeformSettings, kinds: &[Cells]) -> Result<(), DeformError> {
    if settings.bending > 0.0 && !kinds.iter().any(|cells| matches!(cells, Cells::Triangles(_))) {
        return Err(DeformError(format!(
            "{name}: it has no elastic triangles to bend; leave --bending out, or use --mixed where there are tetrahedra too"
        )));
    }
    Ok(())
}

/// The quadratic form of bending over all triangles, in the solver's numbering; edges that cannot bend are warned of.
pub(super) fn bending(
    name: &str,
    settings: &DeformSettings,
    kinds: &[Cells],
    number: &[u32],
    rest: &[f64],
    warnings: &mut Vec<String>,
) -> SymmetricForm {
    let triangles = kinds.iter().find_map(|cells| match cells {
        Cells::Triangles(triangles) => Some(triangles),
        _ => None,
    });
    let Some(triangles) = triangles.filter(|_| settings.bending > 0.0) else { return SymmetricForm::default() };
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
    bending.form(settings.bending)
}
