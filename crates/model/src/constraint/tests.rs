use super::*;
use proxel_split::{Cycle, Order, Term};
use proxel_testkit::random::SplitMix;
use std::sync::Arc;

fn rows(random: &mut SplitMix, n: usize, size: f64) -> Vec<V3> {
    (0..n).map(|_| random.array(-size, size)).collect()
}

fn distance2(a: &[V3], b: &[V3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(sub(*a, *b), sub(*a, *b))).sum()
}

/// Slow twin: of many points of the set, random ones and ones around the projection, none is nearer. `member` makes a
/// point of the set of any rows, without the projection.
fn check_projection(set: &impl Set, n: usize, size: f64, member: impl Fn(&[V3], &mut SplitMix) -> Vec<V3>) {
    let mut random = SplitMix::new(7);
    for _ in 0..60 {
        let v = rows(&mut random, n, size);
        let mut z = v.clone();
        set.project(0, &mut z);
        assert!(set.violation(0, &z) < 1e-12, "{v:?} {z:?} {}", set.violation(0, &z));
        let least = distance2(&v, &z);
        for spread in [1.0, 0.1, 1e-2, 1e-3] {
            for _ in 0..60 {
                let near: Vec<V3> = z.iter().map(|z| add(*z, spread * size, random.array(-1.0, 1.0))).collect();
                let other = member(&near, &mut random);
                assert!(set.violation(0, &other) < 1e-9, "not a member: {other:?}");
                assert!(distance2(&v, &other) > least - 1e-9 * size * size, "{v:?}: {z:?} is farther than {other:?}");
            }
        }
        let mut again = z.clone();
        set.project(0, &mut again);
        assert!(distance2(&z, &again) < 1e-24 * size * size, "a point of the set stays");
    }
}

#[test]
fn the_nearest_planar_polygon() {
    for corners in [4, 5, 9] {
        // Any plane through the origin.
        check_projection(&Planar, corners, 2.0, |near, random| {
            let turned = random.rotation();
            let tilt: V3 = random.array(-0.1, 0.1);
            let n = match random.below(2) {
                0 => turned[0],
                _ => add(BestPlane::of(near).normal, 1.0, tilt),
            };
            let n = scale(1.0 / norm(n), n);
            near.iter().map(|v| add(*v, -dot(n, *v), n)).collect()
        });
    }
}

#[test]
fn the_nearest_length() {
    let member = |low: f64, high: f64| {
        move |near: &[V3], random: &mut SplitMix| {
            let length = random.uniform(low, high.max(low * (1.0 + 1e-15)));
            vec![scale(length / norm(near[0]), near[0])]
        }
    };
    check_projection(&Length::equal(1.3), 1, 2.0, member(1.3, 1.3));
    check_projection(&Length::within(0.5, 1.5), 1, 2.0, member(0.5, 1.5));
    let mut none = [[0.0; 3]];
    Length::equal(2.0).project(0, &mut none);
    assert_eq!(norm(none[0]), 2.0, "an edge without a direction gets one");
}

#[test]
fn the_nearest_angle() {
    let range = AngleRange::new(0.9, 2.0);
    let (low, high) = range.bounds();
    check_projection(&range, 2, 2.0, |near, random| {
        // The second side turned in the plane of both, to any angle within the range.
        let (a, b) = (near[0], near[1]);
        let e = scale(1.0 / norm(a), a);
        let across = sub(b, scale(dot(b, e), e));
        let (f, wanted) = (scale(1.0 / norm(across), across), random.uniform(low, high));
        let kept = norm(across).atan2(dot(b, e));
        let angle = if kept > low && kept < high { kept } else { wanted };
        vec![a, add(scale(norm(b) * angle.cos(), e), norm(b) * angle.sin(), f)]
    });
    for (a, b) in [([1.0, 0.0, 0.0], [2.0, 0.0, 0.0]), ([1.0, 0.0, 0.0], [-0.5, 0.0, 0.0])] {
        let mut v = [a, b];
        range.project(0, &mut v);
        assert!(range.violation(0, &v) < 1e-14, "parallel sides turn too: {v:?}");
    }
    let mut none = [[0.0; 3], [1.0, 2.0, 3.0]];
    range.project(0, &mut none);
    assert_eq!(none, [[0.0; 3], [1.0, 2.0, 3.0]], "a side of no length has any angle");
}

/// Rows are the derivatives of their values, and vanish in the set.
fn check_rows(set: impl Set + Clone, n: usize, exact: bool) {
    let mut random = SplitMix::new(3);
    let mut checked = 0;
    for _ in 0..20 {
        let mut v = rows(&mut random, n, 1.0);
        let at = |v: &[V3]| {
            let mut out: Vec<(f64, Vec<V3>)> = Vec::new();
            set.linearize(0, v, f64::INFINITY, &mut |row| out.push((row.value, row.gradient.to_vec())));
            out
        };
        set.project(0, &mut v);
        if n > 3 {
            let mean = scale(1.0 / n as f64, v.iter().fold([0.0; 3], |s, v| add(s, 1.0, *v)));
            v.iter_mut().for_each(|v| *v = sub(*v, mean));
        }
        if v.iter().any(|v| norm(*v) == 0.0) {
            // The nearest pair of sides far out of a range has one of no length: no angle, no rows.
            continue;
        }
        let here = at(&v);
        assert!(!here.is_empty());
        checked += 1;
        if exact {
            assert!(here.iter().all(|(value, _)| value.abs() < 1e-14));
        }
        let step: Vec<V3> = rows(&mut random, n, 1.0);
        let mean = scale(1.0 / n as f64, step.iter().fold([0.0; 3], |s, v| add(s, 1.0, *v)));
        let centred = |s: V3| if n > 3 { sub(s, mean) } else { s };
        let h = 1e-6;
        let moved: Vec<V3> = v.iter().zip(&step).map(|(v, s)| add(*v, h, centred(*s))).collect();
        let back: Vec<V3> = v.iter().zip(&step).map(|(v, s)| add(*v, -h, centred(*s))).collect();
        // Bases of what is orthogonal to a plane turn, so lengths over all rows are compared.
        let slopes: Vec<f64> =
            here.iter().map(|(_, g)| g.iter().zip(&step).map(|(g, s)| dot(*g, centred(*s))).sum()).collect();
        let length = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
        let value = |of: &[(f64, Vec<V3>)]| length(&mut of.iter().zip(&here).map(|(a, b)| a.0 - b.0));
        let (ahead, behind) = (at(&moved), at(&back));
        let slope = length(&mut slopes.iter().copied());
        let found = if n > 3 {
            0.5 * (value(&ahead) + value(&behind))
        } else {
            length(&mut ahead.iter().zip(&behind).map(|(a, b)| 0.5 * (a.0 - b.0)))
        };
        assert!((found / h - slope).abs() < 1e-4 * (1.0 + slope), "{} {slope}", found / h);
    }
    assert!(checked >= 10);
}

#[test]
fn rows_are_derivatives() {
    for corners in [4, 5, 8] {
        check_rows(Planar, corners, true);
    }
    check_rows(Length::equal(0.7), 1, true);
    check_rows(AngleRange::new(1.0, 1.2), 2, false);
}

/// The unit sphere.
pub(super) struct Ball;

impl Closest for Ball {
    fn closest(&self, x: V3) -> V3 {
        scale(1.0 / norm(x), x)
    }
}

fn batches() -> Vec<(Box<dyn Term>, usize)> {
    let quads = Arc::new(Cells::<MeanCentred, _>::new(vec![0, 1, 2, 3, 3, 2, 4, 5], 4, Planar).unwrap());
    let edges = Arc::new(Cells::<EdgeDifference, _>::new(vec![0, 1, 4, 2, 5, 0], 2, Length::equal(0.8)).unwrap());
    let angles = AngleRange::new(1.0, 1.1);
    let angles = Arc::new(Cells::<TipDifferences, _>::new(vec![0, 1, 2, 5, 4, 1], 3, angles).unwrap());
    let near = Arc::new(Cells::<Vertex, _>::new(vec![0, 2, 5], 1, Near::Shared(Arc::new(Ball))).unwrap());
    vec![
        (Box::new(Batch::new(quads.clone(), Hold::Hard(3.0))), 24),
        (Box::new(Batch::new(quads, Hold::Soft(3.0))), 24),
        (Box::new(Batch::new(edges, Hold::Hard(2.0))), 9),
        (Box::new(Batch::new(angles, Hold::Hard(0.5))), 12),
        (Box::new(Batch::new(near.clone(), Hold::Soft(0.7))), 9),
        (Box::new(Batch::new(near, Hold::Split { weight: 0.7, mu: 2.5 })), 9),
    ]
}

#[test]
fn terms_are_what_they_say() {
    let mut random = SplitMix::new(11);
    let x: Vec<f64> = (0..18).map(|_| random.uniform(-1.0, 1.0)).collect();
    for (mut term, len) in batches() {
        assert_eq!(term.local_len(), len);
        let valued = term.energy(&x, None).value > 0.0;
        assert_eq!(term.is_hard(), !valued);
        assert!(term.has_dual() || valued);
        let p: Vec<f64> = (0..len).map(|_| random.uniform(-1.0, 1.0)).collect();
        // The gradient of the penalty, and of the energy of soft sets, by differences.
        let mut grad = vec![0.0; 18];
        let value = term.penalty(&x, &p, &mut grad).value;
        let mut out = vec![0.0; len];
        term.couple(&x, &mut out);
        let by_hand: f64 = out.iter().zip(&p).map(|(c, p)| (c - p).powi(2)).sum::<f64>() * 0.5 * term.scale().weight2
            / term.n_elems() as f64;
        assert!((value - by_hand).abs() < 1e-13 * by_hand);
        let mut energy_grad = vec![0.0; 18];
        term.energy(&x, Some(&mut energy_grad));
        for i in 0..18 {
            let mut at = |h: f64| {
                let mut y = x.clone();
                y[i] += h;
                (term.penalty(&y, &p, &mut [0.0; 18]).value, term.energy(&y, None).value)
            };
            let (ahead, back) = (at(1e-6), at(-1e-6));
            assert!(((ahead.0 - back.0) / 2e-6 - grad[i]).abs() < 1e-7 * (1.0 + grad[i].abs()), "{i}");
            let slope = (ahead.1 - back.1) / 2e-6;
            assert!((slope - energy_grad[i]).abs() < 1e-6 * (1.0 + slope.abs()), "{i}: {slope} {}", energy_grad[i]);
        }
        // The matrix is that of the penalty: grad(x) - grad(0) = A x.
        let cliques: Vec<Vec<u32>> = {
            let mut all = Vec::new();
            term.for_each_element(&mut |nodes| all.push(nodes.to_vec()));
            all
        };
        let pattern = proxel_linalg::sparse::SymPattern::from_cliques(6, &cliques).unwrap();
        let mut values = vec![0.0; pattern.nnz()];
        term.add_normal(&pattern, &mut values);
        let mut product = vec![0.0; 18];
        pattern.multiply(&values, &x, 3, &mut product).unwrap();
        let mut origin = vec![0.0; 18];
        term.penalty(&[0.0; 18], &p, &mut origin);
        for i in 0..18 {
            assert!((grad[i] - origin[i] - product[i]).abs() < 1e-12, "{i}");
        }
    }
}

#[test]
fn steps_are_those_of_the_provided_method() {
    // Slow twin: what the trait makes of plain local steps, which knows nothing of this one.
    let mut random = SplitMix::new(5);
    let x: Vec<f64> = (0..18).map(|_| random.uniform(-1.0, 1.0)).collect();
    for (mut term, len) in batches() {
        if !term.has_dual() {
            continue;
        }
        let w2 = term.scale().weight2 / term.n_elems() as f64;
        let u0: Vec<f64> = (0..len).map(|_| random.uniform(-0.3, 0.3)).collect();
        let p0: Vec<f64> = (0..len).map(|_| random.uniform(-1.0, 1.0)).collect();
        let mut c = vec![0.0; len];
        term.couple(&x, &mut c);
        for order in [Order::Xzu, Order::Zxu] {
            let cycle = Cycle { order, relaxation: 1.0 };
            let (mut p, mut u, mut grad) = (p0.clone(), u0.clone(), vec![0.0; 18]);
            let report = term.cycle_step(&cycle, &x, &mut p, &mut u, &mut grad);
            let z: Vec<f64> = p.iter().zip(&u).map(|(p, u)| p + u).collect();
            let sum = |f: &dyn Fn(usize) -> f64| (0..len).map(|i| w2 * f(i).powi(2)).sum::<f64>();
            assert!((report.gap2 - sum(&|i| c[i] - z[i])).abs() < 1e-12);
            assert!((report.moved2 - sum(&|i| z[i] - p0[i] - u0[i])).abs() < 1e-12);
            assert!((report.gap2_before - sum(&|i| c[i] - p0[i] - u0[i])).abs() < 1e-12);
            assert!((report.penalty_after - 0.5 * sum(&|i| c[i] + u0[i] - z[i])).abs() < 1e-12);
            assert!((report.objective - 0.5 * sum(&|i| c[i] - p[i])).abs() < 1e-12);
            for i in 0..len {
                let wanted = if order == Order::Xzu { u0[i] + c[i] - z[i] } else { u0[i] };
                assert!((u[i] - wanted).abs() < 1e-14, "{order:?} {i}");
            }
            let mut direct = vec![0.0; 18];
            term.penalty(&x, &p, &mut direct);
            assert!(direct.iter().zip(&grad).all(|(a, b)| (a - b).abs() < 1e-13));
        }
    }
}

#[test]
fn fairing_has_the_stencils_of_a_grid() {
    // 4 x 4 vertices: 4 inner ones with two rows each, 8 on sides with one, 4 corners with none.
    let at = |i: u32, j: u32| 4 * i + j;
    let mut faces: Vec<Vec<u32>> = Vec::new();
    for i in 0..3 {
        for j in 0..3 {
            let face = vec![at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            // Orientation does not matter.
            faces.push(if (i + j) % 2 == 0 { face } else { face.into_iter().rev().collect() });
        }
    }
    let stencils = fairing::laplacian(16, faces.iter().map(Vec::as_slice));
    assert_eq!(stencils.len(), 4 * 2 + 8);
    // Affine positions have none of it.
    let x: Vec<f64> =
        (0..16).flat_map(|k| [f64::from(k / 4), f64::from(k % 4), 0.5 * f64::from(k / 4 + k % 4)]).collect();
    for (nodes, c) in stencils.iter() {
        for d in 0..3 {
            let sum: f64 = nodes.iter().zip(c).map(|(n, c)| c * x[*n as usize * 3 + d]).sum();
            assert!(sum.abs() < 1e-15, "{nodes:?} {c:?}");
        }
    }
    let mixed: [&[u32]; 3] = [&[0, 1, 2], &[0, 2, 3], &[0, 3, 1]];
    let stencils = fairing::laplacian(4, mixed.into_iter());
    // The inner vertex of three edges: its mean; each other one lies on two border edges of two faces.
    let rows: Vec<(Vec<u32>, Vec<f64>)> = stencils.iter().map(|(n, c)| (n.to_vec(), c.to_vec())).collect();
    assert_eq!(rows[0], (vec![0, 1, 2, 3], vec![1.0, -1.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0]));
    assert_eq!(rows.len(), 4);
}

#[test]
fn elements_that_fit_no_set_are_refused() {
    assert!(Cells::<EdgeDifference, _>::new(vec![0, 1, 2], 2, Length::equal(1.0)).is_err());
    assert!(Cells::<TipDifferences, _>::new(vec![0, 1], 2, AngleRange::new(0.0, 1.0)).is_err());
    assert!(Cells::<MeanCentred, _>::new(vec![], 0, Planar).is_err());
}

/// w/2 |L x|^2 + v/2 |L (x - x~)|^2, row by row.
#[test]
fn both_fairings_are_what_they_say() {
    let faces: [&[u32]; 3] = [&[0, 1, 2], &[0, 2, 3], &[0, 3, 1]];
    let stencils = fairing::laplacian(4, faces.into_iter());
    let mut random = SplitMix::new(6);
    let (x, before): ([f64; 12], [f64; 12]) = (random.array(-1.0, 1.0), random.array(-1.0, 1.0));
    for (smooth, relative) in [(0.0, 0.0), (2.0, 0.0), (0.0, 3.0), (0.5, 0.25)] {
        let mut quadratic = proxel_split::Quadratic::default();
        fairing::Fairing { smooth, relative }.add_to(&stencils, &before, &mut quadratic);
        fairing::Fairing { smooth, relative }.add_to(&stencils, &before, &mut quadratic);
        let mut wanted = 0.0;
        for (nodes, c) in stencils.iter() {
            for d in 0..3 {
                let row = |x: &[f64]| nodes.iter().zip(c).map(|(n, c)| c * x[*n as usize * 3 + d]).sum::<f64>();
                wanted += 2.0 * (0.5 * smooth * row(&x).powi(2) + 0.5 * relative * (row(&x) - row(&before)).powi(2));
            }
        }
        let mut grad = vec![0.0; 12];
        let value = quadratic.value_and_gradient(&x, 3, Some(&mut grad));
        assert!((value - wanted).abs() < 1e-13 * (1.0 + wanted), "{value} {wanted}");
        for i in 0..12 {
            let at = |h: f64| {
                let mut y = x;
                y[i] += h;
                quadratic.value_and_gradient(&y, 3, None)
            };
            assert!(((at(1e-5) - at(-1e-5)) / 2e-5 - grad[i]).abs() < 1e-7, "{i}");
        }
    }
}

/// A batch keeps the last triangles; its steps have the bits of one that does not, on any number of threads.
#[test]
fn batches_with_hints_have_the_same_bits() {
    struct Cold(Surface);
    impl Closest for Cold {
        fn closest(&self, x: V3) -> V3 {
            self.0.closest(x)
        }
    }
    let mut random = SplitMix::new(12);
    let points: Vec<V3> = rows(&mut random, 300, 1.0);
    let triangles: Vec<[u32; 3]> = (0..298).map(|i| [i, i + 1, i + 2]).collect();
    let surface = || Surface::new(&points, &triangles).unwrap();
    let n = 3 * super::cells::CHUNK + 7;
    let start: Vec<V3> = rows(&mut random, n, 1.0);
    let moves: Vec<Vec<V3>> = (0..6).map(|k| rows(&mut random, n, 0.3 * 0.3_f64.powi(k))).collect();
    let run = |near: Near, hold: Hold, threads: usize| {
        let cells = Arc::new(Cells::<Vertex, _>::new((0..n as u32).collect(), 1, near).unwrap());
        let mut batch = Batch::new(cells, hold);
        let mut x = start.as_flattened().to_vec();
        let (mut p, mut u, mut out) = (x.clone(), vec![0.0; 3 * n], Vec::new());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for step in &moves {
            x.iter_mut().zip(step.as_flattened()).for_each(|(x, s)| *x += s);
            let mut grad = vec![0.0; 3 * n];
            pool.install(|| batch.local_step(&x, &mut p, &mut u, &mut grad));
            out.push((p.clone(), u.clone(), grad));
        }
        out
    };
    for hold in [Hold::Soft(2.0), Hold::Hard(1.5)] {
        let cold = run(Near::Shared(Arc::new(Cold(surface()))), hold, 1);
        for threads in [1, 2, 3] {
            assert!(run(Near::Shared(Arc::new(surface())), hold, threads) == cold, "{hold:?} {threads}");
        }
    }
}

/// Fixed vertices are points of their own, hard.
#[test]
fn fixed_vertices_stay() {
    let at = [0.3, 0.1, -0.7];
    // Points of three elements, which a law asks for one by one.
    laws::check::<Vertex, _>(1, |m| Near::At(Points(vec![m.point(at); 3])), |_, _| vec![at]);
}
