//! Shapes that are given: up to a rigid motion, or up to a similarity.

use super::complement::complement;
use super::{BestPlane, Relation, Row, Set, V3, add, cross, dot, largest, norm, scale, sub};
use proxel_linalg::svd::{rotation, svd3};

/// Shapes of elements with as many corners each, mean-centred: the same for all, or one each.
#[derive(Clone, Debug)]
pub struct Template {
    points: Vec<V3>,
    corners: usize,
}

/// Points that are no shapes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TemplateError(pub String);

impl std::fmt::Display for TemplateError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for TemplateError {}

impl Template {
    /// Of shapes with `corners` points each, one after another: one for all elements, or one for each.
    ///
    /// # Errors
    /// Points that are no whole number of shapes, a shape whose points coincide, numbers that are not finite.
    pub fn new(mut points: Vec<V3>, corners: usize) -> Result<Self, TemplateError> {
        if corners == 0 || points.is_empty() || !points.len().is_multiple_of(corners) {
            return Err(TemplateError(format!("{} points are no shapes of {corners} corners each", points.len())));
        }
        for (e, shape) in points.chunks_exact_mut(corners).enumerate() {
            let first = shape[0];
            shape.iter_mut().for_each(|p| *p = sub(*p, first));
            let mean = scale(1.0 / corners as f64, shape.iter().fold([0.0; 3], |s, p| add(s, 1.0, *p)));
            shape.iter_mut().for_each(|p| *p = sub(*p, mean));
            let size = shape.iter().flatten().fold(0.0_f64, |m, c| if c.abs() <= m { m } else { c.abs() });
            if !(size > 0.0 && size.is_finite()) {
                let text = format!("shape {e} (0-based) has no extent, or numbers that are not finite; give it one");
                return Err(TemplateError(text));
            }
        }
        Ok(Template { points, corners })
    }

    fn of(&self, e: usize) -> &[V3] {
        self.points.get(e * self.corners..(e + 1) * self.corners).unwrap_or(&self.points[..self.corners])
    }

    /// The best rotation R and scale s of a shape to v, which minimise sum |v_i - s R t_i|^2.
    fn fit(shape: &[V3], v: &[V3], scaled: bool) -> Fit {
        // Both scaled, so that products neither vanish nor overflow.
        let size = |of: &[V3]| of.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        let inverse = |size: f64| if size > 0.0 && size.is_finite() { 1.0 / size } else { 1.0 };
        let (by_t, by_v) = (inverse(size(shape)), inverse(size(v)));
        let (mut h, mut squares) = ([[0.0; 3]; 3], 0.0);
        for (t, v) in shape.iter().zip(v) {
            let (t, v) = (scale(by_t, *t), scale(by_v, *v));
            squares += dot(t, t);
            for i in 0..3 {
                for j in 0..3 {
                    h[i][j] += v[i] * t[j];
                }
            }
        }
        let svd = svd3(h);
        // The last stretch has the sign of det H: where only a reflection would fit better, it is taken off.
        let size = if scaled { svd.s.iter().sum::<f64>() / squares * by_t / by_v } else { 1.0 };
        Fit { rotation: rotation(&svd), size }
    }

    fn project(&self, e: usize, v: &mut [V3], scaled: bool) {
        let shape = self.of(e);
        if v.len() == shape.len() {
            let fit = Self::fit(shape, v, scaled);
            v.iter_mut().zip(shape).for_each(|(v, t)| *v = fit.point(*t));
        }
    }

    fn violation(&self, e: usize, v: &[V3], scaled: bool) -> f64 {
        let shape = self.of(e);
        if v.len() != shape.len() {
            return 0.0;
        }
        let fit = Self::fit(shape, v, scaled);
        largest(v.iter().zip(shape).map(|(v, t)| norm(sub(*v, fit.point(*t)))))
    }

    /// N^T (v - s R t) = 0, N an orthonormal basis of what is orthogonal to all translations, to rotations of R t about its
    /// principal axes, and to R t itself where it may be scaled.
    fn linearize(&self, e: usize, v: &[V3], scaled: bool, row: &mut dyn FnMut(Row<'_>)) {
        let shape = self.of(e);
        if v.len() != shape.len() {
            return;
        }
        let fit = Self::fit(shape, v, scaled);
        let turned: Vec<V3> = shape.iter().map(|t| fit.turned(*t)).collect();
        let off: Vec<V3> = v.iter().zip(shape).map(|(v, t)| sub(*v, fit.point(*t))).collect();
        let size = norm(turned.iter().fold([0.0; 3], |m, t| [0, 1, 2].map(|d| m[d].max(t[d].abs()))));
        let flat = |of: &dyn Fn(V3) -> V3| turned.iter().flat_map(|t| of(*t)).collect::<Vec<f64>>();
        let axes = [0, 1, 2].map(|d| [0, 1, 2].map(|c| if c == d { size } else { 0.0 }));
        let mut tangents: Vec<Vec<f64>> = axes.iter().map(|axis| flat(&|_| *axis)).collect();
        let plane = BestPlane::of(&turned);
        for axis in [plane.normal, plane.along[1], plane.along[0]] {
            tangents.push(flat(&|t| cross(axis, t)));
        }
        if scaled {
            tangents.push(flat(&|t| t));
        }
        for n in complement(&tangents) {
            let gradient = n.as_chunks::<3>().0;
            let value = gradient.iter().zip(&off).map(|(n, off)| dot(*n, *off)).sum();
            row(Row { value, relation: Relation::Zero, gradient });
        }
    }
}

/// s R
struct Fit {
    rotation: [[f64; 3]; 3],
    size: f64,
}

impl Fit {
    fn turned(&self, t: V3) -> V3 {
        self.rotation.map(|row| dot(row, t))
    }

    fn point(&self, t: V3) -> V3 {
        scale(self.size, self.turned(t))
    }
}

/// Corners that are a rotated copy of a given shape, of its size and not mirrored.
///
/// The nearest is R t with R = U V^T of the signed decomposition of H = sum v_i t_i^T, a proper rotation (Kabsch 1976;
/// Umeyama 1991; "rigid" of Bouaziz et al. 2012). The violation is the farthest way of a corner, a length. Rows take O(k^2)
/// numbers for k corners: a shape of very many is better cut to overlapping ones of few.
#[derive(Clone, Debug)]
pub struct Rigid(pub Template);

/// Corners that are a rotated and scaled copy of a given shape, not mirrored: as [`Rigid`], with the scale tr(S) / sum
/// |t_i|^2 of Umeyama 1991, S having the sign of det H, so that it is never below 0.
#[derive(Clone, Debug)]
pub struct Similar(pub Template);

impl Set for Rigid {
    fn project(&self, e: usize, v: &mut [V3]) {
        self.0.project(e, v, false);
    }

    fn violation(&self, e: usize, v: &[V3]) -> f64 {
        self.0.violation(e, v, false)
    }

    fn linearize(&self, e: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        self.0.linearize(e, v, false, row);
    }
}

impl Set for Similar {
    fn project(&self, e: usize, v: &mut [V3]) {
        self.0.project(e, v, true);
    }

    fn violation(&self, e: usize, v: &[V3]) -> f64 {
        self.0.violation(e, v, true)
    }

    fn linearize(&self, e: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        self.0.linearize(e, v, true, row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::MeanCentred;
    use crate::constraint::laws::{self, Motion};
    use proxel_testkit::random::SplitMix;

    /// A solid shape, a flat one, one on a line.
    fn shapes() -> [Vec<V3>; 3] {
        let solid = vec![[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [0.3, 1.4, 0.1], [0.2, -0.3, 0.9], [-0.5, 0.1, 0.4]];
        let flat = solid.iter().map(|p| [p[0], p[1], 2.0]).collect();
        [solid, flat, vec![[1.0, 0.5, 0.0], [2.0, 1.0, 0.0], [4.0, 2.0, 0.0]]]
    }

    fn centred(points: &[V3]) -> Vec<V3> {
        let mean = points.iter().fold([0.0; 3], |s, p| add(s, 1.0 / points.len() as f64, *p));
        points.iter().map(|p| sub(*p, mean)).collect()
    }

    #[test]
    fn the_laws_hold() {
        for shape in shapes() {
            let (k, points) = (shape.len(), centred(&shape));
            let turned = |near: &[V3], random: &mut SplitMix, size: f64| -> Vec<V3> {
                // Any rotation, or one near to the best: a frame from two corners of `near`, less a small turn.
                let r = match random.below(2) {
                    0 => random.rotation(),
                    _ => {
                        let best = Template::fit(&points, near, true).rotation;
                        let small = laws::small_rotation(random, 0.1);
                        [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|l| small[i][l] * best[l][j]).sum()))
                    }
                };
                points.iter().map(|t| scale(size, r.map(|row| dot(row, *t)))).collect()
            };
            let rigid =
                |m: &Motion| Rigid(Template::new(shape.iter().map(|p| scale(m.scale, *p)).collect(), k).unwrap());
            laws::check::<MeanCentred, _>(k, rigid, |near, random| turned(near, random, 1.0));
            let similar = |_: &Motion| Similar(Template::new(shape.clone(), k).unwrap());
            laws::check::<MeanCentred, _>(k, similar, |near, random| {
                let size = random.uniform(0.0, 2.0);
                turned(near, random, size)
            });
        }
    }

    #[test]
    fn a_mirror_image_is_not_the_shape() {
        let [solid, flat, _] = shapes();
        let mirrored = |shape: &[V3]| centred(&shape.iter().map(|p| [-p[0], p[1], p[2]]).collect::<Vec<_>>());
        for (shape, is_one) in [(solid, false), (flat, true)] {
            let image = mirrored(&shape);
            let similar = Similar(Template::new(shape.clone(), 5).unwrap());
            let rigid = Rigid(Template::new(shape, 5).unwrap());
            for violation in [similar.violation(0, &image), rigid.violation(0, &image)] {
                // A flat shape can be turned over.
                assert_eq!(violation < 1e-14, is_one, "{violation}");
            }
        }
    }

    #[test]
    fn shapes_of_each_element() {
        let [solid, flat, _] = shapes();
        let both = Template::new([solid.clone(), flat.clone()].concat(), 5).unwrap();
        let rigid = Rigid(both);
        assert!(rigid.violation(0, &centred(&solid)) < 1e-15 && rigid.violation(1, &centred(&flat)) < 1e-15);
        assert!(rigid.violation(1, &centred(&solid)) > 0.1);
    }

    #[test]
    fn points_that_are_no_shape_are_refused() {
        assert!(Template::new(vec![], 3).is_err());
        assert!(Template::new(vec![[0.0; 3]; 4], 0).is_err());
        assert!(
            Template::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], 2).unwrap_err().0.contains("shape 1")
        );
        assert!(Template::new(vec![[0.0; 3], [f64::NAN; 3]], 2).is_err());
        assert!(Template::new(vec![[0.0; 3]; 5], 2).is_err());
    }

    #[test]
    fn bad_corners_give_numbers() {
        for shape in shapes() {
            let k = shape.len();
            for corners in laws::degenerate(k) {
                laws::finite(&Rigid(Template::new(shape.clone(), k).unwrap()), &corners);
                laws::finite(&Similar(Template::new(shape.clone(), k).unwrap()), &corners);
            }
        }
    }
}
