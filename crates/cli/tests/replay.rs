//! `--dump` and `proxel replay` through the binary; a safe penalty.

mod common;
use common::Folder;
use serde_json::Value;

fn json(folder: &Folder, name: &str) -> Value {
    serde_json::from_str(&folder.read(name)).unwrap()
}

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    std::fs::read(folder.0.join(name)).unwrap()
}

const SCENE: &str = "
[time]
dt = 0.03333333333333333
frames = 7
integrator = \"bdf2\"
[[body]]
name = \"cube\"
mesh = \"rest.node\"
start = \"start.node\"
material = { energy = \"neo-hookean\", young = 1e5, poisson = 0.4 }
angular_velocity = [0.3, 0, 0.7]
translate = [0, 0.3, 0]
[[obstacle]]
shape = { half-space = { point = [0, 0, 0], normal = [0, 1, 0] } }
";

#[test]
fn a_pose_is_solved_again_to_the_same_bits_and_by_other_methods() {
    let folder = Folder::new("replay-deform");
    folder.beam(3).put(
        "up.toml",
        "[groups.foot]\nindices = [0, 1, 2, 3]\n[groups.end]\nindices = [12, 13]\ntranslate = [0.3, 0.1, 0.7]\n",
    );
    let options = "--pins up.toml --young 12345.678 --poisson 0.37 --density 3.3 --gravity 0,-9.81,0.1 --threads 2";
    let dumped = format!("deform rest.node {options} --out a.vtu --report a.json --trace a.csv --dump p.json");
    folder.run(&dumped).is(0);
    // The problem has everything in it.
    for name in ["rest.node", "rest.ele", "up.toml"] {
        std::fs::remove_file(folder.0.join(name)).unwrap();
    }
    folder.run("replay p.json --out b.vtu --report b.json --trace b.csv --threads 1 --quiet").is(0);
    assert!(bytes(&folder, "a.vtu") == bytes(&folder, "b.vtu"), "positions, stresses and reactions to the bit");
    let (a, b) = (json(&folder, "a.json"), json(&folder, "b.json"));
    for key in
        ["status", "reason", "iterations", "energy", "gradient_norm", "gradient_ratio", "min_stretch", "reactions"]
    {
        assert_eq!(a[key], b[key], "{key}");
    }
    let trace = |name: &str| -> Vec<String> {
        let drop_seconds =
            |l: &str| l.split(',').enumerate().filter(|(k, _)| *k != 1).map(|(_, v)| v.to_owned()).collect();
        folder.read(name).lines().map(drop_seconds).map(|l: Vec<String>| l.join(",")).collect()
    };
    assert_eq!(trace("a.csv"), trace("b.csv"));
    let other = folder.run("replay p.json --method newton --report c.json");
    assert!(other.is(0).out.starts_with("converged after "), "{other:?}");
    let (e, f) = (a["energy"].as_f64().unwrap(), json(&folder, "c.json")["energy"].as_f64().unwrap());
    assert!((e - f).abs() < 1e-8 * e.abs() && json(&folder, "c.json")["method"] == "newton", "{e} {f}");
    folder.run("replay p.json --max-iters 1 --quiet").is(3);
    let shown = folder.run("replay p.json --show-settings --tol 1e-6");
    let settings: Value = serde_json::from_str(&shown.is(0).out).unwrap();
    assert_eq!((settings["tol"].as_f64(), settings["material"]["young"].as_f64()), (Some(1e-6), Some(12345.678)));
    folder.run("replay p.json --method jelly").is_refused(&["jelly"]);
    folder.run("replay nothing.json").is_refused(&["nothing.json"]);
    folder.run("replay a.json").is_refused(&["a.json", "no problem file"]);
    folder.run("replay p.json --threads 0").is_refused(&["--threads"]);
}

#[test]
fn a_frame_is_solved_again_to_the_same_bits() {
    let folder = Folder::new("replay-frame");
    folder.beam(1).put("s.toml", SCENE);
    let text = folder.read("rest.node").replace("\n3 0 1 1\n", "\n3 0.1 1.05 1\n");
    assert_ne!(text, folder.read("rest.node"));
    folder.put("start.node", &text);
    let run = folder.run("simulate s.toml --out d --dump f.json --quiet");
    assert_eq!(run.status, Some(0), "{run:?}");
    for name in ["rest.node", "rest.ele", "start.node", "s.toml"] {
        std::fs::remove_file(folder.0.join(name)).unwrap();
    }
    folder.run("replay f.json --report r.json --trace t.csv --out last.vtu --preview last.png --threads 1").is(0);
    assert!(bytes(&folder, "last.vtu") == bytes(&folder, "d/cube_0007.vtu"));
    let (mut whole, mut again) =
        (json(&folder, "d/report.json")["frames"][7].clone(), json(&folder, "r.json")["frames"][0].clone());
    for record in [&mut whole, &mut again] {
        record["seconds"] = Value::Null;
    }
    assert_eq!(whole, again);
    assert!(again["contacts"].as_u64().unwrap() > 0 && folder.read("t.csv").lines().count() > 1, "{again}");
    assert!(folder.run("replay f.json --show-settings").is(0).out.contains("integrator = \"bdf2\""));
    folder.run("replay f.json --method admm --max-iters 40 --quiet").is(3);
}

#[test]
fn nothing_is_half_written() {
    let folder = Folder::new("replay-bad");
    folder.beam(1);
    folder
        .run("deform rest.node --init init.node --pins pins.txt --out a.vtu --dump p.txt")
        .is_refused(&["--dump", ".json"]);
    folder
        .run("deform rest.node --init init.node --pins pins.txt --out a.vtu --dump no/p.json")
        .is_refused(&["no/p.json", "no folder"]);
    assert!(!folder.has("a.vtu"));
    // What cannot be solved, too, can be dumped and looked at.
    folder.put("wide.txt", "0 1 2 3 99\n");
    folder.run("deform rest.node --init init.node --pins wide.txt --out a.vtu --dump p.json").is_refused(&["99"]);
    assert!(!folder.has("p.json"));
}

#[test]
fn a_safe_penalty_is_for_what_it_is_proven_for() {
    let folder = Folder::new("safe");
    folder.beam(2).put(
        "near.toml",
        "[groups.foot]\nindices = [0, 1, 2, 3]\n[groups.end]\nindices = [8, 9, 10, 11]\ntranslate = [0.02, 0, 0]\n",
    );
    let common = "deform rest.node --pins near.toml --out a.vtu --report a.json --quiet";
    let solve = format!("{common} --method admm-pd");
    let stvk = format!("{solve} --material stvk --young 1e3 --poisson 0.3");
    folder.run(&format!("{stvk} --penalty safe --max-iters 200 --trace t.csv")).is(3);
    let energy = |row: &str| row.split(',').nth(2).unwrap().parse::<f64>().unwrap();
    let energies: Vec<f64> = folder.read("t.csv").lines().skip(1).map(energy).collect();
    assert!(energies.len() > 200 && energies.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-12)), "{energies:?}");
    assert_eq!(json(&folder, "a.json")["settings"]["admm"]["penalty"], "safe");
    // The plain one is faster by far, and gets to a lower energy.
    folder.run(&stvk).is(0);
    assert!(json(&folder, "a.json")["energy"].as_f64().unwrap() <= energies[energies.len() - 1]);
    folder.run(&format!("{solve} --penalty safe")).is_refused(&["stvk", "--penalty weights"]);
    folder.run(&format!("{common} --penalty safe --method wrapd")).is_refused(&["admm-pd"]);
    folder.run(&format!("{stvk} --penalty safe --density 1 --gravity 0,-1,0")).is_refused(&["gravity"]);
    let scene = SCENE
        .replace("start = \"start.node\"\n", "")
        .replace("neo-hookean", "stvk")
        .replace("frames = 7", "frames = 2");
    folder.put("s.toml", &scene);
    let go = "simulate s.toml --out d --quiet --method admm --max-iters 30 --penalty safe";
    folder.run(go).is_refused(&["solver.penalty", "obstacles"]);
    folder.put("s.toml", &scene.split("[[obstacle]]").next().unwrap().replace("stvk", "arap"));
    folder.run(go).is_refused(&["solver.penalty", "stvk", "body[0]"]);
    folder.put("s.toml", scene.split("[[obstacle]]").next().unwrap());
    let run = folder.run(go);
    assert!(matches!(run.status, Some(0 | 3)), "{run:?}");
    assert!(folder.read("d/scene.toml").contains("penalty = \"safe\""));
}
