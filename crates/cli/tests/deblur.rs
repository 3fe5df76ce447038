//! `proxel deblur`, `denoise`, `inpaint`: what they write, and what they refuse.

mod common;
use common::Folder;
use proxel::imaging::io::{Depth, Format, ImageFile, encode, read_image};
use proxel::imaging::{Image, Psf};
use serde_json::Value;

const SIDE: usize = 64;

fn report(folder: &Folder) -> Value {
    serde_json::from_str(&folder.read("r.json")).unwrap()
}

/// Boxes of two greys.
fn boxes(i: usize, j: usize) -> f64 {
    if (i / 16 + j / 20).is_multiple_of(2) { 0.25 } else { 0.75 }
}

/// Numbers in (-1, 1) that look random.
fn noise(k: usize) -> f64 {
    let z = (k as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 27)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn put(folder: &Folder, name: &str, depth: Depth, channels: usize, of: impl Fn(usize, usize, usize) -> f64) {
    let plane = |c: usize| (0..SIDE * SIDE).map(|k| of(c, k / SIDE, k % SIDE)).collect();
    let image = Image::new(SIDE, SIDE, (0..channels).map(plane).collect()).unwrap();
    let path = folder.0.join(name);
    let encoded = encode(&ImageFile::new(image, depth), Format::from_path(&path).unwrap()).unwrap();
    std::fs::write(path, encoded.bytes).unwrap();
}

/// The boxes, and what a camera sees of them through a blur: the scene goes on beyond the border.
fn blurred_boxes(folder: &Folder, channels: usize) {
    let psf = Psf::gaussian(1.2).unwrap();
    let shift = |c: usize| 0.1 * c as f64;
    put(folder, "truth.npy", Depth::F64, channels, |c, i, j| boxes(i + 100, j + 100) + shift(c));
    put(folder, "seen.png", Depth::U16, channels, |c, i, j| {
        let (a, b) = psf.center;
        let sum: f64 = (0..psf.weights.len())
            .map(|k| psf.weights[k] * boxes(i + 100 + a - k / psf.width, j + 100 + b - k % psf.width))
            .sum();
        sum + shift(c) + 0.01 * noise((c * SIDE + i) * SIDE + j)
    });
}

#[test]
fn everything_automatic() {
    let folder = Folder::new("deblur");
    blurred_boxes(&folder, 1);
    folder
        .run(
            "deblur seen.png --psf gaussian:1.2 --tol 1e-4 --truth truth.npy --out x.png --report r.json --trace t.csv --preview p.png",
        )
        .is(0);
    let r = report(&folder);
    assert_eq!((&r["command"], &r["status"]), (&"deblur".into(), &"converged".into()));
    assert_eq!((&r["method"], &r["boundary"]), (&"relaxed".into(), &"unknown".into()));
    // One of them was taken, and the report says which.
    assert!(r["regulariser"] == "tv" || r["regulariser"] == "frame", "{}", r["regulariser"]);
    let number = |key: &str| r[key].as_f64().unwrap_or_else(|| panic!("{key} is {}", r[key]));
    // The noise is uniform in +-.01.
    assert!((number("noise") - 0.01 / 3f64.sqrt()).abs() < 0.002, "{}", r["noise"]);
    assert!(number("relative_gap") <= 1e-4 && number("relative_gap") >= 0.0);
    assert!(number("psnr") > number("psnr_input") + 3.0, "{} from {}", r["psnr"], r["psnr_input"]);
    let (file, seen) = (read_image(&folder.0.join("x.png")).unwrap(), read_image(&folder.0.join("seen.png")).unwrap());
    assert_eq!((file.depth, file.image.width, file.image.height), (seen.depth, SIDE, SIDE));
    let trace = folder.read("t.csv");
    let mut lines = trace.lines();
    assert!(lines.next().unwrap().ends_with(",part,duality_gap,psnr"));
    let last: Vec<f64> = trace.lines().last().unwrap().split(',').filter_map(|v| v.parse().ok()).collect();
    assert!((last[last.len() - 2] - number("duality_gap")).abs() < 1e-9 * number("energy"));
    assert_eq!(trace.lines().count() as u64, number("iterations") as u64 + 2);
    assert!(folder.has("p.png"));
}

#[test]
fn the_same_bits_on_any_number_of_threads_and_no_change_by_a_truth() {
    let folder = Folder::new("deblur-bits");
    blurred_boxes(&folder, 3);
    let common = "deblur seen.png --psf gaussian:1.2 --lambda 300 --quiet --tol 1e-3 --report r.json";
    folder.run(&format!("{common} --threads 1 --out one.npy")).is(0);
    folder.run(&format!("{common} --threads 3 --truth truth.npy --trace t.csv --out three.npy")).is(0);
    // With a lambda A(31) is what is solved.
    assert_eq!(report(&folder)["regulariser"], "tv");
    let bytes = |name: &str| std::fs::read(folder.0.join(name)).unwrap();
    assert!(bytes("one.npy") == bytes("three.npy"));
}

#[test]
fn gaps_are_filled_and_noise_is_taken_out() {
    let folder = Folder::new("inpaint");
    put(&folder, "truth.npy", Depth::F64, 1, |_, i, j| boxes(i, j));
    put(&folder, "gaps.png", Depth::U8, 1, |_, i, j| if (i * 7 + j * 3) % 11 == 0 { 0.0 } else { boxes(i, j) });
    put(&folder, "mask.png", Depth::U8, 1, |_, i, j| f64::from(u8::from((i * 7 + j * 3) % 11 > 0)));
    folder
        .run(
            "inpaint gaps.png --mask mask.png --lambda 500 --tol 1e-4 --truth truth.npy --out x.npy --report r.json --quiet",
        )
        .is(0);
    let r = report(&folder);
    assert!(r["psnr"].as_f64().unwrap() > 35.0, "{}", r["psnr"]);
    put(&folder, "noisy.tif", Depth::F32, 1, |_, i, j| boxes(i, j) + 0.1 * noise(i * SIDE + j));
    folder.run("denoise noisy.tif --tol 1e-4 --truth truth.npy --out y.tif --report r.json --quiet").is(0);
    let r = report(&folder);
    assert!(r["psnr"].as_f64().unwrap() > r["psnr_input"].as_f64().unwrap() + 8.0, "{} {}", r["psnr"], r["psnr_input"]);
}

#[test]
fn a_range_holds() {
    let folder = Folder::new("deblur-range");
    blurred_boxes(&folder, 1);
    let text = "deblur seen.png --psf gaussian:1.2 --lambda 3000 --range 0.3,0.7 --tol 1e-4 --out x.npy --report r.json --quiet";
    folder.run(text).is(0);
    let r = report(&folder);
    assert_eq!((&r["status"], &r["relative_gap"]), (&"converged".into(), &Value::Null));
    let image = read_image(&folder.0.join("x.npy")).unwrap().image;
    let worst = image.channels[0].iter().map(|v| (0.3 - v).max(v - 0.7)).fold(0.0, f64::max);
    assert!(worst <= 1e-6, "{worst}");
}

#[test]
fn an_end_before_convergence_is_told() {
    let folder = Folder::new("deblur-short");
    blurred_boxes(&folder, 1);
    folder.run("deblur seen.png --psf disk:2 --lambda 300 --max-iters 3 --out x.png --report r.json --quiet").is(3);
    assert_eq!(report(&folder)["status"], "stopped");
    assert!(folder.has("x.png"));
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let folder = Folder::new("deblur-bad");
    blurred_boxes(&folder, 1);
    put(&folder, "black.png", Depth::U8, 1, |_, _, _| 0.0);
    put(&folder, "below.npy", Depth::F64, 1, |_, i, j| if (i, j) == (0, 2) { -0.5 } else { 0.5 });
    put(&folder, "colours.png", Depth::U8, 3, |c, _, _| 0.2 * c as f64);
    folder.put("one.txt", "0.5\n");
    folder.put("zero.txt", "1 -1\n");
    folder.put("nan.txt", "1 nan\n");
    folder.put("bad.png", "no image");
    for (words, says) in [
        ("deblur seen.png --psf black.png --out x.png", "sum"),
        ("deblur seen.png --psf zero.txt --out x.png", "sum"),
        ("deblur seen.png --psf nan.txt --out x.png", "nan.txt"),
        ("deblur seen.png --psf colours.png --out x.png", "colours"),
        ("deblur seen.png --psf gaussian --out x.png", "gaussian"),
        ("deblur seen.png --psf gaussian:0 --out x.png", "radius"),
        ("deblur seen.png --psf motion:3 --out x.png", "motion"),
        ("deblur seen.png --psf disk:40 --out x.png", "64 x 64"),
        ("deblur seen.png --psf disk:2 --psf-center 9,0 --out x.png", "centre"),
        ("deblur one.txt --psf disk:2 --out x.png", "1 x 1"),
        ("denoise one.txt --out x.png", "--lambda"),
        ("denoise black.png --out x.png", "noise"),
        ("denoise seen.png --truth one.txt --out x.png", "truth"),
        ("denoise seen.png --lambda -1 --out x.png", "--lambda"),
        ("denoise seen.png --noise none --out x.png", "--noise"),
        ("denoise seen.png --range 1,0 --out x.png", "--range"),
        ("denoise seen.png --out x.jpg", "png"),
        ("denoise bad.png --out x.png", "bad.png"),
        ("denoise seen.png --data cauchy --lambda 9 --out x.png", "poisson"),
        ("denoise seen.png --threshold 0.1 --out x.png", "huber"),
        ("denoise seen.png --data huber --threshold -1 --lambda 9 --out x.png", "--threshold"),
        ("denoise black.png --data huber --lambda 9 --out x.png", "--threshold"),
        ("denoise below.npy --data poisson --lambda 9 --out x.png", "row 0, column 2"),
        ("denoise seen.png --regulariser tgv --boundary neumann --lambda 9 --out x.png", "--boundary unknown"),
        ("denoise seen.png --regulariser tgv --tgv-ratio 0 --out x.png", "--tgv-ratio"),
        ("denoise seen.png --regulariser frame --boundary neumann --lambda 9 --out x.png", "--boundary unknown"),
        ("denoise seen.png --tile 0 --lambda 9 --out x.png", "--tile"),
        ("denoise seen.png --tile all --lambda 9 --out x.png", "--tile"),
        ("denoise seen.png --tile 60 --lambda 9 --out x.png", "--tile"),
        ("denoise seen.png --scale 0 --out x.png", "--scale"),
        ("denoise seen.png --scale 2 --boundary neumann --lambda 9 --out x.png", "--boundary unknown"),
        ("denoise seen.png --scale 9 --out x.png", "--scale"),
        ("denoise seen.png --scale 2 --truth truth.npy --lambda 9 --out x.png", "128 x 128"),
        ("deblur seen.png --psf motion:9,30 --boundary neumann --out x.png", "--boundary unknown"),
        ("inpaint seen.png --mask one.txt --out x.png", "one.txt"),
        ("inpaint seen.png --mask black.png --out x.png", "mask"),
    ] {
        let run = folder.run(words);
        let said = run.is(2);
        assert!(said.err.contains(says), "{words}: {}", said.err);
        assert!(!folder.has("x.png"), "{words}");
    }
}

#[test]
fn an_image_of_one_pixel_or_one_value_is_no_trouble_with_a_lambda() {
    let folder = Folder::new("deblur-one");
    folder.put("one.txt", "0.5\n");
    put(&folder, "black.png", Depth::U8, 1, |_, _, _| 0.0);
    folder.run("denoise one.txt --lambda 10 --out x.npy --quiet").is(0);
    assert!((read_image(&folder.0.join("x.npy")).unwrap().image.channels[0][0] - 0.5).abs() < 1e-3);
    folder.run("deblur black.png --psf disk:2 --lambda 10 --out y.npy --quiet").is(0);
    assert!(read_image(&folder.0.join("y.npy")).unwrap().image.channels[0].iter().all(|v| *v == 0.0));
}

#[test]
fn borders_that_mirror() {
    let folder = Folder::new("deblur-neumann");
    blurred_boxes(&folder, 1);
    let common = "--lambda 300 --tol 1e-4 --quiet --report r.json --truth truth.npy";
    folder.run(&format!("deblur seen.png --psf gaussian:1.2 --boundary neumann {common} --out x.npy")).is(0);
    let r = report(&folder);
    assert_eq!((&r["boundary"], &r["field"]), (&"neumann".into(), &serde_json::json!([SIDE, SIDE])));
    assert!(r["psnr"].as_f64().unwrap() > r["psnr_input"].as_f64().unwrap() + 3.0, "{} {}", r["psnr"], r["psnr_input"]);
    // Without a blur nothing beyond the border counts.
    folder.run(&format!("denoise seen.png {common} --out y.npy")).is(0);
    assert_eq!(report(&folder)["boundary"], "neumann");
}

#[test]
fn counted_light_and_outliers() {
    let folder = Folder::new("deblur-data");
    put(&folder, "truth.npy", Depth::F64, 1, |_, i, j| boxes(i, j));
    // Uniform noise that grows with the root of what is seen, as that of counts does.
    put(&folder, "counts.npy", Depth::F64, 1, |_, i, j| {
        (boxes(i, j) + 0.2 * boxes(i, j).sqrt() * noise(i * SIDE + j)).max(0.0)
    });
    let common = "--truth truth.npy --report r.json --quiet --out x.npy";
    folder.run(&format!("denoise counts.npy --data poisson --tol 1e-4 {common}")).is(0);
    let automatic = report(&folder);
    assert!(automatic["lambdas_tried"].as_u64().unwrap() > 2 && automatic["lambda"].as_f64().unwrap() > 0.0);
    folder.run(&format!("denoise counts.npy --data poisson --lambda 15 --tol 1e-5 {common}")).is(0);
    let r = report(&folder);
    assert_eq!((&r["data"], &r["relative_gap"], &r["threshold"]), (&"poisson".into(), &Value::Null, &Value::Null));
    assert!(r["primal_residual"].as_f64().unwrap() <= 1e-5 && r["dual_residual"].as_f64().unwrap() <= 1e-5);
    assert!(r["psnr"].as_f64().unwrap() > r["psnr_input"].as_f64().unwrap() + 5.0, "{} {}", r["psnr"], r["psnr_input"]);

    put(&folder, "specks.npy", Depth::F64, 1, |_, i, j| {
        if (i * 31 + j * 17) % 23 == 0 { 1.0 } else { boxes(i, j) + 0.02 * noise(i * SIDE + j) }
    });
    let psnr = |options: &str| {
        folder.run(&format!("denoise specks.npy --lambda 30 --tol 1e-4 {options} {common}")).is(0);
        let r = report(&folder);
        assert!(r["relative_gap"].as_f64().unwrap() <= 1e-4);
        r["psnr"].as_f64().unwrap()
    };
    let (huber, squares) = (psnr("--data huber --threshold 0.02"), psnr(""));
    assert!(huber > squares + 10.0, "{huber} and {squares}");
}

#[test]
fn a_larger_image_with_its_alpha() {
    let folder = Folder::new("deblur-scale");
    let plane =
        |of: &dyn Fn(usize, usize) -> f64| (0..SIDE * SIDE).map(|k| of(k / SIDE, k % SIDE)).collect::<Vec<f64>>();
    let image = Image::new(SIDE, SIDE, vec![plane(&boxes); 3]).unwrap();
    let mut file = ImageFile::new(image, Depth::U8);
    file.alpha = Some(plane(&|i, j| f64::from(u8::from(i > j))));
    std::fs::write(folder.0.join("small.png"), encode(&file, Format::Png).unwrap().bytes).unwrap();
    folder
        .run("deblur small.png --psf gaussian:0.8 --scale 2 --lambda 500 --tol 1e-2 --out large.png --report r.json --preview p.png --quiet")
        .is(0);
    let large = read_image(&folder.0.join("large.png")).unwrap();
    assert_eq!((large.image.width, large.image.height, large.image.channels.len()), (2 * SIDE, 2 * SIDE, 3));
    let alpha = large.alpha.unwrap();
    assert!((0..4 * SIDE * SIDE).all(|k| alpha[k] == f64::from(u8::from(k / (2 * SIDE) / 2 > k % (2 * SIDE) / 2))));
    assert_eq!(report(&folder)["scale"], 2);
    assert!(folder.has("p.png"));
}

#[test]
fn ramps_by_generalised_variation() {
    let folder = Folder::new("deblur-tgv");
    let ramp = |i: usize, j: usize| 0.008 * j as f64 + if i > 20 && i < 40 { 0.3 } else { 0.1 };
    put(&folder, "truth.npy", Depth::F64, 1, |_, i, j| ramp(i, j));
    put(&folder, "seen.npy", Depth::F64, 1, |_, i, j| ramp(i, j) + 0.05 * noise(i * SIDE + j));
    let psnr = |name: &str| {
        let text = format!(
            "denoise seen.npy --regulariser {name} --lambda 12 --tol 1e-3 --truth truth.npy --out x.npy --report r.json --quiet"
        );
        folder.run(&text).is(0);
        let r = report(&folder);
        assert_eq!(r["regulariser"], name);
        assert!(r["relative_gap"].as_f64().unwrap() <= 1e-3);
        r["psnr"].as_f64().unwrap()
    };
    let (tv, tgv) = (psnr("tv"), psnr("tgv"));
    assert!(tgv > tv + 1.0, "{tgv} and {tv}");
}
