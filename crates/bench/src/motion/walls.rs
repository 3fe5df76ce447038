//! What the horse falls on.

use proxel::model::obstacle::Wall;

/// The obstacles of a figure. A vertex inside goes where the authors' implementation puts it: to the surface of what it is
/// deepest in, and over the ground beside a pit straight up.
#[derive(Clone, Debug, PartialEq)]
pub enum Walls {
    /// The ground below y = `floor`, with a half ball of the radius around (0, floor, 0) taken out.
    Pit {
        /// m
        floor: f64,
        /// m
        radius: f64,
    },
    /// Endless cylinders along z around points of the plane z = 0, and a half-space.
    Cylinders {
        /// Their axes.
        centers: Vec<[f64; 2]>,
        /// m
        radius: f64,
        /// A point of the plane and its unit normal.
        slope: ([f64; 3], [f64; 3]),
    },
}

impl Walls {
    /// Signed distance and what takes the point to the surface.
    fn nearest(&self, x: &[f64; 3]) -> (f64, [f64; 3]) {
        match self {
            Walls::Pit { floor, radius } => {
                let height = x[1] - floor;
                if x[0].hypot(x[2]) > *radius {
                    return (height, [0.0, -height, 0.0]);
                }
                let r = x[0].hypot(x[2]).hypot(height);
                if height > 0.0 {
                    return (r + radius, [0.0; 3]);
                }
                let out = |v: f64| if r > 0.0 { (radius / r - 1.0) * v } else { 0.0 };
                (radius - r, [out(x[0]), out(height), out(x[2])])
            }
            Walls::Cylinders { centers, radius, slope: (point, normal) } => {
                let height: f64 = (0..3).map(|d| (x[d] - point[d]) * normal[d]).sum();
                let plane = (height, normal.map(|n| -height * n));
                centers.iter().fold(plane, |nearest, c| {
                    let (dx, dy) = (x[0] - c[0], x[1] - c[1]);
                    let r = dx.hypot(dy);
                    let distance = r - radius;
                    if distance > nearest.0 {
                        return nearest;
                    }
                    let n = if r > 0.0 { [dx / r, dy / r] } else { [1.0, 0.0] };
                    (distance, [-distance * n[0], -distance * n[1], 0.0])
                })
            }
        }
    }
}

impl Wall<3> for Walls {
    fn distance(&self, x: &[f64; 3]) -> f64 {
        self.nearest(x).0
    }

    fn push(&self, x: &[f64; 3]) -> [f64; 3] {
        let (distance, push) = self.nearest(x);
        if distance < 0.0 { push } else { [0.0; 3] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pushed_points_are_on_the_surface() {
        let centers = vec![[0.0, 0.0], [1.5, 0.0]];
        let walls = [
            Walls::Pit { floor: -3.0, radius: 1.0 },
            Walls::Cylinders { centers, radius: 0.4, slope: ([0.0, -6.5, 0.0], [0.5, 0.75_f64.sqrt(), 0.0]) },
        ];
        let mut inside = 0;
        for wall in &walls {
            for k in 0..4000 {
                let at = |a: f64, size: f64| size * (f64::from(k) * a).sin();
                let x = [at(0.7, 3.0), at(1.3, 8.0), at(2.1, 2.0)];
                let push = wall.push(&x);
                if wall.distance(&x) >= 0.0 {
                    assert_eq!(push, [0.0; 3]);
                    continue;
                }
                inside += 1;
                let y = [0, 1, 2].map(|d| x[d] + push[d]);
                assert!(wall.distance(&y).abs() < 1e-12, "{wall:?}: {x:?} -> {y:?}: {}", wall.distance(&y));
            }
        }
        assert!(inside > 500, "{inside}");
    }
}
