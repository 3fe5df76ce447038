//! Contact as an augmented Lagrangian: what a Newton method on smooth functions makes of points in front of planes.

mod corner;

use crate::points::Points;
use corner::Corner;
use proxel_split::Potential;
use std::sync::Arc;

/// A point in front of a plane, n . c >= h, with what is known of the force between them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touch {
    /// The point.
    pub point: u32,
    /// What it touches; a label that nothing here looks at.
    pub other: u32,
    /// The patch of that; another such label.
    pub patch: u32,
    /// The unit normal n, to where the point may be.
    pub normal: [f64; 3],
    /// h
    pub height: f64,
    /// The multiplier: an estimate of the force along n, 0 or more.
    pub force: f64,
    /// The most that friction can bear: its coefficient times the force along n, as it was estimated before.
    pub grip: f64,
    /// Where the point would be had it stuck to the other body.
    pub anchor: [f64; 3],
}

/// The augmented Lagrangian of the constraints that points c = sum_i w_i x_i are in the intersection P of the
/// half-spaces n_t . c >= h_t of their touches t, with friction that has its normal forces from before:
///
/// ```text
/// k dist(c - f / k, P)^2 / 2  -  |f|^2 / (2 k),   f = sum_t f_t n_t, for each point
/// grip_t phi(|T_t (c_t - anchor_t)|),   T = 1 - n n^T,   for each touch
/// phi(s) = s^2 / (2 e) for s <= e, else s - e / 2
/// ```
///
/// k is a stiffness of each point and f_t the multipliers. For one plane the first is
/// (max(0, f - k g)^2 - f^2) / (2 k) with the gap g = n . c - h. It is convex, and once continuously differentiable; with
/// p the point of P nearest to c - f / k, where its minimum is, k (p - c) + f is a better estimate of the force
/// (Hestenes 1969, Powell 1969). That has the rate of a single plane however flat a hollow is: with a square for each of
/// two planes a small angle apart multipliers would take 1 / angle^2 times as many rounds. Minimising it with Newton's
/// method is an active-set strategy: a constraint is in the Hessian while p is held by it, and is dropped where its
/// multiplier would pull (Hintermueller, Ito and Kunisch 2002). phi is Coulomb's law but for slips below e, which stick
/// elastically. Where half-spaces have nothing in common, each has its own square.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    points: Arc<Points>,
    stiffness: Arc<[f64]>, // k of each point
    slip: Arc<[f64]>,      // e of each point
    touches: Vec<Touch>,   // by points, ascending
}

impl Contacts {
    /// Without touches; a stiffness k and a length e for each point.
    pub fn new(points: Arc<Points>, stiffness: Arc<[f64]>, slip: Arc<[f64]>) -> Self {
        Contacts { points, stiffness, slip, touches: Vec::new() }
    }

    /// The same points with other touches, in any order.
    #[must_use]
    pub fn with(&self, mut touches: Vec<Touch>) -> Self {
        touches.sort_by_key(|t| t.point);
        Contacts { touches, ..self.clone() }
    }

    /// The touches, by points ascending.
    pub fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// The points that could touch something.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// The force along the normal of a touch, 0 or more: k l where p - (c - f / k) is the sum of l n over the
    /// planes of its point.
    pub fn pressure(&self, touch: &Touch, x: &[f64]) -> f64 {
        let from = self.touches.partition_point(|t| t.point < touch.point);
        let to = self.touches.partition_point(|t| t.point <= touch.point);
        let all = self.touches.get(from..to).unwrap_or(&[]);
        let (k, c) = (self.stiffness[touch.point as usize], self.points.at(touch.point as usize, x));
        match all.iter().position(|t| t == touch) {
            Some(place) => Push::of(all, k, c).along(all, place, k, c),
            None => (touch.force - k * gap(touch, c)).max(0.0),
        }
    }

    /// n . c - h of a touch: how far its point is in front of the plane.
    pub fn gap(&self, touch: &Touch, x: &[f64]) -> f64 {
        gap(touch, self.points.at(touch.point as usize, x))
    }

    /// The force on the point of a touch, friction included.
    pub fn force(&self, touch: &Touch, x: &[f64]) -> [f64; 3] {
        let along = self.pressure(touch, x);
        let rub = Rub::of(touch, self.points.at(touch.point as usize, x), self.slip[touch.point as usize]);
        [0, 1, 2].map(|d| along * touch.normal[d] - rub.pull * rub.slip[d])
    }

    /// The touches of each point that has some.
    fn of_points(&self) -> impl Iterator<Item = &[Touch]> {
        self.touches.chunk_by(|a, b| a.point == b.point)
    }

    /// The second derivatives by the place of a point.
    fn block(&self, touches: &[Touch], x: &[f64]) -> [[f64; 3]; 3] {
        let Some(first) = touches.first() else { return [[0.0; 3]; 3] };
        let k = first.point as usize;
        let c: [f64; 3] = self.points.at(k, x);
        let mut block = Push::of(touches, self.stiffness[k], c).block(touches, self.stiffness[k], c);
        for touch in touches {
            let n = touch.normal;
            let rub = Rub::of(touch, c, self.slip[k]);
            for i in 0..3 {
                for j in 0..3 {
                    let tangent = f64::from(u8::from(i == j)) - n[i] * n[j];
                    block[i][j] += rub.pull * (tangent - rub.along[i] * rub.along[j]);
                }
            }
        }
        block
    }
}

/// n . c - h
fn gap(touch: &Touch, c: [f64; 3]) -> f64 {
    (0..3).map(|d| touch.normal[d] * c[d]).sum::<f64>() - touch.height
}

/// What planes do to a point.
enum Push {
    /// They have room for it.
    To(Corner),
    /// They have nothing in common: each does for itself.
    Each,
}

impl Push {
    fn of(touches: &[Touch], k: f64, c: [f64; 3]) -> Push {
        let mut y = c;
        for touch in touches {
            (0..3).for_each(|d| y[d] -= touch.force / k * touch.normal[d]);
        }
        Corner::nearest(touches, y).map_or(Push::Each, Push::To)
    }

    /// The force along the normal of a touch.
    fn along(&self, touches: &[Touch], place: usize, k: f64, c: [f64; 3]) -> f64 {
        match self {
            Push::To(corner) => k * corner.of(place),
            Push::Each => touches.get(place).map_or(0.0, |t| (t.force - k * gap(t, c)).max(0.0)),
        }
    }

    /// The augmented Lagrangian without friction, and the force.
    fn value_and_force(&self, touches: &[Touch], k: f64, c: [f64; 3]) -> (f64, [f64; 3]) {
        // (a^2 - f^2) / 2k as a product, which does not cancel near a = f.
        match self {
            Push::To(corner) => {
                let a = corner.shift(touches).map(|s| k * s);
                let mut f = [0.0; 3];
                for touch in touches {
                    (0..3).for_each(|d| f[d] += touch.force * touch.normal[d]);
                }
                ((0..3).map(|d| (a[d] - f[d]) * (a[d] + f[d])).sum::<f64>() / (2.0 * k), a)
            }
            Push::Each => {
                let (mut value, mut force) = (0.0, [0.0; 3]);
                for (place, touch) in touches.iter().enumerate() {
                    let a = self.along(touches, place, k, c);
                    value += (a - touch.force) * (a + touch.force) / (2.0 * k);
                    (0..3).for_each(|d| force[d] += a * touch.normal[d]);
                }
                (value, force)
            }
        }
    }

    /// Minus the derivative of the force.
    fn block(&self, touches: &[Touch], k: f64, c: [f64; 3]) -> [[f64; 3]; 3] {
        match self {
            Push::To(corner) => corner.block(touches).map(|row| row.map(|v| k * v)),
            Push::Each => {
                let mut block = [[0.0; 3]; 3];
                for touch in touches.iter().filter(|t| t.force - k * gap(t, c) > 0.0) {
                    let n = touch.normal;
                    (0..3).for_each(|i| (0..3).for_each(|j| block[i][j] += k * (n[i] * n[j])));
                }
                block
            }
        }
    }
}

/// Friction at a point.
struct Rub {
    slip: [f64; 3],  // T (c - anchor)
    length: f64,     // of that
    pull: f64,       // grip phi'(length) / length
    along: [f64; 3], // the direction of the slip where it slides, else 0
}

impl Rub {
    fn of(touch: &Touch, c: [f64; 3], e: f64) -> Rub {
        let n = touch.normal;
        let moved = [0, 1, 2].map(|d| c[d] - touch.anchor[d]);
        let along_n = (0..3).map(|d| n[d] * moved[d]).sum::<f64>();
        let slip = [0, 1, 2].map(|d| moved[d] - along_n * n[d]);
        let length = slip.iter().map(|s| s * s).sum::<f64>().sqrt();
        if touch.grip <= 0.0 {
            return Rub { slip, length, pull: 0.0, along: [0.0; 3] };
        }
        let along = if length > e { slip.map(|s| s / length) } else { [0.0; 3] };
        Rub { slip, length, pull: touch.grip / length.max(e), along }
    }

    /// grip phi(length)
    fn value(&self, touch: &Touch, e: f64) -> f64 {
        match () {
            () if touch.grip <= 0.0 => 0.0,
            () if self.length <= e => touch.grip * self.length * self.length / (2.0 * e),
            () => touch.grip * (self.length - 0.5 * e),
        }
    }
}

impl Potential for Contacts {
    fn value_and_gradient(&self, x: &[f64], mut grad: Option<&mut [f64]>) -> f64 {
        let mut value = 0.0;
        for touches in self.of_points() {
            let Some(first) = touches.first() else { continue };
            let k = first.point as usize;
            let c: [f64; 3] = self.points.at(k, x);
            let (pushed, force) =
                Push::of(touches, self.stiffness[k], c).value_and_force(touches, self.stiffness[k], c);
            value += pushed;
            let mut g = force.map(|f| -f);
            for touch in touches {
                let rub = Rub::of(touch, c, self.slip[k]);
                value += rub.value(touch, self.slip[k]);
                (0..3).for_each(|d| g[d] += rub.pull * rub.slip[d]);
            }
            if let Some(grad) = grad.as_deref_mut() {
                self.points.spread(k, g, grad);
            }
        }
        value
    }

    fn n(&self) -> usize {
        self.points.n()
    }

    fn has_hessian(&self) -> bool {
        true
    }

    fn is_convex(&self) -> bool {
        true
    }

    /// Of all points, those that touch nothing included: which do changes from one x to the next.
    fn for_each_block(&self, x: &[f64], give: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        let mut touching = self.of_points().peekable();
        for k in 0..self.points.len() {
            let touches = touching.next_if(|t| t[0].point as usize == k);
            let block = touches.map_or([[0.0; 3]; 3], |touches| self.block(touches, x));
            let (nodes, weights) = self.points.parts(k);
            for (a, wa) in nodes.iter().zip(weights) {
                for (b, wb) in nodes.iter().zip(weights).filter(|(b, _)| *b <= a) {
                    give(*a as usize, *b as usize, block.map(|row| row.map(|v| wa * wb * v)));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contacts() -> (Contacts, Vec<f64>) {
        let mut points = Points::of_nodes(vec![0, 1]);
        points.push(&[0, 1, 2, 3], &[0.1, 0.2, 0.3, 0.4]);
        let tilted = [0.6, 0.8, 0.0];
        let touch = |point, force, grip, height| Touch {
            point,
            other: 0,
            patch: 0,
            normal: tilted,
            height,
            force,
            grip,
            anchor: [0.1, -0.2, 0.05],
        };
        let touches = vec![
            touch(2, 1.0, 0.7, 0.3),  // pressed, slides
            touch(0, 0.2, 0.5, -0.2), // pressed
            touch(0, 0.0, 0.0, 5.0),  // a second plane, deep
            touch(1, 0.0, 0.3, -9.0), // far away, only rubs
        ];
        let x = vec![0.11, -0.19, 0.06, 0.5, 0.1, -0.4, 0.3, -0.2, 0.9, -0.6, 0.2, 0.1];
        (Contacts::new(Arc::new(points), vec![3.0, 5.0, 7.0].into(), vec![0.1, 0.02, 0.03].into()).with(touches), x)
    }

    #[test]
    fn gradient_and_blocks_are_the_derivatives() {
        let (contacts, x) = contacts();
        let (h, n) = (1e-6, x.len());
        let gradient = |x: &[f64]| {
            let mut g = vec![0.0; n];
            contacts.value_and_gradient(x, Some(&mut g));
            g
        };
        let g = gradient(&x);
        let mut hessian = vec![vec![0.0; n]; n];
        contacts.for_each_block(&x, &mut |i, j, block| {
            assert!(i >= j);
            for r in 0..3 {
                for c in 0..3 {
                    hessian[3 * i + r][3 * j + c] += block[r][c];
                    if i != j {
                        hessian[3 * j + c][3 * i + r] += block[r][c];
                    }
                }
            }
        });
        for a in 0..n {
            let at = |t: f64| {
                let mut y = x.clone();
                y[a] += t;
                y
            };
            let slope =
                (contacts.value_and_gradient(&at(h), None) - contacts.value_and_gradient(&at(-h), None)) / (2.0 * h);
            assert!((slope - g[a]).abs() < 1e-7, "{a}: {slope} {}", g[a]);
            let (more, less) = (gradient(&at(h)), gradient(&at(-h)));
            for b in 0..n {
                let second = (more[b] - less[b]) / (2.0 * h);
                assert!((second - hessian[b][a]).abs() < 1e-6, "{b} {a}: {second} {}", hessian[b][a]);
            }
        }
    }

    /// Multipliers of a point that a force presses into a hollow of two faces, on a spring of stiffness 1.
    #[test]
    fn multipliers_settle_in_hollows_however_flat() {
        for angle in [1.0, 0.1, 1e-2, 1e-3] {
            let (sine, cosine) = f64::sin_cos(angle);
            let touch = |sine: f64| Touch { normal: [sine, cosine, 0.0], ..Touch::default() };
            let k = 100.0;
            let none = Contacts::new(Arc::new(Points::of_nodes(vec![0])), vec![k].into(), vec![0.1].into());
            let (mut touches, mut x) = (vec![touch(sine), touch(-sine)], vec![0.3 * angle, 0.2, 0.1]);
            let target = [0.4 * angle, -1.0, 0.1];
            for _ in 0..8 {
                let contacts = none.with(touches.clone());
                for _ in 0..10 {
                    // Newton on |x - target|^2 / 2 and contact; the third coordinate is free.
                    let mut g: Vec<f64> = (0..3).map(|d| x[d] - target[d]).collect();
                    contacts.value_and_gradient(&x, Some(&mut g));
                    let mut h = [[0.0; 3]; 3];
                    contacts.for_each_block(&x, &mut |_, _, block| h = block);
                    let (a, b, c, d) = (h[0][0] + 1.0, h[0][1], h[1][0], h[1][1] + 1.0);
                    let det = a * d - b * c;
                    x[0] -= (d * g[0] - b * g[1]) / det;
                    x[1] -= (a * g[1] - c * g[0]) / det;
                    x[2] -= g[2];
                }
                let forces: Vec<f64> = touches.iter().map(|t| contacts.pressure(&find(&contacts, t), &x)).collect();
                touches.iter_mut().zip(forces).for_each(|(t, force)| t.force = force);
            }
            // It rests in the foot of the hollow, and both faces push.
            assert!(x[0].abs() < 1e-12 && x[1].abs() < 1e-12, "{angle}: {x:?}");
            let (push, tilt) = (1.0 / (2.0 * cosine), -0.4 * angle / (2.0 * sine));
            assert!((touches[0].force - (push + tilt)).abs() < 1e-8, "{angle}: {touches:?}");
            assert!((touches[1].force - (push - tilt)).abs() < 1e-8, "{angle}: {touches:?}");
        }
    }

    /// The touch of this normal.
    fn find(contacts: &Contacts, touch: &Touch) -> Touch {
        *contacts.touches().iter().find(|t| t.normal == touch.normal).unwrap()
    }

    #[test]
    fn forces_are_what_the_gradient_says() {
        let (contacts, x) = contacts();
        let mut g = vec![0.0; x.len()];
        contacts.value_and_gradient(&x, Some(&mut g));
        for touch in contacts.touches() {
            let force = contacts.force(touch, &x);
            contacts.points().spread(touch.point as usize, force, &mut g);
        }
        // Forces are up to 30 N here.
        assert!(g.iter().all(|g| g.abs() < 1e-14), "{g:?}");
        let free = contacts.with(vec![Touch { point: 1, normal: [0.0, 1.0, 0.0], height: -1.0, ..Touch::default() }]);
        assert_eq!(free.pressure(&free.touches()[0], &x), 0.0);
        assert_eq!(free.value_and_gradient(&x, None), 0.0);
    }
}
