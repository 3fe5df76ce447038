//! Images in parts: as the whole, under every border, and honest about what was not reached.

use proxel::imaging::{Fourier, Grid, Image, Psf, convolve};
use proxel::restore::{Hooks, Input, RestoreRow, Restored, restore};
use proxel::settings::{BoundaryName, DataName, RestoreSettings};
use proxel::split::Status;
use std::sync::atomic::Ordering;

const W: usize = 380;
const H: usize = 240;

/// Numbers in (-1, 1) that look random.
fn noise(k: usize) -> f64 {
    let z = (k as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 27)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// Pictures with values from 0 to 1: boxes, discs on a ramp, waves.
fn picture(name: &str, i: usize, j: usize) -> f64 {
    let (y, x) = (i as f64, j as f64);
    match name {
        "boxes" => [0.2, 0.8][(i / 24 + j / 31) % 2],
        "discs" => {
            let (dy, dx) = (y % 60.0 - 30.0, x % 76.0 - 38.0);
            if dy.hypot(dx) < 20.0 { 0.9 } else { 0.2 + 0.5 * x / W as f64 }
        }
        _ => 0.5 + 0.3 * (0.21 * x + 0.1 * y).sin() + 0.2 * (0.7 * y).cos() * (0.3 * x).sin(),
    }
}

/// Blurred around the end, with noise.
fn seen(name: &str, psf: &Psf) -> Image {
    let truth: Vec<f64> = (0..W * H).map(|k| picture(name, k / W, k % W)).collect();
    let fourier = Fourier::new(W, H);
    let mut blurred = vec![0.0; W * H];
    convolve(Grid::new(W, H), &fourier, &psf.spectrum(&fourier), false, &truth, &mut blurred);
    blurred.iter_mut().enumerate().for_each(|(k, v)| *v += 0.01 * noise(k));
    Image::new(W, H, vec![blurred]).unwrap()
}

fn run(image: &Image, psf: &Psf, mask: Option<&[f64]>, settings: &RestoreSettings, hooks: &mut Hooks<'_>) -> Restored {
    let input = Input { command: "deblur", image, psf: psf.clone(), mask, truth: None };
    restore(&input, settings, hooks).unwrap()
}

fn settings(boundary: BoundaryName, tile: Option<usize>) -> RestoreSettings {
    RestoreSettings { boundary, tile, lambda: Some(400.0), tol: 1e-5, ..RestoreSettings::default() }
}

#[test]
fn parts_make_the_whole_under_every_border() {
    let psf = Psf::gaussian(1.2).unwrap();
    let cases = [("boxes", BoundaryName::Unknown), ("discs", BoundaryName::Periodic), ("boxes", BoundaryName::Neumann)];
    for (name, boundary) in cases {
        let image = seen(name, &psf);
        let of = |tile| run(&image, &psf, None, &settings(boundary, tile), &mut Hooks::default());
        let (whole, parts) = (of(None), of(Some(332)));
        let (a, b) = (whole.report.restore.unwrap(), parts.report.restore.unwrap());
        assert_eq!((a.tiles, a.boundary == b.boundary, parts.status), (0, true, Status::Converged));
        assert!(b.tiles == if boundary == BoundaryName::Periodic { 6 } else { 2 }, "{}", b.tiles);
        assert!(b.relative_gap.unwrap() <= 1e-5 && parts.report.energy.is_none(), "{b:?}");
        let off = whole.image.channels[0].iter().zip(&parts.image.channels[0]).map(|(a, b)| (a - b).abs());
        let worst = off.fold(0.0, f64::max);
        println!("{name}, {boundary:?}: {worst:e}");
        // Of a range of 1.
        assert!(worst < 1e-3, "{name}, {boundary:?}: {worst}");
    }
}

#[test]
fn without_a_blur_with_gaps_and_in_colours() {
    let image = seen("discs", &Psf::identity());
    let other = image.channels[0].iter().map(|v| 1.0 - v).collect();
    let image = Image::new(W, H, vec![image.channels[0].clone(), other]).unwrap();
    let mask: Vec<f64> = (0..W * H).map(|k| f64::from(u8::from(noise(k + 7) < 0.4))).collect();
    let of = |tile| {
        let settings = RestoreSettings { lambda: Some(60.0), ..settings(BoundaryName::Auto, tile) };
        run(&image, &Psf::identity(), Some(&mask), &settings, &mut Hooks::default())
    };
    let (whole, parts) = (of(None), of(Some(300)));
    assert_eq!((parts.status, parts.report.restore.unwrap().tiles), (Status::Converged, 2));
    for (a, b) in whole.image.channels.iter().zip(&parts.image.channels) {
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{worst:e}");
        assert!(worst < 1e-3, "{worst}");
    }
}

/// What was not reached is what was seen, and the run says so; rows of the trace say which part they are about.
#[test]
fn parts_that_were_not_reached_are_as_they_were_seen() {
    let psf = Psf::gaussian(1.2).unwrap();
    let image = seen("boxes", &psf);
    let settings = RestoreSettings { max_iters: 20, ..settings(BoundaryName::Periodic, Some(332)) };
    let mut hooks = Hooks::default();
    let cancel = hooks.cancel.clone();
    let mut rows = Vec::new();
    let mut on_row = |row: &RestoreRow| {
        rows.push((row.part, row.row.iteration));
        if row.part == 1 && row.row.iteration == 3 {
            cancel.store(true, Ordering::Relaxed);
        }
    };
    hooks.trace = Some(&mut on_row);
    let found = run(&image, &psf, None, &settings, &mut hooks);
    drop(hooks);
    let tiles = found.report.restore.as_ref().unwrap().tiles;
    assert_eq!((tiles, found.report.iterations), (6, 23));
    // The first part stopped, which the user has not asked for; he did so in the second.
    assert_eq!(found.status, Status::Cancelled, "{}", found.report.reason);
    assert!(found.report.reason.contains("0 of 6 parts converged, 4 are as they were seen"), "{}", found.report.reason);
    let expected: Vec<(usize, usize)> = (0..=20).map(|k| (0, k)).chain((0..=3).map(|k| (1, k))).collect();
    assert_eq!(rows, expected);
    let last = W * H - 1;
    assert_eq!(found.image.channels[0][last], image.channels[0][last]);
    assert!(found.report.restore.unwrap().relative_gap.is_none());
}

#[test]
fn what_cannot_be_cut_is_refused() {
    let psf = Psf::gaussian(1.2).unwrap();
    let image = seen("boxes", &psf);
    let refused = |mask: Option<&[f64]>, settings: RestoreSettings| {
        let settings = RestoreSettings { max_iters: 3, ..settings };
        let input = Input { command: "deblur", image: &image, psf: psf.clone(), mask, truth: None };
        restore(&input, &settings, &mut Hooks::default()).unwrap_err().0
    };
    assert!(refused(None, settings(BoundaryName::Unknown, Some(200))).contains("--tile"));
    let left: Vec<f64> = (0..W * H).map(|k| f64::from(u8::from(k % W < 50))).collect();
    assert!(refused(Some(&left), settings(BoundaryName::Unknown, Some(332))).contains("larger --tile"));
}

/// Parts have the bits of one thread, and other data go with them.
#[test]
fn other_data_and_threads() {
    let psf = Psf::gaussian(1.2).unwrap();
    let image = seen("waves", &psf);
    let of = |threads| {
        let data = DataName::Huber;
        let settings = RestoreSettings {
            data,
            threads: Some(threads),
            max_iters: 30,
            ..settings(BoundaryName::Periodic, Some(332))
        };
        run(&image, &psf, None, &settings, &mut Hooks::default())
    };
    let (one, two) = (of(1), of(2));
    assert_eq!((one.status, one.image.channels == two.image.channels), (Status::Stopped, true));
}
