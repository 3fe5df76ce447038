//! The gradient of an image as a term, against loops over pixels.

use proxel_imaging::{Boundary, GradientTerm, Grid, Norm, Pointwise, TotalVariation, Window};
use proxel_split::{Cycle, Order, Term};
use proxel_testkit::random::SplitMix;

const GRID: Grid = Grid { width: 5, height: 4, channels: 2 };

fn numbers(n: usize, seed: u64) -> Vec<f64> {
    let mut random = SplitMix::new(seed);
    (0..n).map(|_| random.normal()).collect()
}

fn term(boundary: Boundary, weight2: f64) -> GradientTerm<TotalVariation> {
    GradientTerm::new(GRID, boundary, 3, TotalVariation::isotropic(0.7), weight2)
}

/// Differences of pixel (i, j) of channel c of a field that begins at node 3.
fn twin(x: &[f64], boundary: Boundary, i: usize, c: usize, j: usize) -> [f64; 2] {
    let at = |i: usize, j: usize| x[3 + (i * GRID.channels + c) * GRID.width + j];
    let next = |k: usize, n: usize| match boundary {
        Boundary::Periodic => (k + 1) % n,
        Boundary::Neumann => (k + 1).min(n - 1),
    };
    [at(i, next(j, GRID.width)) - at(i, j), at(next(i, GRID.height), j) - at(i, j)]
}

#[test]
fn differences_are_those_of_pixels_one_by_one() {
    let x = numbers(GRID.len() + 5, 1);
    for boundary in [Boundary::Periodic, Boundary::Neumann] {
        let mut term = term(boundary, 2.0);
        let mut c = vec![0.0; term.local_len()];
        term.couple(&x, &mut c);
        let mut total = 0.0;
        for i in 0..GRID.height {
            for j in 0..GRID.width {
                let mut square = 0.0;
                for channel in 0..GRID.channels {
                    let expected = twin(&x, boundary, i, channel, j);
                    for axis in 0..2 {
                        let at = (i * 2 * GRID.channels + 2 * channel + axis) * GRID.width + j;
                        assert_eq!(c[at], expected[axis], "{boundary:?} {i} {j} {channel} {axis}");
                        square += expected[axis] * expected[axis];
                    }
                }
                total += 0.7 * square.sqrt();
            }
        }
        let value = term.energy(&x, None).value;
        assert!((value - total).abs() <= 1e-13 * total, "{value} and {total}");
    }
}

#[test]
fn gradients_of_penalty_and_energy_are_those_of_finite_differences() {
    for boundary in [Boundary::Periodic, Boundary::Neumann] {
        let (x, mut term) = (numbers(GRID.len() + 5, 2), term(boundary, 2.0));
        let p = numbers(term.local_len(), 3);
        let (mut of_penalty, mut of_energy) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        term.penalty(&x, &p, &mut of_penalty);
        term.energy(&x, Some(&mut of_energy));
        for node in 0..x.len() {
            let mut at = |by: f64| {
                let mut x = x.clone();
                x[node] += by;
                (term.penalty(&x, &p, &mut vec![0.0; x.len()]).value, term.energy(&x, None).value)
            };
            let (high, low) = (at(1e-6), at(-1e-6));
            for (slope, high, low) in [(of_penalty[node], high.0, low.0), (of_energy[node], high.1, low.1)] {
                assert!((slope - (high - low) / 2e-6).abs() < 1e-6, "{boundary:?}, node {node}: {slope}");
            }
        }
    }
}

#[test]
fn a_pull_is_the_gradient_at_the_origin() {
    for boundary in [Boundary::Periodic, Boundary::Neumann] {
        for (order, relaxation) in [(Order::Xzu, 1.0), (Order::Xzu, 1.7), (Order::Zxu, 1.0)] {
            let cycle = Cycle { order, relaxation };
            let mut term = term(boundary, 2.0);
            let x = numbers(GRID.len() + 5, 4);
            let (p, u) = (numbers(term.local_len(), 5), numbers(term.local_len(), 6));
            let (mut p1, mut u1, mut grad) = (p.clone(), u.clone(), vec![0.0; x.len()]);
            let (mut p2, mut u2, mut pull) = (p.clone(), u.clone(), vec![0.0; x.len()]);
            let full = term.cycle_step(&cycle, &x, &mut p1, &mut u1, &mut grad);
            let lean = term.pull_step(&cycle, &x, &mut p2, &mut u2, &mut pull, false);
            assert_eq!((&p1, &u1), (&p2, &u2));
            assert_eq!((full.moved2, full.gap2, full.value_after), (lean.moved2, lean.gap2, lean.value_after));
            let mut expected = vec![0.0; x.len()];
            term.penalty(&vec![0.0; x.len()], &p2, &mut expected);
            for (pull, expected) in pull.iter().zip(&expected) {
                assert!((pull - expected).abs() < 1e-12, "{boundary:?} {cycle:?}: {pull} and {expected}");
            }

            // The same number by number: z = prox(alpha c + (1 - alpha) z_before + u), u + that - z.
            let mut c = vec![0.0; p.len()];
            term.couple(&x, &mut c);
            let start: Vec<f64> = p.iter().zip(&u).map(|(p, u)| p + u).collect();
            let (w, row) = (GRID.width, 4 * GRID.width);
            for i in 0..p.len() {
                let (at, j) = (i / row * row, i % w);
                let v = |k: usize| relaxation * c[k] + (1.0 - relaxation) * start[k] + u[k];
                let r = (0..4).map(|k| v(at + k * w + j).powi(2)).sum::<f64>().sqrt();
                let z = v(i) * (1.0 - 0.7 / 2.0 / r).max(0.0);
                let dual = if order == Order::Zxu { u[i] } else { v(i) - z };
                assert!((u2[i] - dual).abs() < 1e-14 && (p2[i] + u2[i] - z).abs() < 1e-14, "{cycle:?}, number {i}");
            }
        }
    }
}

/// Pairs that shrink in one pass, against pixels one by one: rows of whole lanes and a rest, with and without a window.
#[test]
fn pairs_shrink_in_one_pass() {
    const FORCE: f64 = 0.7;
    const WEIGHT2: f64 = 2.0;
    let window = Window { width: 21, rows: [1, 4], columns: [3, 20] };
    let cycles = [(Order::Xzu, 1.0), (Order::Xzu, 1.7), (Order::Zxu, 1.0)];
    for (channels, within) in [(1, None), (2, None), (2, Some(window))] {
        for (boundary, (order, relaxation)) in
            [Boundary::Periodic, Boundary::Neumann].into_iter().flat_map(|b| cycles.map(|cycle| (b, cycle)))
        {
            let grid = Grid { width: 21, height: 5, channels };
            let of = TotalVariation { lambda: FORCE, norm: Norm::Channels, within };
            let mut term = GradientTerm::new(grid, boundary, 3, of, WEIGHT2);
            let x = numbers(grid.len() + 5, 4);
            let (p, u) = (numbers(term.local_len(), 5), numbers(term.local_len(), 6));
            let mut c = vec![0.0; p.len()];
            term.couple(&x, &mut c);
            let (mut p1, mut u1) = (p.clone(), u.clone());
            let mut pull = numbers(x.len(), 7);
            let cycle = Cycle { order, relaxation };
            let report = term.pull_step(&cycle, &x, &mut p1, &mut u1, &mut pull, true);
            let (w, row) = (grid.width, 2 * channels * grid.width);
            let [mut moved2, mut gap2_before, mut gap2, mut value] = [0.0; 4];
            for i in 0..p.len() {
                let (pixel, other) = (i / row * w + i % w, if i % (2 * w) < w { i + w } else { i - w });
                let v = |k: usize| relaxation * c[k] + (1.0 - relaxation) * (p[k] + u[k]) + u[k];
                let r = v(i).hypot(v(other));
                let counts = within.is_none_or(|window| window.contains(pixel));
                let shrunk = if counts { (1.0 - FORCE / WEIGHT2 / r).max(0.0) } else { 1.0 };
                let (before, z) = (p[i] + u[i], v(i) * shrunk);
                let dual = if order == Order::Zxu { u[i] } else { v(i) - z };
                assert!((u1[i] - dual).abs() < 1e-14 && (p1[i] + u1[i] - z).abs() < 1e-14, "{cycle:?}, number {i}");
                moved2 += WEIGHT2 * (z - before).powi(2);
                gap2_before += WEIGHT2 * (c[i] - before).powi(2);
                gap2 += WEIGHT2 * (c[i] - z).powi(2);
                value += if counts && i < other { FORCE * shrunk * r } else { 0.0 };
            }
            let pairs = [
                (report.moved2, moved2),
                (report.gap2_before, gap2_before),
                (report.gap2, gap2),
                (report.value_after, value),
            ];
            assert!(pairs.iter().all(|(a, b)| (a - b).abs() <= 1e-13 * b), "{channels} channels, {cycle:?}: {pairs:?}");
            let mut expected = vec![0.0; x.len()];
            term.penalty(&vec![0.0; x.len()], &p1, &mut expected);
            assert!(pull.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{boundary:?}: {cycle:?}");
        }
    }
}

#[test]
fn the_prox_is_the_minimiser() {
    let mut random = SplitMix::new(7);
    let by_channel = TotalVariation { lambda: 0.7, norm: Norm::Channels, within: None };
    for of in [TotalVariation::isotropic(0.7), TotalVariation::anisotropic(0.7), by_channel] {
        for planes in [2, 4, 6] {
            let n = 9;
            let v = numbers(planes * n, 8);
            let mut z = v.clone();
            let value = of.prox(0..n, &mut z, 1.3);
            assert!((value - of.value(0..n, &z)).abs() < 1e-13, "{of:?}, {planes} planes");
            let objective =
                |z: &[f64]| of.value(0..n, z) + 0.65 * z.iter().zip(&v).map(|(z, v)| (z - v).powi(2)).sum::<f64>();
            let least = objective(&z);
            for _ in 0..2000 {
                let size = 10f64.powf(-4.0 * random.uniform(0.0, 1.0));
                let other: Vec<f64> = z.iter().map(|z| z + size * random.normal()).collect();
                assert!(objective(&other) >= least - 1e-12, "{of:?}, {planes} planes");
            }
        }
    }
}

#[test]
fn a_step_has_the_same_bits_on_any_number_of_threads() {
    let grid = Grid::new(300, 211);
    let x = numbers(grid.len(), 9);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let tv = TotalVariation::isotropic(0.4);
            let mut term = GradientTerm::new(grid, Boundary::Periodic, 0, tv, 1.5);
            let (mut p, mut u) = (numbers(term.local_len(), 10), numbers(term.local_len(), 11));
            let mut pull = vec![0.0; x.len()];
            let report = term.pull_step(&Cycle::PLAIN, &x, &mut p, &mut u, &mut pull, true);
            let mut expected = vec![0.0; x.len()];
            term.penalty(&vec![0.0; x.len()], &p, &mut expected);
            assert!(pull.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12));
            (p, u, pull, report)
        })
    };
    assert_eq!(run(1), run(3));
}

/// What does not count is left as it is, has no value, and bears no force; what does is shrunk as it is elsewhere.
#[test]
fn only_a_window_counts() {
    let window = Window { width: 7, rows: [1, 3], columns: [2, 5] };
    let mut random = SplitMix::new(8);
    for norm in [Norm::Vectorial, Norm::Channels, Norm::Differences, Norm::Triples] {
        let all = TotalVariation { lambda: 0.7, norm, within: None };
        let part = TotalVariation { within: Some(window), ..all };
        for row in 0..4 {
            let pixels = || row * 7..(row + 1) * 7;
            let v: Vec<f64> = (0..6 * 7).map(|_| random.uniform(-1.0, 1.0)).collect();
            let inside = |k: usize| (1..3).contains(&row) && (2..5).contains(&(k % 7));
            let kept: Vec<f64> = v.iter().enumerate().map(|(k, v)| if inside(k) { *v } else { 0.0 }).collect();
            let (mut whole, mut some) = (kept.clone(), v.clone());
            let (value, of_part) = (all.prox(pixels(), &mut whole, 2.0), part.prox(pixels(), &mut some, 2.0));
            assert!((value - of_part).abs() < 1e-13);
            for k in 0..v.len() {
                let want = if inside(k) { whole[k] } else { v[k] };
                assert!((some[k] - want).abs() < 1e-14, "{norm:?}, row {row}, number {k}: {} and {want}", some[k]);
                assert_eq!(window.contains(row * 7 + k % 7), inside(k));
            }
            assert!((part.value(pixels(), &v) - all.value(pixels(), &kept)).abs() < 1e-13);
            let (mut slopes, mut of_kept) = (v.clone(), kept.clone());
            part.gradient(pixels(), &mut slopes);
            all.gradient(pixels(), &mut of_kept);
            assert_eq!(slopes, of_kept);
            assert_eq!(part.gauge(pixels(), &v), Some(f64::INFINITY));
            assert_eq!(part.gauge(pixels(), &kept), all.gauge(pixels(), &kept));
        }
    }
}

/// A local step on v = z + u alone, against the one on p and u: rows of whole lanes and a rest, several tasks, with and without
/// a window.
#[test]
fn folded_steps_are_those_of_both() {
    const FORCE: f64 = 0.7;
    let window = Window { width: 35, rows: [1, 800], columns: [3, 33] };
    for (channels, within) in [(1, None), (2, None), (2, Some(window))] {
        for (boundary, relaxation) in
            [Boundary::Periodic, Boundary::Neumann].into_iter().flat_map(|b| [1.0, 1.7].map(|alpha| (b, alpha)))
        {
            let grid = Grid { width: 35, height: 900, channels };
            assert!(grid.task_rows() < grid.height);
            let of = TotalVariation { lambda: FORCE, norm: Norm::Channels, within };
            let mut term = GradientTerm::new(grid, boundary, 3, of, 2.0);
            let cycle = Cycle { order: Order::Xzu, relaxation };
            let (mut p, mut u) = (numbers(term.local_len(), 5), numbers(term.local_len(), 6));
            let x = [4, 8].map(|seed| numbers(grid.len() + 5, seed));
            let mut v = {
                term.pull_step(&cycle, &x[0], &mut p, &mut u, &mut vec![0.0; x[0].len()], true);
                p.iter().zip(&u).map(|(p, u)| p + 2.0 * u).collect::<Vec<f64>>()
            };
            for begins in [true, false] {
                let [mut both, mut alone] = [(); 2].map(|()| numbers(x[0].len(), 7));
                let report = term.pull_step(&cycle, &x[1], &mut p, &mut u, &mut both, begins);
                let folded = term.folded().expect("pairs shrink");
                let of_folded = folded.step(relaxation, &x[1], &mut v, &mut alone, begins);
                let (mut p1, mut u1) = (vec![0.0; p.len()], vec![0.0; p.len()]);
                folded.unfold(&v, &mut p1, &mut u1);
                for (a, b) in [(&p, &p1), (&u, &u1), (&both, &alone)] {
                    let near = a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-13);
                    assert!(near, "{boundary:?}, {channels} channels, relaxation {relaxation}");
                }
                for (a, b) in [
                    (report.moved2, of_folded.moved2),
                    (report.gap2, of_folded.gap2),
                    (report.gap2_before, of_folded.gap2_before),
                    (report.value_after, of_folded.value_after),
                ] {
                    assert!((a - b).abs() < 1e-12 * a && a > 0.0, "{boundary:?}, {channels} channels: {a} and {b}");
                }
            }
        }
    }
}
