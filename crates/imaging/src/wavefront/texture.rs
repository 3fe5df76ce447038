//! Structure and texture of images, by the model of Rudin, Osher and Fatemi.

use super::plane::Plane;

/// theta, iterations and the part of the structure that is taken out, as in the reference settings.
const THETA: f64 = 0.125;
const ITERATIONS: usize = 20;
const REMOVED: f64 = 0.95;

/// I - 0.95 S, S the structure of an image with values in [-1, 1]: an approximation of
///
/// ```text
/// argmin over S   sum |grad S| + 1/(2 theta) |S - I|^2,   theta = 1/8,
/// ```
///
/// by 20 steps p <- (p + grad(S)/(4 theta)) / max(1, |.|), S = I + theta div p (Chambolle 2004; Wedel et al. 2009, whose way
/// it is to make images of unlike light comparable).
pub fn texture(image: &Plane) -> Plane {
    let (w, h) = (image.width, image.height);
    let mut along = Plane::from_fn(w, h, |_, _| 0.0);
    let mut down = along.clone();
    let mut structure = image.clone();
    for _ in 0..ITERATIONS {
        let step = 1.0 / (4.0 * THETA);
        let difference = |i: usize, j: usize| {
            let (i, j) = (i as isize, j as isize);
            let own = structure.at(i, j);
            // 0 across the border, where the neighbour is the pixel itself.
            [structure.at(i, j + 1) - own, structure.at(i + 1, j) - own]
        };
        let moved = |i: usize, j: usize| {
            let (d, k) = (difference(i, j), i * w + j);
            let p = [along.values[k] + step * d[0], down.values[k] + step * d[1]];
            let size = p[0].hypot(p[1]).max(1.0);
            [p[0] / size, p[1] / size]
        };
        let (a, d) = (Plane::from_fn(w, h, |i, j| moved(i, j)[0]), Plane::from_fn(w, h, |i, j| moved(i, j)[1]));
        (along, down) = (a, d);
        structure = Plane::from_fn(w, h, |i, j| {
            let k = i * w + j;
            let left = if j > 0 { along.values[k - 1] } else { 0.0 };
            let above = if i > 0 { down.values[k - w] } else { 0.0 };
            // At the last row and column p is 0: the difference that it follows is.
            image.values[k] + THETA * ((along.values[k] - left) + (down.values[k] - above))
        });
    }
    Plane::from_fn(w, h, |i, j| image.values[i * w + j] - REMOVED * structure.values[i * w + j])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step and fine stripes: the stripes stay, the step goes.
    #[test]
    fn what_is_fine_stays() {
        let image =
            Plane::from_fn(64, 64, |i, j| if j < 32 { -0.5 } else { 0.5 } + if i % 2 == 0 { 0.1 } else { -0.1 });
        let t = texture(&image);
        let (mut step, mut stripe) = (0.0, 0.0);
        for i in 20..44 {
            step += (t.at(i, 48) - t.at(i, 16)) / 24.0;
            stripe += (t.at(i, 16) * if i % 2 == 0 { 1.0 } else { -1.0 }) / 24.0;
        }
        assert!(step < 0.1, "{step} of 1");
        assert!(stripe > 0.08, "{stripe} of 0.1");
    }

    /// S is a descent of the objective from I.
    #[test]
    fn the_structure_lowers_the_objective() {
        let image = Plane::from_fn(20, 20, |i, j| ((i * 7 + j * j) as f64).sin());
        let t = texture(&image);
        let structure = Plane::from_fn(20, 20, |i, j| {
            let k = i * 20 + j;
            (image.values[k] - t.values[k]) / REMOVED
        });
        let objective = |s: &Plane| {
            let mut sum = 0.0;
            for i in 0..20 {
                for j in 0..20 {
                    let (a, b) = (s.at(i, j + 1) - s.at(i, j), s.at(i + 1, j) - s.at(i, j));
                    sum += a.hypot(b) + (s.at(i, j) - image.at(i, j)).powi(2) / (2.0 * THETA);
                }
            }
            sum
        };
        assert!(objective(&structure) < 0.7 * objective(&image));
    }
}
