use super::*;
use crate::deform::{Deformation, Hooks, deform};
use crate::pins::HalfSpace;
use crate::settings::{Material, MethodName};
use crate::simulate::{Hooks as StepHooks, Simulation};
use proxel_mesh::generate::{CellSplit, beam, cloth};
use proxel_mesh::write_mesh;
use proxel_split::Equality;
use std::path::PathBuf;

fn solve(input: &DeformInput, settings: &DeformSettings) -> Deformation {
    deform(input, settings, &mut Hooks::default()).unwrap()
}

fn again(input: &DeformInput, settings: &DeformSettings) -> (DeformInput, DeformSettings) {
    let text = ProblemFile::deform(input, settings).unwrap().to_text().unwrap();
    match ProblemFile::parse("p.json", &text).unwrap() {
        ProblemFile::Deform { input, settings } => (*input, *settings),
        ProblemFile::Simulate { .. } => panic!("a pose was written"),
    }
}

/// A bar with all that can hold it, and numbers whose last digits count.
fn held_bar() -> DeformInput {
    let mut rest = beam([4, 1, 1], [4.0, 1.0, 1.1], CellSplit::Five).unwrap();
    rest.tet_regions = Some((0..rest.tets.len() as i32).map(|e| e % 2).collect());
    let start = rest.points.iter().enumerate().map(|(i, p)| p.map(|v| v * 1.1 + 0.013 * (i as f64).sin())).collect();
    let at = |v: u32| rest.points[v as usize];
    let last = rest.points.len() as u32 - 1;
    DeformInput {
        fixed: (0..3).map(|v| (v, at(v))).collect(),
        soft: vec![(last, [4.3, 1.0 / 3.0, 0.1], 1e4 / 7.0)],
        loads: vec![(last - 1, [0.0, -1.0 / 3.0, 0.0])],
        pressures: vec![((0..=last).collect(), 0.7)],
        equalities: vec![Equality { nodes: vec![(last - 2, 1.0), (last - 3, -1.0)], value: [0.0, 0.1, 0.2] }],
        groups: vec![("foot".into(), vec![0, 1, 2])],
        start: Some(start),
        rest,
        ..DeformInput::default()
    }
}

#[test]
fn a_pose_comes_back_and_is_solved_to_the_same_bits() {
    let mut settings = DeformSettings { density: 1.0 / 3.0, gravity: [0.0, -9.81, 0.1], ..DeformSettings::default() };
    settings.material.young = 1e4 / 3.0;
    settings.materials.insert(1, Material { poisson: 0.3, ..settings.material.clone() });
    let input = held_bar();
    let (read, how) = again(&input, &DeformSettings { threads: Some(1), time_limit: Some(9.0), ..settings.clone() });
    assert_eq!(how, settings, "threads and limits of time stay behind");
    assert_eq!(read.rest, input.rest);
    let (a, b) = (solve(&input, &settings), solve(&read, &how));
    let bits = |d: &Deformation| d.positions.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
    assert_eq!(bits(&a), bits(&b));
    assert_eq!(a.report.energy.map(f64::to_bits), b.report.energy.map(f64::to_bits));
    assert_eq!((a.report.iterations, &a.report.reactions), (b.report.iterations, &b.report.reactions));
    // Another method, from the same file.
    let other = solve(&read, &DeformSettings { method: MethodName::Wrapd, ..how });
    assert_eq!((a.report.method.as_str(), other.report.method.as_str()), ("auto", "wrapd"));
}

#[test]
fn sheets_with_open_limits_planes_and_quads_come_back() {
    let mut rest = cloth([3, 2], [1.0, 1.0]).unwrap();
    rest.face_regions = Some(vec![5; rest.faces.len()]);
    let mut faces = proxel_mesh::Polygons::new();
    faces.push(&[0, 1, 5, 4]);
    rest.faces.iter().skip(2).for_each(|f| faces.push(f));
    rest.faces = faces;
    rest.face_regions = Some(vec![5; rest.faces.len()]);
    let settings = DeformSettings {
        strain_limit: Some([0.95, f64::INFINITY]),
        surface: crate::settings::SurfaceModel::Shell,
        method: MethodName::AdmmPd,
        max_iters: 5,
        ..DeformSettings::default()
    };
    let obstacles = vec![HalfSpace { point: [0.0, -3.0, 0.0], normal: [0.0, 1.0, 0.0] }];
    let fixed = vec![(0, rest.points[0]), (3, [1.2, 0.0, 0.0])];
    let input = DeformInput { rest, fixed, obstacles, ..DeformInput::default() };
    let (read, how) = again(&input, &settings);
    assert_eq!((&read.rest, &read.obstacles, &how), (&input.rest, &input.obstacles, &settings));
    assert_eq!(solve(&read, &how).positions, solve(&input, &settings).positions);
}

#[test]
fn what_json_cannot_hold_is_refused_before_anything_is_written() {
    let mut input = held_bar();
    input.fixed[1].1[2] = f64::NAN;
    let dir = std::env::temp_dir().join(format!("proxel-problem-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let path = dir.join("nan.json");
    let said = ProblemFile::deform(&input, &DeformSettings::default()).unwrap().write(&path).unwrap_err().to_string();
    assert!(said.contains("number 5 (0-based) of targets is not finite"), "{said}");
    assert!(!path.exists());
    input.fill = Some(vec![1.0; input.rest.tets.len()]);
    let said = ProblemFile::deform(&input, &DeformSettings::default()).unwrap_err().to_string();
    assert!(said.contains("lattice"), "{said}");
    std::fs::remove_dir_all(dir).unwrap();
}

/// A cube on a mesh of triangles that stands in a file, and that file.
fn scene(dir: &Path) -> SceneFile {
    let block = beam([2, 1, 2], [3.0, 1.0, 3.0], CellSplit::Five).unwrap();
    let skin = proxel_mesh::topology::surface(&block);
    let mesh = proxel_mesh::Mesh { points: block.points, faces: skin, name: "block".into(), ..Default::default() };
    write_mesh(&dir.join("block.obj"), &mesh, &proxel_mesh::Fields::none()).unwrap();
    let text = "
[time]
dt = 0.03333333333333333
frames = 8
integrator = \"bdf2\"
[[body]]
generate = { bar = { cells = [2, 2, 2], size = [1, 1, 1] } }
material = { energy = \"neo-hookean\", young = 1e5, poisson = 0.4 }
density = 1000
translate = [0.1, 1.2, 0.2]
strain_limit = [0.1, inf]
[[obstacle]]
shape = { mesh = { file = \"block.obj\", translate = [0, 0, 0] } }
";
    SceneFile::parse("s.toml".into(), text.replace("strain_limit = [0.1, inf]\n", ""), false, dir.to_owned()).unwrap()
}

#[test]
fn a_frame_comes_back_without_its_files_and_has_the_same_bits() {
    let dir = std::env::temp_dir().join(format!("proxel-problem-frame-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let scene = scene(&dir);
    let mut simulation = Simulation::new(&scene, None).unwrap();
    for _ in 0..6 {
        simulation.advance(&mut StepHooks::default()).unwrap();
    }
    let text = ProblemFile::simulate(&scene, simulation.state()).unwrap().to_text().unwrap();
    let next = simulation.advance(&mut StepHooks::default()).unwrap();
    assert!(next.contacts > 0, "the cube is on the block: {next:?}");
    std::fs::remove_dir_all(dir).unwrap();
    let ProblemFile::Simulate { scene, state } = ProblemFile::parse("f.json", &text).unwrap() else { panic!() };
    let mut other = Simulation::new(&scene, Some(1)).unwrap();
    other.resume(state).unwrap();
    let mut record = other.advance(&mut StepHooks::default()).unwrap();
    record.seconds = next.seconds;
    assert_eq!(record, next);
    assert_eq!(other.state().to_bytes(), simulation.state().to_bytes());
    // A file that is named but not there.
    let lost = text.replacen("block.obj\\\"", "other.obj\\\"", 1);
    let said = ProblemFile::parse("f.json", &lost).unwrap_err().to_string();
    assert!(said.contains("other.obj"), "{said}");
}

#[test]
fn wrong_files_are_refused_by_name() {
    let text = ProblemFile::deform(&held_bar(), &DeformSettings::default()).unwrap().to_text().unwrap();
    let said = |text: &str| ProblemFile::parse("p.json", text).unwrap_err().to_string();
    for (from, to, message) in [
        ("proxel-problem", "other", "no problem file"),
        ("\"version\":1", "\"version\":2", "its version is 2, this release reads 1"),
        ("\"deform\"", "\"deforms\"", "unknown key `deforms`; did you mean `deform`?"),
        ("\"fixed\":[[0", "\"fixed\":[[999", "vertex 999 (0-based) is named"),
        ("\"tol\":1e-9", "\"tol\":-1", "tol is -1"),
        ("\"tol\":1e-9", "\"tol\":null", "p.json"),
        ("\"tets\":[[", "\"tets\":[[77777,", "p.json"),
    ] {
        let wrong = text.replacen(from, to, 1);
        assert_ne!(wrong, text, "{from}");
        let said = said(&wrong);
        assert!(said.contains(message) && said.lines().count() == 1, "{said}\n  should have said\n{message}");
    }
    assert!(said("{}").contains("no problem file"), "{}", said("{}"));
    assert!(said("{\"format\":\"proxel-problem\",\"version\":1}").contains("either deform or simulate"));
    let missing = ProblemFile::read(&PathBuf::from("no such file.json")).unwrap_err().to_string();
    assert!(missing.contains("no such file.json"));
}

/// Damaged files: an error or a problem that can be solved or refused, never a panic.
#[test]
fn damaged_files_do_no_harm() {
    let dir = std::env::temp_dir().join(format!("proxel-problem-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let scene = scene(&dir);
    let simulation = Simulation::new(&scene, Some(1)).unwrap();
    let settings = DeformSettings { threads: None, max_iters: 2, ..DeformSettings::default() };
    let files = [
        ProblemFile::deform(&held_bar(), &settings).unwrap().to_text().unwrap(),
        ProblemFile::simulate(&scene, simulation.state()).unwrap().to_text().unwrap(),
    ];
    std::fs::remove_dir_all(dir).unwrap();
    let mut seed = 7_u64;
    let mut random = |n: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((seed >> 33) as usize) % n
    };
    let (mut read, mut refused) = (0, 0);
    for round in 0..600 {
        let mut bytes = files[round % 2].clone().into_bytes();
        for _ in 0..=random(3) {
            let at = random(bytes.len());
            match random(4) {
                // A digit for another keeps most files readable.
                0 | 1 => {
                    let digits: Vec<usize> = (at..bytes.len()).filter(|i| bytes[*i].is_ascii_digit()).take(1).collect();
                    digits.iter().for_each(|i| bytes[*i] = b'0' + random(10) as u8);
                }
                2 => bytes[at] = b"[]{},:\"-e.x\xff"[random(12)],
                _ => {
                    let end = (at + random(40)).min(bytes.len());
                    bytes.drain(at..end);
                }
            }
        }
        match ProblemFile::parse("fuzz", &String::from_utf8_lossy(&bytes)) {
            Err(_) => refused += 1,
            Ok(ProblemFile::Deform { input, mut settings }) => {
                read += 1;
                settings.max_iters = settings.max_iters.min(2);
                settings.threads = Some(1);
                settings.resolution = settings.resolution.min(8);
                let _ = deform(&input, &settings, &mut Hooks::default());
            }
            Ok(ProblemFile::Simulate { mut scene, state }) => {
                read += 1;
                let small = scene.change(|scene| {
                    scene.solver.max_iters = scene.solver.max_iters.min(2);
                    scene.time.substeps = scene.time.substeps.min(2);
                });
                let modest = scene.scene().bodies.iter().all(|b| match &b.generate {
                    Some(crate::simulate::Generate::Bar { cells, .. }) => cells.iter().all(|n| *n <= 4),
                    _ => false,
                });
                if small.is_ok()
                    && modest
                    && let Ok(mut simulation) = Simulation::new(&scene, Some(1))
                    && simulation.resume(state).is_ok()
                {
                    let _ = simulation.advance(&mut StepHooks::default());
                }
            }
        }
    }
    assert!(read > 50 && refused > 50, "{read} read, {refused} refused");
}
