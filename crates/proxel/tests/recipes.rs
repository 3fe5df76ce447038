//! Recipes: every kind of constraint, selections, contradictions, refusals.

use proxel::deform::Hooks;
use proxel::mesh::{Mesh, Polygons};
use proxel::shape::{Recipe, RecipeFile, ShapeInput, ShapeReport, ShapeSettings, Shaped, shape};
use proxel::split::Status;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A wavy roof of 10 x 10 quads, one unit wide each.
fn roof() -> Mesh {
    let n = 10;
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (f64::from(i), f64::from(j));
            points.push([x, y, (0.6 * x).sin() * (0.5 * y).cos() + 0.005 * x * y]);
        }
    }
    let mut faces = Polygons::new();
    for i in 0..n as u32 {
        for j in 0..n as u32 {
            let v = 11 * i + j;
            faces.push(&[v, v + 11, v + 12, v + 1]);
        }
    }
    Mesh { name: "roof.obj".to_string(), points, faces, ..Mesh::default() }
}

fn parse(text: &str) -> Result<Recipe, String> {
    let text = format!("mesh = \"roof.obj\"\n{text}");
    RecipeFile::parse("r.toml".to_string(), &text, false, PathBuf::new()).map(|f| f.recipe).map_err(|e| e.to_string())
}

fn try_run(text: &str) -> Result<Shaped, String> {
    let recipe = parse(text)?;
    let input = ShapeInput { mesh: roof(), reference: None };
    let settings = ShapeSettings { mu: recipe.solver.mu, ..ShapeSettings::recipe() };
    shape(&recipe, &input, &BTreeMap::new(), &settings, &mut Hooks::default()).map_err(|e| e.to_string())
}

fn run(text: &str) -> Shaped {
    try_run(text).expect("a recipe that can be solved")
}

fn told(shaped: &Shaped) -> &ShapeReport {
    shaped.report.shape.as_ref().expect("a report of shapes")
}

/// Near the roof, and fair: on the surface alone vertices would slide, and faces fold.
const NEAR: &str =
    "[[constraint]]\nkind = \"near\"\nweight = 1\n[[constraint]]\nkind = \"relative-laplacian\"\nweight = 0.1\n";

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|d| a[d] - b[d])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|d| a[d] * b[d]).sum()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// The positions of a face.
fn corners(shaped: &Shaped, f: usize) -> Vec<[f64; 3]> {
    roof().faces.get(f).iter().map(|v| shaped.positions[*v as usize]).collect()
}

/// Solves, and checks that every hard constraint holds and that something had to move.
fn holds(text: &str) -> Shaped {
    let shaped = run(text);
    assert_eq!(shaped.status, Status::Converged, "{text}{}", shaped.report.reason);
    let hard: Vec<_> = told(&shaped).constraints.iter().filter(|c| c.hard).collect();
    assert!(!hard.is_empty() && hard.iter().all(|c| c.violation_max.after <= 1e-8), "{text}{hard:?}");
    assert!(hard.iter().any(|c| c.violation_max.before > 1e-3), "{text}nothing was to be done: {hard:?}");
    shaped
}

// What holds is measured here by other formulas than those of the sets.

#[test]
fn faces_of_every_kind() {
    let of = |kind: &str, more: &str| holds(&format!("[[constraint]]\nkind = \"{kind}\"\n{more}{NEAR}"));
    let volume = |p: &[[f64; 3]]| dot(cross(sub(p[1], p[0]), sub(p[2], p[0])), sub(p[3], p[0])).abs();
    let planar = of("planar", "");
    assert!((0..100).all(|f| volume(&corners(&planar, f)) < 1e-9));
    // Opposite angles of a cyclic quad sum to pi: Ptolemy's equality of sides and diagonals.
    let circle = of("circle", "");
    for f in 0..100 {
        let p = corners(&circle, f);
        let d = |i: usize, j: usize| norm(sub(p[i], p[j]));
        let ptolemy = d(0, 2) * d(1, 3) - d(0, 1) * d(2, 3) - d(1, 2) * d(3, 0);
        assert!(ptolemy.abs() < 1e-9 && volume(&p) < 1e-9, "{f}: {ptolemy} {}", volume(&p));
    }
    let conical = of("conical", "[[constraint]]\nkind = \"planar\"\n");
    for (i, j) in (1..10).flat_map(|i| (1..10).map(move |j| (i, j))) {
        let at = |i: usize, j: usize| conical.positions[11 * i + j];
        let around = [at(i + 1, j), at(i, j + 1), at(i - 1, j), at(i, j - 1)].map(|p| sub(p, at(i, j)));
        let angle = |k: usize| {
            let (a, b) = (around[k], around[(k + 1) % 4]);
            (dot(a, b) / (norm(a) * norm(b))).acos()
        };
        assert!((angle(0) + angle(2) - angle(1) - angle(3)).abs() < 1e-9);
    }
    let parallelogram = of("parallelogram", "");
    for f in 0..100 {
        let p = corners(&parallelogram, f);
        assert!((0..3).all(|d| (p[0][d] + p[2][d] - p[1][d] - p[3][d]).abs() < 1e-9));
    }
    let rectangle = of("rectangle", "faces = [5, 17, 33]\n");
    for f in [5, 17, 33] {
        let p = corners(&rectangle, f);
        let right = |k: usize| dot(sub(p[(k + 1) % 4], p[k]), sub(p[(k + 3) % 4], p[k])).abs() < 1e-9;
        assert!((0..4).all(right), "{p:?}");
    }
    let regular = of("regular", "faces = [5, 17, 33]\n");
    for f in [5, 17, 33] {
        let p = corners(&regular, f);
        let sides: Vec<f64> = (0..4).map(|k| norm(sub(p[(k + 1) % 4], p[k]))).collect();
        let diagonals = [norm(sub(p[2], p[0])), norm(sub(p[3], p[1]))];
        assert!(sides.iter().all(|s| (s - sides[0]).abs() < 1e-9 && (s * 2f64.sqrt() - diagonals[0]).abs() < 1e-9));
        assert!((diagonals[0] - diagonals[1]).abs() < 1e-9);
    }
}

#[test]
fn shapes_lines_lengths_and_angles() {
    let at = |v: u32, p: [f64; 3]| format!("[[constraint]]\nkind = \"at\"\nvertices = [{v}]\npoints = [{p:?}]\n");
    let patch = [0, 1, 2, 11, 12, 13];
    let before = roof().points;
    let ratios = |shaped: &Shaped| {
        let pairs = (0..6).flat_map(|i| (0..i).map(move |j| (patch[i], patch[j])));
        let length = |p: &[[f64; 3]], (i, j): (usize, usize)| norm(sub(p[i], p[j]));
        pairs.map(|ij| length(&shaped.positions, ij) / length(&before, ij)).collect::<Vec<f64>>()
    };
    let moved = at(0, [-1.0, -1.0, 0.5]) + &at(13, [2.0, 1.5, 0.0]);
    let similar = holds(&format!("[[constraint]]\nkind = \"similar\"\nvertices = {patch:?}\n{moved}{NEAR}"));
    let all = ratios(&similar);
    assert!(all.iter().all(|r| (r - all[0]).abs() < 1e-9) && all[0] > 1.2, "{all:?}");
    let one = at(0, [-1.0, -1.0, 0.5]);
    let rigid = holds(&format!("[[constraint]]\nkind = \"rigid\"\nvertices = {patch:?}\n{one}{NEAR}"));
    assert!(ratios(&rigid).iter().all(|r| (r - 1.0).abs() < 1e-9));
    let row: Vec<u32> = (0..=10).map(|j| 44 + j).collect();
    let line = holds(&format!("[[constraint]]\nkind = \"line\"\nvertices = {row:?}\n{NEAR}"));
    let p = |v: u32| line.positions[v as usize];
    assert!(row.iter().all(|v| norm(cross(sub(p(*v), p(44)), sub(p(54), p(44)))) < 1e-8));
    let keep =
        holds(&format!("[[constraint]]\nkind = \"edge-length\"\nlength = \"keep\"\n{}{NEAR}", at(0, [0.0, 0.0, 1.0])));
    let length = |points: &[[f64; 3]], a: usize, b: usize| norm(sub(points[a], points[b]));
    assert!((length(&keep.positions, 0, 1) - length(&before, 0, 1)).abs() < 1e-9);
    assert_eq!(keep.positions[0].map(|c| (c * 1e9).round() / 1e9), [0.0, 0.0, 1.0]);
    let within = holds(&format!("[[constraint]]\nkind = \"edge-length\"\nmin = 1.0\nmax = 1.1\n{NEAR}"));
    assert!((0..110).filter(|v| v % 11 != 10).all(|v| (1.0 - 1e-9..1.1 + 1e-9).contains(&length(
        &within.positions,
        v,
        v + 1
    ))));
    let square = holds(&format!("[[constraint]]\nkind = \"angle\"\nmin = 84\nmax = 96\n{NEAR}"));
    for f in 0..100 {
        let p = corners(&square, f);
        for k in 0..4 {
            let (a, b) = (sub(p[(k + 1) % 4], p[k]), sub(p[(k + 3) % 4], p[k]));
            let angle = (dot(a, b) / (norm(a) * norm(b))).acos().to_degrees();
            assert!((84.0 - 1e-7..96.0 + 1e-7).contains(&angle), "{angle}");
        }
    }
}

#[test]
fn places_planes_and_mirrors() {
    // The border slides on a polygon above it.
    let points = "points = [[0, 0, 1], [10, 0, 2], [10, 10, 1], [0, 10, 2]]\nclosed = true\n";
    let fair = "[[constraint]]\nkind = \"laplacian\"\nweight = 1\n";
    let curve = holds(&format!("[[constraint]]\nkind = \"curve\"\n{points}{fair}"));
    let side = |p: [f64; 3]| {
        let ends = [[0.0, 0.0, 1.0], [10.0, 0.0, 2.0], [10.0, 10.0, 1.0], [0.0, 10.0, 2.0]];
        let off = |k: usize| {
            let (a, b) = (ends[k], ends[(k + 1) % 4]);
            norm(cross(sub(p, a), sub(b, a))) / norm(sub(b, a))
        };
        (0..4).map(off).fold(f64::INFINITY, f64::min)
    };
    assert!((0..11).all(|j| side(curve.positions[j]) < 1e-8 && side(curve.positions[110 + j]) < 1e-8));
    let ground = "[[constraint]]\nkind = \"plane\"\npoint = [0, 0, -0.2]\nnormal = [0, 0, 1]\none-sided = true\n";
    let above = holds(&format!("{ground}{NEAR}"));
    assert!(above.positions.iter().all(|p| p[2] >= -0.2 - 1e-9) && above.positions.iter().any(|p| p[2] > 0.5));
    let pairs: Vec<[u32; 2]> = (0..11).map(|j| [j, 110 + j]).collect();
    let mirror = format!(
        "[[constraint]]\nkind = \"symmetric\"\npoint = [5, 5, 0]\nnormal = [1, 0, 0]\npairs = {pairs:?}\n{NEAR}"
    );
    let mirrored = holds(&mirror);
    for [a, b] in pairs {
        let [a, b] = [a, b].map(|v| mirrored.positions[v as usize]);
        assert!((a[0] + b[0] - 10.0).abs() < 1e-8 && (a[1] - b[1]).abs() < 1e-8 && (a[2] - b[2]).abs() < 1e-8);
    }
    // Fixed vertices stay to the bit, selections by box and by name; a soft constraint is only as good as its weight.
    let fixed = "[select]\ncorner = { box = [[-1, -1, -9], [1.5, 1.5, 9]] }\n[[constraint]]\nkind = \"fixed\"\nvertices = \"corner\"\n";
    let held = holds(&format!(
        "{fixed}[[constraint]]\nkind = \"planar\"\nfaces = {{ box = [[3, 3, -9], [9, 9, 9]] }}\n{NEAR}"
    ));
    assert!([0, 1, 11, 12].iter().all(|v| held.positions[*v] == roof().points[*v]));
    let soft = |w: f64| {
        let shaped = run(&format!("[[constraint]]\nkind = \"planar\"\nname = \"flat\"\nweight = {w}\n{NEAR}"));
        let flat = &told(&shaped).constraints[0];
        assert!(flat.name == "flat" && !flat.hard && flat.elements == 100, "{flat:?}");
        flat.violation_max.after
    };
    let (loose, tight) = (soft(0.1), soft(100.0));
    assert!(tight < 0.5 * loose && tight > 1e-6, "{loose} {tight}");
}

#[test]
fn contradictions_are_told_by_name() {
    let both = "[[constraint]]\nkind = \"at\"\nname = \"up\"\nvertices = [0]\npoints = [[0, 0, 1]]\n[[constraint]]\nkind = \"fixed\"\nname = \"down\"\nvertices = [0]\n";
    let shaped = run(&format!("{both}{NEAR}"));
    assert_eq!(shaped.status, Status::Stopped);
    assert!(shaped.report.reason.contains("contradict"), "{}", shaped.report.reason);
    let violated = &told(&shaped).violated;
    // Half of the way each, over the mean edge.
    let mean = told(&shaped).mean_edge;
    let names: Vec<&str> = violated.iter().map(|v| &v.kind[..]).collect();
    assert!(names == ["down", "up"] && violated.iter().all(|v| v.vertices == [0]), "{violated:?}");
    assert!(violated.iter().all(|v| (v.violation * mean - 0.5).abs() < 1e-3), "{violated:?}");
    // What else is asked for is as it was.
    assert!(shaped.positions.iter().flatten().all(|c| c.is_finite()));
}

#[test]
fn what_makes_no_sense_is_refused_by_place() {
    let refused = |text: &str| match try_run(text) {
        Err(said) => said,
        Ok(shaped) => panic!("{text} is no recipe, yet {}", shaped.report.reason),
    };
    let one = |body: &str| refused(&format!("[[constraint]]\n{body}\n"));
    for (body, says) in [
        (
            "kind = \"planar\"\nlength = 3",
            "constraint 0 (planar): `length` is no key of planar; its keys are faces, vertices",
        ),
        ("kind = \"plannar\"", "did you mean `planar`?"),
        ("kind = \"planar\"\nfases = [0]", "did you mean `faces`?"),
        ("kind = \"planar\"\nweight = 0", "`weight` is 0"),
        ("kind = \"planar\"\nfaces = \"feet\"", "there is no selection `feet`; known are all, border, inner"),
        ("kind = \"planar\"\nfaces = [100]", "face 100 is out of range, the faces are 0 to 99"),
        ("kind = \"planar\"\nfaces = [3, 3]", "face 3 is named twice"),
        ("kind = \"planar\"\nfaces = { corners = 5 }", "about nothing"),
        ("kind = \"planar\"\nvertices = [0, 1, 2]", "`vertices` are 3, planar is about at least 4"),
        ("kind = \"planar\"\nvertices = [0]\nfaces = [0]", "`faces` and `vertices` exclude each other"),
        ("kind = \"line\"", "`vertices` is missing"),
        ("kind = \"angle\"", "give `min`, `max` or both"),
        ("kind = \"angle\"\nmin = 200", "`min` is 200; give degrees"),
        ("kind = \"angle\"\nmin = 90\nmax = 80", "give the least first"),
        ("kind = \"edge-length\"\nlength = -1.0", "`length` is -1"),
        ("kind = \"edge-length\"\nlength = \"long\"", "r.toml"),
        ("kind = \"edge-length\"\nlength = 1.0\nedges = [[0, 0]]", "has one end only"),
        ("kind = \"edge-length\"\nlength = 1.0\nedges = [[0, 1], [1, 0]]", "is named twice"),
        ("kind = \"at\"\nvertices = [0, 1]\npoints = [[0, 0, 0]]", "`points` has 1 of them for 2 vertices"),
        ("kind = \"at\"\nvertices = [0]\npoints = [[0, nan, 0]]", "a coordinate is NaN"),
        ("kind = \"plane\"\npoint = [0, 0, 0]\nnormal = [0, 0, 0]", "the `normal` has no direction"),
        ("kind = \"symmetric\"\npoint = [0, 0, 0]\nnormal = [1, 0, 0]\npairs = [[0, 500]]", "vertex 500 of `pairs`"),
        ("kind = \"conical\"\nvertices = [0]", "vertex 0 is no inner one of four faces"),
        ("kind = \"near\"\nto = \"other.obj\"", "`other.obj` has not been read"),
        ("kind = \"laplacian\"", "laplacian is soft"),
    ] {
        let said = one(body);
        assert!(said.contains(says), "{body}: {said}");
    }
    assert!(refused("").contains("there is none; add a [[constraint]]"));
    assert!(refused("[select]\nall = [0]\n[[constraint]]\nkind = \"planar\"\n").contains("select.all"));
    assert!(refused("[select]\na = \"b\"\n[[constraint]]\nkind = \"planar\"\n").contains("no selection `b`"));
    assert!(refused("stay = -1\n[[constraint]]\nkind = \"planar\"\n").contains("stay: it is -1"));
}
