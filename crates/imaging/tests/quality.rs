//! What restorations reach on real images, where they are at hand.

use proxel_imaging::io::read_image;
use proxel_imaging::restore::{Edges, Iteration, Model, RiskSettings, choose_lambda, duality_gap, noise_level, psnr};
use proxel_imaging::{Image, Psf};
use std::path::PathBuf;

fn folder() -> Option<PathBuf> {
    Some(PathBuf::from(std::env::var_os("PROXEL_DATA")?).join("imaging")).filter(|f| f.join("camera.png").exists())
}

fn solve(model: &Model, iterations: usize) -> (Vec<Vec<f64>>, f64) {
    let built = model.build(None).expect("a model");
    let field = built.field.clone();
    let mut method = built.method("tv", Iteration::Admm { relaxation: 1.8 }).expect("a method");
    for _ in 0..iterations {
        method.step().expect("a step");
    }
    let gap = duality_gap(&mut *method, &field).expect("no hard sets").relative();
    (field.image(method.x()), gap)
}

/// Not a test of figures: prints how lambda by risk compares with the best one. `cargo test --release -- --ignored`.
#[test]
#[ignore = "a survey that takes minutes"]
fn survey() {
    let Some(folder) = folder() else { return };
    let mut seed = proxel_testkit::SplitMix::new(3);
    let wanted = std::env::var("SURVEY").unwrap_or_default();
    let iterations: usize = 120;
    for name in
        ["camera", "brick", "grass", "gravel", "coffee"].into_iter().filter(|n| wanted.is_empty() || wanted.contains(n))
    {
        let truth = read_image(&folder.join(format!("{name}.png"))).expect("an image").image;
        let snake = read_image(&folder.join("snake15.txt")).expect("a matrix").image;
        let snake = Psf::new(15, 15, snake.channels[0].clone(), None).expect("a kernel");
        let blurs = [
            ("snake15", snake),
            ("gaussian:1.6", Psf::gaussian(1.6).expect("ok")),
            ("disk:4", Psf::disk(4.0).expect("ok")),
        ];
        for (blur, psf) in blurs {
            // Blurred with a periodic boundary, then what lies within the reach of the border is cut off.
            let field = proxel_imaging::restore::Field::new(
                truth.width,
                truth.height,
                truth.channels.len(),
                &psf,
                Edges::Periodic,
            );
            let (w, h) = (truth.width, truth.height);
            let (cut_w, cut_h) = (w - 2 * (psf.width / 2), h - 2 * (psf.height / 2));
            let crop = |plane: &[f64]| -> Vec<f64> {
                (0..cut_h).flat_map(|i| plane[(i + psf.height / 2) * w + psf.width / 2..][..cut_w].to_vec()).collect()
            };
            let mut seen = Vec::new();
            for plane in &truth.channels {
                let mut out = vec![0.0; w * h];
                let grid = proxel_imaging::Grid::new(w, h);
                proxel_imaging::convolve(grid, &field.fourier, &field.kernel, false, plane, &mut out);
                out.iter_mut().for_each(|v| *v += 0.01 * seed.normal());
                seen.push(crop(&out));
            }
            let truth: Vec<Vec<f64>> = truth.channels.iter().map(|p| crop(p)).collect();
            let noise = noise_level(cut_w, cut_h, &seen).expect("large enough");
            let image = Image::new(cut_w, cut_h, seen).expect("an image");
            let model = Model::new(&image, psf, Edges::Unknown, 100.0);
            let began = std::time::Instant::now();
            let risks = choose_lambda(&model, noise, &RiskSettings::default(), &mut || false).expect("a lambda");
            let seconds = began.elapsed().as_secs_f64();
            let lambda = risks.last().expect("one").lambda;
            let mut line =
                format!("{name} {blur}: noise {noise:.4}, lambda {lambda:.0} after {} ({seconds:.1} s);", risks.len());
            for k in -3..=3 {
                let model = Model { lambda: lambda * 2f64.powi(k), ..model.clone() };
                let (x, gap) = solve(&model, iterations);
                line += &format!(" {:.0}: {:.2} dB ({gap:.0e})", model.lambda, psnr(&x, &truth));
            }
            eprintln!("{line}");
            if name == "camera" {
                eprintln!("{risks:?}");
            }
        }
    }
}
