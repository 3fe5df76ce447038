//! From the maps of charts to one map of the mesh.

use super::chart::ChartMap;
use super::{MapRow, UnwrapError};
use crate::settings::UnwrapSettings;
use proxel_mesh::Mesh;
use proxel_mesh::charts::Charts;
use proxel_mesh::uv::UvMap;
use proxel_mesh::uv::pack::{PackChart, PackError, PackOptions, Placement, pack};

/// The map of a chart, in units of length of the mesh.
pub(super) struct Laid<'a> {
    pub uv: &'a [[f64; 2]],
    pub area: f64,  // of the chart in space
    pub held: bool, // by pins
}

/// A map of the mesh.
pub(super) struct Placed {
    pub uv: UvMap,
    pub density: Option<f64>, // texels per unit of length, where packed
    pub warnings: Vec<String>,
}

/// Between charts that are not packed: this part of the larger side of the last one.
const GAP: f64 = 0.05;

/// Puts the charts side by side: packed into the unit square, or in a row in units of length of the mesh. Charts that pins hold
/// stay where they are.
pub(super) fn place(
    mesh: &Mesh,
    charts: &Charts,
    maps: &[Laid<'_>],
    settings: &UnwrapSettings,
) -> Result<Placed, UnwrapError> {
    let mut warnings = Vec::new();
    let held = maps.iter().any(|map| map.held);
    let mut density = None;
    let placements = if held || !settings.pack {
        in_a_row(maps)
    } else {
        let of: Vec<PackChart<'_>> = maps
            .iter()
            .zip(&charts.charts)
            .map(|(map, chart)| PackChart { uv: map.uv, triangles: &chart.triangles, rest_area: map.area })
            .collect();
        let options = PackOptions {
            padding: settings.padding,
            resolution: settings.resolution,
            rotate: true,
            density: settings.density,
        };
        match pack(&of, &options) {
            Ok(packing) => {
                density = Some(packing.density);
                packing.placements
            }
            // A map is never lost to a page that is too small.
            Err(e @ (PackError::NoRoom { .. } | PackError::DensityTooHigh { .. })) => {
                warnings.push(format!("{}: not packed: {e}; the charts lie in a row, in units of the mesh", mesh.name));
                in_a_row(maps)
            }
            Err(e) => return Err(UnwrapError(format!("{}: {e}", mesh.name))),
        }
    };
    let mut uv = UvMap::default();
    let mut first = Vec::with_capacity(maps.len());
    for (map, placement) in maps.iter().zip(&placements) {
        first.push(uv.coordinates.len() as u32);
        match placement {
            // Not a bit changes where nothing moves: pins stay where they were put.
            p if *p == STAY => uv.coordinates.extend_from_slice(map.uv),
            p => uv.coordinates.extend(map.uv.iter().map(|q| p.apply(*q))),
        }
    }
    uv.corners = charts
        .places
        .iter()
        .map(|place| place.as_ref().map_or(UvMap::NONE, |p| first[p.chart as usize] + p.vertex))
        .collect();
    Ok(Placed { uv, density, warnings })
}

const STAY: Placement = Placement { scale: 1.0, rotation: [1.0, 0.0], offset: [0.0, 0.0] };

/// In the scale that they have, the first where it is, each further one to the right of all before it.
fn in_a_row(maps: &[Laid<'_>]) -> Vec<Placement> {
    let corners = |map: &Laid<'_>| {
        map.uv.iter().fold(([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]), |(lo, hi), p| {
            ([lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])])
        })
    };
    let boxes: Vec<_> = maps.iter().map(corners).collect();
    let held = |c: usize| maps[c].held || maps.len() == 1;
    let mut right = (0..maps.len()).filter(|c| held(*c)).map(|c| boxes[c].1[0]).fold(f64::NEG_INFINITY, f64::max);
    let place = |c: usize| {
        if held(c) {
            return STAY;
        }
        let (low, high) = boxes[c];
        let gap = GAP * (high[0] - low[0]).max(high[1] - low[1]);
        let left = if right.is_finite() { right + gap } else { 0.0 };
        right = left + high[0] - low[0];
        Placement { offset: [left - low[0], -low[1]], ..STAY }
    };
    (0..maps.len()).map(place).collect()
}

/// Row k: sums over all charts after k iterations each, or the last state of those that have fewer.
pub(super) fn rows(maps: &[ChartMap], cutting: f64) -> Vec<MapRow> {
    let longest = maps.iter().map(|m| m.rows.len()).max().unwrap_or(0);
    let total: f64 = maps.iter().map(|m| m.area).sum();
    let state = |k: usize| {
        let mut sum: Option<MapRow> = None;
        for map in maps {
            let Some(row) = map.rows.get(k).or(map.rows.last()) else { continue };
            let is_new = k < map.rows.len();
            let part = map.area / total;
            let to = sum.get_or_insert(MapRow {
                iteration: k,
                seconds: cutting,
                energy: 0.0,
                gradient_norm: 0.0,
                primal_residual: 0.0,
                dual_residual: 0.0,
                inner: 0,
                refactorised: false,
                accepted: true,
                flips: 0,
                energy_z: 0.0,
            });
            to.seconds += row.seconds;
            to.energy += part * row.energy;
            to.energy_z += part * row.energy_z;
            to.gradient_norm = to.gradient_norm.max(row.gradient_norm);
            to.primal_residual = to.primal_residual.max(row.primal_residual);
            to.dual_residual = to.dual_residual.max(row.dual_residual);
            to.flips += row.flips;
            if is_new {
                to.inner += row.inner;
                to.refactorised |= row.refactorised;
                to.accepted &= row.accepted;
            }
        }
        sum
    };
    (0..longest).filter_map(state).collect()
}
