use super::*;
use proptest::prelude::*;

/// Integer points and what of them is exact in i128.
type P = [i64; 2];

fn cross(a: P, b: P, c: P) -> i128 {
    let d = |p: P, q: P, k: usize| i128::from(q[k] - p[k]);
    d(a, b, 0) * d(a, c, 1) - d(a, b, 1) * d(a, c, 0)
}

/// X / W, Y / W.
type Rational = [i128; 3];

fn whole(p: P) -> Rational {
    [i128::from(p[0]), i128::from(p[1]), 1]
}

/// The point where two segments meet that are not parallel.
fn meeting(a: P, b: P, c: P, d: P) -> Option<Rational> {
    let (r, s) = ([b[0] - a[0], b[1] - a[1]].map(i128::from), [d[0] - c[0], d[1] - c[1]].map(i128::from));
    let w = r[0] * s[1] - r[1] * s[0];
    let t = i128::from(c[0] - a[0]) * s[1] - i128::from(c[1] - a[1]) * s[0];
    let u = i128::from(c[0] - a[0]) * r[1] - i128::from(c[1] - a[1]) * r[0];
    let inside = |t: i128| if w > 0 { (0..=w).contains(&t) } else { (w..=0).contains(&t) };
    (w != 0 && inside(t) && inside(u)).then(|| [i128::from(a[0]) * w + t * r[0], i128::from(a[1]) * w + t * r[1], w])
}

fn collinear(p: Rational, q: Rational, r: Rational) -> bool {
    p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0]) + p[2] * (q[0] * r[1] - q[1] * r[0]) == 0
}

/// The slow twin: the corners of the intersection of two triangles do not lie on one line.
fn slow_interiors(a: [P; 3], b: [P; 3]) -> bool {
    let area = |t: [P; 3]| cross(t[0], t[1], t[2]);
    if area(a) == 0 || area(b) == 0 {
        return false;
    }
    let within = |t: [P; 3], p: P| (0..3).all(|k| cross(t[k], t[(k + 1) % 3], p) * area(t) >= 0);
    let mut corners: Vec<Rational> = Vec::new();
    corners.extend(a.iter().filter(|&&p| within(b, p)).map(|&p| whole(p)));
    corners.extend(b.iter().filter(|&&p| within(a, p)).map(|&p| whole(p)));
    for k in 0..3 {
        corners.extend((0..3).filter_map(|l| meeting(a[k], a[(k + 1) % 3], b[l], b[(l + 1) % 3])));
    }
    let n = corners.len();
    (0..n).any(|i| (0..i).any(|j| (0..j).any(|k| !collinear(corners[i], corners[j], corners[k]))))
}

/// The slow twin of contacts: (cross, touch) of two segments, from all their common points.
fn slow_contact(a: P, b: P, c: P, d: P, shared: Option<P>) -> (bool, bool) {
    let on = |p: P, q: P, x: P| {
        let dot = (0..2).map(|k| i128::from(x[k] - p[k]) * i128::from(x[k] - q[k])).sum::<i128>();
        cross(p, q, x) == 0 && dot <= 0
    };
    let mut ends: Vec<P> = [a, b].into_iter().filter(|&x| on(c, d, x)).collect();
    ends.extend([c, d].into_iter().filter(|&x| on(a, b, x)));
    let touch = ends.iter().any(|&x| shared != Some(x));
    let cross = ends.is_empty() && meeting(a, b, c, d).is_some();
    (cross, touch)
}

/// A map of triangles over few points of a small grid, so that everything touches everything.
#[derive(Debug, Clone)]
struct Small {
    faces: Vec<[u32; 3]>,
    uv: Vec<P>, // of each vertex
}

fn small(n_verts: u32, side: i64) -> impl Strategy<Value = Small> {
    let face =
        prop::array::uniform3(0..n_verts).prop_filter("a triangle", |f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0]);
    let uv = prop::collection::vec(prop::array::uniform2(-side..side), n_verts as usize);
    (prop::collection::vec(face, 1..24), uv).prop_map(|(faces, uv)| Small { faces, uv })
}

fn rest(n: usize) -> Vec<[f64; 3]> {
    // On a parabola, so that no three are on a line.
    (0..n).map(|i| [i as f64, (i * i) as f64, 0.0]).collect()
}

impl Small {
    fn map(&self, scale: f64) -> (Vec<[f64; 3]>, Polygons, UvMap) {
        let faces = Polygons::from(&self.faces[..]);
        let coordinates = self.uv.iter().map(|p| p.map(|x| x as f64 * scale)).collect();
        let corners = faces.indices().to_vec();
        (rest(self.uv.len()), faces, UvMap { coordinates, corners })
    }

    fn points(&self, f: [u32; 3]) -> [P; 3] {
        f.map(|v| self.uv[v as usize])
    }

    /// Faces without those that have the vertices of one before them.
    fn originals(&self) -> Vec<[u32; 3]> {
        let sorted = |mut f: [u32; 3]| {
            f.sort_unstable();
            f
        };
        let n = self.faces.len();
        let first = |i: &usize| !(0..*i).any(|j| sorted(self.faces[j]) == sorted(self.faces[*i]));
        (0..n).filter(first).map(|i| self.faces[i]).collect()
    }

    fn border(&self) -> Vec<[u32; 2]> {
        let faces = self.originals();
        let edges = |f: &[u32; 3]| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]].map(|[a, b]| [a.min(b), a.max(b)]);
        let mut all: Vec<[u32; 2]> = faces.iter().flat_map(edges).collect();
        all.sort_unstable();
        all.chunk_by(|a, b| a == b).filter(|g| g.len() == 1).map(|g| g[0]).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn counts_agree_with_the_slow_twin(map in small(14, 4), power in -40i32..40) {
        let (points, faces, uv) = map.map(2f64.powi(power));
        let c = certify(&points, &faces, &uv, &CertificateOptions::default()).unwrap();
        let sign = |f: &[u32; 3]| { let [a, b, c] = map.points(*f); cross(a, b, c).signum() };
        prop_assert_eq!(c.flips, map.faces.iter().filter(|f| sign(f) < 0).count());
        prop_assert_eq!(c.zero_area, map.faces.iter().filter(|f| sign(f) == 0).count());
        let all = map.originals();
        let pairs = (0..all.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let overlaps = pairs.filter(|&(i, j)| slow_interiors(map.points(all[i]), map.points(all[j]))).count();
        prop_assert_eq!(c.overlaps.triangle_pairs, overlaps as u64);
        let border = map.border();
        let (mut crossings, mut touches) = (0, 0);
        for i in 0..border.len() {
            for j in 0..i {
                let at = |v: u32| map.uv[v as usize];
                let ([a, b], [c, d]) = (border[i], border[j]);
                let shared = border[i].into_iter().find(|v| border[j].contains(v));
                let (cross, touch) = slow_contact(at(a), at(b), at(c), at(d), shared.map(at));
                // Other ends at the place of the shared one are that end for everyone who looks at the plane.
                crossings += u64::from(cross);
                touches += u64::from(touch);
            }
        }
        prop_assert_eq!((c.overlaps.boundary_crossings, c.overlaps.boundary_touches), (crossings, touches));
        prop_assert!(c.overlaps.complete);
    }
}

fn grid(n: usize, at: impl Fn(usize, usize) -> [f64; 2]) -> (Vec<[f64; 3]>, Polygons, UvMap) {
    let mut points = Vec::new();
    let mut coordinates = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            points.push([i as f64, j as f64, 0.0]);
            coordinates.push(at(i, j));
        }
    }
    let id = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut faces = Polygons::new();
    for i in 0..n {
        for j in 0..n {
            faces.push(&[id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)]);
        }
    }
    let corners = faces.indices().to_vec();
    (points, faces, UvMap { coordinates, corners })
}

fn certified(map: &(Vec<[f64; 3]>, Polygons, UvMap)) -> Certificate {
    certify(&map.0, &map.1, &map.2, &CertificateOptions::default()).unwrap()
}

#[test]
fn an_isometry_and_an_affine_map() {
    let c = certified(&grid(10, |i, j| [0.05 * i as f64, 0.05 * j as f64 + 0.5]));
    assert_eq!((c.triangles, c.flips, c.zero_area, c.charts), (200, 0, 0, 1));
    assert!(c.overlaps.is_injective() && c.overlaps.boundary_touches == 0);
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-14 * b.abs().max(1.0), "{a} is not {b}");
    let d = c.distortion;
    for x in [
        d.energy,
        d.l2_stretch,
        d.max_stretch,
        d.sander_l2,
        d.sander_linf,
        d.conformal_mean,
        d.conformal_max,
        d.area_max,
    ] {
        near(x, 1.0);
    }
    near(d.scale, 20.0);
    near(d.energy_as_given, 0.5 * (0.0025 + 400.0));
    near(c.packing, 0.25);
    assert_eq!((c.seam_length, c.density_spread), (0.0, 1.0));
    // s = (4, 1) with a fit of 1/2: E = (4 + 1/4) / 2 and L2 = sqrt((4 + 1/4) / 2).
    let c = certified(&grid(4, |i, j| [4.0 * i as f64 - 100.0, j as f64]));
    let d = c.distortion;
    near(d.scale, 0.5);
    near(d.energy, 2.125);
    near(d.energy_as_given, 0.25 * (16.0 + 1.0 + 1.0 / 16.0 + 1.0));
    near(d.energy_at(0.5), 2.125);
    near(d.l2_stretch, 2.125f64.sqrt());
    near(d.max_stretch, 2.0);
    near(d.conformal_mean, 4.0);
    near(d.area_mean, 1.0);
    // Sander: singular values 1 / 4 and 1 from the plane to the surface, areas 4 to 1.
    near(d.sander_l2, ((1.0 + 1.0 / 16.0) / 2.0f64).sqrt() * 2.0);
    near(d.sander_linf, 2.0);
    near(c.packing, 0.25);
}

#[test]
fn reversed_and_degenerate_faces() {
    let mut map = grid(2, |i, j| [i as f64, j as f64]);
    let mut turned = Polygons::new();
    for (f, face) in map.1.iter().enumerate() {
        let mut face = face.to_vec();
        if f == 3 {
            face.reverse();
        }
        turned.push(&face);
    }
    map.2.corners = turned.indices().to_vec();
    map.1 = turned;
    assert_eq!((certified(&map).flips, certified(&map).flipped_faces), (2, vec![3]));
    let options = CertificateOptions { reversed_faces: vec![3] };
    let c = certify(&map.0, &map.1, &map.2, &options).unwrap();
    assert_eq!((c.flips, c.overlaps.is_injective()), (0, true));
    // Two corners of face 0 are put together, on the surface and in the plane, then on the surface alone.
    map.0[0] = map.0[1];
    map.2.coordinates[0] = map.2.coordinates[1];
    let c = certify(&map.0, &map.1, &map.2, &options).unwrap();
    assert_eq!((c.no_rest_area, c.flips, c.zero_area), (1, 0, 0));
    assert!(c.distortion.energy.is_finite());
    map.0[0] = [0.0; 3];
    let c = certify(&map.0, &map.1, &map.2, &options).unwrap();
    assert_eq!((c.no_rest_area, c.zero_area, c.distortion.energy), (0, 1, f64::INFINITY));
    assert!(c.distortion.scale.is_finite() && c.distortion.energy_as_given == f64::INFINITY);
}

#[test]
fn a_cone_of_four_pi_overlaps_without_flips() {
    // A fan of eight triangles that goes around its centre twice.
    let n = 8u32;
    let mut faces = Polygons::new();
    (0..n).for_each(|k| faces.push(&[0, 1 + k, 1 + (k + 1) % n]));
    let mut coordinates = vec![[0.0, 0.0]];
    let quarter = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    coordinates.extend((0..n as usize).map(|k| quarter[k % 4].map(|x| x * (1.0 + 0.1 * k as f64))));
    let uv = UvMap { coordinates, corners: faces.indices().to_vec() };
    let c = certify(&rest(9), &faces, &uv, &CertificateOptions::default()).unwrap();
    assert_eq!((c.flips, c.charts), (0, 1));
    assert!(c.overlaps.triangle_pairs >= 4, "{:?}", c.overlaps);
    assert!(c.overlaps.boundary_crossings > 0);
}

#[test]
fn one_chart_inside_another_and_copies_of_a_face() {
    let mut points = rest(7);
    points[6] = [9.0, 9.0, 9.0];
    let mut faces = Polygons::new();
    [[0, 1, 2], [3, 4, 5], [1, 2, 0]].iter().for_each(|f| faces.push(f));
    let coordinates = vec![[0.0, 0.0], [10.0, 0.0], [0.0, 10.0], [1.0, 1.0], [2.0, 1.0], [1.0, 2.0]];
    let uv = UvMap { coordinates, corners: faces.indices().to_vec() };
    let c = certify(&points, &faces, &uv, &CertificateOptions::default()).unwrap();
    assert_eq!((c.charts, c.overlaps.triangle_pairs, c.overlaps.boundary_crossings), (2, 1, 0));
    assert_eq!(c.overlaps.faces, [[0, 1]], "face 2 is face 0 once more");
}

#[test]
fn seams_by_value_and_texel_density() {
    // Two quads side by side on the surface, apart in the plane, the second at twice the size.
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];
    let mut faces = Polygons::new();
    faces.push(&[0, 1, 4, 3]);
    faces.push(&[1, 2, 5, 4]);
    let square = |x: f64, s: f64| [[x, 0.0], [x + s, 0.0], [x + s, s], [x, s]];
    let apart = [square(0.0, 1.0), square(5.0, 2.0)].concat();
    let uv = UvMap { coordinates: apart, corners: (0..8).collect() };
    let c = certify(&points, &faces, &uv, &CertificateOptions::default()).unwrap();
    assert_eq!((c.charts, c.seam_length, c.density_spread), (2, 1.0, 2.0));
    assert_eq!(c.relative_seam_length, 1.0 / 5f64.sqrt());
    assert_eq!(c.packing, 5.0 / 49.0);
    // The same values under other indices are no seam; and a face without coordinates is none either.
    let joined = [square(0.0, 1.0), square(1.0, 1.0)].concat();
    let uv = UvMap { coordinates: joined, corners: (0..8).collect() };
    let c = certify(&points, &faces, &uv, &CertificateOptions::default()).unwrap();
    assert_eq!((c.charts, c.seam_length, c.overlaps.boundary_touches), (1, 0.0, 0));
    let uv = UvMap { corners: [0, 1, 2, 3, UvMap::NONE, UvMap::NONE, UvMap::NONE, UvMap::NONE].into(), ..uv };
    let c = certify(&points, &faces, &uv, &CertificateOptions::default()).unwrap();
    assert_eq!((c.unmapped_faces, c.triangles, c.seam_length), (1, 2, 0.0));
}

#[test]
fn a_folded_grid_is_counted_whole() {
    // Folded in the middle: every triangle of one half lies over those of the other.
    let n = 20;
    let c = certified(&grid(n, |i, j| [(i as f64 - 10.0).abs(), j as f64]));
    assert_eq!(c.flips, n * n);
    // Each quad over its mirror image, whose diagonal is the other one: all four pairs of halves overlap.
    assert_eq!(c.overlaps.triangle_pairs, 4 * (n * n / 2) as u64);
    assert_eq!(c.overlaps.faces.len(), MOST_EXAMPLES / 4);
    assert!(c.overlaps.complete);
    assert!((c.distortion.energy - 1.0).abs() < 1e-14, "|s| of flipped triangles");
}

#[test]
fn signs_do_not_depend_on_scale_nor_threads() {
    let wavy = |s: f64, o: f64| {
        grid(40, move |i, j| {
            let (x, y) = (i as f64, j as f64);
            [s * (x + 2.0 * (0.9 * y).sin()) + o, s * (y + (1.1 * x).cos() * 1.2) + o]
        })
    };
    let one = certified(&wavy(1.0, 0.0));
    assert!(one.flips > 10 && one.overlaps.triangle_pairs > 10 && one.overlaps.boundary_crossings > 0);
    for power in [-300, -60, 60, 300] {
        let c = certified(&wavy(2f64.powi(power), 0.0));
        assert_eq!((c.flips, c.overlaps), (one.flips, one.overlaps.clone()));
        assert!((c.distortion.energy - one.distortion.energy).abs() < 1e-12 * one.distortion.energy);
    }
    let map = wavy(1.0, 7.0);
    let on = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| certified(&map));
    assert_eq!(on(1), on(3));
}

#[test]
fn rest_area_is_decided_exactly() {
    // On one line up to rounding only; and on one line.
    let almost = [[0.1, 0.1, 0.0], [0.2, 0.2, 0.0], [0.3, 0.3f64.next_up(), 0.0]];
    let exact = [[0.125, 0.125, 0.5], [0.25, 0.25, 0.5], [0.375, 0.375, 0.5]];
    assert!(has_rest_area(almost) && !has_rest_area(exact));
    for s in [2f64.powi(-300), 2f64.powi(300)] {
        assert!(has_rest_area(almost.map(|p| p.map(|x| x * s))));
    }
    assert!(!has_rest_area([[1.0; 3]; 3]) && !has_rest_area([[0.0; 3]; 3]));
}

#[test]
fn refusals() {
    let (points, faces, uv) = grid(1, |i, j| [i as f64, j as f64]);
    let options = CertificateOptions::default();
    let refused =
        |uv: &UvMap, options: &CertificateOptions| certify(&points, &faces, uv, options).unwrap_err().to_string();
    let short = UvMap { corners: vec![0; 3], ..uv.clone() };
    assert_eq!(refused(&short, &options), "UV map: 3 corners for faces of 4 corners; give the map of these faces");
    let beyond = UvMap { corners: vec![0, 1, 2, 9], ..uv.clone() };
    assert!(refused(&beyond, &options).contains("face 0 (0-based): coordinate 9 is out of range"));
    let partial = UvMap { corners: vec![0, 1, 2, UvMap::NONE], ..uv.clone() };
    assert!(refused(&partial, &options).contains("3 of its 4 corners have coordinates"));
    let nan = UvMap { coordinates: vec![[f64::NAN; 2]; 4], ..uv.clone() };
    assert!(refused(&nan, &options).contains("a coordinate is NaN"));
    assert!(refused(&uv, &CertificateOptions { reversed_faces: vec![7] }).contains("reversed face 7"));
    assert!(certify(&points[..2], &faces, &uv, &options).unwrap_err().to_string().contains("out of range"));
    let empty = certify(&[], &Polygons::new(), &UvMap::default(), &options).unwrap();
    assert_eq!((empty.triangles, empty.charts, empty.uv_box), (0, 0, None));
}
