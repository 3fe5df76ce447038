//! Where a map is not injective: triangles that lie over each other, borders that cross.

use rayon::prelude::*;

use super::distortion::Measure;
use super::exact::{Contact, Plane, V2, contact, fold, interiors_intersect};
use super::pairs::{Box2, find_pairs};
use super::{MOST_EXAMPLES, Triangle};
use crate::mesh::Polygons;
use crate::uv::layout::Layout;

/// Pairs that meet in the plane though they do not on the surface, by exact tests over the whole atlas.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Overlaps {
    /// Pairs of triangles whose interiors intersect, of one chart or of two. Copies of a face at the same coordinates
    /// are not tested.
    pub triangle_pairs: u64,
    /// The faces of some of them, (smaller, larger), ascending, at most [`MOST_EXAMPLES`].
    pub faces: Vec<[u32; 2]>,
    /// Pairs of edges of chart borders with a common point inside both.
    pub boundary_crossings: u64,
    /// Pairs of edges of chart borders that have another point in common than an end that they share: an end of one
    /// on the other, or a piece of a line.
    pub boundary_touches: u64,
    /// The faces of some crossing or touching edges.
    pub boundary_faces: Vec<[u32; 2]>,
    /// Whether all pairs were tested. Where so many triangles lie over each other that 3 10^8 tests do not suffice,
    /// the counts are of those that were: lower bounds.
    pub complete: bool,
}

impl Overlaps {
    /// Whether no two triangles overlap and no borders cross. Borders may touch.
    pub fn is_injective(&self) -> bool {
        self.complete && self.triangle_pairs == 0 && self.boundary_crossings == 0
    }
}

/// The faces that have the same UV vertices as one before them.
pub(super) fn copies(faces: &Polygons, layout: &Layout) -> Vec<bool> {
    let own = |f: u32| &layout.corners[faces.offsets()[f as usize] as usize..faces.offsets()[f as usize + 1] as usize];
    // Equal sets have equal sums of mixed numbers; whether sets of equal sums are equal is then looked at.
    let mut keys: Vec<(u64, u32)> = (0..faces.len() as u32)
        .into_par_iter()
        .filter(|&f| super::is_mapped(faces, layout, f as usize))
        .map(|f| (own(f).iter().fold(0, |sum: u64, &c| sum.wrapping_add(mixed(c))), f))
        .collect();
    keys.par_sort_unstable();
    let mut copies = vec![false; faces.len()];
    for alike in keys.chunk_by(|a, b| a.0 == b.0).filter(|g| g.len() > 1) {
        let mut sets: Vec<(Vec<u32>, u32)> = alike.iter().map(|&(_, f)| (own(f).to_vec(), f)).collect();
        sets.iter_mut().for_each(|s| s.0.sort_unstable());
        sets.sort_unstable();
        for w in sets.windows(2).filter(|w| w[0].0 == w[1].0) {
            copies[w[1].1 as usize] = true;
        }
    }
    copies
}

/// A number without structure (Steele, Lea and Flood 2014, SplitMix).
fn mixed(x: u32) -> u64 {
    let z = (u64::from(x) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// Tests all triangles that have area in the plane, and all edges of the border.
pub(super) fn overlaps(
    plane: &Plane,
    layout: &Layout,
    triangles: &[Triangle],
    measures: &[Measure],
    copies: &[bool],
    border: &[([u32; 2], u32)],
) -> Overlaps {
    let has_area = |(t, m): &(&Triangle, &Measure)| m.sign != 0 && !copies[t.face as usize];
    let solid: Vec<(u32, [V2; 3])> = triangles
        .iter()
        .zip(measures)
        .filter(has_area)
        .map(|(t, _)| {
            let [p, q, r] = t.corners.map(|c| plane.at(layout.corners[c as usize]));
            // The measure has the sign turned for reversed faces; here the listed order counts.
            let ccw = super::exact::orient(p, q, r) > 0.0;
            (t.face, if ccw { [p, q, r] } else { [p, r, q] })
        })
        .collect();
    let boxes: Vec<Box2> = solid.par_iter().map(|(_, t)| around(t)).collect();
    let found = find_pairs::<1>(&boxes, true, MOST_EXAMPLES, |i, j| {
        interiors_intersect(solid[i as usize].1, solid[j as usize].1).then_some(0)
    });
    let segments: Vec<[V2; 2]> = border.iter().map(|(e, _)| e.map(|v| plane.at(v))).collect();
    let boxes: Vec<Box2> = segments.iter().map(|s| around(s)).collect();
    let meeting = find_pairs::<2>(&boxes, false, MOST_EXAMPLES, |i, j| {
        let (i, j) = (i as usize, j as usize);
        match edges_meet(plane, border[i].0, border[j].0) {
            Contact::None => None,
            Contact::Cross => Some(0),
            Contact::Touch => Some(1),
        }
    });
    let named = |pairs: Vec<[u32; 2]>, face: &dyn Fn(u32) -> u32| {
        let mut out: Vec<[u32; 2]> = pairs.into_iter().map(|p| p.map(face)).collect();
        out.iter_mut().for_each(|p| p.sort_unstable());
        out.sort_unstable();
        out.dedup();
        out
    };
    Overlaps {
        triangle_pairs: found.counts[0],
        faces: named(found.examples, &|i| solid[i as usize].0),
        boundary_crossings: meeting.counts[0],
        boundary_touches: meeting.counts[1],
        boundary_faces: named(meeting.examples, &|i| border[i as usize].1),
        complete: found.complete && meeting.complete,
    }
}

/// How two edges of the border meet beyond the vertices that they share.
fn edges_meet(plane: &Plane, e: [u32; 2], f: [u32; 2]) -> Contact {
    let shared = e.iter().find(|v| f.contains(v));
    let Some(&p) = shared else {
        return contact(e.map(|v| plane.at(v)), f.map(|v| plane.at(v)));
    };
    let other = |s: [u32; 2]| plane.at(if s[0] == p { s[1] } else { s[0] });
    if fold(plane.at(p), other(e), other(f)) { Contact::Touch } else { Contact::None }
}

fn around(points: &[V2]) -> Box2 {
    let mut b = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for p in points {
        for d in 0..2 {
            b[0][d] = b[0][d].min(p[d]);
            b[1][d] = b[1][d].max(p[d]);
        }
    }
    b
}
