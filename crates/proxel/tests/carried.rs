//! What surrounds a surface in a lattice: obstacles, equalities, pressure and reactions against statics and against the
//! same body made of tetrahedra.

use proxel::deform::{DeformInput, Deformation, Hooks, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::mesh::topology::surface;
use proxel::mesh::{Mesh, Polygons};
use proxel::pins::HalfSpace;
use proxel::settings::{DeformSettings, Material, MethodName};
use proxel::split::{Equality, Status};

type V3 = [f64; 3];

/// A bar of 2 x 0.5 x 0.5 along x, of tetrahedra.
fn body() -> Mesh {
    Mesh { name: "bar".into(), ..beam([16, 4, 4], [2.0, 0.5, 0.5], CellSplit::Six).expect("a beam") }
}

/// Its skin, with vertices of the surface alone.
fn skin() -> Mesh {
    let body = body();
    let mut number = vec![u32::MAX; body.n_verts()];
    let mut out = Mesh { name: "bar".into(), ..Mesh::default() };
    for face in surface(&body).iter() {
        let corners: Vec<u32> = face
            .iter()
            .map(|&v| {
                if number[v as usize] == u32::MAX {
                    number[v as usize] = out.points.len() as u32;
                    out.points.push(body.points[v as usize]);
                }
                number[v as usize]
            })
            .collect();
        out.faces.push(&corners);
    }
    out
}

/// The same triangles, each with corners of its own and turned inside out.
fn soup(mesh: &Mesh) -> Mesh {
    let mut out = Mesh { name: "soup".into(), faces: Polygons::default(), ..Mesh::default() };
    for t in mesh.faces.fan_triangles() {
        let first = out.points.len() as u32;
        out.points.extend([t[0], t[2], t[1]].map(|v| mesh.points[v as usize]));
        out.faces.push(&[first, first + 1, first + 2]);
    }
    out
}

fn settings() -> DeformSettings {
    DeformSettings {
        material: Material { energy: "stable-neo-hookean".into(), young: 1e5, poisson: 0.3, ..Material::default() },
        resolution: 16,
        ..DeformSettings::default()
    }
}

fn run(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    let end = deform(input, settings, &mut Hooks::default()).expect("good input");
    assert_eq!(end.status, Status::Converged, "{}", end.report.reason);
    assert_eq!(end.report.inverted, Some(0));
    end
}

fn chosen(mesh: &Mesh, is_in: impl Fn(V3) -> bool) -> Vec<u32> {
    (0..).zip(&mesh.points).filter(|(_, p)| is_in(**p)).map(|(v, _)| v).collect()
}

fn held(rest: Mesh, vertices: Vec<u32>) -> DeformInput {
    let fixed = vertices.iter().map(|&v| (v, rest.points[v as usize])).collect();
    DeformInput { rest, fixed, groups: vec![("wall".into(), vertices)], ..DeformInput::default() }
}

#[test]
fn a_skin_lies_on_the_ground_with_its_whole_weight_and_not_its_lattice() {
    let rest = skin();
    let ground = HalfSpace { point: [0.0, -0.3, 0.0], normal: [0.0, 3.0, 0.0] };
    let settings =
        DeformSettings { density: 1000.0, gravity: [0.0, -9.81, 0.0], tol: 1e-8, max_iters: 20_000, ..settings() };
    let mut ends = Vec::new();
    for rest in [rest.clone(), soup(&rest)] {
        let end = run(&DeformInput { rest, obstacles: vec![ground], ..DeformInput::default() }, &settings);
        let lowest = end.positions.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        assert!((lowest + 0.3).abs() < 1e-6, "the surface lies on the ground: {lowest}");
        let nodes = end.carried.as_ref().expect("a lattice").positions();
        assert!(nodes.iter().any(|p| p[1] < -0.31), "nodes of the lattice may be below");
        let (force, weight) = (end.report.reactions["obstacle 0"], 2.0 * 0.25 * 9810.0);
        assert!((force[1] + weight).abs() < 1e-4 * weight, "{force:?} carries {weight}");
        assert!(force[0].abs() < 1e-8 * weight && force[2].abs() < 1e-8 * weight, "no friction: {force:?}");
        ends.push(end.report.energy.expect("finite"));
    }
    assert!((ends[0] - ends[1]).abs() < 1e-6 * ends[1].abs(), "copies of a vertex touch once: {ends:?}");
}

#[test]
fn an_obstacle_out_of_reach_costs_nothing() {
    let rest = skin();
    let ends = rest.points.iter().zip(0..).filter(|(p, _)| p[0].abs() >= 1.0);
    let fixed = ends.map(|(p, v)| (v, if p[0] > 0.0 { [p[0], p[2] + 0.5, -p[1]] } else { *p })).collect();
    let free = DeformInput { rest, fixed, ..DeformInput::default() };
    let floor = HalfSpace { point: [0.0, -2.0, 0.0], normal: [0.0, 1.0, 0.0] };
    let settings = DeformSettings { method: MethodName::Wrapd, tol: 1e-7, ..settings() };
    let alone = run(&free, &settings);
    let beside = run(&DeformInput { obstacles: vec![floor], ..free }, &settings);
    let apart = alone.positions.as_flattened().iter().zip(beside.positions.as_flattened());
    let apart = apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-4, "{apart}");
    assert!(beside.report.reactions["obstacle 0"].iter().all(|f| f.abs() < 1e-6), "nothing touches it");
    let (a, b) = (alone.report.iterations, beside.report.iterations);
    assert!(b < 4 * a, "{b} iterations, {a} without the obstacle");
}

#[test]
fn rows_over_the_surface_hold_exactly() {
    let rest = skin();
    let at = |p: V3| {
        chosen(&rest, |q| (0..3).all(|d| (p[d] - q[d]).abs() < 1e-9)).first().copied().expect("a vertex of the skin")
    };
    let (a, b, c) = (at([1.0, -0.25, -0.25]), at([1.0, 0.25, 0.25]), at([0.5, 0.25, 0.25]));
    let input = held(rest.clone(), chosen(&rest, |p| p[0] <= -1.0));
    let pinned = input.fixed[0];
    let row = |nodes: &[(u32, f64)], value| Equality { nodes: nodes.to_vec(), value };
    let rows = vec![
        row(&[(a, 0.5), (b, 0.5)], [0.9, 0.6, 0.2]),
        row(&[(b, 1.0), (c, -1.0), (pinned.0, 0.5)], [-0.05, 0.0, 0.1]),
    ];
    let input = DeformInput { equalities: rows.clone(), ..input };
    let end = run(&input, &DeformSettings { tol: 1e-8, max_iters: 20_000, ..settings() });
    for Equality { nodes, value } in &rows {
        for d in 0..3 {
            let sum: f64 = nodes.iter().map(|(v, a)| a * end.positions[*v as usize][d]).sum();
            assert!((sum - value[d]).abs() < 1e-11, "{sum} is not {}", value[d]);
        }
    }
    let refused = |extra: Equality| {
        let input = DeformInput { equalities: [rows.clone(), vec![extra]].concat(), ..input.clone() };
        deform(&input, &settings(), &mut Hooks::default()).expect_err("refused").to_string()
    };
    let told = refused(row(&[(a, 1.0), (b, 1.0)], [1.8, 1.2, 0.4]));
    assert!(told.contains("equality 2 (0-based) follows from") && told.contains("--resolution"), "{told}");
    assert!(refused(row(&[(a, 1.0), (b, 1.0)], [1.8, 1.3, 0.4])).contains("contradicts"));
    assert!(refused(row(&[(pinned.0, 1.0)], [9.0; 3])).contains("equality 2 (0-based) contradicts"));
    assert!(refused(row(&[(pinned.0, 2.0)], pinned.1.map(|x| 2.0 * x))).contains("follows from"));
    assert!(refused(row(&[(99_999, 1.0)], [0.0; 3])).contains("names no vertex"));
}

#[test]
fn pressure_swells_a_skin_as_it_does_the_body() {
    let length = |end: &Deformation| {
        let x = end.positions.iter().map(|p| p[0]);
        x.clone().fold(f64::NEG_INFINITY, f64::max) - x.fold(f64::INFINITY, f64::min)
    };
    let settings = DeformSettings { tol: 1e-6, ..settings() };
    let pressed = |rest: Mesh| {
        let all = (0..rest.n_verts() as u32).collect();
        run(&DeformInput { rest, pressures: vec![(all, 2e4)], ..DeformInput::default() }, &settings)
    };
    let exact = length(&pressed(body())) - 2.0;
    assert!(exact > 0.1, "it swells: {exact}");
    for rest in [skin(), soup(&skin())] {
        let found = length(&pressed(rest)) - 2.0;
        // Outer cells are partly empty, and as soft as they are on average.
        assert!((found - exact).abs() < 0.15 * exact, "{found} instead of {exact}");
    }
}

#[test]
fn what_a_wall_holds_is_the_load_on_the_surface() {
    // A pressure on the free end's face alone, and a force on its corner; both end in the wall.
    let rest = skin();
    let (wall, end_face) = (chosen(&rest, |p| p[0] <= -1.0), chosen(&rest, |p| p[0] >= 1.0));
    let input = DeformInput {
        loads: vec![(end_face[0], [0.0, 0.0, 3.0])],
        pressures: vec![(end_face, -1e3)],
        ..held(rest, wall)
    };
    let end = run(&input, &DeformSettings { tol: 1e-8, ..settings() });
    assert!(end.report.warnings.iter().any(|w| w.contains("open")), "{:?}", end.report.warnings);
    let force = end.report.reactions["wall"];
    assert!((force[2] - 3.0).abs() < 0.3 && (force[0] + 0.25e3).abs() < 10.0, "{force:?}");
    let sum = end.reaction.iter().fold([0.0; 3], |s, f| [0, 1, 2].map(|d| s[d] + f[d]));
    assert!((0..3).all(|d| (sum[d] - force[d]).abs() < 1e-9), "{sum:?} {force:?}");
}

#[test]
fn what_cannot_be_is_told_by_the_vertices_of_the_surface() {
    let rest = skin();
    let input = held(rest.clone(), chosen(&rest, |p| p[0] <= -1.0));
    let told = |input: &DeformInput, settings: &DeformSettings| {
        deform(input, settings, &mut Hooks::default()).expect_err("refused").to_string()
    };
    let behind = HalfSpace { point: [-0.9, 0.0, 0.0], normal: [1.0, 0.0, 0.0] };
    let message = told(&DeformInput { obstacles: vec![behind], ..input.clone() }, &settings());
    assert!(message.contains("bar: vertex") && message.contains("behind obstacle 0"), "{message}");
    let few = DeformInput { pressures: vec![(vec![0, 1], 1.0)], ..input };
    assert!(told(&few, &settings()).contains("0 faces"));
    // Two bars, of which one is held and both are heavy.
    let mut two = rest.clone();
    let n = rest.n_verts() as u32;
    two.points.extend(rest.points.iter().map(|p| [p[0], p[1] + 5.0, p[2]]));
    rest.faces.iter().for_each(|f| two.faces.push(&f.iter().map(|v| v + n).collect::<Vec<_>>()));
    let free = held(two, chosen(&rest, |p| p[0] <= -1.0));
    let heavy = DeformSettings { density: 1.0, gravity: [0.0, -1.0, 0.0], resolution: 40, ..settings() };
    let message = told(&free, &heavy);
    assert!(message.contains(&format!("component of vertex {n} (0-based), with {n} vertices")), "{message}");
    let light = deform(&free, &DeformSettings { resolution: 40, ..settings() }, &mut Hooks::default()).expect("rests");
    assert!(light.report.warnings.iter().any(|w| w.contains(&format!("of vertex {n} (0-based), with {n}"))));
    let (x, rest) = (light.positions[n as usize], free.rest.points[n as usize]);
    assert!((0..3).all(|d| (x[d] - rest[d]).abs() < 1e-12), "it rests where it is: {x:?}");
}
