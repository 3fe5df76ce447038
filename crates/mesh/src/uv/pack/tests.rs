use super::hull::{P2, convex_hull, smallest_rectangle, smallest_square, turn};
use super::*;

/// SplitMix64 (Steele, Lea and Flood 2014), to [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[derive(Clone)]
struct Shape {
    uv: Vec<P2>,
    triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// A band of quads between two rows of points.
    fn band(rows: [Vec<P2>; 2], closed: bool) -> Shape {
        let n = rows[0].len() as u32;
        let quads = if closed { n } else { n - 1 };
        let triangles = (0..quads).flat_map(|i| {
            let j = (i + 1) % n;
            [[i, j, n + j], [i, n + j, n + i]]
        });
        Shape { triangles: triangles.collect(), uv: rows.concat() }
    }

    fn rectangle(w: f64, h: f64, angle: f64) -> Shape {
        let r = [angle.cos(), angle.sin()];
        let row = |y: f64| vec![turn(r, [0.0, y]), turn(r, [w, y])];
        Shape::band([row(0.0), row(h)], false)
    }

    /// A part of a ring, radii `inner` to 1.
    fn arc(inner: f64, turn: f64, n: usize) -> Shape {
        let closed = turn >= 1.0;
        let at = |r: f64, i: usize| {
            let t = std::f64::consts::TAU * turn * i as f64 / (n - usize::from(!closed)) as f64;
            [r * t.cos(), r * t.sin()]
        };
        let row = |r: f64| (0..n).map(|i| at(r, i)).collect();
        Shape::band([row(1.0), row(inner)], closed).reversed()
    }

    fn reversed(mut self) -> Shape {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self
    }

    /// A star-shaped fan around its middle.
    fn star(random: &mut Random, n: u32) -> Shape {
        let at = |i: u32, r: f64| {
            let t = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            [r * t.cos(), r * t.sin()]
        };
        let mut uv: Vec<P2> = (0..n).map(|i| at(i, 0.25 + random.next())).collect();
        uv.push([0.0; 2]);
        Shape { uv, triangles: (0..n).map(|i| [i, (i + 1) % n, n]).collect() }
    }

    fn scaled(mut self, s: f64) -> Shape {
        self.uv.iter_mut().for_each(|p| *p = p.map(|c| s * c));
        self
    }

    fn area(&self) -> f64 {
        let area = |t: &[u32; 3]| super::hull::orientation(self.at(t[0]), self.at(t[1]), self.at(t[2])).abs() / 2.0;
        self.triangles.iter().map(area).sum()
    }

    fn at(&self, v: u32) -> P2 {
        self.uv[v as usize]
    }
}

/// Stars, arcs, rings and strips of sizes over a factor of 30.
fn mixture(seed: u64, n: usize) -> Vec<Shape> {
    let mut random = Random(seed);
    let shape = |i: usize| {
        let size = 30_f64.powf(random.next());
        let shape = match i % 4 {
            0 => Shape::star(&mut random, 9),
            1 => Shape::arc(0.7, 0.55, 12),
            2 => Shape::arc(0.6, 1.0, 17),
            _ => Shape::rectangle(1.0 + 3.0 * random.next(), 0.3, 7.0 * random.next()),
        };
        shape.scaled(size)
    };
    (0..n).map(shape).collect()
}

fn charts(shapes: &[Shape]) -> Vec<PackChart<'_>> {
    shapes.iter().map(|s| PackChart { uv: &s.uv, triangles: &s.triangles, rest_area: s.area() }).collect()
}

fn placed(shapes: &[Shape], packing: &Packing) -> Vec<Shape> {
    let place = |(s, p): (&Shape, &Placement)| Shape {
        uv: s.uv.iter().map(|&x| p.apply(x)).collect(),
        triangles: s.triangles.clone(),
    };
    shapes.iter().zip(&packing.placements).map(place).collect()
}

fn segment_distance(p: P2, a: P2, b: P2) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let t = ((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]);
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    (p[0] - a[0] - t * d[0]).hypot(p[1] - a[1] - t * d[1])
}

/// The distance of two triangles by all pairs of corners and edges; 0 where they meet.
fn triangle_distance(s: [P2; 3], t: [P2; 3]) -> f64 {
    let side = |a: P2, b: P2, c: P2| (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    let mut least = f64::INFINITY;
    for (s, t) in [(s, t), (t, s)] {
        for k in 0..3 {
            let (a, b) = (s[k], s[(k + 1) % 3]);
            let signs = [0, 1, 2].map(|j| side(t[j], t[(j + 1) % 3], a).signum());
            if signs == [1.0; 3] || signs == [-1.0; 3] {
                return 0.0;
            }
            for j in 0..3 {
                let (c, d) = (t[j], t[(j + 1) % 3]);
                if side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0 {
                    return 0.0;
                }
                least = least.min(segment_distance(c, a, b));
            }
        }
    }
    least
}

/// The least distance of two charts and of a chart from the border, by brute force.
fn distances(shapes: &[Shape]) -> (f64, f64) {
    let triangles = |s: &Shape| s.triangles.iter().map(|t| t.map(|v| s.at(v))).collect::<Vec<_>>();
    let all: Vec<_> = shapes.iter().map(triangles).collect();
    let mut between = f64::INFINITY;
    for (i, a) in all.iter().enumerate() {
        for b in &all[..i] {
            for s in a {
                between = b.iter().fold(between, |m, t| m.min(triangle_distance(*s, *t)));
            }
        }
    }
    let points = shapes.iter().flat_map(|s| &s.uv).flatten();
    let border = points.fold(f64::INFINITY, |m, &c| m.min(c).min(1.0 - c));
    (between, border)
}

#[test]
fn charts_keep_their_distance() {
    for (seed, n, padding, resolution) in [(1, 24, 2.0, 1024), (2, 40, 0.0, 256), (3, 12, 9.5, 200), (4, 130, 1.0, 512)]
    {
        let shapes = mixture(seed, n);
        let options = PackOptions { padding, resolution, ..PackOptions::default() };
        let packing = pack(&charts(&shapes), &options).unwrap();
        let (between, border) = distances(&placed(&shapes, &packing));
        let pixel = 1.0 / f64::from(resolution);
        assert!(between >= padding * pixel - 1e-12, "{n} charts: {} pixels", between / pixel);
        assert!(border >= 0.5 * padding * pixel - 1e-12, "{n} charts: {} pixels from the border", border / pixel);
        // Not more than it must be, either: somewhere charts are as close as cells of 1/1024 allow.
        assert!(between <= padding * pixel + 3.0 / 1024.0, "{n} charts: {} pixels", between / pixel);
        let area: f64 = placed(&shapes, &packing).iter().map(Shape::area).sum();
        assert!((packing.efficiency - area).abs() < 1e-9);
        assert!((packing.density - f64::from(resolution) * packing.placements[0].scale).abs() < 1e-9 * packing.density);
    }
}

#[test]
fn no_chart_is_mirrored_or_scaled_apart() {
    let shapes = mixture(5, 30);
    let packing = pack(&charts(&shapes), &PackOptions::default()).unwrap();
    for (p, (a, b)) in packing.placements.iter().zip(shapes.iter().zip(placed(&shapes, &packing))) {
        assert_eq!(p.scale, packing.placements[0].scale);
        assert!((p.rotation[0].hypot(p.rotation[1]) - 1.0).abs() < 1e-14);
        let [i, j, k] = a.triangles[0];
        let (before, after) =
            (super::hull::orientation(a.at(i), a.at(j), a.at(k)), super::hull::orientation(b.at(i), b.at(j), b.at(k)));
        assert!((after / before / p.scale.powi(2) - 1.0).abs() < 1e-9);
    }
    let still = PackOptions { rotate: false, ..PackOptions::default() };
    let packing = pack(&charts(&shapes), &still).unwrap();
    assert!(packing.placements.iter().all(|p| p.rotation == [1.0, 0.0]));
    assert!(distances(&placed(&shapes, &packing)).0 >= 2.0 / 1024.0 - 1e-12);
}

#[test]
fn bays_and_holes_are_used() {
    // A ring of area 0.19 pi in a square of area 4 with a disc that fits its hole only.
    let mut shapes = vec![Shape::arc(0.9, 1.0, 64), Shape::arc(0.001, 1.0, 64).scaled(0.85)];
    let packing = pack(&charts(&shapes), &PackOptions::default()).unwrap();
    let side = 2.0 * packing.placements[0].scale;
    assert!(side > 0.99, "the ring fills the page: {side}");
    // Twelve right angles that stack into each other; their boxes would fill 0.14 of the page.
    shapes =
        vec![
            Shape::band([vec![[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], vec![[1.0, 0.1], [0.1, 0.1], [0.1, 1.0]]], false)
                .reversed();
            12
        ];
    let packing = pack(&charts(&shapes), &PackOptions::default()).unwrap();
    assert!(packing.efficiency > 0.3, "{}", packing.efficiency);
    assert!(distances(&placed(&shapes, &packing)).0 >= 2.0 / 1024.0 - 1e-12);
}

#[test]
fn a_single_chart_fills_the_page() {
    let unpadded = PackOptions { padding: 0.0, ..PackOptions::default() };
    for angle in [0.0, 0.3, 1.2, 2.9] {
        let square = [Shape::rectangle(3.0, 3.0, angle)];
        let packing = pack(&charts(&square), &unpadded).unwrap();
        assert!((packing.efficiency - 1.0).abs() < 1e-12, "{}", packing.efficiency);
        let (_, border) = distances(&placed(&square, &packing));
        assert!(border > -1e-12);
        // A thin strip lies along the diagonal: length sqrt 2 less what its width takes.
        let strip = [Shape::rectangle(10.0, 1.0, angle)];
        let packing = pack(&charts(&strip), &unpadded).unwrap();
        assert!((packing.placements[0].scale - 2_f64.sqrt() / 11.0).abs() < 1e-12);
    }
}

#[test]
fn calipers_agree_with_trying_all_angles() {
    let mut random = Random(11);
    for n in [2, 3, 5, 40] {
        let points: Vec<P2> = (0..n).map(|_| [random.next(), 0.4 * random.next()]).collect();
        let hull = convex_hull(points.clone());
        let size = |r: P2| {
            let (lo, hi) = chart::bounds(points.iter().map(|&p| turn(r, p)));
            [hi[0] - lo[0], hi[1] - lo[1]]
        };
        let ([w, h], [x, y]) = (size(smallest_rectangle(&hull)), size(smallest_square(&hull)));
        let mut least = [f64::INFINITY; 2];
        for i in 0..20_000 {
            let t = std::f64::consts::PI * f64::from(i) / 20_000.0;
            let [a, b] = size([t.cos(), t.sin()]);
            least = [least[0].min(a * b), least[1].min(a.max(b))];
        }
        assert!(
            w * h <= least[0] * (1.0 + 1e-12) + 1e-15 && w * h >= least[0] * 0.999 - 1e-3,
            "{n}: {w} {h} {least:?}"
        );
        assert!(x.max(y) <= least[1] * (1.0 + 1e-12) && x.max(y) >= least[1] * 0.999, "{n}: {x} {y} {least:?}");
    }
}

#[test]
fn flips_folds_and_flat_triangles_are_covered() {
    // A fold: the second triangle lies back over the first and beyond it; the third is flat and far away.
    let folded = Shape {
        uv: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.2, -0.5], [3.0, 0.0], [4.0, 0.0], [5.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 1, 3], [2, 1, 3], [4, 5, 6]],
    };
    let shapes = vec![folded; 9];
    let packing = pack(&charts(&shapes), &PackOptions::default()).unwrap();
    let (between, border) = distances(&placed(&shapes, &packing));
    assert!(between >= 2.0 / 1024.0 - 1e-12 && border >= 1.0 / 1024.0 - 1e-12);
}

#[test]
fn units_and_origin_do_not_matter() {
    let shapes = mixture(6, 20);
    let at_home = pack(&charts(&shapes), &PackOptions::default()).unwrap();
    for scale in [1e-6, 1e8] {
        let scaled: Vec<Shape> = shapes.iter().map(|s| s.clone().scaled(scale)).collect();
        let packing = pack(&charts(&scaled), &PackOptions::default()).unwrap();
        assert!((packing.efficiency / at_home.efficiency - 1.0).abs() < 0.01);
        assert!((packing.density * scale / at_home.density - 1.0).abs() < 0.01);
    }
    let mut far = shapes.clone();
    far.iter_mut().for_each(|s| s.uv.iter_mut().for_each(|p| *p = p.map(|c| c + 1e6)));
    let packing = pack(&charts(&far), &PackOptions::default()).unwrap();
    assert!((packing.efficiency / at_home.efficiency - 1.0).abs() < 0.01);
    assert!(distances(&placed(&far, &packing)).0 >= 2.0 / 1024.0 - 1e-8);
}

#[test]
fn density_is_kept_or_refused() {
    let shapes = mixture(7, 15);
    let free = pack(&charts(&shapes), &PackOptions::default()).unwrap();
    let with = |density: f64| pack(&charts(&shapes), &PackOptions { density: Some(density), ..PackOptions::default() });
    let half = with(0.5 * free.density).unwrap();
    assert!((half.density / free.density - 0.5).abs() < 1e-12);
    assert!((half.efficiency / free.efficiency - 0.25).abs() < 1e-12);
    match with(2.0 * free.density) {
        Err(PackError::DensityTooHigh { most, .. }) => assert_eq!(most, free.density),
        other => panic!("{other:?}"),
    }
    // Rest areas that are four times those in the map: half as many texels per unit of length.
    let mut stretched = charts(&shapes);
    stretched.iter_mut().for_each(|c| c.rest_area *= 4.0);
    let packing = pack(&stretched, &PackOptions::default()).unwrap();
    assert!((packing.density / free.density - 0.5).abs() < 1e-12);
    assert_eq!(packing.placements, free.placements);
}

#[test]
fn the_same_on_any_number_of_threads() {
    let shapes = mixture(8, 70);
    let run = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| pack(&charts(&shapes), &PackOptions::default()).unwrap())
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn refusals_and_borderline_cases() {
    let uv = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [f64::NAN, 0.0]];
    let chart = |triangles: &'static [[u32; 3]]| PackChart { uv: &uv[..3], triangles, rest_area: 0.5 };
    let good = chart(&[[0, 1, 2]]);
    let default = PackOptions::default();
    assert_eq!(pack(&[], &default).unwrap(), Packing::default());
    assert_eq!(pack(&[good, chart(&[])], &default), Err(PackError::NoTriangles { chart: 1 }));
    assert_eq!(pack(&[chart(&[[0, 1, 2], [0, 1, 3]])], &default), Err(PackError::Index { chart: 0, triangle: 1 }));
    let nan = PackChart { uv: &uv, ..good };
    assert_eq!(pack(&[nan], &default), Err(PackError::NonFinite { chart: 0, vertex: 3 }));
    let negative = PackChart { rest_area: -1.0, ..good };
    assert_eq!(pack(&[negative], &default), Err(PackError::RestArea { chart: 0 }));
    assert_eq!(pack(&[good], &PackOptions { resolution: 0, ..default }), Err(PackError::Resolution));
    for padding in [-1.0, f64::NAN, f64::INFINITY, 1024.0] {
        assert!(matches!(pack(&[good], &PackOptions { padding, ..default }), Err(PackError::Padding { .. })));
    }
    let density = PackOptions { density: Some(0.0), ..default };
    assert_eq!(pack(&[good], &density), Err(PackError::Density(0.0)));
    let full = PackOptions { padding: 300.0, ..default };
    assert_eq!(pack(&[good; 30], &full), Err(PackError::NoRoom { charts: 30, padding: 300.0 }));
    // Charts without extent, and without area, have a place too.
    let point = PackChart { uv: &[[7.0, 7.0]; 3], rest_area: 0.0, ..good };
    let packing = pack(&[point; 5], &default).unwrap();
    assert!(packing.placements.iter().all(|p| p.apply([7.0, 7.0]).iter().all(|c| (0.0..=1.0).contains(c))));
    let line = PackChart { uv: &[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], ..good };
    assert!(pack(&[line, line, good, point], &default).unwrap().efficiency > 0.0);
    let given = PackOptions { density: Some(1.0), ..default };
    assert_eq!(pack(&[PackChart { rest_area: 1.0, ..point }], &given), Err(PackError::NoArea));
    for error in [PackError::Resolution, PackError::NoArea, PackError::DensityTooHigh { density: 2.0, most: 1.0 }] {
        let text = error.to_string();
        assert!(text.contains("; ") && !text.contains('\n'), "{text}");
    }
}
