//! Gradients through a deformation, against central differences of whole runs.

use proxel::deform::{Adjoint, DeformInput, Deformation, Hooks, adjoint, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::mesh::{Mesh, Polygons};
use proxel::pins::HalfSpace;
use proxel::settings::{DeformSettings, Material, MethodName, SurfaceModel};
use proxel::split::Status;
use proxel_testkit::SplitMix as Random;

type V3 = [f64; 3];

fn solve(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    let result = deform(input, settings, &mut Hooks::default()).unwrap();
    assert_eq!(result.status, Status::Converged, "{}", result.report.reason);
    result
}

/// L(X) = sum a_v . X_v + 1/2 sum b_v |X_v|^2 with numbers that follow from v.
fn coefficients(v: usize) -> (V3, f64) {
    let t = v as f64;
    ([(1.3 * t).sin(), (2.1 * t + 0.4).cos(), (0.7 * t - 1.0).sin()], (0.9 * t).cos())
}

fn loss(x: &[V3]) -> f64 {
    let of = |(v, x): (usize, &V3)| {
        let (a, b) = coefficients(v);
        (0..3).map(|d| a[d] * x[d] + 0.5 * b * x[d] * x[d]).sum::<f64>()
    };
    x.iter().enumerate().map(of).sum()
}

fn slope(x: &[V3]) -> Vec<V3> {
    let of = |(v, x): (usize, &V3)| {
        let (a, b) = coefficients(v);
        [0, 1, 2].map(|d| a[d] + b * x[d])
    };
    x.iter().enumerate().map(of).collect()
}

fn gradients(input: &DeformInput, settings: &DeformSettings) -> Adjoint {
    let result = solve(input, settings);
    adjoint(input, settings, &result, &slope(&result.positions)).unwrap()
}

fn dot(a: &[V3], b: &[V3]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

/// The derivative at 0 of what `of` does to the problem, by runs at four steps, is `found` to 1e-5.
fn check(
    what: &str,
    found: f64,
    (input, settings): (&DeformInput, &DeformSettings),
    of: impl Fn(f64, &mut DeformInput, &mut DeformSettings),
) {
    const STEP: f64 = 2e-3;
    let at = |t: f64| {
        let (mut input, mut settings) = (input.clone(), settings.clone());
        of(t, &mut input, &mut settings);
        loss(&solve(&input, &settings).positions)
    };
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|k| at(k * STEP));
    let difference = (a - 8.0 * b + 8.0 * c - d) / (12.0 * STEP);
    let off = (found - difference).abs();
    assert!(off <= 1e-5 * difference.abs() && difference != 0.0, "{what}: {found} is no {difference}");
}

/// A direction for each of n rows; in the plane without a third number.
fn direction(n: usize, seed: u64, planar: bool) -> Vec<V3> {
    let mut random = Random::new(seed);
    (0..n).map(|_| random.array::<3>(-1.0, 1.0)).map(|d| if planar { [d[0], d[1], 0.0] } else { d }).collect()
}

fn add(to: &mut V3, t: f64, d: V3) {
    (0..3).for_each(|k| to[k] += t * d[k]);
}

/// Targets, rest positions, forces and moduli, each along a random direction. `size` is that of an edge.
fn check_all(what: &str, input: &DeformInput, settings: &DeformSettings, size: f64) {
    let found = gradients(input, settings);
    assert!(found.distance < 1e-6 * size, "{what}: {}", found.distance);
    let along = direction(input.fixed.len(), 1, settings.planar);
    check(&format!("{what}: targets"), size * dot(&found.fixed, &along), (input, settings), |t, input, _| {
        input.fixed.iter_mut().zip(&along).for_each(|((_, target), d)| add(target, t * size, *d));
    });
    let along = direction(found.rest.len(), 2, settings.planar);
    check(&format!("{what}: rest"), size * dot(&found.rest, &along), (input, settings), |t, input, _| {
        input.rest.points.iter_mut().zip(&along).for_each(|(p, d)| add(p, t * size, *d));
    });
    let force = settings.material.young * size * size;
    let along = direction(input.rest.n_verts(), 3, settings.planar);
    let along: Vec<V3> = along.into_iter().map(|d| d.map(|d| d * force)).collect();
    check(&format!("{what}: forces"), dot(&found.forces, &along), (input, settings), |t, input, _| {
        let fixed: Vec<u32> = input.fixed.iter().map(|f| f.0).collect();
        input.loads.extend(
            along
                .iter()
                .enumerate()
                .filter(|(v, _)| !fixed.contains(&(*v as u32)))
                .map(|(v, d)| (v as u32, d.map(|d| t * d))),
        );
    });
    // Under a load, or Young's modulus changes nothing.
    let load = |input: &DeformInput| DeformInput {
        loads: (0..input.rest.n_verts() as u32)
            .filter(|v| input.fixed.iter().all(|f| f.0 != *v))
            .map(|v| (v, [0.01, 0.02, if settings.planar { 0.0 } else { -0.03 }].map(|f| f * force)))
            .collect(),
        ..input.clone()
    };
    let loaded = load(input);
    let found = gradients(&loaded, settings);
    let (young, poisson) = (found.material.young.unwrap(), found.material.poisson.unwrap());
    check(&format!("{what}: young"), settings.material.young * young, (&loaded, settings), |t, _, settings| {
        settings.material.young *= 1.0 + t;
    });
    if settings.material.energy == "spring" {
        assert!(poisson.abs() <= 1e-9 * (settings.material.young * young).abs(), "{poisson}");
    } else {
        check(&format!("{what}: poisson"), poisson, (&loaded, settings), |t, _, settings| {
            settings.material.poisson += t
        });
    }
}

fn of(energy: &str, young: f64, poisson: f64) -> DeformSettings {
    DeformSettings {
        material: Material { energy: energy.to_string(), young, poisson, ..Material::default() },
        tol: 1e-11,
        ..DeformSettings::default()
    }
}

/// A bar, stretched and turned at its right end.
fn bar() -> DeformInput {
    let rest = beam([4, 2, 2], [2.0, 1.0, 1.0], CellSplit::Five).unwrap();
    let (sin, cos) = 0.6_f64.sin_cos();
    let ends = rest.points.iter().enumerate().filter(|(_, p)| p[0].abs() == 1.0);
    let place =
        |&[x, y, z]: &V3| if x < 0.0 { [x, y, z] } else { [1.15 * x, cos * y - sin * z + 0.1, sin * y + cos * z] };
    let fixed = ends.map(|(v, p)| (v as u32, place(p))).collect();
    DeformInput { rest, fixed, ..DeformInput::default() }
}

#[test]
fn through_bodies_of_every_material() {
    for energy in [
        "neo-hookean",
        "stable-neo-hookean",
        "stvk",
        "corotated",
        "fixed-corotated",
        "arap",
        "symmetric-dirichlet",
        "symmetric-gradient",
    ] {
        check_all(energy, &bar(), &of(energy, 3e4, 0.3), 0.5);
    }
}

#[test]
fn units_and_nearly_incompressible_rubber() {
    let mut input = bar();
    input.rest.points.iter_mut().for_each(|p| *p = p.map(|v| 1e-3 * v + 7.0));
    input.fixed.iter_mut().for_each(|(_, p)| *p = p.map(|v| 1e-3 * v + 7.0));
    let settings = of("neo-hookean", 1e7, 0.49);
    let result = solve(&input, &settings);
    let found = adjoint(&input, &settings, &result, &slope(&result.positions)).unwrap();
    let along = direction(input.fixed.len(), 1, false);
    check("targets", 5e-4 * dot(&found.fixed, &along), (&input, &settings), |t, input, _| {
        input.fixed.iter_mut().zip(&along).for_each(|((_, target), d)| add(target, t * 5e-4, *d));
    });
    check("poisson", 0.1 * found.material.poisson.unwrap(), (&input, &settings), |t, _, settings| {
        settings.material.poisson += 0.1 * t;
    });
}

/// A grid of n x n cells over [0, 1]^2.
fn grid(n: usize) -> Mesh {
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut faces = Polygons::new();
    for i in 0..n {
        for j in 0..n {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push(&[at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    let place = |k: usize| [(k / (n + 1)) as f64 / n as f64, (k % (n + 1)) as f64 / n as f64, 0.0];
    Mesh { points: (0..(n + 1) * (n + 1)).map(place).collect(), faces, ..Mesh::default() }
}

/// Held at its border, which is pulled apart and bent.
fn sheet(n: usize, lift: f64) -> DeformInput {
    let rest = grid(n);
    let on_border = |p: &V3| p[..2].iter().any(|v| *v == 0.0 || *v == 1.0);
    let place = |p: &V3| [1.2 * p[0], 1.1 * p[1] + 0.1 * p[0] * p[0], lift * p[0] * p[1]];
    let border = rest.points.iter().enumerate().filter(|(_, p)| on_border(p));
    let fixed = border.map(|(v, p)| (v as u32, place(p))).collect();
    DeformInput { rest, fixed, ..DeformInput::default() }
}

#[test]
fn through_sheets_in_space_and_in_the_plane() {
    let shell = DeformSettings { surface: SurfaceModel::Shell, ..of("stvk", 1e4, 0.3) };
    let heavy = DeformSettings { density: 30.0, gravity: [0.0, 1.0, -9.81], ..shell.clone() };
    check_all("heavy sheet", &sheet(4, 0.3), &heavy, 0.25);
    let energy = |energy: &str| Material { energy: energy.to_string(), ..shell.material.clone() };
    check_all("sheet", &sheet(4, 0.3), &DeformSettings { material: energy("neo-hookean"), ..shell.clone() }, 0.25);
    let planar = DeformSettings { planar: true, ..of("mips", 1e4, 0.3) };
    check_mips(&planar);
    check_all("plane", &sheet(4, 0.0), &DeformSettings { planar: true, ..of("neo-hookean", 1e4, 0.3) }, 0.25);
}

/// Stiff against bending, so that it is bending that tells where the sheet is; held by two opposite sides, curved at rest and
/// of triangles that are all different.
#[test]
fn through_sheets_that_bend() {
    let mut input = sheet(4, 0.5);
    let mut random = Random::new(9);
    for p in &mut input.rest.points {
        let [x, y] = random.array(-0.05, 0.05);
        *p = [p[0] + x, p[1] + y, 0.3 * (2.0 * p[0]).sin() + 0.1 * p[0] * p[1]];
    }
    input.fixed.retain(|(v, _)| v % 5 == 0 || v % 5 == 4);
    let shell = DeformSettings { surface: SurfaceModel::Shell, bending: 400.0, ..of("stvk", 1e4, 0.3) };
    check_all("bent sheet", &input, &shell, 0.25);
    // What bending has to do with it, or the check above would pass without it.
    let (stiff, slack) = (gradients(&input, &shell), gradients(&input, &DeformSettings { bending: 1e-3, ..shell }));
    let off: Vec<V3> = stiff.rest.iter().zip(&slack.rest).map(|(a, b)| [0, 1, 2].map(|d| a[d] - b[d])).collect();
    assert!(dot(&off, &off) > 0.1 * dot(&stiff.rest, &stiff.rest));
}

/// MIPS has no lambda: what mu does is all.
fn check_mips(settings: &DeformSettings) {
    let found = gradients(&sheet(4, 0.0), settings);
    assert!(found.material.lambda.abs() < 1e-9 * found.material.mu.abs().max(1e-9));
}

#[test]
fn through_springs() {
    let springs = DeformSettings { surface: SurfaceModel::Shell, ..of("spring", 1e3, 0.3) };
    check_all("net", &sheet(3, 0.4), &springs, 1.0 / 3.0);
}

#[test]
fn bending_pressure_soft_springs_and_regions() {
    let mut input = sheet(5, 0.2);
    input.pressures = vec![((0..36).collect(), 40.0)];
    input.soft = vec![(14, [0.5, 0.5, 0.6], 300.0), (21, [0.6, 0.4, -0.2], 100.0)];
    input.rest.face_regions = Some((0..50).map(|f| i32::from(f >= 20)).collect());
    let stiff = Material { energy: "stvk".to_string(), young: 5e4, poisson: 0.2, ..Material::default() };
    let shell = of("neo-hookean", 1e4, 0.3);
    let settings =
        DeformSettings { surface: SurfaceModel::Shell, bending: 5.0, materials: [(1, stiff)].into(), ..shell };
    let found = gradients(&input, &settings);
    let along = direction(found.rest.len(), 4, false);
    check("rest, with bending", 0.2 * dot(&found.rest, &along), (&input, &settings), |t, input, _| {
        input.rest.points.iter_mut().zip(&along).for_each(|(p, d)| add(p, t * 0.2, *d));
    });
    let along = direction(input.fixed.len(), 1, false);
    check("targets", 0.2 * dot(&found.fixed, &along), (&input, &settings), |t, input, _| {
        input.fixed.iter_mut().zip(&along).for_each(|((_, target), d)| add(target, t * 0.2, *d));
    });
    let along = direction(2, 2, false);
    check("soft springs", dot(&found.soft, &along), (&input, &settings), |t, input, _| {
        input.soft.iter_mut().zip(&along).for_each(|((_, target, _), d)| add(target, t, *d));
    });
    check("young", 1e4 * found.material.young.unwrap(), (&input, &settings), |t, _, settings| {
        settings.material.young *= 1.0 + t;
    });
    check("young of a region", 5e4 * found.materials[&1].young.unwrap(), (&input, &settings), |t, _, settings| {
        settings.materials.get_mut(&1).unwrap().young *= 1.0 + t;
    });
    check("poisson of a region", found.materials[&1].poisson.unwrap(), (&input, &settings), |t, _, settings| {
        settings.materials.get_mut(&1).unwrap().poisson += t;
    });
    // Without bending, rest positions under pressure.
    let settings = DeformSettings { bending: 0.0, ..settings };
    let found = gradients(&input, &settings);
    let along = direction(found.rest.len(), 4, false);
    check("rest", 0.2 * dot(&found.rest, &along), (&input, &settings), |t, input, _| {
        input.rest.points.iter_mut().zip(&along).for_each(|(p, d)| add(p, t * 0.2, *d));
    });
}

#[test]
fn the_same_bits_by_gradients_without_a_factor_to_digits_and_on_threads() {
    let (input, settings) = (bar(), of("neo-hookean", 3e4, 0.3));
    let one = gradients(&input, &DeformSettings { threads: Some(1), ..settings.clone() });
    let three = gradients(&input, &DeformSettings { threads: Some(3), ..settings.clone() });
    assert_eq!(one, three);
    let result = solve(&input, &settings);
    let mut no_room = settings.clone();
    no_room.newton.memory = 1.0;
    let cg = adjoint(&input, &no_room, &result, &slope(&result.positions)).unwrap();
    for (a, b) in cg.fixed.as_flattened().iter().zip(one.fixed.as_flattened()) {
        assert!((a - b).abs() < 1e-8, "{a} {b}");
    }
}

#[test]
fn what_has_no_gradient_is_refused_with_a_remedy() {
    let (input, settings) = (bar(), of("neo-hookean", 3e4, 0.3));
    let short = DeformSettings { max_iters: 1, method: MethodName::Newton, ..settings.clone() };
    let stopped = deform(&input, &short, &mut Hooks::default()).unwrap();
    let refused = |input: &DeformInput, settings: &DeformSettings, result: &Deformation| {
        adjoint(input, settings, result, &slope(&result.positions)).unwrap_err().0
    };
    let text = refused(&input, &short, &stopped);
    assert!(text.contains("\"stopped\"") && text.contains("--max-iters"), "{text}");
    let result = solve(&input, &settings);
    let text = adjoint(&input, &settings, &result, &[[0.0; 3]; 2]).unwrap_err().0;
    assert!(text.contains("2 rows for 45 vertices"), "{text}");
    let mut bad = slope(&result.positions);
    bad[7][1] = f64::NAN;
    let text = adjoint(&input, &settings, &result, &bad).unwrap_err().0;
    assert!(text.contains("vertex 7"), "{text}");
    let obstacles = vec![HalfSpace { point: [0.0, -5.0, 0.0], normal: [0.0, 1.0, 0.0] }];
    let text = refused(&DeformInput { obstacles, ..input.clone() }, &settings, &result);
    assert!(text.contains("obstacles"), "{text}");
    // One vertex holds it: it turns freely, and a loss that sees that has no gradient.
    let loose = DeformInput { fixed: input.fixed[..1].to_vec(), ..input };
    let result = solve(&loose, &settings);
    let text = refused(&loose, &settings, &result);
    assert!(text.contains("pin at least three vertices"), "{text}");
}

/// A strut pressed together and kept straight by the symmetry of its start: a saddle, which Newton's clamped steps
/// reach.
#[test]
fn a_saddle_is_refused() {
    let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let rest = Mesh { points, edges: vec![[0, 1], [1, 2]], ..Mesh::default() };
    let fixed = vec![(0, [0.2, 0.0, 0.0]), (2, [1.8, 0.0, 0.0])];
    let start = Some(vec![[0.2, 0.0, 0.0], [1.05, 0.0, 0.0], [1.8, 0.0, 0.0]]);
    let input = DeformInput { rest, fixed, start, ..DeformInput::default() };
    let settings = DeformSettings { method: MethodName::ProjectedNewton, ..of("spring", 10.0, 0.3) };
    let result = solve(&input, &settings);
    assert!((result.positions[1][0] - 1.0).abs() < 1e-9);
    let text = adjoint(&input, &settings, &result, &slope(&result.positions)).unwrap_err().0;
    assert!(text.contains("saddle"), "{text}");
}
