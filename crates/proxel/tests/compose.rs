//! Problems put together by hand are the ones that commands solve.

use proxel::compose::{ComposeMethod, ComposeSettings, Composed, Composition, OwnSets, Part, Projection, solve};
use proxel::deform::{DeformInput, ElementEnergy, Hooks, Matrix, OwnEnergy, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::mesh::{Mesh, Polygons};
use proxel::settings::{DeformSettings, Material, MethodName};
use proxel::shape::{ShapeInput, ShapeMethod, ShapeSettings, planarize};
use proxel::split::Status;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

type V3 = [f64; 3];

fn run(of: &Composition, settings: &ComposeSettings) -> Composed {
    let solved = solve(of, settings, &mut Hooks::default()).unwrap();
    assert_eq!(solved.status, Status::Converged, "{}", solved.report.reason);
    solved
}

fn by(method: ComposeMethod) -> ComposeSettings {
    // Threads are of no use to problems as small as these.
    ComposeSettings { method, threads: Some(1), ..ComposeSettings::default() }
}

fn largest_gap(a: &[V3], b: &[V3]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Quads over a heightfield whose faces are not planar.
fn quads(n: usize) -> Mesh {
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut faces = Polygons::new();
    for i in 0..n {
        for j in 0..n {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    let place = |k: usize| {
        let [x, y] = [k / (n + 1), k % (n + 1)].map(|c| 2.0 * c as f64 / n as f64 - 1.0);
        [x, y, 0.3 * (2.5 * x).sin() * (2.0 * y).cos() + 0.1 * x * y]
    };
    Mesh { points: (0..(n + 1) * (n + 1)).map(place).collect(), faces, ..Mesh::default() }
}

/// Planes of quads by Jacobi's rotations: nothing of the library in it.
struct Planes;

impl Projection for Planes {
    fn project(&self, rows: &mut [V3]) {
        for v in rows.chunks_exact_mut(4) {
            let mut a = [[0.0; 3]; 3];
            for p in v.iter() {
                (0..9).for_each(|k| a[k / 3][k % 3] += p[k / 3] * p[k % 3]);
            }
            let mut q = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            for _ in 0..30 {
                for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                    let angle = 0.5 * (2.0 * a[i][j]).atan2(a[j][j] - a[i][i]);
                    let (sin, cos) = angle.sin_cos();
                    let mut r = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                    (r[i][i], r[j][j], r[i][j], r[j][i]) = (cos, cos, sin, -sin);
                    let product = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| -> [[f64; 3]; 3] {
                        std::array::from_fn(|r| std::array::from_fn(|c| (0..3).map(|k| a[r][k] * b[k][c]).sum()))
                    };
                    let t = std::array::from_fn(|x| std::array::from_fn(|y| r[y][x]));
                    a = product(product(t, a), r);
                    q = product(q, r);
                }
            }
            let least = (0..3).min_by(|i, j| a[*i][*i].total_cmp(&a[*j][*j])).unwrap();
            let n = [q[0][least], q[1][least], q[2][least]];
            for p in v {
                let height: f64 = (0..3).map(|d| n[d] * p[d]).sum();
                (0..3).for_each(|d| p[d] -= height * n[d]);
            }
        }
    }
}

/// What `planarize` makes of a mesh, put together by hand.
fn planar(mesh: &Mesh, hard: bool, weight: f64) -> Composition {
    Composition {
        start: mesh.points.clone(),
        fairing: vec![(mesh.faces.clone(), 0.1)],
        parts: vec![
            Part::Near { points: (0..mesh.points.len() as u32).collect(), surface: mesh.clone(), weight: 1.0 },
            Part::Sets {
                elements: mesh.faces.indices().to_vec(),
                corners: 4,
                centred: true,
                sets: OwnSets(Arc::new(Planes)),
                hard,
                weight,
            },
        ],
        ..Composition::default()
    }
}

#[test]
fn planarity_by_a_projection_of_ones_own_is_that_of_planarize() {
    let mesh = quads(6);
    for max_iters in [1, 7, 60] {
        let settings =
            ShapeSettings { method: ShapeMethod::Admm, mu: 10.0, tol: 1e-14, max_iters, ..ShapeSettings::planarize() };
        let input = ShapeInput { mesh: mesh.clone(), reference: None };
        let built_in = planarize(&input, &settings, &mut Hooks::default()).unwrap();
        let own = ComposeSettings { tol: 1e-14, max_iters, ..by(ComposeMethod::Admm) };
        let own = solve(&planar(&mesh, true, 10.0), &own, &mut Hooks::default()).unwrap();
        assert_eq!((own.report.iterations, built_in.report.iterations), (max_iters, max_iters));
        let gap = largest_gap(&own.positions, &built_in.positions);
        assert!(gap < 1e-9, "{max_iters}: {gap}");
        assert!(largest_gap(&own.positions, &mesh.points) > 1e-3);
    }
}

/// Springs in the place of the surface, along which points could slide.
fn sprung(mesh: &Mesh, hard: bool, weight: f64) -> Composition {
    let mut out = planar(mesh, hard, weight);
    out.parts.remove(0);
    out.springs = mesh.points.iter().enumerate().map(|(v, p)| (v as u32, *p, 1.0)).collect();
    out
}

#[test]
fn it_converges_to_planes() {
    let of = sprung(&quads(5), true, 10.0);
    let accelerated = run(&of, &by(ComposeMethod::Auto));
    assert!(accelerated.violation < 1e-6 && accelerated.report.method == "aa-admm", "{}", accelerated.violation);
    let plain = run(&of, &by(ComposeMethod::Admm));
    let gap = largest_gap(&accelerated.positions, &plain.positions);
    assert!(gap < 1e-6, "{gap}");
}

/// Soft sets alone: whatever finds the minimum.
#[test]
fn methods_agree_on_soft_sets() {
    let mesh = quads(5);
    let of = sprung(&mesh, false, 0.5);
    let tight = |method| ComposeSettings { tol: 1e-11, max_iters: 50_000, ..by(method) };
    let expected = run(&of, &tight(ComposeMethod::Admm));
    for method in [ComposeMethod::AaAdmm, ComposeMethod::Lbfgs] {
        let other = run(&of, &tight(method));
        let gap = largest_gap(&other.positions, &expected.positions);
        assert!(gap < 1e-7, "{method:?}: {gap}");
        let (a, b) = (other.report.energy.unwrap(), expected.report.energy.unwrap());
        assert!((a - b).abs() < 1e-10 * b, "{a} {b}");
    }
}

fn bar() -> DeformInput {
    let rest = beam([4, 2, 2], [2.0, 1.0, 1.0], CellSplit::Five).unwrap();
    let ends = rest.points.iter().enumerate().filter(|(_, p)| p[0].abs() == 1.0);
    let fixed = ends.map(|(v, &[x, y, z])| (v as u32, [1.2 * x, y + 0.2 * x, z])).collect();
    DeformInput { rest, fixed, ..DeformInput::default() }
}

fn material() -> Material {
    Material { energy: "neo-hookean".to_string(), young: 1e3, poisson: 0.3, ..Material::default() }
}

fn elastic(input: &DeformInput) -> Composition {
    Composition {
        start: input.rest.points.clone(),
        fixed: input.fixed.clone(),
        loads: input.loads.clone(),
        springs: input.soft.clone(),
        parts: vec![Part::Elastic {
            rest: input.rest.points.clone(),
            elements: input.rest.tets.as_flattened().to_vec(),
            corners: 4,
            material: material(),
        }],
        ..Composition::default()
    }
}

#[test]
fn bodies_are_those_of_deform() {
    let mut input = bar();
    input.loads = vec![(22, [1.0, 2.0, -3.0])];
    input.soft = vec![(19, [0.1, 0.3, 0.2], 40.0)];
    let settings = DeformSettings { material: material(), ..DeformSettings::default() };
    let expected = deform(&input, &settings, &mut Hooks::default()).unwrap();
    for method in [ComposeMethod::Auto, ComposeMethod::Lbfgs, ComposeMethod::AaAdmm] {
        let own = run(&elastic(&input), &ComposeSettings { tol: 1e-10, ..by(method) });
        let gap = largest_gap(&own.positions, &expected.positions);
        assert!(gap < 1e-6, "{method:?}: {gap}");
        assert!((own.report.energy.unwrap() / expected.report.energy.unwrap() - 1.0).abs() < 1e-7);
        assert!(input.fixed.iter().all(|(v, p)| own.positions[*v as usize] == *p));
    }
}

/// mu |F - R|^2 is told apart from nothing here: psi = mu/2 |F - I|^2, whose forces are linear.
struct Linear;

impl ElementEnergy for Linear {
    fn evaluate(&self, gradients: &[Matrix], values: &mut [f64], stresses: &mut [Matrix]) {
        for ((f, psi), p) in gradients.iter().zip(values).zip(stresses) {
            *p = std::array::from_fn(|r| std::array::from_fn(|c| 100.0 * (f[r][c] - f64::from(u8::from(r == c)))));
            *psi = p.as_flattened().iter().map(|v| v * v / 200.0).sum();
        }
    }
}

#[test]
fn an_energy_of_ones_own_is_that_of_deform() {
    let input = DeformInput { energy: Some(OwnEnergy(Arc::new(Linear))), ..bar() };
    let like = Material { energy: "arap".to_string(), mu: Some(50.0), lambda: Some(0.0), ..Material::default() };
    let settings = DeformSettings { method: MethodName::Lbfgs, material: like.clone(), ..DeformSettings::default() };
    let expected = deform(&input, &settings, &mut Hooks::default()).unwrap();
    let own = Composition {
        parts: vec![Part::Own {
            rest: input.rest.points.clone(),
            tets: input.rest.tets.clone(),
            energy: OwnEnergy(Arc::new(Linear)),
            like,
        }],
        ..elastic(&input)
    };
    let own = run(&own, &by(ComposeMethod::Auto));
    assert_eq!(own.report.method, "lbfgs");
    assert!(largest_gap(&own.positions, &expected.positions) < 1e-7);
}

/// Points on the unit sphere; counts how often it is asked.
struct Sphere(AtomicUsize);

impl Projection for Sphere {
    fn project(&self, rows: &mut [V3]) {
        self.0.fetch_add(1, Ordering::Relaxed);
        for p in rows {
            let length = p.iter().map(|c| c * c).sum::<f64>().sqrt();
            *p = p.map(|c| c / length);
        }
    }
}

/// An elastic sheet with all points on a sphere: energies and hard sets together.
#[test]
fn elastic_elements_within_sets() {
    let mesh = quads(4);
    let sheet: Vec<u32> = mesh.faces.fan_triangles().into_flattened();
    let lifted: Vec<V3> = mesh.points.iter().map(|p| [0.4 * p[0], 0.4 * p[1], 1.0]).collect();
    let rest: Vec<V3> = lifted.iter().map(|p| [p[0], p[1], 0.0]).collect();
    let sphere = Arc::new(Sphere(AtomicUsize::new(0)));
    let of = Composition {
        start: lifted.clone(),
        fixed: vec![(12, [0.0, 0.0, 1.0])],
        parts: vec![
            Part::Elastic { rest, elements: sheet, corners: 3, material: material() },
            Part::Sets {
                elements: (0..25).collect(),
                corners: 1,
                centred: false,
                sets: OwnSets(sphere.clone()),
                hard: true,
                weight: 100.0,
            },
        ],
        ..Composition::default()
    };
    let on = run(&of, &ComposeSettings { max_iters: 20_000, ..by(ComposeMethod::Admm) });
    for p in &on.positions {
        let length = p.iter().map(|c| c * c).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() < 1e-6, "{length}");
    }
    // All points at once: no more calls than a few an iteration.
    assert!(sphere.0.load(Ordering::Relaxed) <= 3 * (on.report.iterations + 2));
    let one = solve(
        &of,
        &ComposeSettings { threads: Some(1), max_iters: 20, ..by(ComposeMethod::AaAdmm) },
        &mut Hooks::default(),
    );
    let two = solve(
        &of,
        &ComposeSettings { threads: Some(2), max_iters: 20, ..by(ComposeMethod::AaAdmm) },
        &mut Hooks::default(),
    );
    assert_eq!(one.unwrap().positions, two.unwrap().positions);
}

#[test]
fn what_does_not_fit_is_refused_with_a_remedy() {
    let mesh = quads(2);
    let refused = |of: &Composition, method| solve(of, &by(method), &mut Hooks::default()).unwrap_err().0;
    let sets = |hard, weight| planar(&mesh, hard, weight);
    for (of, method, says) in [
        (sets(true, 1.0), ComposeMethod::Lbfgs, "make them soft"),
        (sets(false, 1.0), ComposeMethod::Newton, "newton cannot take sets"),
        (sets(true, -1.0), ComposeMethod::Admm, "part 1: its weight is -1"),
        (Composition::default(), ComposeMethod::Auto, "there are no points"),
        (Composition { fixed: vec![(9, [0.0; 3])], ..sets(true, 1.0) }, ComposeMethod::Auto, "names point 9"),
        (
            Composition { start: vec![[f64::NAN, 0.0, 0.0]; 9], ..sets(true, 1.0) },
            ComposeMethod::Auto,
            "point 0 (0-based)",
        ),
    ] {
        let text = refused(&of, method);
        assert!(text.contains(says), "{text}");
    }
    // Nothing says where a face is.
    let mut floating = sets(true, 1.0);
    floating.parts.remove(0);
    floating.fairing.clear();
    let text = refused(&floating, ComposeMethod::Admm);
    assert!(text.contains("nothing says where its part is"), "{text}");
    let own = Part::Own {
        rest: bar().rest.points,
        tets: bar().rest.tets,
        energy: OwnEnergy(Arc::new(Linear)),
        like: material(),
    };
    let own = Composition { parts: vec![own], ..elastic(&bar()) };
    let text = refused(&own, ComposeMethod::AaAdmm);
    assert!(text.contains("use lbfgs"), "{text}");
}
