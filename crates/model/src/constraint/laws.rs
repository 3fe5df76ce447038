//! What every set has to obey, for tests: nearest points against brute force, the same after a motion, rows against
//! differences and against the set, and an end of ADMM in it.

use super::*;
use proxel_split::{Admm, AdmmSettings, Direct, Method, Problem, Quadratic};
use proxel_testkit::random::SplitMix;
use std::sync::Arc;

/// x -> s R x + t
pub struct Motion {
    pub scale: f64,
    pub rotation: [V3; 3],
    pub offset: V3,
}

impl Motion {
    const NONE: Motion =
        Motion { scale: 1.0, rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], offset: [0.0; 3] };

    pub fn direction(&self, v: V3) -> V3 {
        scale(self.scale, self.rotation.map(|row| dot(row, v)))
    }

    pub fn point(&self, x: V3) -> V3 {
        add(self.direction(x), 1.0, self.offset)
    }
}

pub fn small_rotation(random: &mut SplitMix, angle: f64) -> [V3; 3] {
    let [x, y, z]: V3 = random.array(-angle, angle);
    proxel_linalg::svd::rotation_from_quaternion({
        let length = (1.0 + x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length, 1.0 / length]
    })
}

fn distance(a: &[V3], b: &[V3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(sub(*a, *b), sub(*a, *b))).sum::<f64>().sqrt()
}

fn reduced<R: Reduction>(x: &[V3]) -> Vec<V3> {
    let nodes: Vec<u32> = (0..x.len() as u32).collect();
    let mut v = vec![[0.0; 3]; R::rows(x.len()).expect("as many corners as the set is for")];
    R::reduce(x, &nodes, &mut v);
    v
}

fn projected(set: &impl Set, v: &[V3]) -> Vec<V3> {
    let mut z = v.to_vec();
    set.project(0, &mut z);
    z
}

/// Values and gradients by rows; of inequalities those that do not hold.
fn rows(set: &impl Set, v: &[V3]) -> Vec<(f64, Vec<V3>)> {
    let mut out = Vec::new();
    set.linearize(0, v, f64::INFINITY, &mut |row| {
        if row.relation == Relation::Zero || row.value > 0.0 {
            out.push((row.value, row.gradient.to_vec()));
        }
    });
    out
}

/// All laws. `make` is the set after a motion, `member` makes rows of it from any rows, without the projection; it should
/// sometimes be near to them.
pub fn check<R: Reduction, S: Set + 'static>(
    corners: usize,
    make: impl Fn(&Motion) -> S,
    member: impl Fn(&[V3], &mut SplitMix) -> Vec<V3>,
) {
    let (set, mut random) = (make(&Motion::NONE), SplitMix::new(7));
    let any = |random: &mut SplitMix| (0..corners).map(|_| random.array(-1.0, 1.0)).collect::<Vec<V3>>();
    for _ in 0..40 {
        let x = any(&mut random);
        nearest(&set, &reduced::<R>(&x), &member, &mut random);
    }
    check_from::<R, S>(corners, make, any);
}

/// All laws but those of members, from corners of some kind.
pub fn check_from<R: Reduction, S: Set + 'static>(
    corners: usize,
    make: impl Fn(&Motion) -> S,
    any: impl Fn(&mut SplitMix) -> Vec<V3>,
) {
    let (set, mut random) = (make(&Motion::NONE), SplitMix::new(17));
    for _ in 0..40 {
        let x = any(&mut random);
        moves_along::<R, S>(&set, &make, &x, &mut random);
        linear(&set, &reduced::<R>(&x), &mut random, |v| reduced_again::<R>(v, corners));
    }
    let outside = (0..50).map(|_| any(&mut random)).find(|x| set.violation(0, &reduced::<R>(x)) > 1e-2);
    ends_in_it::<R, S>(set, corners, &outside.expect("corners that are not in the set"));
}

/// A direction that the reduction has, from any rows.
fn reduced_again<R: Reduction>(v: &[V3], corners: usize) -> Vec<V3> {
    let mut x = v.to_vec();
    x.resize(corners, [0.0; 3]);
    reduced::<R>(&x)
}

/// Slow twin: of many members, around the nearest point too, none is nearer; a member stays.
fn nearest(set: &impl Set, v: &[V3], member: &impl Fn(&[V3], &mut SplitMix) -> Vec<V3>, random: &mut SplitMix) {
    let z = projected(set, v);
    assert!(set.violation(0, &z) < 1e-12, "{v:?} {z:?} {}", set.violation(0, &z));
    let least = distance(v, &z);
    for spread in [1.0, 0.1, 1e-2, 1e-3] {
        for _ in 0..60 {
            let near: Vec<V3> = z.iter().map(|z| add(*z, spread, random.array(-1.0, 1.0))).collect();
            let other = member(&near, random);
            assert!(set.violation(0, &other) < 1e-9, "not a member: {other:?} {}", set.violation(0, &other));
            assert!(projected(set, &other).iter().zip(&other).all(|(a, b)| norm(sub(*a, *b)) < 1e-9));
            assert!(distance(v, &other) > least - 1e-9, "{v:?}: {z:?} is farther than {other:?}");
        }
    }
    assert!(distance(&z, &projected(set, &z)) < 1e-12, "a point of the set stays");
}

/// P(s R v) = s R P(v) for the set that was moved along, and positions far away.
fn moves_along<R: Reduction, S: Set>(set: &S, make: &impl Fn(&Motion) -> S, x: &[V3], random: &mut SplitMix) {
    let (v, z) = (reduced::<R>(x), projected(set, &reduced::<R>(x)));
    for size in [1.0, 1e-6, 1e8] {
        let rotation = random.rotation();
        let motion = Motion { scale: size, rotation, offset: random.array(-10.0 * size, 10.0 * size) };
        let moved: Vec<V3> = x.iter().map(|x| motion.point(*x)).collect();
        let there = projected(&make(&motion), &reduced::<R>(&moved));
        // Ways are what both have.
        let ways = |v: &[V3], z: &[V3]| v.iter().zip(z).map(|(v, z)| sub(*z, *v)).collect::<Vec<V3>>();
        let wanted: Vec<V3> = ways(&v, &z).into_iter().map(|way| motion.direction(way)).collect();
        let off = distance(&ways(&reduced::<R>(&moved), &there), &wanted);
        assert!(off < 1e-9 * size, "{size} {x:?}: {off}");
    }
}

/// Around a member z rows are derivatives of their values, and lead to the set and to the nearest point of it, up to squares:
/// v - J^+ c(v) = P(v) + O(|v - z|^2).
fn linear(set: &impl Set, v: &[V3], random: &mut SplitMix, direction: impl Fn(&[V3]) -> Vec<V3>) {
    let z = projected(set, v);
    let along: Vec<V3> = z.iter().map(|_| random.array(-1.0, 1.0)).collect();
    let along = direction(&along);
    let at = |h: f64| z.iter().zip(&along).map(|(z, a)| add(*z, h, *a)).collect::<Vec<V3>>();
    let length = |of: &mut dyn Iterator<Item = f64>| of.map(|c| c * c).sum::<f64>().sqrt();
    let here = rows(set, &z);
    assert!(length(&mut here.iter().map(|r| r.0)) < 1e-12, "rows vanish in the set");
    let h = 1e-5;
    // On both sides, one of which inequalities may hold on.
    for h in [h, -h] {
        let there = rows(set, &at(h));
        let slope = length(&mut there.iter().map(|r| r.1.iter().zip(&along).map(|(g, a)| dot(*g, *a)).sum()));
        let found = length(&mut there.iter().map(|r| r.0)) / h.abs();
        assert!((found - slope).abs() < 1e-3 * (1.0 + slope), "{found} {slope}");
    }
    let off = |h: f64| {
        let v = at(h);
        distance(&newton(&v, &rows(set, &v)), &projected(set, &v))
    };
    // Quarters of h leave sixteenths, or rounding; one of several starts may be near to where the set has a corner.
    let (far, near) = (off(1e-3), off(2.5e-4));
    assert!(near < 0.1 * far + 1e-11, "{far} {near} {z:?} {along:?}");
}

/// v - J^T y with (J J^T) y = c, by conjugate gradients.
fn newton(v: &[V3], rows: &[(f64, Vec<V3>)]) -> Vec<V3> {
    let back = |y: &[f64]| {
        let mut out = vec![[0.0; 3]; v.len()];
        for (y, (_, g)) in y.iter().zip(rows) {
            out.iter_mut().zip(g).for_each(|(o, g)| *o = add(*o, *y, *g));
        }
        out
    };
    let times = |d: &[V3]| rows.iter().map(|(_, g)| g.iter().zip(d).map(|(g, d)| dot(*g, *d)).sum()).collect();
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut y = vec![0.0; rows.len()];
    let mut r: Vec<f64> = rows.iter().map(|r| r.0).collect();
    let mut p = r.clone();
    let start = product(&r, &r);
    let mut squared = start;
    for _ in 0..4 * rows.len() {
        if !(squared > 1e-30 * start) {
            break;
        }
        let ap: Vec<f64> = times(&back(&p));
        let step = squared / product(&p, &ap);
        y.iter_mut().zip(&p).for_each(|(y, p)| *y += step * p);
        r.iter_mut().zip(&ap).for_each(|(r, ap)| *r -= step * ap);
        let next = product(&r, &r);
        p.iter_mut().zip(&r).for_each(|(p, r)| *p = r + next / squared * *p);
        squared = next;
    }
    v.iter().zip(back(&y)).map(|(v, d)| sub(*v, d)).collect()
}

/// Three elements in a chain, each with a vertex of the one before, near to where they come from: ADMM ends in the set, and
/// with little residuals.
fn ends_in_it<R: Reduction, S: Set + 'static>(set: S, corners: usize, start: &[V3]) {
    let step = corners.saturating_sub(1).max(1);
    let nodes: Vec<u32> = (0..3).flat_map(|e| (0..corners).map(move |k| (e * step + k) as u32)).collect();
    let n = 2 * step + corners;
    // The first element as given, the others likewise, from where the one before ends.
    let mut x0 = vec![0.0; 3 * n];
    let mut from = start[0];
    for e in 0..3 {
        for (k, x) in start.iter().enumerate() {
            let at = 3 * (e * step + k);
            x0[at..at + 3].copy_from_slice(&add(sub(*x, start[0]), 1.0, from));
        }
        from = add(sub(start[corners - 1], start[0]), 1.0, from);
    }
    let springs = x0.as_chunks::<3>().0.iter().enumerate().map(|(i, x)| (i as u32, 1.0, *x)).collect();
    let cells = Arc::new(Cells::<R, S>::new(nodes, corners, set).unwrap());
    let before = cells.violation(x0.as_chunks().0);
    let term = Box::new(Batch::new(cells.clone(), Hold::Hard(3.0)));
    let quadratic = Quadratic { springs, ..Quadratic::default() };
    let problem = Problem { dim: 3, n_free: n, x0, terms: vec![term], quadratic, barrier: false };
    let settings =
        AdmmSettings { name: "test".to_string(), global: Box::new(Direct), reweighting: None, renewed_at: None };
    let mut admm = Admm::new(problem, settings).unwrap();
    for _ in 0..3000 {
        admm.step().unwrap();
        if cells.violation(admm.x().as_chunks().0) < 1e-9 {
            break;
        }
    }
    let after = cells.violation(admm.x().as_chunks().0);
    assert!(before > 1e-2 && after < 1e-9, "{before} {after}");
}

/// Corners that no shape can be fitted to: all in one point, all at the origin, on a line, all but one in a point, very
/// long, and very short.
pub fn degenerate(k: usize) -> Vec<Vec<V3>> {
    let line = (0..k).map(|i| [i as f64, 2.0 * i as f64, -(i as f64)]).collect();
    let mut one = vec![[0.0; 3]; k];
    one[k - 1] = [0.3, 0.0, 0.0];
    let mut random = SplitMix::new(1);
    let any: Vec<V3> = (0..k).map(|_| random.array(-1.0, 1.0)).collect();
    let times = |s: f64| any.iter().map(|v| scale(s, *v)).collect();
    vec![vec![[1.0, 2.0, 3.0]; k], vec![[0.0; 3]; k], line, one, times(1e100), times(1e-100)]
}

/// Nearest point, violation and rows are numbers, and the nearest point is in the set.
pub fn finite(set: &impl Set, v: &[V3]) {
    let z = projected(set, v);
    let size = v.iter().chain(&z).flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
    assert!(z.as_flattened().iter().all(|c| c.is_finite()), "{v:?}: {z:?}");
    assert!(set.violation(0, v).is_finite() && set.violation(0, &z) <= 1e-12 * size.max(1.0), "{v:?}");
    for (value, gradient) in rows(set, v) {
        assert!(value.is_finite() && gradient.as_flattened().iter().all(|g| g.is_finite()), "{v:?}");
    }
}
