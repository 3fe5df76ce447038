//! `proxel info`, `proxel convert`, `proxel demo`, `proxel --version`.

mod common;
use common::Folder;

#[test]
fn version_and_help() {
    let folder = Folder::new("version");
    let run = folder.run("--version");
    assert_eq!(run.is(0).out, format!("proxel {}\n", env!("CARGO_PKG_VERSION")));
    for words in ["--help", "deform --help", "demo --help", "info --help", "convert --help"] {
        let run = folder.run(words);
        assert!(run.is(0).out.contains("Usage: proxel"), "{run:?}");
    }
    assert_eq!(folder.run("").status, Some(2));
}

#[test]
fn info_says_what_is_there_and_what_is_wrong() {
    let folder = Folder::new("info");
    folder.beam(2);
    let run = folder.run("info rest.node");
    run.is(0);
    for part in ["vertices       12", "tetrahedra     12", "volume         2.0", "problems       none"] {
        assert!(run.out.contains(part), "`{part}` is not in\n{}", run.out);
    }
    folder.turn_first();
    let run = folder.run("info rest.node");
    run.is_refused(&["tetrahedron 0", "volume is negative"]);
    assert!(run.out.contains("vertices       12"), "the rest is told all the same");
    folder.run("info no.obj").is_refused(&["no.obj", "no such file"]);
}

#[test]
fn convert_keeps_every_bit() {
    let folder = Folder::new("round");
    folder.beam(2);
    let precise = folder.read("rest.node").replacen("5 1 1 0", "5 0.1 1.0000000000000002 3e-17", 1);
    folder.write("rest.node", &precise);
    let chain = ["rest.node", "a.mesh", "b.msh", "c.vtk", "d.vtu", "back.node"];
    for pair in chain.windows(2) {
        folder.run(&format!("convert {} --out {}", pair[0], pair[1])).is(0);
    }
    let numbers = |name: &str| -> Vec<Vec<f64>> {
        let text = folder.read(name);
        text.lines().map(|l| l.split_whitespace().map(|w| w.parse().unwrap()).collect()).collect()
    };
    assert_eq!(numbers("rest.node")[1..], numbers("back.node")[1..]);
    assert_eq!(numbers("rest.ele")[1..], numbers("back.ele")[1..]);
    let run = folder.run("convert rest.node --out surface.obj");
    assert!(run.is(0).err.contains("does not carry tetrahedra"), "{run:?}");
    assert_eq!(folder.run("convert rest.node --out p.npy --quiet").is(0).out, "");
    folder.run("convert p.npy --out p.node").is(0);
    assert_eq!(numbers("rest.node")[1..], numbers("p.node")[1..]);
    assert!(!folder.has("p.ele"));
}

#[test]
fn refinement_takes_start_and_pins_along() {
    let folder = Folder::new("refine");
    folder.beam(2);
    let words = "convert rest.node --out fine.node --refine 2 --init init.node --init-out fine-init.node --pins pins.txt --pins-out fine.txt";
    folder.run(words).is(0);
    let count = |name: &str| -> usize { folder.read(name).split_whitespace().next().unwrap().parse().unwrap() };
    assert_eq!((count("fine.ele"), count("fine-init.node")), (12 * 64, count("fine.node")));
    assert!(!folder.has("fine-init.ele"));
    // The left side is a square of 4 x 4 cells now.
    let pins: Vec<usize> = folder.read("fine.txt").split_whitespace().map(|w| w.parse().unwrap()).collect();
    assert_eq!(pins.len(), 25);
    let text = folder.read("fine.node");
    let x = |v: usize| -> f64 { text.lines().nth(1 + v).unwrap().split_whitespace().nth(1).unwrap().parse().unwrap() };
    assert!(pins.iter().all(|&v| x(v) == 0.0));
    folder.run("deform fine.node --init fine-init.node --pins fine.txt --out out.vtu").is(0);
}

#[test]
fn convert_refuses_in_one_line() {
    let folder = Folder::new("convert-bad");
    folder.beam(2);
    let before = folder.names();
    folder.run("convert rest.node --out out.xyz").is_refused(&["out.xyz", "unknown extension"]);
    folder.run("convert rest.node --out no/out.vtu").is_refused(&["no/out.vtu", "no folder"]);
    folder.run("convert rest.node --out out.vtu --init init.node").is_refused(&["--init-out"]);
    let pins = "convert rest.node --out out.vtu --refine 1 --pins pins.txt --pins-out fine.toml";
    folder.run(pins).is_refused(&["fine.toml", "list"]);
    folder.run("convert pins.txt --out out.vtu").is_refused(&["pins.txt"]);
    assert_eq!(folder.names(), before);
}

#[test]
fn orientation_is_turned() {
    let folder = Folder::new("turn");
    folder.beam(2);
    folder.turn_first();
    let run = folder.run("convert rest.node --out good.mesh --fix-orientation");
    assert!(run.is(0).out.starts_with("turned 1 tetrahedra\n"), "{run:?}");
    folder.run("info good.mesh").is(0);
}
