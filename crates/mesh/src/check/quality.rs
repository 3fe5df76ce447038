//! Figures of shape: edge lengths, angles, mean ratios.

use std::fmt;

use super::orientation::{corners, mean_ratio};
use crate::topology::TET_FACES;
use crate::vec3::{Sum, V3, cross, dot, norm, sub};

/// The least, the mean and the greatest of many numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The least.
    pub min: f64,
    /// The arithmetic mean.
    pub mean: f64,
    /// The greatest.
    pub max: f64,
}

impl Spread {
    /// `None` of nothing.
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Option<Spread> {
        let (mut min, mut max, mut n) = (f64::INFINITY, f64::NEG_INFINITY, 0u64);
        let mut sum = Sum::default();
        for x in numbers {
            sum.add(x);
            (min, max, n) = (min.min(x), max.max(x), n + 1);
        }
        (n > 0).then(|| Spread { min, mean: sum.value() / n as f64, max })
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.4e} to {:.4e}, mean {:.4e}", self.min, self.max, self.mean)
    }
}

/// The shapes of tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TetQuality {
    /// The dihedral angles of each tetrahedron, in degrees.
    pub dihedral: Spread,
    /// The mean ratios, 1 for regular ones and 0 for flat or inverted ones.
    pub mean_ratio: Spread,
    /// The signed volumes.
    pub volume: Spread,
}

/// Examines all tetrahedra; `None` of none.
pub fn tet_quality(points: &[V3], tets: &[[u32; 4]]) -> Option<TetQuality> {
    let each = || tets.iter().map(|&t| corners(points, t));
    Some(TetQuality {
        dihedral: Spread::of(each().flat_map(dihedral_angles))?,
        mean_ratio: Spread::of(each().map(mean_ratio))?,
        volume: Spread::of(each().map(super::volume))?,
    })
}

/// The six dihedral angles of a tetrahedron in degrees, taken as positively oriented.
pub fn dihedral_angles(x: [V3; 4]) -> [f64; 6] {
    let normals = TET_FACES.map(|[a, b, c]| cross(sub(x[b], x[a]), sub(x[c], x[a])));
    // Faces k and l meet in the edge between the other two corners.
    [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]].map(|[k, l]| angle(normals[k], normals[l])).map(|a| 180.0 - a)
}

/// The angles of a triangle in degrees.
pub fn triangle_angles([a, b, c]: [V3; 3]) -> [f64; 3] {
    [angle(sub(b, a), sub(c, a)), angle(sub(a, b), sub(c, b)), angle(sub(a, c), sub(b, c))]
}

/// The angle between two vectors in degrees, accurate also near 0 and 180.
fn angle(u: V3, v: V3) -> f64 {
    norm(cross(u, v)).atan2(dot(u, v)).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_and_right_corners() {
        let regular = [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        for a in dihedral_angles(regular) {
            assert!((a - (1.0f64 / 3.0).acos().to_degrees()).abs() < 1e-12);
        }
        let mut right = dihedral_angles([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        right.sort_by(f64::total_cmp);
        assert!((right[5] - 90.0).abs() < 1e-12 && (right[3] - 90.0).abs() < 1e-12);
        assert!((right[0] - (1.0 / 3f64.sqrt()).acos().to_degrees()).abs() < 1e-12);
        let t = triangle_angles([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert!((t[0] - 90.0).abs() < 1e-12 && (t[1] - 45.0).abs() < 1e-12);
        assert_eq!(Spread::of([]), None);
    }
}
