//! Gradients through maps, against central differences of whole runs.

use proxel::mesh::Mesh;
use proxel::mesh::generate::cloth;
use proxel::settings::UnwrapSettings;
use proxel::split::Status;
use proxel::unwrap::{Hooks, MapAdjoint, UnwrapInput, Unwrapped, adjoint, unwrap};
use proxel_testkit::SplitMix as Random;

type V2 = [f64; 2];
type V3 = [f64; 3];

/// The heightfield z = 0.6 sin 2.5 x cos 2 y over [-1, 1]^2.
fn patch(cells: usize) -> Mesh {
    let mut mesh = cloth([cells, cells], [2.0, 2.0]).unwrap();
    let (low, _) = mesh.bounding_box().unwrap();
    for p in &mut mesh.points {
        let q = [p[0] - low[0] - 1.0, p[1] + p[2] - low[1] - low[2] - 1.0];
        *p = [q[0], q[1], 0.6 * (2.5 * q[0]).sin() * (2.0 * q[1]).cos()];
    }
    mesh
}

fn settings(energy: &str) -> UnwrapSettings {
    UnwrapSettings { energy: energy.to_string(), pack: false, tol: 1e-11, ..UnwrapSettings::default() }
}

fn solve(input: &UnwrapInput, settings: &UnwrapSettings) -> Unwrapped {
    let map = unwrap(input, settings, &mut Hooks::default()).unwrap();
    assert_eq!(map.status, Status::Converged, "{}", map.report.reason);
    map
}

fn coefficients(v: usize) -> (V2, f64) {
    let t = v as f64;
    ([(1.3 * t).sin(), (2.1 * t + 0.4).cos()], (0.9 * t).cos())
}

/// sum a_v . p_v + 1/2 sum b_v |p_v|^2
fn loss(uv: &[V2]) -> f64 {
    let of = |(v, p): (usize, &V2)| {
        let (a, b) = coefficients(v);
        a[0] * p[0] + a[1] * p[1] + 0.5 * b * (p[0] * p[0] + p[1] * p[1])
    };
    uv.iter().enumerate().map(of).sum()
}

fn slope(uv: &[V2]) -> Vec<V2> {
    let of = |(v, p): (usize, &V2)| {
        let (a, b) = coefficients(v);
        [a[0] + b * p[0], a[1] + b * p[1]]
    };
    uv.iter().enumerate().map(of).collect()
}

/// Moved and turned, about `held` where there is one, such that it is nearest to another map.
fn laid_on(uv: &[V2], onto: &[V2], held: Option<usize>) -> Vec<V2> {
    let n = uv.len() as f64;
    let mean = |of: &[V2]| [0, 1].map(|d| of.iter().map(|p| p[d]).sum::<f64>() / n);
    let (from, to) = held.map_or((mean(uv), mean(onto)), |v| (uv[v], uv[v]));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (p, q) in uv.iter().zip(onto) {
        let (p, q) = ([p[0] - from[0], p[1] - from[1]], [q[0] - to[0], q[1] - to[1]]);
        dot += p[0] * q[0] + p[1] * q[1];
        cross += p[0] * q[1] - p[1] * q[0];
    }
    let (sin, cos) = cross.atan2(dot).sin_cos();
    let turn = |p: &V2| {
        let [x, y] = [p[0] - from[0], p[1] - from[1]];
        [to[0] + cos * x - sin * y, to[1] + sin * x + cos * y]
    };
    uv.iter().map(turn).collect()
}

/// How charts are laid on each other: by their ranges of coordinates; none where pins hold the map.
type Charts = Option<(Vec<std::ops::Range<usize>>, Option<usize>)>;

fn laid(uv: &[V2], onto: &[V2], charts: &Charts) -> Vec<V2> {
    let Some((ranges, held)) = charts else { return uv.to_vec() };
    ranges.iter().flat_map(|r| laid_on(&uv[r.clone()], &onto[r.clone()], *held)).collect()
}

fn found(input: &UnwrapInput, settings: &UnwrapSettings) -> (Unwrapped, MapAdjoint) {
    let map = solve(input, settings);
    let out = adjoint(input, settings, &map, &slope(&map.uv.coordinates)).unwrap();
    assert!(out.distance < 1e-7, "{}", out.distance);
    (map, out)
}

/// The derivative at 0 of what `of` does to the input, by runs at four steps, is `gradient` to 1e-5.
fn check(
    what: &str,
    gradient: f64,
    (input, settings): (&UnwrapInput, &UnwrapSettings),
    charts: &Charts,
    of: impl Fn(f64, &mut UnwrapInput),
) {
    const STEP: f64 = 1e-3;
    let base = solve(input, settings).uv.coordinates;
    let at = |t: f64| {
        let mut input = input.clone();
        of(t, &mut input);
        loss(&laid(&solve(&input, settings).uv.coordinates, &base, charts))
    };
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|k| at(k * STEP));
    let difference = (a - 8.0 * b + 8.0 * c - d) / (12.0 * STEP);
    let off = (gradient - difference).abs();
    assert!(off <= 1e-5 * difference.abs() && difference != 0.0, "{what}: {gradient} is no {difference}");
}

fn check_vertices(what: &str, input: &UnwrapInput, settings: &UnwrapSettings, held: Option<Option<usize>>) {
    let (map, out) = found(input, settings);
    let mut first = 0;
    let ranges = map.charts.charts.iter().map(|chart| {
        first += chart.vertices.len();
        first - chart.vertices.len()..first
    });
    let charts = held.map(|held| (ranges.collect(), held));
    let mut random = Random::new(3);
    let along: Vec<V3> = input.mesh.points.iter().map(|_| random.array(-0.2, 0.2)).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let gradient = dot(out.vertices.as_flattened(), along.as_flattened());
    check(&format!("{what}: vertices"), gradient, (input, settings), &charts, |t, input| {
        for (p, d) in input.mesh.points.iter_mut().zip(&along) {
            (0..3).for_each(|k| p[k] += t * d[k]);
        }
    });
    if !input.pins.is_empty() {
        let along: Vec<V2> = input.pins.iter().map(|_| random.array(-0.3, 0.3)).collect();
        let gradient = dot(out.pins.as_flattened(), along.as_flattened());
        check(&format!("{what}: pins"), gradient, (input, settings), &charts, |t, input| {
            for ((_, p), d) in input.pins.iter_mut().zip(&along) {
                (0..2).for_each(|k| p[k] += t * d[k]);
            }
        });
    }
}

#[test]
fn of_a_patch_that_nothing_holds() {
    let input = UnwrapInput { mesh: patch(6), ..UnwrapInput::default() };
    for energy in ["symmetric-dirichlet", "arap", "symmetric-gradient", "neo-hookean"] {
        check_vertices(energy, &input, &settings(energy), Some(None));
    }
}

#[test]
fn with_pins_weights_and_metrics() {
    let mesh = patch(6);
    let pins = vec![(0, [0.1, 0.2]), (48, [2.9, 2.2]), (24, [1.3, 1.6])];
    let held = UnwrapInput { mesh: mesh.clone(), pins: pins.clone(), ..UnwrapInput::default() };
    check_vertices("three pins", &held, &settings("symmetric-dirichlet"), None);
    let one = UnwrapInput { mesh: mesh.clone(), pins: pins[..1].to_vec(), ..UnwrapInput::default() };
    check_vertices("one pin", &one, &settings("symmetric-dirichlet"), Some(Some(0)));
    let mut random = Random::new(8);
    let n = mesh.faces.len();
    let weights = Some((0..n).map(|_| random.uniform(0.5, 2.0)).collect());
    let mut number = |low, high| random.uniform(low, high);
    let metric = (0..n).map(|_| {
        let mut off = || number(-0.2, 0.2);
        [1.2 + off(), off(), off(), 0.9 + off(), off(), 1.1 + off()]
    });
    let metric = Some(metric.collect());
    let weighed = UnwrapInput { mesh, weights, metric, ..UnwrapInput::default() };
    check_vertices("weights and metrics", &weighed, &settings("symmetric-dirichlet"), Some(None));
}

#[test]
fn of_charts_with_shared_vertices() {
    // Cut in two along a line of the grid.
    let n = 6;
    let seams = (0..n).map(|i| [(n / 2) * (n + 1) + i, (n / 2) * (n + 1) + i + 1].map(|v| v as u32)).collect();
    let input = UnwrapInput { mesh: patch(n), seams, ..UnwrapInput::default() };
    let settings = settings("symmetric-dirichlet");
    assert_eq!(solve(&input, &settings).charts.charts.len(), 2);
    check_vertices("two charts", &input, &settings, Some(None));
}

/// Where a map lies and how it is turned does not matter to distances in it: no laying of maps on each other.
#[test]
fn a_loss_that_does_not_see_motions_needs_no_gauge() {
    let input = UnwrapInput { mesh: patch(6), ..UnwrapInput::default() };
    let settings = settings("symmetric-dirichlet");
    let pairs = [(0, 48), (6, 42), (3, 20), (11, 30)];
    let distances = |uv: &[V2]| {
        pairs.iter().map(|(a, b)| (uv[*a][0] - uv[*b][0]).powi(2) + (uv[*a][1] - uv[*b][1]).powi(2)).sum::<f64>()
    };
    let map = solve(&input, &settings);
    let uv = &map.uv.coordinates;
    let mut slope = vec![[0.0; 2]; uv.len()];
    for (a, b) in pairs {
        for d in 0..2 {
            slope[a][d] += 2.0 * (uv[a][d] - uv[b][d]);
            slope[b][d] -= 2.0 * (uv[a][d] - uv[b][d]);
        }
    }
    let out = adjoint(&input, &settings, &map, &slope).unwrap();
    for (v, d) in [(0, 2), (10, 2), (24, 0), (31, 1)] {
        let at = |t: f64| {
            let mut input = input.clone();
            input.mesh.points[v][d] += t;
            distances(&solve(&input, &settings).uv.coordinates)
        };
        let step = 1e-3;
        let [a, b, c, e] = [-2.0, -1.0, 1.0, 2.0].map(|k| at(k * step));
        let difference = (a - 8.0 * b + 8.0 * c - e) / (12.0 * step);
        let off = (out.vertices[v][d] - difference).abs();
        assert!(off <= 1e-5 * difference.abs(), "{v} {d}: {} {difference}", out.vertices[v][d]);
    }
    // The whole surface moved or turned leaves the map as it is; magnified, distances grow with it.
    let [mut push, mut grow] = [[0.0; 3], [0.0; 3]];
    for (g, p) in out.vertices.iter().zip(&input.mesh.points) {
        (0..3).for_each(|d| push[d] += g[d]);
        (0..3).for_each(|d| grow[d] += g[d] * p[d]);
    }
    assert!(push.iter().all(|v| v.abs() < 1e-9), "{push:?}");
    let growth = grow.iter().sum::<f64>();
    assert!((growth - 2.0 * distances(uv)).abs() < 1e-7 * growth, "{growth}");
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let input = UnwrapInput { mesh: patch(6), ..UnwrapInput::default() };
    let [one, three] = [1, 3]
        .map(|threads| found(&input, &UnwrapSettings { threads: Some(threads), ..settings("symmetric-dirichlet") }).1);
    assert_eq!(one, three);
}

#[test]
fn what_has_no_gradient_is_refused_with_a_remedy() {
    let input = UnwrapInput { mesh: patch(4), ..UnwrapInput::default() };
    let refused = |input: &UnwrapInput, settings: &UnwrapSettings| {
        let map = unwrap(input, settings, &mut Hooks::default()).unwrap();
        adjoint(input, settings, &map, &slope(&map.uv.coordinates)).unwrap_err().0
    };
    let plain = settings("symmetric-dirichlet");
    for (settings, says) in [
        (UnwrapSettings { max_iters: 1, ..plain.clone() }, "--max-iters"),
        (UnwrapSettings { pack: true, ..plain.clone() }, "pack=False"),
        (UnwrapSettings { fixed_boundary: true, ..plain.clone() }, "by pins"),
        (UnwrapSettings { bijective: true, ..plain.clone() }, "--bijective"),
    ] {
        let text = refused(&input, &settings);
        assert!(text.contains(says), "{text}");
    }
    let mut collapsed = input.clone();
    let other = collapsed.mesh.points[6];
    collapsed.mesh.points[7] = other;
    let text = refused(&collapsed, &plain);
    assert!(text.contains("without area"), "{text}");
    let map = solve(&input, &plain);
    let text = adjoint(&input, &plain, &map, &[[0.0; 2]]).unwrap_err().0;
    assert!(text.contains("1 rows for 25 coordinates"), "{text}");
}
