//! What a report says of a map: what exact predicates find in it.

use super::Unwrapped;
use crate::report::MapReport;
use proxel_mesh::Mesh;
use proxel_mesh::uv::Certificate;
use proxel_split::Status;

impl Unwrapped {
    /// Puts what was found in a map, as it is handed on, into the report. One with flips has not converged,
    /// whatever the run says, nor has one with overlaps where there were to be none.
    pub fn certified(&mut self, c: &Certificate, mesh: &Mesh) {
        let bijective = self.report.settings["bijective"] == true;
        let d = &c.distortion;
        let before = self.report.map.take().unwrap_or_default();
        self.report.inverted = Some((c.flips + c.zero_area) as u64);
        self.report.energy = d.energy.is_finite().then_some(d.energy);
        let map = MapReport {
            flips: c.flips,
            zero_area: c.zero_area,
            overlaps: c.overlaps.triangle_pairs,
            boundary_crossings: c.overlaps.boundary_crossings,
            charts: c.charts,
            seam_length: c.relative_seam_length,
            packing: c.packing,
            unmapped_faces: c.unmapped_faces,
            l2_stretch: d.l2_stretch,
            linf_stretch: d.max_stretch,
            conformal_distortion: d.conformal_mean,
            conformal_distortion_max: d.conformal_max,
            area_distortion: d.area_mean,
            area_distortion_max: d.area_max,
            ..before
        };
        self.report.map = Some(map);
        if c.overlaps.triangle_pairs > 0 {
            self.report.warnings.push(format!(
                "{}: the map overlaps itself: {} pairs of triangles meet, as of the faces {} and {} (0-based)",
                mesh.name,
                c.overlaps.triangle_pairs,
                c.overlaps.faces.first().map_or(0, |f| f[0]),
                c.overlaps.faces.first().map_or(0, |f| f[1])
            ));
        }
        let wrong = if c.flips + c.zero_area > 0 {
            Some(format!("{} triangles are flipped and {} have no area", c.flips, c.zero_area))
        } else if bijective && !c.overlaps.is_injective() {
            let (pairs, crossings) = (c.overlaps.triangle_pairs, c.overlaps.boundary_crossings);
            Some(format!(
                "{pairs} pairs of triangles overlap and {crossings} pairs of border edges cross (--bijective)"
            ))
        } else {
            None
        };
        if let (Some(wrong), Status::Converged) = (wrong, self.status) {
            self.status = Status::Stopped;
            self.report.status = Status::Stopped.as_str().to_string();
            self.report.reason = format!("{}: {wrong} in the map as written; {}", mesh.name, self.report.reason);
        }
    }
}
