//! Whether a surface has an inside.

use crate::vec3::{V3, add, cross, norm, scale, sub};
use crate::winding::WindingTree;
use rayon::prelude::*;

/// How closed a surface is: the mean over its area of the winding number at it, half-way between its two sides, cut to
/// [-1/2, 1/2].
///
/// On a closed surface w jumps from 0 to 1, so the mean is 1/2 everywhere; -1/2 if all normals point inward; 0 on an open
/// plane, where w jumps from -1/2 to 1/2. A hole takes away the part of the view that it fills, over 4 pi: a hemisphere
/// has 0.3. Where bodies overlap w jumps from 1 to 2, hence the cut.
pub fn closedness(points: &[[f64; 3]], triangles: &[[u32; 3]], tree: &WindingTree) -> f64 {
    /// At most about so many triangles are looked at, evenly spread.
    const SAMPLES: usize = 4096;
    /// How far in front of and behind the surface w is taken, over the size of the triangle.
    const OFFSET: f64 = 1e-3;
    let chosen: Vec<&[u32; 3]> = triangles.iter().step_by(triangles.len().div_ceil(SAMPLES).max(1)).collect();
    let at = |t: &&[u32; 3]| -> (f64, f64) {
        let [a, b, c]: [V3; 3] = t.map(|v| points[v as usize]);
        let n = cross(sub(b, a), sub(c, a));
        let area = norm(n);
        if area.is_nan() || area <= 0.0 {
            return (0.0, 0.0);
        }
        let middle = scale(1.0 / 3.0, add(a, add(b, c)));
        let way = scale(OFFSET / area.sqrt(), n); // |n| = area: OFFSET sqrt(area) long
        let w = (tree.at(add(middle, way)) + tree.at(sub(middle, way))) / 2.0;
        (area * w.clamp(-0.5, 0.5), area)
    };
    let all: Vec<(f64, f64)> = chosen.par_iter().with_min_len(64).map(at).collect();
    let (sum, area) = all.into_iter().fold((0.0, 0.0), |(s, a), (x, y)| (s + x, a + y));
    if area > 0.0 { sum / area } else { 0.0 }
}

/// The triangles of a surface and what is inside of them.
pub(super) struct Inside {
    tree: WindingTree,
    sign: f64, // -1 where all normals point inward
    /// See [`closedness`], without its sign.
    pub closedness: f64,
}

impl Inside {
    pub fn new(points: &[V3], triangles: &[[u32; 3]]) -> Inside {
        let tree = WindingTree::new(points, triangles);
        let closedness = closedness(points, triangles, &tree);
        Inside { tree, sign: if closedness < 0.0 { -1.0 } else { 1.0 }, closedness: closedness.abs() }
    }

    pub fn contains(&self, q: V3) -> bool {
        self.sign * self.tree.at(q) > 0.5
    }
}
