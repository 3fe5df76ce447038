//! `proxel wavefront`: pairs made, wavefronts found, and what is refused.

mod common;
use common::Folder;
use proxel::imaging::io::read_image;
use serde_json::Value;

fn report(folder: &Folder) -> Value {
    serde_json::from_str(&folder.read("r.json")).unwrap()
}

fn values(folder: &Folder, name: &str) -> Vec<f64> {
    read_image(&folder.0.join(name)).unwrap().image.channels.remove(0)
}

#[test]
fn a_pair_and_its_wavefront() {
    let folder = Folder::new("wavefront");
    folder.run("wavefront --simulate 128,1,3 --out pair").is(0);
    let known = values(&folder, "pair/phi.npy");
    folder
        .run(
            "wavefront pair/reference.png pair/captured.png --out phi.tif --report r.json --preview p.png --trace t.csv \
             --zernike 6",
        )
        .is(0);
    let found = values(&folder, "phi.tif");
    let norm = |f: &dyn Fn(usize) -> f64| (0..known.len()).map(|k| f(k).powi(2)).sum::<f64>().sqrt();
    let error = norm(&|k| found[k] - known[k]) / norm(&|k| known[k]);
    assert!(error < 0.15, "{error}"); // of so few pixels; 0.03 of 512 x 512
    let r = report(&folder);
    assert_eq!((&r["command"], &r["status"]), (&"wavefront".into(), &"converged".into()));
    assert_eq!((&r["levels"], &r["problems"]), (&2.into(), &6.into()));
    assert_eq!(r["zernike"].as_array().map(Vec::len), Some(6));
    // What the report says holds for the file.
    let (lo, hi) = found.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    assert_eq!((r["phi_min"].as_f64(), r["phi_max"].as_f64()), (Some(lo), Some(hi)));
    assert_eq!(folder.read("t.csv").lines().count() as u64, r["iterations"].as_u64().unwrap() + 1);
    let picture = read_image(&folder.0.join("p.png")).unwrap().image;
    assert!(picture.width > 128 && picture.channels.len() == 3);
    folder.run("wavefront pair/reference.png pair/captured.png --out phi.npy --method aa-z --threads 1 --quiet").is(0);
    let again = values(&folder, "phi.npy");
    assert!(norm(&|k| again[k] - found[k]) < 0.02 * norm(&|k| found[k]), "another method");
    folder
        .run("wavefront pair/reference.png pair/captured.png --out phi.npy --max-iters 1 --method admm --tol 1e-9")
        .is(3);
}

#[test]
fn refusals() {
    let folder = Folder::new("wavefront-refusals");
    folder.run("wavefront --simulate 64,1,0 --out a --quiet").is(0);
    folder.run("wavefront --simulate 32,1,0 --out b --quiet").is(0);
    folder.run("wavefront a/reference.png b/captured.png --out x.npy").is_refused(&["64 x 64 and 32 x 32"]);
    folder.run("wavefront a/reference.png a/captured.png --out x.png").is_refused(&["x.png", ".tif", ".npy"]);
    folder.run("wavefront a/reference.png missing.png --out x.npy").is_refused(&["missing.png", "cannot read"]);
    folder.put("flat.txt", &"1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1\n".repeat(16));
    folder.run("wavefront flat.txt flat.txt --out x.npy").is_refused(&["flat.txt", "1 everywhere"]);
    folder.run("wavefront a/reference.png a/captured.png --out x.npy --mu 0").is_refused(&["--mu is 0"]);
    folder.run("wavefront a/reference.png a/captured.png --out x.npy --zernike 999").is_refused(&["--zernike", "66"]);
    folder.run("wavefront --simulate 64,1 --out c").is_refused(&["--simulate 64,1", "SIZE,MAX_SHIFT,SEED"]);
    folder.run("wavefront --simulate 8,1,0 --out c").is_refused(&["size is 8"]);
    assert!(!folder.has("x.npy") && !folder.has("x.png"));
    folder.run("wavefront --show-settings").is(0);
}
