//! `proxel simulate` through the binary: physics, contact, bad scenes, resumption, threads.

mod common;

use common::Folder;
use common::scenes::{FLOOR, NO_GRAVITY, SOFT, go, report, scene};

/// The rows of frames.csv by columns.
struct Rows(Vec<String>, Vec<Vec<String>>);

impl Rows {
    fn of(folder: &Folder, dir: &str) -> Rows {
        let text = folder.read(&format!("{dir}/frames.csv"));
        let mut lines = text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
        let header = lines.next().unwrap();
        Rows(header, lines.collect())
    }

    fn len(&self) -> usize {
        self.1.len()
    }

    fn texts(&self, column: &str) -> Vec<String> {
        let at = self.0.iter().position(|c| c == column).unwrap();
        self.1.iter().map(|row| row[at].clone()).collect()
    }

    fn numbers(&self, column: &str) -> Vec<f64> {
        self.texts(column).iter().map(|v| v.parse().unwrap()).collect()
    }
}

/// The bytes of all numbered meshes in a folder.
fn meshes(folder: &Folder, dir: &str) -> Vec<(String, Vec<u8>)> {
    let mut out: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder.0.join(dir))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "vtu"))
        .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&p).unwrap()))
        .collect();
    out.sort();
    out
}

#[test]
fn momentum_is_kept_and_energy_does_not_grow() {
    let folder = Folder::new("simulate-momentum");
    let moving = "velocity = [1, 2, -0.5]\nangular_velocity = [0, 3, 1]";
    // Unconverged on purpose: three iterations a step.
    for (method, iterations) in [("auto", 5000), ("auto", 2), ("admm", 3), ("wrapd", 3), ("aa-admm", 3)] {
        let time = format!("dt = 0.02\nframes = 12\n[solver]\nmethod = \"{method}\"\nmax_iters = {iterations}");
        folder.put("s.toml", &scene(&time, SOFT, moving, NO_GRAVITY));
        let run = go(&folder, "simulate s.toml --out d --quiet");
        assert!(matches!(run.code, 0 | 3), "{method}: {}", run.stderr);
        let rows = Rows::of(&folder, "d");
        assert_eq!(rows.len(), 13);
        for (column, start) in [("px", 1000.0), ("py", 2000.0), ("pz", -500.0)] {
            for p in rows.numbers(column) {
                assert!((p - start).abs() < 1e-9 * 2300.0, "{method} {iterations}: {column} {p}");
            }
        }
        let report = report(&folder, "d");
        assert!(report["momentum_drift"].as_f64().unwrap() < 1e-9);
        assert_eq!(report["status"], if run.code == 0 { "converged" } else { "stopped" });
        if iterations == 5000 {
            assert_eq!(run.code, 0, "{}", report["reason"]);
            assert_eq!(report["energy_growth"].as_array().unwrap().len(), 0, "{report}");
            assert!(report["angular_momentum_drift"].as_f64().unwrap() > 0.0);
        }
    }
}

#[test]
fn free_fall_is_exact_and_the_drift_of_angular_momentum_is_of_first_order() {
    let folder = Folder::new("simulate-fall");
    let spun = "angular_velocity = [0, 2, 0]";
    let drift = |frames: usize, integrator: &str| {
        let time = format!("dt = {}\nframes = {frames}\nintegrator = \"{integrator}\"", 0.4 / frames as f64);
        folder.put("s.toml", &scene(&time, SOFT, spun, NO_GRAVITY));
        assert_eq!(go(&folder, "simulate s.toml --out d --quiet").code, 0);
        let report = report(&folder, "d");
        assert!(report["momentum_drift"].as_f64().unwrap() < 1e-12, "it turns on the spot: {report}");
        report["angular_momentum_drift"].as_f64().unwrap()
    };
    let [coarse, fine, finest] = [10, 20, 40].map(|frames| drift(frames, "implicit-euler"));
    assert!(coarse < 0.1 && fine < 0.65 * coarse && fine > 0.35 * coarse, "halved with dt: {coarse} {fine}");
    assert!(finest < 0.6 * fine && finest > 0.4 * fine, "and again: {fine} {finest}");
    let second = drift(20, "bdf2");
    assert!(second < 0.5 * fine, "of second order, but for its first step: {second} {fine}");

    folder.put("s.toml", &scene("dt = 0.1\nframes = 5", SOFT, "", ""));
    assert_eq!(go(&folder, "simulate s.toml --out d --quiet").code, 0);
    let rows = Rows::of(&folder, "d");
    for (k, p) in rows.numbers("py").iter().enumerate() {
        let exact = -1000.0 * 9.81 * 0.1 * k as f64;
        assert!((p - exact).abs() <= 1e-9 * exact.abs(), "{p} {exact}");
    }
    // Implicit Euler falls by g dt^2 (1 + .. + k).
    let fallen = rows.numbers("potential");
    assert!(((fallen[5] - fallen[0]) + 1000.0 * 9.81 * 9.81 * 0.01 * 15.0).abs() < 1e-6 * fallen[5].abs());
    assert!(rows.texts("status")[1..].iter().all(|s| s == "converged"));
}

#[test]
fn bodies_come_to_rest_on_the_floor() {
    let folder = Folder::new("simulate-floor");
    let time = "dt = 0.03333333333333333\nframes = 40";
    folder.put("s.toml", &scene(time, SOFT, "translate = [0, 1, 0]", FLOOR));
    let run = go(&folder, "simulate s.toml --out d --quiet");
    assert_eq!(run.code, 0, "{}{}", run.stderr, report(&folder, "d")["reason"]);
    let rows = Rows::of(&folder, "d");
    assert!(
        rows.numbers("max_penetration").iter().all(|d| *d <= 1e-6 * 3f64.sqrt()),
        "{:?}",
        rows.numbers("max_penetration")
    );
    let report = report(&folder, "d");
    assert_eq!(report["energy_growth"].as_array().unwrap().len(), 0, "{}", report["energy_growth"]);
    let last = report["frames"].as_array().unwrap().last().unwrap().clone();
    assert!(last["contacts"].as_u64().unwrap() >= 4, "{last}");
    assert!(last["gradient_off_contact"].as_f64().unwrap() <= last["gradient_bound"].as_f64().unwrap());
    assert!(last["kinetic"].as_f64().unwrap() < 1.0, "nearly at rest: {last}");
    // The floor bears the weight.
    let mesh = String::from_utf8_lossy(&std::fs::read(folder.0.join("d/cube_0040.vtu")).unwrap()).into_owned();
    for name in ["displacement", "velocity", "contact_force", "reaction_force", "von_mises_stress"] {
        assert!(mesh.contains(&format!("Name=\"{name}\"")), "{name}");
    }
    assert!(folder.read("d/frames.pvd").contains("cube_0040.vtu"));
    assert!(folder.read("d/scene.toml").contains("substeps = 1"));
}

#[test]
fn every_obstacle_stops_a_body() {
    let folder = Folder::new("simulate-obstacles");
    folder.put(
        "block.obj",
        "v -2 -1 -2\nv 2 -1 -2\nv 2 0 -2\nv -2 0 -2\nv -2 -1 2\nv 2 -1 2\nv 2 0 2\nv -2 0 2\n\
        f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 4 8 7 3\nf 1 5 8 4\nf 2 3 7 6\n",
    );
    let shapes = [
        "{ plane = { point = [0, 0, 0], normal = [0, 2, 0] } }",
        "{ sphere = { center = [0, -3, 0], radius = 3 } }",
        "{ box = { center = [0, -1, 0], size = [6, 2, 6] } }",
        "{ capsule = { from = [-3, -1, 0], to = [3, -1, 0], radius = 1 } }",
        "{ cylinder = { center = [0, -2, 0], axis = [0, 0, 1], radius = 2 } }",
        "{ pit = { center = [0, 0, 0], normal = [0, 1, 0], radius = 0.6 } }",
        "{ height-field = { origin = [-2, -0.5, -2], spacing = [2, 2], heights = [[0.5, 0, 0.5], [0, 0.4, 0], [0.5, 0, 0.5]], depth = 1 } }",
        "{ mesh = { file = \"block.obj\" } }",
    ];
    for shape in shapes {
        let obstacle = format!("[[obstacle]]\nshape = {shape}");
        let time = "dt = 0.03333333333333333\nframes = 14";
        folder.put("s.toml", &scene(time, SOFT, "translate = [0.05, 0.8, 0.02]\nvelocity = [0, -2, 0]", &obstacle));
        let run = go(&folder, "simulate s.toml --out d --quiet");
        let rows = Rows::of(&folder, "d");
        let deepest = rows.numbers("max_penetration").into_iter().fold(0.0, f64::max);
        assert!(deepest <= 1e-6 * 3f64.sqrt(), "{shape}: {deepest:e} {}", run.stderr);
        assert_eq!(run.code, 0, "{shape}: {}", report(&folder, "d")["reason"]);
        let contacts: u64 =
            report(&folder, "d")["frames"].as_array().unwrap().iter().map(|f| f["contacts"].as_u64().unwrap()).sum();
        assert!(contacts > 0, "{shape}: it touched something");
    }
}

#[test]
fn friction_holds_a_body_on_a_slope_and_without_it_slides() {
    let folder = Folder::new("simulate-friction");
    // A slope of tan = 0.5.
    let slope = |friction: f64| {
        format!(
            "[[obstacle]]\nfriction = {friction}\nshape = {{ half-space = {{ point = [0, 0, 0], normal = [-1, 2, 0] }} }}"
        )
    };
    let turned = "rotate = { axis = [0, 0, 1], angle = 26.56505117707799 }\ntranslate = [-0.2237, 0.4474, 0]";
    let slid = |friction: f64| {
        folder.put(
            "s.toml",
            &scene("dt = 0.02\nframes = 20", "energy = \"arap\", young = 1e7, poisson = 0", turned, &slope(friction)),
        );
        let run = go(&folder, "simulate s.toml --out d --quiet");
        assert_eq!(run.code, 0, "{friction}: {}", report(&folder, "d")["reason"]);
        let rows = Rows::of(&folder, "d");
        rows.numbers("px").last().unwrap() / 1000.0
    };
    let along = 9.81 * 0.4; // times sin, cos and what friction leaves
    let (sin, cos) = (1.0 / 5f64.sqrt(), 2.0 / 5f64.sqrt());
    assert!(slid(0.8).abs() < 0.02 * along, "sticks");
    for mu in [0.0, 0.2] {
        let expected = -along * (sin - mu * cos) * cos;
        let found = slid(mu);
        assert!((found - expected).abs() < 0.03 * expected.abs(), "{mu}: {found} {expected}");
    }
}

#[test]
fn stiff_cases_stay_finite_and_bounded() {
    let folder = Folder::new("simulate-stiff");
    let time = "dt = 0.03333333333333333\nframes = 8";
    let lies = "translate = [0, 0.5, 0]";
    let cases = [
        ("E of 3.45e9", scene(time, "energy = \"neo-hookean\", young = 3.45e9, poisson = 0.4", lies, FLOOR)),
        ("nu of .4999", scene(time, "energy = \"neo-hookean\", young = 1e6, poisson = 0.4999", lies, FLOOR)),
        (
            "rotating",
            scene(
                time,
                "energy = \"stable-neo-hookean\", young = 1e6, poisson = 0.45",
                "angular_velocity = [30, 10, 0]",
                NO_GRAVITY,
            ),
        ),
    ];
    for (name, text) in cases {
        folder.put("s.toml", &text);
        let run = go(&folder, "simulate s.toml --out d --quiet");
        assert!(matches!(run.code, 0 | 3), "{name}: {}", run.stderr);
        let rows = Rows::of(&folder, "d");
        assert_eq!(rows.len(), 9, "{name}");
        let energies: Vec<f64> = (0..9)
            .map(|k| rows.numbers("kinetic")[k] + rows.numbers("elastic")[k] + rows.numbers("potential")[k])
            .collect();
        assert!(energies.iter().all(|e| e.is_finite()), "{name}: {energies:?}");
        let scale = energies[0].abs().max(1.0);
        assert!(energies.windows(2).all(|w| w[1] <= w[0] + 1e-6 * scale), "{name}: {energies:?}");
        assert_eq!(run.code, 0, "{name}: {}", report(&folder, "d")["reason"]);
    }
    // A single tetrahedron that begins inside out, with large steps.
    folder.put("tet.node", "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n");
    folder.put("tet.ele", "1 4 0\n0 0 1 2 3\n");
    folder.put("start.node", "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 -1\n");
    for energy in ["neo-hookean", "stable-neo-hookean", "corotated"] {
        folder.put(
            "s.toml",
            &format!(
                "[time]\ndt = 0.4\nframes = 6\n{NO_GRAVITY}\n[[body]]\nname = \"tet\"\nmesh = \"tet.node\"\nstart = \"start.node\"\n\
                 material = {{ energy = \"{energy}\", young = 1e5, poisson = 0.4 }}\n"
            ),
        );
        let run = go(&folder, "simulate s.toml --out d --quiet");
        assert!(matches!(run.code, 0 | 1 | 3), "{energy}: {}", run.stderr);
        let report = report(&folder, "d");
        let frames = report["frames"].as_array().unwrap();
        for frame in frames {
            let kinetic = frame["kinetic"].as_f64().unwrap();
            assert!(kinetic < 1e6, "{energy}: {frame}");
            assert!(
                frame["inverted"] == 0
                    || frame["frame"] == 0
                    || frame["status"] != "converged"
                    || energy == "corotated",
                "{frame}"
            );
        }
        assert_eq!(frames.len(), 7, "{energy}: {}", report["reason"]);
    }
}

#[test]
fn damping_takes_energy_and_adaptive_steps_converge() {
    let folder = Folder::new("simulate-damping");
    let stretched = |damping: &str| {
        let time = "dt = 0.01\nframes = 10";
        let rest = format!("{NO_GRAVITY}\n[damping]\n{damping}");
        folder.put("s.toml", &scene(time, SOFT, "angular_velocity = [0, 0, 6]", &rest));
        assert_eq!(go(&folder, "simulate s.toml --out d --quiet").code, 0);
        let rows = Rows::of(&folder, "d");
        (rows.numbers("kinetic")[10] + rows.numbers("elastic")[10], rows.numbers("lz")[10])
    };
    let (plain, spin) = stretched("");
    let (dragged, slower) = stretched("mass = 5");
    let (stiff, _) = stretched("stiffness = 0.01");
    assert!(dragged < 0.5 * plain && stiff < plain, "{plain} {dragged} {stiff}");
    // (1 + 5 dt)^-10 of the spin is left, but for the change of shape.
    assert!((slower / spin - 1.05f64.powi(-10)).abs() < 0.05, "{slower} {spin}");
    let time = "dt = 0.1\nframes = 2\nadaptive = true\n[solver]\nmethod = \"wrapd\"\nmax_iters = 40\ntol = 1e-6";
    folder.put("s.toml", &scene(time, SOFT, "angular_velocity = [0, 0, 9]", NO_GRAVITY));
    let run = go(&folder, "simulate s.toml --out d --quiet");
    assert!(matches!(run.code, 0 | 3));
    let steps = report(&folder, "d")["frames"][1]["steps"].as_u64().unwrap();
    assert!((1..=16).contains(&steps), "{steps}");
}

#[test]
fn pins_and_obstacles_follow_their_scripts() {
    let folder = Folder::new("simulate-scripts");
    let pins = "[[body.pin]]\nname = \"top\"\nplane = { point = [0, 0.49, 0], normal = [0, 1, 0] }\n\
                keyframe = [{ time = 0 }, { time = 0.2, rotate = { axis = [0, 1, 0], angle = 90 }, translate = [0, 1, 0] }]";
    let pusher = "[[obstacle]]\nname = \"pusher\"\nvelocity = [0, 2, 0]\nshape = { sphere = { center = [0, -2, 0], radius = 1 } }";
    folder.put("s.toml", &scene("dt = 0.05\nframes = 6\n[output]\nobj = true\nglb = true", SOFT, pins, pusher));
    let run = go(&folder, "simulate s.toml --out d --quiet --trace t.csv --report r.json");
    assert_eq!(run.code, 0, "{}", report(&folder, "d")["reason"]);
    let last = folder.read("d/obj/cube_0006.obj");
    let top: Vec<Vec<f64>> = last
        .lines()
        .filter_map(|l| l.strip_prefix("v "))
        .map(|l| l.split_whitespace().map(|v| v.parse().unwrap()).collect::<Vec<f64>>())
        .filter(|p| p[1] > 1.499)
        .collect();
    assert_eq!(top.len(), 9, "the pinned ones are where their script has them");
    assert!(top.iter().all(|p| (p[1] - 1.5).abs() < 1e-12));
    assert!(folder.has("d/scene.glb") && folder.has("r.json"));
    let trace = folder.read("t.csv");
    assert!(trace.starts_with("frame,step,iteration,seconds,energy,gradient_norm"), "{trace}");
    assert!(
        trace
            .lines()
            .skip(1)
            .all(|l| l.split(',').skip(2).all(|v| v.parse::<f64>().is_ok() || v == "true" || v == "false"))
    );
}

#[test]
fn cloth_and_lattices_and_springs_move_together() {
    let folder = Folder::new("simulate-kinds");
    // A closed box of triangles as the skin of a body, a sheet, and a net.
    folder.put(
        "skin.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
        f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 4 8 7\nf 4 7 3\nf 1 5 8\nf 1 8 4\nf 2 3 7\nf 2 7 6\n",
    );
    folder.put(
        "s.toml",
        &format!(
            "[time]\ndt = 0.03333333333333333\nframes = 10\n\
             [[body]]\nname = \"skin\"\nmesh = \"skin.obj\"\nresolution = 3\ntranslate = [0, 0.2, 0]\nmaterial = {{ {SOFT} }}\n\
             [[body]]\nname = \"sheet\"\ngenerate = {{ cloth = {{ cells = [6, 6], size = [1, 1] }} }}\n\
             rotate = {{ axis = [1, 0, 0], angle = -90 }}\ntranslate = [3, 0.3, 0]\nmodel = \"shell\"\n\
             material = {{ energy = \"arap\", young = 1e3, poisson = 0 }}\ndensity = 0.2\nbending = 1e-4\n\
             [[body]]\nname = \"net\"\ngenerate = {{ cloth = {{ cells = [4, 4], size = [1, 1] }} }}\nmodel = \"shell\"\n\
             material = {{ energy = \"spring\", young = 500, poisson = 0 }}\ndensity = 0.1\ntranslate = [6, 2, 0]\n\
             [[body.pin]]\nplane = {{ point = [0, 2.4, 0], normal = [0, 1, 0] }}\n{FLOOR}\n"
        ),
    );
    let run = go(&folder, "simulate s.toml --out d --quiet");
    assert_eq!(run.code, 0, "{}{}", run.stderr, report(&folder, "d")["reason"]);
    let rows = Rows::of(&folder, "d");
    assert!(rows.numbers("max_penetration").iter().all(|d| *d <= 1e-6));
    for name in ["skin", "sheet", "net"] {
        assert!(folder.has(&format!("d/{name}_0010.vtu")), "{name}");
    }
    assert!(report(&folder, "d")["frames"][10]["contacts"].as_u64().unwrap() > 4);
}

#[test]
fn hard_limits_are_held_by_a_splitting_and_by_newton() {
    let folder = Folder::new("simulate-limits");
    folder.put(
        "s.toml",
        "[time]\ndt = 0.03333333333333333\nframes = 3\n[solver]\nmethod = \"wrapd\"\ntol = 1e-7\n\
         [[body]]\nname = \"sheet\"\ngenerate = { cloth = { cells = [6, 6], size = [1, 1] } }\nmodel = \"shell\"\n\
         material = { energy = \"arap\", young = 50, poisson = 0 }\ndensity = 1\nstrain_limit = [0.95, 1.05]\n\
         [[body.pin]]\nplane = { point = [0, 0.49, 0], normal = [0, 1, 0] }\n",
    );
    let run = go(&folder, "simulate s.toml --out d --quiet");
    let rows = Rows::of(&folder, "d");
    assert_eq!(run.code, 0, "{}", report(&folder, "d")["reason"]);
    assert!(
        rows.numbers("max_strain_violation").iter().all(|v| *v <= 1e-6),
        "{:?}",
        rows.numbers("max_strain_violation")
    );
    // Normalised by the mean edge, a sixth of the sheet.
    assert!(rows.numbers("forward")[1..].iter().all(|r| *r <= 1e-6));
    let newton = go(&folder, "simulate s.toml --out d --quiet --method newton");
    let rows = Rows::of(&folder, "d");
    assert_eq!(newton.code, 0, "{}", report(&folder, "d")["reason"]);
    assert!(rows.numbers("max_strain_violation").iter().all(|v| *v <= 1e-6));
    assert!(rows.texts("forward")[1..].iter().all(|r| r == "inf"), "nothing was split");
    let lbfgs = go(&folder, "simulate s.toml --out d --quiet --method lbfgs");
    assert_eq!(lbfgs.code, 2);
    assert!(lbfgs.stderr.contains("body[0].strain_limit: lbfgs needs derivatives"), "{}", lbfgs.stderr);
}

#[test]
fn a_resumed_run_has_the_same_bits_and_so_has_any_number_of_threads() {
    let folder = Folder::new("simulate-resume");
    for integrator in ["implicit-euler", "bdf2"] {
        let time = format!("dt = 0.03333333333333333\nframes = 10\nsubsteps = 2\nintegrator = \"{integrator}\"");
        folder.put("s.toml", &scene(&time, SOFT, "translate = [0, 0.7, 0]\nangular_velocity = [1, 0, 2]", FLOOR));
        assert_eq!(go(&folder, "simulate s.toml --out whole --quiet --threads 1").code, 0);
        assert_eq!(go(&folder, "simulate s.toml --out many --quiet --threads 3").code, 0);
        assert!(meshes(&folder, "whole") == meshes(&folder, "many"), "threads change nothing");
        // Broken off after frame 4: later frames and the state are those of a run of four frames.
        assert_eq!(go(&folder, "simulate s.toml --out part --quiet --frames 4").code, 0);
        let text = folder.read("part/scene.toml").replace("frames = 4", "frames = 10");
        folder.put("part/scene.toml", &text);
        let run = go(&folder, "simulate s.toml --out part --quiet --resume");
        assert_eq!(run.code, 0, "{}", run.stderr);
        assert!(meshes(&folder, "whole") == meshes(&folder, "part"), "{integrator}: resumption changes nothing");
        let without_seconds = |dir: &str| -> Vec<String> {
            let text = folder.read(&format!("{dir}/frames.csv"));
            text.lines().map(|l| l.rsplit_once(',').unwrap().0.to_owned()).collect()
        };
        assert_eq!(without_seconds("whole"), without_seconds("part"));
        assert_eq!(folder.read("whole/frames.pvd"), folder.read("part/frames.pvd"));
    }
    // A crash while the next frame is written leaves lines of it, the last one torn: they go.
    let text = folder.read("whole/frames.jsonl");
    assert_eq!(text.lines().count(), 11);
    let (csv, pvd) = (folder.read("whole/frames.csv"), folder.read("whole/frames.pvd"));
    folder.put("whole/frames.jsonl", &format!("{text}{}", &text.lines().last().unwrap()[..40]));
    folder.put("whole/frames.csv", &format!("{csv}11,3.6"));
    folder.put("whole/frames.pvd", pvd.trim_end_matches("</VTKFile>\n"));
    assert_eq!(go(&folder, "simulate s.toml --out whole --quiet --resume").code, 0);
    assert_eq!((folder.read("whole/frames.jsonl"), folder.read("whole/frames.csv")), (text.clone(), csv));
    assert_eq!(folder.read("whole/frames.pvd"), pvd);
    // Frames that have gone do not come back.
    folder.put("part/frames.jsonl", &text[..text.len() / 2]);
    let lost = go(&folder, "simulate s.toml --out part --quiet --resume");
    assert!(lost.code == 2 && lost.stderr.contains("lost frames"), "{}", lost.stderr);
    // Of another scene, or of nothing, nothing goes on.
    folder.put("s.toml", &scene("dt = 0.02\nframes = 10", SOFT, "", FLOOR.replace("0, 0, 0", "0, -3, 0").as_str()));
    let other = go(&folder, "simulate s.toml --out whole --quiet --resume");
    assert_eq!(other.code, 2);
    assert!(other.stderr.contains("is of another scene: scene.toml differs in line"), "{}", other.stderr);
    let nothing = go(&folder, "simulate s.toml --out nowhere --quiet --resume");
    assert!(nothing.code == 2 && nothing.stderr.contains("no simulation to go on with"), "{}", nothing.stderr);
    assert!(!folder.has("nowhere"));
}
